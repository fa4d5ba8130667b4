/* From radiance to display: exposure, the sRGB transfer, false colour. */
#ifndef TWOPASS_TONEMAP_H
#define TWOPASS_TONEMAP_H

#include <stddef.h>

#include "lib/base/err.h"
#include "lib/picture/image.h"

/* A display picture: sRGB values in [0, 1], [height][width][3], row 0 at the top. */
struct canvas {
	int width, height;
	float *rgb;
};

/* Black. 0, or -1 and e. */
int picture_canvas_new(struct canvas *c, int width, int height, struct err *e);
void picture_canvas_free(struct canvas *c);

/* Rounds to integers of 8 or 16 bits: uint8_t or uint16_t [height][width][3]. */
void picture_canvas_quantise(const struct canvas *c, int bits, void *out);

/* All below take three channels of a picture; one channel given three times is
 * grey. Luminance is Rec. 709's .2126 R + .7152 G + .0722 B, or the grey value.
 * Pixels that are not finite in all of them become magenta and are counted in
 * the result. The canvas has the picture's size. Each is O(pixels). */

struct tone_curve {
	double exposure; /* EV: values are multiplied by 2^EV */
	double white;    /* what is shown as white, after exposure; > 0 */
	int compress;    /* 0: straight, cut off at white. 1: luminance L becomes
	                    L (1 + L / white^2) / (1 + L) (Reinhard et al. 2002, eq. 4) */
};

/* The exposure that brings the typical luminance to .18: the geometric mean of
 * those luminances of the finite pixels with luminance > 0 that lie between
 * their 5th and 95th percentiles (by bins of 1/64 EV, so to about .01 EV). Black
 * surroundings and lamps hardly change it. 0 for a picture with no such pixel;
 * *lit is their number. */
double picture_tonemap_exposure(const struct image *im, const int channel[3], size_t *lit);

size_t picture_tonemap_curve(const struct image *im, const int channel[3],
                             const struct tone_curve *curve, struct canvas *c);

/* A scale of false colours for luminance, min < max, and 0 < min if logarithmic. */
struct tone_scale {
	double min, max;
	int logarithmic;
};

/* Puts round numbers into the ends that are NaN: max the largest luminance
 * rounded up to 1, 2 or 5 times a power of ten; min, for a linear scale, 0 or the
 * least luminance rounded down likewise if negative; for a logarithmic one the
 * 1st percentile of the positive luminances rounded down, but at least
 * max / 10000. A picture with nothing to show gets 0 (or .01) to 1. 0, or -1
 * and e when a given end leaves no scale. */
int picture_tonemap_scale(const struct image *im, const int channel[3], struct tone_scale *s,
                          struct err *e);

/* Luminances beyond the ends get the colours of the ends. */
size_t picture_tonemap_false_colour(const struct image *im, const int channel[3],
                                    const struct tone_scale *s, struct canvas *c);

/* The colour of position t in [0, 1] of a scale: Green's cubehelix (D. A. Green,
 * Bull. Astr. Soc. India 39, 2011, 289), start .5, rotations -1.5, hue 1.2: its
 * brightness rises steadily from black to white, so it prints in grey as well. */
void picture_tonemap_colour(double t, float rgb[3]);

/* Position of a value on a scale, in [0, 1]. */
double picture_tonemap_position(const struct tone_scale *s, double value);

/* Replaces c by itself with a legend at its right: a bar of the scale's colours
 * and numbers. Pictures of fewer than 40 rows are extended to 40. 0, or -1 and e. */
int picture_legend_append(struct canvas *c, const struct tone_scale *s, struct err *e);

#endif
