/* What stands between two facets, one body at a time. */
#ifndef TWOPASS_OCCLUDER_H
#define TWOPASS_OCCLUDER_H

#include "lib/geometry/facet.h"
#include "lib/occlusion/occluder_set.h"

enum { OCCLUDER_EDGES = OCCLUDER_BODY_EDGES + OCCLUDER_BODY_FACES, OCCLUDER_CORNERS = OCCLUDER_EDGES };

/* A body, or what of it is in front of a facet. */
struct occluder {
	int corners, edges, faces, flat;
	double corner[OCCLUDER_CORNERS][3];
	struct {
		double a[3], b[3], along[3];  /* unit vector from a to b */
		int left, right;      /* faces; `faces` is the cut */
	} edge[OCCLUDER_EDGES];
	struct plane face[OCCLUDER_BODY_FACES + 1];
	double centre[3];
};

/* The part of a body in front of the plane of facet b into `out`. 0 if nothing is. */
int occ_occluder_make(const struct occluder_set *s, uint32_t body, const struct facet *b,
                      struct occluder *out);

/* 1 if a blocker hides all of f from all of g: the shadow of a convex body from a point is
 * convex, so corners speak for facets. */
int occ_occluder_hides(const struct occluder *b, const struct facet *f, const struct facet *g,
                       double near);

/* 1 if it is sure that the blockers of the set bits together hide all of f from all of g:
 * for each of the parts that g is halved into, `depth` times at most, one does. */
int occ_occluders_hide(const struct occluder *b, uint64_t from, const struct facet *f,
                       const struct facet *g, double near, int depth);

#endif
