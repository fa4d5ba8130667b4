/* Where the light of punctual lights arrives (private to lib/ff). */
#ifndef TWOPASS_ROW_LIGHT_H
#define TWOPASS_ROW_LIGHT_H

#include "lib/ff_rays/ff_internal.h"

/* The row of a punctual light into the batch; none if it has no flux. 0, or -1 and e.
 * O(elements + rays). */
int ff_light_row(struct ff_thread *t, uint32_t light, struct ff_batch *b, struct err *e);

/* Captures the ways that light of all punctual lights comes straight to a directional
 * patch-side. O(lights). 0, or -1 and e. */
int ff_light_incident(struct ff_thread *t, uint32_t patch_side, struct err *e);

#endif
