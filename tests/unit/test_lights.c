/* Punctual lights: their rays, form factors, solution, direct light and particles,
 * against closed forms. */
#include <math.h>

#include "lib/base/constants.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/data/punctual.h"
#include "lib/occlusion/direct.h"
#include "lib/radiosity/radiosity.h"
#include "lib/radiosity/transport.h"
#include "lib/reference/pathtrace.h"
#include "lib/scatter/bsdf.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/grid.h"
#include "tests/unit/fixtures/memory_ff.h"

static const double zero[3] = { 0, 0, 0 }, one[3] = { 1, 1, 1 };

static const struct ff_options options = { .method = FF_RAYS, .rays = 4096, .points = 1,
	.emitter_gain = 8, .lobe_rays = 4096, .depth = 256, .seed = 1, .shard = 1, .shards = 1,
	.threads = 2 };

/* ---- scenes ---- */

/* One light of intensity 1; direction may be NULL. */
static void add_light(struct model *m, enum light_kind kind, double x, double y, double z,
                      const double direction[3], double inner, double outer)
{
	struct err e = { 0 };
	struct lights *l = &m->light;
	double at[3] = { x, y, z };

	assert_int_equal(model_lights_new(l, 1, m->bands, &e), 0);
	l->name[0] = strdup("lamp");
	l->kind[0] = (uint8_t)kind;
	for (int k = 0; k < 3; k++) {
		l->position[k] = kind == LIGHT_DIRECTIONAL ? 0 : at[k];
		l->direction[k] = direction ? direction[k] : 0;
	}
	if (direction)
		v3_normalise(l->direction);
	l->cone[0] = inner;
	l->cone[1] = outer;
	for (int b = 0; b < m->bands; b++)
		l->intensity[b] = 1;
}

static void set(struct model *m, size_t material, double rho_d, int two_sided)
{
	m->material.one_sided[material] = !two_sided;
	for (int side = 0; side <= two_sided; side++)
		m->material.rho_d[model_material_at(&m->material, material, side)] = rho_d;
}

/* The rectangle [x0,x1] x [y0,y1] at height z, front up or down. */
static void put(struct model *m, size_t n, uint32_t material, double x0, double x1, double y0,
                double y1, double z, int down)
{
	double o[3] = { x0, y0, z }, x[3] = { x1 - x0, 0, 0 }, y[3] = { 0, y1 - y0, 0 };

	grid_quad(m, n, material, o, down ? y : x, down ? x : y);
}

/* Solid angle of [0,x] x [0,y] at height h from the origin, signed. */
static double corner_angle(double x, double y, double h)
{
	return atan(x * y / (h * sqrt(x * x + y * y + h * h)));
}

static double angle(double x0, double x1, double y0, double y1, double h)
{
	return corner_angle(x1, y1, h) - corner_angle(x0, y1, h) - corner_angle(x1, y0, h) +
	       corner_angle(x0, y0, h);
}

/* ---- solving ---- */

static void solve(const struct model *m, struct solution *s)
{
	struct ff f;
	struct ff_stats stats;
	const struct ff *shard[] = { &f };
	const char *name[] = { "memory" };
	struct transport t;
	struct err e = { 0 };
	struct radiosity_options ro = { 1e-9, UINT64_MAX, 2 };
	struct radiosity_report r;

	memory_ff(m, &options, &f, &stats);
	assert_int_equal(radiosity_transport_init(&t, m, shard, name, 1, 2, &e), 0);
	assert_int_equal(radiosity_begin(s, m, &t, 0, &e), 0);
	assert_int_equal(radiosity_shoot(s, &t, &ro, NULL, &r, &e), 0);
	assert_int_equal(radiosity_element_irradiance(s, &t, 2, &r, &e), 0);
	assert_that(r.residual, <=, 1e-12);
	radiosity_transport_free(&t);
	ff_free(&f);
}

/* Flux that arrives on a patch-side, of one part of the irradiance or (NULL) of all. */
static double arrived(const struct model *m, const struct solution *s, uint32_t ps,
                      const double *part)
{
	double sum = 0;

	for (uint32_t i = m->patch.start[ps >> 1]; i < m->patch.start[(ps >> 1) + 1]; i++) {
		size_t es = 2 * (size_t)i + (ps & 1);
		sum += m->element.area[i] *
		       (part ? part[es * (size_t)m->bands] : solution_irradiance(s, es, 0));
	}
	return sum;
}

static double ledger(const struct solution *s, int term)
{
	return s->ledger[(size_t)term * (size_t)s->bands];
}

