/* Phong lobes: normaliser and albedo against tables, sampling against moments. */
#include <math.h>

#include "lib/base/constants.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/scatter/lobe.h"
#include "lib/scatter/lobe_table.h"
#include "tests/unit/fixtures/check.h"

enum { ANGLES = 9 };
static const double angle[ANGLES] = { 0, 30, 45, 60, 75, 80, 85, 89, 90 };

/* N_k by quadrature to 1e-20. */
static const struct {
	double k, value[ANGLES];
} normaliser[] = {
	{ 0, {
	        6.283185307179586, 5.235987755982989, 4.71238898038469, 4.188790204786391,
	        3.665191429188092, 3.490658503988659, 3.316125578789226, 3.17649923862968,
	        3.141592653589793 } },
	{ 1, {
	        3.141592653589793, 2.93114584997056, 2.681517061334488, 2.356194490192345,
	        1.977348332146499, 1.843562246428738, 1.707700247361999, 1.598210502720313,
	        1.570796326794897 } },
	{ 2, {
	        2.094395102393196, 2.034004386589142, 1.90412966012823, 1.684938536190276,
	        1.388397143062697, 1.277559549104776, 1.163257918818719, 1.070466245110727,
	        1.047197551196598 } },
	{ 5, {
	        1.047197551196598, 1.044357577438983, 1.021109104610824, 0.9387962421860124,
	        0.7665743937907564, 0.6906814355520783, 0.6087314054378604, 0.5407291567080819,
	        0.5235987755982989 } },
	{ 10, {
	        0.5711986642890533, 0.5711617072512457, 0.5692359390537308, 0.5478182945416058,
	        0.4589038295917944, 0.4082711545252911, 0.3492635835136206, 0.2984875729700294,
	        0.2855993321445267 } },
	{ 20, {
	        0.2991993003418851, 0.2991992863674957, 0.2991751459630885, 0.2969376653293713,
	        0.2643319243017254, 0.2351510174217382, 0.195597570112475, 0.1590239396476596,
	        0.1495996501709425 } },
	{ 50, {
	        0.1231997119054821, 0.1231997119054821, 0.1231997117050335, 0.1231912239682487,
	        0.1194236515621896, 0.1100369631155595, 0.09025045920770348, 0.06768053517945903,
	        0.06159985595274104 } },
	{ 100, {
	        0.06220975551662957, 0.06220975551662957, 0.06220975551662956, 0.06220975316535686,
	        0.06195173334707266, 0.05974004578893818, 0.0503478246321034, 0.03542534939340279,
	        0.03110487775831479 } },
	{ 1000, {
	        0.006276908398780806, 0.006276908398780806, 0.006276908398780806, 0.006276908398780806,
	        0.006276908398780806, 0.00627690830094146, 0.006258881384922614, 0.00445378682605599,
	        0.003138454199390403 } },
	{ 10000, {
	        0.0006282557051474439, 0.0006282557051474439, 0.0006282557051474439, 0.0006282557051474439,
	        0.0006282557051474439, 0.0006282557051474439, 0.0006282557051474439, 0.000602838906093854,
	        0.0003141278525737219 } },
};

/* Albedo of the reciprocal lobe by quadrature, good to 1e-4 (its columns 0 and 90
 * degrees, where the closed forms are (k+1)/(k+2) and 1/2, show how good). */
static const struct {
	double k, value[ANGLES];
} albedo[] = {
	{ 1, {
	        0.6666673422120746, 0.6609256886309922, 0.6347956696102152, 0.5932688809207386,
	        0.5473566164835844, 0.5316489273361774, 0.5158454717108011, 0.5031579788173975,
	        0.5000000720906479 } },
	{ 5, {
	        0.8571485530452707, 0.8293897899765693, 0.7785675693098943, 0.7049671320060282,
	        0.6095090170892472, 0.5739553699801859, 0.5372682323936048, 0.5074661331947581,
	        0.5000002396161111 } },
	{ 10, {
	        0.916673153956887, 0.886660009257596, 0.8421852594631883, 0.769528878685327,
	        0.6535679622770176, 0.6052188023378959, 0.5535077180420401, 0.510755341418888,
	        0.5000004670188534 } },
	{ 50, {
	        0.9807720354978026, 0.95790071580984, 0.9349278036594694, 0.8947959365088056,
	        0.7910360184569077, 0.7185037157196759, 0.618812706364739, 0.5244641990802755,
	        0.5000023897172768 } },
	{ 100, {
	        0.9901976356624308, 0.9720964449387844, 0.9555497414336619, 0.9267660423680943,
	        0.8484837562039357, 0.7806339883804007, 0.6635014213220861, 0.5346395194108273,
	        0.5000048333772801 } },
	{ 1000, {
	        0.9990021674272759, 0.9922185653604266, 0.9868968258945195, 0.9776753139873071,
	        0.9524776883097716, 0.9280446971765504, 0.8557962029610277, 0.607356065402244,
	        0.5000470502834263 } },
};

