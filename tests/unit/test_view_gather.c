/* Light that views gather: where it goes on by mirrors and panes, and what of the errors of
 * the solution it has. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "tests/unit/fixtures/stage.h"

/* A closed box without emitters, of irradiance 1 that is all indirect. Walls reflect half of
 * what they do not mirror or let through, so that everything is .5 / pi bright, and so is what
 * is gathered. */
static void box(struct stage *t, double rho_s, double tau_s, size_t n)
{
	static const uint32_t material[6] = { 0, 1, 0, 1, 0, 0 };
	double lo[3] = { -1, -1, -1 }, hi[3] = { 1, 1, 1 };
	double o[3] = { -.9, -.8, -.1 }, x[3] = { 1.7, 0, .1 }, y[3] = { 0, 1.6, .2 };

	*t = (struct stage){ 0 };
	grid_new(&t->m, 7, n, 3, 1);
	set(&t->m, 0, FRONT, .5, 0, 0, 0, (double)INFINITY);
	set(&t->m, 1, FRONT, .5 * (1 - rho_s), 0, rho_s, 0, (double)INFINITY);
	for (int side = 0; side < 2; side++)
		set(&t->m, 2, side, .5 * (1 - rho_s / 2 - tau_s), 0, rho_s / 2, tau_s, (double)INFINITY);
	t->m.material.one_sided[0] = t->m.material.one_sided[1] = 1;
	memset(t->m.material.emission, 0, 6 * sizeof *t->m.material.emission);
	grid_box(&t->m, n, material, lo, hi);
	grid_quad(&t->m, n, 2, o, x, y);
	stage_end(t, 0);
	for (size_t i = 0; i < 2 * t->m.element.n; i++)
		t->s.irradiance.indirect[i] = 1;
	use_method(t, VIEW_GATHER);
}

static void test_tails(void **state)
{
	struct view_frame f = frame(.8, -.7, .5, -.5, .6, -.3, 24, 20);
	struct view_options o = options();
	(void)state;

	o.gather_rays = 1024;
	o.cutoff = 0;
	for (int i = 0; i < 4; i++) {
		given("i %d", i);
		double rho_s = i % 2 ? .8 : 0, tau_s = i / 2 ? .5 : 0, mean = 0, worst = 0;
		struct stage t;
		struct image im;
		box(&t, rho_s, tau_s, 3);
		render(&t, &f, &o, &im);
		for (size_t p = 0; p < 24 * 20; p++) {
			double v = (double)im.pixel[p] * PI / .5;
			/* A surface shows half of its diffuse reflectance times what it gathers. */
			mean += v / (24 * 20);
			worst = fmax(worst, fabs(v - .5));
		}
		printf("# mirrors %g, panes %g: %g, %g off at most\n", rho_s, tau_s, mean, worst);
		assert_near(mean, .5, 2e-3);
		assert_that(worst, <, .05);
		picture_image_free(&im);
		stage_free(&t);
	}
}

/* Elements that err by 30 %, apart from one another: how far what is gathered from them is off,
 * and what is stated of it. */
static void test_errors(void **state)
{
	struct view_frame f = frame(.8, -.7, .5, -.5, .6, -.3, 30, 30);
	struct view_options o = options();
	(void)state;

	o.gather_rays = 4096;
	o.layers = VIEW_ERROR;
	for (size_t n = 4; n <= 16; n *= 2) {
		given("n %zu", n);
		struct stage t;
		struct image im;
		double stated = 0, off = 0;
		box(&t, 0, 0, n);
		for (size_t i = 0; i < 2 * t.m.element.n; i++) {
			t.s.error.sampling[i] = .3;
			t.s.irradiance.indirect[i] += .3 * sqrt(3) * (2 * (double)(i * 2654435761u % 1013) / 1012 - 1);
		}
		use_method(&t, VIEW_GATHER);
		render(&t, &f, &o, &im);
		const float *error = picture_image_plane(&im, picture_image_channel(&im, "error.R"));
		for (size_t p = 0; p < 30 * 30; p++) {
			/* What each surface has gathered, were it not for noise, is .5. */
			double right = .25 / PI;
			stated += (double)error[p] * (double)error[p];
			off += ((double)im.pixel[p] - right) * ((double)im.pixel[p] - right);
		}
		printf("# %zu cells: %.3g %% off, stated %.2f of that\n", n * n, 100 * sqrt(off / 900) / .25 * PI,
		       sqrt(stated / off));
		assert_that(stated, >, .25 * off);
		assert_that(stated, <, 4 * off);
		picture_image_free(&im);
		stage_free(&t);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = { cmocka_unit_test(test_tails), cmocka_unit_test(test_errors) };
	return cmocka_run_group_tests(tests, NULL, NULL);
}
