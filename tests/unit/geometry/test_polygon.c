/* Facets, their form factors by contour and by cubature: against closed forms. */
#include <math.h>

#include "lib/base/constants.h"
#include "lib/geometry/contour.h"
#include "lib/geometry/exchange_unoccluded.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/polygon_scene.h"

static struct facet facet_of(int n, const double *v)
{
	struct facet f = { .n = n, .v = v };

	geo_facet_measure(&f);
	return f;
}

static double fraction(int n, const double *a, int k, const double *b)
{
	struct facet f = facet_of(n, a), g = facet_of(k, b);

	return geo_contour_exchange(&f, &g) / f.area;
}

/* ---- points ---- */

static void test_point(void **state)
{
	/* tests/exact/data/form_factors.json: pt_rect_perp, pt_tri, pt_tri_close. */
	const double up[3] = { 0, 0, 1 }, third = .33333333333333333;
	const double wall[] = { 0, 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1 };
	const double tri[] = { 0, 0, 1, 0, 1, 1.5, 1, 0, .7 };
	const double near[] = { 0, 0, 1e-6, 0, 1, 1e-6, 1, 0, 1e-6 };

	(void)state;
	assert_near(geo_contour_point((double[]){ 1, 0, 0 }, up, 4, wall), .05573419700255350161, 1e-16);
	assert_near(geo_contour_point((double[]){ .1, .2, 0 }, up, 3, tri), .11295688744816556648, 1e-16);
	assert_near(geo_contour_point((double[]){ third, third, 0 }, up, 3, near),
	            .99999999999156228199, 1e-14);
}

/* A point under the corner of a rectangle of sides a, b at height c: Howell B-3. */
static void test_point_small_and_far(void **state)
{
	const double up[3] = { 0, 0, 1 }, x[3] = { 0, 0, 0 };

	(void)state;
	for (double c = 1e-3; c < 2e3; c *= 10) {
		given("c %g", c);
		const double v[] = { 0, 0, c, 0, 1, c, 1, 1, c, 1, 0, c };
		double p = 1 / hypot(1, c), exact = p * atan(p) / PI;
		/* The terms of far polygons cancel: absolute to rounding. */
		assert_near(geo_contour_point(x, up, 4, v), exact, 2e-16);
	}
}

/* ---- exchange ---- */

static void test_parallel(void **state)
{
	const double a[] = { 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0 };
	const double b[] = { 0, 0, 1, 0, 1, 1, 1, 1, 1, 1, 0, 1 };
	const double c[] = { .5, .25, .75, .5, 2, .75, 1.5, 2, .75, 1.5, .25, .75 };

	(void)state;
	assert_near(fraction(4, a, 4, b), .19982489569838738304, 1e-15);
	assert_near(fraction(4, a, 4, c), .23835551517202025989, 1e-15);
}

/* Perpendicular rectangles [x] x [y] at z = 0 and [y] x [z] at x = 0: Howell C-15. */
static double perpendicular(const double x[2], const double y[2], const double eta[2],
                            const double z[2])
{
	double sum = 0;

	for (int n = 0; n < 16; n++) {
		double a = x[n & 1], d = y[n >> 1 & 1] - eta[n >> 2 & 1], c = z[n >> 3];
		double h2 = a * a + c * c, h = sqrt(h2), r2 = h2 + d * d;
		double g = (h > 0 ? d * h * atan(d / h) : 0) - (r2 > 0 ? .25 * (h2 - d * d) * log(r2) : 0);
		sum += __builtin_parity((unsigned)n) ? -g : g;
	}
	return sum / (2 * PI);
}

static double perpendicular_contour(const double x[2], const double y[2], const double eta[2],
                                    const double z[2])
{
	const double a[] = { x[0], y[0], 0, x[1], y[0], 0, x[1], y[1], 0, x[0], y[1], 0 };
	const double b[] = { 0, eta[0], z[0], 0, eta[1], z[0], 0, eta[1], z[1], 0, eta[0], z[1] };
	struct facet f = facet_of(4, a), g = facet_of(4, b);

	return geo_contour_exchange(&f, &g);
}

