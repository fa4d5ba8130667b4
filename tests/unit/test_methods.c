/* Where diffuse light of a view comes from: interpolation, direct light and gathering must
 * say the same where all are exact, and count nothing twice. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include "tests/unit/fixtures/grid.h"

#include "lib/base/constants.h"
#include "lib/view/view.h"

struct stage {
	struct model m;
	struct solution s;
	struct ray_scene *rays;
};

static void stage_end(struct stage *t, double direct, double caustic, double indirect)
{
	struct err e = { 0 };
	size_t n = 2 * t->m.element.n * (size_t)t->m.bands;

	grid_end(&t->m);
	grid_solution(&t->m, indirect, &t->s);
	for (size_t i = 0; i < n; i++) {
		t->s.irradiance.direct[i] = direct;
		t->s.irradiance.caustic[i] = caustic;
	}
	assert_non_null(t->rays = ray_scene_new(&t->m, &e));
}

static void stage_free(struct stage *t)
{
	ray_scene_free(t->rays);
	grid_solution_free(&t->s);
	model_free(&t->m);
}

static struct image render(const struct stage *t, enum view_method method, const double eye[3],
                           const double target[3], int width, int height, int threads)
{
	struct view_options o = { .samples = 1, .depth = 32, .cutoff = 1e-6, .threads = threads,
		                  .gather_rays = 256 };
	double up[3] = { .1, .2, 1 };
	struct camera c;
	struct view_frame f;
	struct view_stats stats;
	struct image im;
	struct err e = { 0 };
	struct view_scene *v = view_scene_new(&t->m, &t->s, t->rays, method, threads, &e);

	assert_non_null(v);
	assert_int_equal(picture_camera_look_at(eye, target, up, 70, &c, &e), 0);
	assert_int_equal(picture_camera_frame(&c, width, height, &f, &e), 0);
	assert_int_equal(view_render(v, &f, &o, NULL, &im, &stats, &e), 0);
	view_scene_free(v);
	return im;
}

static double look(const struct stage *t, enum view_method method, double ex, double ey, double ez,
                   double tx, double ty, double tz)
{
	double eye[3] = { ex, ey, ez }, target[3] = { tx, ty, tz };
	struct image im = render(t, method, eye, target, 1, 1, 1);
	double v = (double)im.pixel[0];

	picture_image_free(&im);
	return v;
}

static void set(struct model *m, size_t material, double rho_d, double tau_d, double rho_s,
                double emission)
{
	for (int side = 0; side < 2; side++) {
		size_t at = model_material_at(&m->material, material, side);
		m->material.rho_d[at] = rho_d;
		m->material.tau_d[at] = tau_d;
		m->material.rho_s[at] = rho_s;
		m->material.emission[at] = emission;
	}
}

/* A closed box and a bent sheet in it that transmits, all emitting .5 / pi: half of the
 * irradiance of 1 is direct everywhere. */
static void furnace(struct stage *t)
{
	static const uint32_t material[6] = { 0, 0, 0, 0, 0, 0 };
	double lo[3] = { -1, -1, -1 }, hi[3] = { 1, 1, 1 };
	double o[3] = { -.9, -.8, -.1 }, x[3] = { 1.7, 0, .1 }, y[3] = { 0, 1.6, .2 };

	grid_new(&t->m, 7, 3, 2, 1);
	set(&t->m, 0, .5, 0, 0, .5 / PI);
	set(&t->m, 1, .3, .2, 0, .5 / PI);
	t->m.material.one_sided[0] = 1;
	grid_box(&t->m, 3, material, lo, hi);
	grid_quad(&t->m, 3, 1, o, x, y);
	for (size_t i = t->m.vertices - 4 * 4; i < t->m.vertices; i++)
		t->m.vertex[3 * i + 2] -= .1 * t->m.vertex[3 * i] * t->m.vertex[3 * i];
	stage_end(t, .5, 0, .5);
}

