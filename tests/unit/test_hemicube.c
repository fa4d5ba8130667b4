

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/hemicube/hemicube.h"
#include "tests/unit/fixtures/check.h"

/* Just enough of a model: vertices and elements. */
static struct model model_new(size_t vertices, size_t elements)
{
	struct model m = { 0 };

	m.vertex = calloc(3 * vertices, sizeof *m.vertex);
	m.element.corner = calloc(3 * elements, sizeof *m.element.corner);
	assert_non_null(m.vertex);
	assert_non_null(m.element.corner);
	return m;
}

static void add_triangle(struct model *m, uint32_t a, uint32_t b, uint32_t c)
{
	uint32_t *e = &m->element.corner[3 * m->element.n++];

	e[0] = a, e[1] = b, e[2] = c;
}

static uint32_t mesh_add_vertex(struct model *m, double x, double y, double z)
{
	double *p = &m->vertex[3 * m->vertices];

	p[0] = x, p[1] = y, p[2] = z;
	return (uint32_t)m->vertices++;
}

/* n x n quads over o + [0,1] u + [0,1] v; the front is on the side of u x v. */
static void add_grid(struct model *m, const double o[3], const double u[3],
                     const double v[3], uint32_t n)
{
	uint32_t first = (uint32_t)m->vertices;

	for (uint32_t j = 0; j <= n; j++)
		for (uint32_t i = 0; i <= n; i++) {
			double p[3];
			v3_mad(o, (double)i / n, u, p);
			v3_mad(p, (double)j / n, v, p);
			mesh_add_vertex(m, p[0], p[1], p[2]);
		}
	for (uint32_t j = 0; j < n; j++)
		for (uint32_t i = 0; i < n; i++) {
			uint32_t a = first + j * (n + 1) + i, c = a + n + 1;
			add_triangle(m, a, a + 1, c + 1);
			add_triangle(m, a, c + 1, c);
		}
}

/* The cube [lo, lo + size]^3 from 8 shared vertices, fronts inwards. */
static struct model cube_model(const double lo[3], double size)
{
	static const uint32_t quad[6][4] = { { 0, 1, 3, 2 }, { 4, 6, 7, 5 }, { 0, 4, 5, 1 },
		{ 2, 3, 7, 6 }, { 0, 2, 6, 4 }, { 1, 5, 7, 3 } };
	struct model m = model_new(8, 12);

	for (int i = 0; i < 8; i++)
		mesh_add_vertex(&m, lo[0] + (i & 1 ? size : 0), lo[1] + (i & 2 ? size : 0),
		                lo[2] + (i & 4 ? size : 0));
	for (int i = 0; i < 6; i++) {
		add_triangle(&m, quad[i][0], quad[i][1], quad[i][2]);
		add_triangle(&m, quad[i][0], quad[i][2], quad[i][3]);
	}
	return m;
}

/* Everything needed to draw a model at resolution n. */
struct stage {
	struct hemicube_grid grid;
	struct locator *locator;
	struct hemicube_scene *scene;
	struct hemicube cube;
};

/* Input triangles are drawn where the model has any. */
static struct stage stage_new(const struct model *m, int n)
{
	struct err e = { 0 };
	struct stage s = { .locator = calloc(1, sizeof *s.locator) };

	assert_non_null(s.locator);
	if (m->triangle.n)
		assert_int_equal(ray_locator_init(s.locator, m, &e), 0);
	assert_int_equal(ff_hemicube_grid_init(&s.grid, n, &e), 0);
	s.scene = ff_hemicube_scene_new(m, m->triangle.n ? s.locator : NULL, &e);
	assert_non_null(s.scene);
	return s;
}

static void draw(struct stage *s, const double eye[3], double frame[3][3], uint32_t own)
{
	struct err e = { 0 };

	if (!s->cube.item)
		assert_int_equal(ff_hemicube_init(&s->cube, &s->grid, &e), 0);
	ff_hemicube_render(&s->cube, s->scene, eye, (const double (*)[3])frame, own);
}

