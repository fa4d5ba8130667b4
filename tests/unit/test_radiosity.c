/* Form factors and the solver against closed forms, in memory. */
#include <math.h>

#include <unistd.h>

#include "formats/cache/ff_file.h"
#include "lib/base/constants.h"
#include "lib/radiosity/shoot.h"
#include "lib/scatter/bsdf.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/grid.h"
#include "tests/unit/fixtures/solved.h"

static const double zero[3] = { 0, 0, 0 }, one[3] = { 1, 1, 1 };

static const struct ff_options rays = { .method = FF_RAYS, .rays = 4096, .points = 1,
	.emitter_gain = 1, .lobe_rays = 4096, .depth = 256, .seed = 1, .shard = 1, .shards = 1,
	.threads = 2 };
static const struct ff_options cubes = { .method = FF_HEMICUBE, .rays = 64, .points = 16,
	.emitter_gain = 1, .lobe_rays = 4096, .depth = 256, .seed = 1, .shard = 1, .shards = 1,
	.threads = 2 };

static void set_diffuse(struct model *m, size_t material, double rho, double exitance)
{
	struct materials *mt = &m->material;

	mt->one_sided[material] = 1;
	mt->rho_d[model_material_at(mt, material, FRONT)] = rho;
	mt->emission[model_material_at(mt, material, FRONT)] = exitance / PI;
}

/* Solves; h[i] is the area mean of the irradiance of patch-side side[i]. */
static void solve(const struct model *m, const struct ff_options *o, const uint32_t *side,
                  size_t n, double *h)
{
	struct solved x;

	solved_begin(&x, m, o, 0);
	solved_finish(&x, 1e-9);
	assert_that(x.r.residual, <=, 1e-13);
	for (size_t k = 0; k < n; k++)
		h[k] = patch_mean(m, &x.s, side[k], 0);
	solved_free(&x);
}

static void furnace(const struct ff_options *o, double tolerance)
{
	struct model m;
	const uint32_t material[6] = { 0 };
	const uint32_t side[6] = { 0, 2, 4, 6, 8, 10 };
	double h[6];

	grid_new(&m, 6, 4, 1, 1);
	grid_box(&m, 4, material, zero, one);
	set_diffuse(&m, 0, .5, 1);
	grid_end(&m);
	solve(&m, o, side, 6, h);
	for (int k = 0; k < 6; k++)
		assert_near(h[k], 2, tolerance);
	model_free(&m);
}

static void furnace_by_rays(void **state)
{
	(void)state;
	furnace(&rays, .05);
}

static void furnace_by_hemicubes(void **state)
{
	(void)state;
	furnace(&cubes, .05);
}

/* Band k like band 0, but emission k + 1 times. */
static void spread_bands(struct materials *mt)
{
	double *coefficient[] = { mt->rho_d, mt->tau_d, mt->rho_s, mt->tau_s, mt->emission };

	for (size_t c = 0; c < sizeof coefficient / sizeof *coefficient; c++)
		for (size_t side = 0; side < 2 * mt->n; side++)
			for (int k = 1; k < mt->bands; k++) {
				double *x = coefficient[c] + side * (size_t)mt->bands;
				x[k] = x[0] * (coefficient[c] == mt->emission ? k + 1 : 1);
			}
}

/* A mirror-walled box with a sheet of all kinds of material across it. */
static void plates_model(struct model *m, double lobe_exponent, int bands)
{
	const uint32_t material[6] = { 0, 0, 0, 0, 1, 2 };
	const double at[3] = { 0, 0, .5 }, x[3] = { 1, 0, 0 }, y[3] = { 0, 1, 0 };
	struct materials *mt = &m->material;

	grid_new(m, 7, 2, 4, bands);
	grid_box(m, 2, material, zero, one);
	grid_quad(m, 2, 3, at, x, y);
	for (size_t k = 0; k < 3; k++)
		set_diffuse(m, k, k == 0 ? 0 : k == 1 ? .5 : .4, k == 1);
	mt->rho_s[model_material_at(mt, 0, FRONT)] = 1;
	const double front[4] = { .1, .15, .25, .4 }, back[4] = { .2, .1, .25, .4 };
	double *coefficient[4] = { mt->rho_d, mt->tau_d, mt->rho_s, mt->tau_s };
	for (int k = 0; k < 4; k++) {
		coefficient[k][model_material_at(mt, 3, FRONT)] = front[k];
		coefficient[k][model_material_at(mt, 3, BACK)] = back[k];
	}
	for (int s = 0; s < 2; s++)
		mt->alpha[6 + s] = mt->beta[6 + s] = lobe_exponent;
	spread_bands(mt);
	grid_end(m);
}

