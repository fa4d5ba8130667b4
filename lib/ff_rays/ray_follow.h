/* Rays of a row, followed wherever ideal surfaces and lobes send them (for lib/ff). */
#ifndef TWOPASS_RAY_FOLLOW_H
#define TWOPASS_RAY_FOLLOW_H

#include "lib/ff_rays/ff_internal.h"
#include "lib/ff_rays/ray_guide.h"

/* Follows a ray (origin already off its surface) carrying weight w of the row's
 * flux to where it lands, and on through ideal surfaces; tallies everything. */
void ff_follow(struct ff_thread *t, const double org[3], const double dir[3], double w,
               uint32_t chain);

/* The same for a ray of chain 0 whose first landing has been tallied already. */
void ff_follow_on(struct ff_thread *t, const double org[3], const double dir[3], double w);

/* Casts `count` rays from a patch-side: Lambertian (exponent < 0) or an emission lobe.
 * first_replicate: that they begin with. */
void ff_cast_side(struct ff_thread *t, uint32_t patch_side, uint32_t count, double exponent,
                  uint32_t first_replicate);

/* The same, Lambertian, by a guide. Returns what all weigh: about count times its boost. */
uint32_t ff_cast_guided(struct ff_thread *t, uint32_t patch_side, uint32_t count,
                    const struct ff_guide *g);

/* Casts what waits in t->lobe. */
void ff_lobes_cast(struct ff_thread *t);

#endif
