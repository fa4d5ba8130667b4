/* The way of a punctual light's rays to a point, by mirrors and clear panes. */
#ifndef TWOPASS_LIGHT_VISIBILITY_H
#define TWOPASS_LIGHT_VISIBILITY_H

#include "lib/data/punctual.h"
#include "lib/ray/mirror.h"
#include "lib/ray/ray.h"

/* A scene and the images of its lights. */
struct light_ways {
	const struct model *m;
	const struct ray_scene *rays;
	int panes;               /* some material is a clear pane */
	struct light_images images;
};

/* As many images as a point may be expected to look at. 0, or -1 and e; to be freed in any
 * case. */
int light_ways_new(const struct model *m, const struct ray_scene *rays, struct light_ways *w,
                   struct err *e);
void light_ways_free(struct light_ways *w);

/* Multiplies value[bands] by what clear panes between two points, both just off their
 * surfaces, let through of the light from `to` to `from`. 0 if anything else is between.
 * Adds to *cast the rays that took. O(panes log triangles). */
int light_through(const struct light_ways *w, const double from[3], const double to[3],
                  double *value, uint64_t *cast);

/* As light_through for rays of light or image number `image`, which a point just before
 * `from` sees as s says: they must come by the image's mirrors. What these absorb is in the
 * image's intensity. */
int light_way(const struct light_ways *w, size_t image, const double from[3],
              const struct light_sight *s, double *value, uint64_t *cast);

#endif
