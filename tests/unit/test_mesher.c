/* Elements and patches of shapes whose right division is known. */
#include <time.h>

#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/shapes.h"

static void test_square(void **state)
{
	struct model m;
	struct mesh_report r;

	(void)state;
	make_square(&m);
	r = run(&m, sizes(.25, .25, 0));
	assert_int_equal(m.patch.n, 16);
	assert_int_equal(r.planar_patches, 16);
	for (size_t p = 0; p < m.patch.n; p++) {
		given("p %zu", p);
		assert_int_equal(m.patch.loop[p + 1], p + 1);
		assert_int_equal(m.patch.loop_start[p + 1] - m.patch.loop_start[p], 4);
		assert_near(m.patch.area[p], 1. / 16, 1e-15);
	}
	assert_int_equal(m.element.n, 64);
	assert_that(r.area_back, ==, r.area_front);
	assert_int_equal(r.open_edges, 4);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.closed_components, 0);
	assert_int_equal(r.two_sided, 1);
	mesh_report_free(&r);
	model_free(&m);
}

static void test_unbounded(void **state)
{
	struct model m;
	struct mesh_report r;

	(void)state;
	make_square(&m);
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 1));
	assert_int_equal(m.patch.n, 1);
	assert_int_equal(m.element.n, 2);
	assert_int_equal(m.splits, 0);
	assert_int_equal(m.patch.loop_indices, 4);
	mesh_report_free(&r);
	model_free(&m);
}

/* Rectangles up to sqrt(3) times as long as wide are divided into rectangles;
 * longest-edge bisection leaves ragged borders in longer ones. */
static void test_rectangles(void **state)
{
	static const double length[3] = { 1.3, 1.7, 4 };

	(void)state;
	for (int i = 0; i < 3; i++) {
		given("length %g", length[i]);
		struct model m;
		begin(&m, 1, 0);
		add_rectangle(&m, (double[]){ 1, 2, 3 }, (double[]){ 0, 0, length[i] },
		              (double[]){ 1, 0, 0 }, 0);
		transform(&m, 1, 1, 0);
		struct mesh_report r = run(&m, sizes(.5, .2, 0));
		assert_int_equal(m.patch.n, i == 2 ? 16 : 8);
		double even = length[i] / (double)m.patch.n;
		for (size_t p = 0; p < m.patch.n; p++)
			assert_near(m.patch.area[p], even, (i == 2 ? .1 * even : 1e-12));
		if (i < 2)
			assert_int_equal(m.patch.loop_indices, 4 * m.patch.n);
		mesh_report_free(&r);
		model_free(&m);
	}
}

static void test_cube(void **state)
{
	struct model m;
	struct mesh_report r;

	(void)state;
	make_cube(&m);
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 0));
	assert_int_equal(m.patch.n, 6);
	assert_int_equal(r.planar_patches, 6);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.closed_components, 1);
	assert_int_equal(r.open_edges, 0);
	assert_near(r.area_front, 6, 1e-14);
	assert_that(r.area_back, ==, 0);
	assert_int_equal(m.vertices, 8);
	mesh_report_free(&r);
	model_free(&m);
}

/* The default sizes on a closed room: about a thousand patches. */
static void test_room(void **state)
{
	struct model m;
	struct mesh_report r;

	(void)state;
	make_room(&m);
	r = run(&m, sizes(.05, .04, 1));
	assert_int_equal(m.patch.n, 6 * 256);
	assert_int_equal(m.element.n, 6 * 1024);
	assert_int_equal(r.total.welded, 12);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.closed_components, 1);
	mesh_report_free(&r);
	model_free(&m);
}

/* An L of three squares, of which the corner one has a square hole. */
static void make_l_shape(struct model *m)
{
	static const double outer[4][2] = { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } };

	begin(m, 1, 0);
	for (int i = 0; i < 4; i++)
		mesh_add_vertex(m, outer[i][0], outer[i][1], 0);
	for (int i = 0; i < 4; i++)
		mesh_add_vertex(m, .25 + .5 * outer[i][0], .25 + .5 * outer[i][1], 0);
	for (uint32_t i = 0; i < 4; i++)
		add_quad(m, i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i, 0);
	mesh_add_vertex(m, 2, 0, 0);
	mesh_add_vertex(m, 2, 1, 0);
	add_quad(m, 1, 8, 9, 2, 0);
	mesh_add_vertex(m, 1, 2, 0);
	mesh_add_vertex(m, 0, 2, 0);
	add_quad(m, 3, 2, 10, 11, 0);
}

