/* The element lookup of form-factor rays, against the split trees; samples of rays. */
#include "lib/ray/locate.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/shapes.h"

/* Every random point is found in the element that the tree gives, or, within float32
 * rounding of an edge, in one that touches the point. */
static void agree(struct model *m, double patch, double element)
{
	struct locator l;
	struct err e = { 0 };
	struct rng r = rng_seed(1, 2);
	size_t other = 0, tries = 20000;

	struct mesh_report report = run(m, sizes(patch, element, 1));
	mesh_report_free(&report);
	assert_int_equal(ray_locator_init(&l, m, &e), 0);
	for (size_t i = 0; i < tries; i++) {
		uint32_t t = (uint32_t)(rng_next(&r) % m->triangle.n);
		double a = sqrt(rng_uniform(&r)), b = rng_uniform(&r);
		double w[3] = { 1 - a, a * (1 - b), a * b }, tree[3] = { w[0], w[1], w[2] };
		uint32_t found = ray_locate(&l, t, (float)w[1], (float)w[2]);
		assert_int_equal(m->element.triangle[found], t);
		other += found != model_locate(m, t, tree);
	}
	assert_that(other, <, tries / 1000);
	ray_locator_free(&l);
	model_free(m);
}

static void square(void **state)
{
	struct model m;

	(void)state;
	make_square(&m);
	agree(&m, .2, .01);
}

static void sphere(void **state)
{
	struct model m;

	(void)state;
	make_sphere(&m, 2);
	agree(&m, .3, .03);
}

static void undivided(void **state)
{
	struct model m;

	(void)state;
	make_cube(&m);
	agree(&m, 10, 10);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(square),
		cmocka_unit_test(sphere),
		cmocka_unit_test(undivided),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
