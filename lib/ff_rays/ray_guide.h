/* Rays of an emitter go where its light goes on by mirrors and panes (for lib/ff): formulas know where
 * it lands straight, and curved mirrors bundle what little of it they get.
 *
 * The numbers that make a ray, in [0,1)^4, are divided into cells. Pilot rays, which are not counted,
 * tell from which cells rays meet ideal surfaces; of a sequence `boost` times as long those in such
 * cells are cast, each for 1, and of its beginning the others, each for `boost`. */
#ifndef TWOPASS_RAY_GUIDE_H
#define TWOPASS_RAY_GUIDE_H

#include "lib/ff_rays/ff_internal.h"

/* Parts of a cell's side: of both numbers of the place on the patch, and of the direction. Guesses. */
enum { GUIDE_PLACES = 4, GUIDE_DIRECTIONS = 8,
       GUIDE_CELLS = GUIDE_PLACES * GUIDE_PLACES * GUIDE_DIRECTIONS * GUIDE_DIRECTIONS };

struct ff_guide {
	uint32_t boost;           /* 1: no cell is looked into more closely */
	uint8_t in[GUIDE_CELLS];
};

/* The guide of a patch-side whose row casts so many rays. O(rays). */
void ff_guide_learn(struct ff_thread *t, uint32_t patch_side, uint32_t rays, struct ff_guide *g);

/* Of n rays by their numbers, those in cells that are in, or not, behind those that b has; returns how many
 * of them fit, RAY_BATCH being full. */
uint32_t ff_guide_take(const struct ff_guide *g, int in, const struct ff_ray_batch *from,
                       uint32_t first, uint32_t n, struct ff_ray_batch *b, uint32_t *have);

#endif
