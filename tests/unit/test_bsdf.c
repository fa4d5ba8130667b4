/* The scattering model: sampling against density, energy, sides, reciprocity. */
#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/scatter/bsdf.h"
#include "lib/scatter/lobe.h"
#include "tests/unit/fixtures/check.h"

#define COUNT(a) (sizeof(a) / sizeof *(a))

/* A tilted normal, so that no axis is special. */
static const double n[3] = { 2. / 7, -3. / 7, 6. / 7 };

/* A model of one material; coefficients 0 until a test sets them. */
static void begin(struct model *m, int bands, enum lobe_kind kind)
{
	struct err e = { 0 };

	*m = (struct model){ .bands = bands, .lobe = kind };
	assert_int_equal(model_materials_new(&m->material, 1, bands, &e), 0);
}

/* The direction at polar angle theta and azimuth phi about n. */
static void direction(double theta, double phi, double w[3])
{
	double t[3], b[3];

	v3_frame(n, t, b);
	for (int i = 0; i < 3; i++)
		w[i] = sin(theta) * (cos(phi) * t[i] + sin(phi) * b[i]) + cos(theta) * n[i];
}

static void draw_three(struct rng *r, double u[3])
{
	for (int i = 0; i < 3; i++)
		u[i] = rng_uniform(r);
}

/* ---- chi-square: bins of equal share of the whole lobe about its axis ---- */

enum { RINGS = 10, SECTORS = 8, BINS = RINGS * SECTORS + 1, DRAWS = 20000 };
enum { POINTS = 256 }; /* of the quadrature over a bin */

struct lobe_case {
	struct model *m;
	double k;
	enum bsdf_transport transport;
	int transmitted;
	double known[3], axis[3], side[3]; /* side: normal of the side the lobe leaves */
};

static void lobe_setup(struct lobe_case *c, double degrees)
{
	struct materials *mt = &c->m->material;
	double *coefficient = c->transmitted ? mt->tau_s : mt->rho_s;

	memset(mt->rho_s, 0, 2 * sizeof *mt->rho_s);
	memset(mt->tau_s, 0, 2 * sizeof *mt->tau_s);
	for (int s = 0; s < 2; s++) {
		coefficient[s] = .7;
		mt->alpha[s] = mt->beta[s] = c->k;
	}
	direction(degrees * PI / 180, 1, c->known);
	bsdf_lobe_mirror(c->known, n, c->axis);
	for (int i = 0; i < 3; i++) {
		c->side[i] = c->transmitted ? -n[i] : n[i];
		if (c->transmitted)
			c->axis[i] = -c->known[i];
	}
}

/* cos^(k+1) gamma (uniform for a whole lobe) and azimuth about the axis -> direction */
static void bin_direction(const struct lobe_case *c, double v, double phi, double w[3])
{
	double t[3], b[3], l = log(v) / (c->k + 1), cosine = exp(l), sine = sqrt(-expm1(2 * l));

	v3_frame(c->axis, t, b);
	for (int i = 0; i < 3; i++)
		w[i] = sine * (cos(phi) * t[i] + sin(phi) * b[i]) + cosine * c->axis[i];
}

static int find_bin(const struct lobe_case *c, const double w[3])
{
	double t[3], b[3];

	v3_frame(c->axis, t, b);
	double v = bsdf_lobe_power(c->k + 1, v3_dot(c->axis, w));
	double phi = atan2(v3_dot(b, w), v3_dot(t, w)) / (2 * PI);
	int ring = (int)fmin(v * RINGS, RINGS - 1);
	int sector = (int)fmin((phi < 0 ? phi + 1 : phi) * SECTORS, SECTORS - 1);
	return ring * SECTORS + sector;
}

/* Integrates bsdf_pdf over each bin (Sobol points, because the horizon cuts bins
 * at any angle); the last is what the lobe loses. */
