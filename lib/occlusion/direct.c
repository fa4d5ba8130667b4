#include "lib/occlusion/direct.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/base/replicates.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/data/punctual.h"
#include "lib/geometry/contour.h"
#include "lib/geometry/cubature.h"
#include "lib/occlusion/emitters.h"
#include "lib/occlusion/facet_set.h"
#include "lib/occlusion/visible_region.h"

/* Limits of the formula, counts. Both are guesses; trace(1) tells users of them, and the table of
 * README.md (tests/bench/report) what formula and shadow rays cost. */
enum {
	EXACT_MOST = 48,     /* emitters: each is looked at for each side; more are all sampled */
	OCCLUDERS_MOST = 16  /* between a side and one of them: each is clipped off at every point,
	                        and beyond, rays cost less */
};

/* Shadow rays of a part, counts: at first and at most. Powers of two, which Sobol points fill
 * evenly; both are guesses. 4 x 256 rays reach an error of 3 % where half the light is hidden,
 * if they are no better than independent ones. */
enum { RAYS_FIRST = 4, RAYS_MOST = 256 };

struct direct {
	const struct model *m;
	const struct ray_scene *rays;
	double centre[3];
	struct emitters emitters;
	struct occluder_set occluders;
	int exact;                    /* emitters are looked at one by one */
};

/* What the side sees of an emitter. */
struct visible_emitter {
	const struct emitter *emitter;
	struct facet_room room;
	const struct facet *f;        /* the part in front of the side's plane */
	uint64_t occluders;           /* bits of the side's that may hide something */
	int sampled;
};

struct direct_worker {
	const struct direct *d;
	uint32_t element_side;        /* UINT32_MAX: none yet */
	double normal[3];
	struct visible_emitter *visible_emitter; /* [emitters, or EXACT_MOST at most] */
	size_t visible_emitters;
	double *weight;               /* [emitters] cumulated, of sampled ones */
	struct visible_point visible;
	struct shaft shaft;
};

/* ---- what all points share ---- */

struct direct *occ_direct_new(const struct model *m, const struct ray_scene *rays, struct err *e)
{
	struct direct *d = mem_new(1, sizeof *d, "direct light", e);

	if (!d)
		return NULL;
	d->m = m;
	d->rays = rays;
	occ_facet_centre(m, d->centre);
	int bad = occ_emitters_init(&d->emitters, m, e);
	d->exact = d->emitters.n <= EXACT_MOST;
	if (!bad && (!d->exact || !occ_occluder_set_init(&d->occluders, m, e)))
		return d;
	occ_direct_free(d);
	return NULL;
}

void occ_direct_free(struct direct *d)
{
	if (!d)
		return;
	occ_emitters_free(&d->emitters);
	occ_occluder_set_free(&d->occluders);
	free(d);
}

struct direct_worker *occ_direct_worker_new(const struct direct *d, struct err *e)
{
	struct direct_worker *w = mem_new(1, sizeof *w, "direct light", e);

	if (!w)
		return NULL;
	w->d = d;
	w->element_side = UINT32_MAX;
	w->visible_emitter =
	    mem_new(d->exact ? d->emitters.n : 0, sizeof *w->visible_emitter, "direct light", e);
	w->weight = mem_new(d->emitters.n, sizeof *w->weight, "direct light", e);
	if (w->visible_emitter && w->weight)
		return w;
	occ_direct_worker_free(w);
	return NULL;
}

void occ_direct_worker_free(struct direct_worker *w)
{
	if (!w)
		return;
	free(w->visible_emitter);
	free(w->weight);
	free(w);
}

int occ_direct_exact(const struct direct *d)
{
	return d->exact;
}

/* ---- what stands between a side and the emitters ---- */

/* Puts the shaft's occluders behind those that the side has. 0 if there is no room. */
static int put_occluders(struct direct_worker *w, int *used, struct visible_emitter *o)
{
	if (*used + w->shaft.occluders > SHAFT_OCCLUDERS)
		return 0;
	for (int i = 0; i < w->shaft.occluders; i++)
		if (occ_occluder_make(&w->d->occluders, w->shaft.occluder[i], o->f,
		                      &w->visible.occluder[*used]))
			o->occluders |= (uint64_t)1 << (*used)++;
	return 1;
}

