#include "lib/view/specular_path.h"

#include <math.h>
#include <string.h>

#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/scatter/bsdf.h"
#include "lib/scatter/lobe.h"
#include "lib/view/glossy.h"
#include "lib/view/highlights.h"
#include "lib/view/shade_tile.h"

/* Up to how many directional events from the eye light is computed rather than interpolated, a
 * count: beyond, little of it reaches the pixel; a guess that trace(1) names. Behind a lobe
 * that is sampled it is always interpolated. */
enum { COMPUTED_DEPTH = 4 };

/* Backs of one-sided materials in a row that a ray may pass, a count: more than any scene has, so
 * that rounding between coincident faces cannot hold a ray for ever. */
enum { PASSES_MAX = 4096 };

/* Cosines are no less: at grazing angles the weight of a lobe is large but finite. */
static const double cosine_least = 1e-14;

/* A surface point as a ray meets it. */
struct point {
	uint32_t element, material;
	int side;
	double x[3], n[3];  /* n: front normal */
	double w[3];        /* weights of the element's corners */
	double cosine;      /* |n.dir| */
	double way;         /* to it */
};

/* 1 if the ray meets a surface. */
static int meet(const struct view_scene *v, const double org[3], const double dir[3],
                struct point *p)
{
	const struct model *m = v->m;
	struct ray_hit hit;

	ray_nearest(v->rays, org, dir, &hit);
	if (hit.triangle == RAY_MISS)
		return 0;
	p->element = model_locate(m, hit.triangle, hit.w);
	p->material = m->surface.material[m->triangle.surface[hit.triangle]];
	p->side = hit.side;
	memcpy(p->n, &m->element.normal[3 * (size_t)p->element], sizeof p->n);
	memcpy(p->w, hit.w, sizeof p->w);
	p->cosine = fabs(v3_dot(p->n, dir));
	p->way = hit.t;
	return 1;
}

/* The point itself, from the corners: closer to the plane than along the ray. */
static void ray_locate(const struct view_scene *v, struct point *p)
{
	const uint32_t *c = &v->m->element.corner[3 * (size_t)p->element];

	for (size_t k = 0; k < 3; k++)
		p->x[k] = p->w[0] * v->m->vertex[3 * (size_t)c[0] + k] +
		          p->w[1] * v->m->vertex[3 * (size_t)c[1] + k] +
		          p->w[2] * v->m->vertex[3 * (size_t)c[2] + k];
}

static void leave(const struct view_scene *v, const struct point *p, int side,
                  double x[3])
{
	double n[3];

	for (int k = 0; k < 3; k++)
		n[k] = side == FRONT ? p->n[k] : -p->n[k];
	memcpy(x, p->x, sizeof p->x);
	ray_leave(v->rays, n, x);
}

/* As meet, going through the backs of one-sided materials if `passes`. Returns 0
 * where nothing, or only a black back, is met. */
static int see(const struct view_scene *v, const double org[3], const double dir[3],
               int passes, struct point *p, uint64_t *rays)
{
	double from[3];

	++*rays;
	if (!meet(v, org, dir, p))
		return 0;
	for (int i = 0; v->side[2 * p->material + (uint32_t)p->side].black; i++) {
		if (!passes || i == PASSES_MAX)
			return 0;
		ray_locate(v, p);
		leave(v, p, FRONT, from);
		++*rays;
		if (!meet(v, from, dir, p))
			return 0;
	}
	return 1;
}

/* Has the rest of the light at a point computed and added later. */
static void put_request(struct view_walker *w, const struct view_branch *b, struct point *p)
{
	struct view_request q = { .element = p->element, .side = p->side, .slot = w->slot,
	                          .material = p->material, .directional = b->depth > 0,
	                          .seed = b->seed + b->index };

	ray_locate(w->v, p);
	memcpy(q.x, p->x, sizeof q.x);
	memcpy(q.w, p->w, sizeof q.w);
	view_shade_tile_put(w->shader, &q, b->weight);
}

/* Adds the error of the interpolated light that a side shows. */
static void add_error(struct view_walker *w, const struct view_branch *b, const struct point *p)
{
	const struct view_side *s = &w->v->side[2 * p->material + (uint32_t)p->side];
	size_t bands = (size_t)w->v->m->bands;
	size_t at = (2 * (size_t)p->element + (size_t)p->side) * bands;
	size_t far = (2 * (size_t)p->element + (size_t)!p->side) * bands;

	if (!b->lobes) {
		for (size_t i = 0; i < bands; i++)
			w->error[i] += b->weight[i] * (s->here[i] * (double)w->v->miss[at + i] +
			                               s->across[i] * (double)w->v->miss[far + i]);
		return;
	}
	/* The part of the lobe that the element fills. */
	double way = b->reach + p->way;
	double part = b->density * w->v->m->element.area[p->element] * p->cosine / (way * way);
	for (size_t i = 0; i < bands; i++)
		w->blurred[i] +=
		    b->weight[i] * b->weight[i] *
		    (s->here[i] * s->here[i] * view_blurred(w->v, at + i, part, 0) +
		     s->across[i] * s->across[i] * view_blurred(w->v, far + i, part, 0));
}