static void expected_shares(const struct lobe_case *c, double *share)
{
	memset(share, 0, BINS * sizeof *share);
	share[BINS - 1] = 1;
	for (int i = 0; i < (BINS - 1) * POINTS; i++) {
		int bin = i / POINTS;
		double x = rng_sobol((uint32_t)(i % POINTS), 0, (uint64_t)bin), w[3];
		double y = rng_sobol((uint32_t)(i % POINTS), 1, (uint64_t)bin);
		double v = (bin / SECTORS + x + 0x1p-33) / RINGS;
		bin_direction(c, v, 2 * PI * (bin % SECTORS + y) / SECTORS, w);
		/* dw = dv dphi / ((k+1) cos^k gamma) */
		double jacobian = 2 * PI / ((c->k + 1) * pow(v, c->k / (c->k + 1)));
		double p = bsdf_pdf(c->m, 0, n, c->known, c->transport, w) * jacobian /
		           ((BINS - 1) * POINTS);
		share[bin] += p;
		share[BINS - 1] -= p;
	}
	if (c->m->lobe == LOBE_PAPER) { /* which loses nothing: the rest is rounding */
		assert_that(fabs(share[BINS - 1]), <, 2e-3);
		share[BINS - 1] = 0;
	}
}

static void count_draws(const struct lobe_case *c, uint64_t seed, double *count)
{
	struct rng r = rng_seed(1, seed);

	memset(count, 0, BINS * sizeof *count);
	for (int i = 0; i < DRAWS; i++) {
		struct bsdf_sample s;
		double u[3];
		draw_three(&r, u);
		bsdf_sample(c->m, 0, n, c->known, c->transport, u, &s);
		if (s.event == BSDF_ABSORBED) {
			count[BINS - 1]++;
			continue;
		}
		assert_int_equal(s.event, c->transmitted ? BSDF_LOBE_T : BSDF_LOBE_R);
		assert_that(v3_dot(c->side, s.w), >, 0);
		count[find_bin(c, s.w)]++;
	}
}

/* Chi-square as a standard normal deviate (Wilson & Hilferty 1931); bins of
 * fewer than 10 expected draws are pooled. */
static double chi_square(const double *share, const double *count, int bins, double draws)
{
	double sum = 0, pool_share = 0, pool_count = 0;
	int freedom = -1;

	for (int i = 0; i <= bins; i++) {
		double e = draws * (i < bins ? share[i] : pool_share);
		double o = i < bins ? count[i] : pool_count;
		if (i < bins && e < 10) {
			pool_share += share[i];
			pool_count += o;
		} else if (i < bins || e > 1) {
			sum += (o - e) * (o - e) / e;
			freedom++;
		} else {
			assert_that(o, <=, 10);
		}
	}
	double v = 2. / (9 * freedom);
	return freedom < 1 ? 0 : (cbrt(sum / freedom) - (1 - v)) / sqrt(v);
}

/* 280 cases; a deviate beyond 4.1 in any of them has probability .6 %: 99 %
 * confidence over the family. */
static void test_chi_square_of_lobes(void **state)
{
	static const double k[] = { 0, .5, 1, 2.5, 10, 100, 1000 };
	static const double degrees[] = { 0, 30, 60, 80, 89 };
	double share[BINS], count[BINS], worst = 0;
	uint64_t cases = 0;

	(void)state;
	for (int kind = LOBE_PAPER; kind <= LOBE_RECIPROCAL; kind++) {
		given("kind %d", kind);
		struct model m;
		begin(&m, 1, (enum lobe_kind)kind);
		for (size_t i = 0; i < COUNT(k) * COUNT(degrees) * 4; i++) {
			struct lobe_case c = { .m = &m, .k = k[i / 20], .transmitted = i & 1,
				.transport = i & 2 ? BSDF_FROM_EYE : BSDF_FROM_LIGHT };
			lobe_setup(&c, degrees[i / 4 % 5]);
			expected_shares(&c, share);
			count_draws(&c, cases++, count);
			double z = chi_square(share, count, BINS, DRAWS);
			if (z > 4.1)
				fail_msg("lobe %d, k = %g, %g degrees, %s, %s: deviate %.2f", kind,
				         c.k, degrees[i / 4 % 5], c.transmitted ? "T" : "R",
				         c.transport == BSDF_FROM_EYE ? "eye" : "light", z);
			worst = fmax(worst, z);
		}
		model_materials_free(&m.material);
	}
	assert_int_equal(cases, 280);
	assert_that(worst, >, 1.5); /* a statistic that never moves is no test */
}

/* ---- everything at once: diffuse, lobes, a pane, three bands, unlike sides ---- */

