/* Where the rays of a row begin, go and land. The loops that make a batch are without
 * branches and calls, so that compilers turn them into vector code. */
#include "lib/ff_rays/ray_samples.h"

#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/vec.h"

/* From the centre of a triangle to its farthest corner, by the edges from one corner. */
static double reach(const double a[4], const double b[4])
{
	double far = 0;

	for (int i = 0; i < 3; i++) {
		double s = i == 1 ? 2 : -1, t = i == 2 ? 2 : -1, d[3];
		for (int k = 0; k < 3; k++)
			d[k] = (s * a[k] + t * b[k]) / 3;
		far = fmax(far, v3_length(d));
	}
	return far;
}

static void fill_element(const struct ff_job *j, uint32_t i)
{
	const struct model *m = j->m;
	struct ff_element *el = &j->element[i];
	const uint32_t *c = &m->element.corner[3 * (size_t)i];
	const double *a = &m->vertex[3 * (size_t)c[0]];
	const double *normal = &m->element.normal[3 * (size_t)i];
	double inset = ray_inset(j->rays, m->element.area[i]);
	double tangent[2][3];

	v3_frame(normal, tangent[0], tangent[1]);
	for (int k = 0; k < 2; k++)
		v3_sub(&m->vertex[3 * (size_t)c[k + 1]], a, el->edge[k]);
	el->size = fmax(sqrt(m->element.area[i]), reach(el->edge[0], el->edge[1]));
	for (int k = 0; k < 3; k++) {
		el->corner[k] = a[k] + inset / 3 * (el->edge[0][k] + el->edge[1][k]);
		el->edge[0][k] *= 1 - inset;
		el->edge[1][k] *= 1 - inset;
		el->normal[k] = (float)normal[k];
		el->tangent[0][k] = (float)tangent[0][k];
		el->tangent[1][k] = (float)tangent[1][k];
	}
}

void ff_element_table(struct ff_job *j)
{
	const struct model *m = j->m;

	for (size_t p = 0; p < m->patch.n; p++) {
		double sum = 0, scale = 0x1p32 / m->patch.area[p];
		for (uint32_t i = m->patch.start[p]; i < m->patch.start[p + 1]; i++) {
			struct ff_element *el = &j->element[i];
			fill_element(j, i);
			el->before = (uint32_t)fmin(0xffffffffu, sum * scale);
			el->per_part = (float)(1 / (m->element.area[i] * scale));
			el->cdf = sum += m->element.area[i];
			el->per_area = 1 / m->element.area[i];
		}
	}
}

void ff_normal(const struct ff_job *j, uint32_t element, int side, double n[3])
{
	double s = side ? -1 : 1;

	for (int k = 0; k < 3; k++)
		n[k] = s * j->m->element.normal[3 * (size_t)element + (size_t)k];
}

/* Binary search without branches to mispredict. */
uint32_t ff_choose(const struct ff_job *j, uint32_t patch, double *u)
{
	uint32_t first = j->m->patch.start[patch], lo = first;
	uint32_t n = j->m->patch.start[patch + 1] - first;
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
	uint32_t i = ff_choose(j, patch, &u0);
	const struct ff_element *el = &j->element[i];
	double r = sqrt(u0), w1 = r * (1 - u1), w2 = r * u1;

	for (int k = 0; k < 3; k++)
		x[k] = el->corner[k] + w1 * el->edge[0][k] + w2 * el->edge[1][k];
	return i;
}

void ff_rays_numbers(const struct ff_samples *s, const uint32_t seed[4], uint32_t first,
                     uint32_t n, struct ff_ray_batch *b)
{
	uint32_t bits[RAY_BATCH] = { 0 };

	for (int d = 0; d < 4; d++) {
		uint32_t known = first < s->n ? s->n - first : 0;
		known = known < n ? known : n;
		if (known)
			memcpy(bits, &s->bits[(size_t)d * s->n + first], known * sizeof *bits);
		for (uint32_t i = known; i < n; i++)
			bits[i] = rng_sobol_bits(first + i, d);
		for (int i = 0; i < RAY_BATCH; i++)
			bits[i] = rng_scramble_bits(bits[i], seed[d]);
		if (d == 0)
			memcpy(b->choice, bits, sizeof b->choice);
		for (int i = 0; i < RAY_BATCH; i++)
			b->u[d][i] = (float)(int32_t)(bits[i] >> 8) * 0x1p-24f;
	}
}

/* The last element whose share begins at or before the number: for few elements by
 * counting, all rays at once; for many by binary search. */
static void count_choices(const struct ff_element *el, uint32_t elements, struct ff_ray_batch *b)
{
	for (int i = 0; i < RAY_BATCH; i++)
		b->element[i] = 0;
	for (uint32_t k = 1; k < elements; k++) {
		uint32_t before = el[k].before;
		for (int i = 0; i < RAY_BATCH; i++)
			b->element[i] += b->choice[i] >= before;
	}
}

static void search_choices(const struct ff_element *el, uint32_t elements, uint32_t n,
                           struct ff_ray_batch *b)
{
	for (uint32_t i = 0; i < n; i++) {
		uint32_t lo = 0, left = elements;
		while (left > 1) {
			uint32_t half = left / 2;
			lo += el[lo + half].before <= b->choice[i] ? half : 0;
			left -= half;
		}
		b->element[i] = lo;
	}
}

void ff_rays_elements(const struct ff_job *j, uint32_t patch, uint32_t n,
                      struct ff_ray_batch *b)
{
	enum { FEW = 24 };
	uint32_t first = j->m->patch.start[patch], elements = j->m->patch.start[patch + 1] - first;
	const struct ff_element *el = &j->element[first];

