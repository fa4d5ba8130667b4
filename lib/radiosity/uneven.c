#include "lib/radiosity/uneven.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/parallel.h"
#include "lib/data/landing.h"
#include "lib/data/solution.h"
#include "lib/radiosity/transport.h"

/* Of what slopes bring, the part that may be wrong: fields bend between elements. Measured by
 * tests/bench/uneven.py against particles. */
static const double slope_doubt = .7;

int radiosity_uneven_known(const struct transport *t)
{
	for (size_t i = 0; i < t->shards; i++)
		if (!t->shard[i]->gathered.sides)
			return 0;
	return 1;
}

static uint32_t component_of(const struct uneven *u, size_t es)
{
	return u->components.of[2 * u->t->m->element.patch[es >> 1] + (es & 1)];
}

static void set_losses(struct uneven *u, const struct ff *f)
{
	const struct ff_gathered *g = &f->gathered;
	const uint32_t *start = u->t->m->patch.start;
	size_t side = 0;

	for (size_t ps = 2 * (size_t)f->patch_begin; ps < 2 * (size_t)f->patch_end; ps++)
		for (size_t i = start[ps >> 1]; i < start[(ps >> 1) + 1]; i++, side++) {
			if (!g->rays[side])
				continue;
			float rays = (float)g->rays[side];
			u->loss[2 * i + (ps & 1)] = (float)g->lost[side] / rays;
			u->doubt[2 * i + (ps & 1)] = (1 - (float)g->lost[side] / rays) / rays;
		}
}

int radiosity_uneven_init(struct uneven *u, const struct transport *t, struct solution *s,
                          int threads, struct err *e)
{
	*u = (struct uneven){ .t = t, .s = s, .threads = threads > 1 ? threads : 1 };
	u->start = mem_new(t->shards, sizeof *u->start, "landings", e);
	u->before = mem_new(s->element_sides, solution_channels(s) * sizeof *u->before, "landings", e);
	u->colour = lanes_new(t->chains.n, &u->room[0], "chains", e);
	u->exitance = lanes_new(s->element_sides, &u->room[1], "exitance", e);
	u->deviation = (lanes_f32 *)lanes_new(2 * s->element_sides, &u->room[2], "exitance", e);
	u->straight = lanes_new(s->element_sides, &u->room[3], "exitance", e);
	u->loss = mem_new(s->element_sides, sizeof *u->loss, "landings", e);
	u->doubt = mem_new(s->element_sides, sizeof *u->doubt, "landings", e);
	if (!u->straight || !u->loss || !u->doubt || radiosity_components_init(&u->components, t, e))
		return -1;
	u->missing = lanes_new(u->components.n, &u->room[4], "components", e);
	u->uncertain = mem_new(u->components.n, sizeof *u->uncertain, "components", e);
	if (!u->missing || !u->uncertain || !u->start || !u->before || !u->colour || !u->exitance || !u->deviation ||
	    radiosity_neighbours_init(&u->neighbours, t->m, e))
		return -1;
	for (size_t i = 0; i < t->shards; i++) {
		const struct ff_gathered *g = &t->shard[i]->gathered;
		if (!(u->start[i] = mem_new(g->sides + 1, sizeof *u->start[i], "landings", e)))
			return -1;
		for (size_t k = 0; k < g->sides; k++)
			u->start[i][k + 1] = u->start[i][k] + g->count[k];
		set_losses(u, t->shard[i]);
	}
	for (size_t es = 0; es < s->element_sides; es++)
		u->uncertain[component_of(u, es)] += t->m->element.area[es >> 1] * (double)u->doubt[es];
	return 0;
}

void radiosity_uneven_free(struct uneven *u)
{
	for (size_t i = 0; u->start && i < u->t->shards; i++)
		free(u->start[i]);
	for (size_t i = 0; i < sizeof u->room / sizeof *u->room; i++)
		free(u->room[i]);
	radiosity_neighbours_free(&u->neighbours);
	radiosity_components_free(&u->components);
	MEM_FREE(u->start, u->before, u->loss, u->doubt, u->uncertain);
}