static void mixed_material(struct model *m, enum lobe_kind kind, int ideal_t)
{
	static const double rho_d[] = { .1, .2, .05, .3, .1, 0 }, tau_d[] = { .2, .1, 0, .1, .2, .3 };
	static const double rho_s[] = { .3, .3, .1, .1, .2, .4 }, tau_s[] = { .2, .4, .6, .4, .3, .1 };

	begin(m, 3, kind);
	struct materials *mt = &m->material;
	memcpy(mt->rho_d, rho_d, sizeof rho_d);
	memcpy(mt->tau_d, tau_d, sizeof tau_d);
	memcpy(mt->rho_s, rho_s, sizeof rho_s);
	memcpy(mt->tau_s, tau_s, sizeof tau_s);
	mt->alpha[FRONT] = 3;
	mt->alpha[BACK] = 7.5;
	mt->beta[FRONT] = ideal_t ? (double)INFINITY : 5;
	mt->beta[BACK] = ideal_t ? (double)INFINITY : 2.5;
}

enum { POLAR = 12, TURN = 16, FINE = 20, SPHERE = POLAR * TURN + 3, MIXED_DRAWS = 100000 };

/* Shares of a grid of equal solid angles about n, of R and T deltas, and of
 * absorption. */
static void mixed_shares(const struct model *m, const double known[3],
                         enum bsdf_transport transport, double *share)
{
	const double cell = 4 * PI / (POLAR * TURN * FINE * FINE);
	double rest = 1;

	memset(share, 0, SPHERE * sizeof *share);
	for (int i = 0; i < POLAR * FINE; i++)
		for (int j = 0; j < TURN * FINE; j++) {
			double z = 1 - 2 * (i + .5) / (POLAR * FINE), w[3];
			direction(acos(z), 2 * PI * (j + .5) / (TURN * FINE), w);
			double p = cell * bsdf_pdf(m, 0, n, known, transport, w);
			share[i / FINE * TURN + j / FINE] += p;
			rest -= p;
		}
	share[SPHERE - 1] = rest;
}

static int sphere_bin(const struct bsdf_sample *s)
{
	double t[3], b[3];

	if (s->event == BSDF_ABSORBED)
		return SPHERE - 1;
	if (s->event == BSDF_IDEAL_R || s->event == BSDF_IDEAL_T)
		return SPHERE - 3 + (s->event == BSDF_IDEAL_T);
	v3_frame(n, t, b);
	double phi = atan2(v3_dot(b, s->w), v3_dot(t, s->w)) / (2 * PI);
	int i = (int)((1 - v3_dot(n, s->w)) / 2 * POLAR);
	int j = (int)((phi < 0 ? phi + 1 : phi) * TURN);
	return (i < POLAR ? i : POLAR - 1) * TURN + (j < TURN ? j : TURN - 1);
}

/* The directional albedo seen from the known direction, by quadrature of f |cos|. */
static void quadrature_albedo(const struct model *m, const double known[3],
                              enum bsdf_transport transport, double *albedo)
{
	enum { STEPS = 600 };
	double f[BANDS_MAX], cell = 4 * PI / (STEPS * STEPS);

	memset(albedo, 0, (size_t)m->bands * sizeof *albedo);
	for (int i = 0; i < STEPS * STEPS; i++) {
		double z = 1 - 2 * (i / STEPS + .5) / STEPS, w[3];
		direction(acos(z), 2 * PI * (i % STEPS + .5) / STEPS, w);
		int light = transport == BSDF_FROM_LIGHT;
		bsdf_eval(m, 0, n, light ? known : w, light ? w : known, f);
		for (int b = 0; b < m->bands; b++)
			albedo[b] += f[b] * fabs(z) * cell;
	}
}

struct mixed_sums {
	double count[SPHERE], mean[3], square[3];
};

/* Draws, checks each sample against bsdf_eval and bsdf_pdf, and sums weights. */
static void mixed_draws(const struct model *m, const double known[3],
                        enum bsdf_transport transport, uint64_t seed, struct mixed_sums *sums)
{
	struct rng r = rng_seed(2, seed);

