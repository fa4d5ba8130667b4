/* Irradiance at the corners of elements, for smooth interpolation over surfaces.
 *
 * The elements about a vertex that belong to one surface and are joined by edges
 * flatter than the crease angle form a smooth group. Its value at the vertex is
 * that of a linear function fitted by area-weighted least squares to the means of
 * the elements around, so constants and linear fields come out exactly, at the
 * borders of a surface too. Where the elements about the vertex do not fix such a
 * function (borders, corners), rings of neighbours inside the group are added;
 * where nothing does, the area-weighted mean stands in. The value may leave the
 * range of the elements about the vertex only as far as the fit is good, and never
 * drops below 0; where all of them are 0 it is 0.
 *
 * Where a wider fit agrees with the elements within their standard errors, it
 * replaces the narrow one: noise is smoothed, detail is not. The mean over a surface
 * stays what it was, but for what the limits above forbid. */
#ifndef TWOPASS_RECONSTRUCT_H
#define TWOPASS_RECONSTRUCT_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"

struct solution;

struct reconstruction {
	size_t elements;
	int bands;
	float *corner;  /* [elements][3][2 sides][bands] */
};

/* Which parts of H are summed. */
enum { PART_DIRECT = 1, PART_CAUSTIC = 2, PART_INDIRECT = 4, PART_ALL = 7 };

/* Interpolates the sum of the parts of a mask. The arrays of s->error, of the sum of
 * all, stand for those of any; they may be NULL (exact values). Light groups are summed.
 * O(elements), the same result for any number of threads. 0, or -1 and e. */
int interp_reconstruct(const struct model *m, const struct solution *s, unsigned parts, int threads,
                       struct reconstruction *r, struct err *e);
void interp_reconstruction_free(struct reconstruction *r);

/* H of one side at the point of `element` with corner weights w, into h[bands]. */
static inline void interp_reconstruction_at(const struct reconstruction *r, size_t element,
                                            int side, const double w[3], double *h)
{
	size_t bands = (size_t)r->bands, n = 2 * bands;
	const float *c = r->corner + 3 * n * element + (size_t)side * bands;

	for (size_t i = 0; i < bands; i++) {
		double v = w[0] * (double)c[i] + w[1] * (double)c[n + i] +
		           w[2] * (double)c[2 * n + i];
		h[i] = v > 0 ? v : 0; /* weights may be negative by rounding */
	}
}

#endif
