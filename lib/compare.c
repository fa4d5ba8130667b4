#include "compare.h"

#include <math.h>
#include <stdlib.h>

#include "mem.h"

struct sums {
	double a, b, squares;
};

static double relative(double x, double mean)
{
	return x == 0 ? 0 : x / fabs(mean);
}

/* One pixel into the sums, if it is finite in all channels. */
static int add_pixel(const struct image *a, const int *ca, const struct image *b,
                     const int *cb, int n, size_t at, struct sums *s, double *worst)
{
	for (int c = 0; c < n; c++)
		if (!isfinite(image_plane(a, ca[c])[at]) || !isfinite(image_plane(b, cb[c])[at]))
			return 0;
	*worst = 0;
	for (int c = 0; c < n; c++) {
		double x = image_plane(a, ca[c])[at], y = image_plane(b, cb[c])[at];

		s->a += x;
		s->b += y;
		s->squares += (x - y) * (x - y);
		*worst = fmax(*worst, fabs(x - y));
	}
	return 1;
}

void compare_channels(const struct image *a, const int *channel_a, const struct image *b,
                      const int *channel_b, int n, struct compare *out)
{
	struct sums total = { 0 };

	*out = (struct compare){ .max_x = -1, .max_y = -1 };
	/* Sums by rows keep the rounding of large pictures small. */
	for (int y = 0; y < a->height; y++) {
		struct sums row = { 0 };

		for (int x = 0; x < a->width; x++) {
			size_t at = (size_t)y * (size_t)a->width + (size_t)x;
			double worst;

			if (!add_pixel(a, channel_a, b, channel_b, n, at, &row, &worst)) {
				out->left_out++;
				continue;
			}
			if (out->pixels++ == 0 || worst > out->max) {
				out->max = worst;
				out->max_x = x;
				out->max_y = y;
			}
		}
		total.a += row.a;
		total.b += row.b;
		total.squares += row.squares;
	}
	if (out->pixels == 0)
		return;
	double values = (double)out->pixels * n;
	out->mean_a = total.a / values;
	out->mean_b = total.b / values;
	out->rmse = sqrt(total.squares / values);
	out->bias = out->mean_a - out->mean_b;
	out->relative_rmse = relative(out->rmse, out->mean_b);
	out->relative_bias = relative(out->bias, out->mean_b);
}

int compare_difference(const struct image *a, const int *channel_a, const struct image *b,
                       const int *channel_b, int n, struct image *out, struct err *e)
{
	const char **name = mem_new((size_t)n, sizeof *name, "channel names", e);
	size_t pixels = (size_t)a->width * (size_t)a->height;
	int status;

	if (!name)
		return -1;
	for (int c = 0; c < n; c++)
		name[c] = a->name[channel_a[c]];
	status = image_new(out, a->width, a->height, n, name, e);
	for (int c = 0; c < n && status == 0; c++) {
		const float *x = image_plane(a, channel_a[c]), *y = image_plane(b, channel_b[c]);

		for (size_t i = 0; i < pixels; i++)
			image_plane(out, c)[i] = x[i] - y[i];
	}
	free(name);
	return status;
}
