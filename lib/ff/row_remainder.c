#include "lib/ff/row_remainder.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/ff_rays/ray_samples.h"

int ff_remainder_init(struct ff_rest *r, const struct ff_job *j, struct err *e)
{
	*r = (struct ff_rest){ 0 };
	r->landed = mem_new(2 * j->m->patch.n, sizeof *r->landed, "landings of rays", e);
	return r->landed ? 0 : -1;
}

void ff_remainder_free(struct ff_rest *r)
{
	free(r->landed);
	*r = (struct ff_rest){ 0 };
}

static void count(struct ff_rest *r, const struct ff_job *j, uint32_t replicate, uint32_t n,
                  const struct ff_ray_batch *b)
{
	for (uint32_t i = 0; i < n; i++) {
		if (b->ray.triangle[i] == RAY_MISS) {
			r->escaped++;
			continue;
		}
		uint32_t ps = 2 * j->m->element.patch[b->hit[i]] + b->ray.side[i];
		if (j->is_black[ps])
			r->black++;
		else
			r->landed[ps][replicate]++;
	}
}

void ff_remainder_cast(struct ff_rest *r, const struct ff_job *j, uint32_t ps, uint32_t rays)
{
	struct ff_ray_batch b;

	memset(r->landed, 0, 2 * j->m->patch.n * sizeof *r->landed);
	r->escaped = r->black = 0;
	r->rays += rays;
	for (uint32_t k = 0; k < FF_REPLICATES; k++) {
		struct ff_scramble s = ff_scramble(j, 2 * ps, k);
		for (uint32_t first = 0; first < rays / FF_REPLICATES; first += RAY_BATCH) {
			uint32_t left = rays / FF_REPLICATES - first, n = left < RAY_BATCH ? left : RAY_BATCH;
			ff_rays_numbers(&j->of_rows, s.seed, first, n, &b);
			ff_rays_from_patch(j, ps, n, &b);
			count(r, j, k, n, &b);
		}
	}
}

double ff_remainder_landed(const struct ff_rest *r, uint32_t ps)
{
	double n = 0;

	for (int k = 0; k < FF_REPLICATES; k++)
		n += r->landed[ps][k];
	return n;
}

double ff_remainder_variance(const struct ff_rest *r, uint32_t ps)
{
	double mean = ff_remainder_landed(r, ps) / FF_REPLICATES, square = 0;

	for (int k = 0; k < FF_REPLICATES; k++)
		square += (r->landed[ps][k] - mean) * (r->landed[ps][k] - mean);
	return square * FF_REPLICATES / (FF_REPLICATES - 1);
}