static void near(double got, double want, double tolerance)
{
	if (!(fabs(got - want) <= tolerance)) {
		print_error("%.15g instead of %.15g +- %.3g\n", got, want, tolerance);
		fail();
	}
}

/* ---- rays of lights ---- */

static void rays_carry_the_flux(void **state)
{
	enum { RAYS = 1 << 14 };
	const double down[3] = { .3, -.2, -1 };
	struct model m;
	double inner = .3, outer = .7, core = 0, rim = 0;

	(void)state;
	grid_new(&m, 1, 1, 1, 1);
	put(&m, 1, 0, 0, 1, 0, 1, 0, 0);
	add_light(&m, LIGHT_SPOT, 0, 0, 1, down, inner, outer);
	grid_end(&m);
	for (uint32_t i = 0; i < RAYS; i++) {
		given("i %u", i);
		double u[3] = { rng_sobol(i, 0, 7), rng_sobol(i, 1, 7), rng_sobol(i, 2, 7) };
		double org[3], dir[3];
		model_light_ray(&m.light, 0, u, 0, org, dir);
		double c = v3_dot(dir, m.light.direction);
		near(v3_length(dir), 1, 1e-12);
		assert_that(c, >=, cos(outer) - 1e-12);
		core += c >= cos(inner);
		rim += c < (cos(inner) + cos(outer)) / 2; /* an eighth of the rim's flux */
	}
	double flux = 2 * PI * (1 - cos(inner)), edge = 2 * PI * (cos(inner) - cos(outer)) / 3;
	near(m.light.unit_flux[0], flux + edge, 1e-12);
	near(core / RAYS, flux / (flux + edge), 1e-3);
	near(rim / RAYS, edge / 8 / (flux + edge), 1e-3);
	model_free(&m);
}

/* ---- a black floor ---- */

static void floor_with(struct model *m, enum light_kind kind, const double direction[3],
                       double inner, double outer)
{
	grid_new(m, 1, 16, 1, 1);
	set(m, 0, 0, 0);
	put(m, 16, 0, -2, 2, -2, 2, 0, 0);
	add_light(m, kind, .1, .2, 1, direction, inner, outer);
	grid_end(m);
}

static double direct(const struct model *m, double x, double y)
{
	struct err e = { 0 };
	double at[3] = { x, y, 0 }, nothing = 0, h = 0, error;
	struct ray_scene *rays = ray_scene_new(m, &e);
	struct direct *d = occ_direct_new(m, rays, &e);
	struct direct_worker *w = occ_direct_worker_new(d, &e);

	assert_non_null(w);
	occ_direct_begin(w, 0);
	assert_int_equal(occ_direct_at(w, at, 1, 1e-3, &nothing, &h, &error, &e), 0);
	assert_that(error, ==, 0);
	occ_direct_worker_free(w);
	occ_direct_free(d);
	ray_scene_free(rays);
	return h;
}

static void point_above_a_floor(void **state)
{
	struct model m;
	struct solution s;

	(void)state;
	floor_with(&m, LIGHT_POINT, NULL, 0, 0);
	near(direct(&m, .1, .2), 1, 1e-12);
	near(direct(&m, 1.1, 1.2), pow(3, -1.5), 1e-12); /* I cos^3 / h^2 */
	solve(&m, &s);
	near(arrived(&m, &s, 0, s.irradiance.direct), angle(-2.1, 1.9, -2.2, 1.8, 1), 1e-6);
	near(ledger(&s, LEDGER_EMITTED), 4 * PI, 1e-12);
	near(s.error.sampling[0], 0, 0);
	solution_free(&s);
	model_free(&m);
}

static void spot_on_a_floor(void **state)
{
	const double down[3] = { 0, 0, -1 };
	const double cones[][2] = { { 0, .6 }, { .3, .6 }, { .6, .6 } };

	(void)state;
	for (int i = 0; i < 3; i++) {
		double c[2] = { cos(cones[i][0]), cos(cones[i][1]) };
		struct model m;
		struct solution s;
		floor_with(&m, LIGHT_SPOT, down, cones[i][0], cones[i][1]);
		solve(&m, &s);
		near(arrived(&m, &s, 0, NULL), 2 * PI * (1 - c[0] + (c[0] - c[1]) / 3), 1e-6);
		near(ledger(&s, LEDGER_ESCAPED), 0, 0);
		near(direct(&m, .1, .2), 1, 1e-12);
		near(direct(&m, .1 + tan(.61), .2), 0, 0);
		double x = cos(.5), part = fmin(1, (x - c[1]) / fmax(1e-9, c[0] - c[1]));
		near(direct(&m, .1 + tan(.5), .2), x * x * x * part * part, 1e-12);
		solution_free(&s);
		model_free(&m);
	}
}

