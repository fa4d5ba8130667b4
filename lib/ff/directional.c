/* Directional form factors: eq. (3) of the paper for every source that a
 * directional patch-side sees.
 *
 * The paper takes one direction from a source patch to the directional patch and
 * weighs the hemicube with cos^k about its mirror image (o.centroid does so, but for
 * the sum). Here the pair of patches is sampled: each sample has its own point and
 * direction, distributed as the diffuse light that really comes from that source (the
 * patch-side's own rays, read backwards, or lines to an emitter), and the lobe about
 * ITS mirrored direction is sampled with density cos^k over the whole lobe. Thus no
 * direction is quantised, the normaliser is never a sum that can miss (eq. 3 with its
 * sum over everything the lobe sees), and any exponent works alike.
 *
 * A link is right for light that leaves its source evenly. Light that leaves a lobe does
 * not: its rays are followed on from where they land, through further lobes. */
#include "lib/ff/directional.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/vec.h"
#include "lib/ff/row_light.h"
#include "lib/ff_rays/ray_follow.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/scatter/bsdf.h"
#include "lib/scatter/lobe.h"

/* Counts, of rays where nothing else is said. What was tried is in tests/bench/lobes.py, which measures
 * the error that links bring in scenes of several lobes; the values themselves are guesses that
 * it did not speak against. */
enum {
	MIN_LOBE_RAYS = 16, MIN_EMITTER_RAYS = 64, /* for any one link and lobe */
	BIN_RAYS = 64,
	EMITTER_LANDINGS = 16, FEW_LOBES = 256, /* see cluster_rays */
	CLUSTER_SHARE = 128,  /* sources are joined up to one CLUSTER_SHARE-th of the rays */
	PROBES = 4,           /* point pairs tried for emitters that no ray met */
	BIN_RINGS = 3, BIN_SECTORS = 8, BIN_SAMPLES = 16
};

struct order {
	const struct chains *chains;
	struct ff_incident c;
	size_t index;
};

static int by_source(const void *a, const void *b)
{
	const struct order *x = a, *y = b;
	int d = x->c.chain == y->c.chain ? 0 : ff_chains_compare(x->chains, x->c.chain, y->c.chain);
	if (d)
		return d;
	if (x->c.source != y->c.source)
		return x->c.source < y->c.source ? -1 : 1;
	return (x->index > y->index) - (x->index < y->index);
}

static int sort_captures(struct ff_thread *t, struct err *e)
{
	struct ff_incident *c = t->incident.data;
	size_t n = t->incident.n;
	struct order *o = mem_new(n, sizeof *o, "light paths", e);

	if (!o)
		return -1;
	for (size_t i = 0; i < n; i++)
		o[i] = (struct order){ &t->tally.chains, c[i], i };
	if (n)
		qsort(o, n, sizeof *o, by_source);
	for (size_t i = 0; i < n; i++)
		c[i] = o[i].c;
	free(o);
	return 0;
}

/* A point of a patch-side to draw a line from: with hemicubes, where one of them stands. */
static void line_begin(const struct ff_thread *t, uint32_t ps, uint32_t i, uint64_t seed,
                       struct ff_incident *c)
{
	const struct ff_job *j = t->job;

	c->view = i % j->o.points;
	if (j->o.method == FF_HEMICUBE) {
		const struct view *v = &t->view[2 * c->view + (ps & 1)];
		c->element = v->element;
		memcpy(c->x, v->eye, sizeof c->x);
	} else {
		c->element = ff_point(j, ps >> 1, rng_sobol(i, 0, seed), rng_sobol(i, 1, seed), c->x);
	}
}

/* Straight lines `begin` to `end` from a patch-side to a source: those that are clear are
 * appended as captures that weigh what light of the source comes along them. */
