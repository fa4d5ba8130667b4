/* Where the light of punctual lights arrives.
 *
 * What comes straight, also through clear panes, is found from the elements: points of
 * each look at the light, and where all see it alike the value is exact: the element's
 * solid angle, or its area across the light. The images of lights in plane mirrors are
 * looked at likewise. What mirrors turn more often, or are not plane, is sampled with rays
 * of the light, which also tell whether any leaves the scene: if none does, values of elements
 * that see the light in part are fitted so that the row adds up. */
#include "lib/ff/row_light.h"

#include <math.h>

#include "lib/base/vec.h"
#include "lib/data/punctual.h"
#include "lib/ff_rays/light_paths.h"
#include "lib/ff_rays/ray_follow.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/geometry/solid_angle.h"
#include "lib/scatter/bsdf.h"

/* Counts; guesses. tests/unit/test_lights.c holds the errors stated with them. */
enum {
	POINTS_FIRST = 32,      /* that look from an element; all if they differ */
	POINTS_LEAST = 256,
	POINTS_PART = 16,       /* one over this of a patch-side's rays */
	CAPTURES = 1024,        /* of a directional patch-side, for each light */
	BENT_GAIN = 8           /* times an emitter's rays where light is turned */
};

/* What arrives at an element-side by one chain. */
struct light_arrival {
	uint32_t column, chain;
	double value;           /* first summed weights; then the fraction of the light's flux */
	double variance;        /* 0: exact */
	double toward[3];       /* summed directions to the light, weighted */
};

/* An element-side looking at a light, or at its image in a mirror. */
struct look {
	const struct lights *l; /* with their images */
	size_t light;           /* of these */
	uint32_t column;
	double normal[3];
	double clear;           /* rays end so far before the light */
	uint64_t seed;
	uint32_t points;        /* so far */
	uint32_t full;          /* of these, see all of it by the chain of the first */
	uint32_t none;          /* see nothing */
	double all, seen;       /* summed weights of points: if all saw all, and so */
	double squares[3];      /* summed all^2, all seen, seen^2 */
	size_t first;           /* of its chains in t->arrivals */
};

/* ---- an element looks at the light ---- */

static void see_by(struct ff_thread *t, struct look *k, uint32_t chain, double w,
                   const double toward[3])
{
	struct light_arrival *arrival = t->arrivals.data, new = { .column = k->column, .chain = chain };
	size_t i = k->first;

	while (i < t->arrivals.n && arrival[i].chain != chain)
		i++;
	if (i == t->arrivals.n && mem_append(&t->arrivals, &new, 1, sizeof new, &t->tally.err))
		return;
	arrival = (struct light_arrival *)t->arrivals.data + i;
	arrival->value += w;
	v3_mad(arrival->toward, w, toward, arrival->toward);
}

static void look_from(struct ff_thread *t, struct look *k, const double x[3])
{
	double from[3] = { x[0], x[1], x[2] };
	struct light_sample s;
	uint32_t chain = CHAIN_NONE;

	model_light_see(k->l, k->light, x, k->clear, &s);
	double all = fmax(0, v3_dot(k->normal, s.toward)) * s.across, w = all * s.falloff;
	k->points++;
	k->all += all;
	k->squares[0] += all * all;
	if (w > 0) {
		ray_leave(t->job->rays, k->normal, from);
		chain = ff_light_chain(t, k->light, from, &s);
	}
	if (chain == CHAIN_NONE) {
		k->none++;
		return;
	}
	see_by(t, k, chain, w, s.toward);
	k->seen += w;
	k->squares[1] += all * w;
	k->squares[2] += w * w;
	k->full += s.falloff >= 1 && t->arrivals.n > k->first &&
	           ((struct light_arrival *)t->arrivals.data)[k->first].chain == chain;
}

static void look(struct ff_thread *t, struct look *k, uint32_t points)
{
	const struct ff_element *el = &t->job->element[k->column >> 1];

	for (uint32_t i = k->points; i < points; i++) {
		double r = sqrt(rng_sobol(i, 0, k->seed)), u = rng_sobol(i, 1, k->seed), x[3];
		for (int c = 0; c < 3; c++)
			x[c] = el->corner[c] + r * (1 - u) * el->edge[0][c] + r * u * el->edge[1][c];
		look_from(t, k, x);
	}
}

