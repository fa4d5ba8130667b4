#include "lib/ray/light_visibility.h"

#include <string.h>

#include "lib/base/vec.h"
#include "lib/data/model.h"
#include "lib/data/punctual.h"
#include "lib/ray/ray.h"
#include "lib/scatter/bsdf.h"

/* A fraction of a light: images that carry no more in any band are left out. A guess, far
 * below the error of any picture. */
static const double faint = 1e-6;

/* Counts, all guesses that bound the time of a point: more than rooms with a few mirrors and
 * panes need. Nobody measured what the images beyond would bring. */
enum {
	ORDERS_MOST = 64,  /* mirrors that turn the light of an image, one after the other */
	IMAGES_MOST = 64,  /* images, of all lights together, besides the lights */
	PANES_MOST = 4096  /* panes in a way; ends a walk that rounding would keep going */
};

int ray_light_visibility_new(const struct model *m, const struct ray_scene *rays,
                             struct light_visibility *w, struct err *e)
{
	w->m = m;
	w->rays = rays;
	w->panes = bsdf_any_pane(&m->material);
	return ray_light_images_new(m, ray_offset(rays), ORDERS_MOST, IMAGES_MOST, faint, &w->images, e);
}

void ray_light_visibility_free(struct light_visibility *w)
{
	ray_light_images_free(&w->images);
}

/* ---- the walk ---- */

struct walk {
	const struct light_visibility *w;
	ray_light_pass_fn *pass;
	void *arg;
	uint64_t *cast;
	double org[3];           /* where it has come to, just off a surface */
};

/* A surface met. */
struct met {
	uint32_t material;
	int side;
	double t;                /* distance */
	double n[3];             /* unit normal of that side */
	double x[3];
};

/* Looks from walk->org along dir. 0 if there is nothing. */
static int look(struct walk *k, const double dir[3], struct met *s)
{
	const struct model *m = k->w->m;
	struct ray_hit hit;

	++*k->cast;
	ray_nearest(k->w->rays, k->org, dir, &hit);
	if (hit.triangle == RAY_MISS)
		return 0;
	const uint32_t *c = &m->triangle.corner[3 * (size_t)hit.triangle];
	v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
	        &m->vertex[3 * (size_t)c[2]], s->n);
	v3_normalise(s->n);
	for (int i = 0; i < 3 && hit.side == BACK; i++)
		s->n[i] = -s->n[i];
	ray_point(k->w->rays, m, hit.triangle, hit.w, s->x);
	s->material = m->surface.material[m->triangle.surface[hit.triangle]];
	s->side = hit.side;
	s->t = hit.t;
	return 1;
}

/* On beyond a surface. 0 if it is no clear pane for light that comes against the walk. */
static int through(struct walk *k, const struct met *s)
{
	double beyond[3] = { -s->n[0], -s->n[1], -s->n[2] };

	if (!bsdf_has_ideal(&k->w->m->material, s->material, !s->side, 1) ||
	    !k->pass(k->arg, s->material, !s->side, 1))
		return 0;
	memcpy(k->org, s->x, sizeof k->org);
	ray_leave(k->w->rays, beyond, k->org);
	return 1;
}

static int walk_straight(struct walk *k, const double to[3])
{
	struct met s;
	double dir[3];

	++*k->cast;
	if (!ray_blocked(k->w->rays, k->org, to))
		return 1;
	while (k->w->panes) {
		v3_sub(to, k->org, dir);
		double left = v3_normalise(dir);
		if (!look(k, dir, &s) || s.t >= left)
			return 1;
		if (!through(k, &s))
			return 0;
	}
	return 0;
}

/* From walk->org towards an image to its mirror; walk->org is then just before that. */
static int walk_to_mirror(struct walk *k, const struct mirror_plane *plane, const double dir[3])
{
	struct met s;

	while (look(k, dir, &s)) {
		if (ray_mirror_has(&k->w->images.mirrors, plane, s.material, s.side, s.n, s.x)) {
			memcpy(k->org, s.x, sizeof k->org);
			ray_leave(k->w->rays, plane->n, k->org);
			return k->pass(k->arg, plane->material, plane->side, 0);
		}
		if (!through(k, &s))
			return 0;
	}
	return 0;
}

int ray_light_walk(const struct light_visibility *w, size_t image, const double from[3],
                   const struct light_sample *s, ray_light_pass_fn *pass, void *arg,
                   uint64_t *cast)
{
	const struct light_images *g = &w->images;
	struct walk k = { w, pass, arg, cast, { from[0], from[1], from[2] } };
	struct light_sample at = *s;

	for (; g->plane[image] >= 0; image = g->parent[image]) {
		if (!walk_to_mirror(&k, &g->mirrors.plane[g->plane[image]], at.toward))
			return 0;
		model_light_see(&g->l, g->parent[image], k.org, ray_offset(w->rays), &at);
	}
	return walk_straight(&k, at.to);
}

/* ---- what of the light comes through panes ---- */

struct tint {
	const struct materials *mt;
	double *value;           /* [bands] */
	int panes;               /* passed */
};

static int dim(void *arg, uint32_t material, int arrival, int transmitted)
{
	struct tint *t = arg;
	size_t at = model_material_at(t->mt, material, arrival);

	for (int b = 0; transmitted && b < t->mt->bands; b++)
		t->value[b] *= t->mt->tau_s[at + (size_t)b];
	return !transmitted || ++t->panes < PANES_MOST;
}

int ray_light_transmittance(const struct light_visibility *w, const double from[3],
                            const double to[3], double *value, uint64_t *cast)
{
	struct tint t = { &w->m->material, value, 0 };
	struct walk k = { w, dim, &t, cast, { from[0], from[1], from[2] } };

	return walk_straight(&k, to);
}

int ray_light_visibility(const struct light_visibility *w, size_t image, const double from[3],
                         const struct light_sample *s, double *value, uint64_t *cast)
{
	struct tint t = { &w->m->material, value, 0 };

	return ray_light_walk(w, image, from, s, dim, &t, cast);
}