/* A half sphere, the widest spot there is, lights all below it. */
static void widest_spot(void **state)
{
	const double down[3] = { 0, 0, -1 };
	struct model m;
	struct solution s;

	(void)state;
	floor_with(&m, LIGHT_SPOT, down, PI / 2, PI / 2);
	near(m.light.unit_flux[0], 2 * PI, 1e-12);
	solve(&m, &s);
	near(arrived(&m, &s, 0, NULL), angle(-2.1, 1.9, -2.2, 1.8, 1), 1e-6);
	solution_free(&s);
	model_free(&m);
}

static void directional_on_a_floor(void **state)
{
	const double slanting[3] = { 1, 0, -2 };
	struct model m;
	struct solution s;

	(void)state;
	floor_with(&m, LIGHT_DIRECTIONAL, slanting, 0, 0);
	near(direct(&m, 1, 1), 2 / sqrt(5), 1e-12);
	solve(&m, &s);
	for (size_t i = 0; i < m.element.n; i++)
		near(s.irradiance.direct[2 * i], 2 / sqrt(5), 1e-6);
	near(ledger(&s, LEDGER_EMITTED), 16 * 2 / sqrt(5), 1e-9);
	solution_free(&s);
	model_free(&m);
}

static void light_in_the_floor(void **state)
{
	struct model m;
	struct solution s;

	(void)state;
	grid_new(&m, 1, 4, 1, 1);
	set(&m, 0, .5, 1);
	put(&m, 4, 0, -2, 2, -2, 2, 1, 0);
	add_light(&m, LIGHT_POINT, .1, .2, 1, NULL, 0, 0);
	grid_end(&m);
	solve(&m, &s);
	near(arrived(&m, &s, 0, NULL) + arrived(&m, &s, 1, NULL), 0, 0);
	near(ledger(&s, LEDGER_ESCAPED), 4 * PI, 1e-12);
	solution_free(&s);
	model_free(&m);
}

/* ---- shadows, panes, mirrors ---- */

/* A sheet of half the light's height hides the middle of the floor. */
static void shadow(void **state)
{
	struct model m;
	struct solution s;

	(void)state;
	grid_new(&m, 2, 16, 1, 1);
	set(&m, 0, 0, 1);
	put(&m, 16, 0, -2, 2, -2, 2, 0, 0);
	put(&m, 16, 0, -.4, .3, -.3, .45, .5, 0);
	add_light(&m, LIGHT_POINT, 0, 0, 1, NULL, 0, 0);
	grid_end(&m);
	solve(&m, &s);
	double all = angle(-2, 2, -2, 2, 1), hidden = angle(-.4, .3, -.3, .45, .5);
	near(arrived(&m, &s, 2, NULL), hidden, 1e-6);
	near(arrived(&m, &s, 0, NULL), all - hidden, 2e-3 * all);
	near(direct(&m, .1, .1), 0, 0);
	near(direct(&m, -.9, 0), pow(1 + .81, -1.5), 1e-12);
	solution_free(&s);
	model_free(&m);
}

static void through_a_pane(void **state)
{
	struct model m;
	struct solution s;

	(void)state;
	grid_new(&m, 2, 8, 2, 1);
	set(&m, 0, 0, 1);
	set(&m, 1, 0, 1);
	for (int side = 0; side < 2; side++)
		m.material.tau_s[model_material_at(&m.material, 1, side)] = .8;
	put(&m, 8, 0, 0, 1, 0, 1, 0, 0);
	put(&m, 8, 1, -3, 3, -3, 3, .5, 0);
	add_light(&m, LIGHT_POINT, .5, .5, 1, NULL, 0, 0);
	grid_end(&m);
	solve(&m, &s);
	near(arrived(&m, &s, 0, s.irradiance.caustic), .8 * angle(-.5, .5, -.5, .5, 1), 2e-4);
	near(arrived(&m, &s, 0, s.irradiance.direct), 0, 0);
	near(ledger(&s, LEDGER_ESCAPED), 4 * PI - .2 * angle(-3.5, 2.5, -3.5, 2.5, .5) -
	     .8 * angle(-.5, .5, -.5, .5, 1), 1e-3);
	solution_free(&s);
	model_free(&m);
}

