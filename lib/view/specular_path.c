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
#include "lib/view/surface_point.h"

/* Up to how many directional events from the eye light is computed rather than interpolated, a
 * count: beyond, little of it reaches the pixel; a guess that trace(1) names. Behind a lobe
 * that is sampled it is always interpolated. */
enum { COMPUTED_DEPTH = 4 };

/* Cosines are no less: at grazing angles the weight of a lobe is large but finite. */
static const double cosine_least = 1e-14;

/* Has the rest of the light at a point computed and added later. */
static void put_request(struct view_walker *w, const struct view_branch *b, struct view_point *p)
{
	struct view_request q = { .element = p->element, .side = p->side, .slot = w->slot,
	                          .material = p->material, .directional = b->depth > 0,
	                          .seed = b->seed + b->index };

	view_locate(w->v, p);
	memcpy(q.x, p->x, sizeof q.x);
	memcpy(q.w, p->w, sizeof q.w);
	view_shade_tile_put(w->shader, &q, b->weight);
}

/* Adds the error of the interpolated light that a side shows. */
static void add_error(struct view_walker *w, const struct view_branch *b,
                      const struct view_point *p)
{
	const struct view_side *s = view_side_at(w->v, p);
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
                          const struct view_point *p)
{
	const struct emitter_images *s = &w->v->images;

	if (!b->lobes || !b->aim.tree || b->chain < 0)
		return 1;
	uint32_t emitter = s->of[2 * p->element + (uint32_t)p->side];
	if (emitter == UINT32_MAX)
		return 1;
	size_t image = (size_t)b->chain * s->emitters.n + emitter;
	double other = aim_images_density(s, &b->aim, image, b->way + p->way, p->cosine);
	return b->chance / (b->chance + other);
}

