/* The mesher on shapes whose right answer is known. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "../../lib/edges.h"
#include "../../lib/mem.h"
#include "../../lib/mesher.h"
#include "../../lib/model_check.h"
#include "../../lib/rng.h"
#include "../../lib/vec3.h"

/* ---- models in memory ---- */

/* Surfaces of one grey material each, one-sided or not. */
static void begin(struct model *m, size_t surfaces, int one_sided)
{
	struct err e = { 0 };
	char text[32];

	*m = (struct model){ .bands = 1 };
	assert_int_equal(materials_new(&m->material, surfaces, 1, &e), 0);
	m->surface.n = surfaces;
	m->surface.name = mem_new(surfaces, sizeof *m->surface.name, "names", &e);
	m->surface.material = mem_new(surfaces, sizeof *m->surface.material, "names", &e);
	m->surface.has_normals = mem_new(surfaces, 1, "names", &e);
	for (size_t i = 0; i < surfaces; i++) {
		snprintf(text, sizeof text, "s%zu", i);
		m->surface.name[i] = strdup(text);
		m->material.name[i] = strdup(text);
		m->surface.material[i] = (uint32_t)i;
		m->material.one_sided[i] = (uint8_t)one_sided;
		m->material.rho_d[2 * i] = .5 + .01 * (double)i;
		if (!one_sided)
			m->material.rho_d[2 * i + 1] = m->material.rho_d[2 * i];
	}
}

static void add_vertex(struct model *m, double x, double y, double z)
{
	m->vertex = realloc(m->vertex, 3 * (m->vertices + 1) * sizeof *m->vertex);
	double *v = &m->vertex[3 * m->vertices++];
	v[0] = x, v[1] = y, v[2] = z;
}

static void add_triangle(struct model *m, uint32_t a, uint32_t b, uint32_t c, uint32_t surface)
{
	size_t n = m->triangles++;

	m->triangle = realloc(m->triangle, 3 * (n + 1) * sizeof *m->triangle);
	m->triangle_surface = realloc(m->triangle_surface, (n + 1) * sizeof(uint32_t));
	m->triangle_uv = realloc(m->triangle_uv, 6 * (n + 1) * sizeof(float));
	m->triangle_normal = realloc(m->triangle_normal, 9 * (n + 1) * sizeof(float));
	m->triangle[3 * n] = a, m->triangle[3 * n + 1] = b, m->triangle[3 * n + 2] = c;
	m->triangle_surface[n] = surface;
	memset(&m->triangle_uv[6 * n], 0, 6 * sizeof(float));
	memset(&m->triangle_normal[9 * n], 0, 9 * sizeof(float));
	m->triangle_uv[6 * n] = (float)n; /* to see that rows move together */
}

static void add_quad(struct model *m, uint32_t a, uint32_t b, uint32_t c, uint32_t d,
                     uint32_t surface)
{
	add_triangle(m, a, b, c, surface);
	add_triangle(m, a, c, d, surface);
}

/* A rectangle of its own four vertices: corner, and its two sides. */
static void add_rectangle(struct model *m, const double p[3], const double u[3],
                          const double v[3], uint32_t surface)
{
	uint32_t n = (uint32_t)m->vertices;

	add_vertex(m, p[0], p[1], p[2]);
	add_vertex(m, p[0] + u[0], p[1] + u[1], p[2] + u[2]);
	add_vertex(m, p[0] + u[0] + v[0], p[1] + u[1] + v[1], p[2] + u[2] + v[2]);
	add_vertex(m, p[0] + v[0], p[1] + v[1], p[2] + v[2]);
	add_quad(m, n, n + 1, n + 2, n + 3, surface);
}

