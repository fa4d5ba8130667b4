#include "lib/view/surface_point.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"

/* Backs of one-sided materials in a row that a ray may pass, a count: more than any scene has, so
 * that rounding between coincident faces cannot hold a ray for ever. */
enum { PASSES_MAX = 4096 };

const struct view_side *view_side_at(const struct view_scene *v, const struct view_point *p)
{
	return &v->side[2 * p->material + (uint32_t)p->side];
}

/* 1 if the ray meets a surface. */
static int meet(const struct view_scene *v, const double org[3], const double dir[3],
                struct view_point *p)
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

void view_locate(const struct view_scene *v, struct view_point *p)
{
	const uint32_t *c = &v->m->element.corner[3 * (size_t)p->element];

	for (size_t k = 0; k < 3; k++)
		p->x[k] = p->w[0] * v->m->vertex[3 * (size_t)c[0] + k] +
		          p->w[1] * v->m->vertex[3 * (size_t)c[1] + k] +
		          p->w[2] * v->m->vertex[3 * (size_t)c[2] + k];
}

void view_leave(const struct view_scene *v, const struct view_point *p, int side, double x[3])
{
	double n[3];

	for (int k = 0; k < 3; k++)
		n[k] = side == FRONT ? p->n[k] : -p->n[k];
	memcpy(x, p->x, sizeof p->x);
	ray_leave(v->rays, n, x);
}

int view_see(const struct view_scene *v, const double org[3], const double dir[3], int passes,
             struct view_point *p, uint64_t *rays)
{
	double from[3];

	++*rays;
	if (!meet(v, org, dir, p))
		return 0;
	for (int i = 0; view_side_at(v, p)->black; i++) {
		if (!passes || i == PASSES_MAX)
			return 0;
		view_locate(v, p);
		view_leave(v, p, FRONT, from);
		++*rays;
		if (!meet(v, from, dir, p))
			return 0;
	}
	return 1;
}
