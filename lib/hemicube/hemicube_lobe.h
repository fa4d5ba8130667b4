/* Eq. (3) of the paper over the pixels of a hemicube. */
#ifndef TWOPASS_HEMICUBE_LOBE_H
#define TWOPASS_HEMICUBE_LOBE_H

#include "lib/hemicube/hemicube.h"

/* Weights of pixels, [pixels], that sum to 1: cos^k a dw over its sum, a the angle of a pixel's
 * centre to the axis (unit, cube's frame) and dw = pi dF / cos theta its solid angle. Pixels
 * that see nothing weigh 0 and are left out of the sum, or with `escape` are a part of it.
 * Any k >= 0, also where all of cos^k a is below the least number. 0, or -1 where no pixel
 * that counts has a > 0: then all weights are 0. O(pixels). */
int ff_hemicube_lobe(const struct hemicube_grid *g, const uint32_t *item, const double axis[3],
                     double k, int escape, double *weight);

#endif
