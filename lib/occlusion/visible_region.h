/* What a point sees of a facet past occluders. */
#ifndef TWOPASS_VISIBLE_REGION_H
#define TWOPASS_VISIBLE_REGION_H

#include "lib/base/err.h"
#include "lib/geometry/point_polygon.h"
#include "lib/occlusion/shaft.h"

/* A count: 32 of the silhouette of a whole occluder, and as many where a plane cuts it. */
enum { OUTLINE_EDGES = 64 };

/* The silhouette of an occluder for all eyes that have the same of its faces in front. */
struct outline {
	uint64_t front;               /* bits of those faces; 0: not known */
	int edges;
	double a[3][OUTLINE_EDGES];   /* by coordinate: a corner of each edge */
	double d[3][OUTLINE_EDGES];   /* along it, (a - eye) x d to the inside */
};

/* Planes through the eye and the edges of an outline, their normals to the inside. */
struct outline_planes {
	double x[OUTLINE_EDGES], y[OUTLINE_EDGES], z[OUTLINE_EDGES];
	double size[OUTLINE_EDGES];   /* of the factors of each normal */
};

/* Something additive of polygons that an eye sees. */
typedef double (*visible_measure)(const struct point_polygon *p, void *arg);

/* One thread's scratch space and the occluders. */
struct visible_point {
	struct occluder occluder[SHAFT_OCCLUDERS];
	double near;                  /* of the set of occluders */
	int occluded;                 /* set when an occluder hides something */
	double evaluations;           /* so far */
	/* The eye in work. */
	double reach;                 /* of the farthest corner of what is looked at */
	visible_measure measure;
	void *arg;
	int overlaps;                 /* see visible_region.c */
	int full;                     /* a polygon has too many corners */
	struct outline outline[SHAFT_OCCLUDERS];
	struct outline_planes planes[SHAFT_OCCLUDERS];
};

/* To be called when occluders have changed. */
void occ_visible_begin(struct visible_point *s, int occluders, double near);

/* The form factor from a point x with a unit normal to what it sees of facet g, which is
 * in front of it; exact. occluders: a bit for each that may hide something. NaN and e when
 * polygons have too many corners. */
double occ_visible_exchange(struct visible_point *s, const double x[3], const double normal[3],
                            const struct facet *g, uint64_t occluders, struct err *e);

/* The same for any measure: its sum over convex polygons that are together what is seen. */
double occ_visible_integrate(struct visible_point *s, const double x[3], const struct facet *g,
                             uint64_t occluders, visible_measure measure, void *arg, struct err *e);

#endif
