/* Points that are one, found through a grid of cells a few tolerances wide. */
#ifndef TWOPASS_WELD_H
#define TWOPASS_WELD_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"

/* Finds points that are one. Points of different groups never are;
 * points of a group are when they lie within tolerance[group] of each other,
 * unless that would collapse one of the triangles, whose corners then need
 * bitwise equality. */
struct weld {
	size_t points;
	const double *at;         /* [points][3] */
	const uint32_t *group;    /* [points] */
	size_t groups;
	const double *tolerance;  /* [groups] */
	size_t triangles;
	const uint32_t *triangle; /* [triangles][3] */
};

/* Numbers the distinct points in order of their first member: id[points] and
 * *count of them. O(points + triangles). */
int geo_weld_points(const struct weld *w, uint32_t *id, size_t *count, struct err *e);

/* The distance below which points of a box are one: 1e-9 of its diagonal (far
 * below the spacing of float32, far above the rounding of a transform) and no
 * less than that rounding where the coordinates are large. The 1e-9 is a guess in between. */
double geo_weld_tolerance(const double lo[3], const double hi[3]);

#endif