	memset(sums, 0, sizeof *sums);
	for (int i = 0; i < MIXED_DRAWS; i++) {
		struct bsdf_sample s;
		double u[3], f[3];
		int light = transport == BSDF_FROM_LIGHT;
		draw_three(&r, u);
		bsdf_sample(m, 0, n, known, transport, u, &s);
		sums->count[sphere_bin(&s)]++;
		if (s.pdf > 0) {
			double p = bsdf_pdf(m, 0, n, known, transport, s.w);
			bsdf_eval(m, 0, n, light ? known : s.w, light ? s.w : known, f);
			assert_near(p, s.pdf, 1e-12 * p);
			for (int b = 0; b < 3; b++)
				assert_near(f[b] * fabs(v3_dot(n, s.w)), s.weight[b] * p,
				            1e-12 * s.weight[b] * p);
		}
		for (int b = 0; b < 3; b++) {
			sums->mean[b] += s.weight[b] / MIXED_DRAWS;
			sums->square[b] += s.weight[b] * s.weight[b] / MIXED_DRAWS;
		}
	}
}

/* Chance of each delta: its coefficient's share of the sum of band means. */
static void delta_share(const struct model *m, int side, enum bsdf_transport transport,
                        double *share)
{
	const struct materials *mt = &m->material;
	int across = transport == BSDF_FROM_LIGHT ? side : !side;
	double total = 0, t = 0;

	for (size_t b = 0; b < 3; b++) {
		size_t i = 3 * (size_t)side + b, j = 3 * (size_t)across + b;
		total += mt->rho_d[i] + mt->rho_s[i] + mt->tau_d[j] + mt->tau_s[j];
		t += mt->tau_s[j];
	}
	if (isinf(mt->beta[0])) {
		share[SPHERE - 2] = t / total;
		share[SPHERE - 1] -= t / total;
	}
}

static void check_mixed(const struct model *m, double degrees,
                        enum bsdf_transport transport, uint64_t seed)
{
	double known[3], share[SPHERE], albedo[3];
	struct mixed_sums sums;
	int side = degrees < 90 ? FRONT : BACK;

	direction(degrees * PI / 180, 2, known);
	mixed_shares(m, known, transport, share);
	delta_share(m, side, transport, share);
	if (m->lobe == LOBE_PAPER) /* the density misses nothing but the deltas */
		assert_that(fabs(share[SPHERE - 1]), <, 2e-3);
	share[SPHERE - 1] = m->lobe == LOBE_PAPER ? 0 : share[SPHERE - 1];
	mixed_draws(m, known, transport, seed, &sums);
	double z = chi_square(share, sums.count, SPHERE, MIXED_DRAWS);
	if (z > 4)
		fail_msg("case %d: deviate %.2f", (int)seed, z);

	quadrature_albedo(m, known, transport, albedo);
	for (int b = 0; b < 3; b++) {
		int across = transport == BSDF_FROM_LIGHT ? side : !side;
		if (isinf(m->material.beta[0]))
			albedo[b] += m->material.tau_s[3 * across + b];
		double spread = sqrt(fmax(0, sums.square[b] - sums.mean[b] * sums.mean[b]));
		double allowed = 4.5 * spread / sqrt(MIXED_DRAWS) + 2e-3 * albedo[b];
		if (fabs(sums.mean[b] - albedo[b]) > allowed)
			fail_msg("case %d: mean weight %g, albedo %g, allowed %g", (int)seed,
			         sums.mean[b], albedo[b], allowed);
		if (transport == BSDF_FROM_LIGHT && m->lobe == LOBE_PAPER)
			assert_near(albedo[b], bsdf_albedo(&m->material, 0, side, b), 2e-3);
	}
}

/* 24 grids and 72 means: 99 % over the family. */
static void test_mixed_materials(void **state)
{
	static const double degrees[] = { 10, 70, 130 };
	uint64_t seed = 0;

	(void)state;
	for (int kind = LOBE_PAPER; kind <= LOBE_RECIPROCAL; kind++)
		for (int ideal = 0; ideal < 2; ideal++) {
			given("kind %d, ideal %d", kind, ideal);
			struct model m;
			mixed_material(&m, (enum lobe_kind)kind, ideal);
			for (size_t i = 0; i < COUNT(degrees); i++) {
				check_mixed(&m, degrees[i], BSDF_FROM_LIGHT, seed++);
				check_mixed(&m, degrees[i], BSDF_FROM_EYE, seed++);
			}
			model_materials_free(&m.material);
		}
}

/* ---- closed forms ---- */

/* f(A->B) / f(B->A) of the paper's lobe, A along the normal:
 * N(B) cos A / (N(A) cos B). */
