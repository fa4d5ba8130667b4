/* Facets: convex planar polygons that shoot light from, and receive it on, their front.
 * A planar patch-side is one facet, or several where its outline is not convex or has many
 * corners. */
#ifndef TWOPASS_FACET_H
#define TWOPASS_FACET_H

#include <stddef.h>

/* The most corners that a facet may have; polygons with more are cut into several. 16 is a guess:
 * quadrilaterals, cut by a dozen planes, fit, and scratch arrays stay small. */
enum { FACET_CORNERS = 16 };

struct facet {
	int n;                /* corners */
	const double *v;      /* [n][3] counter-clockwise seen from the front */
	double normal[3];     /* unit, to the front */
	double offset;        /* normal . x on the plane */
	double centre[3];     /* of the corners */
	double radius;        /* of the sphere about centre that holds the corners */
	double area;
};

/* A facet with room for its own corners, as clipping makes it. */
struct facet_room {
	struct facet f;
	double corner[FACET_CORNERS * 3];
};

/* Fills all but n and v from the corners; the plane is the mean one (Newell). */
void geo_facet_measure(struct facet *f);

/* Signed distances of the corners of f from a plane, the lowest and the highest. */
void geo_facet_heights(const struct facet *f, const double normal[3], double offset,
                       double *lowest, double *highest);

/* The part of f in front of a plane (normal . x >= offset) into `out`; its plane stays
 * f's. 1, or 0 if nothing is left. f may be out->f. */
int geo_facet_clip(const struct facet *f, const double normal[3], double offset,
                   struct facet_room *out);

/* The parts of f in front of and behind a plane. 0 if one has too many corners or no area. */
int geo_facet_split(const struct facet *f, const double normal[3], double offset,
                    struct facet_room part[2]);

/* Splits f through its centre across its longest edge, into halves, or both across and
 * along it, into quarters; or into parts like quarters, the cuts shifted from the centre by
 * parts of its length and width. 0 as above. */
int geo_facet_halve(const struct facet *f, struct facet_room half[2]);
int geo_facet_quarter(const struct facet *f, struct facet_room quarter[4]);
int geo_facet_quarter_off(const struct facet *f, const double shift[2],
                          struct facet_room quarter[4]);

/* A point that divides the edge from a to b where heights ha and hb have opposite
 * signs: at height 0. The same bits whichever way round the edge is given. */
void geo_edge_divide(const double a[3], double ha, const double b[3], double hb, double out[3]);

/* A point of a convex facet, uniform by area, from two numbers in [0,1). */
void geo_facet_point(const struct facet *f, double u, double v, double x[3]);

#endif