/* Edges in line: the same, partly overlapping, touching at a corner, apart; and thin. */
static void test_perpendicular(void **state)
{
	const double from = 0, x[][2] = { { 0, 1 }, { 0, .1 }, { 0, 1e-3 }, { .5, 1.5 }, { 1e-7, 1 } };
	const double y[][2] = { { 0, 1 }, { .25, 2 }, { -1, .5 }, { .2, .3 }, { 1, 2 }, { 1.5, 4 } };

	(void)state;
	assert_near(perpendicular_contour(x[3], y[0], y[1], (double[]){ .5, 1 }),
	            .052268665576064740168, 1e-15);
	assert_near(perpendicular_contour(x[1], y[0], y[0], (double[]){ 0, 2 }),
	            .1 * .43755517392044433537, 1e-15);
	for (int i = 0; i < 5; i++)
		for (int j = 0; j < 6; j++)
			for (double top = 1e-3; top < 20; top *= 10) {
				given("i %d, j %d, top %g", i, j, top);
				const double z[2] = { from, top };
				double exact = perpendicular(x[i], y[0], y[j], z);
				assert_near(perpendicular_contour(x[i], y[0], y[j], z), exact,
				            2e-14 * (1 + top) * (1 + top));
			}
}

/* tests/exact/data/form_factors.json. */
static void test_triangles(void **state)
{
	const double right[] = { 0, 0, 0, 1, 0, 0, 0, 1, 0 }, high[] = { 0, 0, 0, 1, 0, 0, .5, 1, 0 };
	const double corner[] = { 0, 0, 0, 0, 0, 1, 1, 0, 0 };
	const double vertex[] = { 0, 0, 0, -.5, .5, 1, .5, .5, 1 };
	const double at10[] = { 0, 0, 0, .5, .98480775301220805937, .17364817766693034885, 1, 0, 0 };
	const double at179[] = { 0, 0, 0, .5, -.99984769515639123916, .017452406437283512819, 1, 0, 0 };
	const double needle[2][9] = { { 0, 0, 0, .001, 0, 0, 0, 1, 0 }, { 0, 0, 0, 0, 1, 0, 0, 0, .001 } };

	(void)state;
	assert_near(fraction(3, right, 3, corner), .21132486540518711775, 1e-14);
	assert_near(fraction(3, right, 3, vertex), .11675155427561136122, 1e-14);
	assert_near(fraction(3, high, 3, at10), .84713792811846125666, 1e-14);
	assert_near(fraction(3, high, 3, at179), .000026142785292725882869, 1e-14);
	assert_near(fraction(3, needle[0], 3, needle[1]), .29278293134766831249, 1e-11);
}

/* Turned by a little about the common axis, squares change by its square. */
static void test_nearly_parallel(void **state)
{
	const double a[] = { 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0 };
	double before = .19982489569838738304;

	(void)state;
	for (double angle = 1e-6; angle > 5e-17; angle /= 10) {
		given("angle %g", angle);
		double b[12];
		for (int i = 0; i < 4; i++) {
			double x = i > 1 ? .5 : -.5, y = i == 1 || i == 2 ? .5 : -.5;
			b[3 * i] = .5 + x - angle * y;
			b[3 * i + 1] = .5 + y + angle * x;
			b[3 * i + 2] = 1;
		}
		assert_near(fraction(4, a, 4, b), before, angle * angle + 2e-14);
	}
}

/* The same bits both ways, and whatever corner comes first to rounding. */
static void test_both_ways(void **state)
{
	struct dice d = { 7, 0 };

	(void)state;
	for (int k = 0; k < 50; k++) {
		given("k %d", k);
		double a[9], b[9], turned[9];
		for (int i = 0; i < 9; i++) {
			a[i] = roll(&d, 0, 1) * (i % 3 != 2);
			b[i] = roll(&d, 0, 1) + (i % 3 == 2);
		}
		struct facet f = facet_of(3, a), g = facet_of(3, b);
		for (int i = 0; i < 9; i++)
			turned[i] = b[(i + 3) % 9];
		struct facet h = facet_of(3, turned);
		if (f.normal[2] < 0 || v3_dot(g.normal, f.v) - g.offset < 0 ||
		    v3_dot(g.normal, &f.v[3]) - g.offset < 0 || v3_dot(g.normal, &f.v[6]) - g.offset < 0)
			continue;
		double one = geo_contour_exchange(&f, &g);
		assert_near(geo_contour_exchange(&g, &f), one, 1e-14);
		assert_near(geo_contour_exchange(&f, &h), one, 1e-14);
	}
}

