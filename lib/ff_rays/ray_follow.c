#include "lib/ff_rays/ray_follow.h"

#include <string.h>

#include "lib/base/vec.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/scatter/lobe.h"

/* ---- one ray ---- */

/* How often a ray may go on both by a mirror and through a pane, a count; a guess: from there on one
 * of the two is drawn, which bounds the work of a ray by 2^4 paths. */
enum { MAX_SPLITS = 4 };

struct flight {
	double org[3], dir[3], w;
	uint32_t chain;
	uint32_t round;    /* events of a colour since the chain was last a new one */
	uint32_t idle;     /* others since the last of these */
	uint32_t lobes;
	int tallied;       /* its landing is known already */
	uint32_t bends;    /* how often it has been turned on its way */
	int splits;
};

static void capture(struct ff_thread *t, uint32_t source, uint32_t chain, double w)
{
	struct ff_incident c = t->now;

	if (!t->job->is_source[source])
		return;
	c.source = source;
	c.chain = bsdf_chains_reverse(&t->tally.chains, chain, &t->tally.err);
	c.w = w * t->capture_weight;
	if (c.chain != CHAIN_NONE)
		mem_append(&t->incident, &c, 1, sizeof c, &t->tally.err);
}

/* The direction of a flight that goes on by event `slot`, n the normal of the side it
 * leaves; returns the part of its weight that does. */
static double turn(struct ff_thread *t, uint32_t slot, const double in[3], const double n[3],
                   double out[3])
{
	const struct model *m = t->job->m;
	uint32_t id = t->tally.chains.event[slot];
	double axis[3] = { in[0], in[1], in[2] };

	if (!(id & 1))
		v3_mad(in, -2 * v3_dot(in, n), n, axis);
	if (!t->tally.chains.finite[slot]) {
		memcpy(out, axis, sizeof axis);
		return 1;
	}
	double u[2] = { rng_uniform(&t->rng), rng_uniform(&t->rng) };
	return bsdf_lobe_scatter(m->lobe, (id & 1 ? m->material.beta : m->material.alpha)[id / 2], axis,
	                         n, u, out);
}

/* Sends a flight on by event `transmitted` from a hit, or books it as cut. */
static int go_on(struct ff_thread *t, const struct flight *in, const struct ray_hit *hit,
                 uint32_t element, uint32_t slot, int transmitted, double w,
                 struct flight *out)
{
	uint32_t chain = bsdf_chains_child(&t->tally.chains, in->chain, slot, &t->tally.err);
	double n[3];

	if (chain == CHAIN_NONE)
		return 0;
	/* A chain that leads back to itself is summed as a series, of which so many rounds
	 * are sample enough, as many of each ray; a longer chain is not followed. The rounds are
	 * even, as two mirrors take turns, and a quarter of the depth: a guess. */
	int coloured = t->tally.chains.most[slot] > 1;
	uint32_t rounds = t->job->o.depth / 8 * 2 + 2;
	out->round = chain == in->chain ? in->round + (uint32_t)coloured : 0;
	out->idle = coloured ? 0 : in->idle + 1;
	if (out->round >= rounds || out->idle > t->job->o.depth)
		return 0;
	if (chain != in->chain && bsdf_chains_length(&t->tally.chains, chain) > t->job->o.depth) {
		ff_tally_rest(&t->tally, chain)->cut += w;
		return 0;
	}
	ff_normal(t->job, element, transmitted ? !hit->side : hit->side, n);
	ray_point(t->job->rays, t->job->m, hit->triangle, hit->w, out->org);
	double part = turn(t, slot, in->dir, n, out->dir);
	if (part < 1)
		ff_tally_rest(&t->tally, chain)->lost += w * (1 - part);
	ray_leave(t->job->rays, n, out->org);
	out->w = w * part;
	out->chain = chain;
	out->lobes = in->lobes + t->tally.chains.finite[slot];
	out->tallied = 0;
	out->bends = in->bends + (!transmitted || t->tally.chains.finite[slot]);
	return part > 0;
}

/* What a surface sends on directionally: 0 to 2 flights into next[]. A surface that both
 * mirrors and passes splits the flight, the first few times; later one way is drawn
 * and counts double, which keeps the expectation. */
static int reflect(struct ff_thread *t, const struct flight *in, const struct ray_hit *hit,
                   uint32_t element, const uint32_t slot[2], struct flight next[2])
{
	int both = slot[0] != CHAIN_NONE && slot[1] != CHAIN_NONE, drawn = -1, n = 0;
	int splits = in->splits + both;
	struct flight from = *in; /* next[0] may be the same place */

	if (both && in->splits >= MAX_SPLITS) {
		drawn = (int)(rng_next(&t->rng) >> 63);
		from.w *= 2;
	}
	for (int transmitted = 0; transmitted < 2; transmitted++)
		if (slot[transmitted] != CHAIN_NONE && drawn != !transmitted &&
		    go_on(t, &from, hit, element, slot[transmitted], transmitted, from.w, &next[n]))
			next[n++].splits = splits;
	return n;
}

