/* The yardstick against closed forms. Unless said otherwise a bound is 4 standard
 * errors, estimated from 64 batches (Student's t with 63 degrees of freedom: .017 %
 * a value); with some 60 values that is 99 % confidence over the family. The seeds
 * are fixed. Sources: closed cavities and flux networks, view factors of parallel
 * squares (Howell's catalogue C-11, C-13). */
#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/reference/pathtrace.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/grid.h"

static const double sigmas = 4;

/* ---- scenes ---- */

struct scene {
	struct model m;
	struct ray_scene *rays;
	struct pathtrace *p;
};

static void set(struct model *m, size_t material, int side, double rho_d, double tau_d,
                double rho_s, double tau_s)
{
	for (size_t b = 0; b < (size_t)m->bands; b++) {
		size_t at = model_material_at(&m->material, material, side) + b;
		m->material.rho_d[at] = rho_d;
		m->material.tau_d[at] = tau_d;
		m->material.rho_s[at] = rho_s;
		m->material.tau_s[at] = tau_s;
	}
}

/* Lambertian exitance */
static void emit(struct model *m, size_t material, int side, double exitance)
{
	for (size_t b = 0; b < (size_t)m->bands; b++)
		m->material.emission[model_material_at(&m->material, material, side) + b] = exitance / PI;
}

static void ready(struct scene *s)
{
	struct err e = { 0 };

	grid_end(&s->m);
	s->rays = ray_scene_new(&s->m, &e);
	s->p = s->rays ? pathtrace_new(&s->m, s->rays, &e) : NULL;
	if (!s->p)
		fail_msg("%s", e.text);
}

static void done(struct scene *s)
{
	pathtrace_free(s->p);
	ray_scene_free(s->rays);
	model_free(&s->m);
}

static void quad(struct scene *s, uint32_t material, double ox, double oy, double oz,
                 double x, double y)
{
	double o[3] = { ox, oy, oz }, u[3] = { x, 0, 0 }, v[3] = { 0, y, 0 };

	grid_quad(&s->m, 1, material, o, u, v);
}

static void unit_cube(struct scene *s, const uint32_t material[6], size_t cells)
{
	static const double lo[3] = { 0, 0, 0 }, hi[3] = { 1, 1, 1 };

	grid_box(&s->m, cells, material, lo, hi);
}

/* ---- checks ---- */

static void run_particles(const struct scene *s, long n, struct pathtrace_irradiance *h)
{
	struct pathtrace_options o = { .samples = n, .seed = 1, .threads = 2 };
	struct err e = { 0 };

	assert_int_equal(pathtrace_particles(s->p, &o, NULL, h, &e), 0);
}

static void check(const char *what, double got, double expected, double error, double relative)
{
	if (!(fabs(got - expected) <= sigmas * error + relative * fabs(expected)))
		fail_msg("%s: %.6g instead of %.6g, %.2f standard errors off", what, got, expected,
		         (got - expected) / error);
}

/* Mean irradiance of a patch's side. The elements' errors are not independent:
 * their sum bounds the mean's. */
static double patch_mean(const struct scene *s, const struct pathtrace_irradiance *h,
                         size_t patch, int side, int band, double *error)
{
	double mean = 0;

	*error = 0;
	for (size_t e = s->m.patch.start[patch]; e < s->m.patch.start[patch + 1]; e++) {
		size_t at = (2 * e + (size_t)side) * (size_t)s->m.bands + (size_t)band;
		double share = s->m.element.area[e] / s->m.patch.area[patch];
		mean += share * h->h[at];
		*error += share * h->error[at];
	}
	return mean;
}

static void check_patch(const struct scene *s, const struct pathtrace_irradiance *h,
                        size_t patch, int side, int band, double expected)
{
	double error, mean = patch_mean(s, h, patch, side, band, &error);

	check("irradiance", mean, expected, error, 0);
	assert_that(error, >, 0);
	assert_that(error, <, .03 * expected);
}