/* ---- cubature ---- */

static void random_facet(struct dice *d, int quad, double size, const double at[3], double v[12])
{
	double frame[3][3], u = size * roll(d, .3, 1), w = size * roll(d, .3, 1), skew = roll(d, -.5, .5);

	roll_frame(d, 0, frame);
	for (int k = 0; k < 3; k++) {
		double x = u * frame[0][k], y = w * (frame[1][k] + (quad ? 0 : skew * frame[0][k]));
		v[k] = at[k];
		v[3 + k] = at[k] + x;
		v[(quad ? 9 : 6) + k] = at[k] + y;
		if (quad)
			v[6 + k] = at[k] + x + y;
	}
}

static int in_front(const struct facet *f, const struct facet *g)
{
	double low, high;

	geo_facet_heights(g, f->normal, f->offset, &low, &high);
	return low > 0;
}

static double spread_over(const struct facet *f, const struct cubature *c, const struct facet *g)
{
	double sum = 0;

	for (int i = 0; i < c->n; i++) {
		double x[3] = { c->x[i], c->y[i], c->z[i] };
		sum += c->w[i] > 0 ? c->w[i] * geo_contour_point(x, f->normal, g->n, g->v) : 0;
	}
	return sum;
}

/* A facet at each level, seen by a far smaller one as near as that level may be used. */
static void test_cubature_reach(void **state)
{
	static const double tolerance[] = { 1e-4, 1e-6 };
	struct dice d = { 3, 0 };
	double reach[CUBATURE_LEVELS], x[2][4][36];

	(void)state;
	for (int t = 0; t < 2; t++)
		for (int pair = 0; pair < 20000; pair++) {
			double v[12], w[12], at[3], frame[3][3];
			int l = pair % CUBATURE_LEVELS, quad = l == 0 || pair / 4 % 2;
			struct cubature p = { 0, x[0][0], x[0][1], x[0][2], x[0][3] };
			struct cubature q = { 0, x[1][0], x[1][1], x[1][2], x[1][3] };
			geo_cubature_reach(tolerance[t], reach);
			random_facet(&d, quad, 1, (double[]){ 0, 0, 0 }, v);
			struct facet f = facet_of(quad ? 4 : 3, v);
			roll_frame(&d, 0, frame);
			v3_mad(f.centre, (reach[l] + .02) * f.radius, frame[2], at);
			random_facet(&d, 1, .01 * f.radius, at, w);
			struct facet g = facet_of(4, w);
			if (!in_front(&f, &g) || !in_front(&g, &f))
				continue;
			geo_cubature_fill(&f, l, &p);
			geo_cubature_fill(&g, 3, &q);
			double exact = spread_over(&g, &q, &f), got = geo_cubature_exchange(&f, &p, &g, &q);
			assert_near(got, exact, tolerance[t] * exact + 1e-15 * g.area);
			assert_near(geo_cubature_exchange(&g, &q, &f, &p), got, 1e-14 * got);
		}
}

static void test_cubature_weights(void **state)
{
	struct dice d = { 5, 0 };
	double x[4][CUBATURE_LEVELS * 36 * 7];

	(void)state;
	for (int n = 3; n <= FACET_CORNERS; n++) {
		given("n %d", n);
		double v[FACET_CORNERS * 3], a = roll(&d, .3, 1), b = roll(&d, .3, 1);
		for (int i = 0; i < n; i++) {
			v[3 * i] = a * cos(2 * PI * i / n);
			v[3 * i + 1] = b * sin(2 * PI * i / n);
			v[3 * i + 2] = .5 * v[3 * i];
		}
		struct facet f = facet_of(n, v);
		for (int l = 0; l < CUBATURE_LEVELS; l++) {
			struct cubature c = { 0, x[0], x[1], x[2], x[3] };
			double sum = 0;
			geo_cubature_fill(&f, l, &c);
			assert_int_equal(c.n, geo_cubature_points(n, l));
			assert_int_equal(c.n % 4, 0);
			for (int i = 0; i < c.n; i++) {
				sum += c.w[i];
				double at[3] = { c.x[i], c.y[i], c.z[i] };
				assert_near(v3_dot(f.normal, at), f.offset, 1e-15);
			}
			assert_near(sum, f.area, 1e-14);
		}
	}
}