static void test_reciprocity_ratio_table(void **state)
{
	static const double degrees[] = { 30, 60, 75, 85 };
	static const struct {
		double k, ratio[4];
	} table[] = {
		{ 1, { 1.0773502691896257, 1.4999999999999998, 2.431851652578137, 6.23685662283493 } },
		{ 5, { 1.1515690191896257, 1.7929687499999998, 2.8283259596559827, 6.6696198646060205 } },
		{ 20, { 1.154700484447859, 1.9848820835481267, 3.4134442440737285, 7.5007876972169925 } },
		{ 100, { 1.1547005383792515, 1.9999999244082314, 3.8476781479917492, 9.285947156915071 } },
	};
	struct model m;

	(void)state;
	begin(&m, 1, LOBE_PAPER);
	m.material.rho_s[FRONT] = .6;
	for (size_t i = 0; i < COUNT(table); i++)
		for (size_t j = 0; j < COUNT(degrees); j++) {
			given("k %g, %g degrees", table[i].k, degrees[j]);
			double a[3], b[3], ab, ba;
			m.material.alpha[FRONT] = table[i].k;
			direction(0, 0, a);
			direction(degrees[j] * PI / 180, 4, b);
			bsdf_eval(&m, 0, n, a, b, &ab);
			bsdf_eval(&m, 0, n, b, a, &ba);
			assert_near(ab / ba / table[i].ratio[j], 1, 1e-12);
		}
	model_materials_free(&m.material);
}

/* The paper's lobe of exponent 1 for light along the normal is diffuse, to rounding. */
static void test_exponent_one_is_diffuse(void **state)
{
	struct rng r = rng_seed(5, 0);
	struct model m;

	(void)state;
	begin(&m, 1, LOBE_PAPER);
	m.material.rho_s[FRONT] = .6;
	m.material.alpha[FRONT] = 1;
	for (int i = 0; i < 1000; i++) {
		given("i %d", i);
		double from[3], to[3], f;
		direction(0, 0, from);
		direction(PI / 2 * rng_uniform(&r), 2 * PI * rng_uniform(&r), to);
		bsdf_eval(&m, 0, n, from, to, &f);
		assert_near(f * PI / .6, 1, 1e-12);
	}
	model_materials_free(&m.material);
}

static void test_reciprocal_lobe(void **state)
{
	struct rng r = rng_seed(3, 0);
	struct model m;

	(void)state;
	begin(&m, 1, LOBE_RECIPROCAL);
	for (int s = 0; s < 2; s++)
		m.material.rho_s[s] = m.material.tau_s[s] = .5;
	for (int i = 0; i < 20000; i++) {
		double a[3], b[3], ab, ba, k = pow(10, 6 * rng_uniform(&r) - 1);
		for (int s = 0; s < 2; s++)
			m.material.alpha[s] = m.material.beta[s] = k;
		direction(PI * rng_uniform(&r), 2 * PI * rng_uniform(&r), a);
		direction(PI * rng_uniform(&r), 2 * PI * rng_uniform(&r), b);
		bsdf_eval(&m, 0, n, a, b, &ab);
		bsdf_eval(&m, 0, n, b, a, &ba);
		assert_near(ab, ba, 1e-12 * ab);
	}
	model_materials_free(&m.material);
}

static void test_reciprocal_albedo(void **state)
{
	enum { N = 40000 };
	struct rng r = rng_seed(4, 0);
	struct model m;

	(void)state;
	begin(&m, 1, LOBE_RECIPROCAL);
	m.material.rho_s[FRONT] = .8;
	m.material.alpha[FRONT] = 20;
	for (int deg = 5; deg < 90; deg += 12) { /* 8 means within 4 standard errors */
		given("deg %d", deg);
		double known[3], mean = 0, square = 0;
		direction(deg * PI / 180, 0, known);
		for (int i = 0; i < N; i++) {
			struct bsdf_sample s;
			double u[3];
			draw_three(&r, u);
			bsdf_sample(&m, 0, n, known, i & 1 ? BSDF_FROM_EYE : BSDF_FROM_LIGHT, u, &s);
			mean += s.weight[0] / N;
			square += s.weight[0] * s.weight[0] / N;
		}
		assert_near(mean, .8 * bsdf_lobe_albedo(20, cos(deg * PI / 180)),
		            4 * sqrt((square - mean * mean) / N));
	}
	model_materials_free(&m.material);
}

/* ---- sides ---- */