static void test_furnace(void **state)
{
	double eye[3] = { .3, -.5, .6 }, target[3] = { -.2, .4, -.5 };
	struct stage t;
	(void)state;

	furnace(&t);
	for (enum view_method k = VIEW_MESH; k <= VIEW_GATHER; k++) {
		struct image im = render(&t, k, eye, target, 40, 30, 1);
		for (size_t p = 0; p < 3 * 40 * 30; p++) {
			given("p %zu", p);
			assert_near((double)im.pixel[p] * PI, 1, 2e-6);
		}
		picture_image_free(&im);
	}
	stage_free(&t);
}

static void test_threads(void **state)
{
	double eye[3] = { .3, -.5, .6 }, target[3] = { -.2, .4, -.5 };
	struct stage t;
	(void)state;

	furnace(&t);
	for (size_t i = 0; i < t.m.element.n; i++)
		t.s.irradiance.indirect[2 * i] = 1 + sin((double)i);
	for (enum view_method k = VIEW_MESH; k <= VIEW_GATHER; k++) {
		struct image a = render(&t, k, eye, target, 50, 37, 1);
		struct image b = render(&t, k, eye, target, 50, 37, 4);
		assert_memory_equal(a.pixel, b.pixel, 3 * 50 * 37 * sizeof *a.pixel);
		picture_image_free(&a);
		picture_image_free(&b);
	}
	stage_free(&t);
}

/* A floor z = 0, [-2, 2]^2, half under a lamp at z = 1 that is seen past a sheet; a perfect
 * mirror at x = 2 facing it. */
static void room(struct stage *t)
{
	double floor_o[3] = { -2, -2, 0 }, floor_u[3] = { 4, 0, 0 }, floor_v[3] = { 0, 4, 0 };
	double lamp_o[3] = { -.5, -.5, 1 }, lamp_u[3] = { 0, 1, 0 }, lamp_v[3] = { 1, 0, 0 };
	double sheet_o[3] = { 0, -1, .5 }, sheet_u[3] = { 1, 0, 0 }, sheet_v[3] = { 0, 2, 0 };
	double mirror_o[3] = { 2, -2, .01 }, mirror_u[3] = { 0, 0, 3 }, mirror_v[3] = { 0, 4, 0 };

	grid_new(&t->m, 4, 4, 4, 1);
	set(&t->m, 0, .6, 0, 0, 0);
	set(&t->m, 1, 0, 0, 0, 5);
	set(&t->m, 2, 0, 0, 0, 0);
	set(&t->m, 3, 0, 0, 1, 0);
	t->m.material.one_sided[1] = 1;
	grid_quad(&t->m, 4, 0, floor_o, floor_u, floor_v);
	grid_quad(&t->m, 4, 1, lamp_o, lamp_u, lamp_v);
	grid_quad(&t->m, 4, 2, sheet_o, sheet_u, sheet_v);
	grid_quad(&t->m, 4, 3, mirror_o, mirror_u, mirror_v);
}

/* A point looks the same in a mirror, whatever the method; its direct light is that of the
 * half of the lamp that it sees. */
static void test_mirror(void **state)
{
	/* Of the lamp, from the floor's middle, x < 0: twice a corner rectangle .5 x .5. */
	double p = sqrt(1.25), half = 4 * .5 / p * atan(.5 / p) / (2 * PI);
	struct stage t;
	(void)state;

	room(&t);
	stage_end(&t, .2, .3, .5);
	for (enum view_method k = VIEW_MESH; k <= VIEW_GATHER; k++) {
		double straight = look(&t, k, -1.5, 0, .2, 0, 0, 0);
		double mirrored = look(&t, k, 1.7, 0, .2, 4, 0, 0);
		assert_near(mirrored, straight, 2e-5 * straight);
		double direct = k == VIEW_MESH ? .2 : 5 * PI * half;
		if (k != VIEW_GATHER)
			assert_near(straight, .6 / PI * (direct + .8), 1e-6);
	}
	stage_free(&t);
}

/* Gathering rays that meet the mirror find no lamp in it, nor the floor, which is in one
 * plane with its image: the floor shows its direct and caustic light. */
static void test_no_caustic_twice(void **state)
{
	struct stage t;
	(void)state;

	room(&t);
	stage_end(&t, 0, .3, 0);
	double direct = look(&t, VIEW_DIRECT, -1.5, 0, .2, 0, 0, 0);
	double gathered = look(&t, VIEW_GATHER, -1.5, 0, .2, 0, 0, 0);
	assert_that(direct, >, .6 / PI * .3);
	assert_that(gathered, ==, direct);
	stage_free(&t);
}