/* It is a pair of infinite plates: H_ceiling = E / (1 - rho^2). */
static void plates(const struct ff_options *o, double lobe_exponent, double tolerance)
{
	struct model m;

	plates_model(&m, lobe_exponent, 1);
	const double expected[4] = { 1.4063777596075226, .3270645952575634, .8127555192150451,
		.8176614881439084 };
	const uint32_t side[4] = { 2 * 6 + 1, 2 * 6, 2 * 4, 2 * 5 };
	double h[4];
	solve(&m, o, side, 4, h);
	for (int k = 0; k < 4; k++) {
		if (!(fabs(h[k] / expected[k] - 1) < tolerance))
			print_error("exponent %g: %g for %g\n", lobe_exponent, h[k], expected[k]);
		assert_near(h[k] / expected[k], 1, tolerance);
	}
	model_free(&m);
}

static void plates_by_rays(void **state)
{
	(void)state;
	plates(&rays, (double)INFINITY, .01);
	plates(&rays, 1, .01);
	plates(&rays, 10, .01);
}

static void plates_by_hemicubes(void **state)
{
	(void)state;
	plates(&cubes, (double)INFINITY, .01);
	plates(&cubes, 1, .01);
	plates(&cubes, 10, .01);
}

/* Bands are independent, in the same vector or not. */
static void six_bands(void **state)
{
	struct model m;
	struct solved x;

	(void)state;
	plates_model(&m, 10, 6);
	solved_begin(&x, &m, &rays, 0);
	solved_finish(&x, 1e-9);
	for (size_t i = 0; i < 2 * m.element.n; i++)
		for (int k = 1; k < 6; k++) {
			given("i %zu, k %d", i, k);
			double h = (k + 1) * solution_irradiance(&x.s, i, 0);
			double e = (k + 1) * x.s.error.sampling[6 * i];
			assert_near(solution_irradiance(&x.s, i, k), h, 1e-12 * h);
			assert_near(x.s.error.sampling[6 * i + (size_t)k], e, 1e-5 * e);
		}
	solved_free(&x);
	model_free(&m);
}

/* The solution by form factors, which stay with the caller. */
static void solution_of(const struct model *m, const struct ff *f, struct solution *s)
{
	struct solved x;

	solved_join(&x, m, NULL, f);
	assert_int_equal(radiosity_begin(&x.s, m, &x.t, 0, &x.e), 0);
	solved_finish(&x, 1e-9);
	*s = x.s;
	radiosity_transport_free(&x.t);
}

/* Through a file whose receivers are patches or elements. */
static void solve_file(const struct model *m, const struct ff *f, int to_patches,
                       struct solution *s)
{
	char path[] = "/tmp/twopass-radiosity-XXXXXX";
	struct cache_info info = { 0 };
	struct ff_file file;
	struct err e = { 0 };
	int fd = mkstemp(path);

	assert_that(fd, >=, 0);
	close(fd);
	struct ff_writer *w = file_ff_create(path, m, f->value64 != NULL, to_patches, &e);
	if (!w || file_ff_append(w, f, &e) || file_ff_finish(w, f, &info, &e) ||
	    file_ff_open(path, m, NULL, &file, &e))
		fail_msg("%s", e.text);
	solution_of(m, &file.f, s);
	file_ff_close(&file);
	unlink(path);
}

/* Patches as receivers: the same flux for each patch, the same irradiance all over it;
 * and lists, as they are in memory, solve like spans. */
