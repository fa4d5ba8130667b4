/* What an emitter lights, from the elements (private to lib/ff). */
#ifndef TWOPASS_ROW_EMITTER_H
#define TWOPASS_ROW_EMITTER_H

#include "lib/ff_rays/ff_internal.h"

/* A row of direct sight: t->shares becomes F[source -> element-side] of every
 * element-side that may see the source, with about `rays` rays between them. Returns
 * their sum. O(elements + rays). */
double ff_emitter_row(struct ff_thread *t, uint32_t source, uint32_t rays, struct err *e);

#endif
