#include "lib/hemicube/hemicube.h"

#include <math.h>
#include <stdlib.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/hemicube/hemicube_scene.h"

/* Antiderivatives (in both face coordinates) of the solid angle and of the form
 * factor density cos(theta) / pi, on the planes z = 1 (top) and x = 1 (side, y
 * across, z up). Form factors: integrals of 1 / (pi (1 + x^2 + y^2)^2) and of
 * z / (pi (1 + y^2 + z^2)^2), Cohen & Greenberg 1985, done in closed form.
 * Long double: a pixel is the small difference of four corners. */
static long double corner_angle(long double x, long double y)
{
	return atanl(x * y / sqrtl(1 + x * x + y * y));
}

/* 2 pi in long double, which PI is not. */
static long double two_pi(void)
{
	return 8 * atanl(1);
}

static long double corner_top(long double x, long double y)
{
	long double a = 1 / sqrtl(1 + x * x), b = 1 / sqrtl(1 + y * y);

	return (x * a * atanl(y * a) + y * b * atanl(x * b)) / two_pi();
}

static long double corner_side(long double y, long double z)
{
	long double c = 1 / sqrtl(1 + z * z);

	return -c * atanl(y * c) / two_pi();
}

typedef long double corner_fn(long double x, long double y);

/* Integrals over the pixels of a face of n columns whose row 0 begins at y0, by
 * differences of f at the corners. line: scratch, n + 1. */
static void integrate(corner_fn *f, int n, int rows, long double y0, long double *line,
                      double *out)
{
	for (int j = 0; j <= rows; j++) {
		long double y = y0 + 2 * (long double)j / n, before = 0;
		for (int i = 0; i <= n; i++) {
			long double at = f((long double)(2 * i - n) / n, y);
			if (i > 0 && j > 0)
				*out++ = (double)((at - before) - (line[i] - line[i - 1]));
			if (i > 0)
				line[i - 1] = before;
			before = at;
		}
		line[n] = before;
	}
}

/* Rounding is spread so that the sum is `total`. */
static void scale_to(double *a, size_t n, double total)
{
	long double sum = 0;

	for (size_t i = 0; i < n; i++)
		sum += a[i];
	for (size_t i = 0; i < n; i++)
		a[i] = (double)(a[i] * (total / sum));
}

static void fill_directions(struct hemicube_grid *g)
{
	static const double across[5][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, -1, 0 },
		{ -1, 0, 0 }, { 1, 0, 0 } };
	static const double ahead[5][3] = { { 0, 0, 1 }, { 1, 0, 0 }, { -1, 0, 0 },
		{ 0, 1, 0 }, { 0, -1, 0 } };
	double *d = g->direction;
	int n = g->n;

	for (int f = 0; f < 5; f++)
		for (int j = 0; j < (f ? n / 2 : n); j++)
			for (int i = 0; i < n; i++, d += 3) {
				double u = (double)(2 * i + 1 - n) / n;
				double v = (double)(2 * j + 1 - (f ? 0 : n)) / n;
				for (int k = 0; k < 3; k++)
					d[k] = u * across[f][k] + ahead[f][k];
				d[f ? 2 : 1] = v;
				v3_normalise(d);
			}
}

int ff_hemicube_grid_init(struct hemicube_grid *g, int n, struct err *e)
{
	*g = (struct hemicube_grid){ .n = n };
	if (n < 2 || n > HEMICUBE_N_MAX || n % 2)
		return err_set(e, "hemicube resolution %d: must be even, from 2 to %d", n,
		               HEMICUBE_N_MAX);
	size_t top = (size_t)n * (size_t)n, side = top / 2;
	g->pixels = 3 * top;
	g->delta = mem_new(g->pixels, sizeof *g->delta, "hemicube pixels", e);
	g->solid_angle = mem_new(g->pixels, sizeof *g->solid_angle, "hemicube pixels", e);
	g->direction = mem_new(g->pixels, 3 * sizeof *g->direction, "hemicube pixels", e);
	long double *line = mem_new((size_t)n + 1, sizeof *line, "hemicube pixels", e);
	if (!g->delta || !g->solid_angle || !g->direction || !line) {
		free(line);
		ff_hemicube_grid_free(g);
		return -1;
	}
	integrate(corner_top, n, n, -1, line, g->delta);
	integrate(corner_angle, n, n, -1, line, g->solid_angle);
	for (size_t f = 0; f < 4; f++) {
		integrate(corner_side, n, n / 2, 0, line, g->delta + top + f * side);
		integrate(corner_angle, n, n / 2, 0, line, g->solid_angle + top + f * side);
	}
	free(line);
	scale_to(g->delta, g->pixels, 1);
	scale_to(g->solid_angle, g->pixels, 2 * PI);
	fill_directions(g);
	return 0;
}

void ff_hemicube_grid_free(struct hemicube_grid *g)
{
	free(g->delta);
	free(g->solid_angle);
	free(g->direction);
	*g = (struct hemicube_grid){ 0 };
}

static size_t pixel_coordinate(double x, int n)
{
	int i = (int)(x * (n / 2));

	return (size_t)(i < 0 ? 0 : i >= n ? n - 1 : i);
}

size_t ff_hemicube_lookup(const struct hemicube_grid *g, const double d[3])
{
	double x = fabs(d[0]), y = fabs(d[1]), z = d[2] > 0 ? d[2] : 0;
	size_t n = (size_t)g->n;

	if (z >= x && z >= y)
		return pixel_coordinate(d[1] / z + 1, g->n) * n +
		       pixel_coordinate(d[0] / z + 1, g->n);
	size_t face = x >= y ? d[0] < 0 : 2 + (size_t)(d[1] < 0);
	double w = x >= y ? x : y;
	double u = x >= y ? (d[0] < 0 ? -d[1] : d[1]) : (d[1] < 0 ? d[0] : -d[0]);
	return n * n + face * (n * n / 2) + pixel_coordinate(z / w, g->n) * n +
	       pixel_coordinate(u / w + 1, g->n);
}

int ff_hemicube_init(struct hemicube *h, const struct hemicube_grid *g, struct err *e)
{
	*h = (struct hemicube){ .grid = g };
	h->item = mem_new(g->pixels + HEMICUBE_LANES, sizeof *h->item, "item buffer", e);
	h->depth = mem_new(g->pixels + HEMICUBE_LANES, sizeof *h->depth, "depth buffer", e);
	h->work = mem_new(1, sizeof *h->work, "hemicube", e);
	if (h->work)
		h->work->far = mem_new(ff_hemicube_tiles(g->n) * (ff_hemicube_tiles(g->n) + 4 * ff_hemicube_tiles(g->n / 2)),
		                       sizeof *h->work->far, "depth tiles", e);
	if (!h->item || !h->depth || !h->work || !h->work->far) {
		ff_hemicube_free(h);
		return -1;
	}
	return 0;
}

void ff_hemicube_free(struct hemicube *h)
{
	free(h->item);
	free(h->depth);
	if (h->work)
		free(h->work->far);
	free(h->work);
	*h = (struct hemicube){ 0 };
}