#define COUNT(a) (sizeof(a) / sizeof *(a))

/* cos of degrees, exact at 90 */
static double cosine(double degrees)
{
	return degrees == 90 ? 0 : cos(degrees * PI / 180);
}

static void test_normaliser_table(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(normaliser); i++)
		for (int j = 0; j < ANGLES; j++) {
			given("k %g, %g degrees", normaliser[i].k, angle[j]);
			assert_close(bsdf_lobe_normaliser(normaliser[i].k, cosine(angle[j])),
			             normaliser[i].value[j], 1e-12);
		}
}

/* Integral of sin^k over [lo, hi] by the double-exponential rule. */
static long double sine_power(long double k, long double lo, long double hi)
{
	const int half = 400;
	long double sum = 0, half_pi = acosl(0);

	for (int i = -half; i <= half; i++) {
		long double t = 4.0L * (long double)i / (long double)half;
		long double q = half_pi * sinhl(t);
		long double x = lo + (hi - lo) / (1 + expl(-2 * q));
		sum += half_pi * coshl(t) / (coshl(q) * coshl(q)) * expl(k * logl(sinl(x)));
	}
	return sum * 4.0L / (long double)half * (hi - lo) / 2;
}

/* N by the integral of dN/dtheta, over the part of [0, 90] degrees where
 * sin^k is not negligible. */
static double slow_normaliser(double k, double cos_theta)
{
	long double half_pi = acosl(0), theta = acosl(cos_theta);
	long double from = fmaxl(0, half_pi - 12 / sqrtl((long double)k + 1));
	long double start = fmaxl(0, fminl(theta, half_pi) - 12 / sqrtl((long double)k + 1));
	long double below = sine_power(k, start, theta);
	long double above = sine_power(k, fmaxl(from, theta), half_pi);

	return (double)(2 * half_pi * 2 / ((long double)k + 1) *
	                (1 - below / (below + above) / 2));
}

static void test_normaliser_any_exponent(void **state)
{
	(void)state;
	for (double l = -3; l <= 8; l += .37)
		for (int i = 1; i <= 40; i++) {
			given("l %g, i %d", l, i);
			double k = pow(10, l), c = i <= 20 ? cos(i * PI / 42) : pow(10, -.4 * (i - 20));
			assert_close(bsdf_lobe_normaliser(k, c), slow_normaliser(k, c), 1e-12);
		}
	for (double k = 0; k <= 1e8; k = 3 * k + .1) {
		given("k %g", k);
		assert_close(bsdf_lobe_normaliser(k, 1), 2 * PI / (k + 1), 1e-14);
		assert_close(bsdf_lobe_normaliser(k, 0), PI / (k + 1), 1e-14);
	}
}

static void test_table(void **state)
{
	(void)state;
	for (double k = 0; k <= 1e8; k = 2 * k + .7) {
		given("k %g", k);
		struct lobe_table t;
		bsdf_lobe_table_make(&t, k);
		for (int i = 0; i <= 1000; i++) {
			double c = fmin(1, i * .008 / sqrt(k + 1));
			assert_close(bsdf_lobe_table_normaliser(&t, c), bsdf_lobe_normaliser(k, c), 1e-5);
		}
	}
}

static void test_power(void **state)
{
	(void)state;
	assert_that(bsdf_lobe_power(0, 1e-300), ==, 1);
	assert_that(bsdf_lobe_power(0, 0), ==, 0);
	assert_that(bsdf_lobe_power(2.5, -.5), ==, 0);
	assert_that(bsdf_lobe_power(2.5, 0), ==, 0);
	assert_that(bsdf_lobe_power(1e8, 1), ==, 1);
	assert_that(bsdf_lobe_power(3, 1 + 1e-15), ==, 1);
	assert_that(bsdf_lobe_power(1e8, .5), ==, 0);
	assert_close(bsdf_lobe_power(2.5, .3), pow(.3, 2.5), 1e-14);
}

static void test_albedo_table(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(albedo); i++)
		for (int j = 0; j < ANGLES; j++) {
			given("k %g, %g degrees", albedo[i].k, angle[j]);
			assert_close(bsdf_lobe_albedo(albedo[i].k, cosine(angle[j])),
			             albedo[i].value[j], 1e-4);
		}
}

/* The albedo integral in coordinates about the normal, by the midpoint rule with
 * cells cut at theta_o = theta_i, where min(1, cos_o / cos_i) has its kink. */