static void make_square(struct model *m)
{
	begin(m, 1, 0);
	add_rectangle(m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
}

/* Eight corners, all faces one surface, seen from outside. */
static void make_cube(struct model *m)
{
	static const uint32_t face[6][4] = { { 0, 2, 3, 1 }, { 4, 5, 7, 6 }, { 0, 1, 5, 4 },
		{ 2, 6, 7, 3 }, { 0, 4, 6, 2 }, { 1, 3, 7, 5 } };

	begin(m, 1, 1);
	for (int i = 0; i < 8; i++)
		add_vertex(m, i & 1, i >> 1 & 1, i >> 2);
	for (int f = 0; f < 6; f++)
		add_quad(m, face[f][0], face[f][1], face[f][2], face[f][3], 0);
}

/* A six-walled room, each wall a surface with vertices of its own. */
static void make_room(struct model *m)
{
	struct model cube;

	make_cube(&cube);
	begin(m, 6, 1);
	for (uint32_t t = 0; t < cube.triangles; t++) {
		for (size_t k = 0; k < 3; k++) {
			const double *v = &cube.vertex[3 * (size_t)cube.triangle[3 * (size_t)t + k]];
			add_vertex(m, v[0], v[1], v[2]);
		}
		add_triangle(m, 3 * t, 3 * t + 2, 3 * t + 1, t / 2);
	}
	model_free(&cube);
}

/* Icosahedron with each face cut into 4^levels, vertices on the unit sphere. */
static void make_sphere(struct model *m, int levels)
{
	const double g = (1 + sqrt(5)) / 2;
	static const uint32_t face[20][3] = { { 0, 11, 5 }, { 0, 5, 1 }, { 0, 1, 7 },
		{ 0, 7, 10 }, { 0, 10, 11 }, { 1, 5, 9 }, { 5, 11, 4 }, { 11, 10, 2 },
		{ 10, 7, 6 }, { 7, 1, 8 }, { 3, 9, 4 }, { 3, 4, 2 }, { 3, 2, 6 }, { 3, 6, 8 },
		{ 3, 8, 9 }, { 4, 9, 5 }, { 2, 4, 11 }, { 6, 2, 10 }, { 8, 6, 7 }, { 9, 8, 1 } };
	const double corner[12][3] = { { -1, g, 0 }, { 1, g, 0 }, { -1, -g, 0 }, { 1, -g, 0 },
		{ 0, -1, g }, { 0, 1, g }, { 0, -1, -g }, { 0, 1, -g }, { g, 0, -1 },
		{ g, 0, 1 }, { -g, 0, -1 }, { -g, 0, 1 } };

	begin(m, 1, 1);
	int n = 1 << levels;
	for (int f = 0; f < 20; f++)
		for (int i = 0; i < n; i++)
			for (int j = 0; j < 2 * (n - i) - 1; j++) {
				/* Barycentric lattice of the face; odd j are inverted. */
				int q = j / 2, up = !(j & 1);
				int at[3][2] = { { i + !up, q + !up }, { i + 1, q }, { i, q + 1 } };
				if (!up) {
					at[1][0] = i, at[1][1] = q + 1;
					at[2][0] = i + 1, at[2][1] = q;
				}
				uint32_t first = (uint32_t)m->vertices;
				for (int c = 0; c < 3; c++) {
					double x[3] = { 0 };
					double w[3] = { n - at[c][0] - at[c][1], at[c][0], at[c][1] };
					for (int k = 0; k < 3; k++)
						v3_mad(x, w[k], corner[face[f][k]], x);
					v3_normalise(x);
					add_vertex(m, x[0], x[1], x[2]);
				}
				add_triangle(m, first, first + 1, first + 2, 0);
			}
}

/* Turns the scene by some angle about some axis (Rodrigues), then moves it. */
static void transform(struct model *m, double scale, int turn, double offset)
{
	const double axis[3] = { 2. / 7, 3. / 7, 6. / 7 }, c = .28, s = .96;

	for (size_t i = 0; i < m->vertices; i++) {
		double *v = &m->vertex[3 * i], w[3], d = v3_dot(axis, v);
		v3_cross(axis, v, w);
		for (int k = 0; k < 3; k++) {
			double x = turn ? c * v[k] + s * w[k] + (1 - c) * d * axis[k] : v[k];
			w[k] = scale * x + (k == 1 ? -offset : offset);
		}
		memcpy(v, w, sizeof w);
	}
}

static struct mesher_options sizes(double patch, double element, int relative)
{
	return (struct mesher_options){ .patch = { patch, relative },
		                        .element = { element, relative }, .normal_cone = 20 };
}

/* ---- what must hold for every model ---- */

static double input_area(const struct model *m)
{
	double sum = 0, a[3];

	for (size_t t = 0; t < m->triangles; t++) {
		const uint32_t *c = &m->triangle[3 * t];
		v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
		        &m->vertex[3 * (size_t)c[2]], a);
		sum += v3_length(a);
	}
	return sum;
}

