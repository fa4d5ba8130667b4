/* What elements see: the other way to a form factor (private to lib/ff). */
#ifndef TWOPASS_ROW_RECIPROCAL_H
#define TWOPASS_ROW_RECIPROCAL_H

#include "lib/base/parallel.h"
#include "lib/ff_rays/ff_internal.h"

/* Casts ff_reciprocal_rays rays from every element-side that is modelled and no ideal mirror or
 * pane, jointly stratified over its area and hemisphere, into j->reciprocal; adds to *rays.
 * Memory: 16 bytes for every pair of an element-side and a patch-side that it sees.
 * O(element-sides x rays x log triangles). 0, or -1 and e. */
int ff_reciprocal_cast(struct ff_job *j, uint32_t begin, uint32_t end, double *rays,
                       const struct progress *progress, struct err *e);
void ff_reciprocal_free(struct ff_reciprocal *g);

/* 1 if the row of a patch-side needs no rays of its own. */
int ff_row_is_reciprocal(const struct ff_job *j, uint32_t patch_side);

/* What a row's weights are counted in. */
struct ff_weight {
	uint32_t samples;         /* independent ones that the row is worth */
	double total;
};

/* Lets what was gathered, or seen, decide where the light of patch-side ps lands: of what
 * the `cast` rays of its own, tallied already, brought to elements that know better, or
 * (cast = 0) of all that neither escapes nor meets a black side. 1 if it did, else the
 * tally is left alone. */
int ff_combine_estimates(struct ff_thread *t, uint32_t ps, uint32_t cast, struct ff_weight *w);

#endif
