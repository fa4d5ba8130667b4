/* Irradiance straight from emitters, against closed forms and sums. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include "tests/unit/fixtures/grid.h"

#include "lib/base/constants.h"
#include "lib/base/vec.h"
#include "lib/occlusion/direct.h"

struct stage {
	struct model m;
	struct ray_scene *rays;
	struct direct *d;
	struct direct_worker *w;
};

/* Material 0 is a dark two-sided sheet, material 1 a one-sided lamp of radiance 1. */
static void stage_new(struct stage *t, size_t surfaces, size_t n)
{
	*t = (struct stage){ 0 };
	grid_new(&t->m, surfaces, n, 2, 1);
	t->m.material.emission[model_material_at(&t->m.material, 1, FRONT)] = 1;
	t->m.material.one_sided[1] = 1;
}

/* A rectangle parallel to the floor, facing down. */
static void put(struct stage *t, size_t n, uint32_t material, double x, double y, double z,
                double dx, double dy)
{
	double o[3] = { x, y, z }, u[3] = { 0, dy, 0 }, v[3] = { dx, 0, 0 };

	grid_quad(&t->m, n, material, o, u, v);
}

static void stage_end(struct stage *t)
{
	struct err e = { 0 };

	grid_end(&t->m);
	assert_non_null(t->rays = ray_scene_new(&t->m, &e));
	assert_non_null(t->d = occ_direct_new(&t->m, t->rays, &e));
	assert_non_null(t->w = occ_direct_worker_new(t->d, &e));
}

static void stage_free(struct stage *t)
{
	occ_direct_worker_free(t->w);
	occ_direct_free(t->d);
	ray_scene_free(t->rays);
	model_free(&t->m);
}

/* The floor, surface 0, z = 0, [-2, 2]^2, front up. */
static void put_floor(struct stage *t, size_t n)
{
	double o[3] = { -2, -2, 0 }, u[3] = { 4, 0, 0 }, v[3] = { 0, 4, 0 };

	grid_quad(&t->m, n, 0, o, u, v);
}

/* Irradiance of the floor at (x, y, 0). */
static double lit(struct stage *t, double x, double y, int side, double *error)
{
	struct err e = { 0 };
	double at[3] = { x, y, 0 }, nothing = 0, h, off;

	for (uint32_t i = 0; i < t->m.element.n; i++) {
		const double *v[3];
		double w[3], n[3];
		for (int k = 0; k < 3; k++)
			v[k] = &t->m.vertex[3 * (size_t)t->m.element.corner[3 * i + (uint32_t)k]];
		for (int k = 0; k < 3; k++) {
			v3_area(at, v[(k + 1) % 3], v[(k + 2) % 3], n);
			w[k] = n[2];
		}
		if (v[0][2] != 0 || w[0] < -1e-12 || w[1] < -1e-12 || w[2] < -1e-12)
			continue;
		occ_direct_begin(t->w, 2 * i + (uint32_t)side);
		assert_int_equal(occ_direct_at(t->w, at, 1, 1e-3, &nothing, &h, &off, &e), 0);
		*error = off;
		return h;
	}
	fail_msg("(%g, %g) is on no element", x, y);
	return 0;
}

/* Form factor of a rectangle at height z whose corner is above the point (Howell B-3). */
static double corner_factor(double a, double b, double z)
{
	double x = a / z, y = b / z, p = sqrt(1 + x * x), q = sqrt(1 + y * y);

	return (x / p * atan(y / p) + y / q * atan(x / q)) / (2 * PI);
}

/* Of the rectangle [x0, x1] x [y0, y1]. */
static double factor(double x0, double x1, double y0, double y1, double z)
{
	return corner_factor(x1, y1, z) - corner_factor(x0, y1, z) - corner_factor(x1, y0, z) +
	       corner_factor(x0, y0, z);
}

static void test_rectangle(void **state)
{
	struct stage t;
	double error;
	(void)state;

	stage_new(&t, 2, 4);
	put_floor(&t, 4);
	put(&t, 4, 1, -.5, -.3, 1.5, 1, .6);
	stage_end(&t);
	for (double x = -1.9; x < 2; x += .37) {
		given("x %g", x);
		assert_close(lit(&t, x, .3 * x, FRONT, &error),
		     PI * factor(-.5 - x, .5 - x, -.3 - .3 * x, .3 - .3 * x, 1.5), 1e-12);
		assert_that(error, ==, 0);
		assert_that(lit(&t, x, .3 * x, BACK, &error), ==, 0);
	}
	stage_free(&t);
}

