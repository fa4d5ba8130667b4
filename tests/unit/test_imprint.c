/* Surfaces are cut where others cross or touch them, and nowhere else. */
#include "lib/geometry/box_tree.h"
#include "lib/mesh/imprint.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/shapes.h"

enum { PLACES = 4 };

/* The scene as it is, turned, turned and small, turned and far away. */
static void put(struct model *m, int place)
{
	static const double scale[PLACES] = { 1, 1, 1e-6, 1 }, offset[PLACES] = { 0, 0, 0, 1e3 };

	transform(m, scale[place], place > 0, offset[place]);
}

/* UVs as a linear function of the place, to be found again after cutting. */
static void linear_uvs(struct model *m)
{
	for (size_t i = 0; i < 3 * m->triangle.n; i++) {
		const double *x = &m->vertex[3 * (size_t)m->triangle.corner[i]];
		m->triangle.uv[2 * i] = (float)(x[0] + 2 * x[1] - x[2]);
		m->triangle.uv[2 * i + 1] = (float)(x[2] - x[0]);
	}
}

static void check_uvs(const struct model *m, double scale)
{
	for (size_t i = 0; i < 3 * m->triangle.n; i++) {
		const double *x = &m->vertex[3 * (size_t)m->triangle.corner[i]];
		assert_near((double)m->triangle.uv[2 * i], (x[0] + 2 * x[1] - x[2]), 1e-6 * scale);
		assert_near((double)m->triangle.uv[2 * i + 1], (x[2] - x[0]), 1e-6 * scale);
	}
}

/* The least height of an element over its longest edge. */
static double worst_shape(const struct model *m)
{
	double worst = 1;

	for (size_t i = 0; i < m->element.n; i++) {
		double longest = 0, d[3];
		for (size_t k = 0; k < 3; k++) {
			v3_sub(&m->vertex[3 * (size_t)m->element.corner[3 * i + k]],
			       &m->vertex[3 * (size_t)m->element.corner[3 * i + (k + 1) % 3]], d);
			longest = fmax(longest, v3_length(d));
		}
		worst = fmin(worst, 2 * m->element.area[i] / (longest * longest));
	}
	return worst;
}

/* No triangle is crossed any more, or touched inside by an edge, along more than what
 * is left alone on purpose. */
static void check_no_contacts(const struct model *m, double size)
{
	struct imprint_limits limits = { .size = 0, .thick = 1e-6 * size,
		                         .close = 1e-6 * size, .apart = .05 * size,
		                         .shortest = .55 * size, .fine = .55 * size };
	struct contacts found = { 0 };
	struct half_edges g;
	struct err e = { 0 };

	assert_int_equal(geo_half_edges_build(&g, m->triangle.corner, m->triangle.n, m->vertices, &e), 0);
	assert_int_equal(mesh_find_contacts(m, &g, &limits, &found, &e), 0);
	assert_int_equal(found.list.n, 0);
	free(found.list.data);
	geo_half_edges_free(&g);
}

/* Meshes with elements of `size`; the area must stay and contacts must be gone. */
static struct mesh_report mesh(struct model *m, double size)
{
	double area = input_area(m), reach = 0;

	for (size_t i = 0; i < 3 * m->vertices; i++)
		reach = fmax(reach, fabs(m->vertex[i]));
	linear_uvs(m);
	struct mesh_report r = run(m, sizes(2 * size, size, 0));
	assert_near(input_area(m), area, (1e-12 + 1e-14 * reach / r.diameter) * area);
	check_uvs(m, reach);
	check_no_contacts(m, size);
	return r;
}

/* Area of the elements of surface s whose centroid satisfies `inside` in the frame
 * origin, u, v: coordinates along u and v as multiples of these. */
