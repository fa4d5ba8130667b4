/* Lobes of finite exponent in pictures: what they show, and what is stated of their errors. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "tests/unit/fixtures/stage.h"

#include "lib/base/vec.h"
#include "lib/scatter/bsdf.h"
#include "lib/scatter/lobe.h"

/* Uniform surroundings of radiance 10 seen in a lobe at 60 degrees. */
static void test_lobes(void **state)
{
	double cosine = .5, k = 30;
	(void)state;

	for (int kind = 0; kind < 2; kind++) {
		given("kind %d", kind);
		struct stage t;
		struct view_options o = options();
		wall(&t, kind ? LOBE_RECIPROCAL : LOBE_PAPER);
		set(&t.m, 0, FRONT, 0, 0, .6, 0, k);
		set(&t.m, 0, BACK, 0, 0, 0, 0, k);
		t.m.material.emission[0] = t.m.material.emission[1] = 0;
		stage_end(&t, 0);
		double x = sqrt(.75), a = bsdf_lobe_albedo(k, cosine);
		double one = look(&t, &o, x, 0, .5, 0, 0, 0);
		assert_near(one, 10 * .6 * (kind ? a : 1), 1e-4);
		o.lobe_samples = 4096;
		double many = look(&t, &o, x, 0, .5, 0, 0, 0), expected = 0, sum = 0;
		/* The same integral by quadrature over the lobe. */
		for (int i = 0; i < 400; i++)
			for (int j = 0; j < 400; j++) {
				double c = (i + .5) / 400, s = sqrt(1 - c * c);
				double p = 2 * PI * (j + .5) / 400;
				double g = -s * cos(p) * x + c * cosine;
				double w = bsdf_lobe_power(k, g) * 2 * PI / 160000.;
				expected += w * c / (kind ? fmax(c, cosine)
				                          : bsdf_lobe_normaliser(k, c) * cosine);
				sum += w;
			}
		expected *= 10 * .6 * (kind ? (k + 1) / (2 * PI) : 1);
		assert_near(sum / bsdf_lobe_normaliser(k, cosine), 1, 1e-3);
		assert_near(many / expected, 1, 5e-3);
		stage_free(&t);
	}
}

/* A glossy floor at z = 0 of exponent k below a surface of n x n cells at z = 1: a lamp of
 * radiance `lamp`, or whose elements have some irradiance each. */
static void gloss(struct stage *t, enum lobe_kind kind, double k, size_t n, double lamp)
{
	double o[3] = { -3, -3, 0 }, x[3] = { 6, 0, 0 }, y[3] = { 0, 6, 0 };
	double size = lamp > 0 ? 1 : 8, up[3] = { -size / 2, -size / 2, 1 };
	double px[3] = { 0, size, 0 }, py[3] = { size, 0, 0 };

	*t = (struct stage){ 0 };
	grid_new(&t->m, 2, n, 2, 1);
	t->m.lobe = kind;
	set(&t->m, 0, FRONT, 0, 0, .6, 0, k);
	set(&t->m, 1, FRONT, lamp > 0 ? 0 : 1, 0, 0, 0, 1);
	memset(t->m.material.emission, 0, 4 * sizeof *t->m.material.emission);
	t->m.material.emission[2] = lamp;
	grid_quad(&t->m, n, 0, o, x, y);
	grid_quad(&t->m, n, 1, up, px, py);
	stage_end(t, 0);
	for (size_t e = 2 * n * n; e < t->m.element.n && lamp == 0; e++)
		t->s.irradiance.indirect[2 * e] = (double)(e * 2654435761u % 97) / 97;
	use_method(t, VIEW_MESH);
}

/* What a lobe on the floor makes of a lamp of radiance 7 and side `size` parallel to it, by
 * quadrature. */
static double lamp_seen(const struct model *m, const double at[3], const double out[3], double size,
                        double height)
{
	double sum = 0, f, up[3] = { 0, 0, 1 };
	int n = 800;

	for (int i = 0; i < n; i++)
		for (int j = 0; j < n; j++) {
			double d[3] = { size * ((i + .5) / n - .5) - at[0], size * ((j + .5) / n - .5) - at[1],
			                height };
			double square = v3_dot(d, d);
			v3_normalise(d);
			bsdf_eval_lobes(m, 0, up, d, out, &f);
			sum += 7 * f * d[2] * d[2] / square * size * size / (n * n);
		}
	return sum;
}

