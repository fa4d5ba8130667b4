/* Rows by the paper's algorithm as printed (private to lib/ff): one hemicube at the centre of
 * each side of a patch, eq. (3) as a sum over its pixels, a link for each source. */
#ifndef TWOPASS_ROW_PAPER_H
#define TWOPASS_ROW_PAPER_H

#include "lib/ff_rays/ff_internal.h"

/* All rows and links of one patch into the batch, of a model without ideal surfaces
 * (model_ideal_as_lobes). O(elements + pixels x (1 + sources seen)). 0, or -1 and e. */
int ff_patch_paper(struct ff_thread *t, uint32_t patch, struct ff_batch *b, struct err *e);

#endif