static double area_within(const struct model *m, uint32_t s, double frame[3][3],
                          int (*inside)(double, double))
{
	double sum = 0;

	for (size_t i = 0; i < m->element.n; i++) {
		double c[3] = { 0 }, d[3];
		if (m->triangle.surface[m->element.triangle[i]] != s)
			continue;
		for (size_t k = 0; k < 3; k++)
			v3_mad(c, 1. / 3, &m->vertex[3 * (size_t)m->element.corner[3 * i + k]], c);
		v3_sub(c, frame[0], d);
		double x = v3_dot(d, frame[1]) / v3_dot(frame[1], frame[1]);
		double y = v3_dot(d, frame[2]) / v3_dot(frame[2], frame[2]);
		if (inside(x, y))
			sum += m->element.area[i];
	}
	return sum;
}

/* The corner and sides of a rectangle of four consecutive vertices. */
static void frame_of(const struct model *m, size_t first, double frame[3][3])
{
	memcpy(frame[0], &m->vertex[3 * first], sizeof frame[0]);
	v3_sub(&m->vertex[3 * (first + 1)], frame[0], frame[1]);
	v3_sub(&m->vertex[3 * (first + 3)], frame[0], frame[2]);
}

/* Four walls of a box with a square foot of side .3 at (.31, .42), turned by .4. */
static void add_block(struct model *m, uint32_t surface)
{
	double c = .3 * cos(.4), s = .3 * sin(.4);
	double x[4] = { .31, .31 + c, .31 + c - s, .31 - s };
	double y[4] = { .42, .42 + s, .42 + s + c, .42 + c };

	for (int k = 0; k < 4; k++) {
		int n = (k + 1) % 4;
		add_rectangle(m, (double[]){ x[k], y[k], 0 },
		              (double[]){ x[n] - x[k], y[n] - y[k], 0 }, (double[]){ 0, 0, .5 },
		              surface);
	}
}

static int within_block(double x, double y)
{
	double u = (x - .31) * cos(.4) + (y - .42) * sin(.4);
	double v = (y - .42) * cos(.4) - (x - .31) * sin(.4);

	return u > 0 && u < .3 && v > 0 && v < .3;
}

static void test_footprint(void **state)
{
	(void)state;
	for (int place = 0; place < PLACES; place++)
		for (int one_surface = 0; one_surface < 2; one_surface++) {
			given("place %d, one_surface %d", place, one_surface);
			struct model m;
			double frame[3][3];
			begin(&m, 2, 0);
			add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
			              (double[]){ 0, 1, 0 }, 0);
			add_block(&m, one_surface ? 0 : 1);
			put(&m, place);
			frame_of(&m, 0, frame);
			double unit = v3_length(frame[1]);
			struct mesh_report r = mesh(&m, .1 * unit);
			assert_int_equal(r.cut, 2);
			assert_that(r.lines, >=, 4);
			assert_that(r.lines, <=, 20);
			double area = area_within(&m, 0, frame, within_block);
			if (!one_surface)
				assert_near(area, .09 * unit * unit, 1e-11 * unit * unit);
			assert_that(worst_shape(&m), >, .1);
			mesh_report_free(&r);
			model_free(&m);
		}
}

/* No patch has elements both in the footprint and outside. */
static void test_patches_end_at_lines(void **state)
{
	struct model m;
	double frame[3][3];

	(void)state;
	begin(&m, 2, 0);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
	add_block(&m, 1);
	frame_of(&m, 0, frame);
	struct mesh_report r = run(&m, sizes((double)INFINITY, .1, 0));
	size_t patches = 0;
	for (size_t p = 0; p < m.patch.n; p++)
		patches += m.surface.n && m.patch.surface[p] == 0;
	assert_int_equal(patches, 2);
	assert_near(area_within(&m, 0, frame, within_block), .09, 1e-12);
	for (size_t p = 0; p < m.patch.n; p++) {
		given("p %zu", p);
		if (m.patch.surface[p] == 0)
			assert_true(fabs(m.patch.area[p] - .09) < 1e-12 ||
			            fabs(m.patch.area[p] - .91) < 1e-12);
	}
	mesh_report_free(&r);
	model_free(&m);
}

static int left_half(double x, double y)
{
	(void)y;
	return x < .37;
}

