#include "lib/data/punctual.h"

#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/base/vec.h"

static void find_box(struct model *m)
{
	double *lo = m->light.box[0], *hi = m->light.box[1];

	for (int k = 0; k < 3; k++) {
		lo[k] = m->triangle.n ? (double)INFINITY : 0;
		hi[k] = -lo[k];
	}
	for (size_t i = 0; i < 3 * m->triangle.n; i++)
		for (int k = 0; k < 3; k++) {
			double x = m->vertex[3 * (size_t)m->triangle.corner[i] + (size_t)k];
			lo[k] = fmin(lo[k], x);
			hi[k] = fmax(hi[k], x);
		}
}

/* Areas of the box's three kinds of faces as seen along a direction. */
static void faces(const struct lights *l, const double direction[3], double area[3])
{
	double size[3];

	v3_sub(l->box[1], l->box[0], size);
	for (int k = 0; k < 3; k++)
		area[k] = fabs(direction[k]) * size[(k + 1) % 3] * size[(k + 2) % 3];
}

static double unit_flux(const struct lights *l, size_t light)
{
	double inner = l->cosine[2 * light], outer = l->cosine[2 * light + 1], area[3];

	switch (l->kind[light]) {
	case LIGHT_POINT:
		return 4 * PI;
	case LIGHT_SPOT:
		return 2 * PI * (1 - inner + (inner - outer) / 3);
	default:
		faces(l, &l->direction[3 * light], area);
		return area[0] + area[1] + area[2];
	}
}

int model_lights_derive(struct model *m, struct err *e)
{
	struct lights *l = &m->light;

	find_box(m);
	l->unit_flux = mem_new(l->n, sizeof *l->unit_flux, "lights", e);
	l->cosine = mem_new(l->n, 2 * sizeof *l->cosine, "lights", e);
	if (!l->unit_flux || !l->cosine)
		return -1;
	for (size_t i = 0; i < 2 * l->n; i++)
		l->cosine[i] = cos(l->cone[i]);
	for (size_t i = 0; i < l->n; i++)
		l->unit_flux[i] = unit_flux(l, i);
	return 0;
}

/* The extension's intensity between a spot's cones. */
static double falloff(const struct lights *l, size_t light, double cos_axis)
{
	double inner = l->cosine[2 * light], outer = l->cosine[2 * light + 1];

	if (l->kind[light] != LIGHT_SPOT || cos_axis >= inner)
		return 1;
	if (cos_axis <= outer)
		return 0;
	double x = (cos_axis - outer) / (inner - outer);
	return x * x;
}

static double diagonal(const struct lights *l)
{
	double size[3];

	v3_sub(l->box[1], l->box[0], size);
	return v3_length(size);
}

void model_light_see(const struct lights *l, size_t light, const double x[3], double clear,
                     struct light_sample *s)
{
	const double *direction = &l->direction[3 * light];

	if (l->kind[light] == LIGHT_DIRECTIONAL) {
		for (int k = 0; k < 3; k++)
			s->toward[k] = -direction[k];
		v3_mad(x, diagonal(l) + clear, s->toward, s->to);
		s->across = s->falloff = 1;
		return;
	}
	v3_sub(&l->position[3 * light], x, s->toward);
	double distance = v3_normalise(s->toward);
	v3_mad(&l->position[3 * light], -clear, s->toward, s->to);
	/* Closer than rays can tell, a light is inside the surface. */
	s->across = distance > clear ? 1 / (distance * distance) : 0;
	s->falloff = falloff(l, light, -v3_dot(direction, s->toward));
}

/* Cosine of a spot's ray to its axis: uniform within the inner cone; between the cones the
 * flux grows as the third power. */
static double spot_cosine(const struct lights *l, size_t light, double u)
{
	double inner = l->cosine[2 * light], outer = l->cosine[2 * light + 1];
	double core = 1 - inner, rim = (inner - outer) / 3, at = u * (core + rim);

	if (at < core)
		return 1 - at;
	return outer + (inner - outer) * cbrt(1 - fmin(1, (at - core) / rim));
}

static void sphere_ray(const struct lights *l, size_t light, const double u[3], double dir[3])
{
	const double up[3] = { 0, 0, 1 };
	const double *axis = l->kind[light] == LIGHT_SPOT ? &l->direction[3 * light] : up;
	double c = l->kind[light] == LIGHT_SPOT ? spot_cosine(l, light, u[0]) : 1 - 2 * u[0];
	double s = sqrt(fmax(0, 1 - c * c)), t[3], b[3];

	v3_frame(axis, t, b);
	for (int k = 0; k < 3; k++)
		dir[k] = c * axis[k] + s * (cos(2 * PI * u[1]) * t[k] + sin(2 * PI * u[1]) * b[k]);
}

/* Through a point of the box's faces that the light meets first, each as often as the light
 * sees of it; from so far away that rays do not take a face which they graze for one that
 * they leave. */
static void box_ray(const struct lights *l, size_t light, const double u[3], double clear,
                    double org[3])
{
	const double *direction = &l->direction[3 * light];
	double area[3], at = u[0] * l->unit_flux[light];
	int face = 0;

	faces(l, direction, area);
	for (; face < 2 && at >= area[face]; face++)
		at -= area[face];
	for (int k = 0; k < 3; k++) {
		double x = k == face ? direction[k] < 0 : u[k == (face + 1) % 3 ? 1 : 2];
		org[k] = l->box[0][k] + x * (l->box[1][k] - l->box[0][k]);
	}
	v3_mad(org, -(diagonal(l) + clear), direction, org);
}

void model_light_ray(const struct lights *l, size_t light, const double u[3], double clear,
                     double org[3], double dir[3])
{
	if (l->kind[light] == LIGHT_DIRECTIONAL) {
		memcpy(dir, &l->direction[3 * light], 3 * sizeof *dir);
		box_ray(l, light, u, clear, org);
		return;
	}
	sphere_ray(l, light, u, dir);
	v3_mad(&l->position[3 * light], clear, dir, org);
}