static void stage_free(struct stage *s)
{
	ff_hemicube_free(&s->cube);
	ff_hemicube_scene_free(s->scene);
	ray_locator_free(s->locator);
	free(s->locator);
	ff_hemicube_grid_free(&s->grid);
}

/* A frame about n, turned by `angle`. */
static void frame_about(const double n[3], double angle, double frame[3][3])
{
	double t[3], b[3];

	v3_frame(n, t, b);
	for (int k = 0; k < 3; k++) {
		frame[0][k] = cos(angle) * t[k] + sin(angle) * b[k];
		frame[1][k] = cos(angle) * b[k] - sin(angle) * t[k];
		frame[2][k] = n[k];
	}
}

static void random_frame(struct rng *r, double frame[3][3])
{
	double n[3] = { rng_uniform(r) - .5, rng_uniform(r) - .5, rng_uniform(r) - .5 };

	v3_normalise(n);
	frame_about(n, 7 * rng_uniform(r), frame);
}

/* Adds the form factors of all pixels to f[2 elements]; returns the sum of those that see
 * nothing. */
static double factors(const struct stage *s, double *f)
{
	double unseen = 0;

	for (size_t i = 0; i < s->grid.pixels; i++)
		*(s->cube.item[i] == HEMICUBE_VOID ? &unseen : &f[s->cube.item[i]]) += s->grid.delta[i];
	return unseen;
}

/* From the eye to what pixel i sees along its direction. */
static double distance(const struct stage *s, size_t i)
{
	const double *d = &s->grid.direction[3 * i];

	/* The face's axis is the largest coordinate. */
	return 1 / ((double)s->cube.depth[i] * fmax(fmax(fabs(d[0]), fabs(d[1])), d[2]));
}

static size_t count_void(const struct stage *s)
{
	size_t n = 0;

	for (size_t i = 0; i < s->grid.pixels; i++)
		n += s->cube.item[i] == HEMICUBE_VOID;
	return n;
}

/* Mean form factor from 8 x 8 points (Gauss-Legendre) of the unit square z = 0 to
 * the only grid of the model, which must be seen from its front. */
static double mean_factor(const struct model *m, int n)
{
	static const double node[4] = { .1834346424956498, .5255324099163290,
		.7966664774136267, .9602898564975363 };
	static const double weight[4] = { .3626837833783620, .3137066458778873,
		.2223810344533745, .1012285362903763 };
	struct stage s = stage_new(m, n);
	double *f = calloc(2 * m->element.n, sizeof *f), sum = 0, back = 0;
	double up[3] = { 0, 0, 1 }, frame[3][3];

	assert_non_null(f);
	for (int i = 0; i < 64; i++) {
		int x = i % 8, y = i / 8;
		double eye[3] = { (1 + (x < 4 ? 1 : -1) * node[x % 4]) / 2,
			          (1 + (y < 4 ? 1 : -1) * node[y % 4]) / 2, 0 };
		frame_about(up, .3 + i, frame);
		draw(&s, eye, frame, HEMICUBE_VOID);
		memset(f, 0, 2 * m->element.n * sizeof *f);
		factors(&s, f);
		for (size_t k = 0; k < m->element.n; k++) {
			sum += weight[x % 4] * weight[y % 4] / 4 * f[2 * k + FRONT];
			back += f[2 * k + BACK];
		}
	}
	assert_that(back, ==, 0);
	free(f);
	stage_free(&s);
	return sum;
}

static void parallel_squares(void **state)
{
	struct model m = model_new(9 * 9, 128);
	double o[3] = { 0, 1, 1 }, u[3] = { 1, 0, 0 }, v[3] = { 0, -1, 0 };

	(void)state;
	add_grid(&m, o, u, v, 8);
	/* Howell's catalogue of configuration factors, C-11. */
	assert_near(mean_factor(&m, 128) / .199824895698387, 1, 1e-3);
	model_free(&m);
}

static void perpendicular_squares(void **state)
{
	struct model m = model_new(9 * 9, 128);
	double o[3] = { 0, 0, 0 }, u[3] = { 0, 1, 0 }, v[3] = { 0, 0, 1 };

	(void)state;
	add_grid(&m, o, u, v, 8);
	/* Howell's catalogue of configuration factors, C-14. */
	assert_near(mean_factor(&m, 128) / .2000437760754, 1, 1e-2);
	model_free(&m);
}