/* Flux on an element of a light of intensity 1 in all directions, nothing between. */
static double whole_flux(const struct model *m, const struct look *k)
{
	uint32_t element = k->column >> 1;
	double corner[9];

	if (k->l->kind[k->light] == LIGHT_DIRECTIONAL)
		return m->element.area[element] *
		       -v3_dot(&k->l->direction[3 * k->light], k->normal);
	for (size_t c = 0; c < 9; c++)
		corner[c] = m->vertex[3 * (size_t)m->element.corner[3 * (size_t)element + c / 3] + c % 3];
	return geo_solid_angle(corner, &k->l->position[3 * k->light]);
}

/* From summed weights to fractions of the light's flux. */
static void weigh(struct ff_thread *t, const struct look *k)
{
	struct light_arrival *arrival = t->arrivals.data;
	double scale = whole_flux(t->job->m, k) / k->l->unit_flux[k->light] / k->all;
	double part = k->seen / k->all, spread = 0;

	if (k->full < k->points) /* of a ratio estimate: Cochran, Sampling Techniques, 6.4 */
		spread = fmax(0, k->squares[2] - 2 * part * k->squares[1] +
		                 part * part * k->squares[0]);
	for (size_t i = k->first; i < t->arrivals.n; i++) {
		arrival[i].variance = spread * scale * scale * arrival[i].value / k->seen;
		arrival[i].value *= scale;
	}
}

/* The side of an element's plane that a light is on, or -1 in the plane. */
static int side_towards(const struct model *m, const struct lights *l, size_t light,
                        uint32_t element, double clear)
{
	const double *n = &m->element.normal[3 * (size_t)element];
	double to[3], height;

	if (l->kind[light] == LIGHT_DIRECTIONAL) {
		height = -v3_dot(&l->direction[3 * light], n);
		return height > 1e-14 ? FRONT : height < -1e-14 ? BACK : -1;
	}
	v3_sub(&l->position[3 * light], &m->vertex[3 * (size_t)m->element.corner[3 * (size_t)element]], to);
	height = v3_dot(to, n);
	return height > clear ? FRONT : height < -clear ? BACK : -1;
}

static void light_element(struct ff_thread *t, const struct look *from, uint32_t element)
{
	const struct ff_job *j = t->job;
	uint32_t most = j->o.method == FF_HEMICUBE ? 0 : j->o.rays / POINTS_PART;
	int side = side_towards(j->m, from->l, from->light, element, from->clear);
	struct look k = *from;

	if (side < 0)
		return;
	k.first = t->arrivals.n;
	k.column = 2 * element + (uint32_t)side;
	k.seed = rng_mix(from->seed ^ rng_mix(element));
	ff_normal(j, element, side, k.normal);
	look(t, &k, POINTS_FIRST);
	if (k.full < k.points && k.none < k.points)
		look(t, &k, most > POINTS_LEAST ? most : POINTS_LEAST);
	if (t->arrivals.n > k.first)
		weigh(t, &k);
}

/* All elements look at a light, and at its images. */
static void light_elements(struct ff_thread *t, size_t light)
{
	const struct ff_job *j = t->job;
	const struct light_images *g = &j->lights.images;
	struct look k = { .l = &g->l, .clear = ray_offset(j->rays),
	                  .seed = rng_mix(j->o.seed ^ rng_mix(light)) };

	t->arrivals.n = 0;
	for (size_t i = 0; i < g->l.n; i++) {
		if (g->origin[i] != light)
			continue;
		k.light = i;
		for (uint32_t el = 0; el < j->m->element.n; el++)
			light_element(t, &k, el);
	}
}

/* ---- a row ---- */

static uint32_t cast(struct ff_thread *t, size_t light)
{
	const struct ff_job *j = t->job;
	uint64_t seed = rng_mix(j->o.seed ^ rng_mix(~(uint64_t)light));
	uint64_t n = (uint64_t)j->o.rays * j->o.emitter_gain * (j->has_ideal ? BENT_GAIN : 1);
	uint32_t rays = n < UINT32_MAX ? (uint32_t)n : UINT32_MAX;

	t->bent_only = 1;
	t->lobe_depth = j->o.lobe_depth;
	t->turned = 0;
	t->rng = rng_seed(j->o.seed, model_sources(j->m) + light);
	for (uint32_t i = 0; i < rays; i++) {
		double u[3] = { rng_sobol(i, 0, seed), rng_sobol(i, 1, seed), rng_sobol(i, 2, seed) };
		double org[3], dir[3];
		model_light_ray(&j->m->light, light, u, ray_offset(j->rays), org, dir);
		ff_follow(t, org, dir, 1, 0);
	}
	t->bent_only = 0;
	t->lobe_depth = 0;
	return rays;
}