/* ---- what elements send ---- */

/* Channels of the pass: of all groups, or with them added up. */
static size_t channels_of(const struct uneven *u)
{
	return u->total ? (size_t)u->s->bands : solution_channels(u->s);
}

static double irradiance(const struct uneven *u, size_t es, size_t channel)
{
	const struct irradiance *h = &u->s->irradiance;
	size_t bands = (size_t)u->s->bands;
	size_t at = (channel / bands * u->s->element_sides + es) * bands + channel % bands;

	return u->total ? solution_irradiance(u->s, es, (int)channel)
	                : h->direct[at] + h->caustic[at] + h->indirect[at];
}

/* What side `es` scatters diffusely, of the channels in work. */
static void set_exitance(void *arg, size_t begin, size_t end, int thread)
{
	const struct uneven *u = arg;

	(void)thread;
	for (size_t es = begin; es < end; es++) {
		lanes x = { 0 };
		for (size_t k = 0; k < LANES && u->first + k < channels_of(u); k++) {
			size_t c = u->first + k;
			x[k] = solution_scattered(u->t->m, es, (int)(c % (size_t)u->s->bands),
			                          irradiance(u, es, c), irradiance(u, es ^ 1, c));
		}
		u->exitance[es] = x;
	}
}

static void set_deviations(void *arg, size_t begin, size_t end, int thread)
{
	const struct uneven *u = arg;
	const struct model *m = u->t->m;

	(void)thread;
	for (size_t ps = 2 * begin; ps < 2 * end; ps++) {
		uint32_t first = m->patch.start[ps >> 1], last = m->patch.start[(ps >> 1) + 1];
		lanes mean = { 0 }, slope[2];
		for (size_t i = first; i < last; i++)
			mean += u->exitance[2 * i + (ps & 1)] *
			        (m->element.area[i] / m->patch.area[ps >> 1]);
		for (size_t i = first; i < last; i++) {
			size_t es = 2 * i + (ps & 1);
			radiosity_exitance_slope(&u->neighbours, u->exitance, (uint32_t)es, slope);
			lanes_f32 *to = u->deviation + 3 * es;
			to[0] = __builtin_convertvector(u->exitance[es] - mean, lanes_f32);
			to[1] = __builtin_convertvector(slope[0], lanes_f32);
			to[2] = __builtin_convertvector(slope[1], lanes_f32);
		}
	}
}

/* What the events of each chain leave of light, in the channels in work. */
static void set_colours(struct uneven *u)
{
	const struct chains *c = &u->t->chains;
	const struct materials *mt = &u->t->m->material;
	size_t bands = (size_t)u->s->bands;

	for (uint32_t chain = 0; chain < c->n; chain++) {
		u->colour[chain] = (lanes){ 1, 1, 1, 1 };
		for (uint32_t i = 0; i < c->events; i++) {
			uint32_t id = c->event[i], times = bsdf_chains_count(c, chain)[i];
			const double *coefficient = (id & 1 ? mt->tau_s : mt->rho_s) + id / 2 * bands;
			for (size_t k = 0; times && k < LANES; k++)
				u->colour[chain][k] *= pow(coefficient[(u->first + k) % bands], times);
		}
	}
}

static void set_channels(struct uneven *u)
{
	par_for(u->s->element_sides, 4096, u->threads, set_exitance, u, NULL);
	par_for(u->t->m->patch.n, 64, u->threads, set_deviations, u, NULL);
	set_colours(u);
}

/* ---- what it makes of others ---- */

struct lack {
	lanes sum, square;        /* of deviations, and their squares, over the rays */
	lanes straight;           /* of the sum, what landings of chain 0 bring */
	lanes slope;              /* of the sum, what slopes bring */
};

