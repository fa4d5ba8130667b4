/* The yardstick: unbiased Monte Carlo solutions of exactly the light model of
 * bsdf.h, by eye paths for pictures and by particles for irradiance. It shares the
 * scattering model, the cameras and the rays with the two-pass method, nothing
 * else. Results depend on the seed but not on the number of threads. */
#ifndef TWOPASS_PATHTRACE_H
#define TWOPASS_PATHTRACE_H

#include <stdint.h>

#include "lib/base/err.h"
#include "lib/base/parallel.h"
#include "lib/data/model.h"
#include "lib/picture/camera.h"
#include "lib/picture/image.h"
#include "lib/ray/ray.h"

struct pathtrace;

/* Tables of the emitters and of the triangles' planes; m and rays must outlive
 * them. NULL and e on failure, also when nothing emits. O(triangles). */
struct pathtrace *pathtrace_new(const struct model *m, const struct ray_scene *rays,
                                struct err *e);
void pathtrace_free(struct pathtrace *p);

/* 1 if the variance of eye paths diverges: the paper's lobe with a finite exponent
 * weighs 1 / cos theta_o when seen from the eye. */
int pathtrace_diverges(const struct model *m);

/* 1 if pictures may miss light: of punctual lights that curved mirrors turn, or plane ones
 * more often than there are images for (lib/ray/light_visibility.h). */
int pathtrace_misses(const struct pathtrace *p);

struct pathtrace_options {
	long samples;      /* paths a pixel (at least 1), or particles in all (2) */
	uint64_t seed;
	int centre;        /* all paths begin at the pixel's centre */
	int threads;
};

/* Renders into a new picture: channels R, G, B (one band: all the same; otherwise
 * bands 0, 1, 2, or the last there is), `band.0` and so on unless there are 1 or 3
 * bands, and for each of these a channel `stderr.R` and so on with the standard
 * error of the pixel, from batches of its samples. *relative_error (may be NULL):
 * the root mean square of the standard errors of R, G and B over their mean. One
 * sample has no standard error: no such channels, and infinity.
 * Next-event estimation of the area emitters with multiple importance sampling, and of
 * punctual lights and their images in plane mirrors, also through clear panes; ideal events
 * are followed; Russian roulette after a few bounces. O(pixels samples bounces log triangles). */
int pathtrace_picture(const struct pathtrace *p, const struct view_frame *f,
                      const struct pathtrace_options *o, const struct progress *progress,
                      struct image *picture, double *relative_error, struct err *e);

/* Irradiance of element-sides, row 2e+s, [2E][bands]; a flux per band. */
struct pathtrace_irradiance {
	double *h, *error;          /* and its standard error: that of one particle
	                               where none arrived */
	double emitted[BANDS_MAX];
	double escaped[BANDS_MAX], escaped_error[BANDS_MAX];
};

/* Follows particles from the emitters until they are absorbed or escape.
 * O(particles bounces log triangles) time, O(threads elements bands) memory. */
int pathtrace_particles(const struct pathtrace *p, const struct pathtrace_options *o,
                        const struct progress *progress, struct pathtrace_irradiance *out,
                        struct err *e);
void pathtrace_irradiance_free(struct pathtrace_irradiance *i);

#endif