/* A small picture from eye to target, optionally orthographic. */
static void take_picture(const struct scene *s, const double eye[3], const double target[3],
                         double half_extent, long samples, struct image *im)
{
	double direction[3] = { target[0] - eye[0], target[1] - eye[1], target[2] - eye[2] };
	double up[3] = { 0, 1, 0 };
	struct pathtrace_options o = { .samples = samples, .seed = 2, .threads = 2 };
	struct camera c;
	struct view_frame f;
	struct err e = { 0 };

	if (direction[0] == 0 && direction[2] == 0)
		up[1] = 0, up[0] = 1;
	assert_int_equal(picture_camera_look_at(eye, target, up, 60, &c, &e), 0);
	if (half_extent > 0) {
		c.orthographic = 1;
		c.xmag = c.ymag = half_extent;
	}
	assert_int_equal(picture_camera_frame(&c, 12, 12, &f, &e), 0);
	assert_int_equal(pathtrace_picture(s->p, &f, &o, NULL, im, NULL, &e), 0);
}

/* Mean of a channel, and its standard error: pixels are independent. */
static double picture_mean(const struct image *im, const char *name, double *error)
{
	char other[32] = "stderr.";
	size_t n = (size_t)im->width * (size_t)im->height;
	double sum = 0, squares = 0;

	strcat(other, name);
	const float *value = picture_image_plane(im, picture_image_channel(im, name));
	const float *spread = picture_image_plane(im, picture_image_channel(im, other));
	for (size_t i = 0; i < n; i++) {
		sum += value[i];
		squares += (double)spread[i] * spread[i];
	}
	*error = sqrt(squares) / (double)n;
	return sum / (double)n;
}

static void check_picture(const struct scene *s, const double eye[3], const double target[3],
                          double half_extent, long samples, double expected, double relative)
{
	struct image im;
	double error, mean;

	take_picture(s, eye, target, half_extent, samples, &im);
	mean = picture_mean(&im, "R", &error);
	check("picture", mean, expected, error, relative);
	assert_that(error, <, .05 * expected + 1e-30);
	picture_image_free(&im);
}

/* ---- closed cavities ---- */

static const double inside[3] = { .3, .6, .4 }, corner[3] = { 1, .1, .9 };

/* H = E / (1 - rho), three bands */
static void test_furnace(void **state)
{
	static const double rho[3] = { .5, .9, .2 };
	static const uint32_t material[6] = { 0 };
	static const char *const name[] = { "R", "G", "B" };
	struct pathtrace_irradiance h;
	struct image im;
	struct scene s;
	double error;

	(void)state;
	grid_new(&s.m, 6, 1, 1, 3);
	unit_cube(&s, material, 1);
	memcpy(s.m.material.rho_d, rho, sizeof rho);
	emit(&s.m, 0, FRONT, 1);
	ready(&s);
	run_particles(&s, 100000, &h);
	for (size_t patch = 0; patch < 6; patch++)
		for (int b = 0; b < 3; b++) {
			given("patch %zu, b %d", patch, b);
			check_patch(&s, &h, patch, FRONT, b, 1 / (1 - rho[b]));
		}
	for (int b = 0; b < 3; b++) {
		given("b %d", b);
		assert_near(h.emitted[b], 6, 1e-12);
		assert_that(h.escaped[b], ==, 0);
		for (size_t e = 0; e < s.m.element.n; e++)
			assert_that(h.h[(2 * e + BACK) * 3 + (size_t)b], ==, 0);
	}
	take_picture(&s, inside, corner, 0, 64, &im);
	for (int b = 0; b < 3; b++) {
		given("band %s", name[b]);
		double mean = picture_mean(&im, name[b], &error);
		check(name[b], mean, 1 / (1 - rho[b]) / PI, error, 0);
		assert_that(error, <, .02 * mean);
	}
	picture_image_free(&im);
	pathtrace_irradiance_free(&h);
	done(&s);
}

/* Diffuse and mirror walls with E = 1 - rho_d - rho_s: H = 1, and every pixel of
 * every picture is 1 / pi. */
static void test_furnace_mirror_mix(void **state)
{
	static const double rho[6][2] = { { .5, 0 }, { .1, .8 }, { .6, .3 }, { 0, 0 }, { .3, .5 },
		{ 0, 1 } };
	static const uint32_t material[6] = { 0, 1, 2, 3, 4, 5 };
	struct pathtrace_irradiance h;
	struct scene s;

	(void)state;
	grid_new(&s.m, 6, 2, 6, 1);
	unit_cube(&s, material, 2);
	for (size_t i = 0; i < 6; i++) {
		set(&s.m, i, FRONT, rho[i][0], 0, rho[i][1], 0);
		emit(&s.m, i, FRONT, 1 - rho[i][0] - rho[i][1]);
	}
	ready(&s);
	run_particles(&s, 100000, &h);
	for (size_t patch = 0; patch < 6; patch++) {
		given("patch %zu", patch);
		check_patch(&s, &h, patch, FRONT, 0, 1);
	}
	check_picture(&s, inside, corner, 0, 64, 1 / PI, 0);
	pathtrace_irradiance_free(&h);
	done(&s);
}

