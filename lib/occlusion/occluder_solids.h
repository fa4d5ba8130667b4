/* Convex solids among polygons (private to lib/occlusion). */
#ifndef TWOPASS_OCCLUDER_SOLIDS_H
#define TWOPASS_OCCLUDER_SOLIDS_H

#include "lib/occlusion/occluder_polygons.h"

/* An edge of a polygon: corner `at` of it and the next, sorted by their points. */
struct side {
	uint32_t low, high;           /* points */
	uint32_t polygon;
	uint32_t up;                  /* 1: runs from low to high */
};

/* One group of polygons that belong together. */
struct solid {
	const uint32_t *polygon;      /* [polygons] */
	size_t polygons;
	const struct side *side;      /* their edges, sorted by points */
	size_t sides;
	struct plane missing;         /* the face that closes it */
	int closed;                   /* 1: nothing was missing */
};

/* Groups polygons that meet at convex edges: set[i] is the lowest polygon of i's group.
 * sides receives all edges sorted by points (free() it). 0, or -1 and e. O(n log n). */
int occ_solids_group(const struct polygons *p, uint32_t *set, struct side **sides, size_t *n,
                     struct err *e);

/* 1 if the group is a convex solid that one plane face at most leaves open; fills
 * missing and closed. */
int occ_solid_check(const struct polygons *p, struct solid *s);

#endif