static void test_crossing(void **state)
{
	(void)state;
	for (int place = 0; place < PLACES; place++) {
		given("place %d", place);
		struct model m;
		double frame[3][3];
		begin(&m, 2, 0);
		add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 0);
		add_rectangle(&m, (double[]){ .37, -.2, -.61 }, (double[]){ 0, 1.4, 0 },
		              (double[]){ 0, 0, 1.3 }, 1);
		put(&m, place);
		frame_of(&m, 0, frame);
		double unit = v3_length(frame[1]);
		struct mesh_report r = mesh(&m, .2 * unit);
		assert_int_equal(r.cut, 4);
		/* One line through either quad, halved where it crosses the diagonal, and
		 * once more to keep the pieces in shape. */
		assert_that(r.lines, >=, 4);
		assert_that(r.lines, <=, 6);
		assert_near(area_within(&m, 0, frame, left_half), .37 * unit * unit,
		            1e-11 * unit * unit);
		mesh_report_free(&r);
		model_free(&m);
	}
}

/* A wall that ends inside the floor: the floor stays in one piece around its ends. */
static void test_wall(void **state)
{
	(void)state;
	for (int place = 0; place < PLACES; place++) {
		given("place %d", place);
		struct model m;
		struct half_edges g;
		struct err e = { 0 };
		begin(&m, 2, 0);
		add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 0);
		add_rectangle(&m, (double[]){ .41, .2, 0 }, (double[]){ 0, .7, 0 },
		              (double[]){ 0, 0, 1 }, 1);
		put(&m, place);
		double unit = place == 2 ? 1e-6 : 1;
		struct mesh_report r = mesh(&m, .2 * unit);
		assert_int_equal(r.cut, 2);
		/* Both sides of the line are open edges, between the same places. */
		assert_int_equal(geo_half_edges_build(&g, m.triangle.corner, m.triangle.n, m.vertices, &e), 0);
		double open = 0, d[3];
		for (size_t i = 0; i < g.n; i++) {
			uint32_t h = g.use[g.start[i]];
			v3_sub(&m.vertex[3 * (size_t)geo_half_edge_from(m.triangle.corner, h)],
			       &m.vertex[3 * (size_t)geo_half_edge_to(m.triangle.corner, h)], d);
			if (g.start[i + 1] - g.start[i] == 1)
				open += v3_length(d);
		}
		assert_near(open, (4 + 2 * .7 + 2 * 1.7) * unit, 1e-9 * unit);
		geo_half_edges_free(&g);
		mesh_report_free(&r);
		model_free(&m);
	}
}

/* Where surfaces only meet at their borders nothing is cut. */
static void test_room_is_whole(void **state)
{
	struct model m;

	(void)state;
	make_room(&m);
	transform(&m, 1, 1, 3);
	struct mesh_report r = run(&m, sizes(.2, .1, 0));
	assert_int_equal(r.cut, 0);
	assert_int_equal(m.triangle.n, 12);
	mesh_report_free(&r);
	model_free(&m);
}

/* Coplanar: a sheet's border is cut into the floor, its diagonal is not, and floors
 * side by side leave each other alone. */
static void test_flush(void **state)
{
	struct model m;

	(void)state;
	begin(&m, 3, 0);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
	add_rectangle(&m, (double[]){ .3, .1, 0 }, (double[]){ .2, 0, 0 }, (double[]){ 0, .15, 0 }, 1);
	add_rectangle(&m, (double[]){ 1, .2, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, .5, 0 }, 2);
	transform(&m, 1, 1, 0);
	struct mesh_report r = run(&m, sizes(.2, .1, 0));
	assert_int_equal(r.cut, 1);
	assert_that(r.lines, >=, 4);
	assert_that(r.lines, <=, 8);
	mesh_report_free(&r);
	model_free(&m);
}

static int within_sheet(double x, double y)
{
	return x > .3 && x < .6 && y > .1 && y < .5;
}

