/* Directions within a triangle: its solid angle, and moments of the samples against it and
 * against Lambert's formula. */
#include <math.h>

#include "lib/base/constants.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/geometry/solid_angle.h"
#include "tests/unit/fixtures/check.h"

/* Near and wide, far and small, a needle, one seen at a slant. */
static const double triangle[][3][3] = {
	{ { 1, 0, .1 }, { -1, 1, .1 }, { -1, -1, .1 } },
	{ { 10, 3, 20 }, { 10.5, 3, 20 }, { 10, 3.5, 20.2 } },
	{ { 1, -1, .5 }, { 1, 1, .5 }, { 1.001, 1, .5 } },
	{ { .1, 0, .01 }, { 1, 0, .02 }, { .5, .7, .5 } },
};
enum { TRIANGLES = sizeof triangle / sizeof *triangle };

/* Integral over the triangle, as x = 0 sees it, of the direction (Lambert: the sum over edges
 * of angle times normal, halved). */
static void mean_of(const double v[3][3], double sum[3])
{
	for (int k = 0; k < 3; k++)
		sum[k] = 0;
	for (int i = 0; i < 3; i++) {
		const double *a = v[i], *b = v[(i + 1) % 3];
		double n[3];
		v3_cross(a, b, n);
		double sine = v3_normalise(n);
		v3_mad(sum, .5 * atan2(sine, v3_dot(a, b)), n, sum);
	}
}

static void octant(void **state)
{
	const double v[] = { 3, 0, 0, 0, 1, 0, 0, 0, 2 }, x[3] = { 0 };
	(void)state;
	assert_near(geo_solid_angle(v, x), PI / 2, 1e-14);
}

static void samples(void **state)
{
	enum { N = 1 << 16 };
	const double x[3] = { 0 };

	(void)state;
	for (int t = 0; t < TRIANGLES; t++) {
		given("t %d", t);
		const double (*v)[3] = triangle[t];
		double angle = geo_solid_angle(v[0], x), sum[3] = { 0 }, want[3], normal[3];
		v3_area(v[0], v[1], v[2], normal);
		for (uint32_t i = 0; i < N; i++) {
			double u[2] = { rng_sobol(i, 0, 1), rng_sobol(i, 1, 1) }, dir[3];
			geo_solid_angle_sample(v[0], x, angle, u, dir);
			assert_near(v3_length(dir), 1, 1e-12);
			/* It is within: on the same side of all planes through edges. */
			for (int k = 0; k < 3; k++) {
				double edge[3];
				v3_cross(v[k], v[(k + 1) % 3], edge);
				double side = v3_dot(edge, v[(k + 2) % 3]);
				double off = v3_dot(edge, dir) / v3_length(edge);
				assert_that(off * side, >=, -1e-9 * fabs(side));
			}
			v3_mad(sum, angle / N, dir, sum);
		}
		mean_of(v, want);
		if (v3_dot(want, v[0]) < 0)
			for (int k = 0; k < 3; k++)
				want[k] = -want[k];
		v3_sub(sum, want, sum);
		assert_that(v3_length(sum), <, 1e-4 * v3_length(want));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(octant),
		cmocka_unit_test(samples),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