static void test_l_shape(void **state)
{
	struct model m;
	struct mesh_report r;

	(void)state;
	make_l_shape(&m);
	r = run(&m, sizes((double)INFINITY, .1, 0));
	assert_int_equal(m.patch.n, 1);
	assert_int_equal(m.patch.loops, 2);
	assert_int_equal(m.patch.loop_start[1], 6);
	assert_int_equal(m.patch.loop_start[2], 10);
	assert_near(m.patch.area[0], 2.75, 1e-12);
	mesh_report_free(&r);
	model_free(&m);

	make_l_shape(&m);
	transform(&m, 1, 1, 0);
	r = run(&m, sizes(.25, .1, 0));
	assert_int_equal(r.planar_patches, m.patch.n);
	assert_in_range(m.patch.n, 44, 60);
	mesh_report_free(&r);
	model_free(&m);
}

static void test_sphere(void **state)
{
	struct model m;
	struct mesh_report r;

	(void)state;
	make_sphere(&m, 5);
	assert_int_equal(m.triangle.n, 20480);
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 0));
	assert_int_equal(m.element.n, 20480);
	assert_int_equal(m.vertices, 10242);
	assert_in_range(m.patch.n, 33, 160); /* a sphere has 33 cones of 20 degrees */
	assert_that(r.planar_patches, <, 10); /* left-over single facets */
	assert_int_equal(r.closed_components, 1);
	mesh_report_free(&r);
	model_free(&m);

	make_sphere(&m, 3);
	r = run(&m, sizes(.17, .1, 0)); /* facets of .15 get patches of their own */
	assert_int_equal(r.planar_patches, m.patch.n);
	assert_int_equal(m.patch.n, 1280);
	mesh_report_free(&r);
	model_free(&m);
}

/* A fine round bar: strips along it, not rings. */
static void test_cylinder(void **state)
{
	enum { AROUND = 64, ALONG = 32 };
	struct model m;
	struct mesh_report r;

	(void)state;
	begin(&m, 1, 1);
	for (int j = 0; j <= ALONG; j++)
		for (int i = 0; i < AROUND; i++) {
			double a = 2 * acos(-1) * i / AROUND;
			mesh_add_vertex(&m, .05 * cos(a), .05 * sin(a), 2. * j / ALONG);
		}
	for (uint32_t j = 0; j < ALONG; j++)
		for (uint32_t i = 0; i < AROUND; i++) {
			uint32_t n = (i + 1) % AROUND;
			add_quad(&m, AROUND * j + i, AROUND * j + n, AROUND * j + AROUND + n,
			         AROUND * j + AROUND + i, 0);
		}
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 0));
	assert_in_range(m.patch.n, 9, 18);
	mesh_report_free(&r);
	model_free(&m);
}

/* Same counts whatever the scale, place and direction of the scene. */
static void test_invariance(void **state)
{
	static const struct { double scale, offset; int turn; } t[] = { { 1, 0, 0 },
		{ 1e-6, 0, 0 }, { 1e6, 0, 0 }, { 1, 1e6, 0 }, { 1, 0, 1 }, { 3e-6, 0, 1 },
		{ 1, 1e6, 1 } };
	size_t patches[3] = { 0 }, elements[3] = { 0 };

	(void)state;
	for (size_t i = 0; i < sizeof t / sizeof *t; i++)
		for (int shape = 0; shape < 3; shape++) {
			given("i %zu, shape %d", i, shape);
			struct model m;
			if (shape == 0)
				make_room(&m);
			else if (shape == 1)
				make_l_shape(&m);
			else
				make_sphere(&m, 4);
			transform(&m, t[i].scale, t[i].turn, t[i].offset);
			struct mesh_report r = run(&m, sizes(.11, .043, 1));
			if (i == 0) {
				patches[shape] = m.patch.n;
				elements[shape] = m.element.n;
			}
			assert_int_equal(r.total.degenerate + r.total.duplicate, 0);
			if (t[i].offset == 0 || shape == 0) {
				double slack = t[i].turn ? .05 : 0;
				assert_close((double)m.patch.n, (double)patches[shape], slack);
				assert_close((double)m.element.n, (double)elements[shape], slack);
			}
			mesh_report_free(&r);
			model_free(&m);
		}
}