static void closed_cube_has_no_holes(void **state)
{
	static const double size[] = { 1e-6, 1, 1e6, 1 }, offset[] = { 0, 0, 0, 1e6 };

	(void)state;
	for (int k = 0; k < 4; k++) {
		given("offset %g, size %g", offset[k], size[k]);
		struct rng r = rng_seed(2, (uint64_t)k);
		double lo[3] = { offset[k], -offset[k], offset[k] };
		struct model m = cube_model(lo, size[k]);
		struct stage s = stage_new(&m, 64);
		for (int i = 0; i < 300; i++) {
			double eye[3], frame[3][3];
			for (int c = 0; c < 3; c++)
				eye[c] = lo[c] + size[k] * rng_uniform(&r);
			random_frame(&r, frame);
			draw(&s, eye, frame, HEMICUBE_VOID);
			assert_int_equal(count_void(&s), 0);
			for (size_t p = 0; p < s.grid.pixels; p++) {
				double d = distance(&s, p);
				assert_int_equal(s.cube.item[p] & 1, FRONT);
				assert_that(d, >, 0);
				assert_that(d, <, 1.75 * size[k]);
			}
		}
		stage_free(&s);
		model_free(&m);
	}
}

/* From points of the cube's own faces, its element left out, and axis-aligned so
 * that many edges run through pixel centres. */
static void closed_cube_from_its_faces(void **state)
{
	static const double offset[] = { 0, 1e6 };
	struct rng r = rng_seed(3, 0);

	(void)state;
	for (int k = 0; k < 2; k++) {
		given("offset %g", offset[k]);
		double lo[3] = { offset[k], offset[k], -offset[k] };
		struct model m = cube_model(lo, 1);
		struct stage s = stage_new(&m, 64);
		for (int i = 0; i < 300; i++) {
			uint32_t own = (uint32_t)i % 12, *v = &m.element.corner[3 * own];
			const double *a = &m.vertex[3 * v[0]], *b = &m.vertex[3 * v[1]],
			             *c = &m.vertex[3 * v[2]];
			double n[3], eye[3], frame[3][3];
			double w0 = (double)(1 + i % 5) / 8, w1 = i % 3 ? .25 : .3 * rng_uniform(&r);
			v3_area(a, b, c, n);
			v3_normalise(n);
			for (int j = 0; j < 3; j++)
				eye[j] = a[j] + w0 * (b[j] - a[j]) + w1 * (c[j] - a[j]);
			frame_about(n, i % 2 ? rng_uniform(&r) : 0, frame);
			draw(&s, eye, frame, own);
			assert_int_equal(count_void(&s), 0);
			/* The other half of the face lies in the horizon. */
			for (size_t p = 0; p < s.grid.pixels; p++)
				assert_that(s.cube.item[p] / 4, !=, own / 2);
		}
		stage_free(&s);
		model_free(&m);
	}
}

static void near_sheet_blocks(void **state)
{
	static const double height[] = { 1e-4, -1e-4, 1e-7 };
	double up[3] = { 0, 0, 1 };

	(void)state;
	for (int k = 0; k < 3; k++) {
		given("height %g", height[k]);
		struct model m = model_new(4 + 4, 4);
		double o[3] = { 0, 0, height[k] }, u[3] = { 1, 0, 0 }, v[3] = { 0, 1, 0 };
		double ceiling[3] = { -50, -50, .5 }, wide[3] = { 101, 0, 0 }, deep[3] = { 0, 101, 0 };
		add_grid(&m, o, u, v, 1);
		add_grid(&m, ceiling, wide, deep, 1);
		struct stage s = stage_new(&m, 128);
		for (int i = 0; i < 20; i++) {
			double eye[3] = { .1 + .04 * i, .45, 0 }, frame[3][3], seen[8] = { 0 };
			frame_about(up, i, frame);
			draw(&s, eye, frame, HEMICUBE_VOID);
			factors(&s, seen);
			double sheet = seen[0] + seen[1] + seen[2] + seen[3];
			if (height[k] > 0)
				assert_true(sheet > 1 - 1e-5 && seen[0] + seen[2] == 0);
			else
				assert_true(sheet == 0 && seen[4] + seen[5] + seen[6] + seen[7] > .99);
		}
		stage_free(&s);
		model_free(&m);
	}
}

