/* Gathering rays that go on after directional events (private to lib/view): one way at each,
 * chosen by what it carries, a batch at a time. */
#ifndef TWOPASS_FINAL_GATHER_SPECULAR_H
#define TWOPASS_FINAL_GATHER_SPECULAR_H

#include "lib/base/rng.h"
#include "lib/view/final_gather_table.h"

/* A ray that waits. */
struct gather_going {
	float org[3], dir[3];       /* as in a ray_batch */
	double weight[BANDS_MAX];   /* that what it finds counts with */
	int depth;                  /* directional events behind it */
	struct rng random;
};

struct gather_tails {
	struct gather_going going[2 * RAY_BATCH];
	uint32_t waiting;
	struct ray_batch batch;
	struct gather_going now[RAY_BATCH]; /* those of the batch */
	int depth;                  /* events that are followed at most */
	uint64_t rays;              /* so far */
};

/* Has the ray go on from what ray i of a batch met, unless chance ends it. There has to be
 * room for one. */
void view_gather_go_on(struct gather_tails *s, const struct gather_table *t,
                       const struct ray_batch *b, uint32_t i, size_t place,
                       const struct gather_going *g);

/* Follows the rays that wait down to `left` and adds the radiance they find. */
void view_gather_follow(struct gather_tails *s, const struct gather_table *t, uint32_t left,
                        double *sum);

#endif
