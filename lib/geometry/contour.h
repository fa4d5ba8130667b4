/* Form factors of polygons by Lambert's formula and by contour integrals: exact to
 * rounding for near and touching polygons. For far ones the terms cancel: see
 * cubature.h. */
#ifndef TWOPASS_CONTOUR_H
#define TWOPASS_CONTOUR_H

#include "lib/geometry/facet.h"

/* Form factor from a surface element at x with a unit normal to a polygon with nothing
 * between: see geo_point_polygon_factor(). v: [n][3]. */
double geo_contour_point(const double x[3], const double normal[3], int n, const double *v);

/* Exchange area A_p F_pq = A_q F_qp, m^2, of two convex facets that lie in front of
 * one another with nothing between, as (1 / 2 pi) times the double contour integral of
 * ln r (Stokes; Sparrow 1963). Pairs of edges that are parallel or share a corner are
 * integrated in closed form, others by adaptive Gauss-Kronrod quadrature of the closed
 * inner integral. Absolute error about 1e-15 times the product of the perimeters.
 * O(corners p x corners q). */
double geo_contour_exchange(const struct facet *p, const struct facet *q);

#endif