/* Corners of element i and weights of point x of its triangle agree. */
static void check_location(const struct model *m, uint32_t t, const double w[3])
{
	double x[3] = { 0 }, y[3] = { 0 }, v[3] = { w[0], w[1], w[2] }, scale = 0;
	uint32_t element = model_locate(m, t, v);

	assert_true(element < m->elements);
	assert_int_equal(m->element_triangle[element], t);
	for (size_t k = 0; k < 3; k++) {
		const double *corner = &m->vertex[3 * (size_t)m->triangle[3 * (size_t)t + k]];
		v3_mad(x, w[k], corner, x);
		v3_mad(y, v[k], &m->vertex[3 * (size_t)m->element[3 * (size_t)element + k]], y);
		scale = fmax(scale, v3_length(corner));
		assert_true(v[k] >= -1e-15 && v[k] <= 1 + 1e-15);
	}
	v3_sub(x, y, y);
	assert_true(v3_length(y) <= 1e-14 * scale);
}

static void check_locations(const struct model *m)
{
	struct rng r = rng_seed(7, 1);

	for (int i = 0; i < 2000; i++) {
		uint32_t t = (uint32_t)(rng_next(&r) % m->triangles);
		double a = rng_uniform(&r), b = rng_uniform(&r) * (1 - a);
		check_location(m, t, (double[]){ a, b, 1 - a - b });
	}
}

/* Edges of elements are as shared as the input edges they lie on: none of a
 * surface has more uses than the input allows, and open ones only subdivide open
 * input edges, so their lengths sum to the same. */
static void check_conforming(const struct model *m)
{
	struct err e = { 0 };
	const uint32_t *corners[2] = { m->triangle, m->element };
	const size_t count[2] = { m->triangles, m->elements };
	double open[2] = { 0 };

	for (int level = 0; level < 2; level++) {
		struct edges g;
		assert_int_equal(edges_build(&g, corners[level], count[level], m->vertices, &e), 0);
		for (size_t i = 0; i < g.n; i++) {
			uint32_t h = g.use[g.start[i]];
			double d[3];
			v3_sub(&m->vertex[3 * (size_t)half_from(corners[level], h)],
			       &m->vertex[3 * (size_t)half_to(corners[level], h)], d);
			if (g.start[i + 1] - g.start[i] == 1)
				open[level] += v3_length(d);
		}
		edges_free(&g);
	}
	assert_true(fabs(open[0] - open[1]) <= 1e-9 * (1e-300 + open[0]));
}

static double loop_area(const struct model *m, size_t loop, const double n[3])
{
	const uint32_t *c = &m->loop_index[m->loop_start[loop]];
	size_t corners = m->loop_start[loop + 1] - m->loop_start[loop];
	double sum = 0, a[3];

	for (size_t i = 1; i + 1 < corners; i++) {
		v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[i]],
		        &m->vertex[3 * (size_t)c[i + 1]], a);
		sum += v3_dot(a, n);
	}
	return sum;
}

static void check_outlines(const struct model *m, double tolerance)
{
	for (size_t p = 0; p < m->patches; p++) {
		const double *n = &m->element_normal[3 * (size_t)m->patch_start[p]];
		double area = 0;
		if (m->patch_loop[p] == m->patch_loop[p + 1])
			continue;
		assert_true(loop_area(m, m->patch_loop[p], n) > 0);
		for (size_t l = m->patch_loop[p]; l < m->patch_loop[p + 1]; l++)
			area += loop_area(m, l, n);
		assert_true(fabs(area - m->patch_area[p]) <= tolerance * m->patch_area[p]);
	}
}

