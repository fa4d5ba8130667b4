#include "lib/ray/mirror.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/scatter/bsdf.h"

/* A count of planes, sides apart, up to which images are made. Pairs of planes make images of
 * images, so that more would cost more than rays: a guess. A room of mirrors has 6, curved ones
 * have hundreds. */
enum { PLANES_MOST = 16 };

/* 1 - cosine of normals, and heights over the size of the scene, by which triangles of one plane
 * differ: a guess, some roundings of float32 (1.2e-7), which corners' coordinates have. */
static const double same_plane = 1e-6;

int ray_mirror_has(const struct mirrors *k, const struct mirror_plane *plane, uint32_t material,
                   int side, const double n[3], const double x[3])
{
	return material == plane->material && side == plane->side &&
	       v3_dot(n, plane->n) > 1 - same_plane &&
	       fabs(v3_dot(x, plane->n) - plane->offset) <= k->same;
}

static void extend(struct mirror_plane *plane, const double x[3])
{
	for (int c = 0; c < 3; c++) {
		plane->box[0][c] = fmin(plane->box[0][c], x[c]);
		plane->box[1][c] = fmax(plane->box[1][c], x[c]);
	}
}

static int add_plane(const struct model *m, struct mirrors *k, struct array *list,
                     size_t triangle, int side, struct err *e)
{
	const uint32_t *c = &m->triangle.corner[3 * triangle];
	const double *x[3];
	uint32_t material = m->surface.material[m->triangle.surface[triangle]];
	struct mirror_plane new = { .side = side, .box = { { INFINITY, INFINITY, INFINITY },
	                                                   { -INFINITY, -INFINITY, -INFINITY } },
	                            .material = material };
	struct mirror_plane *have = list->data;
	size_t i = 0;

	for (int d = 0; d < 3; d++)
		x[d] = &m->vertex[3 * (size_t)c[d]];
	v3_area(x[0], x[1], x[2], new.n);
	v3_normalise(new.n);
	for (int d = 0; d < 3 && side == BACK; d++)
		new.n[d] = -new.n[d];
	new.offset = v3_dot(x[0], new.n);
	while (i < list->n && !ray_mirror_has(k, &have[i], new.material, side, new.n, x[0]))
		i++;
	if (i == list->n && mem_append(list, &new, 1, sizeof new, e))
		return -1;
	for (int d = 0; d < 3; d++)
		extend((struct mirror_plane *)list->data + i, x[d]);
	return 0;
}

int ray_mirrors_find(const struct model *m, struct mirrors *k, struct err *e)
{
	struct array list = { 0 };
	double size[3];
	int bad = 0;

	v3_sub(m->light.box[1], m->light.box[0], size);
	*k = (struct mirrors){ .same = same_plane * v3_length(size) };
	for (size_t t = 0; !bad && t < m->triangle.n && list.n <= PLANES_MOST; t++)
		for (int side = FRONT; !bad && side <= BACK; side++)
			if (bsdf_has_ideal(&m->material,
			                   m->surface.material[m->triangle.surface[t]], side, 0))
				bad = add_plane(m, k, &list, t, side, e);
	k->plane = list.data;
	k->complete = list.n <= PLANES_MOST;
	k->n = k->complete ? list.n : 0;
	return bad;
}

void ray_mirrors_free(struct mirrors *k)
{
	free(k->plane);
	*k = (struct mirrors){ 0 };
}

/* ---- images ---- */

/* How far the mirror's points reach over another mirror's plane. */
static double reach(const struct mirror_plane *plane, const struct mirror_plane *over)
{
	double most = -over->offset;

	for (int c = 0; c < 3; c++)
		most += fmax(over->n[c] * plane->box[0][c], over->n[c] * plane->box[1][c]);
	return most;
}

/* A light, or an image while there may be more. */
struct image {
	uint32_t origin, parent;
	int32_t plane;
	double position[3], direction[3];
	double part[BANDS_MAX];  /* of the light */
};

/* 1 if a mirror may turn the rays of an image: in front of it, and not hidden behind the
 * mirror that they come from. */
static int turns(const struct mirrors *k, int directional, const struct image *i, size_t plane,
                 double clear)
{
	const struct mirror_plane *p = &k->plane[plane];

	if (i->plane == (int32_t)plane ||
	    (i->plane >= 0 && reach(p, &k->plane[i->plane]) <= k->same))
		return 0;
	return directional ? v3_dot(i->direction, p->n) < 0
	                   : v3_dot(i->position, p->n) - p->offset > clear;
}