/* A closed emitting box inside a dark one: nothing leaks, not even a little. */
static void test_isolated(void **state)
{
	static const double lo[3] = { .25, .25, .25 }, hi[3] = { .75, .75, .75 };
	static const uint32_t outer[6] = { 0 }, inner[6] = { 1, 1, 1, 1, 1, 1 };
	struct pathtrace_irradiance h;
	struct scene s;

	(void)state;
	grid_new(&s.m, 12, 1, 2, 1);
	unit_cube(&s, outer, 1);
	grid_box(&s.m, 1, inner, lo, hi);
	set(&s.m, 0, FRONT, .5, 0, 0, 0);
	set(&s.m, 1, FRONT, .5, 0, 0, 0);
	set(&s.m, 1, BACK, .5, 0, 0, 0);
	emit(&s.m, 1, FRONT, 1);
	ready(&s);
	run_particles(&s, 200000, &h);
	for (size_t patch = 6; patch < 12; patch++) {
		given("patch %zu", patch);
		check_patch(&s, &h, patch, FRONT, 0, 2);
	}
	for (size_t e = 0; e < s.m.element.n; e++) {
		given("e %zu", e);
		double one = h.emitted[0] / 200000 / s.m.element.area[e];
		assert_that(h.h[2 * e + BACK], ==, 0);
		assert_near(h.error[2 * e + BACK] / one, 1, 1e-12);
		if (e < s.m.patch.start[6])
			assert_that(h.h[2 * e], ==, 0);
	}
	assert_that(h.escaped[0], ==, 0);
	pathtrace_irradiance_free(&h);
	done(&s);
}

/* ---- open scenes ---- */

/* Facing unit squares at distance 1, E = 1 and rho = .5 against rho = .8; the
 * answers are Nystrom solutions to 1e-12. */
static void test_parallel_squares(void **state)
{
	struct pathtrace_irradiance h;
	struct scene s;

	(void)state;
	grid_new(&s.m, 2, 1, 2, 1);
	quad(&s, 0, 0, 0, 0, 1, 1);
	quad(&s, 1, 1, 0, 1, -1, 1);
	set(&s.m, 0, FRONT, .5, 0, 0, 0);
	set(&s.m, 1, FRONT, .8, 0, 0, 0);
	emit(&s.m, 0, FRONT, 1);
	ready(&s);
	run_particles(&s, 400000, &h);
	check_patch(&s, &h, 0, FRONT, 0, 0.032902320895719456);
	check_patch(&s, &h, 1, FRONT, 0, 0.2031567818865611);
	check("escaped", h.escaped[0], 0.942917483174828, h.escaped_error[0], 0);
	/* the upper square from below, B = .8 H */
	check_picture(&s, (double[]){ .5, .5, .3 }, (double[]){ .5, .5, 1 }, .5, 64,
	              .8 * 0.2031567818865611 / PI, 0);
	pathtrace_irradiance_free(&h);
	done(&s);
}

/* The receiver sees the emitter in the mirror only. */
static void test_mirror_image(void **state)
{
	struct pathtrace_irradiance h;
	struct scene s;

	(void)state;
	grid_new(&s.m, 3, 1, 3, 1);
	quad(&s, 0, 0, 0, 0, 1, 1);
	quad(&s, 1, 2, 0, 1, -2, 1);
	quad(&s, 2, 1, 0, 0, 1, 1);
	set(&s.m, 1, FRONT, 0, 0, .8, 0);
	emit(&s.m, 0, FRONT, 1);
	ready(&s);
	run_particles(&s, 400000, &h);
	check_patch(&s, &h, 2, FRONT, 0, .8 * 0.04806410298507045);
	check_patch(&s, &h, 0, FRONT, 0, .8 * 0.06858958881855244);
	check_patch(&s, &h, 1, FRONT, 0, 0.14293769242535737);
	pathtrace_irradiance_free(&h);
	done(&s);
}

