#include "lib/picture/tonemap.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"

/* Of white: what photographers expose for, the reflectance of a grey card. */
static const double middle_grey = .18;

/* Parts of the lit pixels, by luminance, between which their mean is exposed for: lamps and dark
 * corners do not count. Guesses. */
static const double exposed_from = .05, exposed_to = .95;

/* Of a value: what powers of ten are off by rounding, and more. */
static const double rounded = 1e-9;

/* The part of the lit pixels that may lie below a logarithmic scale, and how far one reaches down
 * from its end at most, and in a picture without light: guesses. */
static const double below_scale = .01, scale_reach = 10000, dark_reach = 100;

static const float magenta[3] = { 1, 0, 1 };

/* ---- canvas ---- */

int picture_canvas_new(struct canvas *c, int width, int height, struct err *e)
{
	*c = (struct canvas){ .width = width, .height = height };
	c->rgb = mem_new((size_t)width * (size_t)height, 3 * sizeof *c->rgb,
	                 "a display picture", e);
	return c->rgb ? 0 : -1;
}

void picture_canvas_free(struct canvas *c)
{
	free(c->rgb);
	*c = (struct canvas){ 0 };
}

void picture_canvas_quantise(const struct canvas *c, int bits, void *out)
{
	size_t n = 3 * (size_t)c->width * (size_t)c->height;
	uint8_t *bytes = out;
	uint16_t *words = out;

	for (size_t i = 0; i < n; i++) {
		if (bits == 16)
			words[i] = (uint16_t)(c->rgb[i] * 65535.f + .5f);
		else
			bytes[i] = (uint8_t)(c->rgb[i] * 255.f + .5f);
	}
}

/* ---- luminance ---- */

/* One pixel's channels; 0 if one of them is not finite. */
static int pixel(const struct image *im, const int channel[3], size_t at, double rgb[3])
{
	for (int i = 0; i < 3; i++)
		rgb[i] = (double)picture_image_plane(im, channel[i])[at];
	return isfinite(rgb[0]) && isfinite(rgb[1]) && isfinite(rgb[2]);
}

static double luminance(const int channel[3], const double rgb[3])
{
	if (channel[0] == channel[1] && channel[1] == channel[2])
		return rgb[0];
	/* ITU-R BT.709. */
	return .2126 * rgb[0] + .7152 * rgb[1] + .0722 * rgb[2];
}

/* Histogram of log2 of positive luminances: all that floats have, 2^-149 to 2^128 times what
 * the weights make of it, at 1 percent. */
enum { BINS_PER_EV = 64, EV_MIN = -160, EV_MAX = 136, BINS = (EV_MAX - EV_MIN) * BINS_PER_EV };

struct histogram {
	size_t n;          /* positive luminances */
	double least, most; /* of all finite luminances; 0 if there are none */
	size_t count[BINS];
};

static struct histogram *histogram_new(const struct image *im, const int channel[3])
{
	struct histogram *h = calloc(1, sizeof *h);
	size_t pixels = (size_t)im->width * (size_t)im->height, finite = 0;
	double rgb[3];

	for (size_t i = 0; h && i < pixels; i++) {
		if (!pixel(im, channel, i, rgb))
			continue;
		double l = luminance(channel, rgb);
		h->least = finite == 0 || l < h->least ? l : h->least;
		h->most = finite == 0 || l > h->most ? l : h->most;
		finite++;
		if (l > 0) {
			h->count[(int)((log2(l) - EV_MIN) * BINS_PER_EV)]++;
			h->n++;
		}
	}
	return h;
}

/* log2 of the middle of a bin. */
static double bin_ev(int bin)
{
	return EV_MIN + (bin + .5) / BINS_PER_EV;
}

static double percentile(const struct histogram *h, double part)
{
	double below = 0;

	for (int i = 0; i < BINS; i++) {
		below += (double)h->count[i];
		if (below > part * (double)h->n)
			return exp2(bin_ev(i));
	}
	return 1;
}

double picture_tonemap_exposure(const struct image *im, const int channel[3], size_t *lit)
{
	struct histogram *h = histogram_new(im, channel);
	double below = 0, sum = 0, weight = 0;

	*lit = h ? h->n : 0;
	for (int i = 0; *lit && i < BINS; i++) {
		/* The part of this bin between the percentiles. */
		double from = fmax(below, exposed_from * (double)*lit);
		double to = fmin(below + (double)h->count[i], exposed_to * (double)*lit);

		if (to > from) {
			sum += (to - from) * bin_ev(i);
			weight += to - from;
		}
		below += (double)h->count[i];
	}
	free(h);
	return weight > 0 ? log2(middle_grey) - sum / weight : 0;
}