/* Tallies where a flight lands; returns how many go on into next[], which may begin
 * at the flight itself. */
static int land(struct ff_thread *t, const struct flight *f, const struct ray_hit *hit,
                uint32_t element, struct flight next[2])
{
	const struct ff_job *j = t->job;

	t->rays++;
	int straight = t->bent_only && f->bends <= (j->lights.images.mirrors.n > 0);
	t->turned += t->bent_only && !straight ? f->w : 0;
	if (hit->triangle == RAY_MISS) {
		if (!f->tallied)
			ff_tally_rest(&t->tally, f->chain)->escape += f->w;
		return 0;
	}
	uint32_t side = (uint32_t)hit->side, ps = 2 * j->m->element.patch[element] + side;
	int known = f->tallied || straight;
	if (j->is_black[ps]) {
		if (!known)
			ff_tally_rest(&t->tally, f->chain)->black += f->w;
		return 0;
	}
	if (!known)
		ff_tally_hit(&t->tally, f->chain, 2 * element + side, f->w, f->dir);
	if (t->capturing)
		capture(t, ps, f->chain, f->w);
	int lobes_too = j->has_lobe[ps] && f->lobes < t->lobe_depth && (!t->bent_only || f->bends);
	if (!j->is_ideal[ps] && !lobes_too)
		return 0;
	uint32_t id = 4 * model_patch_material(j->m, ps >> 1) + 2 * side, slot[2];
	for (int way = 0; way < 2; way++) {
		slot[way] = t->tally.chains.slot[id + (uint32_t)way];
		if (slot[way] != CHAIN_NONE && t->tally.chains.finite[slot[way]] && !lobes_too)
			slot[way] = CHAIN_NONE;
	}
	return reflect(t, f, hit, element, slot, next);
}

static uint32_t element_of(const struct ff_job *j, const struct ray_hit *hit)
{
	return hit->triangle == RAY_MISS ? 0 : ray_locate(&j->locator, hit->triangle,
	                                                  (float)hit->w[1], (float)hit->w[2]);
}

/* Casts the flights of a stack and all that come of them. */
static void fly(struct ff_thread *t, struct flight *stack, int n)
{
	struct ray_hit hit;

	while (n > 0) {
		n--;
		ray_nearest(t->job->rays, stack[n].org, stack[n].dir, &hit);
		n += land(t, &stack[n], &hit, element_of(t->job, &hit), &stack[n]);
	}
}

static void follow(struct ff_thread *t, const double org[3], const double dir[3], double w,
                   uint32_t chain, int tallied)
{
	struct flight stack[MAX_SPLITS + 3];

	stack[0] = (struct flight){ .w = w, .chain = chain, .tallied = tallied };
	memcpy(stack[0].org, org, sizeof stack[0].org);
	memcpy(stack[0].dir, dir, sizeof stack[0].dir);
	fly(t, stack, 1);
}

void ff_follow(struct ff_thread *t, const double org[3], const double dir[3], double w,
               uint32_t chain)
{
	follow(t, org, dir, w, chain, 0);
}

void ff_follow_on(struct ff_thread *t, const double org[3], const double dir[3], double w)
{
	follow(t, org, dir, w, 0, 1);
}

/* ---- many from one side ---- */

/* As ff_rays_from_patch, with directions of an emission lobe about the normal. */
static void rays_of_lobe(const struct ff_job *j, uint32_t ps, double exponent, uint32_t n,
                         struct ff_ray_batch *b)
{
	ff_rays_elements(j, ps >> 1, n, b);
	ff_rays_origins(j, (int)(ps & 1), n, b);
	for (uint32_t i = 0; i < n; i++) {
		double normal[3], dir[3], u[2] = { (double)b->u[2][i], (double)b->u[3][i] };
		ff_normal(j, b->element[i], (int)(ps & 1), normal);
		bsdf_lobe_sample(exponent, normal, normal, u, dir);
		for (int k = 0; k < 3; k++)
			b->ray.dir[k][i] = (float)dir[k];
	}
	ff_rays_cast(j, n, b);
}

static void world_ray(const struct ff_job *j, const struct ff_ray_batch *b, uint32_t i,
                      double org[3], double dir[3])
{
	struct ray_units units = ray_units(j->rays);

	for (int k = 0; k < 3; k++) {
		org[k] = units.centre[k] + (double)b->ray.org[k][i] / units.per_unit;
		dir[k] = (double)b->ray.dir[k][i];
	}
	v3_normalise(dir);
}