static int probe(struct ff_thread *t, uint32_t ps, uint32_t source, uint32_t begin,
                 uint32_t end, struct array *to, struct err *e)
{
	const struct ff_job *j = t->job;
	uint64_t seed = rng_mix(j->o.seed ^ (((uint64_t)ps << 32) | source));

	for (uint32_t i = begin; i < end; i++) {
		struct ff_incident c = { .source = source };
		double y[3], nx[3], ny[3];
		line_begin(t, ps, i, seed, &c);
		uint32_t el = ff_point(j, source >> 1, rng_sobol(i, 2, seed), rng_sobol(i, 3, seed), y);
		ff_normal(j, c.element, (int)(ps & 1), nx);
		ff_normal(j, el, (int)(source & 1), ny);
		v3_sub(y, c.x, c.l);
		double r2 = v3_dot(c.l, c.l), cx = v3_dot(c.l, nx), cy = -v3_dot(c.l, ny);
		if (!(cx > 0 && cy > 0))
			continue;
		double from[3] = { c.x[0], c.x[1], c.x[2] };
		ray_leave(j->rays, nx, from);
		ray_leave(j->rays, ny, y);
		t->rays++;
		if (ray_blocked(j->rays, from, y))
			continue;
		v3_normalise(c.l);
		c.w = cx * cy / (r2 * r2);
		if (mem_append(to, &c, 1, sizeof c, e))
			return -1;
	}
	return 0;
}

/* Tries a few straight lines from the patch-side to every emitter that none of its
 * rays met by chain 0: a small lamp far away may well be missed, yet its highlight is
 * what is seen. `all`: what the rays' captures weigh. O(emitters). */
static int probe_unseen(struct ff_thread *t, uint32_t ps, const uint8_t *met, double all,
                        struct err *e)
{
	const struct ff_job *j = t->job;

	for (uint32_t q = 0; q < 2 * j->m->patch.n; q++) {
		size_t before = t->incident.n;
		if (met[q] || !j->emits[q] || q >> 1 == ps >> 1)
			continue;
		if (probe(t, ps, q, 0, PROBES, &t->incident, e))
			return -1;
		for (size_t i = before; i < t->incident.n; i++)
			((struct ff_incident *)t->incident.data)[i].w *=
				all * j->m->patch.area[q >> 1] / (PI * PROBES);
	}
	return 0;
}

/* How many captures of equal weight these are worth. */
static double worth(const struct ff_incident *c, size_t n)
{
	double sum = 0, squares = 0;

	for (size_t i = 0; i < n; i++) {
		sum += c[i].w;
		squares += c[i].w * c[i].w;
	}
	return squares > 0 ? sum * sum / squares : 0;
}

/* Captures of an emitter that is seen straight: a line for each lobe ray, or the n that
 * there are already where they are worth more (a large emitter near by). */
static const struct ff_incident *straight_captures(struct ff_thread *t, uint32_t ps,
                                                   const struct ff_incident *c, size_t *n,
                                                   uint32_t rays, struct err *e)
{
	t->pairs.n = 0;
	if (probe(t, ps, c->source, 0, rays, &t->pairs, e))
		return NULL;
	if (worth(t->pairs.data, t->pairs.n) <= worth(c, *n))
		return c;
	*n = t->pairs.n;
	return t->pairs.data;
}

/* Captures without a source of their own: the patch-side's hemisphere in bins of
 * direction (equal cosine-weighted area), for light nobody expected. */
static uint32_t direction_bin(const double n[3], const double l[3])
{
	double t[3], b[3];

	v3_frame(n, t, b);
	double x = v3_dot(l, t), y = v3_dot(l, b);
	int ring = (int)((x * x + y * y) * BIN_RINGS);
	int sector = (int)((atan2(y, x) / (2 * PI) + .5) * BIN_SECTORS);
	ring = ring < BIN_RINGS ? ring : BIN_RINGS - 1;
	sector = sector < BIN_SECTORS ? sector : BIN_SECTORS - 1;
	return (uint32_t)(ring * BIN_SECTORS + sector);
}