static void equal_depths_give_the_lowest(void **state)
{
	struct rng r = rng_seed(4, 0);
	struct model m = model_new(8, 4);
	double lo[3] = { -1, -1, .6 }, u[3] = { 2, 0, .3 }, v[3] = { 0, 2, .1 };

	(void)state;
	add_grid(&m, lo, u, v, 1);
	for (uint32_t i = 0; i < 4; i++) /* the same, wound the other way */
		mesh_add_vertex(&m, m.vertex[3 * i], m.vertex[3 * i + 1], m.vertex[3 * i + 2]);
	add_triangle(&m, 7, 5, 4);
	add_triangle(&m, 6, 7, 4);
	struct stage s = stage_new(&m, 64);
	for (int i = 0; i < 50; i++) {
		given("i %d", i);
		double eye[3] = { rng_uniform(&r), rng_uniform(&r), 0 }, up[3] = { 0, 0, 1 }, frame[3][3];
		frame_about(up, i, frame);
		draw(&s, eye, frame, HEMICUBE_VOID);
		for (size_t p = 0; p < s.grid.pixels; p++)
			assert_true(s.cube.item[p] == HEMICUBE_VOID || s.cube.item[p] / 2 < 2);
	}
	stage_free(&s);
	model_free(&m);
}

/* Nearest triangle along dir, double precision (Moeller & Trumbore 1997). */
static uint32_t cast(const struct model *m, const double eye[3], const double dir[3])
{
	double nearest = INFINITY;
	uint32_t item = HEMICUBE_VOID;

	for (uint32_t i = 0; i < m->element.n; i++) {
		const uint32_t *v = &m->element.corner[3 * i];
		double e1[3], e2[3], p[3], q[3], s[3];
		v3_sub(&m->vertex[3 * v[1]], &m->vertex[3 * v[0]], e1);
		v3_sub(&m->vertex[3 * v[2]], &m->vertex[3 * v[0]], e2);
		v3_sub(eye, &m->vertex[3 * v[0]], s);
		v3_cross(dir, e2, p);
		v3_cross(s, e1, q);
		double det = v3_dot(e1, p), x = v3_dot(s, p) / det, y = v3_dot(dir, q) / det;
		double t = v3_dot(e2, q) / det;
		if (x >= 0 && y >= 0 && x + y <= 1 && t > 0 && t < nearest) {
			nearest = t;
			item = 2 * i + (det > 0 ? FRONT : BACK);
		}
	}
	return item;
}

static struct model soup_model(struct rng *r, size_t triangles, double size)
{
	struct model m = model_new(3 * triangles, triangles);

	for (size_t i = 0; i < triangles; i++) {
		double c[3];
		for (int k = 0; k < 3; k++)
			c[k] = 2 * rng_uniform(r) - 1;
		for (int j = 0; j < 3; j++)
			mesh_add_vertex(&m, c[0] + size * (rng_uniform(r) - .5),
			                c[1] + size * (rng_uniform(r) - .5),
			                c[2] + size * (rng_uniform(r) - .5));
		uint32_t v = (uint32_t)(3 * i);
		add_triangle(&m, v, v + 1, v + 2);
	}
	return m;
}

static void soup_agrees_with_rays(void **state)
{
	struct rng r = rng_seed(5, 0);
	size_t differ = 0, pixels = 0;

	(void)state;
	for (int k = 0; k < 6; k++) {
		struct model m = soup_model(&r, k % 2 ? 3000 : 300, k < 3 ? .5 : 3);
		struct stage s = stage_new(&m, 32);
		double eye[3] = { .3 * rng_uniform(&r), 0, .2 }, frame[3][3];
		random_frame(&r, frame);
		draw(&s, eye, frame, HEMICUBE_VOID);
		for (size_t p = 0; p < s.grid.pixels; p++) {
			const double *d = &s.grid.direction[3 * p];
			double dir[3];
			for (int c = 0; c < 3; c++)
				dir[c] = d[0] * frame[0][c] + d[1] * frame[1][c] + d[2] * frame[2][c];
			differ += cast(&m, eye, dir) != s.cube.item[p];
		}
		pixels += s.grid.pixels;
		stage_free(&s);
		model_free(&m);
	}
	/* Float depths: only triangles that cross within a pixel may swap. */
	assert_that(differ * 5000, <=, pixels);
}

