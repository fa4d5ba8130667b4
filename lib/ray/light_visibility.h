/* The way of a punctual light's rays to a point, by mirrors and clear panes. */
#ifndef TWOPASS_LIGHT_VISIBILITY_H
#define TWOPASS_LIGHT_VISIBILITY_H

#include "lib/data/punctual.h"
#include "lib/ray/mirror.h"
#include "lib/ray/ray.h"

/* A scene and the images of its lights. */
struct light_visibility {
	const struct model *m;
	const struct ray_scene *rays;
	int panes;               /* some material is a clear pane */
	struct light_images images;
};

/* As many images as a point may be expected to look at. 0, or -1 and e; to be freed in any
 * case. */
int ray_light_visibility_new(const struct model *m, const struct ray_scene *rays, struct light_visibility *w,
                             struct err *e);
void ray_light_visibility_free(struct light_visibility *w);

/* Multiplies value[bands] by what clear panes between two points, both just off their
 * surfaces, let through of the light from `to` to `from`. 0 if anything else is between.
 * Adds to *cast the rays that took. O(panes log triangles). */
int ray_light_transmittance(const struct light_visibility *w, const double from[3], const double to[3],
                            double *value, uint64_t *cast);

/* As ray_light_transmittance for rays of light or image number `image`, which a point just before
 * `from` sees as s says: they must come by the image's mirrors. What these absorb is in the
 * image's intensity. */
int ray_light_visibility(const struct light_visibility *w, size_t image, const double from[3],
                         const struct light_sight *s, double *value, uint64_t *cast);

#endif
