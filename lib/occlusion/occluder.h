/* What stands between two facets, one occluder at a time. */
#ifndef TWOPASS_OCCLUDER_H
#define TWOPASS_OCCLUDER_H

#include "lib/geometry/facet.h"
#include "lib/occlusion/occluder_set.h"

/* Where a plane cuts an occluder, each of its faces gets one edge more. */
enum {
	OCCLUDER_EDGES = OCCLUDER_SHAPE_EDGES + OCCLUDER_SHAPE_FACES,
	OCCLUDER_CORNERS = OCCLUDER_EDGES
};

/* An occluder, or what of it is in front of a facet. */
struct occluder {
	int corners, edges, faces, flat;
	double corner[OCCLUDER_CORNERS][3];
	struct {
		double a[3], b[3], along[3];  /* unit vector from a to b */
		int left, right;      /* faces; `faces` is the cut */
	} edge[OCCLUDER_EDGES];
	struct plane face[OCCLUDER_SHAPE_FACES + 1];
	double centre[3];
};

/* The part of an occluder in front of the plane of facet b into `out`. 0 if nothing is. */
int occ_occluder_make(const struct occluder_set *s, uint32_t occluder, const struct facet *b,
                      struct occluder *out);

/* 1 if an occluder hides all of f from all of g: the shadow of a convex occluder from a point is
 * convex, so corners speak for facets. */
int occ_occluder_hides(const struct occluder *b, const struct facet *f, const struct facet *g,
                       double near);

/* 1 if it is sure that the occluders of the set bits together hide all of f from all of g:
 * for each of the parts that g is halved into, `depth` times at most, one does. */
int occ_occluders_hide(const struct occluder *b, uint64_t from, const struct facet *f,
                       const struct facet *g, double near, int depth);

#endif