/* Adds what the point itself sends: emission and M / pi. */
static void add_radiance(struct view_walker *w, const struct view_branch *b, struct view_point *p)
{
	const struct view_side *s = view_side_at(w->v, p);
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

/* Adds the highlights of punctual lights in a lobe. */
static void add_highlights(struct view_walker *w, const struct view_branch *b,
                           const struct aim_lobe *l, const double *coefficient)
{
	double light[BANDS_MAX];

	view_highlights(w->v, l, light, &w->rays);
	for (int i = 0; i < w->v->m->bands; i++)
		w->directional[i] += b->weight[i] * coefficient[i] * light[i];
}

/* Follows a finite lobe, by samples or by one ray about its axis. */
static void branch_into(struct view_walker *w, const struct view_branch *b,
                        const struct view_point *p, const struct view_lobe *lobe, int side,
                        struct view_branch *next)
{
	const struct view_side *s = view_side_at(w->v, p);
	struct aim_lobe l = { .k = lobe->k, .cosine = fmax(p->cosine, cosine_least),
	                            .element = p->element, .side = side, .table = &lobe->table };
	double scale = w->v->m->lobe == LOBE_RECIPROCAL ? bsdf_lobe_albedo(lobe->k, p->cosine) : 1;

	memcpy(l.axis, next->dir, sizeof l.axis);
	memcpy(l.x, p->x, sizeof l.x);
	for (int k = 0; k < 3; k++)
		l.normal[k] = side == FRONT ? p->n[k] : -p->n[k];
	if (w->v->highlights)
		add_highlights(w, b, &l, lobe->coefficient);
	if (b->lobes) {
		view_lobe_go_on(w, b, &l, lobe->coefficient, next);
		return;
	}
	if (w->o->lobe_samples) {
		interp_reconstruction_at(&w->v->all, p->element, p->side, p->w, l.other);
		for (int i = 0; i < w->v->m->bands; i++)
			l.other[i] = b->weight[i] * s->here[i] * l.other[i] + w->directional[i];
		l.id = 2 * (2 * p->material + (uint32_t)p->side) + (side != p->side);
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

/* The chain of a branch that a mirror turns: branches' `chain`. */
static int32_t turned(const struct view_scene *v, const struct view_branch *b,
                      const struct view_point *p)
{
	const struct emitter_images *s = &v->images;
	int plane = b->chain < 0 || !b->aim.tree
	          ? -1 : aim_images_plane(s, p->material, p->side, p->n, p->x);

	return plane < 0 ? -1 : s->turn[(size_t)b->chain * s->mirrors.n + (size_t)plane];
}

/* Follows one directional part of a point: `through` 0 for reflection into the side
 * seen, 1 for light that comes from the other side. */
static void branch_off(struct view_walker *w, const struct view_branch *b,
                       const struct view_point *p, const struct view_lobe *lobe, int through)
{
	struct view_branch next = { .lobes = b->lobes, .index = b->index,
	                            .seed = rng_mix(b->seed + 1 + (uint64_t)through) };
	int side = through ? !p->side : p->side, ideal = isinf(lobe->k);

	if (through)
		memcpy(next.dir, b->dir, sizeof next.dir);
	else
		v3_mad(b->dir, -2 * v3_dot(b->dir, p->n), p->n, next.dir);
	view_leave(w->v, p, side, next.org);
	next.passes = through && ideal && b->passes;
	if (b->lobes) {
		next.density = b->density;
		next.reach = b->reach + p->way;
		next.worth = b->worth;
		next.shown = b->shown;
	}
	if (!ideal) {
		if (!w->asking || !w->o->lobe_samples)
			branch_into(w, b, p, lobe, side, &next);
		return;
	}
	if (b->lobes) {
		next.aim = b->aim;
		next.chance = b->chance;
		next.way = b->way + p->way;
		next.chain = through ? b->chain : turned(w->v, b, p);
	}
	view_push(w, b, &next, lobe->coefficient, 1);
}

/* The most that a lobe leaves of a branch in any band. */
static double carries(const struct view_branch *b, const struct view_lobe *lobe, int bands)
{
	double most = 0;

	for (int i = 0; i < bands && lobe->coefficient; i++)
		most = fmax(most, b->weight[i] * lobe->coefficient[i]);
	return most;
}

/* Goes on behind a lobe that is sampled, each way by as much less chance as it carries less than
 * is worth it: of a sample's branches about 1 / worth_following are alive at any time. */
static void go_on(struct view_walker *w, const struct view_branch *b, const struct view_point *p,
                  const struct view_side *s)
{
	uint64_t seed = rng_mix(b->seed);
	uint32_t index = rng_shuffle(b->index, seed);

	for (int through = 0; through < 2; through++) {
		const struct view_lobe *lobe = through ? &s->transmitted : &s->reflected;
		double chance = fmin(1, carries(b, lobe, w->v->m->bands) / b->worth);
		struct view_branch one = *b;
		if (!(chance > 0) || (chance < 1 && rng_sobol(index, through, seed) >= chance))
			continue;
		for (int i = 0; i < w->v->m->bands; i++)
			one.weight[i] /= chance;
		branch_off(w, &one, p, lobe, through);
	}
}

static void follow_branch(struct view_walker *w, const struct view_branch *b)
{
	const struct view_scene *v = w->v;
	struct view_point p;

	if (!view_see(v, b->org, b->dir, b->passes, &p, &w->rays))
		return;
	add_radiance(w, b, &p);
	const struct view_side *s = view_side_at(v, &p);
	if (!s->reflected.coefficient && !s->transmitted.coefficient)
		return;
	view_locate(v, &p);
	if (b->lobes) {
		go_on(w, b, &p, s);
		return;
	}
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
	w->step = follow_branch;
	follow_branch(w, b);
	view_run(w, 0);
}

void view_first_seen(const struct view_scene *v, const double org[3], const double dir[3],
                     struct view_first *first)
{
	struct view_point p;
	uint64_t rays = 0;

	first->element = RAY_MISS;
	if (!view_see(v, org, dir, 1, &p, &rays))
		return;
	view_locate(v, &p);
	first->element = p.element;
	memcpy(first->point, p.x, sizeof p.x);
	for (int k = 0; k < 3; k++)
		first->normal[k] = p.side == FRONT ? p.n[k] : -p.n[k];
}