/* A lamp just below a ceiling, or a sheet on a wall: its outline is cut into what is behind
 * it, unless the gap is wide enough for light. */
static void test_close(void **state)
{
	static const double gap[] = { 1e-3, .012, .013 };

	(void)state;
	for (int i = 0; i < 3; i++)
		for (int place = 0; place < 3; place++) {
			given("i %d, place %d", i, place);
			struct model m;
			double frame[3][3];
			begin(&m, 2, 0);
			add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
			              (double[]){ 0, 1, 0 }, 0);
			add_rectangle(&m, (double[]){ .3, .1, gap[i] }, (double[]){ .3, 0, 0 },
			              (double[]){ 0, .4, 0 }, 1);
			put(&m, place);
			frame_of(&m, 0, frame);
			double unit = v3_length(frame[1]);
			struct mesh_report r = run(&m, sizes(.2 * unit, .1 * unit, 0));
			assert_int_equal(r.cut, i < 2 ? 2 : 0);
			if (i < 2)
				assert_near(area_within(&m, 0, frame, within_sheet),
				            .12 * unit * unit, 1e-9 * unit * unit);
			mesh_report_free(&r);
			model_free(&m);
		}
}

/* A sheet in the plane of a floor covers it, turned over or not, however small, unless it
 * lets light through. */
static void test_covered(void **state)
{
	(void)state;
	for (int i = 0; i < 4; i++)
		for (int place = 0; place < 3; place++) {
			given("i %d, place %d", i, place);
			struct model m;
			double frame[3][3];
			begin(&m, 2, i == 1);
			add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
			              (double[]){ 0, 1, 0 }, 0);
			if (i == 1)
				add_rectangle(&m, (double[]){ .3, .1, 0 }, (double[]){ 0, .4, 0 },
				              (double[]){ .3, 0, 0 }, 1);
			else
				add_rectangle(&m, (double[]){ .3, .1, 0 },
				              (double[]){ i == 2 ? .01 : .3, 0, 0 },
				              (double[]){ 0, .4, 0 }, 1);
			if (i == 3)
				m.material.tau_d[model_material_at(&m.material, 1, BACK)] = .1;
			put(&m, place);
			frame_of(&m, 0, frame);
			double unit = v3_length(frame[1]);
			struct mesh_report r = run(&m, sizes(.2 * unit, .1 * unit, 0));
			double gone = i == 3 ? 0 : i == 2 ? .004 : .12;
			assert_that((r.covered > 0), ==, (i < 3));
			assert_int_equal(r.merged > 0, i == 1); /* the floor shows on the sheet's back */
			double area = input_area(&m) / (unit * unit), given = i == 2 ? 1.004 : 1.12;
			assert_that(fabs(area - given + gone), <, 1e-9);
			mesh_report_free(&r);
			model_free(&m);
		}
}

static void test_options(void **state)
{
	struct model m;

	(void)state;
	for (int i = 0; i < 3; i++) {
		given("i %d", i);
		begin(&m, 2, 0);
		add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 0);
		add_block(&m, 1);
		struct mesh_options o = sizes((double)INFINITY, i == 0 ? (double)INFINITY :
		                              i == 1 ? 1.5 : .1, 0);
		o.no_imprint = i == 2;
		struct mesh_report r = run(&m, o);
		assert_int_equal(r.cut, 0);
		mesh_report_free(&r);
		model_free(&m);
	}
}

static void random_vector(struct rng *r, double size, double x[3])
{
	for (int k = 0; k < 3; k++)
		x[k] = size * (rng_uniform(r) - .5);
}