static struct lack add_landings(const struct uneven *u, size_t shard, size_t side,
                                const float (*weight)[2])
{
	const struct ff_gathered *g = &u->t->shard[shard]->gathered;
	const uint32_t *chain = u->t->shard_chain[shard];
	struct lack a = { 0 };
	lanes_f32 sum = { 0 }, square = { 0 }, slope = { 0 }, turned = { 0 };

	for (uint64_t i = u->start[shard][side]; i < u->start[shard][side + 1]; i++) {
		const lanes_f32 *d = u->deviation + 3 * (size_t)landing_side(g->landing[i]);
		const float *w = weight[g->landing[i] % LANDING_PLACES];
		lanes_f32 by_slope = w[0] * d[1] + w[1] * d[2], by = d[0] + by_slope;
		if (g->chain && g->chain[i]) {
			lanes_f32 colour = __builtin_convertvector(u->colour[chain[g->chain[i]]], lanes_f32);
			by *= colour;
			by_slope *= colour;
			turned += by;
		}
		sum += by;
		square += by * by;
		slope += by_slope;
	}
	double part = g->rays[side] ? 1. / g->rays[side] : 0;
	a.sum = __builtin_convertvector(sum, lanes) * part;
	a.straight = a.sum - __builtin_convertvector(turned, lanes) * part;
	a.square = __builtin_convertvector(square, lanes) * (part * part);
	a.slope = __builtin_convertvector(slope, lanes) * part;
	return a;
}

/* Weights of corners beyond a third, by place. */
static void place_weights(float weight[LANDING_PLACES][2])
{
	for (uint32_t p = 0; p < LANDING_PLACES; p++) {
		double w[2];
		landing_weights(p, w);
		for (int k = 0; k < 2; k++)
			weight[p][k] = (float)(w[k] - 1. / 3);
	}
}

/* Takes what an element-side lacks; sides by any thread. */
typedef void put_fn(struct uneven *u, size_t es, const struct lack *a);

/* A part of the element-sides that gather: those of a shard, by patch-side, then element. */
struct pass {
	struct uneven *u;
	put_fn *put;
	size_t shard;
	float weight[LANDING_PLACES][2];
};

static void add_patches(void *arg, size_t begin, size_t end, int thread)
{
	const struct pass *p = arg;
	const struct ff *f = p->u->t->shard[p->shard];
	const uint32_t *start = p->u->t->m->patch.start;

	(void)thread;
	for (size_t patch = f->patch_begin + begin; patch < f->patch_begin + end; patch++) {
		size_t side = 2 * (size_t)(start[patch] - start[f->patch_begin]);
		for (size_t way = 0; way < 2; way++)
			for (size_t i = start[patch]; i < start[patch + 1]; i++, side++) {
				struct lack a = add_landings(p->u, p->shard, side, p->weight);
				p->put(p->u, 2 * i + way, &a);
			}
	}
}

static void each_side(struct uneven *u, put_fn *put, void (*then)(struct uneven *))
{
	struct pass pass = { .u = u, .put = put };

	place_weights(pass.weight);
	for (u->first = 0; u->first < channels_of(u); u->first += LANES) {
		set_channels(u);
		for (pass.shard = 0; pass.shard < u->t->shards; pass.shard++) {
			const struct ff *f = u->t->shard[pass.shard];
			par_for(f->patch_end - f->patch_begin, 16, u->threads, add_patches, &pass, NULL);
		}
		if (then)
			then(u);
	}
}

/* ---- a step ---- */

static size_t place_of(const struct uneven *u, size_t es, size_t channel)
{
	size_t bands = (size_t)u->s->bands;

	return (channel / bands * u->s->element_sides + es) * bands + channel % bands;
}

static void put_lack(struct uneven *u, size_t es, const struct lack *a)
{
	struct solution *s = u->s;

	u->straight[es] = a->straight;
	for (size_t k = 0; k < LANES && u->first + k < channels_of(u); k++)
		s->uneven[place_of(u, es, u->first + k)] = (float)a->sum[k];
}