static void patches_as_receivers(const struct ff_options *o, double exponent, double tolerance)
{
	struct model m;
	struct ff f;
	struct ff_stats stats;
	struct solution memory, elements, patches;

	plates_model(&m, exponent, 1);
	for (size_t i = 0; i < m.material.n; i++)
		m.material.name[i] = strdup("material");
	for (size_t i = 0; i < m.surface.n; i++)
		m.surface.name[i] = strdup("surface");
	memory_ff(&m, o, &f, &stats);
	solution_of(&m, &f, &memory);
	solve_file(&m, &f, 0, &elements);
	solve_file(&m, &f, 1, &patches);
	for (size_t i = 0; i < 2 * m.element.n; i++) {
		uint32_t ps = 2 * m.element.patch[i >> 1] + (uint32_t)(i & 1);
		double h = solution_irradiance(&patches, i, 0);
		assert_that(solution_irradiance(&memory, i, 0), ==,
		            solution_irradiance(&elements, i, 0));
		assert_that(memory.error.sampling[i], ==, elements.error.sampling[i]);
		assert_near(h, patch_mean(&m, &elements, ps, 0), tolerance * h);
		assert_that(h, ==,
		            solution_irradiance(&patches, 2 * m.patch.start[ps >> 1] + (i & 1), 0));
	}
	solution_free(&memory);
	solution_free(&elements);
	solution_free(&patches);
	ff_free(&f);
	model_free(&m);
}

static void patches_as_receivers_f32(void **state)
{
	(void)state;
	patches_as_receivers(&rays, 10, 1e-6);
}

static void patches_as_receivers_f64(void **state)
{
	struct ff_options o = cubes;

	(void)state;
	o.f64 = 1;
	patches_as_receivers(&o, (double)INFINITY, 1e-11);
	patches_as_receivers(&o, 1, 1e-11);
}

static void shards_of_two_kinds(void **state)
{
	struct ff a = { .shard = 1, .shards = 2 }, b = { .shard = 2, .shards = 2, .to_patches = 1 };
	const struct ff *shard[] = { &a, &b };
	const char *name[] = { "a.ff", "b.ff" };
	const struct model m = { 0 };
	struct transport t;
	struct err e = { 0 };

	(void)state;
	assert_int_equal(radiosity_transport_init(&t, &m, shard, name, 2, 1, &e), -1);
	assert_non_null(strstr(e.text, "b.ff: receivers are patches, but elements of a.ff"));
	radiosity_transport_free(&t);
}

/* A box whose first three walls have one albedo and emission, the others another. */
static void box_model(struct model *m, const double rho[2], const double exitance[2])
{
	const uint32_t material[6] = { 0, 0, 0, 1, 1, 1 };

	grid_new(m, 6, 4, 2, 1);
	grid_box(m, 4, material, zero, one);
	for (size_t k = 0; k < 2; k++)
		set_diffuse(m, k, rho[k], exitance[k]);
	grid_end(m);
}

static void white_box_has_no_steady_state(void **state)
{
	struct model m;
	struct solved x;

	(void)state;
	box_model(&m, one, one);
	solved_begin(&x, &m, &rays, 0);
	assert_int_equal(solved_shoot(&x, 1e-4), -1);
	assert_non_null(strstr(x.e.text, "no steady state"));
	solved_free(&x);
	model_free(&m);
}

/* A box of albedo rho where everything emits 1: H = 1 / (1 - rho) everywhere. */
static void white_furnace(double rho, double passes)
{
	struct model m;
	struct solved x;
	double exact = 1 / (1 - rho);

	box_model(&m, (double[]){ rho, rho }, one);
	solved_begin(&x, &m, &rays, 0);
	solved_finish(&x, 1e-8);
	double absorbed = (1 - rho) * x.s.ledger[0] * exact;
	assert_near(x.s.ledger[LEDGER_ABSORBED] / absorbed, 1, x.r.bound);
	assert_that(x.r.bound, <, 1e-7 * exact);
	assert_that(x.r.passes, <=, passes);
	assert_that(x.r.residual, <=, 1e-13);
	for (uint32_t p = 0; p < m.patch.n; p++)
		assert_near(patch_mean(&m, &x.s, 2 * p, 0) / exact, 1, .05);
	solved_free(&x);
	model_free(&m);
}

static void white_furnaces(void **state)
{
	(void)state;
	white_furnace(.99, 100);
	white_furnace(.999, 100);
	white_furnace(.9999, 100);
	white_furnace(.99999, 100);
}

/* A box of two albedos stopped early: all that is still to arrive is below the bound, and
 * not far below. */
