/* How far chains of ideal events are told apart: a few rays are followed to see which
 * chains the scene makes. Two mirrors that face each other make two of each length; a
 * kaleidoscope of many colours makes all that there are. */
#include "lib/ff_rays/chain_limit.h"

#include <stdlib.h>

#include "lib/ff_rays/ray_follow.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/scatter/lobe.h"

/* Counts; guesses. */
enum {
	SIDES = 64, RAYS = 16,    /* patch-sides that send, and rays from each */
	ROOM = 1 << 21,           /* blocks that all rows together may have */
	CHAINS_LEAST = 64, CHAINS_AIM = 4096,
	CHANGES = 2               /* the least: tells events that change colours from others */
};

/* Where counts stop so that no chain is longer than rays are followed; *coloured: ideal
 * events that change colours. */
static uint32_t by_depth(const struct ff_job *j, const struct chains *c, uint32_t *coloured)
{
	uint32_t others = j->o.lobe_depth;

	*coloured = 0;
	for (uint32_t i = 0; i < c->events; i++) {
		*coloured += !c->finite[i] && c->most[i] > 1;
		others += !c->finite[i] && c->most[i] == 1;
	}
	uint32_t left = j->o.depth > others ? j->o.depth - others : 0;
	uint32_t each = left / (*coloured ? *coloured : 1);
	return each > CHANGES ? each : CHANGES;
}

/* Rays of every source, or of as many as evenly spaced ones; the chains that they make are
 * in t->tally.chains. */
static void send(struct ff_thread *t)
{
	const struct ff_job *j = t->job;
	uint32_t sides = 2 * (uint32_t)j->m->patch.n, step = sides / SIDES + 1;

	for (uint32_t ps = 0; ps < sides; ps += step) {
		if (!j->is_source[ps])
			continue;
		uint64_t seed = rng_mix(j->o.seed ^ ps);
		for (uint32_t i = 0; i < RAYS; i++) {
			double x[3], n[3], dir[3];
			double u[2] = { rng_sobol(i, 2, seed), rng_sobol(i, 3, seed) };
			uint32_t el = ff_point(j, ps >> 1, rng_sobol(i, 0, seed),
			                       rng_sobol(i, 1, seed), x);
			ff_normal(j, el, (int)(ps & 1), n);
			bsdf_sample_cosine(n, u, dir);
			ray_leave(j->rays, n, x);
			ff_follow(t, x, dir, 1, 0);
		}
	}
}

/* How many of these chains are left when counts stop at `most`, or CHAIN_NONE and e. */
static uint32_t count_chains(const struct ff_job *j, const struct chains *all, uint32_t most,
                             struct err *e)
{
	struct chains c;
	uint32_t *count = mem_new(all->events, sizeof *count, "chains", e);
	int bad = bsdf_chains_init(&c, j->m, most, e) || !count;

	for (uint32_t i = 0; !bad && i < all->n; i++) {
		for (uint32_t k = 0; k < all->events; k++) {
			uint32_t n = bsdf_chains_count(all, i)[k];
			count[k] = n < c.most[k] ? n : c.most[k];
		}
		bad = bsdf_chains_find(&c, count, e) == CHAIN_NONE;
	}
	uint32_t n = bad ? CHAIN_NONE : (uint32_t)c.n;
	bsdf_chains_free(&c);
	free(count);
	return n;
}

int ff_find_chain_limit(struct ff_job *j, struct err *e)
{
	struct ff_thread t = { .job = j };
	size_t aim = ROOM / (2 * j->m->patch.n + 1);
	uint32_t n = 0, coloured = 0;

	aim = aim < CHAINS_LEAST ? CHAINS_LEAST : aim > CHAINS_AIM ? CHAINS_AIM : aim;
	j->chain_most = CHANGES;
	int bad = ff_tally_init(&t.tally, j->m, &j->places, j->has_lobe, j->chain_most, e);
	if (!bad)
		j->chain_most = by_depth(j, &t.tally.chains, &coloured);
	if (!bad && coloured) {
		ff_tally_free(&t.tally);
		bad = ff_tally_init(&t.tally, j->m, &j->places, j->has_lobe, j->chain_most, e);
	}
	if (!bad && coloured) {
		t.rng = rng_seed(j->o.seed, 0);
		send(&t);
		bad = t.tally.err.set ? err_set(e, "%s", t.tally.err.text) : 0;
		/* Three quarters a try: near the aim, in few tries. A guess. */
		while (!bad && (n = count_chains(j, &t.tally.chains, j->chain_most, e)) > aim &&
		       n != CHAIN_NONE && j->chain_most > CHANGES)
			j->chain_most = (j->chain_most * 3 + 1) / 4;
	}
	ff_tally_free(&t.tally);
	return bad || n == CHAIN_NONE ? -1 : 0;
}
