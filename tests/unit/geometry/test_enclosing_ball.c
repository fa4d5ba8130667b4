/* The smallest ball about points: known ones, and what must hold for points at random. */
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/geometry/enclosing_ball.h"
#include "tests/unit/fixtures/check.h"

static double reach(const struct ball *b, const double *x, size_t n)
{
	double most = 0, d[3];

	for (size_t i = 0; i < n; i++) {
		v3_sub(x + 3 * i, b->centre, d);
		most = fmax(most, v3_length(d));
	}
	return most;
}

static void test_known(void **state)
{
	const double box[][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 2, 0 }, { 1, 2, 0 },
	                          { 0, 0, 3 }, { 1, 0, 3 }, { 0, 2, 3 }, { 1, 2, 3 } };
	const double triangle[][3] = { { 0, 0, 0 }, { 4, 0, 0 }, { 2, 2 * sqrt(3), 0 }, { 2, 1, 0 } };
	const double obtuse[][3] = { { 0, 0, 0 }, { 4, 0, 0 }, { 2, .5, 0 } };
	const double point[][3] = { { 7, 8, 9 }, { 7, 8, 9 } };

	(void)state;
	assert_close(geo_enclosing_ball(box[0], 8).radius, sqrt(14) / 2, 1e-14);
	assert_close(geo_enclosing_ball(triangle[0], 4).radius, 4 / sqrt(3), 1e-14);
	assert_close(geo_enclosing_ball(obtuse[0], 3).radius, 2, 1e-14);
	assert_that(geo_enclosing_ball(point[0], 2).radius, ==, 0);
	assert_that(geo_enclosing_ball(point[0], 2).centre[1], ==, 8);
}

/* Holds all, and is the same for points in another order, of any size, and turned. */
static void test_random(void **state)
{
	struct rng random = rng_seed(5, 0);

	(void)state;
	for (int trial = 0; trial < 200; trial++) {
		enum { N = 40 };
		double x[3 * N], y[3 * N];
		const double flat = trial % 3 ? 1 : 0, scale = trial % 2 ? 1e-170 : 1e150;
		const double c = cos(.3 + trial), s = sin(.3 + trial);
		given("trial %d", trial);
		for (int i = 0; i < 3 * N; i++)
			x[i] = rng_uniform(&random) * (i % 3 == 2 ? flat : 1);
		for (int i = 0; i < N; i++) {
			const double *from = &x[3 * (N - 1 - i)];
			y[3 * i] = scale * (c * from[0] + s * from[1]);
			y[3 * i + 1] = scale * (c * from[1] - s * from[0]);
			y[3 * i + 2] = scale * from[2];
		}
		struct ball a = geo_enclosing_ball(x, N), b = geo_enclosing_ball(y, N);
		assert_close(reach(&a, x, N), a.radius, 1e-9);
		assert_close(b.radius / scale, a.radius, 1e-9);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_known), cmocka_unit_test(test_random)
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
