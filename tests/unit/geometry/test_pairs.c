/* Form factors of random polygons with things between, at several tolerances: none is off by more
 * than it states, or was asked for. */
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/random_pairs.h"

enum { PAIRS = 32 };

static struct brute brute;
static struct exchanger exchanger;

static void check_pair(struct random_pair *p, double target)
{
	struct exchange_options o = { .relative = 1e-9, .absolute = target, .most = 50000,
	                              .occluders = SHAFT_OCCLUDERS };
	struct err e = { 0 };
	double off, back;

	occ_exchanger_init(&exchanger, &o, &p->bodies, NULL, p->centre);
	double got = occ_exchange(&exchanger, &p->s, p->f, &p->s, p->g, &off, &e);
	assert_that(fabs(got - p->truth), <=, fmax(off, target * p->least) + 2 * p->doubt);
	assert_that(off, <=, target * p->least + 1e-8 * got);
	got -= occ_exchange(&exchanger, &p->s, p->g, &p->s, p->f, &back, &e);
	assert_that(fabs(got), <=, off + back);
	occ_exchanger_free(&exchanger);
}

static void test_stated(void **state)
{
	(void)state;
	for (uint64_t seed = 0; seed < PAIRS; seed++) {
		struct random_pair p;
		assert_int_equal(random_pair_init(&p, seed, &brute, 1e-5), 0);
		for (double target = 1e-3; target > 5e-6; target /= 10) {
			given("pair %d, target %g", (int)seed, target);
			check_pair(&p, target);
		}
		random_pair_free(&p);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = { cmocka_unit_test(test_stated) };

	return cmocka_run_group_tests(tests, NULL, NULL);
}