/* Ray i of a batch, at all that may befall it. side: that it left its element by. */
static void land_apart(struct ff_thread *t, int side, const struct ff_ray_batch *b, uint32_t i,
                       uint32_t weight)
{
	struct flight stack[MAX_SPLITS + 3], f = { .w = weight };
	double x = (double)b->ray.w[0][i], y = (double)b->ray.w[1][i];
	struct ray_hit hit = { .triangle = b->ray.triangle[i], .side = (int)b->ray.side[i],
	                       .w = { 1 - x - y, x, y } };

	world_ray(t->job, b, i, f.org, f.dir);
	if (t->capturing) {
		double normal[3];
		t->now = (struct ff_incident){ .element = b->element[i] };
		ff_normal(t->job, b->element[i], side, normal);
		v3_mad(f.org, -ray_offset(t->job->rays), normal, t->now.x);
		memcpy(t->now.l, f.dir, sizeof t->now.l);
	}
	fly(t, stack, land(t, &f, &hit, b->hit[i], stack));
}

static void batch_land(struct ff_thread *t, int side, uint32_t n, const struct ff_ray_batch *b,
                       uint32_t weight)
{
	const uint32_t *place = t->job->places.place;
	uint32_t escaped = 0, simple = 0;

	for (uint32_t i = 0; i < n; i++) {
		if (t->capturing) {
			land_apart(t, side, b, i, weight);
			continue;
		}
		if (b->ray.triangle[i] == RAY_MISS) {
			escaped++;
			continue;
		}
		uint32_t at = place[2 * b->hit[i] + b->ray.side[i]];
		if (at & TALLY_APART) {
			land_apart(t, side, b, i, weight);
		} else {
			ff_tally_count(&t->tally, at, weight);
			simple++;
		}
	}
	t->rays += escaped + simple;
	ff_tally_rest(&t->tally, 0)->escape += (double)weight * escaped;
}

void ff_cast_side(struct ff_thread *t, uint32_t ps, uint32_t count, double exponent,
                  uint32_t first_replicate)
{
	const struct ff_job *j = t->job;
	uint32_t each = count / FF_REPLICATES;
	struct ff_ray_batch b;

	for (uint32_t r = 0; r < FF_REPLICATES; r++) {
		struct ff_scramble s = ff_scramble(j, 2 * ps + (exponent >= 0), first_replicate + r);
		for (uint32_t first = 0; first < each; first += RAY_BATCH) {
			uint32_t n = each - first < RAY_BATCH ? each - first : RAY_BATCH;
			ff_rays_numbers(&j->of_rows, s.seed, first, n, &b);
			if (exponent < 0)
				ff_rays_from_patch(j, ps, n, &b);
			else
				rays_of_lobe(j, ps, exponent, n, &b);
			batch_land(t, (int)(ps & 1), n, &b, 1);
		}
		ff_tally_replicate(&t->tally);
	}
}

static void send_batch(struct ff_thread *t, uint32_t ps, uint32_t *n, struct ff_ray_batch *b,
                       uint32_t weight)
{
	ff_rays_from_patch(t->job, ps, *n, b);
	batch_land(t, (int)(ps & 1), *n, b, weight);
	*n = 0;
}

/* Those of the first `count` points of a replicate that are in the guide's cells, or not. Returns what
 * they weigh. */
static uint32_t cast_cells(struct ff_thread *t, uint32_t ps, const struct ff_scramble *s, uint32_t count,
                       const struct ff_guide *g, int in)
{
	struct ff_ray_batch numbers, b = { .choice = { 0 } };
	uint32_t have = 0, weight = in ? 1 : g->boost, all = 0;

	for (uint32_t first = 0; first < count; first += RAY_BATCH) {
		uint32_t n = count - first < RAY_BATCH ? count - first : RAY_BATCH, taken = 0;
		ff_rays_numbers(&t->job->of_rows, s->seed, first, n, &numbers);
		while (taken < n) {
			taken = ff_guide_take(g, in, &numbers, taken, n, &b, &have);
			if (have == RAY_BATCH) {
				all += weight * have;
				send_batch(t, ps, &have, &b, weight);
			}
		}
	}
	all += weight * have;
	send_batch(t, ps, &have, &b, weight);
	return all;
}

uint32_t ff_cast_guided(struct ff_thread *t, uint32_t ps, uint32_t count, const struct ff_guide *g)
{
	uint32_t weight = 0;

	for (uint32_t r = 0; r < FF_REPLICATES; r++) {
		struct ff_scramble s = ff_scramble(t->job, 2 * ps, r);
		weight += cast_cells(t, ps, &s, count / FF_REPLICATES, g, 0);
		weight += cast_cells(t, ps, &s, count / FF_REPLICATES * g->boost, g, 1);
		ff_tally_replicate(&t->tally);
	}
	return weight;
}

void ff_lobes_cast(struct ff_thread *t)
{
	ff_rays_cast(t->job, t->lobes, &t->lobe);
	batch_land(t, 0, t->lobes, &t->lobe, 1);
	t->lobes = 0;
}
