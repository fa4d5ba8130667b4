/* What can stand between two facets: the scene's triangles merged into as few convex
 * occluders as come by cheaply. Connected coplanar triangles with a convex outline are one
 * flat occluder; flat occluders that close a convex solid, but for one face at most (a block
 * without a bottom), are one solid occluder. Planes that have the whole scene on one side
 * block nothing and are left out. A solid that something may look out of, or about in,
 * from a place that is not in it as a whole is left as its faces. */
#ifndef TWOPASS_OCCLUDER_SET_H
#define TWOPASS_OCCLUDER_SET_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"

/* The most that an occluder may have, counts; what has more stays apart as its faces, or as its
 * triangles. At three edges a corner, 48 edges have 32 corners, so no silhouette has more
 * edges. That takes in furniture and frames, while a ball is left to rays: a guess. */
enum { OCCLUDER_SHAPE_EDGES = 48, OCCLUDER_SHAPE_FACES = 32, FLAT_CORNERS = 32 };

struct plane {
	double normal[3], offset;     /* normal . x = offset */
};

/* An edge between two faces; a flat occluder has only face 0, on both sides. */
struct occluder_edge {
	uint32_t a, b;                /* corners, in occluder_set.corner */
	uint16_t left, right;         /* faces of the occluder */
	double along[3];              /* unit vector from a to b */
};

/* A convex occluder as a whole. */
struct occluder_shape {
	uint32_t corner, corners;     /* first and number in occluder_set.corner */
	uint32_t edge, edges;
	uint32_t face, faces;
	int flat;
	double lo[3], hi[3], centre[3];
};

struct occluder_node {
	double lo[3], hi[3];
	uint32_t first, count;        /* occluders below */
	uint32_t right;               /* second child; the first is the next node; 0 = leaf */
};

/* Corners are relative to occ_facet_centre(). */
struct occluder_set {
	size_t occluders, corners, edges, faces, nodes;
	struct occluder_shape *occluder; /* ordered as the leaves of the tree */
	double *corner;               /* [corners][3] */
	struct occluder_edge *edge;
	struct plane *face;           /* outward normals of solids */
	struct occluder_node *node;
	double near;                  /* heights up to this count as on a plane, m */
};

/* O(n log n) in triangles, and O(corners) for each plane on the hull and each solid. 0, or -1
 * and e. */
int occ_occluder_set_init(struct occluder_set *s, const struct model *m, struct err *e);
void occ_occluder_set_free(struct occluder_set *s);

#endif
