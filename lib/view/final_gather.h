/* Final gathering: indirect irradiance at points, from rays over their hemisphere against
 * the solution. At a point x with normal n it estimates
 *
 *     H_indirect(x) = integral over the hemisphere of L(y, -w) (n.w) dw
 *                   = pi mean of L(y_i, -w_i),   w_i by the density (n.w) / pi,
 *
 * y being what the ray from x along w meets, and L its diffuse radiance M(y) / pi, behind
 * directional events times their weight: the same L as view.h's, without L_e.
 *
 * What a ray meets adds the radiance of its diffuse light, interpolated; where it meets a
 * surface that reflects or transmits directionally it goes on, but an emitter is never
 * counted: light that comes straight from emitters is direct, light by directional events
 * alone caustic, and both are known by other ways.
 *
 * Irradiance that varies smoothly is gathered at the corners of elements and interpolated;
 * where its second differences say that this would be off by more than is wanted it is
 * gathered at the points themselves. */
#ifndef TWOPASS_FINAL_GATHER_H
#define TWOPASS_FINAL_GATHER_H

#include <stdint.h>

#include "lib/base/err.h"
#include "lib/base/parallel.h"
#include "lib/view/view_scene.h"

struct gather;

struct gather_options {
	int rays;               /* from a point, if `relative` is 0 */
	double relative;        /* standard error aimed at, relative to all irradiance, or 0 */
	int samples;            /* of a pixel, that share rays where each gathers for itself */
	int depth;              /* directional events that a gathering ray may go on after */
	int threads;
};

/* v, made for VIEW_GATHER, must outlive it. O(elements). NULL and e on failure. */
struct gather *view_gather_new(const struct view_scene *v, const struct gather_options *o,
                               struct err *e);
void view_gather_free(struct gather *g);

/* Asks for the light on a side of an element; from any thread. */
void view_gather_want(struct gather *g, uint32_t element_side);

/* Gathers at the corners of all that is wanted. The result depends on what was wanted, but
 * not on the number of threads. O(corners x rays x log triangles). */
void view_gather_corners(struct gather *g, const struct progress *progress);

/* Irradiance at a point and its standard error: of this point alone, and what it has in
 * common with points around, of interpolation and of the errors of the solution where rays
 * meet it. */
struct gathered {
	double h[BANDS_MAX], error[BANDS_MAX], common[BANDS_MAX];
};

/* Indirect irradiance at point x (world) of a side that was wanted, whose element's corners
 * have weights w there. */
void view_gather_at(struct gather *g, uint32_t element_side, const double x[3], const double w[3],
                    uint64_t seed, int thread, struct gathered *to);

/* 0, or -1 and e if memory was short. */
int view_gather_check(const struct gather *g, struct err *e);

/* Rays traced so far. */
uint64_t view_gather_rays(const struct gather *g);

#endif