/* Makes what comes straight add up to 1 by the values in doubt; light on black backs is
 * among it. */
static void fit(struct array *all)
{
	struct light_arrival *arrival = all->data;
	double sure = 0, doubtful = 0;

	for (size_t i = 0; i < all->n; i++)
		if (arrival[i].chain == 0)
			*(arrival[i].variance > 0 ? &doubtful : &sure) += arrival[i].value;
	for (size_t i = 0; i < all->n && doubtful > 0 && sure < 1; i++)
		if (arrival[i].chain == 0 && arrival[i].variance > 0)
			arrival[i].value *= (1 - sure) / doubtful;
}

/* What elements saw into the tally, whose weights count `rays` as 1. Returns the part
 * that came by chain 0. */
static double put_straight(struct ff_thread *t, double rays)
{
	const struct light_arrival *arrival = t->arrivals.data;
	const struct model *m = t->job->m;
	double first = 0;

	for (size_t i = 0; i < t->arrivals.n; i++) {
		uint32_t ps = 2 * m->element.patch[arrival[i].column >> 1] + (arrival[i].column & 1);
		double back[3] = { -arrival[i].toward[0], -arrival[i].toward[1], -arrival[i].toward[2] };
		first += arrival[i].chain == 0 ? arrival[i].value : 0;
		v3_normalise(back);
		if (t->job->is_black[ps])
			ff_tally_rest(&t->tally, arrival[i].chain)->black += arrival[i].value * rays;
		else
			ff_tally_hit(&t->tally, arrival[i].chain, arrival[i].column,
			             arrival[i].value * rays, back);
	}
	return first;
}

/* As many independent rays as the row is worth: with n of them, light that arrives in
 * parts f would have variances that add up to f / n. 0 if all is exact. */
static uint32_t worth(const struct ff_thread *t, double rays, double straight)
{
	const struct light_arrival *arrival = t->arrivals.data;
	double turned = t->turned / rays, variance = turned / rays;

	for (size_t i = 0; i < t->arrivals.n; i++)
		variance += arrival[i].variance;
	if (!(variance > 0))
		return 0;
	double n = (straight + turned) / variance;
	return n < 1 ? 1 : n < UINT32_MAX ? (uint32_t)n : UINT32_MAX;
}

int ff_light_row(struct ff_thread *t, uint32_t light, struct ff_batch *b, struct err *e)
{
	const struct model *m = t->job->m;

	if (!(m->light.unit_flux[light] > 0))
		return 0;
	uint32_t rays = cast(t, light);
	light_elements(t, light);
	int open = ff_tally_rest(&t->tally, 0)->escape > 0;
	if (!open)
		fit(&t->arrivals);
	double straight = put_straight(t, rays);
	ff_tally_rest(&t->tally, 0)->escape = open ? fmax(0, 1 - straight) * rays : 0;
	return ff_tally_finish(&t->tally, b, (uint32_t)(2 * m->patch.n) + light, FF_LIGHT,
	                       worth(t, rays, straight), rays, e);
}

/* ---- links ---- */

int ff_light_incident(struct ff_thread *t, uint32_t ps, struct err *e)
{
	const struct ff_job *j = t->job;
	const struct lights *l = &j->m->light;

	for (uint32_t light = 0; light < l->n; light++) {
		uint64_t seed = rng_mix(j->o.seed ^ rng_mix((uint64_t)ps << 32 | light));
		for (uint32_t i = 0; i < CAPTURES; i++) {
			struct ff_incident c = { .source = (uint32_t)(2 * j->m->patch.n) + light,
			                     .view = i % j->o.points };
			struct light_sample s;
			double n[3], from[3];
			c.element = ff_point(j, ps >> 1, rng_sobol(i, 0, seed), rng_sobol(i, 1, seed), c.x);
			ff_normal(j, c.element, (int)(ps & 1), n);
			model_light_see(l, light, c.x, ray_offset(j->rays), &s);
			c.w = fmax(0, v3_dot(n, s.toward)) * s.across * s.falloff;
			if (!(c.w > 0))
				continue;
			for (int k = 0; k < 3; k++) {
				from[k] = c.x[k];
				c.l[k] = s.toward[k];
			}
			ray_leave(j->rays, n, from);
			c.chain = ff_light_chain(t, light, from, &s);
			if (c.chain != CHAIN_NONE && mem_append(&t->incident, &c, 1, sizeof c, e))
				return -1;
		}
	}
	return 0;
}
