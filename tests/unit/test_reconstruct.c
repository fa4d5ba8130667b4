/* Interpolation of irradiance: exact for constants and linear fields, breaks at
 * creases and materials, robust to noise. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include "tests/unit/fixtures/grid.h"

#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/interpolate/reconstruct.h"

static const double origin[3] = { 0, 0, 0 }, x1[3] = { 1, 0, 0 }, y1[3] = { 0, 1, 0 };

static double linear(const double p[3])
{
	return 2 + 3 * p[0] - .5 * p[1];
}

/* Fills H with the element means of a field that is linear (centroid values). */
static void fill(const struct model *m, struct solution *s, double (*field)(const double *))
{
	for (size_t e = 0; e < m->element.n; e++) {
		double c[3] = { 0, 0, 0 };
		for (size_t k = 0; k < 3; k++)
			v3_mad(c, 1. / 3, &m->vertex[3 * (size_t)m->element.corner[3 * e + k]], c);
		for (size_t i = 0; i < 2 * (size_t)m->bands; i++)
			s->irradiance.indirect[2 * e * (size_t)m->bands + i] = field(c);
	}
}

static double corner(const struct reconstruction *r, size_t element, size_t k)
{
	return (double)r->corner[(3 * element + k) * 2 * (size_t)r->bands];
}

static void run(const struct model *m, const struct solution *s, int threads,
                struct reconstruction *r)
{
	struct err e = { 0 };
	assert_int_equal(interp_reconstruct(m, s, PART_ALL, threads, r, &e), 0);
}

static double worst(const struct model *m, const struct reconstruction *r,
                    double (*field)(const double *))
{
	double most = 0;
	for (size_t c = 0; c < 3 * m->element.n; c++)
		most = fmax(most, fabs(corner(r, c / 3, c % 3) -
		                       field(&m->vertex[3 * (size_t)m->element.corner[c]])));
	return most;
}

static void test_constant(void **state)
{
	struct model m;
	struct solution s;
	struct reconstruction r;
	(void)state;

	for (size_t n = 1; n < 6; n++) {
		given("n %zu", n);
		grid_new(&m, 1, n, 1, 3);
		grid_quad(&m, n, 0, origin, x1, y1);
		grid_end(&m);
		grid_solution(&m, .1, &s);
		run(&m, &s, 1, &r);
		for (size_t i = 0; i < 18 * m.element.n; i++)
			assert_that(r.corner[i], ==, (float).1);
		interp_reconstruction_free(&r);
		grid_solution_free(&s);
		model_free(&m);
	}
}

static void test_linear(void **state)
{
	struct model m;
	struct solution s;
	struct reconstruction r;
	(void)state;

	for (size_t n = 3; n < 9; n++) {
		given("n %zu", n);
		grid_new(&m, 1, n, 1, 1);
		grid_quad(&m, n, 0, origin, x1, y1);
		grid_end(&m);
		grid_solution(&m, 0, &s);
		fill(&m, &s, linear);
		run(&m, &s, 1, &r); /* borders and corners included */
		assert_that(worst(&m, &r, linear), <, 1e-6);
		interp_reconstruction_free(&r);
		grid_solution_free(&s);
		model_free(&m);
	}
}

/* Jittered vertices: triangles of all shapes. */
static void test_linear_irregular(void **state)
{
	enum { N = 12 };
	struct model m;
	struct solution s;
	struct reconstruction r;
	struct rng g = rng_seed(1, 0);
	(void)state;

	grid_new(&m, 1, N, 1, 1);
	grid_quad(&m, N, 0, origin, x1, y1);
	for (size_t j = 1; j < N; j++)
		for (size_t i = 1; i < N; i++)
			for (size_t k = 0; k < 2; k++)
				m.vertex[3 * (j * (N + 1) + i) + k] += .5 / N * (rng_uniform(&g) - .5);
	grid_end(&m);
	grid_solution(&m, 0, &s);
	fill(&m, &s, linear);
	run(&m, &s, 1, &r);
	assert_that(worst(&m, &r, linear), <, 1e-6);
	interp_reconstruction_free(&r);
	grid_solution_free(&s);
	model_free(&m);
}

static double ramp_from_zero(const double p[3])
{
	return p[0];
}

