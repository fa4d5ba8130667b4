/* Rays that lobes aim at emitters (private to lib/view). */
#ifndef TWOPASS_AIMED_RAY_H
#define TWOPASS_AIMED_RAY_H

#include "lib/view/specular_stack.h"

/* What a ray that is aimed at an image of an emitter came by. */
enum view_aimed { VIEW_AIMED_STRAIGHT = 1, VIEW_AIMED_ROUND };

/* Follows it from where `from` begins, through panes and by the mirrors of the image's chain, and
 * multiplies value[bands] by what it brings. 0 if anything is between. */
int view_aimed(struct view_walker *w, const struct view_branch *from, const double dir[3],
               uint32_t image, double *value);

#endif