/* The virtual image of a light, behind a mirror that is as good as infinite. */
static void by_a_mirror(void **state)
{
	struct model m;
	struct solution s;

	(void)state;
	grid_new(&m, 2, 4, 2, 1);
	set(&m, 0, 0, 0);
	m.material.one_sided[1] = 1;
	m.material.rho_s[model_material_at(&m.material, 1, FRONT)] = .8;
	put(&m, 4, 0, .5, 2, 0, 1.5, 1, 1);
	put(&m, 4, 1, -9, 9, -9, 9, 0, 0);
	add_light(&m, LIGHT_POINT, 0, 0, 1, NULL, 0, 0);
	grid_end(&m);
	solve(&m, &s);
	double want = .8 * angle(.5, 2, 0, 1.5, 2);
	near(arrived(&m, &s, 0, s.irradiance.caustic), want, 5e-4 * want);
	near(arrived(&m, &s, 0, s.irradiance.direct), 0, 0);
	solution_free(&s);
	model_free(&m);
}

/* ---- closed rooms ---- */

static void box_with(struct model *m, double rho, double x, double y, double z)
{
	const uint32_t material[6] = { 0 };

	grid_new(m, 6, 4, 1, 1);
	set(m, 0, rho, 0);
	grid_box(m, 4, material, zero, one);
	add_light(m, LIGHT_POINT, x, y, z, NULL, 0, 0);
	grid_end(m);
}

/* All flux is absorbed, so sum of H A = flux / (1 - rho). */
static void furnace(void **state)
{
	struct model m;
	struct solution s;
	double sum = 0;

	(void)state;
	box_with(&m, .75, .3, .4, .6);
	solve(&m, &s);
	for (uint32_t p = 0; p < 6; p++)
		sum += arrived(&m, &s, 2 * p, NULL);
	near(sum, 4 * PI / .25, 1e-6);
	near(ledger(&s, LEDGER_ESCAPED), 0, 0);
	near(arrived(&m, &s, 8, s.irradiance.direct), angle(-.3, .7, -.4, .6, .6), 1e-6);
	solution_free(&s);
	model_free(&m);
}

static void outside(void **state)
{
	struct model m;
	struct solution s;

	(void)state;
	box_with(&m, .5, .3, .4, 1.6);
	solve(&m, &s);
	for (uint32_t p = 0; p < 6; p++)
		near(arrived(&m, &s, 2 * p, NULL), 0, 0);
	/* Black backs absorb what meets them. */
	near(ledger(&s, LEDGER_ABSORBED), angle(-.3, .7, -.4, .6, .6), 1e-3);
	solution_free(&s);
	model_free(&m);
}

static void dark_light_is_no_emitter(void **state)
{
	struct model m;
	struct ff f;
	struct ff_stats stats;
	const struct ff *shard[] = { &f };
	const char *name[] = { "memory" };
	struct transport t;
	struct solution s;
	struct err e = { 0 };

	(void)state;
	box_with(&m, .5, .3, .4, .6);
	m.light.intensity[0] = 0;
	memory_ff(&m, &options, &f, &stats);
	assert_int_equal(radiosity_transport_init(&t, &m, shard, name, 1, 1, &e), 0);
	assert_int_equal(radiosity_begin(&s, &m, &t, 0, &e), -1);
	assert_non_null(strstr(e.text, "no emitter"));
	solution_free(&s);
	radiosity_transport_free(&t);
	ff_free(&f);
	model_free(&m);
}

/* ---- lobes, and particles ---- */

/* Irradiance straight and by way of a glossy floor, against particles. */
static void particles_agree(void **state)
{
	const uint32_t material[6] = { 0, 0, 0, 0, 1, 0 };
	const struct pathtrace_options po = { .samples = 200000, .seed = 3, .threads = 2 };
	struct model m;
	struct solution s;
	struct pathtrace_irradiance h;
	struct err e = { 0 };

	(void)state;
	grid_new(&m, 6, 4, 2, 1);
	set(&m, 0, 0, 0);
	set(&m, 1, 0, 0);
	m.material.rho_s[model_material_at(&m.material, 1, FRONT)] = .6;
	m.material.alpha[2] = 20;
	grid_box(&m, 4, material, zero, one);
	add_light(&m, LIGHT_POINT, .3, .4, .6, NULL, 0, 0);
	grid_end(&m);
	solve(&m, &s);
	struct ray_scene *rays = ray_scene_new(&m, &e);
	struct pathtrace *p = pathtrace_new(&m, rays, &e);
	assert_non_null(p);
	assert_int_equal(pathtrace_particles(p, &po, NULL, &h, &e), 0);
	near(h.emitted[0], 4 * PI, 1e-12);
	for (uint32_t ps = 0; ps < 12; ps += 2) {
		double flux = 0, variance = 0;
		for (uint32_t i = m.patch.start[ps >> 1]; i < m.patch.start[(ps >> 1) + 1]; i++) {
			flux += h.h[2 * i] * m.element.area[i];
			variance += pow(h.error[2 * i] * m.element.area[i], 2);
		}
		double got = arrived(&m, &s, ps, NULL);
		near(got, flux, 4 * sqrt(variance) + .005 * flux);
	}
	pathtrace_irradiance_free(&h);
	pathtrace_free(p);
	ray_scene_free(rays);
	solution_free(&s);
	model_free(&m);
}

