/* Whether a punctual light's rays reach a point, straight or by plane mirrors, and through
 * which clear panes. */
#ifndef TWOPASS_LIGHT_VISIBILITY_H
#define TWOPASS_LIGHT_VISIBILITY_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/ray/mirror.h"

struct light_sample;
struct ray_scene;

/* A scene and the images of its lights. */
struct light_visibility {
	const struct model *m;
	const struct ray_scene *rays;
	int panes;               /* some material is a clear pane */
	struct light_images images;
};

/* As many images as a point may be expected to look at. 0, or -1 and e; to be freed in any
 * case. */
int ray_light_visibility_new(const struct model *m, const struct ray_scene *rays,
                             struct light_visibility *w, struct err *e);
void ray_light_visibility_free(struct light_visibility *w);

/* Is told of a surface that light passes: it arrives on that side of the material, and goes
 * through a clear pane (transmitted) or is turned by a mirror. Returns 0 to end the walk. */
typedef int ray_light_pass_fn(void *arg, uint32_t material, int arrival, int transmitted);

/* Walks from a point just off its surface towards light or image number `image`, which that
 * point sees as s says: through clear panes, by the image's mirrors (the last to turn the light
 * comes first), and from there on to the light itself. Calls pass for each surface, in this
 * order. 1 if the light's rays come this way; 0 if anything else is between or pass said so.
 * Adds the rays that took to *cast. O((panes + mirrors) log triangles). */
int ray_light_walk(const struct light_visibility *w, size_t image, const double from[3],
                   const struct light_sample *s, ray_light_pass_fn *pass, void *arg,
                   uint64_t *cast);

/* Multiplies value[bands] by what clear panes between two points, both just off their
 * surfaces, let through of the light from `to` to `from`. 0 if anything else is between.
 * Adds to *cast the rays that took. O(panes log triangles). */
int ray_light_transmittance(const struct light_visibility *w, const double from[3],
                            const double to[3], double *value, uint64_t *cast);

/* The same for the way that ray_light_walk takes. What mirrors absorb is in the image's
 * intensity already. */
int ray_light_visibility(const struct light_visibility *w, size_t image, const double from[3],
                         const struct light_sample *s, double *value, uint64_t *cast);

#endif
