/* Form factors by hemicubes: several sample points a patch, each with a randomly
 * rotated hemicube over the front, the back, or both (Cohen & Greenberg 1985; the
 * paper's two-sided patches). Light that meets an ideal surface is followed by
 * rays through the pixels that see it; lobes are sampled with density cos^k and
 * looked up in the item buffer, so a lobe narrower than a pixel still lands. */
#include "lib/ff/row_hemicube.h"

#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/vec.h"
#include "lib/ff/directional.h"
#include "lib/ff/hemicube_pilot.h"
#include "lib/ff/hemicube_subpixel.h"
#include "lib/ff_rays/ray_follow.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/scatter/lobe.h"

/* Counts; the last two are guesses. */
enum {
	GROUPS = 4,               /* of sample points, whose spread gives the error */
	CAPTURES = 4096,          /* light paths kept of a directional patch-side */
	EMISSION_SAMPLES = 16384  /* lobe directions a row of an emission lobe */
};

static uint32_t *items(const struct ff_thread *t, uint32_t view, int side)
{
	return t->item + (2 * view + (uint32_t)side) * t->job->grid.pixels;
}

static void place_view(struct ff_thread *t, uint32_t patch, uint32_t i, int side)
{
	const struct ff_job *j = t->job;
	struct view *v = &t->view[2 * i + (uint32_t)side];
	uint64_t seed = rng_mix(j->o.seed ^ rng_mix(patch));
	double turn = 2 * PI * rng_sobol(i, 4, seed ^ (uint64_t)side), tt[3], bb[3];

	v->element = ff_point(j, patch, rng_sobol(i, 0, seed), rng_sobol(i, 1, seed), v->eye);
	ff_normal(j, v->element, side, v->frame[2]);
	v3_frame(v->frame[2], tt, bb);
	for (int k = 0; k < 3; k++) {
		v->frame[0][k] = cos(turn) * tt[k] + sin(turn) * bb[k];
		v->frame[1][k] = cos(turn) * bb[k] - sin(turn) * tt[k];
	}
	ray_leave(j->rays, v->frame[2], v->eye);
}

static void render(struct ff_thread *t, uint32_t patch, int side)
{
	const struct ff_job *j = t->job;

	for (uint32_t i = 0; i < j->o.points; i++) {
		const struct view *v = &t->view[2 * i + (uint32_t)side];
		place_view(t, patch, i, side);
		ff_hemicube_render(&t->cube, j->cubes, v->eye, v->frame, HEMICUBE_VOID);
		memcpy(items(t, i, side), t->cube.item, j->grid.pixels * sizeof *t->item);
	}
}

static void to_world(const struct view *v, const double local[3], double out[3])
{
	for (int k = 0; k < 3; k++)
		out[k] = local[0] * v->frame[0][k] + local[1] * v->frame[1][k] +
		         local[2] * v->frame[2][k];
}

/* Tallies weight w of the row's flux that goes through a pixel along dir. */
static void through_pixel(struct ff_thread *t, const struct view *v, uint32_t item,
                          const double dir[3], double w)
{
	const struct ff_job *j = t->job;

	if (item == HEMICUBE_VOID) {
		ff_tally_rest(&t->tally, 0)->escape += w;
		return;
	}
	uint32_t ps = 2 * j->m->element.patch[item >> 1] + (item & 1);
	if (j->is_ideal[ps] || (j->has_lobe[ps] && t->lobe_depth))
		ff_follow(t, v->eye, dir, w, 0);
	else if (!model_side_modelled(j->m, ps))
		ff_tally_rest(&t->tally, 0)->black += w;
	else
		ff_tally_hit(&t->tally, 0, item, w, dir);
}

/* Counts how often a running sum of weights passes a multiple of 1 / parts. */
static double passes(double *sum, double w, double parts)
{
	double before = floor(*sum * parts);

	*sum += w;
	return floor(*sum * parts) - before;
}

