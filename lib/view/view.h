/* The view-dependent pass: pictures of a solved scene.
 *
 * The radiance that point j sends to the eye is equation (1) of Nishitani and Nono, A Two-Pass
 * Solution to the Global Illumination Model, as radiance:
 *
 *     L(j, eye) = L_e(j, eye)                                 emission            [KE term]
 *               + M(j) / pi                                   diffuse light       [(2), KD term]
 *               + integral of f_s(wi, eye) L(j, wi) cos dwi   directional part    [KS term]
 *
 *     M(j) = rho_d H(this side) + tau_d(other side) H(other side)
 *
 * f_s being the lobes of reflection and of transmission, ideal ones included (lib/scatter/bsdf.h).
 * H, the irradiance of pass 1, holds every path up to its last diffuse event: it is interpolated
 * between elements, or computed at the point (enum view_method). The integral is found by
 * following rays, the specular tail (specular_path.h): in the mirror and the straight-through
 * direction, or by samples of the lobes. Nothing is counted twice: a tail adds M / pi and L_e
 * of each surface it meets, and goes on by the directional part alone.
 * Cost: O(pixels samples log triangles), times the tails' branches. */
#ifndef TWOPASS_VIEW_H
#define TWOPASS_VIEW_H

#include <stdint.h>

#include "lib/base/err.h"
#include "lib/base/parallel.h"
#include "lib/data/model.h"
#include "lib/picture/camera.h"
#include "lib/picture/image.h"
#include "lib/ray/ray.h"

/* Layers beside R, G, B. Z, N, element and patch are those at the pixel's centre:
 * Z the camera depth (infinite where nothing is seen), N the geometric normal of
 * the side seen, element and patch their numbers (-1 where nothing is seen). Error is the
 * estimated standard error of R, G, B: what interpolation and the noise of the solution
 * leave in interpolated light, that of sampled light, and that of the pixel's samples among
 * one another. */
enum {
	VIEW_DIFFUSE = 1, VIEW_DIRECTIONAL = 2, VIEW_EMISSION = 4, VIEW_Z = 8,
	VIEW_N = 16, VIEW_ELEMENT = 32, VIEW_PATCH = 64, VIEW_ERROR = 128, VIEW_ALL = 255
};

/* Where diffuse light comes from: all of it interpolated between the elements; that from
 * emitters, straight, computed for each point; that, and indirect light gathered against the
 * solution. */
enum view_method { VIEW_MESH, VIEW_DIRECT, VIEW_GATHER };

enum { VIEW_LOBE_ENOUGH = -1 };

struct view_options {
	int samples;       /* of a pixel; 1 = its centre, else stratified over it */
	double relative;   /* a pixel takes samples until its standard error is this times
	                      its radiance, after `samples` at the latest; 0: never */
	int lobe_samples;  /* of a finite lobe; 0 = one ray in the mirror or straight-through
	                      direction (the paper); VIEW_LOBE_ENOUGH: as many as it takes */
	int depth;         /* directional events followed */
	double cutoff;     /* tails of less than this part of a pixel are cut */
	unsigned layers;   /* VIEW_... */
	int gather_rays;   /* that indirect light is gathered by at a point */
	int threads;
};

/* Guesses, but README.md has what samples and gathering rays cost and bring (tests/bench/report).
 * Depth 32: what mirrors of .8 leave is then below the cutoff. */
#define VIEW_OPTIONS_DEFAULT \
	((struct view_options){ .samples = 4, .lobe_samples = VIEW_LOBE_ENOUGH, .depth = 32, \
	                        .cutoff = 1e-3, .gather_rays = 1024 })

struct view_stats {
	uint64_t rays;
	double radiance;   /* mean over pixels, summed over bands */
	double cut;        /* bound on what cut tails would have added to it; infinite
	                      where no bound exists */
	double error;      /* estimated relative rmse: the root mean square of standard errors
	                      over the mean radiance, of pixels that show neither an emitter
	                      nor nothing */
};

struct solution;
struct view_scene;

/* What all views share: tables of materials, interpolated irradiance, the brightest
 * radiance, emitters. m, s and rays must outlive it. NULL and e on failure. O(elements). */
struct view_scene *view_scene_new(const struct model *m, const struct solution *s,
                                  const struct ray_scene *rays, enum view_method method,
                                  int threads, struct err *e);
void view_scene_free(struct view_scene *v);

/* 1 if highlights may be missing: of punctual lights that curved mirrors turn, or plane ones
 * more often than there are images for (lib/ray/light_visibility.h). */
int view_misses(const struct view_scene *v);

/* Names of the layers, in the order of their bits, then `all`, then NULL. */
extern const char *const view_layer_name[];

/* Renders into a new picture: channels R, G, B (one band: all the same; otherwise
 * bands 0, 1, 2, or the last there is), `band.0` and so on unless there are 1 or 3
 * bands, and the layers. The same bytes for any number of threads. */
int view_render(const struct view_scene *v, const struct view_frame *f,
                const struct view_options *o, const struct progress *progress,
                struct image *picture, struct view_stats *stats, struct err *e);

#endif
