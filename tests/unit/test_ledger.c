/* The ledger and convergence where light is hardly absorbed or not at all, and where it is
 * hardly there. */
#include <math.h>

#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/grid.h"
#include "tests/unit/fixtures/solved.h"

static const double zero[3] = { 0, 0, 0 };

static const struct ff_options rays = { .method = FF_RAYS, .rays = 256, .points = 1,
	.emitter_gain = 1, .lobe_rays = 256, .depth = 256, .seed = 1, .shard = 1, .shards = 1,
	.threads = 2 };

/* Coefficients of light on a side, in each band: rho_d, tau_d, rho_s, tau_s. */
static void set_side(struct model *m, size_t material, int side, const double c[4])
{
	struct materials *mt = &m->material;
	double *to[] = { mt->rho_d, mt->tau_d, mt->rho_s, mt->tau_s };

	for (int k = 0; k < 4; k++)
		for (int b = 0; b < mt->bands; b++)
			to[k][model_material_at(mt, material, side) + (size_t)b] = c[k];
}

static void set_emission(struct model *m, size_t material, double x)
{
	for (int b = 0; b < m->bands; b++)
		m->material.emission[model_material_at(&m->material, material, FRONT) + (size_t)b] = x;
}

enum { CELLS = 4 };

/* A parallelogram as CELLS x CELLS patches. */
static void add_wall(struct model *m, uint32_t material, const double o[3], const double x[3],
                     const double y[3])
{
	for (int i = 0; i < CELLS; i++)
		for (int j = 0; j < CELLS; j++) {
			double at[3], u[3], v[3];
			for (int k = 0; k < 3; k++) {
				at[k] = o[k] + (x[k] * i + y[k] * j) / CELLS;
				u[k] = x[k] / CELLS;
				v[k] = y[k] / CELLS;
			}
			grid_quad(m, 1, material, at, u, v);
		}
}

/* A cube with walls of material 0, one-sided, which emit, or whose ceiling emits if there is
 * one: not if it is open. Across it a sheet of material 2, with lobes of this exponent. */
static void room(struct model *m, int open, const double wall[4], const double sheet[4],
                 double exponent, int bands)
{
	const double x[3] = { 1, 0, 0 }, y[3] = { 0, 1, 0 }, z[3] = { 0, 0, 1 };
	const double at[3] = { 0, 0, .5 }, deep[3] = { 0, .7, 0 };

	grid_new(m, 7 * CELLS * CELLS, 1, 3, bands);
	add_wall(m, 0, zero, x, y);
	add_wall(m, 0, zero, y, z);
	add_wall(m, 0, zero, z, x);
	add_wall(m, 0, x, z, y);
	add_wall(m, 0, y, x, z);
	if (!open)
		add_wall(m, 1, z, y, x);
	for (size_t k = 0; k < 2; k++) {
		m->material.one_sided[k] = 1;
		set_side(m, k, FRONT, wall);
	}
	set_emission(m, open ? 0 : 1, 1);
	for (int side = 0; side < 2; side++) {
		set_side(m, 2, side, sheet);
		m->material.alpha[4 + side] = m->material.beta[4 + side] = exponent;
	}
	add_wall(m, 2, at, x, deep);
	for (size_t k = 0; k < 3; k++)
		m->material.name[k] = strdup("material");
	grid_end(m);
}

/* Solves; the ledger balances after every step, in few passes. The bound goes to *bound. */
static void assert_balanced(const struct model *m, int groups, double stop, double *bound)
{
	struct solved x;

	solved_begin(&x, m, &rays, groups);
	solved_finish(&x, stop);
	if (x.r.residual > 1e-13 || x.r.passes > 40)
		print_error("residual %g, %g passes\n", x.r.residual, x.r.passes);
	assert_that(x.r.residual, <=, 1e-13);
	assert_that(x.r.passes, <=, 40);
	assert_that(x.r.unshot, <=, stop);
	if (bound)
		*bound = x.r.bound;
	solved_free(&x);
}

static void rooms(double albedo, const double part[4], double exponent, int bands)
{
	double wall[4] = { albedo, 0, 0, 0 }, sheet[4];
	struct model m;

	for (int k = 0; k < 4; k++)
		sheet[k] = albedo * part[k];
	for (int open = albedo < 1 ? 0 : 1; open < 2; open++) {
		room(&m, open, wall, sheet, exponent, bands);
		assert_balanced(&m, 0, 1e-6, NULL);
		if (!open) {
			set_emission(&m, 0, .01);
			assert_balanced(&m, 1, 1e-6, NULL);
		}
		model_free(&m);
	}
}

/* Opaque, translucent, all kinds of light, lobes or mirrors and panes alone. */
static void test_albedos(void **state)
{
	static const double albedo[] = { .9, .999, .99999, 1 };
	static const double part[][4] = { { 1, 0, 0, 0 }, { .3, .7, 0, 0 }, { .2, .2, .3, .3 },
		{ 0, 0, .4, .6 } };

	(void)state;
	for (size_t a = 0; a < sizeof albedo / sizeof *albedo; a++)
		for (size_t k = 0; k < sizeof part / sizeof *part; k++) {
			rooms(albedo[a], part[k], 20, 1);
			rooms(albedo[a], part[k], (double)INFINITY, 3);
		}
}

/* A closed room that is white in one band: light of that band has nowhere to go, light of
 * others has, and a bound that the white band is no part of. */
static void test_white_band(void **state)
{
	static const double half[4] = { .5, 0, 0, 0 }, black[4] = { 0 };
	struct model m;
	struct solved x;
	double bound;

	(void)state;
	room(&m, 0, half, black, 1, 2);
	for (size_t k = 0; k < 3; k++)
		for (int side = 0; side < 2; side++)
			m.material.rho_d[model_material_at(&m.material, k, side)] = 1;
	solved_begin(&x, &m, &rays, 0);
	assert_int_equal(solved_shoot(&x, 1e-4), -1);
	assert_non_null(strstr(x.e.text, "no steady state: light in band 0"));
	solved_free(&x);
	m.material.emission[model_material_at(&m.material, 1, FRONT)] = 0;
	assert_balanced(&m, 0, 1e-4, &bound);
	assert_that(bound, <, 4e-4);
	model_free(&m);
}

/* Emission beyond what can be computed with is refused, below it is none. */
static void test_bright_and_dim(void **state)
{
	static const double half[4] = { .5, 0, 0, 0 };
	struct model m;
	struct solved x;

	(void)state;
	room(&m, 0, half, half, 1, 1);
	set_emission(&m, 1, 1e160);
	solved_join(&x, &m, &rays, NULL);
	assert_int_equal(radiosity_begin(&x.s, &m, &x.t, 0, &x.e), -1);
	assert_non_null(strstr(x.e.text, "too large to compute with"));
	solved_free(&x);
	set_emission(&m, 1, 1e-300);
	solved_join(&x, &m, &rays, NULL);
	assert_int_equal(radiosity_begin(&x.s, &m, &x.t, 0, &x.e), -1);
	assert_non_null(strstr(x.e.text, "no emitter"));
	solved_free(&x);
	set_emission(&m, 0, 1);
	assert_balanced(&m, 1, 1e-4, NULL);
	model_free(&m);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		slow_unit_test(test_albedos),
		cmocka_unit_test(test_white_band),
		cmocka_unit_test(test_bright_and_dim),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