static void check_patches(const struct model *m, double cone)
{
	for (uint32_t p = 0; p < m->patches; p++) {
		double mean[3] = { 0 };
		for (uint32_t i = m->patch_start[p]; i < m->patch_start[p + 1]; i++) {
			v3_mad(mean, m->element_area[i], &m->element_normal[3 * (size_t)i], mean);
			assert_int_equal(m->triangle_surface[m->element_triangle[i]],
			                 m->patch_surface[p]);
		}
		v3_normalise(mean);
		for (uint32_t i = m->patch_start[p]; i < m->patch_start[p + 1]; i++)
			assert_true(v3_dot(mean, &m->element_normal[3 * (size_t)i]) >=
			            cos(cone * acos(-1) / 180) - 1e-9);
	}
}

/* Runs the mesher and checks all that always holds. */
static struct mesher_report run(struct model *m, struct mesher_options o)
{
	struct err e = { 0 };
	struct mesher_report r = { 0 };
	int status = mesher_run(m, &o, &r, &e);

	if (status)
		fail_msg("%s", e.text);
	if (model_check(m, &e))
		fail_msg("%s", e.text);
	double area = 0, offset = fabs(m->vertex[0]) / r.diagonal;
	for (size_t i = 0; i < m->elements; i++)
		area += m->element_area[i];
	double tolerance = 1e-12 + 1e-14 * offset;
	assert_true(fabs(area - input_area(m)) <= tolerance * area);
	assert_true(fabs(area - r.area_front) <= tolerance * area);
	if (offset < 10)
		check_locations(m);
	check_conforming(m);
	check_patches(m, o.normal_cone);
	check_outlines(m, 1e-10 + 1e-13 * offset);
	return r;
}

/* ---- the tests ---- */

static void test_square(void **state)
{
	struct model m;
	struct mesher_report r;

	(void)state;
	make_square(&m);
	r = run(&m, sizes(.25, .25, 0));
	assert_int_equal(m.patches, 16);
	assert_int_equal(r.planar_patches, 16);
	for (size_t p = 0; p < m.patches; p++) {
		assert_int_equal(m.patch_loop[p + 1], p + 1);
		assert_int_equal(m.loop_start[p + 1] - m.loop_start[p], 4);
		assert_true(fabs(m.patch_area[p] - 1. / 16) < 1e-15);
	}
	assert_int_equal(m.elements, 64);
	assert_true(r.area_back == r.area_front);
	assert_int_equal(r.open_edges, 4);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.closed_components, 0);
	assert_int_equal(r.two_sided, 1);
	mesher_report_free(&r);
	model_free(&m);
}

static void test_unbounded(void **state)
{
	struct model m;
	struct mesher_report r;

	(void)state;
	make_square(&m);
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 1));
	assert_int_equal(m.patches, 1);
	assert_int_equal(m.elements, 2);
	assert_int_equal(m.splits, 0);
	assert_int_equal(m.loop_indices, 4);
	mesher_report_free(&r);
	model_free(&m);
}

/* Rectangles up to sqrt(3) times as long as wide are divided into rectangles;
 * longest-edge bisection leaves ragged borders in longer ones. */
static void test_rectangles(void **state)
{
	static const double length[3] = { 1.3, 1.7, 4 };

	(void)state;
	for (int i = 0; i < 3; i++) {
		struct model m;
		begin(&m, 1, 0);
		add_rectangle(&m, (double[]){ 1, 2, 3 }, (double[]){ 0, 0, length[i] },
		              (double[]){ 1, 0, 0 }, 0);
		transform(&m, 1, 1, 0);
		struct mesher_report r = run(&m, sizes(.5, .2, 0));
		assert_int_equal(m.patches, i == 2 ? 16 : 8);
		double even = length[i] / (double)m.patches;
		for (size_t p = 0; p < m.patches; p++)
			assert_true(fabs(m.patch_area[p] - even) < (i == 2 ? .1 * even : 1e-12));
		if (i < 2)
			assert_int_equal(m.loop_indices, 4 * m.patches);
		mesher_report_free(&r);
		model_free(&m);
	}
}

