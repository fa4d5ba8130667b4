/* What stands between two facets. */
#ifndef TWOPASS_SHAFT_H
#define TWOPASS_SHAFT_H

#include "lib/occlusion/occluder.h"

enum { SIGHT_BLOCKERS = 48, SHAFT_PLANES = 2 * FACET_CORNERS };

enum sight {
	SIGHT_CLEAR,          /* nothing: every point of one sees every point of the other */
	SIGHT_NONE,           /* one body hides all of one from all of the other */
	SIGHT_PART,           /* the blockers listed may hide something */
	SIGHT_CROWDED         /* more blockers than the list holds */
};

struct sight_line {
	const struct body_set *set;
	const struct facet *a, *b;
	struct plane shaft[SHAFT_PLANES];
	int planes;
	double lo[3], hi[3];      /* box of both */
	uint32_t body[SIGHT_BLOCKERS];
	int bodies, most;         /* most: how many are let in before it is a crowd */
};

/* Looks from a to b, which lie in front of one another; l->most is set. With SIGHT_PART the
 * bodies that may hide something are in l->body. O(log bodies + bodies between x corners). */
enum sight sight_find(struct sight_line *l, const struct body_set *set, const struct facet *a,
                      const struct facet *b);

/* Planes that have both facets on or behind them, through an edge of one and a corner of
 * the other. Returns their number. */
int shaft_planes(const struct facet *f, const struct facet *g, double near,
                 struct plane shaft[SHAFT_PLANES]);

#endif