/* Turned scenes with sizes in metres: the same patches. */
static void test_rotation(void **state)
{
	(void)state;
	for (int shape = 0; shape < 3; shape++) {
		given("shape %d", shape);
		struct model m[2];
		struct mesh_report r[2];
		for (int turn = 0; turn < 2; turn++) {
			if (shape == 0)
				make_room(&m[turn]);
			else if (shape == 1)
				make_l_shape(&m[turn]);
			else
				make_sphere(&m[turn], 4);
			transform(&m[turn], 1, turn, 0);
			r[turn] = run(&m[turn], sizes(.11, .043, 0));
		}
		assert_int_equal(m[0].element.n, m[1].element.n);
		if (shape < 2)
			assert_int_equal(m[0].patch.n, m[1].patch.n);
		for (int turn = 0; turn < 2; turn++) {
			mesh_report_free(&r[turn]);
			model_free(&m[turn]);
		}
	}
}

static int compare_doubles(const void *pa, const void *pb)
{
	double a = *(const double *)pa, b = *(const double *)pb;

	return a < b ? -1 : a > b;
}

/* The triangles in another order give the same patches in the same order. */
static void test_permuted(void **state)
{
	struct model m[2];
	struct mesh_report r[2];
	struct rng g = rng_seed(3, 0);

	(void)state;
	for (int i = 0; i < 2; i++)
		make_sphere(&m[i], 4);
	for (size_t t = m[1].triangle.n - 1; t > 0; t--) {
		size_t other = rng_next(&g) % (t + 1);
		for (size_t k = 0; k < 3; k++) {
			uint32_t swap = m[1].triangle.corner[3 * t + k];
			m[1].triangle.corner[3 * t + k] = m[1].triangle.corner[3 * other + k];
			m[1].triangle.corner[3 * other + k] = swap;
		}
	}
	for (int i = 0; i < 2; i++)
		r[i] = run(&m[i], sizes(.3, .1, 0));
	assert_int_equal(m[0].patch.n, m[1].patch.n);
	assert_int_equal(m[0].element.n, m[1].element.n);
	for (size_t p = 0; p < m[0].patch.n; p++) {
		given("p %zu", p);
		assert_near(m[0].patch.area[p], m[1].patch.area[p], 1e-14);
	}
	for (int i = 0; i < 2; i++)
		qsort(m[i].element.area, m[i].element.n, sizeof(double), compare_doubles);
	for (size_t i = 0; i < m[0].element.n; i++) {
		given("i %zu", i);
		assert_that(m[0].element.area[i], ==, m[1].element.area[i]);
	}
	for (int i = 0; i < 2; i++) {
		mesh_report_free(&r[i]);
		model_free(&m[i]);
	}
}

static void make_soup(struct model *m, size_t n)
{
	struct rng g = rng_seed(11, 0);

	begin(m, 1, 0);
	m->vertex = malloc(9 * n * sizeof *m->vertex);
	m->triangle.corner = malloc(3 * n * sizeof *m->triangle.corner);
	m->triangle.surface = calloc(n, sizeof *m->triangle.surface);
	m->vertices = 3 * n;
	m->triangle.n = n;
	for (size_t t = 0; t < n; t++) {
		double at[3] = { rng_uniform(&g), rng_uniform(&g), rng_uniform(&g) };
		for (size_t i = 0; i < 9; i++) {
			m->vertex[9 * t + i] = at[i % 3] + .01 * rng_uniform(&g);
			m->triangle.corner[3 * t + i / 3] = (uint32_t)(3 * t + i / 3);
		}
	}
}

static void test_soup(void **state)
{
	struct model m;
	struct mesh_report r = { 0 };
	struct err e = { 0 };
	struct mesh_options o = sizes(.05, .04, 1);

	(void)state;
	make_soup(&m, 100000);
	clock_t begun = clock();
	assert_int_equal(mesh_run(&m, &o, &r, &e), 0);
	double seconds = (double)(clock() - begun) / CLOCKS_PER_SEC;
	print_message("100k loose triangles: %.2f s\n", seconds);
#ifndef __SANITIZE_ADDRESS__
	assert_that(seconds, <, 2);
#endif
	assert_in_range(m.element.n, 100000 - 10, 100000);
	mesh_report_free(&r);
	model_free(&m);
}

