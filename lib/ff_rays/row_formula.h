/* Factors from plane patch-sides to element-sides by formula (for lib/ff). */
#ifndef TWOPASS_ROW_FORMULA_H
#define TWOPASS_ROW_FORMULA_H

#include "lib/occlusion/exchange.h"

struct ff_formula {
	int on;                   /* anything is computed by formula */
	int all;                  /* of all plane patch-sides, not only of emitters */
	struct facet_set sources, receivers; /* patch-sides, element-sides */
	struct occluder_set occluders;
	double centre[3];
};

/* O(n log n). 0, or -1 and e. */
int ff_formula_init(struct ff_formula *f, const struct model *m, int all, struct err *e);
void ff_formula_free(struct ff_formula *f);

/* 1 if the patch-side is made of facets. */
static inline int ff_formula_has(const struct ff_formula *f, uint32_t patch_side)
{
	return f->on && f->sources.start[patch_side + 1] > f->sources.start[patch_side];
}

/* Exchange area of a patch-side and an element-side, m^2, and its error. 1, or 0 where so
 * much stands between that samples do better. NaN and e when memory is short. */
int ff_formula_exchange(struct exchanger *x, const struct ff_formula *f, uint32_t source,
                        uint32_t column, double *area, double *error, struct err *e);

#endif