static int bin_captures(struct ff_thread *t, uint32_t ps, struct err *e)
{
	const struct ff_job *j = t->job;
	uint64_t seed = rng_mix(j->o.seed ^ ~(uint64_t)ps);

	for (uint32_t i = 0; i < BIN_RINGS * BIN_SECTORS * BIN_SAMPLES; i++) {
		struct ff_incident c = { .source = FF_ANY, .w = 1, .view = i % j->o.points };
		double n[3], u[2] = { rng_sobol(i, 2, seed), rng_sobol(i, 3, seed) };
		c.element = ff_point(j, ps >> 1, rng_sobol(i, 0, seed), rng_sobol(i, 1, seed), c.x);
		ff_normal(j, c.element, (int)(ps & 1), n);
		bsdf_sample_cosine(n, u, c.l);
		if (mem_append(&t->incident, &c, 1, sizeof c, e))
			return -1;
	}
	return 0;
}

/* One lobe ray of a capture: about R on the side of incidence, or about T = -L on
 * the other. */
static void cast_one(struct ff_thread *t, const struct ff_incident *c, int side, int transmitted,
                     double exponent, const double u[2], ff_cast_fn *cast)
{
	double n[3], axis[3], dir[3];
	int out = transmitted ? !side : side;

	ff_normal(t->job, c->element, out, n);
	bsdf_lobe_mirror(c->l, n, axis);
	if (transmitted)
		for (int k = 0; k < 3; k++)
			axis[k] = -c->l[k];
	double w = bsdf_lobe_scatter(t->job->m->lobe, exponent, axis, n, u, dir);
	ff_tally_rest(&t->tally, 0)->lost += 1 - w;
	if (w > 0)
		cast(t, c, out, dir, w);
}

static int is_light(const struct ff_job *j, uint32_t source)
{
	return source >= 2 * j->m->patch.n;
}

/* 1 if a source gives light of its own. */
static int is_emitter(const struct ff_job *j, uint32_t source)
{
	return source >= 2 * j->m->patch.n || j->emits[source];
}

static void centroid(const struct model *m, uint32_t patch, double c[3])
{
	memset(c, 0, 3 * sizeof *c);
	for (uint32_t el = m->patch.start[patch]; el < m->patch.start[patch + 1]; el++)
		for (int k = 0; k < 3; k++)
			v3_mad(c, m->element.area[el] / (3 * m->patch.area[patch]),
			       &m->vertex[3 * (size_t)m->element.corner[3 * (size_t)el + (size_t)k]], c);
}

static void mean_direction(const struct ff_incident *c, size_t n, double mean[3])
{
	memset(mean, 0, 3 * sizeof *mean);
	for (size_t i = 0; i < n; i++)
		v3_mad(mean, c[i].w, c[i].l, mean);
	v3_normalise(mean);
}

/* Captures as the paper has them: light comes from the source's centroid to that of the
 * patch, all over which it is alike. By a mirror, from a punctual light, or from a source
 * whose centroid is below the horizon, it comes from the mean of the captures c. */
static const struct ff_incident *centroid_captures(struct ff_thread *t, uint32_t ps,
                                                   const struct ff_incident *c, size_t *n,
                                                   uint32_t rays, struct err *e)
{
	const struct ff_job *j = t->job;
	uint64_t seed = rng_mix(j->o.seed ^ ps);
	double from[3], to[3], l[3], normal[3];

	mean_direction(c, *n, l);
	if (c->chain == 0 && !is_light(j, c->source)) {
		centroid(j->m, c->source >> 1, from);
		centroid(j->m, ps >> 1, to);
		v3_sub(from, to, from);
		ff_normal(j, c->element, (int)(ps & 1), normal);
		if (v3_dot(from, normal) > 0)
			memcpy(l, from, sizeof l);
	}
	v3_normalise(l);
	t->pairs.n = 0;
	for (uint32_t i = 0; i < rays; i++) {
		struct ff_incident all = { .source = c->source, .chain = c->chain, .w = 1 };
		line_begin(t, ps, i, seed, &all);
		memcpy(all.l, l, sizeof l);
		if (mem_append(&t->pairs, &all, 1, sizeof all, e))
			return NULL;
	}
	*n = rays;
	return t->pairs.data;
}

/* The G row of one link and lobe: `rays` rays, shared out among its captures in
 * proportion to their weights. (At even steps through captures of a sequence, weights
 * that alternate would be in step with them.) */
