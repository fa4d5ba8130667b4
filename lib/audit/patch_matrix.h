/* Form factors between whole patch-sides, summed from a struct ff. */
#ifndef TWOPASS_PATCH_MATRIX_H
#define TWOPASS_PATCH_MATRIX_H

#include "lib/data/ff_check.h"

/* Rows and columns are the modelled patch-sides in ascending order. */
struct patch_matrix {
	const struct ff *f;
	size_t sides;             /* modelled patch-sides: the matrix is sides x sides */
	uint32_t *side;           /* [sides] patch-side */
	uint32_t *row;            /* [sides] row of f that says how it emits (diffuse, or
	                             else the emission lobe), or FF_NO_ROW */
	uint32_t *place;          /* [2E], or [2P] if f is to patches: what a
	                             column of f adds to */
	int unmodelled;           /* 1: some row's flux meets black backs */
};

/* f and s must have passed ff_check. 0, or -1 and e. O(rows + elements + patches). */
int ff_patch_matrix_init(struct patch_matrix *pm, const struct ff *f, const struct ff_scene *s,
                         struct err *e);
void ff_patch_matrix_free(struct patch_matrix *pm);

/* What leaves side[i], by where it first lands: out[sides], then the fractions that
 * meet black backs and that leave the scene. They sum to 1. NaN throughout if there
 * is no row. O(sides + entries of the row). */
void ff_patch_matrix_row(const struct patch_matrix *pm, size_t i, double *out,
                         double *unmodelled, double *escape);

#endif
