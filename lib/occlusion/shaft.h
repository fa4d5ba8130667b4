/* What stands between two facets. */
#ifndef TWOPASS_SHAFT_H
#define TWOPASS_SHAFT_H

#include "lib/occlusion/occluder.h"

/* Occluders, a count: more are a crowd, where formulas cost more than the rays that replace them;
 * at most the 64 bits of those who keep a set of them. A guess. Planes: one for each edge of
 * either facet at most. */
enum { SHAFT_OCCLUDERS = 48, SHAFT_PLANES = 2 * FACET_CORNERS };

enum shaft_state {
	SHAFT_UNOCCLUDED,     /* nothing: every point of one sees every point of the other */
	SHAFT_HIDDEN,         /* one occluder hides all of one from all of the other */
	SHAFT_PARTLY,         /* the occluders listed may hide something */
	SHAFT_CROWDED         /* more occluders than the list holds */
};

struct shaft {
	const struct occluder_set *set;
	const struct facet *a, *b;
	struct plane shaft[SHAFT_PLANES];
	int planes;
	double lo[3], hi[3];      /* box of both */
	uint32_t occluder[SHAFT_OCCLUDERS];
	int occluders, most;      /* most: how many are let in before it is a crowd */
};

/* Looks from a to b, which lie in front of one another; l->most is set. With SHAFT_PARTLY the
 * occluders that may hide something are in l->occluder.
 * O(log occluders + occluders between x corners). */
enum shaft_state occ_shaft_cull(struct shaft *l, const struct occluder_set *set,
                                const struct facet *a, const struct facet *b);

/* Planes that have both facets on or behind them, through an edge of one and a corner of
 * the other. Returns their number. */
int occ_shaft_planes(const struct facet *f, const struct facet *g, double near,
                     struct plane shaft[SHAFT_PLANES]);

#endif