static void bound_is_sharp(void **state)
{
	struct model m;
	struct solved x;
	double arrived[2], bound = 0;

	(void)state;
	box_model(&m, (double[]){ .9, .3 }, (double[]){ 1, 0 });
	solved_begin(&x, &m, &rays, 0);
	for (int k = 0; k < 2; k++) {
		solved_finish(&x, k ? 1e-12 : .1);
		bound = k ? bound : x.r.bound;
		arrived[k] = 0;
		for (size_t i = 0; i < m.element.n; i++)
			arrived[k] += m.element.area[i] * solution_irradiance(&x.s, 2 * i, 0);
	}
	double missing = (arrived[1] - arrived[0]) / x.s.ledger[LEDGER_EMITTED];
	assert_that(missing, >, .1);
	assert_that(missing, <=, bound * (1 + 1e-9));
	assert_that(bound, <=, 1.1 * missing);
	solved_free(&x);
	model_free(&m);
}

/* Shooting every side by turns until nothing is left, with plain shots alone. */
static void shoot_all(struct shooter *v)
{
	double worst = 1;

	for (int i = 0; i < 100000 && worst > 1e-13; i++) {
		for (uint32_t ps = 0; ps < v->s->patch_sides; ps++)
			radiosity_shoot_side(v, ps, 0);
		radiosity_survey(v, &worst);
	}
	assert_that(worst, <=, 1e-13);
}

static void assert_same(const double *a, const double *b, size_t n)
{
	double most = 0, off = 0;

	for (size_t i = 0; i < n; i++) {
		most = fmax(most, fabs(a[i]));
		off = fmax(off, fabs(a[i] - b[i]));
	}
	assert_that(off, <=, 1e-10 * most);
}

/* Overshooting comes to what shots come to, in each of the three parts: mirrors, lobes,
 * transmission. */
static void overshooting(double exponent, int bands)
{
	struct model m;
	struct solved x;
	struct solution s[2];
	struct ff_options o = rays;

	o.rays = o.lobe_rays = 512;
	plates_model(&m, exponent, bands);
	solved_join(&x, &m, &o, NULL);
	for (int k = 0; k < 2; k++) {
		struct shooter v;
		double worst;
		assert_int_equal(radiosity_begin(&x.s, &m, &x.t, 0, &x.e), 0);
		assert_int_equal(radiosity_shooter_init(&v, &x.s, &x.t, &x.e), 0);
		radiosity_survey(&v, &worst);
		if (k == 0)
			shoot_all(&v);
		for (int i = 0; k == 1 && i < 3; i++)
			assert_that(radiosity_gmres_finish(&v, 1, 1e-13, &x.e), >=, 0);
		radiosity_survey(&v, &worst);
		assert_that(worst, <=, 1e-12);
		assert_that(v.residual, <=, 1e-13);
		radiosity_propagator_store(&v.propagator, &x.s);
		radiosity_shooter_free(&v);
		solved_gather(&x);
		s[k] = x.s;
	}
	size_t n = s[0].element_sides * (size_t)bands;
	assert_same(s[0].irradiance.direct, s[1].irradiance.direct, n);
	assert_same(s[0].irradiance.caustic, s[1].irradiance.caustic, n);
	assert_same(s[0].irradiance.indirect, s[1].irradiance.indirect, n);
	solution_free(&s[0]);
	solved_free(&x);
	model_free(&m);
}

static void overshooting_as_shots(void **state)
{
	(void)state;
	overshooting(20, 1);
	overshooting(20, 6);
	overshooting((double)INFINITY, 3);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(furnace_by_rays),
		cmocka_unit_test(furnace_by_hemicubes),
		cmocka_unit_test(plates_by_rays),
		slow_unit_test(plates_by_hemicubes),
		cmocka_unit_test(six_bands),
		cmocka_unit_test(patches_as_receivers_f32),
		cmocka_unit_test(patches_as_receivers_f64),
		cmocka_unit_test(shards_of_two_kinds),
		cmocka_unit_test(white_box_has_no_steady_state),
		cmocka_unit_test(white_furnaces),
		cmocka_unit_test(bound_is_sharp),
		cmocka_unit_test(overshooting_as_shots),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
