/* Images of punctual lights in plane mirrors, and the ways that their rays take. */
#include <math.h>
#include <string.h>

#include "bsdf.h"
#include "ff_job.h"
#include "light.h"
#include "vec3.h"

/* Planes of mirrors beyond which images cost more than rays. */
enum { MIRRORS_MOST = 16 };

/* Corners have float32 coordinates: normals and, over the size of the scene, heights of
 * one plane differ by this. */
static const double same_plane = 1e-6;

static double scene_size(const struct model *m)
{
	double size[3];

	v3_sub(m->light.box[1], m->light.box[0], size);
	return v3_length(size);
}

/* 1 if a point of a triangle with this normal, of the side that reflects, is the mirror's. */
static int on_mirror(const struct model *m, const struct ff_mirror *k, const double n[3],
                     const double x[3])
{
	return v3_dot(n, k->n) > 1 - same_plane &&
	       fabs(v3_dot(x, k->n) - k->offset) <= same_plane * scene_size(m);
}

static int add_mirror(struct ff_job *j, struct vec *list, size_t triangle, int side,
                      struct err *e)
{
	const struct model *m = j->m;
	const uint32_t *c = &m->triangle[3 * triangle];
	const double *x = &m->vertex[3 * (size_t)c[0]];
	const struct ff_mirror *have = list->data;
	struct ff_mirror new = { .side = side,
	                         .material = m->surface.material[m->triangle_surface[triangle]] };

	v3_area(x, &m->vertex[3 * (size_t)c[1]], &m->vertex[3 * (size_t)c[2]], new.n);
	v3_normalise(new.n);
	for (int k = 0; k < 3 && side == BACK; k++)
		new.n[k] = -new.n[k];
	new.offset = v3_dot(x, new.n);
	for (size_t i = 0; i < list->n; i++)
		if (have[i].material == new.material && have[i].side == side &&
		    on_mirror(m, &have[i], new.n, x))
			return 0;
	return vec_append(list, &new, 1, sizeof new, e);
}

int ff_mirrors(struct ff_job *j, struct err *e)
{
	const struct model *m = j->m;
	struct vec list = { 0 };
	int bad = 0;

	for (size_t t = 0; !bad && t < m->triangles && list.n <= MIRRORS_MOST; t++)
		for (int side = FRONT; !bad && side <= BACK; side++)
			if (bsdf_has_ideal(&m->material, m->surface.material[m->triangle_surface[t]],
			                   side, 0))
				bad = add_mirror(j, &list, t, side, e);
	j->mirror = list.data;
	j->mirrors = list.n <= MIRRORS_MOST ? list.n : 0;
	return bad;
}

int ff_image(const struct ff_job *j, const struct ff_mirror *mirror, size_t light,
             struct ff_image *i)
{
	const struct lights *l = &j->m->light;
	const double *x = &l->position[3 * light], *d = &l->direction[3 * light];
	double towards = v3_dot(d, mirror->n), height = v3_dot(x, mirror->n) - mirror->offset;

	*i = (struct ff_image){ .kind = l->kind[light], .unit_flux = l->unit_flux[light] };
	if (i->kind == LIGHT_DIRECTIONAL ? !(towards < 0) : !(height > ray_offset(j->rays)))
		return 0;
	v3_mad(x, i->kind == LIGHT_DIRECTIONAL ? 0 : -2 * height, mirror->n, i->position);
	v3_mad(d, -2 * towards, mirror->n, i->direction);
	memcpy(i->cone, &l->cone[2 * light], sizeof i->cone);
	memcpy(i->cosine, &l->cosine[2 * light], sizeof i->cosine);
	i->l = (struct lights){ .n = 1, .kind = &i->kind, .position = i->position,
	                        .direction = i->direction, .cone = i->cone, .cosine = i->cosine,
	                        .unit_flux = &i->unit_flux };
	memcpy(i->l.box, l->box, sizeof l->box);
	return 1;
}

/* A ray's way through clear panes: where it is, and the events passed. */
struct way {
	double org[3];
	uint32_t chain, passed;
};

/* Through the surface of a hit, if it is a clear pane for light that comes against the
 * ray. 0 if not. */
static int pass(struct ff_thread *t, const struct ray_hit *hit, struct way *w)
{
	const struct ff_job *j = t->job;
	struct chains *chains = &t->tally.chains;
	uint32_t material = j->m->surface.material[j->m->triangle_surface[hit->triangle]];
	uint32_t arrival = (uint32_t)!hit->side;
	double n[3];

	if (!bsdf_has_ideal(&j->m->material, material, (int)arrival, 1) || w->passed++ >= j->o.depth)
		return 0;
	w->chain = chains_child(chains, w->chain, chains->slot[4 * material + 2 * arrival + 1],
	                        &t->tally.err);
	ff_normal(j, locate(&j->locator, hit->triangle, (float)hit->w[1], (float)hit->w[2]),
	          (int)arrival, n);
	ff_hit_point(j, hit, w->org);
	ray_leave(j->rays, n, w->org);
	return w->chain != CHAIN_NONE;
}

/* On from w->org to a point: the chain, or CHAIN_NONE. */
static uint32_t way_to(struct ff_thread *t, const double to[3], struct way *w)
{
	const struct ff_job *j = t->job;
	struct ray_hit hit;
	double dir[3];

	t->rays++;
	if (!ray_blocked(j->rays, w->org, to))
		return w->chain;
	while (j->has_panes) {
		v3_sub(to, w->org, dir);
		double left = v3_normalise(dir);
		ray_nearest(j->rays, w->org, dir, &hit);
		t->rays++;
		if (hit.triangle == RAY_MISS || hit.t >= left)
			return w->chain;
		if (!pass(t, &hit, w))
			return CHAIN_NONE;
	}
	return CHAIN_NONE;
}

uint32_t ff_clear_way(struct ff_thread *t, const double from[3], const double to[3])
{
	struct way w = { { from[0], from[1], from[2] }, 0, 0 };

	return way_to(t, to, &w);
}

uint32_t ff_mirror_way(struct ff_thread *t, const struct ff_mirror *mirror, size_t light,
                       const double from[3], const double toward[3])
{
	const struct ff_job *j = t->job;
	struct chains *chains = &t->tally.chains;
	struct way w = { { from[0], from[1], from[2] }, 0, 0 };
	struct light_sight s;
	struct ray_hit hit;
	double n[3], x[3];

	for (;;) {
		ray_nearest(j->rays, w.org, toward, &hit);
		t->rays++;
		if (hit.triangle == RAY_MISS)
			return CHAIN_NONE;
		uint32_t surface = j->m->triangle_surface[hit.triangle];
		ff_normal(j, locate(&j->locator, hit.triangle, (float)hit.w[1], (float)hit.w[2]),
		          hit.side, n);
		ff_hit_point(j, &hit, x);
		if (j->m->surface.material[surface] == mirror->material && hit.side == mirror->side &&
		    on_mirror(j->m, mirror, n, x))
			break;
		if (!pass(t, &hit, &w))
			return CHAIN_NONE;
	}
	if (w.passed++ >= j->o.depth)
		return CHAIN_NONE;
	w.chain = chains_child(chains, w.chain,
	                       chains->slot[4 * mirror->material + 2 * (uint32_t)mirror->side],
	                       &t->tally.err);
	if (w.chain == CHAIN_NONE)
		return CHAIN_NONE;
	light_see(&j->m->light, light, x, ray_offset(j->rays), &s);
	memcpy(w.org, x, sizeof x);
	ray_leave(j->rays, mirror->n, w.org);
	return way_to(t, s.to, &w);
}