/* What the element-side f sees of an emitter; 0 if nothing. */
static int find_visible(struct direct_worker *w, const struct facet *f, const struct emitter *t,
                        int *used, struct visible_emitter *o)
{
	const struct direct *d = w->d;
	struct facet_room room;
	const struct facet *from = occ_facet_front(f, &t->f, d->occluders.near, &room);

	o->emitter = t;
	o->occluders = 0;
	o->sampled = 0;
	o->f = from ? occ_facet_front(&t->f, f, d->occluders.near, &o->room) : NULL;
	if (!o->f)
		return 0;
	w->shaft.most = OCCLUDERS_MOST;
	enum shaft_state state = occ_shaft_cull(&w->shaft, &d->occluders, from, o->f);
	o->sampled =
	    state == SHAFT_CROWDED || (state == SHAFT_PARTLY && !put_occluders(w, used, o));
	return state != SHAFT_HIDDEN;
}

/* The element as a facet whose front is the side. */
static struct facet side_facet(const struct direct *d, uint32_t element_side, double corner[9])
{
	struct facet f = { .n = 3, .v = corner };
	const uint32_t *c = &d->m->element.corner[3 * (size_t)(element_side >> 1)];

	for (int k = 0; k < 3; k++)
		v3_sub(&d->m->vertex[3 * (size_t)c[element_side & 1 ? 2 - k : k]], d->centre,
		       &corner[3 * k]);
	geo_facet_measure(&f);
	return f;
}

void occ_direct_begin(struct direct_worker *w, uint32_t element_side)
{
	const struct direct *d = w->d;
	double corner[9];
	int used = 0;

	if (element_side == w->element_side)
		return;
	struct facet f = side_facet(d, element_side, corner);
	w->element_side = element_side;
	memcpy(w->normal, f.normal, sizeof w->normal);
	w->visible_emitters = 0;
	for (size_t i = 0; i < d->emitters.n && d->exact; i++)
		w->visible_emitters += (size_t)find_visible(w, &f, &d->emitters.emitter[i], &used,
		                            &w->visible_emitter[w->visible_emitters]);
	occ_visible_begin(&w->visible, used, d->occluders.near);
}

/* ---- by formula ---- */

/* cos^m; nearly every emitter has m = 1. */
static double lobe(double cos_theta, double exponent)
{
	return exponent == 1 ? cos_theta : pow(cos_theta, exponent);
}

/* Angle between a unit vector and any other. */
static double angle(const double unit[3], const double v[3])
{
	double c[3];

	v3_cross(unit, v, c);
	return atan2(sqrt(v3_dot(c, c)), v3_dot(unit, v));
}

/* Integral of cos^(m-1) weight dw over a convex polygon seen whole from x, m the emitter's
 * exponent: by cubature over parts that are small for their distance, and for what the
 * weight varies over. */
static double weighted_part(const struct emitter *t, const double x[3], const struct facet *f,
                            const struct direct_weight *weight, int depth)
{
	/* DEEPEST, a count of quarterings: parts 2^-24 of the polygon wide are rounding. ROOM: what
	 * the largest rule takes of the most corners (geo_cubature_points). A part is small when
	 * its radius is a third of its distance, or the weight's width: a guess for the 7 points
	 * of degree 5. */
	enum { DEEPEST = 24, ROOM = 36 * (FACET_CORNERS / 2) };
	struct facet_room quarter[4];
	double d[3], sum = 0, small = fmin(1. / 3, weight->width);

	v3_sub(f->centre, x, d);
	double far = sqrt(v3_dot(d, d));
	if (far > f->radius && angle(weight->axis, d) - asin(f->radius / far) > weight->reach)
		return 0;
	/* Close to x, parts are as small as what is near them no longer matters. */
	if (depth < (far < f->radius ? DEEPEST / 4 : DEEPEST) && small * far < f->radius &&
	    geo_facet_quarter(f, quarter)) {
		for (int i = 0; i < 4; i++)
			sum += weighted_part(t, x, &quarter[i].f, weight, depth + 1);
		return sum;
	}
	double at[4][ROOM];
	struct cubature p = { 0, at[0], at[1], at[2], at[3] };
	geo_cubature_fill(f, 1, &p);
	for (int i = 0; i < p.n; i++) {
		double y[3] = { p.x[i], p.y[i], p.z[i] };
		v3_sub(y, x, d);
		double r = v3_normalise(d), there = -v3_dot(d, t->f.normal);
		if (p.w[i] > 0 && there > 0)
			sum += p.w[i] * lobe(there, t->exponent) * weight->at(d, weight->arg) /
			       (r * r);
	}
	return sum;
}

struct weighted_eye {
	const struct emitter *t;
	const double *x;
	const struct direct_weight *weight;
};

/* The same over a polygon as x sees it: a fan of triangles. */
static double weighted_polygon(const struct point_polygon *p, void *arg)
{
	const struct weighted_eye *o = arg;
	double sum = 0;

	for (int k = 1; k + 1 < p->n; k++) {
		double corner[9];
		struct facet f = { .n = 3, .v = corner };
		for (int i = 0; i < 3; i++) {
			int c = i ? k + i - 1 : 0;
			corner[3 * i] = o->x[0] + p->x[c];
			corner[3 * i + 1] = o->x[1] + p->y[c];
			corner[3 * i + 2] = o->x[2] + p->z[c];
		}
		geo_facet_measure(&f);
		if (f.area > 0)
			sum += weighted_part(o->t, o->x, &f, o->weight, 0);
	}
	return sum;
}

