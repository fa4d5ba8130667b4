/* What a row by formula leaves over, by rays: curved receivers, what escapes, what meets
 * black backs (private to lib/ff). */
#ifndef TWOPASS_ROW_REMAINDER_H
#define TWOPASS_ROW_REMAINDER_H

#include "lib/ff_rays/ff_internal.h"

/* Landings of rays of a patch-side. */
struct ff_rest {
	uint32_t (*landed)[FF_REPLICATES]; /* [2P] on patch-sides, by replicate */
	uint32_t escaped, black;
	double rays;              /* cast in all since the beginning */
};

int ff_remainder_init(struct ff_rest *r, const struct ff_job *j, struct err *e);
void ff_remainder_free(struct ff_rest *r);

/* Casts `count` Lambertian rays (a multiple of FF_REPLICATES) from a patch-side; what was
 * there before is forgotten. O(patches + count log triangles). */
void ff_remainder_cast(struct ff_rest *r, const struct ff_job *j, uint32_t patch_side, uint32_t count);

/* Rays that landed on a patch-side, and the variance of that number, from the spread of
 * the replicates. */
double ff_remainder_landed(const struct ff_rest *r, uint32_t patch_side);
double ff_remainder_variance(const struct ff_rest *r, uint32_t patch_side);

#endif
