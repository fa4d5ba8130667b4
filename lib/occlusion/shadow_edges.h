/* Where on a facet the shadows of occluders begin and end. */
#ifndef TWOPASS_SHADOW_EDGES_H
#define TWOPASS_SHADOW_EDGES_H

#include "lib/occlusion/shaft.h"

/* Counts. Cuts: as many as a cell has bits for them; further ones are left to the halving of cells.
 * Limits: 16 for each of the most occluders; a shadow seldom has more. */
enum { SHADOW_CUTS = 32, SHADOW_LIMITS = 768 };

struct shadow_cuts {
	struct plane cut[SHADOW_CUTS];
	uint64_t of[SHADOW_CUTS];     /* bits of the occluders that each is an edge of */
	int n;
};

struct shadows {
	struct shadow_cuts edges;     /* where shadows begin, end or fill differently */
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

/* The occluders, of those of the set bits of `from`, that may hide something of g from a convex
 * cell in the plane of f. *crossed: bits of those whose shadow has a limit that crosses the
 * cell; all points of the cell are in the shadows of the others. */
uint64_t occ_shadow_on(const struct shadows *s, uint64_t from, const struct facet *cell,
                       double near, uint64_t *crossed);

/* The part of a cell that is in an occluder's shadow: 1, or 0 if none is. *limit: of those that
 * cross the cell, the one that halves it best. */
int occ_shadow_part(const struct shadows *s, int occluder, const struct facet *cell, double near,
                    struct facet_room *part, const struct plane **limit);

#endif