/* Rectangles that cross each other anyhow. */
static void test_random(void **state)
{
	size_t cut = 0;

	(void)state;
	for (uint64_t seed = 0; seed < 60; seed++) {
		struct rng random = rng_seed(seed, 5);
		struct model m;
		uint32_t n = 3 + (uint32_t)seed / 2;
		begin(&m, n, 0);
		for (uint32_t i = 0; i < n; i++) {
			double p[3], u[3], v[3], w[3];
			random_vector(&random, .6, p);
			random_vector(&random, 2, u);
			random_vector(&random, 2, w);
			v3_cross(u, w, v);
			v3_mad(u, .5 / v3_length(u), u, u); /* no side shorter than an element */
			v3_mad(v, .5 / v3_length(v), v, v);
			add_rectangle(&m, p, u, v, i % (1 + n / 2));
		}
		put(&m, (int)(seed % 3)); /* not far away: patches may be narrow */
		double unit = seed % 3 == 2 ? 1e-6 : 1;
		struct mesh_report r = mesh(&m, .25 * unit);
		cut += r.cut;
		mesh_report_free(&r);
		model_free(&m);
	}
	assert_that(cut, >, 100);
}

/* Walls in a grid, all on one floor. */
static void test_many(void **state)
{
	struct model m;
	enum { N = 24 };

	(void)state;
	begin(&m, 2, 0);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
	for (int i = 0; i < N; i++) {
		double at = (i + .5) / N;
		add_rectangle(&m, (double[]){ at, -.1, 0 }, (double[]){ 0, 1.2, 0 },
		              (double[]){ 0, 0, .2 }, 1);
		add_rectangle(&m, (double[]){ -.1, at, -.1 }, (double[]){ 1.2, 0, 0 },
		              (double[]){ 0, 0, .2 }, 1);
	}
	transform(&m, 1, 1, 0);
	struct mesh_report r = run(&m, sizes(.2, .1, 0));
	size_t patches = 0;
	for (size_t p = 0; p < m.patch.n; p++)
		patches += m.patch.surface[p] == 0;
	assert_int_equal(patches, (N + 1) * (N + 1));
	check_no_contacts(&m, .1);
	mesh_report_free(&r);
	model_free(&m);
}

/* The tree finds the boxes that a look at each of them finds, once each. */
static void test_boxes(void **state)
{
	enum { MANY = 500 };
	struct rng random = rng_seed(3, 1);

	(void)state;
	for (uint32_t n = 1; n <= MANY; n = 2 * n + 1) {
		given("n %u", n);
		double vertex[3 * MANY][3];
		uint32_t triangle[3 * MANY];
		struct boxes b;
		struct array found = { 0 };
		struct err e = { 0 };
		for (uint32_t i = 0; i < 3 * n; i++) {
			random_vector(&random, 1, vertex[i]);
			if (i % 3)
				for (int k = 0; k < 3; k++)
					vertex[i][k] = vertex[i - i % 3][k] + .1 * vertex[i][k];
			triangle[i] = i;
		}
		assert_int_equal(geo_boxes_build(&b, vertex[0], triangle, n, &e), 0);
		for (uint32_t i = 0; i < n; i++) {
			size_t near = 0;
			found.n = 0;
			assert_int_equal(geo_boxes_find(&b, &b.box[i], .01, &found, &e), 0);
			for (uint32_t j = 0; j < n; j++) {
				int apart = 0;
				for (int k = 0; k < 3; k++)
					apart |= b.box[j].lo[k] > b.box[i].hi[k] + .01 ||
					         b.box[j].hi[k] < b.box[i].lo[k] - .01;
				for (size_t f = 0; f < found.n && !apart; f++)
					near += ((uint32_t *)found.data)[f] == j;
				near += apart ? 0 : 0x10000;
			}
			assert_int_equal(near, found.n * 0x10001);
		}
		free(found.data);
		geo_boxes_free(&b);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_footprint),
		cmocka_unit_test(test_patches_end_at_lines),
		cmocka_unit_test(test_crossing),
		cmocka_unit_test(test_wall),
		cmocka_unit_test(test_room_is_whole),
		cmocka_unit_test(test_flush),
		cmocka_unit_test(test_close),
		cmocka_unit_test(test_covered),
		cmocka_unit_test(test_options),
		slow_unit_test(test_random),
		cmocka_unit_test(test_many),
		cmocka_unit_test(test_boxes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