/* The floor below a wall of known radiance: half of its hemisphere from the edge. */
static void test_gathered(void **state)
{
	double floor_o[3] = { -2, -2, 0 }, floor_u[3] = { 4, 0, 0 }, floor_v[3] = { 0, 4, 0 };
	double wall_o[3] = { 2, -50, 0 }, wall_u[3] = { 0, 0, 50 }, wall_v[3] = { 0, 100, 0 };
	double o[3] = { 5, 5, 5 }, u[3] = { .1, 0, 0 }, v[3] = { 0, .1, 0 };
	struct stage t;
	(void)state;

	grid_new(&t.m, 3, 8, 3, 1);
	set(&t.m, 0, .5, 0, 0, 0);
	set(&t.m, 1, 1, 0, 0, 0);
	set(&t.m, 2, 0, 0, 0, 1);
	grid_quad(&t.m, 8, 0, floor_o, floor_u, floor_v);
	grid_quad(&t.m, 8, 1, wall_o, wall_u, wall_v);
	grid_quad(&t.m, 8, 2, o, u, v);
	stage_end(&t, 0, 0, 0);
	size_t wall = 2 * 8 * 8;
	for (size_t i = wall; i < 2 * wall; i++)
		t.s.irradiance.indirect[2 * i] = t.s.irradiance.indirect[2 * i + 1] = 1;
	for (double x = -1.8; x < 2; x += .31) {
		given("x %g", x);
		double factor = .5 * (1 - (2 - x) / hypot(2 - x, 50));
		double got = look(&t, VIEW_GATHER, x - .1, .3, 1, x, .3, 0);
		assert_near(got, .5 / PI * factor, .02 * .5 / PI * factor);
	}
	stage_free(&t);
}

/* Sampling stops where its error is small, and what is stated at edges is about what is
 * left against many samples. */
static void test_target(void **state)
{
	double eye[3] = { -1.5, -1, 1.3 }, target[3] = { 0, 0, .3 }, up[3] = { 0, 0, 1 };
	enum { WIDE = 64, HIGH = 48, PIXELS = WIDE * HIGH };
	struct view_options o = { .samples = 64, .depth = 4, .cutoff = 1e-3, .threads = 1,
		                  .layers = VIEW_ERROR };
	struct view_stats some, all;
	struct camera c;
	struct view_frame f;
	struct image a, b;
	struct stage t;
	struct err e = { 0 };
	(void)state;

	room(&t);
	stage_end(&t, .2, .3, .5);
	struct view_scene *v = view_scene_new(&t.m, &t.s, t.rays, VIEW_DIRECT, 1, &e);
	assert_non_null(v);
	assert_int_equal(picture_camera_look_at(eye, target, up, 70, &c, &e), 0);
	assert_int_equal(picture_camera_frame(&c, WIDE, HIGH, &f, &e), 0);
	assert_int_equal(view_render(v, &f, &o, NULL, &b, &all, &e), 0);
	o.relative = .1;
	assert_int_equal(view_render(v, &f, &o, NULL, &a, &some, &e), 0);
	assert_that(some.rays, <, all.rays / 4);
	assert_that(some.rays, >=, 4 * PIXELS);
	double off = 0, stated = 0;
	for (size_t i = 0; i < PIXELS; i++) {
		given("i %zu", i);
		double d = (double)(picture_image_plane(&a, 0)[i] - picture_image_plane(&b, 0)[i]);
		double s = (double)picture_image_plane(&a, 3)[i];
		off += d * d;
		stated += s * s;
		assert_that(s, >=, 0);
	}
	assert_that(stated, >, off / 9);
	assert_that(stated, <, off * 9);
	picture_image_free(&a);
	picture_image_free(&b);
	view_scene_free(v);
	stage_free(&t);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_furnace), cmocka_unit_test(test_threads),
		cmocka_unit_test(test_mirror), cmocka_unit_test(test_no_caustic_twice),
		cmocka_unit_test(test_gathered), cmocka_unit_test(test_target),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
