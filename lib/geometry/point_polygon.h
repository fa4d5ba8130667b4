/* Convex polygons as an eye, which is any point, sees them: corners are relative to it, by
 * coordinate, as vector code likes them. */
#ifndef TWOPASS_POINT_POLYGON_H
#define TWOPASS_POINT_POLYGON_H

#include "lib/base/vec.h"

/* The most corners: a facet's 16, and as each plane that cuts a convex polygon gives it one more
 * at most, 64 cuts. A guess; whoever cuts stops when there is no room. */
enum { POINT_POLYGON_CORNERS = 80 };

struct point_polygon {
	int n;
	/* The first corner stands again behind the last, to the end of that vector and one
	 * beyond. */
	double x[POINT_POLYGON_CORNERS + 8], y[POINT_POLYGON_CORNERS + 8];
	double z[POINT_POLYGON_CORNERS + 8];
};

/* n (at most POINT_POLYGON_CORNERS) corners v [n][3] as seen from x. */
void geo_point_polygon_make(struct point_polygon *p, const double x[3], int n, const double *v);

/* The part of p in front of a plane through the eye into `in`, the rest into `away`; heights
 * up to `zero` are on the plane. Both have room for the corners of p and one more. n is 0
 * where less than a triangle is left. */
void geo_point_polygon_cut(const struct point_polygon *p, const double normal[3], double zero,
                           struct point_polygon *in, struct point_polygon *away);

/* Fraction of what a Lambertian surface element at the eye with unit normal n emits that
 * reaches the polygon (Lambert 1760; Baum, Rushmeier & Winget, SIGGRAPH 1989): the sum
 * over edges of angle times n . edge plane / 2 pi. All of it is in front of the element;
 * positive where it runs counter-clockwise seen from the eye. */
double geo_point_polygon_factor(const struct point_polygon *p, const double normal[3]);

#endif
