#include "lib/ff_rays/landings.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/data/landing.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/scatter/lobe_table.h"

/* Counts; guesses. EVENTS: mirrors, panes and lobes that a ray is followed through; what uneven
 * light does beyond is lost among so many images. COPIES: landings that stand for one ray, at most;
 * more are of a lobe seen along its surface. */
enum { EVENTS = 16, COPIES = 16 };

/* Cosines are no less: at grazing angles a weight is large but finite. */
static const double cosine_least = 1e-9;

int ff_landings_init(struct ff_landings *l, const struct ff_job *j, struct err *e)
{
	size_t threads = j->o.threads > 0 ? (size_t)j->o.threads : 1;

	*l = (struct ff_landings){ .job = j, .threads = threads };
	l->patch = mem_new(j->m->patch.n, sizeof *l->patch, "gathered light", e);
	l->rays = mem_new(2 * j->m->element.n, sizeof *l->rays, "gathered light", e);
	l->lost = mem_new(2 * j->m->element.n, sizeof *l->lost, "gathered light", e);
	l->count = mem_new(2 * j->m->element.n, sizeof *l->count, "gathered light", e);
	l->chains = mem_new(threads, sizeof *l->chains, "chains", e);
	l->map = mem_new(threads, sizeof *l->map, "chains", e);
	if (!l->patch || !l->rays || !l->lost || !l->count || !l->chains || !l->map)
		return -1;
	for (size_t t = 0; t < threads; t++)
		if (bsdf_chains_init(&l->chains[t], j->m, j->chain_most, e))
			return -1;
	if (!(l->table = mem_new(l->chains[0].events, sizeof *l->table, "lobes", e)))
		return -1;
	for (uint32_t i = 0; i < l->chains[0].events; i++) {
		uint32_t id = l->chains[0].event[i];
		if (l->chains[0].finite[i])
			bsdf_lobe_table_make(&l->table[i], (id & 1 ? j->m->material.beta
			                                           : j->m->material.alpha)[id / 2]);
	}
	return 0;
}

void ff_landings_free(struct ff_landings *l)
{
	for (size_t p = 0; l->patch && p < l->job->m->patch.n; p++)
		MEM_FREE(l->patch[p].landing.data, l->patch[p].chain.data);
	for (size_t t = 0; t < l->threads; t++) {
		if (l->chains)
			bsdf_chains_free(&l->chains[t]);
		if (l->map)
			free(l->map[t].data);
	}
	MEM_FREE(l->patch, l->rays, l->lost, l->count, l->chains, l->map, l->table);
	*l = (struct ff_landings){ 0 };
}

static uint32_t place_of(const struct ff_landings *l, uint32_t column)
{
	return l->job->places.place[column] & ~TALLY_APART;
}

void ff_landings_begin(struct ff_landings *l, uint32_t column, uint32_t rays, int thread)
{
	l->patch[l->job->m->element.patch[column >> 1]].thread = thread;
	l->rays[place_of(l, column)] = rays;
}

void ff_landings_end(struct ff_landings *l, uint32_t column, uint32_t lost)
{
	l->lost[place_of(l, column)] = lost;
}

/* ---- one ray ---- */

/* A ray that gathers, on its way back along the light. */
struct gathering {
	double dir[3];
	uint32_t chain, lobes, copies;
	uint32_t triangle, element;
	int side;
	double w[3];              /* weights of the triangle's corners */
};

/* Where a ray is on the element that it met. */
static uint32_t landing_of(const struct ff_job *j, const struct gathering *g)
{
	const struct model *m = j->m;
	const uint32_t *corner = &m->triangle.corner[3 * (size_t)g->triangle];
	const struct ff_element *el = &j->element[g->element];
	double d[3], a = v3_dot(el->edge[0], el->edge[0]), b = v3_dot(el->edge[0], el->edge[1]);
	double c = v3_dot(el->edge[1], el->edge[1]), all = a * c - b * b;

	for (int k = 0; k < 3; k++) {
		d[k] = -el->corner[k];
		for (int i = 0; i < 3; i++)
			d[k] += g->w[i] * m->vertex[3 * (size_t)corner[i] + (size_t)k];
	}
	double x = v3_dot(d, el->edge[0]), y = v3_dot(d, el->edge[1]);
	return landing_at(2 * g->element + (uint32_t)g->side, fmax(0, (c * x - b * y) / all),
	                  fmax(0, (a * y - b * x) / all));
}

void ff_landings_fetch(const struct ff_landings *l, uint32_t n, const struct ff_ray_batch *b)
{
	for (uint32_t i = 0; i < n; i++)
		if (b->ray.triangle[i] != RAY_MISS) {
			const char *element = (const char *)&l->job->element[b->hit[i]];
			__builtin_prefetch(element);
			__builtin_prefetch(element + 64);
		}
}

static void put(struct ff_landings *l, uint32_t column, const struct gathering *g, struct err *e)
{
	const struct ff_job *j = l->job;
	struct ff_patch_landings *p = &l->patch[j->m->element.patch[column >> 1]];
	uint32_t landing = landing_of(j, g);

	if (!j->shoots_diffuse[2 * j->m->element.patch[g->element] + (uint32_t)g->side])
		return;
	for (uint32_t i = 0; i < g->copies; i++)
		if (mem_append(&p->landing, &landing, 1, sizeof landing, e) ||
		    (l->chains[0].events && mem_append(&p->chain, &g->chain, 1, sizeof g->chain, e)))
			return;
	l->count[place_of(l, column)] += g->copies;
}