static int lobe_row(struct ff_thread *t, uint32_t ps, const struct ff_incident *c, size_t n,
                    int transmitted, uint32_t rays, ff_cast_fn *cast, struct ff_batch *b,
                    struct err *e)
{
	const struct materials *mt = &t->job->m->material;
	uint32_t material = model_patch_material(t->job->m, ps >> 1);
	int side = (int)(ps & 1), out = transmitted ? !side : side;
	double exponent = (transmitted ? mt->beta : mt->alpha)[2 * material + (uint32_t)side];
	uint64_t seed = rng_next(&t->rng);
	double sum = 0, cumulated;
	size_t at = 0;

	for (size_t i = 0; i < n; i++)
		sum += c[i].w;
	cumulated = c[0].w;
	t->lobe_depth = t->job->o.lobe_depth;
	for (uint32_t i = 0; i < rays; i++) {
		double u[2] = { rng_sobol(i, 4, seed), rng_sobol(i, 5, seed) };
		double want = (i + rng_uniform(&t->rng)) / rays * sum;
		while (at + 1 < n && cumulated < want)
			cumulated += c[++at].w;
		cast_one(t, &c[at], side, transmitted, exponent, u, cast);
	}
	ff_lobes_cast(t);
	t->lobe_depth = 0;
	return ff_tally_finish(&t->tally, b, (ps & ~1u) | (uint32_t)out,
	                       transmitted ? FF_TRANSMITTED : FF_REFLECTED, rays, rays, e);
}

static int add_link(struct ff_thread *t, uint32_t ps, const struct ff_incident *c, size_t n,
                    uint32_t rays, ff_cast_fn *cast, struct ff_batch *b, struct err *e)
{
	const struct materials *mt = &t->job->m->material;
	uint32_t material = model_patch_material(t->job->m, ps >> 1), row[2];
	double mean[3];
	float direction[3];

	mean_direction(c, n, mean);
	for (int k = 0; k < 3; k++)
		direction[k] = (float)mean[k];
	for (int transmitted = 0; transmitted < 2; transmitted++) {
		row[transmitted] = FF_NO_ROW;
		if (!bsdf_has_lobe(mt, material, (int)(ps & 1), transmitted))
			continue;
		row[transmitted] = (uint32_t)b->row_side.n;
		if (lobe_row(t, ps, c, n, transmitted, rays, cast, b, e))
			return -1;
	}
	return mem_append(&b->link_target, &ps, 1, sizeof ps, e) ||
	       mem_append(&b->link_source, &c[0].source, 1, sizeof c->source, e) ||
	       mem_append(&b->link_last, &c[n - 1].source, 1, sizeof c->source, e) ||
	       mem_append(&b->link_chain, &c->chain, 1, sizeof c->chain, e) ||
	       mem_append(&b->link_direction, direction, 3, sizeof *direction, e) ||
	       mem_append(&b->link_row, row, 2, sizeof *row, e) ? -1 : 0;
}

/* Bins of FF_ANY are told apart by the direction: sort them into bins first. */
static int bin_links(struct ff_thread *t, uint32_t ps, ff_cast_fn *cast, struct ff_batch *b,
                     struct err *e)
{
	struct array all, bin = { 0 };
	int bad = 0;

	t->incident.n = 0;
	if (bin_captures(t, ps, e))
		return -1;
	all = t->incident;
	for (uint32_t k = 0; !bad && k < BIN_RINGS * BIN_SECTORS; k++) {
		const struct ff_incident *c = all.data;
		bin.n = 0;
		for (size_t i = 0; !bad && i < all.n; i++) {
			double n[3];
			ff_normal(t->job, c[i].element, (int)(ps & 1), n);
			if (direction_bin(n, c[i].l) == k)
				bad = mem_append(&bin, &c[i], 1, sizeof c[i], e);
		}
		if (!bad && bin.n)
			bad = add_link(t, ps, bin.data, bin.n, BIN_RAYS, cast, b, e);
	}
	free(bin.data);
	return bad;
}

/* The end of the cluster that begins at capture i, and its weight: an emitter by
 * itself; other sources while they come by the same chain, from within a narrow cone
 * about the first (patches are numbered along a spatial tree, so neighbours in number
 * are mostly neighbours in space), and until they weigh enough for a row of their own.
 * Light from within a cluster is spread over it as its form factors are. */
