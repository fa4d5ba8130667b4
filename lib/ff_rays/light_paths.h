/* By which chain of events a punctual light or its image reaches a point. */
#ifndef TWOPASS_LIGHT_PATHS_H
#define TWOPASS_LIGHT_PATHS_H

#include <stddef.h>
#include <stdint.h>

struct ff_thread;
struct light_sample;

/* The chain of events that the rays of light or image number `image` of job->lights pass on
 * their way to a point just off its surface, which sees it as s says: clear panes, and the
 * image's mirror. CHAIN_NONE if anything else is in their way. */
uint32_t ff_light_chain(struct ff_thread *t, size_t image, const double from[3],
                        const struct light_sample *s);

#endif
