#include "lib/view/glossy.h"

#include <math.h>
#include <string.h>

#include "lib/base/replicates.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/scatter/lobe.h"
#include "lib/view/aimed_ray.h"
#include "lib/view/shade_tile.h"

/* Counts of samples, powers of two, which Sobol points fill evenly. Guesses; README.md has what
 * lobes cost in pictures (tests/bench/report). */
enum {
	PILOT = 16,            /* that tell how many the first lobe of its kind in a tile takes */
	FEWEST = 4, MOST = 64, /* of a part where an error is aimed at */
	PROBES = 8             /* of each of two parts that tell how far one ray is off */
};

/* Standard error of a stretch of the sequence over that of as many independent parts, no unit:
 * the parts fill one another's gaps. Measured when lobes were first sampled so, by which
 * command is not known; test_view_lobes.c holds stated errors to a factor of 2. */
static const double together = .8;

/* Images of emitters are aimed at if they may bring such a part of the pixel's light: a guess,
 * less than the noise of samples that stop at an error of 5 %. */
static const double worth_aiming = .02;

/* What a lobe behind one that is sampled carries less than, relative to that one, goes on by as
 * much less chance. A guess. */
static const double worth_following = .25;

/* How far what tells of later lobes of a kind moves towards what the last one told: the mean of
 * about the last two, which are of the same pixel as a rule. Of .25, .5 and .75 the first two were
 * alike on scenes/two-pass.gltf, and .75 a tenth noisier. */
static const double forgets = .5;

/* Sums over the samples of a part. */
struct part {
	double rest[BANDS_MAX], lit[BANDS_MAX];
};

/* All samples of a lobe. */
struct run {
	struct view_walker *w;
	const struct view_branch *b;
	const struct aim_lobe *l;
	const double *coefficient;
	struct view_branch *next;
	int sampled;             /* what emitters send straight to it is */
	uint32_t first;          /* index of the first sample */
	struct part part[REPLICATES];
};

/* ---- one sample ---- */

/* The most that a lobe lets through of a branch in any band. */
static double carried(const struct view_walker *w, const struct view_branch *b,
                      const double *coefficient)
{
	double most = 0;

	for (int i = 0; i < w->v->m->bands; i++)
		most = fmax(most, b->weight[i] * coefficient[i]);
	return most;
}

/* Aims `next`, which is about to leave a lobe, at an image of an emitter. What comes straight to
 * the first lobe is kept apart. */
static void add_aimed(struct view_walker *w, const struct view_branch *b, const struct aim_lobe *l,
                      const double *coefficient, const struct view_branch *next, const double u[3])
{
	const struct aim_lobe_weight weight = { l, w->v->m->lobe };
	double dir[3], value[BANDS_MAX];
	uint32_t image;
	double chance = aim_images_aim(&w->v->images, &next->aim, u, dir, &image);
	double f = chance > 0 ? aim_lobe_weight_at(dir, &weight) : 0;
	if (!(f > 0))
		return;
	f /= chance + aim_lobe_density(l, weight.kind, dir);
	for (int i = 0; i < w->v->m->bands; i++)
		value[i] = b->weight[i] * coefficient[i] * f;
	int came = view_aimed(w, next, dir, image, value);
	double *to = came == VIEW_AIMED_STRAIGHT && next->straight ? w->lit : w->directional;
	for (int i = 0; i < w->v->m->bands && came; i++)
		to[i] += value[i];
}

/* Sends `next` along a direction of the lobe, and where there is something to aim at there, too. */
static void push_sample(struct view_walker *w, const struct view_branch *b,
                        const struct aim_lobe *l, const double *coefficient,
                        struct view_branch *next)
{
	enum { NUMBERS = 5 };  /* of a direction, and of what is aimed at */
	enum lobe_kind kind = w->v->m->lobe;
	uint32_t index = rng_shuffle(next->index, next->seed);
	double u[NUMBERS];

	for (int k = 0; k < (next->aim.tree ? NUMBERS : 2); k++)
		u[k] = rng_sobol(index, k, next->seed);
	next->depth = b->depth + 1;
	if (next->aim.tree)
		add_aimed(w, b, l, coefficient, next, u + 2);
	if (kind == LOBE_RECIPROCAL)
		bsdf_lobe_sample_whole(l->k, l->axis, u, next->dir);
	else
		bsdf_lobe_sample(l->k, l->axis, l->normal, u, next->dir);
	double cos_i = v3_dot(l->normal, next->dir);
	if (!(cos_i > 0))
		return;
	next->chance = aim_lobe_density(l, kind, next->dir);
	next->way = 0;
	next->chain = 0;
	if (next->straight)
		next->density = next->chance;
	view_push(w, b, next, coefficient, aim_lobe_per_density(l, kind, cos_i));
}

void view_lobe_go_on(struct view_walker *w, const struct view_branch *b, const struct aim_lobe *l,
                     const double *coefficient, struct view_branch *next)
{
	next->shown = b->shown;
	aim_images_choose(&w->v->images, l, 1, worth_aiming * b->shown / carried(w, b, coefficient),
	                  &next->aim);
	push_sample(w, b, l, coefficient, next);
}

/* Follows sample i to its end and adds it to a part. */
static void follow_sample(struct run *r, uint32_t i, struct part *to)
{
	struct view_walker *w = r->w;
	size_t below = w->waiting;

	memset(w->directional, 0, sizeof w->directional);
	memset(w->lit, 0, sizeof w->lit);
	r->next->index = r->first + i;
	push_sample(w, r->b, r->l, r->coefficient, r->next);
	view_run(w, below);
	for (int b = 0; b < w->v->m->bands; b++) {
		to->rest[b] += w->directional[b];
		to->lit[b] += w->lit[b];
	}
}