static void test_never_negative(void **state)
{
	struct model m;
	struct solution s;
	struct reconstruction r;
	(void)state;

	grid_new(&m, 1, 8, 1, 1);
	grid_quad(&m, 8, 0, origin, x1, y1);
	grid_end(&m);
	grid_solution(&m, 0, &s);
	fill(&m, &s, ramp_from_zero);
	run(&m, &s, 1, &r);
	assert_that(worst(&m, &r, ramp_from_zero), <, 1e-6);
	interp_reconstruction_free(&r);
	/* A lit strip beside darkness: no undershoot, no overshoot, no NaN. */
	for (size_t e = 0; e < m.element.n; e++)
		s.irradiance.indirect[2 * e] = m.vertex[3 * (size_t)m.element.corner[3 * e]] < .5 ? 0 : 1;
	run(&m, &s, 1, &r);
	for (size_t c = 0; c < 3 * m.element.n; c++) {
		given("c %zu", c);
		double v = corner(&r, c / 3, c % 3);
		double x = m.vertex[3 * (size_t)m.element.corner[c]];
		assert_that(v, >=, 0);
		assert_that(v, <=, 1);
		if (x < .49)
			assert_that(v, ==, 0);
		if (x > .51)
			assert_that(v, >, .999999);
	}
	interp_reconstruction_free(&r);
	grid_solution_free(&s);
	model_free(&m);
}

/* One surface folded along x = .5 by an angle. */
static double fold_jump(double degrees)
{
	enum { N = 8 };
	struct model m;
	struct solution s;
	struct reconstruction r;
	double a = degrees * acos(-1) / 180, jump = 0;

	grid_new(&m, 1, N, 1, 1);
	grid_quad(&m, N, 0, origin, x1, y1);
	for (size_t v = 0; v < m.vertices; v++) {
		double *p = &m.vertex[3 * v], d = p[0] - .5;
		if (d > 0)
			p[0] = .5 + d * cos(a), p[2] = d * sin(a);
	}
	grid_end(&m);
	grid_solution(&m, 0, &s);
	for (size_t e = 0; e < m.element.n; e++)
		s.irradiance.indirect[2 * e] = s.irradiance.indirect[2 * e + 1] = e % (2 * N) < N ? 1 : 2;
	run(&m, &s, 1, &r);
	for (size_t c = 0; c < 3 * m.element.n; c++)
		jump = fmax(jump, fabs(corner(&r, c / 3, c % 3) - s.irradiance.indirect[2 * (c / 3)]));
	interp_reconstruction_free(&r);
	grid_solution_free(&s);
	model_free(&m);
	return jump;
}

static void test_crease(void **state)
{
	(void)state;
	assert_that(fold_jump(40), <, 1e-6);  /* a break: both sides keep their value */
	assert_that(fold_jump(-40), <, 1e-6);
	assert_that(fold_jump(20), >, .3);    /* smooth: the edge is shared */
}

static void test_surfaces_and_rooms(void **state)
{
	double right[3] = { 1, 0, 0 };
	struct model m;
	struct solution s;
	struct reconstruction r;
	(void)state;

	grid_new(&m, 2, 4, 1, 1);
	grid_quad(&m, 4, 0, origin, x1, y1);
	grid_quad(&m, 4, 0, right, x1, y1);
	grid_end(&m);
	/* Weld: the second surface's left column is the first one's right column. */
	for (size_t i = 0; i < 3 * m.element.n; i++)
		if (m.element.corner[i] >= 25 && (m.element.corner[i] - 25) % 5 == 0)
			m.element.corner[i] = m.element.corner[i] - 25 + 4;
	grid_solution(&m, 0, &s);
	for (size_t e = 0; e < m.element.n / 2; e++)
		s.irradiance.indirect[2 * e] = 5;
	run(&m, &s, 1, &r);
	for (size_t c = 0; c < 3 * m.element.n; c++) /* the dark room stays dark */ {
		given("c %zu", c);
		assert_that(corner(&r, c / 3, c % 3), ==, (c / 3 < m.element.n / 2 ? 5 : 0));
	}
	interp_reconstruction_free(&r);
	grid_solution_free(&s);
	model_free(&m);
}