/* A clear pane between two squares changes nothing but by its transmittance: for
 * particles, for the eye behind it and for light chosen across it. */
static void test_pane(void **state)
{
	const double f = 0.19982489569838738, tau = .9;
	struct pathtrace_irradiance h;
	struct scene s;

	(void)state;
	grid_new(&s.m, 3, 1, 3, 1);
	quad(&s, 0, 0, 0, 0, 1, 1);
	quad(&s, 1, -1, -1, .5, 3, 3);
	quad(&s, 2, 1, 0, 1, -1, 1);
	for (int side = 0; side < 2; side++)
		set(&s.m, 1, side, 0, 0, 0, tau);
	set(&s.m, 2, FRONT, .7, 0, 0, 0);
	emit(&s.m, 0, FRONT, 1);
	ready(&s);
	run_particles(&s, 200000, &h);
	check_patch(&s, &h, 2, FRONT, 0, tau * f);
	check_picture(&s, (double[]){ .5, .5, .3 }, (double[]){ .5, .5, 1 }, .5, 64,
	              .7 * tau * tau * f / PI, 0);
	pathtrace_irradiance_free(&h);
	done(&s);
}

/* A small glossy patch (n = 1: about the normal exactly Lambertian) under a narrow
 * beam sends a configuration factor's share to a receiver beside it and the rest
 * into the open; the closed form neglects the patch's size: 1e-3. */
static void test_open_lobe(void **state)
{
	struct pathtrace_irradiance h;
	struct scene s;
	double in, out, error;

	(void)state;
	grid_new(&s.m, 3, 1, 3, 1);
	quad(&s, 0, -.005, -.005, 0, .01, .01);
	quad(&s, 1, .005, -.005, 2, -.01, .01);
	quad(&s, 2, 2, -.5, 1, -1, 1);
	set(&s.m, 0, FRONT, 0, 0, 1, 0);
	s.m.material.alpha[FRONT] = 1;
	emit(&s.m, 1, FRONT, 1);
	s.m.material.emission_exponent[2] = 1e8;
	ready(&s);
	run_particles(&s, 400000, &h);
	in = patch_mean(&s, &h, 0, FRONT, 0, &error) * s.m.patch.area[0];
	out = patch_mean(&s, &h, 2, FRONT, 0, &error) * s.m.patch.area[2];
	check("fraction", out / in, 0.033307015494622394, error * s.m.patch.area[2] / in, 1e-3);
	pathtrace_irradiance_free(&h);
	done(&s);
}

/* ---- both directions of a partition, any exponent ---- */

static void plates(struct scene *s, double exponent)
{
	static const uint32_t material[6] = { 0, 0, 0, 0, 1, 2 };

	grid_new(&s->m, 7, 1, 4, 1);
	unit_cube(s, material, 1);
	quad(s, 3, 0, 0, .5, 1, 1);
	set(&s->m, 0, FRONT, 0, 0, 1, 0);
	set(&s->m, 1, FRONT, .5, 0, 0, 0);
	set(&s->m, 2, FRONT, .4, 0, 0, 0);
	set(&s->m, 3, FRONT, .1, .15, .25, .4);
	set(&s->m, 3, BACK, .2, .1, .25, .4);
	for (int side = 0; side < 2; side++)
		s->m.material.alpha[6 + side] = s->m.material.beta[6 + side] = exponent;
	emit(&s->m, 1, FRONT, 1);
	ready(s);
}

/* Mirror walls make the plates infinite: a network of fluxes whose answer does not
 * depend on the exponent. The eye sees floor and ceiling as uniform: this holds the
 * paths from the eye against those from the light over the same lobes. Eye paths
 * over the paper's lobe have rare large weights, hence the 1 % beside the standard
 * error. */