struct gathering {
	double captured, followed; /* running sums over all views */
};

/* Light that a pixel sends to an ideal surface lands there whole; rays of equal weight,
 * on the average one a pixel, stand for what goes on from there. */
static void fly_on(struct ff_thread *t, const struct view *v, int has_lobe,
                   const double dir[3], double w, struct gathering *g)
{
	double flights = (double)t->job->grid.pixels * t->job->o.points;
	double n = passes(&g->followed, w, flights);

	if (!(n > 0))
		return;
	t->capturing = has_lobe && passes(&g->captured, n / flights, CAPTURES) > 0;
	t->capture_weight = flights / n;
	ff_follow_on(t, v->eye, dir, n / flights);
	t->capturing = 0;
}

/* Keeps every CAPTURES-th part of the cosine-weighted hemisphere as a light path. */
static void capture_pixel(struct ff_thread *t, uint32_t ps, const struct ff_incident *now, double w,
                          struct gathering *g)
{
	struct ff_incident c = *now;

	c.source = ps;
	c.w = passes(&g->captured, w, CAPTURES);
	if (c.w > 0 && t->job->is_source[ps])
		mem_append(&t->incident, &c, 1, sizeof c, &t->tally.err);
}

/* 1 if where a pixel's light lands is all there is to tell of it. */
static int lands_only(const struct ff_job *j, uint32_t from, uint32_t item)
{
	if (item == HEMICUBE_VOID)
		return 1;
	uint32_t ps = 2 * j->m->element.patch[item >> 1] + (item & 1);
	return j->is_black[ps] || !(j->is_ideal[ps] || j->has_lobe[ps] || j->has_lobe[from]);
}

/* Neighbouring pixels that show the same, w their factor. */
static void land(struct ff_thread *t, uint32_t item, double w)
{
	const struct ff_job *j = t->job;

	if (item == HEMICUBE_VOID)
		ff_tally_rest(&t->tally, 0)->escape += w;
	else if (j->is_black[2 * j->m->element.patch[item >> 1] + (item & 1)])
		ff_tally_rest(&t->tally, 0)->black += w;
	else
		ff_tally_hit(&t->tally, 0, item, w, NULL);
}

/* A pixel whose light keeps its direction, there or on its way back. */
static void gather_pixel(struct ff_thread *t, uint32_t i, uint32_t from, size_t pixel, uint32_t item,
                         double w, struct gathering *g)
{
	const struct ff_job *j = t->job;
	const struct view *v = &t->view[2 * i + (from & 1)];
	uint32_t ps = 2 * j->m->element.patch[item >> 1] + (item & 1);
	double dir[3];

	to_world(v, &j->grid.direction[3 * pixel], dir);
	ff_tally_hit(&t->tally, 0, item, w, dir);
	if (!j->is_ideal[ps] && !j->has_lobe[from])
		return;
	t->now = (struct ff_incident){ .element = v->element, .view = i };
	memcpy(t->now.x, v->eye, sizeof t->now.x);
	memcpy(t->now.l, dir, sizeof t->now.l);
	if (j->is_ideal[ps])
		fly_on(t, v, j->has_lobe[from], dir, w, g);
	else
		capture_pixel(t, ps, &t->now, w, g);
}

static void gather(struct ff_thread *t, uint32_t ps)
{
	const struct ff_job *j = t->job;
	const double *delta = j->grid.delta;
	struct gathering g = { 0 };
	double share = 1. / j->o.points;

	for (uint32_t i = 0; i < j->o.points; i++) {
		const uint32_t *item = items(t, i, (int)(ps & 1));
		for (size_t k = 0, first; k < j->grid.pixels;) {
			double sum = 0;
			for (first = k; k < j->grid.pixels && item[k] == item[first]; k++)
				sum += delta[k];
			if (lands_only(j, ps, item[first]))
				land(t, item[first], share * sum);
			else
				for (size_t pixel = first; pixel < k; pixel++)
					gather_pixel(t, i, ps, pixel, item[pixel],
					             share * delta[pixel], &g);
		}
		if ((i + 1) * GROUPS % j->o.points == 0)
			ff_tally_replicate(&t->tally);
	}
}