static void test_cube(void **state)
{
	struct model m;
	struct mesher_report r;

	(void)state;
	make_cube(&m);
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 0));
	assert_int_equal(m.patches, 6);
	assert_int_equal(r.planar_patches, 6);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.closed_components, 1);
	assert_int_equal(r.open_edges, 0);
	assert_true(fabs(r.area_front - 6) < 1e-14);
	assert_true(r.area_back == 0);
	assert_int_equal(m.vertices, 8);
	mesher_report_free(&r);
	model_free(&m);
}

/* The default sizes on a closed room: about a thousand patches. */
static void test_room(void **state)
{
	struct model m;
	struct mesher_report r;

	(void)state;
	make_room(&m);
	r = run(&m, sizes(.05, .04, 1));
	assert_int_equal(m.patches, 6 * 256);
	assert_int_equal(m.elements, 6 * 1024);
	assert_int_equal(r.total.welded, 12);
	assert_int_equal(r.components, 1);
	assert_int_equal(r.closed_components, 1);
	mesher_report_free(&r);
	model_free(&m);
}

/* An L of three squares, of which the corner one has a square hole. */
static void make_l_shape(struct model *m)
{
	static const double outer[4][2] = { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } };

	begin(m, 1, 0);
	for (int i = 0; i < 4; i++)
		add_vertex(m, outer[i][0], outer[i][1], 0);
	for (int i = 0; i < 4; i++)
		add_vertex(m, .25 + .5 * outer[i][0], .25 + .5 * outer[i][1], 0);
	for (uint32_t i = 0; i < 4; i++)
		add_quad(m, i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i, 0);
	add_vertex(m, 2, 0, 0);
	add_vertex(m, 2, 1, 0);
	add_quad(m, 1, 8, 9, 2, 0);
	add_vertex(m, 1, 2, 0);
	add_vertex(m, 0, 2, 0);
	add_quad(m, 3, 2, 10, 11, 0);
}

static void test_l_shape(void **state)
{
	struct model m;
	struct mesher_report r;

	(void)state;
	make_l_shape(&m);
	r = run(&m, sizes((double)INFINITY, .1, 0));
	assert_int_equal(m.patches, 1);
	assert_int_equal(m.loops, 2);
	assert_int_equal(m.loop_start[1], 6);
	assert_int_equal(m.loop_start[2], 10);
	assert_true(fabs(m.patch_area[0] - 2.75) < 1e-12);
	mesher_report_free(&r);
	model_free(&m);

	make_l_shape(&m);
	transform(&m, 1, 1, 0);
	r = run(&m, sizes(.25, .1, 0));
	assert_int_equal(r.planar_patches, m.patches);
	assert_in_range(m.patches, 44, 60);
	mesher_report_free(&r);
	model_free(&m);
}

static void test_sphere(void **state)
{
	struct model m;
	struct mesher_report r;

	(void)state;
	make_sphere(&m, 5);
	assert_int_equal(m.triangles, 20480);
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 0));
	assert_int_equal(m.elements, 20480);
	assert_int_equal(m.vertices, 10242);
	assert_in_range(m.patches, 33, 160); /* a sphere has 33 cones of 20 degrees */
	assert_true(r.planar_patches < 10); /* left-over single facets */
	assert_int_equal(r.closed_components, 1);
	mesher_report_free(&r);
	model_free(&m);

	make_sphere(&m, 3);
	r = run(&m, sizes(.17, .1, 0)); /* facets of .15 get patches of their own */
	assert_int_equal(r.planar_patches, m.patches);
	assert_int_equal(m.patches, 1280);
	mesher_report_free(&r);
	model_free(&m);
}

/* A fine round bar: strips along it, not rings. */
static void test_cylinder(void **state)
{
	enum { AROUND = 64, ALONG = 32 };
	struct model m;
	struct mesher_report r;

	(void)state;
	begin(&m, 1, 1);
	for (int j = 0; j <= ALONG; j++)
		for (int i = 0; i < AROUND; i++) {
			double a = 2 * acos(-1) * i / AROUND;
			add_vertex(&m, .05 * cos(a), .05 * sin(a), 2. * j / ALONG);
		}
	for (uint32_t j = 0; j < ALONG; j++)
		for (uint32_t i = 0; i < AROUND; i++) {
			uint32_t n = (i + 1) % AROUND;
			add_quad(&m, AROUND * j + i, AROUND * j + n, AROUND * j + AROUND + n,
			         AROUND * j + AROUND + i, 0);
		}
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 0));
	assert_in_range(m.patches, 9, 18);
	mesher_report_free(&r);
	model_free(&m);
}