/* A parallelogram, its corners off by `skew`. */
static void random_parallelogram(struct dice *d, double size, double skew, const double at[3],
                                 double v[12])
{
	double frame[3][3], u[2] = { roll(d, .2, 1), 0 }, w[2] = { roll(d, -.5, .5), roll(d, .2, 1) };

	roll_frame(d, 0, frame);
	for (int i = 0; i < 4; i++) {
		double su = i == 1 || i == 2 ? 1 : -1, sw = i > 1 ? 1 : -1;
		double x = su * u[0] + sw * w[0] + skew * roll(d, -1, 1);
		double y = sw * w[1] + skew * roll(d, -1, 1);
		for (int k = 0; k < 3; k++)
			v[3 * i + k] = at[k] + size * (x * frame[0][k] + y * frame[1][k]);
	}
}

/* Moves g until its lowest corner is on f's plane. */
static void touch(const struct facet *f, double g[12])
{
	double low = INFINITY;

	for (int i = 0; i < 4; i++)
		low = fmin(low, v3_dot(f->normal, &g[3 * i]) - f->offset);
	for (int i = 0; i < 4; i++)
		v3_mad(&g[3 * i], 1e-9 - low, f->normal, &g[3 * i]);
}

/* The rule for two at once, where it says that it does, against products of 36 points each. */
static void test_fitted_pair(void **state)
{
	static const double tolerance[] = { 1e-5, 8e-7, 1e-9 };
	struct dice d = { 17, 0 };
	double x[2][4][36];
	struct cubature p = { 0, x[0][0], x[0][1], x[0][2], x[0][3] };
	struct cubature q = { 0, x[1][0], x[1][1], x[1][2], x[1][3] };
	int used = 0;

	(void)state;
	for (int t = 0; t < 60000; t++) {
		double v[12], w[12], at[3], way[3][3], size = exp(roll(&d, -4, 0)), skew = t % 5 ? 0 : 1e-6;
		double tol = tolerance[t % 3], far = (1 + size) * exp(roll(&d, 1.6, 3.8));
		struct cubature_pair jf, jg;
		roll_frame(&d, 0, way);
		for (int k = 0; k < 3; k++)
			at[k] = far * way[0][k];
		random_parallelogram(&d, 1, skew, (double[]){ 0, 0, 0 }, v);
		random_parallelogram(&d, size, skew, at, w);
		struct facet f = facet_of(4, v), g = facet_of(4, w);
		if (t % 2)
			touch(&f, w);
		g = facet_of(4, w);
		if (t % 4 == 1)
			touch(&g, v);
		f = facet_of(4, v);
		geo_pair_fill(&f, &jf);
		geo_pair_fill(&g, &jg);
		if (!in_front(&f, &g) || !in_front(&g, &f) || !geo_pair_reaches(&f, &jf, &g, &jg, tol))
			continue;
		used++;
		geo_cubature_fill(&f, 3, &p);
		geo_cubature_fill(&g, 3, &q);
		double exact = geo_cubature_exchange(&f, &p, &g, &q);
		assert_near(geo_pair_exchange(&f, &jf, &g, &jg), exact, (tol + 1e-13) * exact);
	}
	assert_that(used, >, 1000);
}