/* What counts of an emitter that a sample of a lobe has met: it may be found by aiming, too. */
static double aimed_share(const struct view_walker *w, const struct view_branch *b,
                          const struct point *p)
{
	const struct emitter_images *s = &w->v->images;

	if (!b->lobes || b->straight || b->turns < 0 || !(w->aim.sum > 0))
		return 1;
	uint32_t emitter = s->of[2 * p->element + (uint32_t)p->side];
	if (emitter == UINT32_MAX)
		return 1;
	size_t image = (size_t)b->turns * s->emitters.n + emitter;
	double other = view_emitter_images_density(s, &w->aim, image, b->reach + p->way, p->cosine);
	return b->density / (b->density + other);
}

/* Adds what the point itself sends: emission and M / pi. */
static void add_radiance(struct view_walker *w, const struct view_branch *b, struct point *p)
{
	const struct view_side *s = &w->v->side[2 * p->material + (uint32_t)p->side];
	size_t bands = (size_t)w->v->m->bands;
	double h[BANDS_MAX];
	double *diffuse = b->depth ? w->directional : w->diffuse;
	double *emission = b->straight ? w->lit : b->depth ? w->directional : w->emission;
	int computed = w->shader && w->v->method != VIEW_MESH && !b->lobes &&
	               b->depth <= COMPUTED_DEPTH;
	const struct reconstruction *r = computed ? &w->v->part : &w->v->all;

	if (computed && (s->diffuse || s->translucent))
		put_request(w, b, p);
	interp_reconstruction_at(r, p->element, p->side, p->w, h);
	for (size_t i = 0; i < bands; i++)
		diffuse[i] += b->weight[i] * s->here[i] * h[i];
	if (s->translucent) {
		interp_reconstruction_at(r, p->element, !p->side, p->w, h);
		for (size_t i = 0; i < bands; i++)
			diffuse[i] += b->weight[i] * s->across[i] * h[i];
	}
	if (s->diffuse || s->translucent)
		add_error(w, b, p);
	if (!s->emits)
		return;
	double out[3] = { -b->dir[0], -b->dir[1], -b->dir[2] };
	bsdf_emission(w->v->m, p->material, p->n, out, h);
	double share = aimed_share(w, b, p);
	for (size_t i = 0; i < bands; i++)
		emission[i] += b->weight[i] * share * h[i];
}

/* Adds the highlights of punctual lights, which no ray of a lobe can meet. */
static void add_highlights(struct view_walker *w, const struct view_branch *b,
                           const struct point *p)
{
	double out[3] = { -b->dir[0], -b->dir[1], -b->dir[2] }, l[BANDS_MAX];

	view_highlights(w->v, p->material, p->x, p->n, out, l, &w->rays);
	for (int i = 0; i < w->v->m->bands; i++)
		w->directional[i] += b->weight[i] * l[i];
}

/* Follows a finite lobe, by samples or by one ray about its axis. */
static void branch_into(struct view_walker *w, const struct view_branch *b, const struct point *p,
                        const struct view_lobe *lobe, int side, struct view_branch *next)
{
	const struct view_side *s = &w->v->side[2 * p->material + (uint32_t)p->side];
	struct view_lobe_seen l = { .k = lobe->k, .cosine = fmax(p->cosine, cosine_least),
	                            .element = p->element, .side = side, .table = &lobe->table };
	double scale = w->v->m->lobe == LOBE_RECIPROCAL ? bsdf_lobe_albedo(lobe->k, p->cosine) : 1;

	memcpy(l.axis, next->dir, sizeof l.axis);
	memcpy(l.x, p->x, sizeof l.x);
	for (int k = 0; k < 3; k++)
		l.normal[k] = side == FRONT ? p->n[k] : -p->n[k];
	if (w->o->lobe_samples || b->lobes) {
		interp_reconstruction_at(&w->v->all, p->element, p->side, p->w, l.other);
		for (int i = 0; i < w->v->m->bands; i++)
			l.other[i] = b->weight[i] * s->here[i] * l.other[i] + w->directional[i];
		view_lobe_follow(w, b, &l, lobe->coefficient, next);
		return;
	}
	for (int i = 0; i < w->v->m->bands; i++)
		w->axial[i] +=
		    b->weight[i] * b->weight[i] * lobe->coefficient[i] * lobe->coefficient[i];
	if (w->probing)
		view_lobe_probe(w, b, &l, lobe->coefficient, scale, next);
	view_push(w, b, next, lobe->coefficient, scale);
}

