/* Floating-point pictures of named channels. */
#ifndef TWOPASS_IMAGE_H
#define TWOPASS_IMAGE_H

#include <stddef.h>

#include "lib/base/err.h"

struct image {
	int width, height;
	int channels;
	char **name;     /* [channels], e.g. "R", "diffuse.R", "Z", "element" */
	float *pixel;    /* [channels][height][width], row 0 at the top */
};

/* A zeroed picture whose channels carry copies of the given names. */
int picture_image_new(struct image *im, int width, int height, int channels,
                      const char *const *name, struct err *e);
void picture_image_free(struct image *im);

/* Index of the channel with this name, or -1. */
int picture_image_channel(const struct image *im, const char *name);

/* The channels of a layer: LAYER.R, .G, .B (or .X, .Y, .Z), or the one channel
 * called LAYER; for layer NULL R, G, B, or else Y. Returns how many there are
 * (3, 1 or 0); of a single channel all three entries are its index. */
int picture_image_layer(const struct image *im, const char *layer, int channel[3]);

static inline float *picture_image_plane(const struct image *im, int channel)
{
	return im->pixel + (size_t)channel * (size_t)im->height * (size_t)im->width;
}

#endif