/* Edges of the grid run through pixel centres when the cube is aligned with it. */
static void aligned_grid(void **state)
{
	struct model m = model_new(98 * 98, 2 * 97 * 97);
	double o[3] = { -97. / 64, -97. / 64, 1 }, u[3] = { 97. / 32, 0, 0 },
	       v[3] = { 0, 97. / 32, 0 };
	double eye[3] = { 0, 0, 0 }, up[3] = { 0, 0, 1 };
	/* From the centre of a rectangle of half width A at distance 1: Howell's
	 * B-4, four times, with s = A / sqrt(1 + A^2). */
	double s1 = 97. / 64 / sqrt(1 + 97. / 64 * 97 / 64), exact = 4 / acos(-1) * s1 * atan(s1);

	(void)state;
	add_grid(&m, o, u, v, 97);
	struct stage s = stage_new(&m, 64);
	for (int i = 0; i < 8; i++) {
		given("i %d", i);
		double f[2 * 2 * 97 * 97] = { 0 }, frame[3][3], sum = 0;
		frame_about(up, .4 * i, frame);
		if (i == 0)
			for (int k = 0; k < 9; k++)
				frame[k / 3][k % 3] = k % 4 == 0;
		draw(&s, eye, frame, HEMICUBE_VOID);
		for (size_t p = 0; p < 64 * 64; p++)
			assert_int_not_equal(s.cube.item[p], HEMICUBE_VOID);
		double unseen = factors(&s, f);
		for (size_t k = 0; k < 2 * m.element.n; k++)
			sum += f[k];
		assert_near(sum + unseen, 1, 1e-12);
		assert_near(sum / exact, 1, (i ? 3e-3 : 2e-2));
	}
	stage_free(&s);
	model_free(&m);
}

/* Splits a triangle (corners v) at the middle of its longest edge, `depth` times;
 * what triangle_split holds. */
static int32_t bisect(struct model *m, uint32_t triangle, const uint32_t v[3], int depth)
{
	double longest = -1, middle[3];
	int edge = 0;

	if (depth == 0) {
		m->element.triangle[m->element.n] = triangle;
		add_triangle(m, v[0], v[1], v[2]);
		return ~(int32_t)(m->element.n - 1);
	}
	for (int k = 0; k < 3; k++) {
		double d[3];
		v3_sub(&m->vertex[3 * v[k]], &m->vertex[3 * v[(k + 1) % 3]], d);
		if (v3_length(d) > longest + 1e-9)
			longest = v3_length(d), edge = k;
	}
	const double *a = &m->vertex[3 * v[edge]], *b = &m->vertex[3 * v[(edge + 1) % 3]];
	for (int k = 0; k < 3; k++)
		middle[k] = (a[k] + b[k]) / 2;
	uint32_t c = mesh_add_vertex(m, middle[0], middle[1], middle[2]);
	uint32_t low[3] = { v[0], v[1], v[2] }, high[3] = { v[0], v[1], v[2] };
	low[(edge + 1) % 3] = high[edge] = c;
	int32_t at = (int32_t)m->splits++;
	m->split[at].edge = edge;
	m->split[at].child[0] = bisect(m, triangle, low, depth - 1);
	m->split[at].child[1] = bisect(m, triangle, high, depth - 1);
	return at;
}