/* ---- how many ---- */

/* Follows n samples, in four parts if they are as many; returns the number of parts. */
static int follow_samples(struct run *r, uint32_t n)
{
	uint32_t parts = n < REPLICATES ? n : REPLICATES;

	memset(r->part, 0, sizeof r->part);
	for (uint32_t i = 0; i < n; i++)
		follow_sample(r, i, &r->part[(uint64_t)i * parts / n]);
	return (int)parts;
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

/* Samples that it would take for the error aimed at, by what n samples in four parts have found. */
static double wanted(const struct run *r, double n)
{
	double mean[BANDS_MAX], variance[BANDS_MAX], aim = r->w->shader->lobe_relative, most = 0;

	measure(r, REPLICATES, n, r->sampled, mean, variance);
	for (int b = 0; b < r->w->v->m->bands; b++) {
		double all = aim * (mean[b] + r->l->other[b]);
		if (variance[b] > 0)
			most = fmax(most, n * variance[b] / (all * all));
	}
	return most;
}

/* As many samples as it takes, which lobes of the kind before in the tile have told, or a pilot of
 * this one: never those that are kept, which would leave out what is seldom met. Returns their
 * number. */
static uint32_t follow_enough(struct run *r)
{
	double *unrest = &r->w->unrest[r->l->id];
	uint32_t each = FEWEST;

	if (!(*unrest > 0)) {
		uint64_t seed = r->next->seed;
		r->next->seed = rng_mix(~seed);
		r->first = r->b->index * PILOT;
		follow_samples(r, PILOT);
		*unrest = fmax(1, wanted(r, PILOT));
		r->next->seed = seed;
	}
	while (each < MOST && REPLICATES * each < *unrest)
		each *= 2;
	r->first = r->b->index * REPLICATES * MOST;
	follow_samples(r, REPLICATES * each);
	*unrest += forgets * (fmax(1, wanted(r, REPLICATES * each)) - *unrest);
	return REPLICATES * each;
}

/* Follows as many samples as are asked for, fewer where what is before the lobe has dimmed it;
 * returns their number and in how many parts. */
static uint32_t follow_all(struct run *r, int *parts)
{
	int asked = r->w->o->lobe_samples;

	if (asked == VIEW_LOBE_ENOUGH) {
		*parts = REPLICATES;
		return follow_enough(r);
	}
	uint32_t n = (uint32_t)fmax(1, fmin(1, carried(r->w, r->b, r->coefficient)) * asked + .5);
	r->first = r->b->index * (uint32_t)asked;
	*parts = follow_samples(r, n);
	return n;
}

/* ---- lobes ---- */

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

/* What is aimed at has to bring a part of the light of a pixel. */
static void aim(struct run *r)
{
	r->next->shown = 0;
	for (int i = 0; i < r->w->v->m->bands; i++)
		r->next->shown += r->l->other[i] / r->w->v->m->bands;
	r->sampled = view_shade_tile_sampled(r->w->shader, 2 * r->l->element + (uint32_t)r->l->side);
	aim_images_choose(&r->w->v->images, r->l, r->sampled,
	                  worth_aiming * r->next->shown / carried(r->w, r->b, r->coefficient),
	                  &r->next->aim);
}

void view_lobe_follow(struct view_walker *w, const struct view_branch *b, const struct aim_lobe *l,
                      const double *coefficient, struct view_branch *next)
{
	struct run r = { .w = w, .b = b, .l = l, .coefficient = coefficient, .next = next };
	double directional[BANDS_MAX], cut[BANDS_MAX], lit[BANDS_MAX] = { 0 };
	int parts;

	memcpy(directional, w->directional, sizeof directional);
	memcpy(cut, w->cut, sizeof cut);
	memset(w->cut, 0, sizeof w->cut);
	memset(w->blurred, 0, sizeof w->blurred);
	next->lobes = next->straight = 1;
	next->worth = worth_following * carried(w, b, coefficient);
	aim(&r);
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
	put_light(&r, parts, n, lit);
}

void view_lobe_probe(struct view_walker *w, const struct view_branch *b, const struct aim_lobe *l,
                     const double *coefficient, double scale, const struct view_branch *axial)
{
	struct view_branch next = *axial;
	struct run r = { .w = w, .b = b, .l = l, .coefficient = coefficient, .next = &next,
	                 .first = 2 * PROBES * b->index };
	double one[BANDS_MAX], directional[BANDS_MAX], cut[BANDS_MAX];
	size_t below = w->waiting;

	memcpy(directional, w->directional, sizeof directional);
	memcpy(cut, w->cut, sizeof cut);
	memset(w->directional, 0, sizeof w->directional);
	memset(w->lit, 0, sizeof w->lit);
	next.lobes = next.straight = 1;
	next.density = aim_lobe_density(l, w->v->m->lobe, l->axis);
	next.worth = worth_following * carried(w, b, coefficient);
	view_push(w, b, &next, coefficient, scale);
	view_run(w, below);
	for (int k = 0; k < w->v->m->bands; k++)
		one[k] = w->directional[k] + w->lit[k];
	for (uint32_t i = 0; i < 2 * PROBES; i++)
		follow_sample(&r, i, &r.part[i / PROBES]);
	for (int k = 0; k < w->v->m->bands; k++) {
		double off[2], weight = b->weight[k] * coefficient[k];
		for (int p = 0; p < 2; p++)
			off[p] = one[k] - (r.part[p].rest[k] + r.part[p].lit[k]) / PROBES;
		w->probed[k] += weight * weight;
		w->off[k] += off[0] * off[1];
	}
	memcpy(w->directional, directional, sizeof directional);
	memcpy(w->cut, cut, sizeof cut);
}
