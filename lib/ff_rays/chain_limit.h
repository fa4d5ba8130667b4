/* How far chains of ideal events are told apart (for lib/ff). */
#ifndef TWOPASS_CHAIN_LIMIT_H
#define TWOPASS_CHAIN_LIMIT_H

#include "lib/ff_rays/ff_internal.h"

/* Sets job->chain_most: as high as keeps chains few, by what a few rays meet. O(depth)
 * rays. 0, or -1 and e. */
int ff_find_chain_limit(struct ff_job *j, struct err *e);

#endif
