/* Where on a facet the shadows of occluders begin and end. */
#ifndef TWOPASS_SHADOW_EDGES_H
#define TWOPASS_SHADOW_EDGES_H

#include "lib/occlusion/shaft.h"

/* Counts. Cuts: as many as a cell has bits for them; further ones are left to the halving of cells.
 * Limits: further occluders are not ruled out early. 96 is a guess. */
enum { SHADOW_CUTS = 32, SHADOW_LIMITS = 96 };

struct shadow_cuts {
	struct plane cut[SHADOW_CUTS];
	uint64_t of[SHADOW_CUTS];     /* bits of the occluders that each is an edge of */
	int n;
};

struct shadows {
	/* Where shadows begin, end or fill differently; and where only how fast they grow
	 * does: at a corner that the edge of a shadow passes in between. */
	struct shadow_cuts edges, bends;
	/* Planes with an occluder in front of them and all of g behind: what of f is behind
	 * one sees g past that occluder. */
	struct plane limit[SHADOW_LIMITS];
	int occluder[SHADOW_LIMITS], limits;
	uint64_t idle;                /* a bit for each occluder that hides nothing */
};

/* Planes that cut facet f where what its points see of facet g past the occluders changes
 * its law: through an edge of one and a corner of the other that have all of each on one
 * side (edges of the whole shadow and of its core), through parallel edges of both or of
 * two occluders, where a gap between them opens, or through an occluder's face that g
 * crosses. No more are kept than fit.
 * O((occluders x edges)^2). */
void occ_shadow_edges(const struct occluder *b, int occluders, const struct facet *f,
                      const struct facet *g, double near, struct shadows *s);

/* What occluders do to the view from a convex cell in the plane of f to g: those of the set
 * bits of `from` that may hide something stay set; 0: nothing does. *hidden is set if one
 * of them hides all. */
uint64_t occ_shadow_on(const struct occluder *b, const struct shadows *s, uint64_t from,
                       const struct facet *cell, const struct facet *g, double near, int *hidden);

#endif
