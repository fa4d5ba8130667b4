/* What element-sides see, element by element: where the rays landed that they gathered with,
 * straight and by mirrors, panes and lobes (for lib/ff). */
#ifndef TWOPASS_LANDINGS_H
#define TWOPASS_LANDINGS_H

#include "lib/ff_rays/ff_internal.h"

/* Tables, and room for the landings of every patch of the shard. 0, or -1 and e. */
int ff_landings_init(struct ff_landings *l, const struct ff_job *j, struct err *e);
void ff_landings_free(struct ff_landings *l);

/* An element-side begins, with so many rays, of which ray i of a batch landed where that says. To be
 * called in the order of places in a patch; patches by any thread, each whole. Ways that light
 * comes by from beyond are followed. Returns how many rays that took. */
void ff_landings_begin(struct ff_landings *l, uint32_t column, uint32_t rays, int thread);
uint32_t ff_landings_add(struct ff_landings *l, uint32_t column, const struct ff_ray_batch *b,
                         uint32_t i, int thread, struct err *e);

/* Fetches what n rays of a batch need, some time before they are added. */
void ff_landings_fetch(const struct ff_landings *l, uint32_t n, const struct ff_ray_batch *b);

/* All rays of an element-side are done; so many met nothing or black sides. */
void ff_landings_end(struct ff_landings *l, uint32_t column, uint32_t lost);

/* Puts those of a patch into its batch, with the chain numbers of the whole, and forgets them. Called
 * in the order of patches. 0, or -1 and e. */
int ff_landings_put(struct ff_landings *l, uint32_t patch, struct ff_batch *b,
                    struct chains *whole, struct err *e);

#endif