/* Four pairs at a time: as one by one, the same bits whichever facet of a pair is given. */
static void test_pair_table(void **state)
{
	enum { N = 40 };
	const double tolerance = 8e-7, near = 1e-9;
	struct dice d = { 19, 0 };
	double v[N][12], one[PAIR_ONE], x[4], other[4], low, high;
	struct facet f[N];
	struct cubature_pair fitted[N];
	struct cubature_pair_table t;
	struct err e = { 0 };
	int reached = 0, behind = 0;

	(void)state;
	for (int i = 0; i < N; i++) {
		double at[3];
		for (int k = 0; k < 3; k++)
			at[k] = i % 4 == 1 && k == 2 ? 0 : 8 * roll(&d, -1, 1);
		random_parallelogram(&d, .3, 0, at, v[i]);
		for (int k = 0; i % 4 == 1 && k < 4; k++)
			v[i][3 * k + 2] = 0; /* many in one plane */
		f[i] = facet_of(i % 7 ? 4 : 3, v[i]);
		geo_pair_fill(&f[i], &fitted[i]);
	}
	assert_int_equal(geo_pair_table_new(f, fitted, N, tolerance, near, &t, &e), 0);
	for (size_t i = 0; i < N; i++)
		for (size_t j = 0; j < N; j++) {
			geo_pair_one(&t, i, one);
			int known = geo_pair_four(&t, one, j, 0, x) & 1;
			geo_pair_one(&t, j, one);
			assert_int_equal(known, geo_pair_four(&t, one, i, 1, other) & 1);
			int front = in_front(&f[i], &f[j]) && in_front(&f[j], &f[i]);
			if (!known) {
				assert_true(i == j || !front || !geo_pair_reaches(&f[i], &fitted[i], &f[j],
				                                                  &fitted[j], .999 * tolerance) ||
				            v3_dot(f[i].normal, f[j].centre) - f[i].offset < f[j].radius ||
				            v3_dot(f[j].normal, f[i].centre) - f[j].offset < f[i].radius);
				continue;
			}
			assert_that(x[0], ==, other[0]);
			if (x[0] > 0) {
				double exact = geo_pair_exchange(&f[i], &fitted[i], &f[j], &fitted[j]);
				assert_true(front);
				assert_near(x[0], exact, 1e-13 * exact);
				reached++;
				continue;
			}
			geo_facet_heights(&f[j], f[i].normal, f[i].offset, &low, &high);
			if (high > near)
				geo_facet_heights(&f[i], f[j].normal, f[j].offset, &low, &high);
			assert_that(high, <=, near);
			behind++;
		}
	assert_that(reached, >, 100);
	assert_that(behind, >, 100);
	geo_pair_table_free(&t);
}

/* What is chosen for a pair, far, near, unequal or touching: within what was asked for. */
static void test_clear(void **state)
{
	static const double relative[] = { 8e-7, 1e-9 };
	struct dice d = { 11, 0 };
	static struct unoccluded c;

	(void)state;
	for (int t = 0; t < 2; t++) {
		given("tolerance %g", relative[t]);
		geo_unoccluded_init(&c, relative[t]);
		for (int pair = 0; pair < 3000; pair++) {
			double v[12], w[12], at[3], size = exp(roll(&d, -6, 0)), gap = exp(roll(&d, -4, 2));
			for (int k = 0; k < 3; k++)
				at[k] = gap * roll(&d, -1, 1);
			int quad = roll_int(&d, 0, 1);
			random_facet(&d, quad, 1, (double[]){ 0, 0, 0 }, v);
			random_facet(&d, 1, size, at, w);
			struct facet f = facet_of(3 + quad, v), g = facet_of(4, w);
			if (!in_front(&f, &g) || !in_front(&g, &f))
				continue;
			struct cubature_pair jf, jg;
			geo_pair_fill(&f, &jf);
			geo_pair_fill(&g, &jg);
			double got = geo_unoccluded_exchange(&c, &f, (struct unoccluded_points){ NULL, &jf },
			                                     &g, (struct unoccluded_points){ NULL, &jg });
			double exact = geo_contour_exchange(&f, &g);
			assert_near(got, exact, relative[t] * exact +
			            2e-14 * (f.radius + g.radius) * (f.radius + g.radius));
		}
	}
}

/* ---- facets ---- */