static void test_sliver(void **state)
{
	struct model m;
	struct mesher_report r;

	(void)state;
	for (int turn = 0; turn < 2; turn++) {
		begin(&m, 3, 0);
		add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 0);
		add_rectangle(&m, (double[]){ 1, 0, 0 }, (double[]){ 1e-6, 0, 0 },
		              (double[]){ 0, 1, 0 }, 1);
		add_rectangle(&m, (double[]){ 1 + 1e-6, 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 2);
		transform(&m, 1, turn, 0);
		r = run(&m, sizes(.5, .25, 0));
		assert_int_equal(m.triangles, 6);
		assert_int_equal(r.total.degenerate, 0);
		assert_int_equal(r.total.duplicate, 0);
		assert_int_equal(r.components, 1);
		assert_int_equal(r.open_edges, 8);
		assert_true(fabs(r.area_front - 2.000001) < 1e-12);
		mesher_report_free(&r);
		model_free(&m);
	}
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
			struct model m;
			if (shape == 0)
				make_room(&m);
			else if (shape == 1)
				make_l_shape(&m);
			else
				make_sphere(&m, 4);
			transform(&m, t[i].scale, t[i].turn, t[i].offset);
			struct mesher_report r = run(&m, sizes(.11, .043, 1));
			if (i == 0) {
				patches[shape] = m.patches;
				elements[shape] = m.elements;
			}
			assert_int_equal(r.total.degenerate + r.total.duplicate, 0);
			if (t[i].offset == 0 || shape == 0) {
				/* AABB diagonals turn with the scene only for scale. */
				if (!t[i].turn) {
					assert_int_equal(m.patches, patches[shape]);
					assert_int_equal(m.elements, elements[shape]);
				}
			}
			mesher_report_free(&r);
			model_free(&m);
		}
}

