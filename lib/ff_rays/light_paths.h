/* The ways that rays of punctual lights and of their images take (private to lib/ff). */
#ifndef TWOPASS_LIGHT_PATHS_H
#define TWOPASS_LIGHT_PATHS_H

#include "lib/ff_rays/ff_internal.h"

/* The chain of events that a light's rays pass from `to` to `from`: straight and through
 * clear panes; or by way of a mirror, when the ray from `from` towards the image meets it
 * first. CHAIN_NONE if anything else is in their way. */
uint32_t ff_light_straight(struct ff_thread *t, const double from[3], const double to[3]);
uint32_t ff_light_mirrored(struct ff_thread *t, const struct mirror_plane *mirror, size_t light,
                           const double from[3], const double toward[3]);

#endif