/* NaN and e when memory is short. */
static double weighted(struct direct_worker *w, const struct visible_emitter *o, const double x[3],
                       const struct direct_weight *weight, struct err *e)
{
	struct weighted_eye eye = { o->emitter, x, weight };

	if (v3_dot(o->emitter->f.normal, x) - o->emitter->f.offset <= 0)
		return 0;
	return occ_visible_integrate(&w->visible, x, o->f, o->occluders, weighted_polygon, &eye, e);
}

int occ_direct_weighted(struct direct_worker *w, const double world[3],
                        const struct direct_weight *weight, double *h, struct err *e)
{
	double x[3];

	v3_sub(world, w->d->centre, x);
	memset(h, 0, (size_t)w->d->m->bands * sizeof *h);
	for (size_t i = 0; i < w->visible_emitters; i++) {
		double f = weighted(w, &w->visible_emitter[i], x, weight, e);
		if (isnan(f))
			return -1;
		for (int b = 0; b < w->d->m->bands; b++)
			h[b] += f * w->visible_emitter[i].emitter->radiance[b];
	}
	return 0;
}

int occ_direct_sampled(const struct direct_worker *w)
{
	int sampled = !w->d->exact;

	for (size_t i = 0; i < w->visible_emitters; i++)
		sampled |= w->visible_emitter[i].sampled;
	return sampled;
}

static double cosine(const double dir[3], const void *normal)
{
	return fmax(0, v3_dot(dir, normal));
}

/* Irradiance for unit radiance along the emitter's normal. NaN and e when memory is short. */
static double exact(struct direct_worker *w, const struct visible_emitter *o, const double x[3],
                    struct err *e)
{
	const struct emitter *t = o->emitter;

	if (v3_dot(t->f.normal, x) - t->f.offset <= 0)
		return 0;
	if (!o->occluders && t->exponent == 1)
		return PI * fmax(0, geo_contour_point(x, w->normal, o->f->n, o->f->v));
	if (t->exponent == 1)
		return PI * occ_visible_exchange(&w->visible, x, w->normal, o->f, o->occluders, e);
	struct direct_weight all = { .at = cosine, .arg = w->normal, .width = 1, .reach = PI };
	memcpy(all.axis, w->normal, sizeof all.axis);
	return weighted(w, o, x, &all, e);
}

/* ---- by shadow rays ---- */

/* About what an emitter would bring if nothing were hidden: the density that it is chosen
 * with. 0 only if it is behind the plane of x, or x behind its plane. */
static double guess(const struct direct_worker *w, const struct emitter *t, const double x[3])
{
	double d[3], lowest, highest, offset = v3_dot(w->normal, x);
	double there = v3_dot(t->f.normal, x) - t->f.offset;

	geo_facet_heights(&t->f, w->normal, offset, &lowest, &highest);
	if (highest <= 0 || there <= 0)
		return 0;
	v3_sub(t->f.centre, x, d);
	double r2 = fmax(v3_dot(d, d), t->f.radius * t->f.radius), r = sqrt(r2);
	return t->power * lobe(fmin(1, there / r), t->exponent) * (highest / r) / r2;
}

/* 1 if nothing is between points x and y of the side and of an emitter. */
static int unoccluded(struct direct_worker *w, const double x[3], const double y[3],
                      const struct emitter *t)
{
	double from[3], to[3];

	v3_mad(x, 1, w->d->centre, from);
	v3_mad(y, 1, w->d->centre, to);
	ray_leave(w->d->rays, w->normal, from);
	ray_leave(w->d->rays, t->f.normal, to);
	return !ray_blocked(w->d->rays, from, to);
}

/* Adds what one shadow ray brings to h. */
static void add_ray(struct direct_worker *w, const double x[3], size_t n, const double u[3],
                    double *h)
{
	const struct direct *d = w->d;
	double total = w->weight[n - 1], at = u[0] * total, y[3], v[3];
	size_t lo = 0;

	for (size_t left = n; left > 1;) {
		size_t half = left / 2;
		lo += w->weight[lo + half - 1] <= at ? half : 0;
		left -= half;
	}
	const struct emitter *t =
	    d->exact ? w->visible_emitter[lo].emitter : &d->emitters.emitter[lo];
	double share = (w->weight[lo] - (lo ? w->weight[lo - 1] : 0)) / total;
	geo_facet_point(&t->f, u[1], u[2], y);
	v3_sub(y, x, v);
	double r2 = v3_dot(v, v), r = sqrt(r2);
	double here = v3_dot(v, w->normal) / r, there = -v3_dot(v, t->f.normal) / r;
	if (!(here > 0 && there > 0 && share > 0) || !unoccluded(w, x, y, t))
		return;
	double scale = here * lobe(there, t->exponent) / r2 * t->f.area / share;
	for (int b = 0; b < d->m->bands; b++)
		h[b] += scale * t->radiance[b];
}

