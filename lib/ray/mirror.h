/* Plane ideal mirrors, and the images of punctual lights in them.
 *
 * An image in a plane mirror is a light beyond it, whose rays count where they come through
 * the mirror: exactly what the mirror makes of the light. Mirrors that see each other make
 * images of images. */
#ifndef TWOPASS_MIRROR_H
#define TWOPASS_MIRROR_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"

/* A plane of ideal mirrors of one material; n points to the side that reflects. */
struct mirror_plane {
	double n[3], offset;
	double box[2][3];        /* of its triangles */
	uint32_t material;
	int side;
};

struct mirrors {
	size_t n;
	struct mirror_plane *plane;
	double same;             /* heights over a plane that are no more are in it */
	int complete;            /* 0: there are too many planes, as of curved mirrors; n = 0 */
};

/* Needs derived lights. O(triangles). 0, or -1 and e; to be freed in any case. */
int ray_mirrors_find(const struct model *m, struct mirrors *k, struct err *e);
void ray_mirrors_free(struct mirrors *k);

/* 1 if a point of a side of a triangle, n its unit normal, is the mirror's. */
int ray_mirror_has(const struct mirrors *k, const struct mirror_plane *plane, uint32_t material,
                   int side, const double n[3], const double x[3]);

/* Lights and behind them their images, those turned more often last. */
struct light_images {
	struct mirrors mirrors;
	struct lights l;         /* no names; intensities of images are dimmed by the mirrors */
	uint32_t *origin;        /* [l.n] the light that it is of */
	uint32_t *parent;        /* [l.n] what the last mirror turned */
	int32_t *plane;          /* [l.n] that mirror, -1 for the lights themselves */
	int complete;            /* no other way by mirrors carries as much of a light */
};

/* Images of up to `orders` mirrors that carry more than a part of `least` in some band,
 * `most` at most; `clear`: a light so close to a plane is
 * in it (ray_offset). O(triangles + images planes). 0, or -1 and e; to be freed in any
 * case. */
int ray_light_images_new(const struct model *m, double clear, int orders, size_t most,
                         double least, struct light_images *g, struct err *e);
void ray_light_images_free(struct light_images *g);

#endif
