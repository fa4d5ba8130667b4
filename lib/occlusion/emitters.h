/* The emitters of a model as few convex polygons: its emitting triangles of one material
 * and side, merged where they continue one another in a plane. */
#ifndef TWOPASS_EMITTERS_H
#define TWOPASS_EMITTERS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"
#include "lib/geometry/facet.h"

struct emitter {
	struct facet f;               /* its front sends; corners relative to occ_facet_centre() */
	const double *radiance;       /* [bands] along the normal */
	double exponent;              /* m of L cos^(m-1) */
	double power;                 /* mean over bands of radiance, times area */
};

struct emitters {
	size_t n;
	struct emitter *emitter;
	double *corner;
};

/* m must outlive it. O(materials that emit x triangles). 0, or -1 and e; to be freed in
 * any case. */
int occ_emitters_init(struct emitters *s, const struct model *m, struct err *e);
void occ_emitters_free(struct emitters *s);

#endif