static void lobes_apart(void **state)
{
	const double n[3] = { 0, 0, 1 };
	double wi[3] = { .3, .1, .8 }, wo[3] = { -.5, .2, .7 }, all, lobe;
	struct model m;

	(void)state;
	grid_new(&m, 1, 1, 1, 1);
	set(&m, 0, .4, 0);
	m.material.rho_s[0] = .5;
	m.material.alpha[0] = 9;
	v3_normalise(wi);
	v3_normalise(wo);
	bsdf_eval(&m, 0, n, wi, wo, &all);
	bsdf_eval_lobes(&m, 0, n, wi, wo, &lobe);
	assert_that(lobe, >, 0);
	near(all - lobe, .4 / PI, 1e-15);
	model_free(&m);
}

static void any_threads_any_shards(void **state)
{
	struct ff_options o = options;
	struct model m;
	struct ff f[4];
	struct ff_stats stats;

	(void)state;
	box_with(&m, .5, .3, .4, .6);
	memory_ff(&m, &o, &f[0], &stats);
	assert_int_equal(stats.rows[FF_LIGHT], 1);
	o.threads = 1;
	memory_ff(&m, &o, &f[1], &stats);
	assert_int_equal(f[0].entries, f[1].entries);
	assert_memory_equal(f[0].value, f[1].value, f[0].entries * sizeof *f[0].value);
	o.shards = 2;
	for (o.shard = 1; o.shard <= 2; o.shard++)
		memory_ff(&m, &o, &f[1 + o.shard], &stats);
	assert_int_equal(f[2].row.n + f[3].row.n, f[0].row.n);
	assert_int_equal(f[3].row.kind[f[3].row.n - 1], FF_LIGHT);
	for (int i = 0; i < 4; i++)
		ff_free(&f[i]);
	model_free(&m);
}

/* Two mirrors at a right angle: an image in each, by formula, and one in both, by rays. */
static void in_a_corner(void **state)
{
	const double o[3] = { 0, -9, 0 }, y[3] = { 0, 18, 0 }, z[3] = { 0, 0, 9 };
	struct model m;
	struct solution s;

	(void)state;
	grid_new(&m, 3, 4, 2, 1);
	set(&m, 0, 0, 0);
	m.material.one_sided[1] = 1;
	m.material.rho_s[model_material_at(&m.material, 1, FRONT)] = .8;
	put(&m, 4, 0, 1.5, 2.5, 0, 1, 2, 1);
	put(&m, 4, 1, 0, 9, -9, 9, 0, 0);
	grid_quad(&m, 4, 1, o, y, z);
	add_light(&m, LIGHT_POINT, 1, 0, 1, NULL, 0, 0);
	grid_end(&m);
	solve(&m, &s);
	double direct = angle(.5, 1.5, 0, 1, 1), wall = angle(2.5, 3.5, 0, 1, 1);
	double below = angle(.5, 1.5, 0, 1, 3), both = angle(2.5, 3.5, 0, 1, 3);
	double want = .8 * (wall + below) + .64 * both;
	near(arrived(&m, &s, 0, s.irradiance.direct), direct, 1e-6);
	near(arrived(&m, &s, 0, s.irradiance.caustic), want, 2e-3 * want);
	solution_free(&s);
	model_free(&m);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(rays_carry_the_flux),
		cmocka_unit_test(point_above_a_floor),
		cmocka_unit_test(spot_on_a_floor),
		cmocka_unit_test(widest_spot),
		cmocka_unit_test(directional_on_a_floor),
		cmocka_unit_test(light_in_the_floor),
		cmocka_unit_test(shadow),
		cmocka_unit_test(through_a_pane),
		cmocka_unit_test(by_a_mirror),
		cmocka_unit_test(in_a_corner),
		cmocka_unit_test(furnace),
		cmocka_unit_test(outside),
		cmocka_unit_test(dark_light_is_no_emitter),
		cmocka_unit_test(particles_agree),
		cmocka_unit_test(lobes_apart),
		cmocka_unit_test(any_threads_any_shards),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