/* A direction of a lobe in place of its axis, n on the side that the ray goes off to; its weight. */
static double scatter(const struct ff_landings *l, uint32_t slot, const double n[3], double cos_o,
                      struct rng *random, double dir[3])
{
	double axis[3] = { dir[0], dir[1], dir[2] };
	double u[2] = { rng_uniform(random), rng_uniform(random) };

	return bsdf_lobe_table_sample(&l->table[slot], l->job->m->lobe, axis, n, cos_o, u, dir);
}

/* The events by which light can have come that leaves a side towards the ray, at most two. */
static int ways(const struct ff_landings *l, const struct gathering *g, uint32_t slot[2])
{
	const struct ff_job *j = l->job;
	const struct chains *c = &l->chains[0];
	uint32_t side = 2 * model_patch_material(j->m, j->m->element.patch[g->element]);
	uint32_t id[2] = { 2 * (side + (uint32_t)g->side), 2 * (side + !g->side) + 1 };
	int n = 0;

	for (int way = 0; way < 2; way++) {
		slot[n] = c->slot[id[way]];
		n += slot[n] != CHAIN_NONE && !(c->finite[slot[n]] && g->lobes >= j->o.lobe_depth);
	}
	return n;
}

/* Takes a ray on by event `slot`, to where it next meets something. 0 if it ends. Chains that
 * would no longer tell their events apart are not followed. */
static int go_on(struct ff_landings *l, struct gathering *g, uint32_t slot, int thread,
                 struct rng *random, struct err *e)
{
	const struct ff_job *j = l->job;
	struct chains *c = &l->chains[thread];
	int finite = c->finite[slot], through = (int)(c->event[slot] & 1);
	double n[3], org[3], weight = 1;
	struct ray_hit hit;

	if (c->most[slot] > 1 && bsdf_chains_count(c, g->chain)[slot] + 1 >= c->most[slot])
		return 0;
	g->chain = bsdf_chains_child(c, g->chain, slot, e);
	ff_normal(j, g->element, through ? !g->side : g->side, n);
	double cosine = v3_dot(g->dir, n);
	if (!through)
		v3_mad(g->dir, -2 * cosine, n, g->dir);
	if (finite)
		weight = scatter(l, slot, n, fmax(fabs(cosine), cosine_least), random, g->dir);
	g->copies = (uint32_t)fmin(COPIES, g->copies * weight + rng_uniform(random));
	g->lobes += (uint32_t)finite;
	if (g->chain == CHAIN_NONE || !g->copies)
		return 0;
	ray_point(j->rays, j->m, g->triangle, g->w, org);
	ray_leave(j->rays, n, org);
	ray_nearest(j->rays, org, g->dir, &hit);
	if (hit.triangle == RAY_MISS)
		return 0;
	g->triangle = hit.triangle;
	g->side = hit.side;
	g->element = ray_locate(&j->locator, hit.triangle, (float)hit.w[1], (float)hit.w[2]);
	memcpy(g->w, hit.w, sizeof g->w);
	return !j->is_black[2 * j->m->element.patch[g->element] + (uint32_t)g->side];
}

/* Of two ways one is taken, for both. */
static uint32_t follow(struct ff_landings *l, uint32_t column, struct gathering *g, int thread,
                       struct rng *random, struct err *e)
{
	uint32_t slot[2], rays = 0;
	int n;

	while (rays < EVENTS && (n = ways(l, g, slot)) > 0) {
		int way = n == 2 ? (int)(rng_next(random) >> 63) : 0;
		rays++;
		g->copies *= (uint32_t)n;
		if (!go_on(l, g, slot[way], thread, random, e))
			break;
		put(l, column, g, e);
	}
	return rays;
}

uint32_t ff_landings_add(struct ff_landings *l, uint32_t column, const struct ff_ray_batch *b,
                         uint32_t i, int thread, struct err *e)
{
	double x = (double)b->ray.w[0][i], y = (double)b->ray.w[1][i];
	struct gathering g = { .copies = 1, .triangle = b->ray.triangle[i], .element = b->hit[i],
	                       .side = (int)b->ray.side[i], .w = { 1 - x - y, x, y } };

	put(l, column, &g, e);
	if (!l->chains[0].events)
		return 0;
	struct rng random = rng_seed(l->job->o.seed ^ column, rng_mix(b->choice[i]) ^ b->hit[i]);
	for (int k = 0; k < 3; k++)
		g.dir[k] = (double)b->ray.dir[k][i];
	v3_normalise(g.dir);
	return follow(l, column, &g, thread, &random, e);
}

/* ---- into batches ---- */

int ff_landings_put(struct ff_landings *l, uint32_t patch, struct ff_batch *b,
                    struct chains *whole, struct err *e)
{
	const struct model *m = l->job->m;
	struct ff_patch_landings *p = &l->patch[patch];
	uint32_t first = 2 * m->patch.start[patch], sides = 2 * m->patch.start[patch + 1] - first;

	if (ff_batch_begin(b, e) ||
	    ff_batch_renumber_chains(p->chain.data, p->chain.n, &l->chains[p->thread],
	                             &l->map[p->thread], whole, e) ||
	    mem_append(&b->gathered_rays, &l->rays[first], sides, sizeof *l->rays, e) ||
	    mem_append(&b->gathered_lost, &l->lost[first], sides, sizeof *l->lost, e) ||
	    mem_append(&b->gathered_count, &l->count[first], sides, sizeof *l->count, e))
		return -1;
	b->gathered_landing = p->landing;
	b->gathered_chain = p->chain;
	*p = (struct ff_patch_landings){ 0 };
	return 0;
}