/* What a lobe shows of a lamp, by quadrature over the lamp. */
static void test_lamp_in_lobe(void **state)
{
	double eye[3] = { .7, -.4, .8 }, at[3] = { .1, .05, 0 }, out[3];
	(void)state;

	v3_sub(eye, at, out);
	v3_normalise(out);
	for (int kind = 0; kind < 2; kind++)
		for (double k = 0; k < 2e4; k = 3 * k + 2) {
			given("kind %d, k %g", kind, k);
			struct stage t;
			struct view_options o = options();
			gloss(&t, kind ? LOBE_RECIPROCAL : LOBE_PAPER, k, 1, 7);
			o.lobe_samples = VIEW_LOBE_ENOUGH;
			double seen = look(&t, &o, eye[0], eye[1], eye[2], at[0], at[1], at[2]);
			double sum = lamp_seen(&t.m, at, out, 1, 1);
			assert_near(seen, sum, 2e-3 * sum + 1e-6);
			stage_free(&t);
		}
}

/* The same lamp at x = 2.5, turned upwards, below a mirror at z = 3: its image is at z = 5.
 * With `pane`, turned down, above a clear pane. */
static void test_image_in_lobe(void **state)
{
	double eye[3] = { -.45, .1, .8 }, at[3] = { -2.5, 0, 0 }, out[3] = { -.45, .1, .8 };
	(void)state;

	v3_normalise(out);
	for (int pane = 0; pane < 2; pane++)
		for (double k = 3; k < 2e4; k *= 20) {
			given("pane %d, k %g", pane, k);
			double floor[3] = { -3, -3, 0 }, x[3] = { 6, 0, 0 }, y[3] = { 0, 6, 0 };
			double lamp[3] = { 2, -.5, pane ? 5 : 1 }, lx[3] = { 1, 0, 0 }, ly[3] = { 0, 1, 0 };
			double over[3] = { -9, -9, pane ? .9 : 3 }, ox[3] = { 0, 18, 0 }, oy[3] = { 18, 0, 0 };
			struct view_options o = options();
			struct stage t = { 0 };
			grid_new(&t.m, 3, 1, 3, 1);
			set(&t.m, 0, FRONT, 0, 0, .6, 0, k);
			set(&t.m, 1, FRONT, 0, 0, 0, 0, 1);
			for (int side = 0; side < 2; side++)
				set(&t.m, 2, side, 0, 0, pane ? 0 : .8, pane ? .8 : 0, (double)INFINITY);
			memset(t.m.material.emission, 0, 6 * sizeof *t.m.material.emission);
			t.m.material.emission[2] = 7;
			grid_quad(&t.m, 1, 0, floor, x, y);
			grid_quad(&t.m, 1, 1, lamp, pane ? ly : lx, pane ? lx : ly);
			grid_quad(&t.m, 1, 2, over, ox, oy);
			stage_end(&t, 0);
			double sum = .8 * lamp_seen(&t.m, at, out, 1, 5);
			o.lobe_samples = 4096;
			o.depth = 2; /* what is over the floor, but not the floor once more */
			double seen = look(&t, &o, eye[0], eye[1], eye[2], 0, 0, 0);
			printf("# %s, exponent %g: %g, exact %g\n", pane ? "pane" : "mirror", k, seen, sum);
			assert_near(seen, sum, .02 * sum + 1e-6);
			stage_free(&t);
		}
}

/* Squares of standard errors, of what they are of, and of radiance, over a picture of a lobe. */
static void compare(const struct stage *t, int lobe_samples, double *stated, double *true_error,
                    double *all)
{
	struct view_frame f = frame(.5, -.6, .7, .1, .1, 0, 16, 16);
	struct view_options o = options();
	struct image a, b;

	*stated = *true_error = *all = 0;
	o.layers = VIEW_ERROR;
	o.lobe_samples = lobe_samples;
	render(t, &f, &o, &a);
	o.lobe_samples = 1024;
	render(t, &f, &o, &b);
	const float *error = picture_image_plane(&a, picture_image_channel(&a, "error.R"));
	for (size_t i = 0; i < 16 * 16; i++) {
		double off = (double)a.pixel[i] - (double)b.pixel[i];
		*stated += (double)error[i] * (double)error[i];
		*true_error += off * off;
		*all += (double)b.pixel[i] * (double)b.pixel[i];
	}
	picture_image_free(&a);
	picture_image_free(&b);
}

static void test_lobe_errors(void **state)
{
	static const int samples[] = { 0, 4, 16, 64, VIEW_LOBE_ENOUGH };
	double stated, off, all;
	(void)state;

	for (double k = 3; k < 500; k *= 8)
		for (int i = 0; i < 5; i++) {
			given("k %g, i %d", k, i);
			struct stage t;
			gloss(&t, LOBE_PAPER, k, 40, 0);
			compare(&t, samples[i], &stated, &off, &all);
			printf("# exponent %g, %d samples: stated %.3g of the true error\n", k, samples[i],
			       sqrt(stated / off));
			assert_that(stated, >, .25 * off);
			/* More than that, where there are many samples for how smooth light is. */
			assert_true(stated < 4 * off || stated < 2.5e-3 * all);
			stage_free(&t);
		}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_lobes), slow_unit_test(test_lamp_in_lobe),
		cmocka_unit_test(test_image_in_lobe), slow_unit_test(test_lobe_errors)
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
