#include "lib/picture/compare.h"

#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"

const int picture_compare_percentile[COMPARE_PERCENTILES] = { 50, 95, 99 };

struct sums {
	double a, b, squares;
};

/* Channels of two pictures. */
struct pair {
	const struct image *a, *b;
	const int *channel_a, *channel_b;
	int n;
};

static double relative(double x, double mean)
{
	return x == 0 ? 0 : x / fabs(mean);
}

/* One pixel into the sums, its largest and its relative error, if it is finite in all
 * channels. */
static int add_pixel(const struct pair *p, size_t at, struct sums *s, double *worst, float *error)
{
	double off = 0, size = 0;

	for (int c = 0; c < p->n; c++)
		if (!isfinite(picture_image_plane(p->a, p->channel_a[c])[at]) ||
		    !isfinite(picture_image_plane(p->b, p->channel_b[c])[at]))
			return 0;
	*worst = 0;
	for (int c = 0; c < p->n; c++) {
		double x = picture_image_plane(p->a, p->channel_a[c])[at];
		double y = picture_image_plane(p->b, p->channel_b[c])[at];

		s->a += x;
		s->b += y;
		off += (x - y) * (x - y);
		size += y * y;
		*worst = fmax(*worst, fabs(x - y));
	}
	s->squares += off;
	*error = (float)relative(sqrt(off), sqrt(size));
	return 1;
}

static int by_size(const void *x, const void *y)
{
	float a = *(const float *)x, b = *(const float *)y;

	return (a > b) - (a < b);
}

static void rank(float *error, struct compare *out)
{
	qsort(error, out->pixels, sizeof *error, by_size);
	for (int i = 0; i < COMPARE_PERCENTILES; i++) {
		size_t at = (out->pixels * (size_t)picture_compare_percentile[i] + 99) / 100;
		out->percentile[i] = (double)error[at > 0 ? at - 1 : 0];
	}
}

/* A row of pixels; rounding of large pictures stays small when rows are summed apart. */
static void add_row(const struct pair *p, int y, const unsigned char *mask, float *error,
                    struct sums *total, struct compare *out)
{
	struct sums row = { 0 };

	for (int x = 0; x < p->a->width; x++) {
		size_t at = (size_t)y * (size_t)p->a->width + (size_t)x;
		double worst;

		if (mask && mask[at]) {
			out->excluded++;
			continue;
		}
		if (!add_pixel(p, at, &row, &worst, &error[out->pixels])) {
			out->left_out++;
			continue;
		}
		if (out->pixels++ == 0 || worst > out->max) {
			out->max = worst;
			out->max_x = x;
			out->max_y = y;
		}
	}
	total->a += row.a;
	total->b += row.b;
	total->squares += row.squares;
}

int picture_compare_channels(const struct image *a, const int *channel_a, const struct image *b,
                             const int *channel_b, int n, const unsigned char *mask,
                             struct compare *out, struct err *e)
{
	struct pair p = { a, b, channel_a, channel_b, n };
	size_t pixels = (size_t)a->width * (size_t)a->height;
	float *error = mem_new(pixels, sizeof *error, "pixel errors", e);
	struct sums total = { 0 };

	*out = (struct compare){ .max_x = -1, .max_y = -1 };
	if (!error)
		return -1;
	for (int y = 0; y < a->height; y++)
		add_row(&p, y, mask, error, &total, out);
	if (out->pixels > 0) {
		double values = (double)out->pixels * n;
		out->mean_a = total.a / values;
		out->mean_b = total.b / values;
		out->rmse = sqrt(total.squares / values);
		out->bias = out->mean_a - out->mean_b;
		out->relative_rmse = relative(out->rmse, out->mean_b);
		out->relative_bias = relative(out->bias, out->mean_b);
		rank(error, out);
	}
	free(error);
	return 0;
}

int picture_compare_mask_emitters(const struct image *im, unsigned char *mask)
{
	size_t pixels = (size_t)im->width * (size_t)im->height;
	int channel[3], n = picture_image_layer(im, "emission", channel);

	for (int c = 0; c < n; c++)
		for (size_t i = 0; i < pixels; i++)
			mask[i] = mask[i] || picture_image_plane(im, channel[c])[i] != 0;
	return n ? 0 : -1;
}

int picture_compare_mask_nothing(const struct image *im, unsigned char *mask)
{
	size_t pixels = (size_t)im->width * (size_t)im->height;
	int element = picture_image_channel(im, "element"), z = picture_image_channel(im, "Z");

	for (size_t i = 0; i < pixels && element >= 0; i++)
		mask[i] = mask[i] || picture_image_plane(im, element)[i] < 0;
	for (size_t i = 0; i < pixels && z >= 0; i++)
		mask[i] = mask[i] || isinf(picture_image_plane(im, z)[i]);
	return element >= 0 || z >= 0 ? 0 : -1;
}

int picture_compare_difference(const struct image *a, const int *channel_a, const struct image *b,
                               const int *channel_b, int n, struct image *out, struct err *e)
{
	const char **name = mem_new((size_t)n, sizeof *name, "channel names", e);
	size_t pixels = (size_t)a->width * (size_t)a->height;
	int status;

	if (!name)
		return -1;
	for (int c = 0; c < n; c++)
		name[c] = a->name[channel_a[c]];
	status = picture_image_new(out, a->width, a->height, n, name, e);
	for (int c = 0; c < n && status == 0; c++) {
		const float *x = picture_image_plane(a, channel_a[c]);
		const float *y = picture_image_plane(b, channel_b[c]);

		for (size_t i = 0; i < pixels; i++)
			picture_image_plane(out, c)[i] = x[i] - y[i];
	}
	free(name);
	return status;
}
