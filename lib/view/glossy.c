#include "lib/view/glossy.h"

#include <math.h>
#include <string.h>

#include "lib/base/replicates.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/scatter/lobe.h"
#include "lib/view/shade_tile.h"

/* Counts of samples, powers of two, which Sobol points fill evenly. Guesses; README.md has what
 * lobes cost in pictures (tests/bench/report). */
enum {
	FIRST = 4, MOST = 64,  /* of a part where an error is aimed at */
	PROBES = 8             /* of each of two parts that tell how far one ray is off */
};

/* Standard error of a stretch of the sequence over that of as many independent parts, no unit:
 * the parts fill one another's gaps. Measured when lobes were first sampled so, by which
 * command is not known; test_view_lobes.c holds stated errors to a factor of 2. */
static const double together = .8;

/* Images of emitters are aimed at if they may bring such a part of the pixel's light: a guess,
 * less than the noise of samples that stop at an error of 5 %. */
static const double worth_aiming = .01;

/* Sums over the samples of a part. */
struct part {
	double rest[BANDS_MAX], lit[BANDS_MAX];
};

/* All samples of a lobe. */
struct run {
	struct view_walker *w;
	const struct view_branch *b;
	const struct view_lobe_seen *l;
	const double *coefficient;
	struct view_branch *next;
	uint32_t first;          /* index of the first sample */
	struct part part[REPLICATES];
};

/* Follows the next branch to its end. */
static void follow(struct run *r, double scale, struct part *to)
{
	struct view_walker *w = r->w;
	size_t below = w->waiting;

	memset(w->directional, 0, sizeof w->directional);
	memset(w->lit, 0, sizeof w->lit);
	view_push(w, r->b, r->next, r->coefficient, scale);
	view_run(w, below);
	for (int b = 0; b < w->v->m->bands; b++) {
		to->rest[b] += w->directional[b];
		to->lit[b] += w->lit[b];
	}
}

/* Aims at an image of an emitter, for sample i, and follows that. */
static void follow_aimed(struct run *r, uint32_t i, struct part *to)
{
	const struct emitter_images *images = &r->w->v->images;
	const struct view_lobe_weight weight = { r->l, r->w->v->m->lobe };
	struct view_branch *next = r->next;
	uint32_t image;
	double u[3];

	for (int k = 0; k < 3; k++)
		u[k] = rng_sobol(r->first + i, 2 + k, next->seed);
	double chance = view_emitter_images_aim(images, &r->w->aim, u, next->dir, &image);
	if (!(chance > 0))
		return;
	next->aimed = 1 + image;
	chance += view_lobe_density(r->l, weight.kind, next->dir);
	follow(r, view_lobe_weight_at(next->dir, &weight) / chance, to);
	next->aimed = 0;
}

/* Follows sample i to its end and adds it to a part; without one, has it wait. */
static void follow_sample(struct run *r, uint32_t i, struct part *to)
{
	const struct view_lobe_seen *l = r->l;
	enum lobe_kind kind = r->w->v->m->lobe;
	struct view_walker *w = r->w;
	struct view_branch *next = r->next;

	next->index = r->first + i;
	double u[2] = { rng_sobol(next->index, 0, next->seed),
		        rng_sobol(next->index, 1, next->seed) };
	if (kind == LOBE_RECIPROCAL)
		bsdf_lobe_sample_whole(l->k, l->axis, u, next->dir);
	else
		bsdf_lobe_sample(l->k, l->axis, l->normal, u, next->dir);
	double cos_i = v3_dot(l->normal, next->dir);
	if (!(cos_i > 0))
		return;
	if (!to) {
		view_push(w, r->b, next, r->coefficient, view_lobe_per_density(l, kind, cos_i));
		return;
	}
	next->density = view_lobe_density(l, kind, next->dir);
	follow(r, view_lobe_per_density(l, kind, cos_i), to);
}

static void follow_both(struct run *r, uint32_t i, struct part *to)
{
	follow_sample(r, i, to);
	if (r->w->aim.sum > 0)
		follow_aimed(r, i, to);
}

/* What is aimed at has to bring a part of the light of a pixel. */
static void aim(struct view_walker *w, const struct view_branch *b, const struct view_lobe_seen *l,
                const double *coefficient)
{
	double other = 0, most = 0;

	for (int i = 0; i < w->v->m->bands; i++) {
		other += l->other[i] / w->v->m->bands;
		most = fmax(most, b->weight[i] * coefficient[i]);
	}
	view_emitter_images_choose(&w->v->images, l, worth_aiming * other / most, &w->aim);
}

/* Mean and variance of n samples in `parts` parts, with emitters or without. */
static void measure(const struct run *r, int parts, double n, int lit, double *mean,
                    double *variance)
{
	for (int b = 0; b < r->w->v->m->bands; b++) {
		double sum[REPLICATES];
		for (int p = 0; p < parts; p++)
			sum[p] = r->part[p].rest[b] + (lit ? r->part[p].lit[b] : 0);
		struct replicates all = replicates_of(sum, 1, parts);
		mean[b] = all.mean * parts / n;
		variance[b] = parts > 1 ? together * together * all.squares * parts /
		                          ((parts - 1) * n * n) : 0;
	}
}

static int settled(const struct run *r, double n)
{
	double mean[BANDS_MAX], variance[BANDS_MAX], aim = r->w->shader->lobe_relative;

	measure(r, REPLICATES, n, !occ_direct_exact(r->w->v->direct), mean, variance);
	for (int b = 0; b < r->w->v->m->bands; b++) {
		double all = aim * (mean[b] + r->l->other[b]);
		if (variance[b] > all * all)
			return 0;
	}
	return 1;
}