/* Elements without a size of their own fit into patches. */
static void test_element_within_patch(void **state)
{
	static const double patch[2] = { .125, 3 };

	(void)state;
	for (int i = 0; i < 2; i++) {
		given("patch %g", patch[i]);
		struct model m;
		struct mesh_options o = sizes(patch[i], .25, 0);
		make_square(&m);
		o.element_within_patch = 1;
		struct mesh_report r = run(&m, o);
		assert_that(r.element_size, ==, (i ? .25 : .125));
		assert_int_equal(m.patch.n, i ? 1 : 64);
		mesh_report_free(&r);
		model_free(&m);
	}
}

/* The longest edge of elements whose centres are within `reach` of the segment from (x, a, z) to
 * (x, b, z). */
static double longest_near(const struct model *m, double x, double a, double b, double z, double reach)
{
	double most = 0;

	for (size_t i = 0; i < m->element.n; i++) {
		const double *v[3];
		double centre[3] = { 0 }, d[3];
		for (int k = 0; k < 3; k++) {
			v[k] = &m->vertex[3 * (size_t)m->element.corner[3 * i + (size_t)k]];
			v3_mad(centre, 1. / 3, v[k], centre);
		}
		d[0] = centre[0] - x;
		d[1] = centre[1] - fmin(b, fmax(a, centre[1]));
		d[2] = centre[2] - z;
		for (int k = 0; k < 3 && v3_length(d) < reach; k++) {
			double edge[3];
			v3_sub(v[(k + 1) % 3], v[k], edge);
			most = fmax(most, v3_length(edge));
		}
	}
	return most;
}

/* A lamp close to a wall: small elements before its outline, and not elsewhere; none behind it. */
static void test_near_lamp(void **state)
{
	size_t n[3];

	(void)state;
	for (int lit = 0; lit < 3; lit++) { /* by none, this side, the other */
		struct model m;
		begin(&m, 7, 1);
		add_room(&m);
		add_rectangle(&m, (double[]){ .05, .1, .1 }, (double[]){ 0, 0, .8 },
		              (double[]){ 0, .8, 0 }, 6);
		m.material.one_sided[6] = 0;
		if (lit)
			m.material.emission[2 * 6 + lit - 1] = 1;
		struct mesh_report r = run(&m, sizes(.3, .3, 0));
		n[lit] = m.element.n;
		if (lit == 1) {
			assert_that(longest_near(&m, 0, .2, .8, .1, .02), <, .08);
			assert_that(longest_near(&m, 0, .4, .6, .5, .1), >, .1);
		}
		if (lit == 2)
			assert_that(longest_near(&m, 0, .2, .8, .1, .15), >, .1);
		mesh_report_free(&r);
		model_free(&m);
	}
	assert_that(n[1], <, 8 * n[0]);
	assert_that(n[2], <, n[1]);
}

static void test_too_fine(void **state)
{
	struct model m;
	struct mesh_report r = { 0 };
	struct err e = { 0 };
	struct mesh_options o = sizes(.1, 1e-7, 0);

	(void)state;
	make_square(&m);
	assert_int_equal(mesh_run(&m, &o, &r, &e), -1);
	assert_non_null(strstr(e.text, "element size"));
	mesh_report_free(&r);
	model_free(&m);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_square),
		cmocka_unit_test(test_unbounded),
		cmocka_unit_test(test_rectangles),
		cmocka_unit_test(test_cube),
		cmocka_unit_test(test_room),
		cmocka_unit_test(test_l_shape),
		cmocka_unit_test(test_sphere),
		cmocka_unit_test(test_cylinder),
		cmocka_unit_test(test_invariance),
		cmocka_unit_test(test_rotation),
		cmocka_unit_test(test_permuted),
		slow_unit_test(test_soup),
		cmocka_unit_test(test_element_within_patch),
		cmocka_unit_test(test_near_lamp), cmocka_unit_test(test_too_fine),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
