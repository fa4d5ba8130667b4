/* The estimate of what the division into elements costs, against the true error of
 * interpolation of known fields. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include "tests/unit/fixtures/grid.h"

#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/interpolate/discretisation.h"
#include "lib/interpolate/reconstruct.h"

enum { N = 16, SUB = 24 };

static const double origin[3] = { 0, 0, 0 }, x1[3] = { 1, 0, 0 }, y1[3] = { 0, 1, 0 };

typedef double field(double x, double y);

static double constant(double x, double y)
{
	return 2 + 0 * x * y;
}

static double linear(double x, double y)
{
	return 2 + 3 * x - .5 * y;
}

static double curved(double x, double y)
{
	return 2 + 4 * (x - .3) * (x - .3) + 3 * (y - .6) * (y - .6);
}

/* A small lamp near by. */
static double bump(double x, double y)
{
	double d2 = (x - .4) * (x - .4) + (y - .55) * (y - .55) + .04;

	return .04 * .04 / (d2 * d2);
}

static double step(double x, double y)
{
	return x + .37 * y > .71;
}

static double penumbra(double x, double y)
{
	double t = (x + .37 * y - .6) / .2;

	return t < 0 ? 0 : t > 1 ? 1 : t * t * (3 - 2 * t);
}

/* Weights and coordinates of a point of element e. */
static void sample(const struct model *m, size_t e, int i, int k, double w[3], double p[2])
{
	w[1] = (i + 1. / 3) / SUB;
	w[2] = (k + 1. / 3) / SUB;
	w[0] = 1 - w[1] - w[2];
	for (int c = 0; c < 2; c++)
		p[c] = w[0] * m->vertex[3 * m->element.corner[3 * e] + (size_t)c] +
		       w[1] * m->vertex[3 * m->element.corner[3 * e + 1] + (size_t)c] +
		       w[2] * m->vertex[3 * m->element.corner[3 * e + 2] + (size_t)c];
}

static double mean(const struct model *m, size_t e, field *f)
{
	double sum = 0, w[3], p[2];
	int n = 0;

	for (int i = 0; i < SUB; i++)
		for (int k = 0; i + k < SUB; k++, n++) {
			sample(m, e, i, k, w, p);
			sum += f(p[0], p[1]);
		}
	return sum / n;
}

/* Mean square of interpolation's error over an element. */
static double square(const struct model *m, const struct reconstruction *r, size_t e, field *f)
{
	double sum = 0, w[3], p[2], h[1];
	int n = 0;

	for (int i = 0; i < SUB; i++)
		for (int k = 0; i + k < SUB; k++, n++) {
			sample(m, e, i, k, w, p);
			interp_reconstruction_at(r, e, FRONT, w, h);
			sum += (h[0] - f(p[0], p[1])) * (h[0] - f(p[0], p[1]));
		}
	return sum / n;
}

struct outcome {
	double stated, exact;   /* root mean squares over the surface */
	double noise;           /* as corrected */
};

/* Jittered elements of a field's means with noise, and what its error is said to be. */
static struct outcome run_noisy(field *f, double noise, double said)
{
	struct model m;
	struct solution s;
	struct reconstruction r;
	struct err e = { 0 };
	struct rng g = rng_seed(3, 0);
	struct outcome o = { 0 };

	grid_new(&m, 1, N, 1, 1);
	grid_quad(&m, N, 0, origin, x1, y1);
	for (size_t j = 1; j < N; j++)
		for (size_t i = 1; i < N; i++)
			for (size_t k = 0; k < 2; k++)
				m.vertex[3 * (j * (N + 1) + i) + k] += .3 / N * (rng_uniform(&g) - .5);
	grid_end(&m);
	grid_solution(&m, 0, &s);
	for (size_t i = 0; i < m.element.n; i++) {
		s.irradiance.indirect[2 * i] = mean(&m, i, f) + noise * sqrt(12) * (rng_uniform(&g) - .5);
		s.error.sampling[2 * i] = said;
	}
	assert_int_equal(interp_discretisation(&m, &s, 1, 2, &e), 0);
	assert_int_equal(interp_reconstruct(&m, &s, PART_ALL, 1, &r, &e), 0);
	for (size_t i = 0; i < m.element.n; i++) {
		o.exact += m.element.area[i] * square(&m, &r, i, f);
		o.stated += m.element.area[i] * s.error.discretisation[2 * i] * s.error.discretisation[2 * i];
		assert_that(s.error.discretisation[2 * i + 1], ==, 0);
	}
	o.noise = s.error.sampling[0];
	o.exact = sqrt(o.exact);
	o.stated = sqrt(o.stated);
	interp_reconstruction_free(&r);
	grid_solution_free(&s);
	model_free(&m);
	return o;
}

static struct outcome run(field *f, double noise)
{
	return run_noisy(f, noise, noise);
}

static void test_exact_fields(void **state)
{
	(void)state;
	assert_that(run(constant, 0).stated, <, 1e-12);
	assert_that(run(linear, 0).stated, <, 1e-12);
}

static void within_factor(struct outcome o, double factor)
{
	assert_that(o.stated, <, o.exact * factor);
	assert_that(o.exact, <, o.stated * factor);
}

static void test_smooth_fields(void **state)
{
	(void)state;
	within_factor(run(curved, 0), 2);
	within_factor(run(bump, 0), 2);
	within_factor(run(penumbra, 0), 2);
}

static void test_shadow_edge(void **state)
{
	(void)state;
	within_factor(run(step, 0), 1.5);
}

/* Noise is not taken for detail, nor does it hide a step. */
static void test_noise(void **state)
{
	(void)state;
	assert_that(run(constant, .05).stated, <, .05);
	within_factor(run(step, .05), 1.5);
	within_factor(run(step, .01), 1.5);
}

/* Errors that are stated too large are corrected, in spite of a step; others are not. */
static void test_stated_noise(void **state)
{
	(void)state;
	assert_near(run_noisy(constant, .05, .15).noise / .05, 1, .2);
	assert_near(run_noisy(step, .05, .15).noise / .05, 1, .35);
	assert_near(run_noisy(linear, .05, .15).noise / .05, 1, .2);
	assert_that(run_noisy(constant, .05, .02).noise, ==, .02);
	within_factor(run_noisy(step, .05, .15), 1.6);
}

/* Elements that share their patch's irradiance do not make its error any smaller. */
static void test_noise_by_patches(void **state)
{
	(void)state;
	assert_that(run_noisy(constant, 0, .1).noise, ==, .1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_exact_fields),
		cmocka_unit_test(test_smooth_fields),
		cmocka_unit_test(test_shadow_edge),
		cmocka_unit_test(test_noise),
		cmocka_unit_test(test_stated_noise),
		cmocka_unit_test(test_noise_by_patches),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
