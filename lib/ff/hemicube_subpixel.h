/* Elements below a pixel (private to lib/ff). */
#ifndef TWOPASS_HEMICUBE_SUBPIXEL_H
#define TWOPASS_HEMICUBE_SUBPIXEL_H

#include "lib/ff_rays/ff_internal.h"

/* Shares the light of patch-side ps, whose views are set and whose hemicubes are tallied,
 * anew among elements that few pixels show. O(elements x points) rays. */
void ff_hemicube_subpixel(struct ff_thread *t, uint32_t ps);

#endif
