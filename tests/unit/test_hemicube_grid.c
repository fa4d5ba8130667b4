

#include <math.h>
#include <string.h>

#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/hemicube/hemicube.h"
#include "tests/unit/fixtures/check.h"

static void delta_factors_sum_to_one(void **state)
{
	static const int n[] = { 2, 10, 64, 256, 254 };
	struct err e = { 0 };

	(void)state;
	for (size_t k = 0; k < sizeof n / sizeof *n; k++) {
		given("n %d", n[k]);
		struct hemicube_grid g;
		long double sum = 0, angle = 0, cosines = 0;
		assert_int_equal(ff_hemicube_grid_init(&g, n[k], &e), 0);
		assert_int_equal(g.pixels, 3 * n[k] * n[k]);
		for (size_t i = 0; i < g.pixels; i++) {
			sum += g.delta[i];
			angle += g.solid_angle[i];
			cosines += g.solid_angle[i] * g.direction[3 * i + 2];
			assert_that(g.delta[i], >, 0);
			assert_that(g.solid_angle[i], >, 0);
		}
		assert_that(fabsl(sum - 1), <, 1e-15L);
		assert_that(fabsl(angle - 2 * acosl(-1)), <, 1e-14L);
		assert_that(fabsl(cosines / acosl(-1) - 1), <, 1.L / (n[k] * n[k]));
		ff_hemicube_grid_free(&g);
	}
}

/* Against Gauss-Legendre quadrature of cos(theta) dw / pi over single pixels. */
static void delta_factors_are_integrals(void **state)
{
	static const double at[3] = { -.7745966692414834, 0, .7745966692414834 };
	static const double weight[3] = { 5. / 9, 8. / 9, 5. / 9 };
	struct hemicube_grid g;
	struct err e = { 0 };
	int n = 64;

	(void)state;
	assert_int_equal(ff_hemicube_grid_init(&g, n, &e), 0);
	for (size_t i = 0; i < g.pixels; i += 7) {
		given("i %zu", i);
		size_t top = (size_t)(n * n), side = i >= top;
		size_t in = side ? (i - top) % (top / 2) : i;
		int column = (int)(in % (size_t)n), row = (int)(in / (size_t)n);
		double sum = 0, angle = 0;
		for (int a = 0; a < 9; a++) {
			double u = (2 * column + 1 - n + at[a % 3]) / n;
			double v = (2 * row + 1 - (side ? 0 : n) + at[a / 3]) / n;
			double s = 1 + u * u + v * v, w = weight[a % 3] * weight[a / 3] / (n * n);
			sum += w * (side ? v : 1) / (s * s) / acos(-1);
			angle += w / (s * sqrt(s));
		}
		assert_near(g.delta[i] / sum, 1, 1e-7);
		assert_near(g.solid_angle[i] / angle, 1, 1e-7);
	}
	ff_hemicube_grid_free(&g);
}

static void lookup_inverts_direction(void **state)
{
	static const int n[] = { 2, 14, 64, 128 };
	struct err e = { 0 };

	(void)state;
	for (size_t k = 0; k < sizeof n / sizeof *n; k++) {
		given("n %d", n[k]);
		struct hemicube_grid g;
		struct rng r = rng_seed(1, k);
		assert_int_equal(ff_hemicube_grid_init(&g, n[k], &e), 0);
		for (size_t i = 0; i < g.pixels; i++)
			assert_int_equal(ff_hemicube_lookup(&g, &g.direction[3 * i]), i);
		for (int i = 0; i < 10000; i++) {
			double d[3] = { rng_uniform(&r) - .5, rng_uniform(&r) - .5, rng_uniform(&r) };
			size_t p = ff_hemicube_lookup(&g, d);
			assert_that(p, <, g.pixels);
			v3_normalise(d);
			assert_that(v3_dot(d, &g.direction[3 * p]), >, cos(1.5 / n[k]));
		}
		const double edge[][3] = { { 1, 1, 1 }, { -1, -1, -1 }, { 1, 0, 0 }, { 0, -1, 0 },
			{ -1, 1, 0 }, { 0, 0, 1 }, { 1, -1, 1 }, { 0, 1, -2 } };
		for (size_t i = 0; i < sizeof edge / sizeof *edge; i++)
			assert_that(ff_hemicube_lookup(&g, edge[i]), <, g.pixels);
		ff_hemicube_grid_free(&g);
	}
}

static void odd_resolution_is_refused(void **state)
{
	struct hemicube_grid g;
	static const int n[] = { -2, 0, 1, 7, HEMICUBE_N_MAX + 2 };

	(void)state;
	for (size_t i = 0; i < sizeof n / sizeof *n; i++) {
		given("n %d", n[i]);
		struct err e = { 0 };
		assert_int_equal(ff_hemicube_grid_init(&g, n[i], &e), -1);
		assert_non_null(strstr(e.text, "even"));
	}
	ff_hemicube_grid_free(&g);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(delta_factors_sum_to_one),
		cmocka_unit_test(delta_factors_are_integrals),
		cmocka_unit_test(lookup_inverts_direction),
		cmocka_unit_test(odd_resolution_is_refused),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