/* Errors that the solution admits to are smoothed. */
static void test_noise(void **state)
{
	enum { N = 32 };
	struct model m;
	struct solution s;
	struct reconstruction r;
	struct rng g = rng_seed(2, 0);
	double before = 0, after[2] = { 0, 0 };
	(void)state;

	grid_new(&m, 1, N, 1, 1);
	grid_quad(&m, N, 0, origin, x1, y1);
	grid_end(&m);
	grid_solution(&m, 0, &s);
	fill(&m, &s, linear);
	for (size_t i = 0; i < 2 * m.element.n; i++) {
		double noise = .5 * (rng_uniform(&g) - .5);
		s.irradiance.indirect[i] += noise;
		before += noise * noise / (double)(2 * m.element.n);
	}
	for (int known = 0; known < 2; known++) {
		for (size_t i = 0; i < 2 * m.element.n; i++)
			s.error.sampling[i] = known ? sqrt(before) : 0;
		run(&m, &s, 2, &r);
		for (size_t c = 0; c < 3 * m.element.n; c++) {
			double d = corner(&r, c / 3, c % 3) -
			           linear(&m.vertex[3 * (size_t)m.element.corner[c]]);
			after[known] += d * d / (double)(3 * m.element.n);
		}
		interp_reconstruction_free(&r);
	}
	assert_that(after[0], <, .25 * before);
	assert_that(after[1], <, .5 * after[0]);
	grid_solution_free(&s);
	model_free(&m);
}

/* The mean over a surface is kept, curved and noisy as the field may be. */
static double hill(const double p[3])
{
	return 1 + sin(3 * p[0]) * sin(3 * p[1]);
}

static void test_mean(void **state)
{
	enum { N = 16 };
	struct model m;
	struct solution s;
	struct reconstruction r;
	struct rng g = rng_seed(3, 0);
	double before = 0, after = 0;
	(void)state;

	grid_new(&m, 1, N, 1, 1);
	grid_quad(&m, N, 0, origin, x1, y1);
	grid_end(&m);
	grid_solution(&m, 0, &s);
	fill(&m, &s, hill);
	for (size_t i = 0; i < 2 * m.element.n; i++) {
		s.irradiance.indirect[i] += .3 * (rng_uniform(&g) - .5);
		s.error.sampling[i] = .3 / sqrt(12);
	}
	run(&m, &s, 1, &r);
	for (size_t e = 0; e < m.element.n; e++) {
		before += s.irradiance.indirect[2 * e];
		after += (corner(&r, e, 0) + corner(&r, e, 1) + corner(&r, e, 2)) / 3;
	}
	assert_near(after / before, 1, 5e-4);
	interp_reconstruction_free(&r);
	grid_solution_free(&s);
	model_free(&m);
}

static void test_threads(void **state)
{
	enum { N = 40 };
	struct model m;
	struct solution s;
	struct reconstruction a, b;
	(void)state;

	grid_new(&m, 1, N, 1, 3);
	grid_quad(&m, N, 0, origin, x1, y1);
	grid_end(&m);
	grid_solution(&m, 0, &s);
	for (size_t i = 0; i < 6 * m.element.n; i++)
		s.irradiance.indirect[i] = (double)(rng_mix(i) % 1000);
	run(&m, &s, 1, &a);
	run(&m, &s, 3, &b);
	assert_memory_equal(a.corner, b.corner, 18 * m.element.n * sizeof *a.corner);
	interp_reconstruction_free(&a);
	interp_reconstruction_free(&b);
	grid_solution_free(&s);
	model_free(&m);
}

/* A fan of many slivers and a degenerate element: finite, bounded, quick. */
static void test_fan(void **state)
{
	enum { N = 64, SPOKES = 2 * N * N - 1 };
	struct model m;
	struct solution s;
	struct reconstruction r;
	(void)state;

	grid_new(&m, 1, N, 1, 1);
	free(m.vertex);
	m.vertex = calloc(SPOKES + 1, 3 * sizeof *m.vertex);
	m.vertices = SPOKES + 1;
	for (uint32_t i = 1; i <= SPOKES; i++) {
		double a = 2 * acos(-1) * i / SPOKES;
		m.vertex[3 * i] = cos(a);
		m.vertex[3 * i + 1] = sin(a);
		grid_triangle(&m, 0, i, i % SPOKES + 1);
	}
	grid_triangle(&m, 1, 1, 2);
	m.surface.n = m.patch.n = 1;
	m.patch.start[1] = (uint32_t)m.element.n;
	grid_end(&m);
	grid_solution(&m, 3, &s);
	run(&m, &s, 1, &r);
	for (size_t i = 0; i < 6 * m.element.n; i++) {
		given("i %zu", i);
		assert_near((double)r.corner[i], 3, 1e-6);
	}
	interp_reconstruction_free(&r);
	grid_solution_free(&s);
	model_free(&m);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_constant), cmocka_unit_test(test_linear),
		cmocka_unit_test(test_linear_irregular), cmocka_unit_test(test_never_negative),
		cmocka_unit_test(test_crease), cmocka_unit_test(test_surfaces_and_rooms),
		cmocka_unit_test(test_noise), cmocka_unit_test(test_mean),
		cmocka_unit_test(test_threads),
		cmocka_unit_test(test_fan)
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