/* Turning the normal over and swapping the sides' coefficients changes nothing. */
static void test_flipped_winding(void **state)
{
	struct model m, turned;
	struct rng r = rng_seed(5, 0);
	const double other[3] = { -n[0], -n[1], -n[2] };

	(void)state;
	mixed_material(&m, LOBE_PAPER, 0);
	mixed_material(&turned, LOBE_PAPER, 0);
	double *const from[] = { m.material.rho_d, m.material.tau_d, m.material.rho_s, m.material.tau_s };
	double *const to[] = { turned.material.rho_d, turned.material.tau_d, turned.material.rho_s,
		turned.material.tau_s };
	for (int i = 0; i < 4; i++)
		for (int b = 0; b < 6; b++)
			to[i][(b + 3) % 6] = from[i][b];
	for (int s = 0; s < 2; s++) {
		turned.material.alpha[s] = m.material.alpha[!s];
		turned.material.beta[s] = m.material.beta[!s];
	}
	for (int i = 0; i < 2000; i++) {
		given("i %d", i);
		double a[3], b[3], f[3], g[3], u[3];
		struct bsdf_sample s, t;
		direction(PI * rng_uniform(&r), 2 * PI * rng_uniform(&r), a);
		direction(PI * rng_uniform(&r), 2 * PI * rng_uniform(&r), b);
		bsdf_eval(&m, 0, n, a, b, f);
		bsdf_eval(&turned, 0, other, a, b, g);
		assert_memory_equal(f, g, sizeof f);
		draw_three(&r, u);
		bsdf_sample(&m, 0, n, a, BSDF_FROM_EYE, u, &s);
		bsdf_sample(&turned, 0, other, a, BSDF_FROM_EYE, u, &t);
		assert_int_equal(s.event, t.event);
	}
	model_materials_free(&m.material);
	model_materials_free(&turned.material);
}

static void test_one_sided(void **state)
{
	struct model m;
	struct bsdf_sample s;
	double behind[3], front[3], f[3], u[3] = { .5, .5, .5 };

	(void)state;
	mixed_material(&m, LOBE_PAPER, 0);
	m.material.one_sided[0] = 1;
	m.material.emission[3] = 1;
	direction(2.5, 0, behind);
	direction(.5, 0, front);
	bsdf_sample(&m, 0, n, behind, BSDF_FROM_LIGHT, u, &s);
	assert_int_equal(s.event, BSDF_ABSORBED);
	bsdf_eval(&m, 0, n, behind, front, f);
	assert_that(f[0], ==, 0);
	assert_that(f[1], ==, 0);
	assert_that(f[2], ==, 0);
	bsdf_emission(&m, 0, n, behind, f);
	assert_that(f[0], ==, 0);
	assert_that(bsdf_exitance(&m.material, 0, BACK, 0), ==, 0);
	assert_that(bsdf_albedo(&m.material, 0, BACK, 0), ==, 0);
	assert_true(!bsdf_has_lobe(&m.material, 0, BACK, 0) && bsdf_has_lobe(&m.material, 0, FRONT, 0));
	model_materials_free(&m.material);
}

static void test_ideal(void **state)
{
	struct model m;
	struct bsdf_sample s;
	double known[3], f, u[3] = { .1, .5, .5 };

	(void)state;
	begin(&m, 1, LOBE_PAPER);
	m.material.rho_s[FRONT] = .6;
	m.material.tau_s[BACK] = .2; /* light from the back, through to the front */
	direction(1, 0, known);
	assert_true(bsdf_has_ideal(&m.material, 0, FRONT, 0) && !bsdf_has_lobe(&m.material, 0, FRONT, 0));
	assert_true(bsdf_has_ideal(&m.material, 0, BACK, 1) && !bsdf_has_ideal(&m.material, 0, FRONT, 1));
	bsdf_sample(&m, 0, n, known, BSDF_FROM_EYE, u, &s);
	assert_that(s.event, ==, BSDF_IDEAL_R);
	assert_that(s.pdf, ==, 0);
	assert_near(s.weight[0], .8, 1e-15);
	u[0] = .9;
	bsdf_sample(&m, 0, n, known, BSDF_FROM_EYE, u, &s);
	assert_that(s.event, ==, BSDF_IDEAL_T);
	assert_near(s.weight[0], .8, 1e-15);
	assert_that(s.w[0], ==, -known[0]);
	assert_that(s.w[1], ==, -known[1]);
	assert_that(s.w[2], ==, -known[2]);
	bsdf_sample(&m, 0, n, known, BSDF_FROM_LIGHT, u, &s);
	assert_that(s.event, ==, BSDF_IDEAL_R);
	assert_near(s.weight[0], .6, 1e-15);
	bsdf_eval(&m, 0, n, known, s.w, &f);
	assert_that(f, ==, 0);
	assert_that(bsdf_pdf(&m, 0, n, known, BSDF_FROM_LIGHT, s.w), ==, 0);
	model_materials_free(&m.material);
}