/* ---- the curve ---- */

/* IEC 61966-2-1. */
static double srgb(double v)
{
	v = fmin(1, fmax(0, v));
	return v <= .0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - .055;
}

static void put(struct canvas *c, size_t at, const float rgb[3])
{
	for (int i = 0; i < 3; i++)
		c->rgb[3 * at + (size_t)i] = rgb[i];
}

size_t picture_tonemap_curve(const struct image *im, const int channel[3],
                             const struct tone_curve *curve, struct canvas *c)
{
	size_t pixels = (size_t)im->width * (size_t)im->height, odd = 0;
	double gain = exp2(curve->exposure), white = curve->white, rgb[3];

	for (size_t i = 0; i < pixels; i++) {
		float shown[3];
		double scale = gain / white;

		if (!pixel(im, channel, i, rgb)) {
			put(c, i, magenta);
			odd++;
			continue;
		}
		if (curve->compress) {
			double l = fmax(0, gain * luminance(channel, rgb));

			scale = gain * (1 + l / (white * white)) / (1 + l);
		}
		for (int k = 0; k < 3; k++)
			shown[k] = (float)srgb(scale * rgb[k]);
		put(c, i, shown);
	}
	return odd;
}

/* ---- false colour ---- */

void picture_tonemap_colour(double t, float rgb[3])
{
	static const double start = .5, rotations = -1.5, hue = 1.2;
	double angle = 2 * PI * (start / 3 + 1 + rotations * t);
	double a = hue * t * (1 - t) / 2, x = a * cos(angle), y = a * sin(angle);

	rgb[0] = (float)fmin(1, fmax(0, t - .14861 * x + 1.78277 * y));
	rgb[1] = (float)fmin(1, fmax(0, t - .29227 * x - .90649 * y));
	rgb[2] = (float)fmin(1, fmax(0, t + 1.97294 * x));
}

double picture_tonemap_position(const struct tone_scale *s, double value)
{
	if (value <= s->min)
		return 0;
	if (value >= s->max)
		return 1;
	if (s->logarithmic)
		return log(value / s->min) / log(s->max / s->min);
	return (value - s->min) / (s->max - s->min);
}

/* 1, 2 or 5 times a power of ten, at least (up) or at most x > 0. */
static double round_number(double x, int up)
{
	static const double steps[] = { 1, 2, 5, 10 };
	double power = pow(10, floor(log10(x)));
	double below = power;

	for (int i = 0; i < 4; i++) {
		double v = steps[i] * power;

		/* A tolerance, because powers of ten are rounded. */
		if (up && v >= x * (1 - rounded))
			return v;
		if (!up && v <= x * (1 + rounded))
			below = v;
	}
	return up ? 10 * power : below;
}

int picture_tonemap_scale(const struct image *im, const int channel[3], struct tone_scale *s,
                          struct err *e)
{
	struct histogram *h = histogram_new(im, channel);
	int choose_min = isnan(s->min);

	if (!h)
		return err_set(e, "out of memory");
	if (isnan(s->max)) {
		if (h->most > 0)
			s->max = round_number(h->most, 1);
		else
			s->max = h->least < 0 && !s->logarithmic ? 0 : 1;
	}
	if (choose_min && s->logarithmic)
		s->min = fmax(h->n ? round_number(percentile(h, below_scale), 0) : 0,
		              s->max / (h->n ? scale_reach : dark_reach));
	else if (choose_min)
		s->min = h->least < 0 ? -round_number(-h->least, 1) : 0;
	/* A uniform picture of a round value, or all of it beyond the given end. */
	if (choose_min && s->logarithmic && s->min >= s->max)
		s->min = s->max / 10;
	free(h);
	if (s->logarithmic && !(s->min > 0))
		return err_set(e, "a logarithmic scale cannot begin at %g; use a linear one",
		               s->min);
	if (!(s->min < s->max))
		return err_set(e, "no scale reaches from %g to %g", s->min, s->max);
	return 0;
}

size_t picture_tonemap_false_colour(const struct image *im, const int channel[3],
                                    const struct tone_scale *s, struct canvas *c)
{
	size_t pixels = (size_t)im->width * (size_t)im->height, odd = 0;
	double rgb[3];
	float shown[3];

	for (size_t i = 0; i < pixels; i++) {
		if (!pixel(im, channel, i, rgb)) {
			put(c, i, magenta);
			odd++;
			continue;
		}
		picture_tonemap_colour(picture_tonemap_position(s, luminance(channel, rgb)), shown);
		put(c, i, shown);
	}
	return odd;
}