/* Drawing input triangles and finding elements in them, against drawing elements. */
static void triangles_give_the_same_elements(void **state)
{
	enum { DEPTH = 9, ELEMENTS = 12 << DEPTH };
	double lo[3] = { -1, -2, .5 };
	struct model coarse = cube_model(lo, 2), m = model_new(8 + ELEMENTS, ELEMENTS);
	struct rng r = rng_seed(7, 0);
	size_t differ = 0, pixels = 0;

	(void)state;
	m.triangle.corner = coarse.element.corner;
	m.triangle.n = 12;
	m.triangle.split = calloc(12, sizeof *m.triangle.split);
	m.split = calloc(ELEMENTS, sizeof *m.split);
	m.element.triangle = calloc(ELEMENTS, sizeof *m.element.triangle);
	assert_true(m.triangle.split && m.split && m.element.triangle);
	memcpy(m.vertex, coarse.vertex, 24 * sizeof *m.vertex);
	m.vertices = 8;
	for (uint32_t t = 0; t < 12; t++)
		m.triangle.split[t] = bisect(&m, t, &m.triangle.corner[3 * t], DEPTH);
	struct model elements_only = m;
	elements_only.triangle.n = 0;
	struct stage s = stage_new(&m, 16), e = stage_new(&elements_only, 16);
	for (int i = 0; i < 200; i++) {
		given("i %d", i);
		double eye[3], frame[3][3];
		for (int k = 0; k < 3; k++)
			eye[k] = lo[k] + 2 * rng_uniform(&r);
		uint32_t own = i % 2 ? HEMICUBE_VOID : (uint32_t)i * 30;
		random_frame(&r, frame);
		draw(&s, eye, frame, own);
		draw(&e, eye, frame, HEMICUBE_VOID);
		for (size_t p = 0; p < s.grid.pixels; p++) {
			uint32_t a = s.cube.item[p], b = e.cube.item[p];
			assert_int_not_equal(b, HEMICUBE_VOID);
			if (own != HEMICUBE_VOID && m.element.triangle[b >> 1] == m.element.triangle[own])
				assert_int_equal(a, HEMICUBE_VOID);
			else
				differ += a != b;
		}
		pixels += s.grid.pixels;
	}
	assert_that(differ * 5000, <, pixels);
	stage_free(&s);
	stage_free(&e);
	free(coarse.vertex);
	model_free(&m);
}

static void same_picture_every_time(void **state)
{
	struct rng r = rng_seed(6, 0);
	struct model m = soup_model(&r, 2000, .4);
	struct stage s = stage_new(&m, 62), t = stage_new(&m, 62);

	(void)state;
	for (int i = 0; i < 5; i++) {
		given("i %d", i);
		double eye[3] = { .1 * i, 0, 0 }, other[3] = { 0, 0, .5 }, frame[3][3];
		random_frame(&r, frame);
		draw(&s, eye, frame, 3);
		draw(&t, other, frame, HEMICUBE_VOID);
		draw(&t, eye, frame, 3);
		assert_memory_equal(s.cube.item, t.cube.item, s.grid.pixels * sizeof *s.cube.item);
		assert_memory_equal(s.cube.depth, t.cube.depth, s.grid.pixels * sizeof *s.cube.depth);
	}
	stage_free(&s);
	stage_free(&t);
	model_free(&m);
}

static void empty_scene_escapes(void **state)
{
	struct model m = model_new(1, 1);
	struct stage s = stage_new(&m, 16);
	double eye[3] = { 0, 0, 0 }, frame[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };

	(void)state;
	draw(&s, eye, frame, HEMICUBE_VOID);
	assert_near(factors(&s, NULL), 1, 1e-14);
	stage_free(&s);
	ff_hemicube_scene_free(NULL);
	model_free(&m);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(parallel_squares),
		cmocka_unit_test(perpendicular_squares),
		cmocka_unit_test(closed_cube_has_no_holes),
		cmocka_unit_test(closed_cube_from_its_faces),
		cmocka_unit_test(near_sheet_blocks),
		cmocka_unit_test(equal_depths_give_the_lowest),
		cmocka_unit_test(soup_agrees_with_rays),
		cmocka_unit_test(aligned_grid),
		cmocka_unit_test(triangles_give_the_same_elements),
		cmocka_unit_test(same_picture_every_time),
		cmocka_unit_test(empty_scene_escapes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
