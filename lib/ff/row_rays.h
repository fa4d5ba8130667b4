/* Rows of form factors by rays (private to lib/ff). */
#ifndef TWOPASS_ROW_RAYS_H
#define TWOPASS_ROW_RAYS_H

#include "lib/ff_rays/ff_internal.h"

/* All rows of one patch into the batch. 0, or -1 and e. */
int ff_patch_rays(struct ff_thread *t, uint32_t patch, struct ff_batch *b, struct err *e);

#endif
