/* Closing rows by least squares, against a symmetric matrix that is known. */
#include <math.h>
#include <stdlib.h>

#include "lib/base/rng.h"
#include "lib/ff_tally/closure.h"
#include "tests/unit/fixtures/check.h"

enum { ROWS = 40, PAIRS = ROWS * (ROWS - 1) / 2 };

/* Pairs with errors of very different size, and what was added to each. */
static size_t make(struct doubt *d, double *wrong, double *missing, struct rng *r)
{
	size_t n = 0;

	for (uint32_t i = 0; i < ROWS; i++)
		for (uint32_t j = i + 1; j < ROWS; j++) {
			double error = pow(10, -6 * rng_uniform(r));
			double sum = 0;
			for (int k = 0; k < 12; k++) /* nearly normal */
				sum += rng_uniform(r) - .5;
			d[n] = (struct doubt){ i, j, error };
			wrong[n] = sum * error;
			missing[i] -= wrong[n];
			missing[j] -= wrong[n];
			n++;
		}
	return n;
}

static double rms(const double *x, const double *y, size_t n)
{
	double sum = 0;

	for (size_t k = 0; k < n; k++)
		sum += (x[k] + (y ? y[k] : 0)) * (x[k] + (y ? y[k] : 0));
	return sqrt(sum / (double)n);
}

static void closes_and_improves(void **state)
{
	static struct doubt d[PAIRS];
	static double wrong[PAIRS], change[PAIRS];
	uint8_t closed[ROWS];
	struct rng r = rng_seed(7, 1);
	struct err e = { 0 };

	(void)state;
	for (int trial = 0; trial < 20; trial++) {
		given("trial %d", trial);
		double missing[ROWS] = { 0 };
		size_t n = make(d, wrong, missing, &r);
		for (int i = 0; i < ROWS; i++)
			closed[i] = 1;
		assert_int_equal(ff_closure(d, n, ROWS, missing, closed, change, &e), 0);
		for (size_t k = 0; k < n; k++) {
			missing[d[k].i] -= change[k];
			missing[d[k].j] -= change[k];
		}
		for (int i = 0; i < ROWS; i++)
			assert_that(fabs(missing[i]), <, 1e-10);
		assert_true(rms(wrong, change, n) < rms(wrong, NULL, n));
	}
}

/* Rows that are not closed are not asked to add up, but their pairs may change. */
static void open_rows(void **state)
{
	static const struct doubt d[] = { { 0, 1, 1e-3 }, { 0, 2, 1e-6 }, { 1, 2, 1e-3 } };
	double missing[] = { 1e-3, 5, 0, 7 }, change[3];
	const uint8_t closed[] = { 1, 0, 0, 1 };
	struct err e = { 0 };

	(void)state;
	assert_int_equal(ff_closure(d, 3, 4, missing, closed, change, &e), 0);
	assert_near(change[0] + change[1], 1e-3, 1e-15);
	assert_that(fabs(change[1]), <, 1e-8);
	assert_that(change[2], ==, 0);
}

static void nothing_in_doubt(void **state)
{
	double missing[] = { 1, 1 };
	const uint8_t closed[] = { 1, 1 };
	struct err e = { 0 };

	(void)state;
	assert_int_equal(ff_closure(NULL, 0, 2, missing, closed, NULL, &e), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = { cmocka_unit_test(closes_and_improves),
	                                    cmocka_unit_test(open_rows),
	                                    cmocka_unit_test(nothing_in_doubt) };

	return cmocka_run_group_tests(tests, NULL, NULL);
}
