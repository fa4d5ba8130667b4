#include "view_lights.h"

#include <math.h>
#include <string.h>

#include "bsdf.h"
#include "light.h"
#include "vec3.h"

enum { PANES_MAX = 4096 };

/* Beyond a surface on the way of a ray along dir. */
static void pass(const struct view_scene *v, const struct ray_hit *hit, const double dir[3],
                 double org[3])
{
	const uint32_t *c = &v->m->triangle[3 * (size_t)hit->triangle];
	const double *corner[3];
	double n[3];

	for (int i = 0; i < 3; i++)
		corner[i] = &v->m->vertex[3 * (size_t)c[i]];
	v3_area(corner[0], corner[1], corner[2], n);
	v3_normalise(n);
	double up = v3_dot(n, dir) < 0 ? -1 : 1;
	for (int k = 0; k < 3; k++) {
		n[k] *= up;
		org[k] = hit->w[0] * corner[0][k] + hit->w[1] * corner[1][k] +
		         hit->w[2] * corner[2][k];
	}
	ray_leave(v->rays, n, org);
}

/* Multiplies value[bands] by what clear panes between two points let through of the light
 * from `to` to `from`. 0 if anything else is between. */
static int through(const struct view_scene *v, const double from[3], const double to[3],
                   double *value, uint64_t *rays)
{
	const struct model *m = v->m;
	double org[3] = { from[0], from[1], from[2] }, dir[3];
	struct ray_hit hit;

	++*rays;
	if (!ray_blocked(v->rays, from, to))
		return 1;
	for (int i = 0; i < PANES_MAX; i++) {
		v3_sub(to, org, dir);
		double left = v3_normalise(dir);
		++*rays;
		ray_nearest(v->rays, org, dir, &hit);
		if (hit.triangle == RAY_MISS || hit.t >= left)
			return 1;
		uint32_t material = m->surface.material[m->triangle_surface[hit.triangle]];
		if (!bsdf_has_ideal(&m->material, material, !hit.side, 1))
			return 0;
		for (int b = 0; b < m->bands; b++)
			value[b] *= m->material.tau_s[material_at(&m->material, material, !hit.side) +
			                              (size_t)b];
		pass(v, &hit, dir, org);
	}
	return 0;
}

void view_highlights(const struct view_scene *v, uint32_t material, const double x[3],
                     const double n[3], const double out[3], double *l, uint64_t *rays)
{
	const struct model *m = v->m;
	size_t bands = (size_t)m->bands;
	double f[BANDS_MAX], any, from[3], normal[3];

	memset(l, 0, bands * sizeof *l);
	for (size_t i = 0; i < m->light.n; i++) {
		struct light_sight s;
		light_see(&m->light, i, x, ray_offset(v->rays), &s);
		double cosine = v3_dot(n, s.toward), e = fabs(cosine) * s.across * s.falloff;
		bsdf_eval_lobes(m, material, n, s.toward, out, f);
		any = 0;
		for (size_t b = 0; b < bands; b++) {
			f[b] *= e * m->light.intensity[i * bands + b];
			any = fmax(any, f[b]);
		}
		if (!(any > 0))
			continue;
		for (int k = 0; k < 3; k++) {
			from[k] = x[k];
			normal[k] = cosine < 0 ? -n[k] : n[k];
		}
		ray_leave(v->rays, normal, from);
		if (!through(v, from, s.to, f, rays))
			continue;
		for (size_t b = 0; b < bands; b++)
			l[b] += f[b];
	}
}