static double slow_albedo(double k, double theta)
{
	enum { CELLS = 700, TURN = 700 };
	double sum = 0, c = cos(theta), s = sin(theta);

	for (int piece = 0; piece < 2; piece++) {
		double lo = piece ? theta : 0, step = ((piece ? PI / 2 : theta) - lo) / CELLS;
		for (int i = 0; i < CELLS; i++) {
			double t = lo + (i + .5) * step, ring = 0;
			for (int j = 0; j < TURN; j++) {
				double phi = (j + .5) * PI / TURN;
				ring += bsdf_lobe_power(k, c * cos(t) + s * sin(t) * cos(phi));
			}
			sum += ring * fmin(1, cos(t) / c) * sin(t) * step;
		}
	}
	return sum * 2 * (PI / TURN) * (k + 1) / (2 * PI);
}

static void test_albedo(void **state)
{
	static const double k[] = { 2.5, 10, 100 }, theta[] = { 20, 55, 80 };

	(void)state;
	for (size_t i = 0; i < COUNT(k); i++)
		for (size_t j = 0; j < COUNT(theta); j++) {
			given("k %g, %g degrees", k[i], theta[j]);
			assert_close(bsdf_lobe_albedo(k[i], cosine(theta[j])),
			             slow_albedo(k[i], theta[j] * PI / 180), 1e-6);
		}
	for (double x = 0; x <= 1e6; x = 3 * x + .3) {
		given("x %g", x);
		assert_close(bsdf_lobe_albedo(x, 1), (x + 1) / (x + 2), 1e-6);
		assert_close(bsdf_lobe_albedo(x, 0), .5, 1e-6);
	}
}

/* cos^(k+1) gamma of whole-lobe samples is uniform: its mean and that of its
 * square within 5 standard errors (99.99 % over the 12 values). */
static void test_sample_whole(void **state)
{
	enum { N = 20000 };
	static const double k[] = { 0, .5, 1, 10, 1000, 1e6 };
	double axis[3] = { .3, -.5, .7 };

	(void)state;
	v3_normalise(axis);
	for (size_t i = 0; i < COUNT(k); i++) {
		given("k %g", k[i]);
		struct rng r = rng_seed(7, i);
		double mean = 0, square = 0;
		for (int s = 0; s < N; s++) {
			double u[2] = { rng_uniform(&r), rng_uniform(&r) }, w[3];
			bsdf_lobe_sample_whole(k[i], axis, u, w);
			assert_near(v3_dot(w, w), 1, 1e-14);
			double x = bsdf_lobe_power(k[i] + 1, v3_dot(axis, w));
			mean += x / N;
			square += x * x / N;
		}
		assert_near(mean, 1. / 2, 5 * sqrt(1. / 12 / N));
		assert_near(square, 1. / 3, 5 * sqrt(4. / 45 / N));
	}
}

static void test_sample_clipped(void **state)
{
	static const double n[3] = { 0, 0, 1 };

	(void)state;
	for (int deg = 0; deg <= 90; deg += 10)
		for (int s = 0; s < 2000; s++) {
			given("deg %d, s %d", deg, s);
			double axis[3] = { sin(deg * PI / 180), 0, cosine(deg) }, w[3], again[3];
			double u[2] = { rng_sobol((uint32_t)s, 0, 1), rng_sobol((uint32_t)s, 1, 1) };
			bsdf_lobe_sample(deg * deg, axis, n, u, w);
			bsdf_lobe_sample(deg * deg, axis, n, u, again);
			assert_that(w[2], >, 0);
			assert_that(v3_dot(axis, w), >, 0);
			assert_memory_equal(w, again, sizeof w);
		}
	/* the ends of the unit square, and an axis that rounding put below */
	double low[3] = { 1, 0, -1e-17 }, w[3], u[2] = { 0, 0 };
	for (int i = 0; i < 4; i++) {
		given("i %d", i);
		u[0] = i & 1 ? 1 - 0x1p-53 : 0;
		u[1] = i & 2 ? 1 - 0x1p-53 : 0;
		bsdf_lobe_sample(1e8, low, n, u, w);
		assert_true(isfinite(w[0] + w[1] + w[2]));
		assert_that(w[2], >=, 0);
		bsdf_sample_cosine(n, u, w);
		assert_true(isfinite(w[0] + w[1] + w[2]));
		assert_that(w[2], >, 0);
	}
}

static void test_mirror(void **state)
{
	static const double n[3] = { 0, 0, 1 }, l[3] = { .6, 0, .8 };
	double r[3];

	(void)state;
	bsdf_lobe_mirror(l, n, r);
	assert_that(fabs(r[0] + .6), <, 1e-15);
	assert_that(r[1], ==, 0);
	assert_near(r[2], .8, 1e-15);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_normaliser_table),
		slow_unit_test(test_normaliser_any_exponent), cmocka_unit_test(test_table),
		cmocka_unit_test(test_power),
		cmocka_unit_test(test_albedo_table),
		cmocka_unit_test(test_albedo),
		cmocka_unit_test(test_sample_whole),
		cmocka_unit_test(test_sample_clipped),
		cmocka_unit_test(test_mirror),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