/* A direction above the horizon of a view, looked up in its item buffer. */
static void cast_view(struct ff_thread *t, uint32_t i, int side, const double dir[3], double w)
{
	const struct view *v = &t->view[2 * i + (uint32_t)side];
	double local[3];

	for (int k = 0; k < 3; k++)
		local[k] = v3_dot(dir, v->frame[k]);
	through_pixel(t, v, items(t, i, side)[ff_hemicube_lookup(&t->job->grid, local)], dir, w);
}

static void cast_lookup(struct ff_thread *t, const struct ff_incident *c, int side,
                        const double dir[3], double w)
{
	cast_view(t, c->view, side, dir, w);
}

static void gather_emission(struct ff_thread *t, uint32_t ps, double exponent)
{
	const struct ff_job *j = t->job;
	int side = (int)(ps & 1);
	uint32_t n = EMISSION_SAMPLES / j->o.points + 1;
	uint64_t seed = rng_next(&t->rng);
	double w = 1. / ((double)n * j->o.points);

	t->lobe_depth = j->o.lobe_depth;
	for (uint32_t i = 0; i < j->o.points; i++) {
		const double *normal = t->view[2 * i + (uint32_t)side].frame[2];
		for (uint32_t k = 0; k < n; k++) {
			double u[2] = { rng_sobol(i * n + k, 0, seed), rng_sobol(i * n + k, 1, seed) };
			double dir[3];
			bsdf_lobe_sample(exponent, normal, normal, u, dir);
			cast_view(t, i, side, dir, w);
		}
		if ((i + 1) * GROUPS % j->o.points == 0)
			ff_tally_replicate(&t->tally);
	}
	t->lobe_depth = 0;
}

static int side_rows(struct ff_thread *t, uint32_t ps, struct ff_batch *b, struct err *e)
{
	const struct ff_job *j = t->job;
	uint32_t material = model_patch_material(j->m, ps >> 1);
	uint32_t samples = (uint32_t)(j->grid.pixels * j->o.points);

	t->rng = rng_seed(j->o.seed, ps);
	t->incident.n = 0;
	if (j->shoots_diffuse[ps] || j->has_lobe[ps]) {
		struct ff_batch unused = { 0 };
		gather(t, ps);
		if (j->emits[ps])
			ff_hemicube_subpixel(t, ps);
		if (j->o.points == 1)
			ff_hemicube_pilot(t, ps);
		if (ff_tally_finish(&t->tally, j->shoots_diffuse[ps] ? b : &unused, ps, FF_DIFFUSE,
		                    samples, 1, e))
			return -1;
		ff_batch_free(&unused);
	}
	if (j->shoots_lobe[ps]) {
		gather_emission(t, ps, j->m->material.emission_exponent[2 * material + (ps & 1)]);
		if (ff_tally_finish(&t->tally, b, ps, FF_EMISSION, EMISSION_SAMPLES, 1, e))
			return -1;
	}
	return j->has_lobe[ps] ? ff_directional_rows(t, ps, cast_lookup, b, e) : 0;
}

int ff_patch_hemicube(struct ff_thread *t, uint32_t patch, struct ff_batch *b, struct err *e)
{
	const struct ff_job *j = t->job;
	const uint32_t ps = 2 * patch;

	/* Light that arrives on one side may leave the other: both may be needed. */
	for (int side = 0; side < 2; side++)
		if (j->is_source[ps + (uint32_t)side] || j->has_lobe[ps + (uint32_t)side])
			render(t, patch, side);
	for (uint32_t side = 0; side < 2; side++)
		if (side_rows(t, ps + side, b, e))
			return -1;
	return 0;
}