/* How a mirror has turned what met none before: branches' `turns`. */
static int turned(const struct view_scene *v, const struct point *p)
{
	int plane = view_emitter_images_plane(&v->images, p->material, p->side, p->n, p->x);

	return plane < 0 ? -1 : 1 + plane;
}

/* Follows one directional part of a point: `through` 0 for reflection into the side
 * seen, 1 for light that comes from the other side. */
static void branch_off(struct view_walker *w, const struct view_branch *b,
                       const struct point *p, const struct view_lobe *lobe, int through)
{
	struct view_branch next = { .lobes = b->lobes, .density = b->density, .share = b->share,
	                            .index = b->index, .reach = b->lobes ? b->reach + p->way : 0,
	                            .turns = b->turns, .aimed = b->aimed };
	int side = through ? !p->side : p->side, ideal = isinf(lobe->k);

	if (through)
		memcpy(next.dir, b->dir, sizeof next.dir);
	else
		v3_mad(b->dir, -2 * v3_dot(b->dir, p->n), p->n, next.dir);
	leave(w->v, p, side, next.org);
	next.passes = through && ideal && b->passes;
	next.seed = rng_mix(b->seed + 1 + (uint64_t)through);
	if (b->lobes && (!ideal || !through))
		next.turns = ideal && b->turns == 0 ? turned(w->v, p) : -1;
	if (ideal)
		view_push(w, b, &next, lobe->coefficient, 1);
	else if (!w->asking || !w->o->lobe_samples)
		branch_into(w, b, p, lobe, side, &next);
}

/* Goes on along the one way that leads to an image; adds its emitter at the end. */
static void follow_aimed(struct view_walker *w, const struct view_branch *b, struct point *p)
{
	const struct emitter_images *s = &w->v->images;
	const struct view_side *seen = &w->v->side[2 * p->material + (uint32_t)p->side];
	size_t image = b->aimed - 1;
	int plane = (int)(image / s->emitters.n) - 1;
	double out[3] = { -b->dir[0], -b->dir[1], -b->dir[2] }, l[BANDS_MAX];

	ray_locate(w->v, p);
	if (b->turns == 0 && plane >= 0 &&
	    view_emitter_images_plane(s, p->material, p->side, p->n, p->x) == plane) {
		branch_off(w, b, p, &seen->reflected, 0);
	} else if (s->of[2 * p->element + (uint32_t)p->side] == image % s->emitters.n) {
		if (b->straight || b->turns != plane + 1)
			return;
		bsdf_emission(w->v->m, p->material, p->n, out, l);
		for (int i = 0; i < w->v->m->bands; i++)
			w->directional[i] += b->weight[i] * l[i];
	} else if (seen->transmitted.coefficient && isinf(seen->transmitted.k)) {
		branch_off(w, b, p, &seen->transmitted, 1);
	}
}

static void follow_branch(struct view_walker *w, const struct view_branch *b)
{
	const struct view_scene *v = w->v;
	struct point p;

	if (!see(v, b->org, b->dir, b->passes, &p, &w->rays))
		return;
	if (b->aimed) {
		follow_aimed(w, b, &p);
		return;
	}
	add_radiance(w, b, &p);
	const struct view_side *s = &v->side[2 * p.material + (uint32_t)p.side];
	if (!s->reflected.coefficient && !s->transmitted.coefficient)
		return;
	ray_locate(v, &p);
	if (v->highlights)
		add_highlights(w, b, &p);
	if (s->reflected.coefficient)
		branch_off(w, b, &p, &s->reflected, 0);
	if (s->transmitted.coefficient)
		branch_off(w, b, &p, &s->transmitted, 1);
}

void view_follow(struct view_walker *w, struct view_branch *b)
{
	for (int i = 0; i < w->v->m->bands; i++)
		b->weight[i] = 1;
	b->depth = b->lobes = b->straight = 0;
	b->passes = 1;
	b->share = 1;
	w->step = follow_branch;
	follow_branch(w, b);
	view_run(w, 0);
}

void view_first_seen(const struct view_scene *v, const double org[3], const double dir[3],
                     struct view_first *first)
{
	struct point p;
	uint64_t rays = 0;

	first->element = RAY_MISS;
	if (!see(v, org, dir, 1, &p, &rays))
		return;
	ray_locate(v, &p);
	first->element = p.element;
	memcpy(first->point, p.x, sizeof p.x);
	for (int k = 0; k < 3; k++)
		first->normal[k] = p.side == FRONT ? p.n[k] : -p.n[k];
}