static void assert_plane(const struct facet *part, const struct facet *whole)
{
	for (int i = 0; i < part->n; i++)
		assert_near(v3_dot(whole->normal, &part->v[3 * i]), whole->offset, 1e-15);
	for (int k = 0; k < 3; k++)
		assert_that(part->normal[k], ==, whole->normal[k]);
	assert_that(part->offset, ==, whole->offset);
}

static void test_facet_parts(void **state)
{
	struct dice d = { 13, 0 };

	(void)state;
	for (int k = 0; k < 2000; k++) {
		given("k %d", k);
		int n = roll_int(&d, 3, FACET_CORNERS - 2);
		double v[FACET_CORNERS * 3], frame[3][3], plane[3][3], a = roll(&d, .01, 1);
		roll_frame(&d, 0, frame);
		for (int i = 0; i < n; i++)
			for (int c = 0; c < 3; c++)
				v[3 * i + c] = a * cos(2 * PI * i / n) * frame[0][c] + sin(2 * PI * i / n) * frame[1][c];
		struct facet f = facet_of(n, v);
		struct facet_room part[4];
		roll_frame(&d, 0, plane);
		double offset = v3_dot(plane[2], f.centre) + roll(&d, -.1, .1) * a;
		if (geo_facet_split(&f, plane[2], offset, part)) {
			assert_near(part[0].f.area + part[1].f.area, f.area, 1e-14);
			assert_plane(&part[0].f, &f);
			assert_plane(&part[1].f, &f);
		}
		assert_true(geo_facet_halve(&f, part));
		assert_near(part[0].f.area + part[1].f.area, f.area, 1e-14);
		if (!geo_facet_quarter(&f, part))
			continue;
		double sum = 0;
		for (int i = 0; i < 4; i++) {
			sum += part[i].f.area;
			assert_plane(&part[i].f, &f);
		}
		assert_near(sum, f.area, 1e-14);
	}
}

static void test_facet_clip(void **state)
{
	const double v[] = { 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0 }, x[3] = { 1, 0, 0 };
	struct facet f = facet_of(4, v);
	struct facet_room out;

	(void)state;
	assert_true(geo_facet_clip(&f, x, .25, &out));
	assert_near(out.f.area, .75, 1e-16);
	assert_int_equal(out.f.n, 4);
	assert_true(geo_facet_clip(&f, x, 0, &out));
	assert_that(out.f.area, ==, 1);
	assert_false(geo_facet_clip(&f, x, 1, &out));
	assert_false(geo_facet_clip(&f, x, 2, &out));
	assert_true(geo_facet_clip(&f, x, .5, &out));
	assert_true(geo_facet_clip(&out.f, (double[]){ 0, 1, 0 }, .5, &out));
	assert_near(out.f.area, .25, 1e-16);
}

static void test_edge_divide(void **state)
{
	struct dice d = { 17, 0 };

	(void)state;
	for (int i = 0; i < 1000; i++) {
		given("i %d", i);
		double a[3], b[3], p[3], q[3], ha = roll(&d, 1e-9, 1), hb = -roll(&d, 1e-9, 1);
		for (int k = 0; k < 3; k++) {
			a[k] = roll(&d, -1, 1);
			b[k] = roll(&d, -1, 1);
		}
		geo_edge_divide(a, ha, b, hb, p);
		geo_edge_divide(b, hb, a, ha, q);
		assert_memory_equal(p, q, sizeof p);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_point),
		cmocka_unit_test(test_point_small_and_far),
		cmocka_unit_test(test_parallel),
		cmocka_unit_test(test_perpendicular),
		cmocka_unit_test(test_triangles),
		cmocka_unit_test(test_nearly_parallel),
		cmocka_unit_test(test_both_ways),
		cmocka_unit_test(test_cubature_reach),
		cmocka_unit_test(test_cubature_weights),
		cmocka_unit_test(test_fitted_pair), cmocka_unit_test(test_pair_table),
		cmocka_unit_test(test_clear),
		cmocka_unit_test(test_facet_parts),
		cmocka_unit_test(test_facet_clip),
		cmocka_unit_test(test_edge_divide),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