/* What sampling is to reach. */
struct aim {
	double relative;
	const double *other;
	double unoccluded;            /* about what there would be if nothing were hidden */
};

/* Mean of the parts, its standard error, and whether that is small enough. Where no ray
 * arrived, the next one may be the first that does. */
static int settled(double part[REPLICATES][BANDS_MAX], int bands, double rays,
                   const struct aim *aim, double *h, double *error)
{
	int good = 1;

	for (int b = 0; b < bands; b++) {
		struct replicates r = replicates_of(&part[0][b], BANDS_MAX, REPLICATES);
		h[b] = r.mean / rays;
		error[b] = r.mean > 0 ? replicates_error(r, REPLICATES) / rays
		                      : aim->unoccluded / (REPLICATES * rays);
		good &= error[b] <= aim->relative * (h[b] + aim->other[b]);
	}
	return good;
}

/* What the first n emitters bring, or those that the side sees, by their cumulated weights. */
static void sample(struct direct_worker *w, const double x[3], size_t n, uint64_t seed,
                   const struct aim *aim, double *h, double *error)
{
	double part[REPLICATES][BANDS_MAX] = { { 0 } }, u[3];
	uint32_t from = 0, scramble[REPLICATES][3], bits[3];

	for (int p = 0; p < REPLICATES; p++)
		for (int k = 0; k < 3; k++)
			scramble[p][k] = rng_sobol_seed(seed + (uint64_t)p, k);
	for (uint32_t to = RAYS_FIRST; to <= RAYS_MOST; from = to, to *= 2) {
		for (uint32_t i = from; i < to; i++) {
			for (int k = 0; k < 3; k++)
				bits[k] = rng_sobol_bits(i, k);
			for (int p = 0; p < REPLICATES; p++) {
				for (int k = 0; k < 3; k++)
					u[k] = rng_scramble(bits[k], scramble[p][k]);
				add_ray(w, x, n, u, part[p]);
			}
		}
		if (settled(part, w->d->m->bands, to, aim, h, error))
			return;
	}
}

/* ---- punctual lights ---- */

static void add_lights(struct direct_worker *w, const double world[3], double *h)
{
	const struct model *m = w->d->m;
	double from[3] = { world[0], world[1], world[2] };

	ray_leave(w->d->rays, w->normal, from);
	for (size_t i = 0; i < m->light.n; i++) {
		struct light_sample s;
		model_light_see(&m->light, i, world, ray_offset(w->d->rays), &s);
		double scale = v3_dot(w->normal, s.toward) * s.across * s.falloff;
		if (!(scale > 0))
			continue;
		if (ray_blocked(w->d->rays, from, s.to))
			continue;
		for (int b = 0; b < m->bands; b++)
			h[b] += scale * m->light.intensity[i * (size_t)m->bands + (size_t)b];
	}
}

int occ_direct_at(struct direct_worker *w, const double world[3], uint64_t seed, double relative,
                  const double *other, double *h, double *error, struct err *e)
{
	const struct direct *d = w->d;
	size_t n = d->exact ? w->visible_emitters : d->emitters.n;
	double x[3], sum = 0;

	v3_sub(world, d->centre, x);
	memset(h, 0, (size_t)d->m->bands * sizeof *h);
	memset(error, 0, (size_t)d->m->bands * sizeof *error);
	for (size_t i = 0; i < n; i++) {
		const struct emitter *t =
		    d->exact ? w->visible_emitter[i].emitter : &d->emitters.emitter[i];
		if (!d->exact || w->visible_emitter[i].sampled)
			sum += guess(w, t, x);
		w->weight[i] = sum;
	}
	if (sum > 0)
		sample(w, x, n, seed, &(struct aim){ relative, other, sum }, h, error);
	for (size_t i = 0; i < n && d->exact; i++) {
		if (w->visible_emitter[i].sampled)
			continue;
		double f = exact(w, &w->visible_emitter[i], x, e);
		if (isnan(f))
			return -1;
		for (int b = 0; b < d->m->bands; b++)
			h[b] += f * w->visible_emitter[i].emitter->radiance[b];
	}
	add_lights(w, world, h);
	return 0;
}
