/* Channels of a picture (private to lib/view). */
#ifndef TWOPASS_VIEW_LAYERS_H
#define TWOPASS_VIEW_LAYERS_H

#include "lib/view/view.h"

/* Planes of the picture by what they hold; -1 = not asked for. */
struct view_planes {
	int bands, diffuse, directional, emission, z, normal, element, patch, error;
};

/* A new picture with R, G, B, `bands` of its own unless there are 1 or 3, and the layers of a
 * mask; says where they are. 0, or -1 and e. */
int view_picture_new(const struct view_frame *f, unsigned layers, int bands, struct view_planes *at,
                     struct image *picture, struct err *e);

#endif