/* A sheet half way up hides, from points under the lamp, twice its shadow on it. */
static void test_hidden(void **state)
{
	struct stage t;
	double error;
	(void)state;

	stage_new(&t, 3, 4);
	put_floor(&t, 4);
	put(&t, 4, 1, -1, -1, 1, 2, 2);
	put(&t, 4, 0, 0, -1.5, .5, 1.5, 3);
	stage_end(&t);
	/* From (x, 0) the sheet's edge x = 0 is seen at -x on the lamp. */
	for (double x = -1.4; x < 1.5; x += .1) {
		given("x %g", x);
		double edge = fmin(1, fmax(-1, -x));
		assert_close(lit(&t, x, 0, FRONT, &error), PI * factor(-1 - x, edge - x, -1, 1, 1), 1e-9);
		assert_that(error, ==, 0);
	}
	stage_free(&t);
}

/* Lamps in one plane and a sheet, too many to look at one by one: sampled. */
static void test_sampled(void **state)
{
	enum { SIDE = 8 };
	struct stage t;
	double error, off = 0, stated = 0;
	(void)state;

	stage_new(&t, 2 + SIDE * SIDE, 2);
	put_floor(&t, 2);
	put(&t, 2, 0, 0, -1.5, .5, 1.5, 3);
	for (int i = 0; i < SIDE * SIDE; i++)
		put(&t, 2, 1, -1 + .25 * (i % SIDE), -1 + .25 * (i / SIDE), 1, .2, .2);
	stage_end(&t);
	for (double x = -1.3; x < 1.4; x += .19) {
		given("x %g", x);
		double sum = 0;
		for (int i = 0; i < SIDE * SIDE; i++) {
			double x0 = -1 + .25 * (i % SIDE) - x, y0 = -1 + .25 * (i / SIDE);
			double edge = fmin(x0 + .2, fmax(x0, -2 * x));
			sum += PI * factor(x0, edge, y0, y0 + .2, 1);
		}
		double got = lit(&t, x, 0, FRONT, &error);
		/* Errors from four parts scatter: their root mean square is what counts. */
		off += (got - sum) * (got - sum);
		stated += error * error;
		assert_that(error, <=, .01);
	}
	assert_that(off, <, 4 * stated);
	assert_that(stated, <, 4 * off);
	assert_true(occ_direct_sampled(t.w));
	stage_free(&t);
}

/* A lamp that sends L cos^3, against a sum over 400 x 400 points of it; half of it
 * hidden by a sheet at half its height. */
static void test_exponent(void **state)
{
	enum { POINTS = 400 };
	struct stage t;
	double error;
	(void)state;

	for (int hidden = 0; hidden < 2; hidden++) {
		given("hidden %d", hidden);
		stage_new(&t, 3, 1);
		put_floor(&t, 1);
		put(&t, 1, 1, -1, -1, 1, 2, 2);
		put(&t, 1, 0, 0, -1.5, hidden ? .5 : 2, 1.5, 3);
		t.m.material.emission_exponent[2] = 4;
		stage_end(&t);
		for (double x = -1; x <= 1; x += .4) {
			double sum = 0;
			for (int i = 0; i < POINTS * POINTS; i++) {
				double u = -1 + 2 * (i % POINTS + .5) / POINTS, v = -1 + 2 * (i / POINTS + .5) / POINTS;
				double r2 = (u - x) * (u - x) + v * v + 1, c = 1 / sqrt(r2);
				double clear = hidden && u > -x ? 0 : 1;
				sum += clear * pow(c, 5) / r2 * 4. / (POINTS * POINTS);
			}
			assert_close(lit(&t, x, 0, FRONT, &error), sum, hidden ? 5e-3 : 1e-4);
		}
		stage_free(&t);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_rectangle), cmocka_unit_test(test_hidden),
		cmocka_unit_test(test_sampled), cmocka_unit_test(test_exponent),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