static void test_partition(void **state)
{
	static const double exponent[] = { 1, 10, (double)INFINITY };
	const double floor = 0.8127555192150451, ceiling = 0.8176614881439084;

	(void)state;
	for (int i = 0; i < 3; i++) {
		given("exponent %g", exponent[i]);
		struct pathtrace_irradiance h;
		struct scene s;
		plates(&s, exponent[i]);
		run_particles(&s, 200000, &h);
		check_patch(&s, &h, 6, BACK, 0, 1.4063777596075226);
		check_patch(&s, &h, 6, FRONT, 0, 0.3270645952575634);
		check_patch(&s, &h, 4, FRONT, 0, floor);
		check_patch(&s, &h, 5, FRONT, 0, ceiling);
		check_picture(&s, (double[]){ .5, .5, .4 }, (double[]){ .5, .5, 0 }, .5, 100,
		              (1 + .5 * floor) / PI, isinf(exponent[i]) ? 0 : .01);
		check_picture(&s, (double[]){ .5, .5, .6 }, (double[]){ .5, .5, 1 }, .5, 400,
		              .4 * ceiling / PI, isinf(exponent[i]) ? 0 : .01);
		assert_int_equal(pathtrace_diverges(&s.m), !isinf(exponent[i]));
		s.m.lobe = LOBE_RECIPROCAL;
		assert_false(pathtrace_diverges(&s.m));
		pathtrace_irradiance_free(&h);
		done(&s);
	}
}

/* The reciprocal lobe: both ways give the same receiver, whatever the answer. */
static void test_reciprocal_both_ways(void **state)
{
	struct pathtrace_irradiance h;
	struct scene s;
	struct image im;
	double error, light, spread, eye;

	(void)state;
	grid_new(&s.m, 3, 1, 3, 1);
	s.m.lobe = LOBE_RECIPROCAL;
	quad(&s, 0, 0, 0, 0, 1, 1);
	quad(&s, 1, 2, 0, 1, -2, 1);
	quad(&s, 2, 1, 0, 0, 1, 1);
	set(&s.m, 1, FRONT, 0, 0, .9, 0);
	set(&s.m, 2, FRONT, .6, 0, 0, 0);
	s.m.material.alpha[2] = 20;
	emit(&s.m, 0, FRONT, 1);
	ready(&s);
	run_particles(&s, 400000, &h);
	light = .6 / PI * patch_mean(&s, &h, 2, FRONT, 0, &error);
	take_picture(&s, (double[]){ 1.5, .5, .5 }, (double[]){ 1.5, .5, 0 }, .5, 400, &im);
	eye = picture_mean(&im, "R", &spread);
	check("both ways", eye, light, hypot(spread, .6 / PI * error), 0);
	assert_that(spread, <, .02 * eye);
	picture_image_free(&im);
	pathtrace_irradiance_free(&h);
	done(&s);
}

/* ---- what is seen ---- */

/* Backs of one-sided walls let the camera in, also through a pane; other rays and
 * two-sided walls do not. */
static void test_one_sided(void **state)
{
	static const uint32_t material[6] = { 0 };
	static const double outside[3] = { .5, .5, 3 }, middle[3] = { .5, .5, .5 };
	struct scene s;

	(void)state;
	for (int one_sided = 0; one_sided < 2; one_sided++) {
		given("one_sided %d", one_sided);
		grid_new(&s.m, 7, 1, 2, 1);
		unit_cube(&s, material, 1);
		quad(&s, 1, -1, -1, 2, 3, 3);
		set(&s.m, 0, FRONT, .5, 0, 0, 0);
		s.m.material.one_sided[0] = (uint8_t)one_sided;
		for (int side = 0; side < 2; side++)
			set(&s.m, 1, side, 0, 0, 0, .8);
		emit(&s.m, 0, FRONT, 1);
		ready(&s);
		check_picture(&s, outside, middle, .49, 64, one_sided ? .8 * 2 / PI : 0, 0);
		done(&s);
	}
}

/* Radiance L cos^(m-1), seen at 45 degrees; the other side is dark. */
static void test_emission_exponent(void **state)
{
	static const double above[3] = { 0, 10, 10 }, below[3] = { 0, 10, -10 };
	static const double origin[3] = { 0, 0, 0 };
	struct scene s;

	(void)state;
	grid_new(&s.m, 1, 1, 1, 1);
	quad(&s, 0, -1, -1, 0, 2, 2);
	emit(&s.m, 0, FRONT, PI);
	s.m.material.emission_exponent[FRONT] = 4;
	ready(&s);
	check_picture(&s, above, origin, .1, 4, pow(.5, 1.5), 1e-6);
	check_picture(&s, below, origin, .1, 4, 0, 0);
	done(&s);
}