/* Turned scenes with sizes in metres: the same patches. */
static void test_rotation(void **state)
{
	(void)state;
	for (int shape = 0; shape < 3; shape++) {
		struct model m[2];
		struct mesher_report r[2];
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
		assert_int_equal(m[0].elements, m[1].elements);
		if (shape < 2)
			assert_int_equal(m[0].patches, m[1].patches);
		for (int turn = 0; turn < 2; turn++) {
			mesher_report_free(&r[turn]);
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
	struct mesher_report r[2];
	struct rng g = rng_seed(3, 0);

	(void)state;
	for (int i = 0; i < 2; i++)
		make_sphere(&m[i], 4);
	for (size_t t = m[1].triangles - 1; t > 0; t--) {
		size_t other = rng_next(&g) % (t + 1);
		for (size_t k = 0; k < 3; k++) {
			uint32_t swap = m[1].triangle[3 * t + k];
			m[1].triangle[3 * t + k] = m[1].triangle[3 * other + k];
			m[1].triangle[3 * other + k] = swap;
		}
	}
	for (int i = 0; i < 2; i++)
		r[i] = run(&m[i], sizes(.3, .1, 0));
	assert_int_equal(m[0].patches, m[1].patches);
	assert_int_equal(m[0].elements, m[1].elements);
	for (size_t p = 0; p < m[0].patches; p++)
		assert_true(fabs(m[0].patch_area[p] - m[1].patch_area[p]) < 1e-14);
	for (int i = 0; i < 2; i++)
		qsort(m[i].element_area, m[i].elements, sizeof(double), compare_doubles);
	for (size_t i = 0; i < m[0].elements; i++)
		assert_true(m[0].element_area[i] == m[1].element_area[i]);
	for (int i = 0; i < 2; i++) {
		mesher_report_free(&r[i]);
		model_free(&m[i]);
	}
}

static void test_degenerate(void **state)
{
	struct model m;
	struct mesher_report r;
	struct err e = { 0 };

	(void)state;
	begin(&m, 2, 0);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
	for (int i = 0; i < 4; i++) /* float32 positions that mean to be collinear */
		add_vertex(&m, (double)(.1f * (float)i), (double)(.2f * (float)i),
		           (double)(.3f * (float)i));
	add_triangle(&m, 4, 5, 7, 1);
	add_triangle(&m, 5, 5, 6, 1);
	add_triangle(&m, 5, 6, 5, 1);
	add_triangle(&m, 0, 1, 3, 1);
	r = run(&m, sizes(.5, .5, 0));
	/* The last one was no copy of a square's half, cut along the other diagonal. */
	assert_int_equal(m.triangles, 3);
	assert_int_equal(r.total.degenerate, 3);
	assert_int_equal(r.surface[1].degenerate, 3);
	assert_int_equal(r.total.duplicate, 0);
	assert_true(m.triangle_uv[6 * 2] == 5);
	mesher_report_free(&r);
	model_free(&m);

	begin(&m, 1, 0);
	add_vertex(&m, 1, 2, 3);
	add_triangle(&m, 0, 0, 0, 0);
	assert_int_equal(mesher_run(&m, &(struct mesher_options){ 0 }, &r, &e), -1);
	assert_non_null(strstr(e.text, "no geometry"));
	mesher_report_free(&r);
	model_free(&m);
}

/* Equal, opposite and otherwise cut copies of a square. */
static void test_duplicates(void **state)
{
	static const uint32_t copy[4][4] = { { 0, 1, 2, 3 }, { 0, 3, 2, 1 }, { 3, 2, 1, 0 },
		{ 1, 2, 3, 0 } };

	(void)state;
	for (int one_sided = 0; one_sided < 2; one_sided++)
		for (int c = 0; c < 4; c++)
			for (int other = 0; other < 2; other++) {
				struct model m;
				const uint32_t *q = copy[c];
				int opposite = c == 1 || c == 2;
				begin(&m, 2, one_sided);
				for (int i = 0; i < 2; i++)
					add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
					              (double[]){ 0, 1, 0 }, 0);
				m.triangles = 2;
				add_quad(&m, 4 + q[0], 4 + q[1], 4 + q[2], 4 + q[3], (uint32_t)other);
				struct mesher_report r = run(&m, sizes((double)INFINITY, .5, 0));
				assert_int_equal(m.triangles, 2);
				assert_int_equal(r.total.duplicate, 2);
				assert_int_equal(m.patches, 1);
				assert_int_equal(r.merged, one_sided && opposite ? 2 : 0);
				assert_int_equal(m.patch_surface[0], 0);
				uint32_t material = model_patch_material(&m, 0);
				if (one_sided && opposite) {
					assert_int_equal(m.material.one_sided[material], 0);
					assert_true(m.material.rho_d[2 * material] == .5);
					assert_true(m.material.rho_d[2 * material + 1] ==
					            .5 + .01 * other);
				} else {
					assert_int_equal(material, 0);
				}
				mesher_report_free(&r);
				model_free(&m);
			}
}

/* Only half of a surface has a twin: it becomes a surface of its own. */
static void test_partial_sandwich(void **state)
{
	struct model m;
	struct mesher_report r;

	(void)state;
	begin(&m, 2, 1);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
	add_rectangle(&m, (double[]){ 1, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 0, 1, 0 }, (double[]){ 1, 0, 0 }, 1);
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 0));
	assert_int_equal(r.merged, 2);
	assert_int_equal(m.surface.n, 3);
	assert_string_equal(m.surface.name[2], "s0|s1");
	assert_int_equal(m.material.n, 3);
	assert_string_equal(m.material.name[2], "s0|s1");
	assert_int_equal(m.patches, 2);
	assert_true(fabs(r.area_front - 2) < 1e-15 && fabs(r.area_back - 1) < 1e-15);
	mesher_report_free(&r);
	model_free(&m);
}

static void test_winding(void **state)
{
	struct model m;
	struct mesher_report r;

	(void)state;
	make_cube(&m);
	uint32_t swap = m.triangle[1];
	m.triangle[1] = m.triangle[2];
	m.triangle[2] = swap;
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 0));
	assert_int_equal(r.surface[0].opposite, 3);
	assert_int_equal(m.patches, 7);
	mesher_report_free(&r);
	model_free(&m);
}

