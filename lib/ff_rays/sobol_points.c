/* Points of samples, shared by all rows: their order. */
#include "lib/ff_rays/sobol_points.h"

#include <stdlib.h>

#include "lib/ff_rays/ray_budget.h"

/* Counts; guesses. Points that are put in order take 1 MB; small elements cast a quarter of the rays
 * if these are still four replicates of eight. */
enum { SOBOL_POINTS_MAX = 1 << 16, GATHER_FEWEST = 32 };

/* Bits of x spread to the even places. */
static uint64_t spread(uint32_t x)
{
	uint64_t v = x;

	v = (v | v << 16) & 0x0000ffff0000ffffu;
	v = (v | v << 8) & 0x00ff00ff00ff00ffu;
	v = (v | v << 4) & 0x0f0f0f0f0f0f0f0fu;
	v = (v | v << 2) & 0x3333333333333333u;
	return (v | v << 1) & 0x5555555555555555u;
}

struct sample {
	uint32_t bits[FF_DIMS];
};

static int by_direction(const void *a, const void *b)
{
	const uint32_t *x = ((const struct sample *)a)->bits, *y = ((const struct sample *)b)->bits;
	uint64_t p = spread(rng_reverse_bits(x[2])) << 1 | spread(rng_reverse_bits(x[3]));
	uint64_t q = spread(rng_reverse_bits(y[2])) << 1 | spread(rng_reverse_bits(y[3]));

	return (p > q) - (p < q);
}

/* The first n sample points, each aligned block of a power of two that divides `each`, but
 * none longer than the fewest points that are used at a time, in an order in which
 * neighbours have similar directions (their places on a Morton curve, which scrambling
 * keeps): rays and memory then see coherent work. */
static int fill_samples(struct ff_samples *s, uint32_t each, uint64_t n, struct err *e)
{
	uint32_t block = each & (~each + 1);

	block = block < FF_CLOSE_RAYS ? block : FF_CLOSE_RAYS;
	s->n = n < SOBOL_POINTS_MAX ? (uint32_t)n : SOBOL_POINTS_MAX;
	s->bits = mem_new((size_t)s->n * FF_DIMS, sizeof *s->bits, "sample points", e);
	struct sample *sample = mem_new(s->n, sizeof *sample, "sample points", e);
	for (uint32_t i = 0; s->bits && sample && i < s->n; i++)
		for (int d = 0; d < FF_DIMS; d++)
			sample[i].bits[d] = rng_sobol_bits(i, d);
	for (uint32_t i = 0; s->bits && sample && block && i + block <= s->n; i += block)
		qsort(sample + i, block, sizeof *sample, by_direction);
	for (uint32_t i = 0; s->bits && sample && i < s->n; i++)
		for (uint32_t d = 0; d < FF_DIMS; d++)
			s->bits[(size_t)d * s->n + i] = sample[i].bits[d];
	free(sample);
	return s->bits && sample ? 0 : -1;
}

/* A quarter of the mean area of an element as a picture shows them, each for its area. */
static double small_area(const struct model *m)
{
	double sum = 0, squares = 0;

	for (size_t i = 0; i < m->element.n; i++) {
		sum += m->element.area[i];
		squares += m->element.area[i] * m->element.area[i];
	}
	return squares / (4 * sum);
}

int ff_sobol_points(struct ff_job *j, struct err *e)
{
	uint32_t each = j->o.rays / FF_REPLICATES, gather = j->o.gather;

	if (j->o.method == FF_HEMICUBE)
		return 0;
	if (gather / 4 >= GATHER_FEWEST)
		j->small_area = small_area(j->m);
	uint32_t least = each >> ff_most_halvings(j->o.rays);
	return fill_samples(&j->of_rows, least, (uint64_t)each * j->o.emitter_gain, e) ||
	       fill_samples(&j->of_reciprocal, gather, gather, e) ||
	       fill_samples(&j->of_small, gather / 4, gather / 4, e) ? -1 : 0;
}
