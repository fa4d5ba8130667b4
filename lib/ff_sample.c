/* Where the rays of a row begin and go. The loops over a batch are written without
 * branches and calls, so that compilers turn them into vector code. */
#include <math.h>

#include "ff_job.h"
#include "vec3.h"

#define PI 3.14159265358979323846

void ff_element_table(struct ff_job *j)
{
	const struct model *m = j->m;

	for (size_t p = 0; p < m->patches; p++) {
		double sum = 0;
		for (uint32_t i = m->patch_start[p]; i < m->patch_start[p + 1]; i++) {
			struct ff_element *el = &j->element[i];
			const uint32_t *c = &m->element[3 * (size_t)i];
			const double *a = &m->vertex[3 * (size_t)c[0]];
			/* Clear of walls along the edges by a few float32 steps of the
			 * scene, but never far from where the sample belongs. */
			double inset = fmin(.2, 4 * ray_offset(j->rays) / sqrt(m->element_area[i]));
			el->cdf = sum += m->element_area[i];
			el->per_area = 1 / m->element_area[i];
			for (int k = 0; k < 2; k++)
				v3_sub(&m->vertex[3 * (size_t)c[k + 1]], a, el->edge[k]);
			for (int k = 0; k < 3; k++) {
				el->corner[k] = a[k] + inset / 3 * (el->edge[0][k] + el->edge[1][k]);
				el->edge[0][k] *= 1 - inset;
				el->edge[1][k] *= 1 - inset;
			}
			v3_frame(&m->element_normal[3 * (size_t)i], el->tangent[0], el->tangent[1]);
		}
	}
}

void ff_normal(const struct ff_job *j, uint32_t element, int side, double n[3])
{
	double s = side ? -1 : 1;

	for (int k = 0; k < 3; k++)
		n[k] = s * j->m->element_normal[3 * (size_t)element + (size_t)k];
}

/* The element of a patch that a number in [0,1) chooses by area; what is left of the
 * number, again uniform, replaces it. Binary search without branches to mispredict. */
static uint32_t choose(const struct ff_job *j, uint32_t patch, double *u)
{
	uint32_t first = j->m->patch_start[patch], lo = first;
	uint32_t n = j->m->patch_start[patch + 1] - first;
	double area = *u * j->element[first + n - 1].cdf;

	while (n > 1) {
		uint32_t half = n / 2;
		lo += j->element[lo + half - 1].cdf <= area ? half : 0;
		n -= half;
	}
	double before = lo > first ? j->element[lo - 1].cdf : 0;
	*u = fmin(1, fmax(0, (area - before) * j->element[lo].per_area));
	return lo;
}

uint32_t ff_point(const struct ff_job *j, uint32_t patch, double u0, double u1, double x[3])
{
	uint32_t i = choose(j, patch, &u0);
	const struct ff_element *el = &j->element[i];
	double r = sqrt(u0), w1 = r * (1 - u1), w2 = r * u1;

	for (int k = 0; k < 3; k++)
		x[k] = el->corner[k] + w1 * el->edge[0][k] + w2 * el->edge[1][k];
	return i;
}

void ff_batch_numbers(const struct ff_job *j, const uint32_t seed[4], uint32_t first,
                      uint32_t n, struct ff_batch_rays *b)
{
	uint32_t bits[4][FF_BATCH] = { { 0 } };

	for (uint32_t i = 0; i < n; i++)
		for (int d = 0; d < 4; d++)
			bits[d][i] = first + i < j->sobol_points
			           ? j->sobol[(size_t)(first + i) * FF_DIMS + (size_t)d]
			           : rng_sobol_bits(first + i, d);
	for (int d = 0; d < 4; d++)
		for (int i = 0; i < FF_BATCH; i++)
			b->u[d][i] = rng_scramble(bits[d][i], seed[d]);
}

void ff_batch_origins(const struct ff_job *j, uint32_t ps, uint32_t n, struct ff_batch_rays *b)
{
	double off = ray_offset(j->rays) * (ps & 1 ? -1 : 1);

	for (uint32_t i = 0; i < n; i++)
		b->element[i] = choose(j, ps >> 1, &b->u[0][i]);
	for (uint32_t i = 0; i < n; i++) {
		const struct ff_element *el = &j->element[b->element[i]];
		const double *normal = &j->m->element_normal[3 * (size_t)b->element[i]];
		double r = sqrt(b->u[0][i]), w1 = r * (1 - b->u[1][i]), w2 = r * b->u[1][i];
		for (int k = 0; k < 3; k++)
			b->org[k][i] = el->corner[k] + w1 * el->edge[0][k] + w2 * el->edge[1][k] +
			               off * normal[k];
	}
}

/* Cosine and sine of 2 pi u for a batch, to 1e-11, by Taylor series at the half angle. */
static void turns(const double *u, double *x, double *y)
{
	for (int i = 0; i < FF_BATCH; i++) {
		double h = PI * u[i] - PI / 2, q = h * h;
		double s = h * (1 + q * (-1. / 6 + q * (1. / 120 + q * (-1. / 5040 +
		           q * (1. / 362880 + q * (-1. / 39916800 + q * (1. / 6227020800. +
		           q * (-1. / 1307674368000.))))))));
		double c = 1 + q * (-1. / 2 + q * (1. / 24 + q * (-1. / 720 + q * (1. / 40320 +
		           q * (-1. / 3628800 + q * (1. / 479001600. + q * (-1. / 87178291200. +
		           q * (1. / 20922789888000.))))))));
		x[i] = 2 * s * s - 1;
		y[i] = -2 * s * c;
	}
}

void ff_batch_directions(const struct ff_job *j, uint32_t ps, uint32_t n,
                         struct ff_batch_rays *b)
{
	double x[FF_BATCH], y[FF_BATCH], z[FF_BATCH], side = ps & 1 ? -1 : 1;

	turns(b->u[3], x, y);
	for (int i = 0; i < FF_BATCH; i++) {
		double sine = sqrt(b->u[2][i]);
		x[i] *= sine;
		y[i] *= sine;
		z[i] = side * sqrt(1 - b->u[2][i]);
	}
	for (uint32_t i = 0; i < n; i++) {
		const struct ff_element *el = &j->element[b->element[i]];
		const double *normal = &j->m->element_normal[3 * (size_t)b->element[i]];
		for (int k = 0; k < 3; k++)
			b->dir[k][i] = x[i] * el->tangent[0][k] + y[i] * el->tangent[1][k] +
			               z[i] * normal[k];
	}
}