static size_t cluster_end(const struct ff_job *j, const struct ff_incident *c, size_t i, size_t n,
                          double enough, double *w)
{
	const double narrow = .97; /* cos 14 degrees */
	size_t end = i;

	while (end < n && c[end].chain == c[i].chain) {
		uint32_t source = c[end].source;
		if (source != c[i].source &&
		    (j->o.centroid || *w >= enough || is_emitter(j, source) ||
		     is_emitter(j, c[i].source) ||
		     v3_dot(c[end].l, c[i].l) < narrow))
			break;
		while (end < n && c[end].chain == c[i].chain && c[end].source == source)
			*w += c[end++].w;
	}
	return end;
}

/* Rays for the rows of a cluster that is `share` of what the patch-side sees. Emitters, whose
 * light is brightest, share emitter_gain times what the others do, but each gets no more than
 * EMITTER_LANDINGS times what its own row would send here of as many: where it is small or
 * far, its light on the patch-side is a small part of what it gives. Lobes that are few are
 * all that evens out one another's noise, so they get more. */
static uint32_t cluster_rays(const struct ff_job *j, uint32_t ps, const struct ff_incident *c,
                             double share, size_t emitters)
{
	double rays = share * j->o.lobe_rays, least = MIN_LOBE_RAYS;

	if (is_emitter(j, c->source)) {
		double all = (double)j->o.lobe_rays * j->o.emitter_gain;
		double lands = is_light(j, c->source) ? 1
		             : share * j->m->patch.area[ps >> 1] / j->m->patch.area[c->source >> 1];
		lands *= EMITTER_LANDINGS * fmax(1, FEW_LOBES / (double)j->lobes);
		rays = all * fmin(1. / (double)emitters, lands);
		least = MIN_EMITTER_RAYS;
	}
	return (uint32_t)fmax(least, fmin(rays, UINT32_MAX));
}

/* Emitters, by chain, among sorted captures. */
static size_t count_emitters(const struct ff_job *j, const struct ff_incident *c, size_t n)
{
	size_t emitters = 0;

	for (size_t i = 0; i < n; i++)
		emitters += (size_t)is_emitter(j, c[i].source) &&
		            (i == 0 || c[i].source != c[i - 1].source || c[i].chain != c[i - 1].chain);
	return emitters;
}

int ff_directional_rows(struct ff_thread *t, uint32_t ps, ff_cast_fn *cast, struct ff_batch *b,
                        struct err *e)
{
	const struct ff_job *j = t->job;
	const struct ff_incident *c;
	uint8_t *met = mem_new(2 * j->m->patch.n, 1, "sources met", e);
	double all = 0;
	size_t own = t->incident.n, emitters = 0;
	int bad = !met;

	c = t->incident.data;
	for (size_t i = 0; !bad && i < own; i++) {
		all += c[i].w;
		if (c[i].chain == 0)
			met[c[i].source] = 1;
	}
	bad = bad || probe_unseen(t, ps, met, all, e) || ff_light_incident(t, ps, e) ||
	      sort_captures(t, e);
	free(met);
	c = t->incident.data;
	if (!bad)
		emitters = count_emitters(j, c, t->incident.n);
	for (size_t i = 0, end; !bad && i < t->incident.n; i = end) {
		double w = 0;
		end = cluster_end(j, c, i, t->incident.n, all / CLUSTER_SHARE, &w);
		double share = all > 0 ? fmin(1, w / all) : 0;
		uint32_t rays = cluster_rays(j, ps, &c[i], share, emitters);
		size_t many = end - i;
		const struct ff_incident *of = &c[i];
		if (j->o.centroid)
			of = centroid_captures(t, ps, of, &many, rays, e);
		else if (of->chain == 0 && !is_light(j, of->source) && j->emits[of->source])
			of = straight_captures(t, ps, of, &many, rays, e);
		bad = !of || add_link(t, ps, of, many, rays, cast, b, e);
		c = t->incident.data;
	}
	return bad ? bad : bin_links(t, ps, cast, b, e);
}