	if (elements <= FEW)
		count_choices(el, elements, b);
	else
		search_choices(el, elements, n, b);
	for (uint32_t i = 0; i < n; i++) {
		const struct ff_element *chosen = &el[b->element[i]];
		float left = (float)(b->choice[i] - chosen->before) * chosen->per_part;
		b->u[0][i] = left < 1 ? left : 1;
		b->element[i] += first;
	}
}

/* Vectors of a struct ff_element; the fourth lane idles. */
typedef double d4 __attribute__((vector_size(32), aligned(8), may_alias));
typedef float f4 __attribute__((vector_size(16), aligned(4), may_alias));

void ff_rays_origins(const struct ff_job *j, int side, uint32_t n, struct ff_ray_batch *b)
{
	struct ray_units units = ray_units(j->rays);
	double off = ray_offset(j->rays) * (side ? -1 : 1);
	d4 centre = { units.centre[0], units.centre[1], units.centre[2], 0 };
	float w1[RAY_BATCH], w2[RAY_BATCH];

	for (int i = 0; i < RAY_BATCH; i++) {
		float r = sqrtf(b->u[0][i]);
		w2[i] = r * b->u[1][i];
		w1[i] = r - w2[i];
	}
	for (uint32_t i = 0; i < n; i++) {
		const struct ff_element *el = &j->element[b->element[i]];
		d4 x = *(const d4 *)el->corner - centre;
		x += (double)w1[i] * *(const d4 *)el->edge[0] + (double)w2[i] * *(const d4 *)el->edge[1];
		x += off * __builtin_convertvector(*(const f4 *)el->normal, d4);
		f4 out = __builtin_convertvector(x * units.per_unit, f4);
		for (int k = 0; k < 3; k++)
			b->ray.org[k][i] = out[k];
	}
}

/* Cosine and sine of 2 pi u for a batch, to 2e-7, by Taylor series at the half angle. */
static void turns(const float *u, float *x, float *y)
{
	for (int i = 0; i < RAY_BATCH; i++) {
		float h = (float)PI * u[i] - (float)(PI / 2), q = h * h;
		float s = h * (1 + q * (-1.f / 6 + q * (1.f / 120 + q * (-1.f / 5040 +
		          q * (1.f / 362880 + q * (-1.f / 39916800))))));
		float c = 1 + q * (-1.f / 2 + q * (1.f / 24 + q * (-1.f / 720 + q * (1.f / 40320 +
		          q * (-1.f / 3628800 + q * (1.f / 479001600))))));
		x[i] = 2 * s * s - 1;
		y[i] = -2 * s * c;
	}
}

void ff_rays_directions(const struct ff_job *j, int side, uint32_t n, struct ff_ray_batch *b)
{
	float x[RAY_BATCH], y[RAY_BATCH], z[RAY_BATCH], sign = side ? -1 : 1;

	turns(b->u[3], x, y);
	for (int i = 0; i < RAY_BATCH; i++) {
		float sine = sqrtf(b->u[2][i]);
		x[i] *= sine;
		y[i] *= sine;
		z[i] = sign * sqrtf(1 - b->u[2][i]);
	}
	for (uint32_t i = 0; i < n; i++) {
		const struct ff_element *el = &j->element[b->element[i]];
		f4 d = x[i] * *(const f4 *)el->tangent[0] + y[i] * *(const f4 *)el->tangent[1] +
		       z[i] * *(const f4 *)el->normal;
		for (int k = 0; k < 3; k++)
			b->ray.dir[k][i] = d[k];
	}
}

struct ff_scramble ff_scramble(const struct ff_job *j, uint32_t row, uint32_t replicate)
{
	struct ff_scramble s;
	uint64_t seed = rng_mix(rng_mix(j->o.seed) ^ rng_mix(((uint64_t)row << 8) | replicate));

	for (int d = 0; d < FF_DIMS; d++)
		s.seed[d] = rng_sobol_seed(seed, d);
	return s;
}

/* Rays are made, cast, located and tallied by the batch: each loop then overlaps the
 * latencies of many rays, where one ray at a time would wait for each in turn. */
void ff_rays_cast(const struct ff_job *j, uint32_t n, struct ff_ray_batch *b)
{
	static const int32_t nowhere = ~0;
	const struct locator *l = &j->locator;
	const int32_t *way[RAY_BATCH]; /* where the search for an element begins */

	ray_nearest_batch(j->rays, &b->ray, n);
	for (uint32_t i = 0; i < n; i++) {
		way[i] = b->ray.triangle[i] == RAY_MISS ? &nowhere
		       : ray_locate_begin(l, b->ray.triangle[i], b->ray.w[0][i], b->ray.w[1][i]);
		__builtin_prefetch(way[i]);
	}
	for (uint32_t i = 0; i < n; i++)
		b->hit[i] = ray_locate_below(l, *way[i], b->ray.w[0][i], b->ray.w[1][i]);
}

void ff_rays_from_patch(const struct ff_job *j, uint32_t ps, uint32_t n, struct ff_ray_batch *b)
{
	ff_rays_elements(j, ps >> 1, n, b);
	ff_rays_origins(j, (int)(ps & 1), n, b);
	ff_rays_directions(j, (int)(ps & 1), n, b);
	ff_rays_cast(j, n, b);
}

void ff_rays_from_element(const struct ff_job *j, const struct ff_samples *s,
                          const uint32_t seed[4], uint32_t column, uint32_t first,
                          uint32_t n, struct ff_ray_batch *b)
{
	for (uint32_t i = 0; i < n; i++)
		b->element[i] = column >> 1;
	ff_rays_numbers(s, seed, first, n, b);
	ff_rays_origins(j, (int)(column & 1), n, b);
	ff_rays_directions(j, (int)(column & 1), n, b);
	ff_rays_cast(j, n, b);
}