/* Vertices a rounding error apart are one; a crack of 1e-6 stays. */
static void test_weld(void **state)
{
	static const double gap[2] = { 1e-11, 1e-6 };

	(void)state;
	for (int i = 0; i < 2; i++) {
		struct model m;
		begin(&m, 1, 0);
		add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 0);
		add_rectangle(&m, (double[]){ 1 + gap[i], 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 0);
		struct mesher_report r = run(&m, sizes((double)INFINITY, .3, 0));
		assert_int_equal(r.surface[0].welded, i ? 0 : 2);
		assert_int_equal(m.patches, i ? 2 : 1);
		mesher_report_free(&r);
		model_free(&m);
	}
}

static void make_soup(struct model *m, size_t n)
{
	struct rng g = rng_seed(11, 0);

	begin(m, 1, 0);
	m->vertex = malloc(9 * n * sizeof *m->vertex);
	m->triangle = malloc(3 * n * sizeof *m->triangle);
	m->triangle_surface = calloc(n, sizeof *m->triangle_surface);
	m->vertices = 3 * n;
	m->triangles = n;
	for (size_t t = 0; t < n; t++) {
		double at[3] = { rng_uniform(&g), rng_uniform(&g), rng_uniform(&g) };
		for (size_t i = 0; i < 9; i++) {
			m->vertex[9 * t + i] = at[i % 3] + .01 * rng_uniform(&g);
			m->triangle[3 * t + i / 3] = (uint32_t)(3 * t + i / 3);
		}
	}
}

static void test_soup(void **state)
{
	struct model m;
	struct mesher_report r = { 0 };
	struct err e = { 0 };
	struct mesher_options o = sizes(.05, .04, 1);

	(void)state;
	make_soup(&m, 100000);
	clock_t begun = clock();
	assert_int_equal(mesher_run(&m, &o, &r, &e), 0);
	double seconds = (double)(clock() - begun) / CLOCKS_PER_SEC;
	print_message("100k loose triangles: %.2f s\n", seconds);
#ifndef __SANITIZE_ADDRESS__
	assert_true(seconds < 2);
#endif
	assert_in_range(m.elements, 100000 - 10, 100000);
	mesher_report_free(&r);
	model_free(&m);
}

/* Elements without a size of their own fit into patches. */
static void test_element_within_patch(void **state)
{
	static const double patch[2] = { .125, 3 };

	(void)state;
	for (int i = 0; i < 2; i++) {
		struct model m;
		struct mesher_options o = sizes(patch[i], .25, 0);
		make_square(&m);
		o.element_within_patch = 1;
		struct mesher_report r = run(&m, o);
		assert_true(r.element_size == (i ? .25 : .125));
		assert_int_equal(m.patches, i ? 1 : 64);
		mesher_report_free(&r);
		model_free(&m);
	}
}

static void test_too_fine(void **state)
{
	struct model m;
	struct mesher_report r = { 0 };
	struct err e = { 0 };
	struct mesher_options o = sizes(.1, 1e-7, 0);

	(void)state;
	make_square(&m);
	assert_int_equal(mesher_run(&m, &o, &r, &e), -1);
	assert_non_null(strstr(e.text, "element size"));
	mesher_report_free(&r);
	model_free(&m);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_square), cmocka_unit_test(test_unbounded),
		cmocka_unit_test(test_rectangles), cmocka_unit_test(test_cube),
		cmocka_unit_test(test_room), cmocka_unit_test(test_l_shape),
		cmocka_unit_test(test_sphere), cmocka_unit_test(test_cylinder),
		cmocka_unit_test(test_sliver), cmocka_unit_test(test_invariance),
		cmocka_unit_test(test_rotation), cmocka_unit_test(test_permuted),
		cmocka_unit_test(test_degenerate), cmocka_unit_test(test_duplicates),
		cmocka_unit_test(test_partial_sandwich), cmocka_unit_test(test_winding),
		cmocka_unit_test(test_weld), cmocka_unit_test(test_soup),
		cmocka_unit_test(test_element_within_patch),
		cmocka_unit_test(test_too_fine),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