/* As many samples as it takes: returns their number. */
static uint32_t follow_until(struct run *r)
{
	uint32_t each = FIRST;

	size_t stride = sizeof *r->part / sizeof(double);

	for (uint32_t i = 0; i < REPLICATES * each; i++)
		follow_both(r, i, &r->part[i / each]);
	while (!settled(r, REPLICATES * each) && each < MOST) {
		/* As many again: the parts so far are half as many, twice as long. */
		each *= 2;
		for (int b = 0; b < r->w->v->m->bands; b++) {
			replicates_halve(&r->part[0].rest[b], stride);
			replicates_halve(&r->part[0].lit[b], stride);
		}
		for (uint32_t i = REPLICATES / 2 * each; i < REPLICATES * each; i++)
			follow_both(r, i, &r->part[i / each]);
	}
	return REPLICATES * each;
}

/* How many, fewer where what is before the lobe has dimmed it. */
static uint32_t fixed_number(const struct run *r)
{
	double most = 0;

	for (int b = 0; b < r->w->v->m->bands; b++)
		most = fmax(most, r->b->weight[b] * r->coefficient[b]);
	return (uint32_t)fmax(1, fmin(1, most) * r->w->o->lobe_samples + .5);
}

/* The emitters' part waits: by formula it may be better than what samples found of it. */
static void put_light(struct run *r, int parts, double n, const double *lit)
{
	struct view_lobe_request q = { .slot = r->w->slot, .l = *r->l };
	double mean[BANDS_MAX];

	for (int b = 0; b < r->w->v->m->bands; b++) {
		q.weight[b] = r->b->weight[b] * r->coefficient[b];
		q.found[b] = lit[b];
	}
	measure(r, parts, n, 0, mean, q.rest);
	measure(r, parts, n, 1, mean, q.all);
	view_shade_tile_put_lobe(r->w->shader, &q);
}

/* Follows as many samples as are asked for; returns their number and in how many parts. */
static uint32_t follow_all(struct run *r, int *parts)
{
	const struct view_branch *b = r->b;
	uint32_t n =
	    r->w->o->lobe_samples == VIEW_LOBE_ENOUGH ? REPLICATES * MOST : fixed_number(r);

	r->next->share = b->share / n;
	*parts = REPLICATES;
	if (r->w->o->lobe_samples == VIEW_LOBE_ENOUGH) {
		r->first = b->index * n;
		return follow_until(r);
	}
	*parts = n < REPLICATES ? (int)n : REPLICATES;
	r->first = b->index * (uint32_t)r->w->o->lobe_samples;
	for (uint32_t i = 0; i < n; i++)
		follow_both(r, i, &r->part[i * (uint32_t)*parts / n]);
	return n;
}

void view_lobe_follow(struct view_walker *w, const struct view_branch *b,
                      const struct view_lobe_seen *l, const double *coefficient,
                      struct view_branch *next)
{
	struct run r = { .w = w, .b = b, .l = l, .coefficient = coefficient, .next = next };
	double directional[BANDS_MAX], cut[BANDS_MAX], lit[BANDS_MAX] = { 0 };
	int parts;

	next->lobes = 1;
	if (b->lobes) {
		r.first = b->index;
		follow_sample(&r, 0, NULL);
		return;
	}
	memcpy(directional, w->directional, sizeof directional);
	memcpy(cut, w->cut, sizeof cut);
	memset(w->cut, 0, sizeof w->cut);
	memset(w->blurred, 0, sizeof w->blurred);
	next->straight = 1;
	next->turns = 0;
	aim(w, b, l, coefficient);
	uint32_t n = follow_all(&r, &parts);
	for (int k = 0; k < w->v->m->bands; k++) {
		w->directional[k] = directional[k];
		for (int p = 0; p < parts; p++) {
			w->directional[k] += r.part[p].rest[k] / n;
			lit[k] += r.part[p].lit[k] / n;
		}
		w->cut[k] = cut[k] + w->cut[k] / n;
		w->error[k] += sqrt(w->blurred[k] / n);
	}
	w->aim.sum = 0;
	put_light(&r, parts, n, lit);
}

void view_lobe_probe(struct view_walker *w, const struct view_branch *b,
                     const struct view_lobe_seen *l, const double *coefficient, double scale,
                     const struct view_branch *axial)
{
	struct view_branch next = *axial;
	struct run r = { .w = w, .b = b, .l = l, .coefficient = coefficient, .next = &next,
	                 .first = 2 * PROBES * b->index };
	struct part one = { { 0 }, { 0 } };
	double directional[BANDS_MAX], cut[BANDS_MAX];

	memcpy(directional, w->directional, sizeof directional);
	memcpy(cut, w->cut, sizeof cut);
	next.lobes = next.straight = 1;
	next.density = view_lobe_density(l, w->v->m->lobe, l->axis);
	follow(&r, scale, &one);
	for (uint32_t i = 0; i < 2 * PROBES; i++)
		follow_sample(&r, i, &r.part[i / PROBES]);
	for (int k = 0; k < w->v->m->bands; k++) {
		double off[2], weight = b->weight[k] * coefficient[k];
		for (int p = 0; p < 2; p++)
			off[p] = one.rest[k] + one.lit[k] -
			         (r.part[p].rest[k] + r.part[p].lit[k]) / PROBES;
		w->probed[k] += weight * weight;
		w->off[k] += off[0] * off[1];
	}
	memcpy(w->directional, directional, sizeof directional);
	memcpy(w->cut, cut, sizeof cut);
}
