#include "lib/ray/light_visibility.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec3.h"
#include "lib/scatter/bsdf.h"

/* Parts of a light that images may leave out. */
static const double faint = 1e-6;

enum {
	ORDERS_MOST = 64,  /* mirrors in a way */
	IMAGES_MOST = 64,
	PANES_MAX = 4096   /* surfaces in a row that a straight ray may pass */
};

int ray_light_visibility_new(const struct model *m, const struct ray_scene *rays, struct light_visibility *w,
                             struct err *e)
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

/* Where a ray meets a surface: front normal and place. */
static uint32_t place(const struct light_visibility *w, const struct ray_hit *hit, double n[3],
                      double x[3])
{
	const struct model *m = w->m;
	const uint32_t *c = &m->triangle.corner[3 * (size_t)hit->triangle];

	v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
	        &m->vertex[3 * (size_t)c[2]], n);
	v3_normalise(n);
	ray_point(w->rays, m, hit->triangle, hit->w, x);
	return m->surface.material[m->triangle.surface[hit->triangle]];
}

/* Beyond a clear pane at org, met on `side`. 0 if it is none. */
static int pass(const struct light_visibility *w, uint32_t material, int side, const double n[3],
                double org[3], double *value)
{
	const struct materials *mt = &w->m->material;
	double beyond[3];

	if (!bsdf_has_ideal(mt, material, !side, 1))
		return 0;
	for (int b = 0; b < w->m->bands; b++)
		value[b] *= mt->tau_s[model_material_at(mt, material, !side) + (size_t)b];
	for (int k = 0; k < 3; k++)
		beyond[k] = side == FRONT ? -n[k] : n[k];
	ray_leave(w->rays, beyond, org);
	return 1;
}

int ray_light_transmittance(const struct light_visibility *w, const double from[3], const double to[3],
                            double *value, uint64_t *cast)
{
	double org[3] = { from[0], from[1], from[2] }, dir[3], n[3];
	struct ray_hit hit;

	++*cast;
	if (!ray_blocked(w->rays, from, to))
		return 1;
	for (int i = 0; w->panes && i < PANES_MAX; i++) {
		v3_sub(to, org, dir);
		double left = v3_normalise(dir);
		++*cast;
		ray_nearest(w->rays, org, dir, &hit);
		if (hit.triangle == RAY_MISS || hit.t >= left)
			return 1;
		uint32_t material = place(w, &hit, n, org);
		if (!pass(w, material, hit.side, n, org, value))
			return 0;
	}
	return 0;
}

/* On from org towards an image to its mirror, through panes; org is then just before it. */
static int to_mirror(const struct light_visibility *w, const struct mirror_plane *plane,
                     const double dir[3], double org[3], double *value, uint64_t *cast)
{
	double n[3], up[3];
	struct ray_hit hit;

	for (int i = 0; i < PANES_MAX; i++) {
		++*cast;
		ray_nearest(w->rays, org, dir, &hit);
		if (hit.triangle == RAY_MISS)
			return 0;
		uint32_t material = place(w, &hit, n, org);
		for (int k = 0; k < 3; k++)
			up[k] = hit.side == FRONT ? n[k] : -n[k];
		if (ray_mirror_has(&w->images.mirrors, plane, material, hit.side, up, org)) {
			ray_leave(w->rays, plane->n, org);
			return 1;
		}
		if (!pass(w, material, hit.side, n, org, value))
			return 0;
	}
	return 0;
}

int ray_light_visibility(const struct light_visibility *w, size_t image, const double from[3],
                         const struct light_sight *s, double *value, uint64_t *cast)
{
	const struct light_images *g = &w->images;
	double org[3] = { from[0], from[1], from[2] };
	struct light_sight at = *s;

	while (g->plane[image] >= 0) {
		if (!to_mirror(w, &g->mirrors.plane[g->plane[image]], at.toward, org, value, cast))
			return 0;
		image = g->parent[image];
		model_light_see(&g->l, image, org, ray_offset(w->rays), &at);
	}
	return ray_light_transmittance(w, org, at.to, value, cast);
}
