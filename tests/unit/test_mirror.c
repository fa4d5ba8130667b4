/* Images of punctual lights in plane mirrors, against closed forms. */
#include <math.h>

#include "lib/base/vec.h"
#include "lib/data/punctual.h"
#include "lib/ray/light_visibility.h"
#include "lib/ray/ray.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/grid.h"

enum { FLOOR, MIRROR, PANE, MATERIALS };

static const double rho = .8, tau = .5;

struct room {
	struct model m;
	struct ray_scene *rays;
	struct light_visibility ways;
};

/* Black one-sided floors, mirrors and two-sided panes; one light of intensity 1. */
static void room_new(struct room *r, size_t surfaces, enum light_kind kind, const double at[3])
{
	struct err e = { 0 };
	struct model *m = &r->m;

	grid_new(m, surfaces, 2, MATERIALS, 1);
	for (size_t i = 0; i < MATERIALS; i++)
		m->material.one_sided[i] = i != PANE;
	m->material.rho_s[model_material_at(&m->material, MIRROR, FRONT)] = rho;
	for (int side = 0; side < 2; side++)
		m->material.tau_s[model_material_at(&m->material, PANE, side)] = tau;
	assert_int_equal(model_lights_new(&m->light, 1, 1, &e), 0);
	m->light.name[0] = strdup("lamp");
	m->light.kind[0] = (uint8_t)kind;
	memcpy(kind == LIGHT_DIRECTIONAL ? m->light.direction : m->light.position, at,
	       3 * sizeof *at);
	if (kind == LIGHT_DIRECTIONAL)
		v3_normalise(m->light.direction);
	m->light.intensity[0] = 1;
}

static void add(struct room *r, uint32_t material, const double o[3], const double x[3],
                const double y[3])
{
	grid_quad(&r->m, 2, material, o, x, y);
}

static void room_ready(struct room *r)
{
	struct err e = { 0 };

	grid_end(&r->m);
	r->rays = ray_scene_new(&r->m, &e);
	assert_non_null(r->rays);
	assert_int_equal(ray_light_visibility_new(&r->m, r->rays, &r->ways, &e), 0);
}

static void room_free(struct room *r)
{
	ray_light_visibility_free(&r->ways);
	ray_scene_free(r->rays);
	model_free(&r->m);
}

/* Irradiance of a floor's point from the light and all images. */
static double irradiance(const struct room *r, double x, double y)
{
	const struct lights *l = &r->ways.images.l;
	const double at[3] = { x, y, 0 }, normal[3] = { 0, 0, 1 };
	double from[3] = { x, y, 0 }, sum = 0;
	uint64_t rays = 0;

	ray_leave(r->rays, normal, from);
	for (size_t i = 0; i < l->n; i++) {
		struct light_sample s;
		double value = l->intensity[i];
		model_light_see(l, i, at, ray_offset(r->rays), &s);
		if (ray_light_visibility(&r->ways, i, from, &s, &value, &rays))
			sum += value * s.across * s.falloff * fmax(0, s.toward[2]);
	}
	return sum;
}

/* Of a point light at height h over the floor, a distance away. */
static double from_point(double dx, double dy, double h)
{
	return h * pow(dx * dx + dy * dy + h * h, -1.5);
}

static const double floor_o[3] = { 0, 0, 0 }, floor_x[3] = { 4, 0, 0 }, floor_y[3] = { 0, 4, 0 };
static const double up[3] = { 0, 0, 9 }, along_x[3] = { 90, 0, 0 }, along_y[3] = { 0, 90, 0 };

/* Mirrors x = 0 and y = 0: an image in each, and one in both, which some points see by one
 * of them first and some by the other. */
static void corner(void **state)
{
	const double at[3] = { 1, 2, 1 };
	struct room r;

	(void)state;
	room_new(&r, 3, LIGHT_POINT, at);
	add(&r, FLOOR, floor_o, floor_x, floor_y);
	add(&r, MIRROR, floor_o, along_y, up);
	add(&r, MIRROR, floor_o, up, along_x);
	room_ready(&r);
	assert_int_equal(r.ways.images.mirrors.n, 2);
	assert_int_equal(r.ways.images.l.n, 5);
	assert_true(r.ways.images.complete);
	for (double x = .3; x < 4; x += .37)
		for (double y = .21; y < 4; y += .43) {
			given("x %g, y %g", x, y);
			double want = from_point(x - 1, y - 2, 1) +
			              rho * (from_point(x + 1, y - 2, 1) + from_point(x - 1, y + 2, 1)) +
			              rho * rho * from_point(x + 1, y + 2, 1);
			assert_near(irradiance(&r, x, y), want, 1e-6 * want);
		}
	room_free(&r);
}

/* A directional light by the mirror x = 0, and a pane before part of it. */
static void through_a_pane(void **state)
{
	const double along[3] = { -1, 0, -2 };
	const double pane[3] = { 1e-3, 0, 0 }, low[3] = { 0, 0, 1 };
	struct room r;

	(void)state;
	room_new(&r, 3, LIGHT_DIRECTIONAL, along);
	add(&r, FLOOR, floor_o, floor_x, floor_y);
	add(&r, MIRROR, floor_o, along_y, up);
	add(&r, PANE, pane, along_y, low);
	room_ready(&r);
	double cosine = 2 / sqrt(5);
	/* Down to 1 m above the floor the mirror is behind the pane: its light crosses that
	 * before it and behind it, and lands within half a metre. */
	assert_near(irradiance(&r, .25, 1), cosine * (1 + rho * tau * tau), 1e-6);
	assert_near(irradiance(&r, 1, 1), cosine * (1 + rho), 1e-6);
	room_free(&r);
}

/* Two mirrors that face each other a metre apart: images of images without end. */
static void facing(void **state)
{
	const double at[3] = { .25, 2, 1 }, opposite[3] = { 1, 0, 0 };
	const double narrow[3] = { 1, 0, 0 };
	struct room r;

	(void)state;
	room_new(&r, 3, LIGHT_POINT, at);
	add(&r, FLOOR, floor_o, narrow, floor_y);
	add(&r, MIRROR, floor_o, along_y, up);
	add(&r, MIRROR, opposite, up, along_y);
	room_ready(&r);
	double want = 0, got = irradiance(&r, .6, 2.5);
	for (int i = -200; i <= 200; i++)
		want += pow(rho, abs(2 * i)) * from_point(.6 - (2 * i + .25), .5, 1) +
		        pow(rho, abs(2 * i - 1)) * from_point(.6 - (2 * i - .25), .5, 1);
	assert_false(r.ways.images.complete);
	assert_near(got, want, 1e-4 * want);
	room_free(&r);
}

/* More planes than images are made for. */
static void curved(void **state)
{
	const double at[3] = { 0, 0, 5 };
	struct room r;

	(void)state;
	room_new(&r, 20, LIGHT_POINT, at);
	for (int i = 0; i < 20; i++) {
		double o[3] = { i, 0, i * i }, x[3] = { 1, 0, 2 * i + 1 }, y[3] = { 0, 1, 0 };
		add(&r, MIRROR, o, x, y);
	}
	room_ready(&r);
	assert_int_equal(r.ways.images.l.n, 1);
	assert_false(r.ways.images.complete);
	room_free(&r);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(corner),
		cmocka_unit_test(through_a_pane),
		cmocka_unit_test(facing),
		cmocka_unit_test(curved),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