/* Makes what lands straight what is not lost; see uneven.h. */
static void conserve(struct uneven *u)
{
	struct solution *s = u->s;
	const struct model *m = u->t->m;

	memset(u->missing, 0, u->components.n * sizeof *u->missing);
	for (size_t es = 0; es < s->element_sides; es++) {
		lanes deviation = __builtin_convertvector(u->deviation[3 * es], lanes);
		u->missing[component_of(u, es)] -= m->element.area[es >> 1] *
		                                   (u->straight[es] + deviation * (double)u->loss[es]);
	}
	for (size_t es = 0; es < s->element_sides; es++) {
		uint32_t c = component_of(u, es);
		double part = u->uncertain[c] > 0 ? (double)u->doubt[es] / u->uncertain[c] : 0;
		for (size_t k = 0; k < LANES && u->first + k < channels_of(u); k++)
			s->uneven[place_of(u, es, u->first + k)] += (float)(u->missing[c][k] * part);
	}
}

/* Light that arrives anew is sent on as what rows land is; but what lobes and ideal events make of
 * it is in the landings of others. */
static void book(struct uneven *u, size_t es, size_t channel, double flux)
{
	const struct model *m = u->t->m;
	const struct materials *mt = &m->material;
	struct solution *s = u->s;
	size_t channels = solution_channels(s), band = channel % (size_t)s->bands;
	uint32_t ps = 2 * m->element.patch[es >> 1] + (uint32_t)(es & 1);
	size_t at = model_material_at(mt, model_patch_material(m, ps >> 1), (int)(es & 1)) + band;
	double onward = mt->rho_s[at] + mt->tau_s[at];

	s->unshot.diffuse[ps * channels + channel] += mt->rho_d[at] * flux;
	s->unshot.diffuse[(ps ^ 1) * channels + channel] += mt->tau_d[at] * flux;
	s->ledger[LEDGER_ABSORBED * channels + channel] +=
		(1 - mt->rho_d[at] - mt->tau_d[at] - onward) * flux;
	s->ledger[LEDGER_UNEVEN * channels + channel] -= (1 - onward) * flux;
}

double radiosity_uneven_step(struct uneven *u)
{
	struct solution *s = u->s;
	const struct model *m = u->t->m;
	size_t channels = solution_channels(s), bands = (size_t)s->bands;
	double squares = 0, area = 0;

	memcpy(u->before, s->uneven, s->element_sides * channels * sizeof *s->uneven);
	u->total = 0;
	each_side(u, put_lack, conserve);
	for (size_t es = 0; es < s->element_sides; es++) {
		double part = m->element.area[es >> 1];
		if (!model_side_modelled(m, 2 * m->element.patch[es >> 1] + (uint32_t)(es & 1)))
			continue;
		area += part * s->bands;
		for (size_t k = 0; k < bands; k++) {
			double all = 0;
			for (size_t c = k; c < channels; c += bands) {
				size_t at = place_of(u, es, c);
				double change = (double)s->uneven[at] - (double)u->before[at];
				all += change;
				book(u, es, c, part * change);
			}
			squares += part * all * all;
		}
	}
	return area > 0 ? sqrt(squares / area) : 0;
}

/* ---- what is left ---- */

static void put_errors(struct uneven *u, size_t es, const struct lack *a)
{
	struct solution *s = u->s;
	size_t bands = (size_t)s->bands;

	for (size_t k = 0; k < LANES && u->first + k < bands; k++) {
		size_t band = u->first + k, at = es * bands + band;
		double last = 0;
		for (size_t g = 0; g < s->groups; g++) {
			size_t i = place_of(u, es, g * bands + band);
			last += (double)s->uneven[i] - (double)u->before[i];
		}
		s->error.sampling[at] = sqrt(s->error.sampling[at] * s->error.sampling[at] + a->square[k]);
		s->error.uneven[at] = hypot(slope_doubt * a->slope[k], u->left * last);
	}
}

void radiosity_uneven_errors(struct uneven *u, double left)
{
	u->left = left;
	u->total = 1;
	each_side(u, put_errors, NULL);
}