/* Image number `from` in a mirror. Returns the largest part that is left. */
static double turn(const struct model *m, const struct mirrors *k, const struct image *all,
                   uint32_t from, size_t plane, struct image *new)
{
	const struct mirror_plane *p = &k->plane[plane];
	size_t at = model_material_at(&m->material, p->material, p->side);
	const double *rho = &m->material.rho_s[at];
	double most = 0;

	*new = all[from];
	new->parent = from;
	new->plane = (int32_t)plane;
	if (m->light.kind[new->origin] != LIGHT_DIRECTIONAL)
		v3_mad(new->position, -2 * (v3_dot(new->position, p->n) - p->offset), p->n,
		       new->position);
	v3_mad(new->direction, -2 * v3_dot(new->direction, p->n), p->n, new->direction);
	for (int b = 0; b < m->bands; b++)
		most = fmax(most, new->part[b] *= rho[b]);
	return most;
}

static int list_lights(const struct model *m, struct array *list, struct err *e)
{
	for (uint32_t i = 0; i < m->light.n; i++) {
		struct image new = { .origin = i, .parent = i, .plane = -1 };
		memcpy(new.position, &m->light.position[3 * (size_t)i], sizeof new.position);
		memcpy(new.direction, &m->light.direction[3 * (size_t)i], sizeof new.direction);
		for (int b = 0; b < m->bands; b++)
			new.part[b] = 1;
		if (mem_append(list, &new, 1, sizeof new, e))
			return -1;
	}
	return 0;
}

/* Images of images until none carries anything, or there are enough. */
static int list_images(const struct model *m, double clear, int orders, size_t most,
                       double least, struct light_images *g, struct array *list, struct err *e)
{
	size_t begin = 0, end = list->n;
	struct image new;

	g->complete = g->mirrors.complete;
	for (int order = 0; begin < end; order++, begin = end, end = list->n)
		for (size_t i = begin; i < end; i++)
			for (size_t p = 0; p < g->mirrors.n; p++) {
				const struct image *all = list->data;
				int directional = m->light.kind[all[i].origin] == LIGHT_DIRECTIONAL;
				if (!turns(&g->mirrors, directional, &all[i], p, clear) ||
				    turn(m, &g->mirrors, all, (uint32_t)i, p, &new) <= least)
					continue;
				if (order >= orders || list->n - m->light.n >= most)
					g->complete = 0;
				else if (mem_append(list, &new, 1, sizeof new, e))
					return -1;
			}
	return 0;
}

static int new_arrays(const struct model *m, struct light_images *g, size_t n, struct err *e)
{
	if (model_lights_new(&g->l, n, m->bands, e))
		return -1;
	g->l.unit_flux = mem_new(n, sizeof *g->l.unit_flux, "images of lights", e);
	g->l.cosine = mem_new(n, 2 * sizeof *g->l.cosine, "images of lights", e);
	g->origin = mem_new(n, sizeof *g->origin, "images of lights", e);
	g->parent = mem_new(n, sizeof *g->parent, "images of lights", e);
	g->plane = mem_new(n, sizeof *g->plane, "images of lights", e);
	return g->l.unit_flux && g->l.cosine && g->origin && g->parent && g->plane ? 0 : -1;
}

static void fill(const struct model *m, const struct image *list, struct light_images *g)
{
	const struct lights *from = &m->light;
	struct lights *l = &g->l;
	size_t bands = (size_t)m->bands;

	memcpy(l->box, from->box, sizeof l->box);
	for (size_t i = 0; i < l->n; i++) {
		size_t o = list[i].origin;
		g->origin[i] = list[i].origin;
		g->parent[i] = list[i].parent;
		g->plane[i] = list[i].plane;
		l->kind[i] = from->kind[o];
		l->unit_flux[i] = from->unit_flux[o];
		memcpy(&l->position[3 * i], list[i].position, sizeof list[i].position);
		memcpy(&l->direction[3 * i], list[i].direction, sizeof list[i].direction);
		memcpy(&l->cone[2 * i], &from->cone[2 * o], 2 * sizeof *l->cone);
		memcpy(&l->cosine[2 * i], &from->cosine[2 * o], 2 * sizeof *l->cosine);
		for (size_t b = 0; b < bands; b++)
			l->intensity[i * bands + b] = from->intensity[o * bands + b] *
			                              list[i].part[b];
	}
}

int ray_light_images_new(const struct model *m, double clear, int orders, size_t most,
                         double least, struct light_images *g, struct err *e)
{
	struct array list = { 0 };

	*g = (struct light_images){ 0 };
	int bad = (m->light.n && ray_mirrors_find(m, &g->mirrors, e)) || list_lights(m, &list, e) ||
	          list_images(m, clear, orders, most, least, g, &list, e) ||
	          new_arrays(m, g, list.n, e);
	if (!bad)
		fill(m, list.data, g);
	free(list.data);
	return bad ? -1 : 0;
}

void ray_light_images_free(struct light_images *g)
{
	ray_mirrors_free(&g->mirrors);
	model_lights_free(&g->l);
	free(g->origin);
	free(g->parent);
	free(g->plane);
	*g = (struct light_images){ 0 };
}
