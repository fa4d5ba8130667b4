/* Form factors of polygons at a distance from one another: cubature of the kernel
 * cos cos / (pi r^2) over both. All terms are positive, so the result keeps its relative
 * accuracy however small it is. */
#ifndef TWOPASS_CUBATURE_H
#define TWOPASS_CUBATURE_H

#include <stddef.h>

#include "lib/geometry/facet.h"

enum { CUBATURE_LEVELS = 4 };

/* Points of a facet at one level, by coordinate; n is a multiple of four, with points of
 * weight 0 at the end. Weights sum to the facet's area. */
struct cubature {
	int n;
	double *x, *y, *z, *w;
};

/* Points that a facet of `corners` corners has at a level: 4, 8, 16 or 36 for each of
 * the triangle or the quadrilaterals it is cut into. */
int geo_cubature_points(int corners, int level);

/* Fills c (room for geo_cubature_points doubles in each array) for a facet.
 * Levels 0, 2, 3: products of 2, 4, 6 Gauss-Legendre points on a bilinear map, but 3
 * points of degree 2 on a triangle at level 0; level 1: Radon's 7 points of degree 5
 * (triangles; quadrilaterals). Stroud 1971. */
void geo_cubature_fill(const struct facet *f, int level, struct cubature *c);

/* Exchange area, m^2, of two facets in front of one another. O(points a x points b). */
double geo_cubature_exchange(const struct facet *a, const struct cubature *ca,
                             const struct facet *b, const struct cubature *cb);

/* reach[l]: a facet of radius r may be represented by its points of level l, with a
 * relative error below `tolerance`, for another whose nearest corner may be at a
 * distance of reach[l] r from its centre. Level 0: quadrilaterals only. */
void geo_cubature_reach(double tolerance, double reach[CUBATURE_LEVELS]);

#endif