static void test_nothing_emits(void **state)
{
	struct scene s;
	struct err e = { 0 };

	(void)state;
	grid_new(&s.m, 1, 1, 1, 1);
	quad(&s, 0, 0, 0, 0, 1, 1);
	grid_end(&s.m);
	s.rays = ray_scene_new(&s.m, &e);
	assert_non_null(s.rays);
	assert_null(pathtrace_new(&s.m, s.rays, &e));
	assert_non_null(strstr(e.text, "nothing emits"));
	s.p = NULL;
	done(&s);
}

/* ---- the standard error, and determinism ---- */

/* Twenty runs: their spread is what each of them says, within the accuracy of a
 * spread of 20 (16 %; bounds at 4 sigma). */
static void test_standard_error(void **state)
{
	enum { RUNS = 20 };
	struct scene s;
	double sum = 0, squares = 0, said = 0;

	(void)state;
	grid_new(&s.m, 2, 1, 2, 1);
	quad(&s, 0, 0, 0, 0, 1, 1);
	quad(&s, 1, 1, 0, 1, -1, 1);
	set(&s.m, 1, FRONT, .8, 0, 0, 0);
	emit(&s.m, 0, FRONT, 1);
	ready(&s);
	for (int i = 0; i < RUNS; i++) {
		given("i %d", i);
		struct pathtrace_options o = { .samples = 10000, .seed = 100 + (uint64_t)i,
			.threads = 1 };
		struct pathtrace_irradiance h;
		struct err e = { 0 };
		assert_int_equal(pathtrace_particles(s.p, &o, NULL, &h, &e), 0);
		double x = h.escaped[0];
		sum += x;
		squares += x * x;
		said += h.escaped_error[0] * h.escaped_error[0] / RUNS;
		pathtrace_irradiance_free(&h);
	}
	double variance = (squares - sum * sum / RUNS) / (RUNS - 1);
	assert_that(variance, >, .2 * said);
	assert_that(variance, <, 2.5 * said);
	done(&s);
}

static void test_threads(void **state)
{
	static const double eye[3] = { .5, .5, .4 }, target[3] = { .1, .8, 0 };
	struct pathtrace_irradiance h[2];
	struct camera c;
	struct view_frame f;
	struct image im[2];
	struct scene s;
	struct err e = { 0 };

	(void)state;
	plates(&s, 10);
	assert_int_equal(picture_camera_look_at(eye, target, (double[]){ 0, 1, 0 }, 90, &c, &e), 0);
	assert_int_equal(picture_camera_frame(&c, 15, 11, &f, &e), 0);
	for (int i = 0; i < 2; i++) {
		given("i %d", i);
		struct pathtrace_options o = { .samples = 333, .seed = 7, .threads = 1 + 2 * i };
		double relative;
		assert_int_equal(pathtrace_particles(s.p, &o, NULL, &h[i], &e), 0);
		o.samples = 5;
		assert_int_equal(pathtrace_picture(s.p, &f, &o, NULL, &im[i], &relative, &e), 0);
		assert_that(relative, >, 0);
		assert_true(isfinite(relative));
	}
	size_t rows = 2 * s.m.element.n;
	assert_memory_equal(h[0].h, h[1].h, rows * sizeof(double));
	assert_memory_equal(h[0].error, h[1].error, rows * sizeof(double));
	assert_memory_equal(im[0].pixel, im[1].pixel, 6 * 15 * 11 * sizeof(float));
	for (int i = 0; i < 2; i++) {
		picture_image_free(&im[i]);
		pathtrace_irradiance_free(&h[i]);
	}
	done(&s);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_furnace),
		cmocka_unit_test(test_furnace_mirror_mix),
		cmocka_unit_test(test_isolated),
		cmocka_unit_test(test_parallel_squares),
		cmocka_unit_test(test_mirror_image),
		cmocka_unit_test(test_pane),
		cmocka_unit_test(test_open_lobe),
		slow_unit_test(test_partition),
		cmocka_unit_test(test_reciprocal_both_ways),
		cmocka_unit_test(test_one_sided),
		cmocka_unit_test(test_emission_exponent),
		cmocka_unit_test(test_nothing_emits),
		cmocka_unit_test(test_standard_error),
		cmocka_unit_test(test_threads),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
