/* Patches that are not evenly lit: solutions of large patches against those of small ones, with the same
 * elements. */
#include "lib/data/landing.h"
#include "lib/data/solution.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/shapes.h"
#include "tests/unit/fixtures/solved.h"

enum { LAMP = 6, PANEL = 7, SURFACES };

enum kind { PLAIN, TRANSLUCENT, MIRROR, PANE, GLOSSY, KINDS };

/* A room of side 1 whose lamp shines at a wall a tenth away; a panel in its middle, which is what
 * `kind` says. */
static void make(struct model *m, enum kind kind, double patch)
{
	struct mesh_options o = sizes(patch, .1, 0);

	begin(m, SURFACES, 1);
	add_room(m);
	add_rectangle(m, (double[]){ .1, .2, .6 }, (double[]){ 0, 0, .2 }, (double[]){ 0, .6, 0 }, LAMP);
	add_rectangle(m, (double[]){ .5, .1, .1 }, (double[]){ 0, .8, 0 }, (double[]){ 0, 0, .5 }, PANEL);
	m->material.emission[2 * LAMP] = 1;
	m->material.one_sided[PANEL] = 0;
	for (int side = 0; side < 2; side++) {
		size_t at = 2 * PANEL + (size_t)side;
		m->material.rho_d[at] = .2;
		m->material.tau_d[at] = kind == TRANSLUCENT ? .6 : 0;
		m->material.rho_s[at] = kind == MIRROR || kind == GLOSSY ? .7 : 0;
		m->material.tau_s[at] = kind == PANE ? .7 : 0;
		if (kind == GLOSSY)
			m->material.alpha[at] = 20;
	}
	struct mesh_report r = run(m, o);
	mesh_report_free(&r);
}

static struct ff_options options(void)
{
	struct ff_options o = FF_OPTIONS_DEFAULT;
	struct err e = { 0 };

	o.method = FF_RAYS;
	o.threads = 2;
	o.rays = 512;
	o.gather = 256;
	assert_int_equal(ff_options_complete(&o, &e), 0);
	return o;
}

/* Mean irradiance of the sides of surfaces, with what is uneven put right or not. */
static void solve(enum kind kind, double patch, int put_right, double mean[2 * SURFACES],
                  struct solved *x, struct model *m)
{
	struct ff_options o = options();
	const struct radiosity_options how = { 1e-5, UINT64_MAX, 2 };
	double area[SURFACES] = { 0 };

	make(m, kind, patch);
	solved_begin(x, m, &o, 0);
	if (put_right)
		assert_int_equal(radiosity_solve(&x->s, &x->t, &how, NULL, &x->r, &x->e), 0);
	else
		solved_finish(x, 1e-5);
	memset(mean, 0, 2 * SURFACES * sizeof *mean);
	for (uint32_t i = 0; i < m->element.n; i++) {
		uint32_t surface = m->patch.surface[m->element.patch[i]];
		area[surface] += m->element.area[i];
		for (uint32_t side = 0; side < 2; side++)
			mean[2 * surface + side] += m->element.area[i] *
			                            solution_irradiance(&x->s, 2 * i + side, 0);
	}
	for (int s = 0; s < 2 * SURFACES; s++)
		mean[s] /= area[s / 2];
}

/* The largest difference of two means, over the mean of all. */
static double off(const double *a, const double *b)
{
	double most = 0, all = 0;

	for (int s = 0; s < 2 * SURFACES; s++) {
		most = fmax(most, fabs(a[s] - b[s]));
		all += b[s] / (2 * SURFACES - LAMP);
	}
	return most / all;
}

static void finish(struct solved *x, struct model *m)
{
	solved_free(x);
	model_free(m);
}

static void check_kind(enum kind kind)
{
	double truth[2 * SURFACES], as_even[2 * SURFACES], got[2 * SURFACES];
	struct solved x;
	struct model m;
	given("kind %d", (int)kind);

	solve(kind, .1, 1, truth, &x, &m);
	finish(&x, &m);
	solve(kind, 1, 0, as_even, &x, &m);
	finish(&x, &m);
	solve(kind, 1, 1, got, &x, &m);
	printf("# kind %d: %.4f as if even, %.4f put right\n", (int)kind, off(as_even, truth),
	       off(got, truth));
	assert_that(off(as_even, truth), >, .05);
	assert_that(off(got, truth), <, .02);
	assert_that(x.r.residual, <, 1e-12);
	finish(&x, &m);
}

static void test_surfaces(void **state)
{
	(void)state;
	for (enum kind kind = PLAIN; kind < KINDS; kind++)
		check_kind(kind);
}

/* Whoever resumes a solution that is done changes no more than what was left to put right. */
static void test_resumed(void **state)
{
	const struct radiosity_options how = { 1e-6, UINT64_MAX, 2 };
	double mean[2 * SURFACES];
	struct solved x;
	struct model m;

	(void)state;
	solve(PLAIN, 1, 1, mean, &x, &m);
	assert_int_equal(radiosity_solve(&x.s, &x.t, &how, NULL, &x.r, &x.e), 0);
	double before = solution_irradiance(&x.s, 0, 0);
	assert_int_equal(radiosity_solve(&x.s, &x.t, &how, NULL, &x.r, &x.e), 0);
	assert_close(solution_irradiance(&x.s, 0, 0), before, .01);
	assert_that(x.r.residual, <, 1e-12);
	finish(&x, &m);
}

/* Places have the same area, and their means that of the triangle. */
static void test_landing(void **state)
{
	struct rng random = rng_seed(1, 0);
	double mean[2] = { 0 };
	int count[LANDING_PLACES] = { 0 };
	enum { POINTS = 160000 };

	(void)state;
	for (uint32_t p = 0; p < LANDING_PLACES; p++) {
		double w[2];
		landing_weights(p, w);
		assert_int_equal(landing_at(77, w[0], w[1]), 77 * LANDING_PLACES + p);
		for (int k = 0; k < 2; k++)
			mean[k] += w[k] / LANDING_PLACES;
	}
	assert_near(mean[0], 1. / 3, 1e-15);
	assert_near(mean[1], 1. / 3, 1e-15);
	for (int i = 0; i < POINTS; i++) {
		double r = sqrt(rng_uniform(&random)), s = rng_uniform(&random);
		uint32_t at = landing_at(5, r * (1 - s), r * s);
		assert_int_equal(landing_side(at), 5);
		count[at % LANDING_PLACES]++;
	}
	for (int p = 0; p < LANDING_PLACES; p++) /* five standard deviations */
		assert_near(count[p], POINTS / LANDING_PLACES, 5 * sqrt(POINTS / LANDING_PLACES));
	assert_int_equal(landing_side(landing_at(9, 0, 0)), 9);
	assert_int_equal(landing_side(landing_at(9, 0, 1 + 1e-9)), 9);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		slow_unit_test(test_surfaces), cmocka_unit_test(test_resumed), cmocka_unit_test(test_landing),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
