/* Small models in memory for the mesher's tests, and what must hold for each. */
#ifndef TEST_SHAPES_H
#define TEST_SHAPES_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../lib/edges.h"
#include "../../lib/mem.h"
#include "../../lib/mesher.h"
#include "../../lib/model_check.h"
#include "../../lib/rng.h"
#include "../../lib/vec3.h"

/* ---- models in memory ---- */

/* Surfaces of one grey material each, one-sided or not. */
static inline void begin(struct model *m, size_t surfaces, int one_sided)
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

/* Room for one more than n rows, which grows by doubling: the sanitizer's realloc always
 * copies. */
static inline void *one_more(void *rows, size_t n, size_t size)
{
	return n & (n - 1) ? rows : realloc(rows, (n ? 2 * n : 1) * size);
}

static inline void add_vertex(struct model *m, double x, double y, double z)
{
	m->vertex = one_more(m->vertex, m->vertices, 3 * sizeof *m->vertex);
	double *v = &m->vertex[3 * m->vertices++];
	v[0] = x, v[1] = y, v[2] = z;
}

static inline void add_triangle(struct model *m, uint32_t a, uint32_t b, uint32_t c,
                                uint32_t surface)
{
	size_t n = m->triangles++;

	m->triangle = one_more(m->triangle, n, 3 * sizeof *m->triangle);
	m->triangle_surface = one_more(m->triangle_surface, n, sizeof(uint32_t));
	m->triangle_uv = one_more(m->triangle_uv, n, 6 * sizeof(float));
	m->triangle_normal = one_more(m->triangle_normal, n, 9 * sizeof(float));
	m->triangle[3 * n] = a, m->triangle[3 * n + 1] = b, m->triangle[3 * n + 2] = c;
	m->triangle_surface[n] = surface;
	memset(&m->triangle_uv[6 * n], 0, 6 * sizeof(float));
	memset(&m->triangle_normal[9 * n], 0, 9 * sizeof(float));
	m->triangle_uv[6 * n] = (float)n; /* to see that rows move together */
}

static inline void add_quad(struct model *m, uint32_t a, uint32_t b, uint32_t c, uint32_t d,
                     uint32_t surface)
{
	add_triangle(m, a, b, c, surface);
	add_triangle(m, a, c, d, surface);
}

/* A rectangle of its own four vertices: corner, and its two sides. */
static inline void add_rectangle(struct model *m, const double p[3], const double u[3],
                          const double v[3], uint32_t surface)
{
	uint32_t n = (uint32_t)m->vertices;

	add_vertex(m, p[0], p[1], p[2]);
	add_vertex(m, p[0] + u[0], p[1] + u[1], p[2] + u[2]);
	add_vertex(m, p[0] + u[0] + v[0], p[1] + u[1] + v[1], p[2] + u[2] + v[2]);
	add_vertex(m, p[0] + v[0], p[1] + v[1], p[2] + v[2]);
	add_quad(m, n, n + 1, n + 2, n + 3, surface);
}

static inline void make_square(struct model *m)
{
	begin(m, 1, 0);
	add_rectangle(m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
}

/* Eight corners, all faces one surface, seen from outside. */
static inline void make_cube(struct model *m)
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
static inline void make_room(struct model *m)
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
static inline void make_sphere(struct model *m, int levels)
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
static inline void transform(struct model *m, double scale, int turn, double offset)
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

static inline struct mesher_options sizes(double patch, double element, int relative)
{
	return (struct mesher_options){ .patch = { patch, relative },
		                        .element = { element, relative }, .normal_cone = 20 };
}

/* ---- what must hold for every model ---- */

static inline double input_area(const struct model *m)
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
static inline void check_location(const struct model *m, uint32_t t, const double w[3])
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

static inline void check_locations(const struct model *m)
{
	struct rng r = rng_seed(7, 1);

	for (int i = 0; i < 2000; i++) {
		uint32_t t = (uint32_t)(rng_next(&r) % m->triangles);
		double a = rng_uniform(&r), b = rng_uniform(&r) * (1 - a);
		check_location(m, t, (double[]){ a, b, 1 - a - b });
	}
}

/* No vertex lies inside an element's edge: the open edges of elements only divide
 * open edges of the input, so both sum to the same length, and no edge has more
 * than two elements where none has more than two triangles. */
static inline void check_conforming(const struct model *m)
{
	struct err e = { 0 };
	const uint32_t *corners[2] = { m->triangle, m->element };
	const size_t count[2] = { m->triangles, m->elements };
	double open[2] = { 0 };
	size_t crowded[2] = { 0 };

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
			crowded[level] += g.start[i + 1] - g.start[i] > 2;
		}
		edges_free(&g);
	}
	assert_true(crowded[0] > 0 || crowded[1] == 0);
	assert_true(fabs(open[0] - open[1]) <= 1e-9 * (1e-300 + open[0]));
}

static inline double loop_area(const struct model *m, size_t loop, const double n[3])
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

static inline void check_outlines(const struct model *m, double tolerance)
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

static inline void check_patches(const struct model *m, double cone)
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
static inline struct mesher_report run(struct model *m, struct mesher_options o)
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

#endif