/* ---- grazing ---- */

static void check_grazing(const struct model *m, const double known[3], const double up[3],
                          struct rng *r)
{
	for (int t = BSDF_FROM_LIGHT; t <= BSDF_FROM_EYE; t++)
		for (int i = 0; i < 200; i++) {
			struct bsdf_sample s;
			double u[3], f[3];
			draw_three(r, u);
			bsdf_sample(m, 0, up, known, (enum bsdf_transport)t, u, &s);
			assert_true(isfinite(s.pdf));
			assert_that(s.pdf, >=, 0);
			for (int b = 0; b < 3; b++)
				assert_true(isfinite(s.weight[b]) && s.weight[b] >= 0);
			bsdf_eval(m, 0, up, known, s.w, f);
			assert_true(isfinite(f[0] + f[1] + f[2]));
			bsdf_eval(m, 0, up, s.w, known, f);
			assert_true(isfinite(f[0] + f[1] + f[2]));
		}
}

static void test_grazing(void **state)
{
	static const double up[3] = { 0, 0, 1 };
	static const double height[] = { 0, 1e-320, 1e-30, 1e-16, 1e-14, 1e-12, 1e-8, 1e-4 };
	struct rng r = rng_seed(6, 0);

	(void)state;
	for (int kind = LOBE_PAPER; kind <= LOBE_RECIPROCAL; kind++)
		for (double k = 0; k <= 1e8; k = 20 * k + .5) {
			given("kind %d, k %g", kind, k);
			struct model m;
			mixed_material(&m, (enum lobe_kind)kind, 0);
			for (int s = 0; s < 2; s++)
				m.material.alpha[s] = m.material.beta[s] = k;
			for (size_t i = 0; i < COUNT(height); i++) {
				double known[3] = { sqrt(1 - height[i] * height[i]), 0, height[i] };
				check_grazing(&m, known, up, &r);
				known[2] = -known[2];
				check_grazing(&m, known, up, &r);
			}
			model_materials_free(&m.material);
		}
}

/* ---- emission ---- */

static void test_emission(void **state)
{
	struct model m;

	(void)state;
	begin(&m, 1, LOBE_PAPER);
	m.material.emission[BACK] = 3;
	for (double e = 1; e < 40; e = 2 * e + .5) {
		given("e %g", e);
		double flux = 0, l, w[3];
		m.material.emission_exponent[BACK] = e;
		for (int i = 0; i < 100000; i++) { /* midpoints in the cosine */
			double c = (i + .5) / 100000;
			direction(PI - acos(c), 0, w);
			bsdf_emission(&m, 0, n, w, &l);
			assert_near(l, 3 * pow(c, e - 1), 1e-9);
			flux += 2 * PI * l * c / 100000;
		}
		assert_near(flux / bsdf_exitance(&m.material, 0, BACK, 0), 1, 1e-6);
		direction(.3, 0, w);
		bsdf_emission(&m, 0, n, w, &l);
		assert_that(l, ==, 0);
		assert_that(bsdf_exitance(&m.material, 0, FRONT, 0), ==, 0);
	}
	model_materials_free(&m.material);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		slow_unit_test(test_chi_square_of_lobes),
		slow_unit_test(test_mixed_materials),
		cmocka_unit_test(test_reciprocity_ratio_table),
		cmocka_unit_test(test_exponent_one_is_diffuse),
		cmocka_unit_test(test_reciprocal_lobe),
		cmocka_unit_test(test_reciprocal_albedo),
		cmocka_unit_test(test_flipped_winding),
		cmocka_unit_test(test_one_sided),
		cmocka_unit_test(test_ideal),
		cmocka_unit_test(test_grazing),
		cmocka_unit_test(test_emission),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
