/* Rows of rays, of what elements gather and of what they see of emitters, element by
 * element against Lambert's formula for polygons. */
#include <math.h>

#include "lib/base/constants.h"
#include "lib/ff/ff_job.h"
#include "lib/ff/row_reciprocal.h"
#include "lib/ff_rays/ray_budget.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/memory_ff.h"
#include "tests/unit/fixtures/shapes.h"

enum { CEILING = 1, SHELF = 6 };

static struct ff_options options(uint32_t gather)
{
	return (struct ff_options){ .method = FF_RAYS, .rays = 4096, .points = 1,
		.emitter_gain = 8, .gather = gather, .lobe_rays = 64, .depth = 16, .seed = 1,
		.f64 = 1, .shard = 1, .shards = 1, .threads = 2 };
}

/* Meshes a scene whose report nobody reads. */
static void mesh(struct model *m, struct mesh_options o)
{
	struct mesh_report r = run(m, o);

	mesh_report_free(&r);
}

/* The room with its ceiling at z = 1, meshed; the ceiling gives light or not. */
static void make(struct model *m, double emission, int shelf)
{
	if (!shelf) {
		make_room(m);
	} else { /* a plate above half of the floor, seen from both sides */
		begin(m, 7, 0);
		add_room(m);
		add_rectangle(m, (double[]){ .1, .2, .4 }, (double[]){ .5, 0, 0 },
		              (double[]){ 0, .6, 0 }, SHELF);
	}
	m->material.emission[2 * CEILING] = emission;
	mesh(m, shelf ? sizes(.35, .12, 0) : sizes(.2, .07, 0));
}

/* Lambert 1760: the form factor from a point with normal n to a polygon above its
 * horizon. */
static double lambert(const double x[3], const double n[3], const double (*corner)[3], int corners)
{
	double sum = 0;

	for (int i = 0; i < corners; i++) {
		double a[3], b[3], c[3], l;
		v3_sub(corner[i], x, a);
		v3_sub(corner[(i + 1) % corners], x, b);
		v3_cross(a, b, c);
		l = v3_normalise(c);
		if (l > 0)
			sum += atan2(l, v3_dot(a, b)) * v3_dot(c, n);
	}
	return fabs(sum) / (2 * PI);
}

/* Flux per area that each element-side gets from surface `from` of unit exitance, by the
 * rows of a form-factor file. */
static double *lit_by(const struct model *m, const struct ff *f, uint32_t from)
{
	double *h = calloc(2 * m->element.n, sizeof *h);

	for (size_t r = 0; r < f->row.n; r++) {
		uint32_t patch = f->row.side[r] >> 1;
		uint64_t b = f->row.block[r];
		if (m->patch.surface[patch] != from)
			continue;
		for (uint64_t i = f->block.start[b]; i < f->block.start[b + 1]; i++)
			h[f->column[i]] += ff_value(f, i) * f->row.scale[r] * m->patch.area[patch] /
			                   m->element.area[f->column[i] >> 1];
	}
	return h;
}

static void check_closure(const struct ff *f)
{
	for (size_t r = 0; r < f->row.n; r++) {
		uint64_t b = f->row.block[r];
		double sum = f->block.escape[b] + f->block.black[b] + f->block.lost[b] + f->block.cut[b];
		for (uint64_t i = f->block.start[b]; i < f->block.start[b + 1]; i++)
			sum += ff_value(f, i);
		assert_near(sum * f->row.scale[r], 1, 1e-12);
		assert_that(f->row.error[r], >=, 0);
		assert_that(f->row.error[r], <, .1);
	}
}

/* Relative root mean square over the floor of what the ceiling sends there, against the
 * formula. */
static double floor_error(const struct model *m, const struct ff_options *o)
{
	static const double ceiling[4][3] = { { 0, 0, 1 }, { 1, 0, 1 }, { 1, 1, 1 }, { 0, 1, 1 } };
	struct ff f;
	struct ff_stats stats;
	double squares = 0, area = 0;

	memory_ff(m, o, &f, &stats);
	check_closure(&f);
	double *h = lit_by(m, &f, CEILING);
	for (uint32_t el = 0; el < m->element.n; el++) {
		double x[3] = { 0 };
		const double *n = &m->element.normal[3 * (size_t)el];
		if (m->patch.surface[m->element.patch[el]] != 0)
			continue;
		assert_that(n[2], >, .99);
		for (size_t k = 0; k < 3; k++)
			v3_mad(x, 1. / 3, &m->vertex[3 * (size_t)m->element.corner[3 * (size_t)el + k]], x);
		double exact = lambert(x, n, ceiling, 4), d = h[2 * el] / exact - 1;
		squares += m->element.area[el] * d * d;
		area += m->element.area[el];
	}
	assert_near(area, 1, 1e-9);
	free(h);
	ff_free(&f);
	return sqrt(squares / area);
}

/* Of the rows' own rays an element of the floor gets its share by chance; what it gathers
 * is stratified. 1.5 times what was found at this seed. */
static void gathered(void **state)
{
	struct model m;
	struct ff_options own = options(0), gathers = options(256);

	(void)state;
	make(&m, 0, 0);
	double a = floor_error(&m, &own), b = floor_error(&m, &gathers);
	print_message("own rays %.4f, gathered %.4f\n", a, b);
	assert_that(b, <, .058);
	assert_that(b, <, a / 2);
	model_free(&m);
}

static void emitter_seen(void **state)
{
	struct model m;
	struct ff_options sees = options(256);

	(void)state;
	make(&m, 1, 0);
	double a = floor_error(&m, &sees);
	print_message("emitter %.4f\n", a);
	assert_that(a, <, .002);
	model_free(&m);
}

/* With something in the way: what every element gets of every patch, from a run with
 * many rays of the rows alone. */
static void hidden(void **state)
{
	struct model m;
	struct ff f[2];
	struct ff_stats stats;
	struct ff_options many = options(0), gathers = options(256);

	(void)state;
	many.rays = 131072;
	many.emitter_gain = 4;
	make(&m, 1, 1);
	memory_ff(&m, &many, &f[0], &stats);
	memory_ff(&m, &gathers, &f[1], &stats);
	check_closure(&f[1]);
	for (uint32_t from = 0; from < 7; from++) {
		given("from %u", from);
		double *h[2] = { lit_by(&m, &f[0], from), lit_by(&m, &f[1], from) };
		double squares = 0, sum = 0, flux[2] = { 0 };
		for (size_t i = 0; i < 2 * m.element.n; i++) {
			double area = m.element.area[i / 2];
			squares += area * (h[0][i] - h[1][i]) * (h[0][i] - h[1][i]);
			sum += area * h[0][i] * h[0][i];
			flux[0] += area * h[0][i];
			flux[1] += area * h[1][i];
		}
		print_message("surface %u: %.4f\n", from, sqrt(squares / sum));
		assert_that(sqrt(squares / sum), <, .09);
		assert_near(flux[1] / flux[0], 1, 1e-9);
		free(h[0]);
		free(h[1]);
	}
	ff_free(&f[0]);
	ff_free(&f[1]);
	model_free(&m);
}

/* A square of light under an equal one: what escapes is told by the elements' rays, what
 * arrives by pairs. F = .199825 (Howell, C-11, at distance 1). */
static void open_scene(void **state)
{
	struct model m;
	struct ff f;
	struct ff_stats stats;
	struct ff_options o = options(256);
	double got = 0, escape = 0;

	(void)state;
	begin(&m, 2, 1);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
	add_rectangle(&m, (double[]){ 0, 0, 1 }, (double[]){ 0, 1, 0 }, (double[]){ 1, 0, 0 }, 1);
	m.material.emission[0] = 1;
	mesh(&m, sizes(.25, .08, 0));
	memory_ff(&m, &o, &f, &stats);
	check_closure(&f);
	double *h = lit_by(&m, &f, 0);
	for (size_t i = 0; i < 2 * m.element.n; i++)
		got += h[i] * m.element.area[i / 2];
	for (size_t r = 0; r < f.row.n; r++)
		if (m.patch.surface[f.row.side[r] >> 1] == 0)
			escape += f.block.escape[f.row.block[r]] * f.row.scale[r] *
			          m.patch.area[f.row.side[r] >> 1];
	print_message("F %.6f\n", got);
	assert_near(got, .199825, .001);
	assert_near(got + escape, 1, 1e-9);
	free(h);
	ff_free(&f);
	model_free(&m);
}

/* What the second of two squares at a right angle gets of the first, an emitter:
 * .200044 (Howell, C-14). */
static double at_a_right_angle(const struct ff_options *o, double element_size)
{
	struct model m;
	struct ff f;
	struct ff_stats stats;
	double got = 0;

	begin(&m, 2, 1);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 0, 1, 0 }, (double[]){ 0, 0, 1 }, 1);
	m.material.emission[0] = 1;
	mesh(&m, sizes(2, element_size, 0));
	memory_ff(&m, o, &f, &stats);
	check_closure(&f);
	double *h = lit_by(&m, &f, 0);
	for (size_t i = 0; i < 2 * m.element.n; i++)
		got += h[i] * m.element.area[i / 2];
	print_message("F %.6f\n", got);
	free(h);
	ff_free(&f);
	model_free(&m);
	return got;
}

/* Elements that touch the emitter cast rays; however many the rows have, they must not
 * be of some directions only. */
static void close_by(void **state)
{
	struct ff_options o = options(256);

	(void)state;
	o.rays = 65536;
	assert_near(at_a_right_angle(&o, .12), .200044, 2e-4);
}

/* By formula, also where elements are as large as the patch. */
static void by_formula(void **state)
{
	struct ff_options o = options(16);

	(void)state;
	o.method = FF_AUTO;
	o.target = 1e-4;
	assert_near(at_a_right_angle(&o, 2), .200044, 1e-6);
}

static void any_threads(void **state)
{
	struct model m;
	struct ff f[2];
	struct ff_stats stats;
	struct ff_options one = options(64), three = options(64);

	(void)state;
	one.rays = three.rays = 512;
	one.threads = 1;
	three.threads = 3;
	make(&m, 1, 1);
	memory_ff(&m, &one, &f[0], &stats);
	memory_ff(&m, &three, &f[1], &stats);
	assert_int_equal(f[0].entries, f[1].entries);
	assert_memory_equal(f[0].column, f[1].column, f[0].entries * sizeof *f[0].column);
	assert_memory_equal(f[0].value64, f[1].value64, f[0].entries * sizeof *f[0].value64);
	assert_memory_equal(f[0].row.error, f[1].row.error, f[0].row.n * sizeof *f[0].row.error);
	ff_free(&f[0]);
	ff_free(&f[1]);
	model_free(&m);
}

/* Rays of all rows that cast as many as they carry light, over those of all rows alike; the
 * most that one casts, and the fewest. */
static double shared_rays(double emission, uint32_t *most, uint32_t *least)
{
	struct model m;
	struct ff_job j;
	struct ff_options o = options(64);
	struct err e = { 0 };
	double rays = 0, sum = 0, rows = 0;

	make(&m, emission, 0);
	assert_int_equal(ff_job_init(&j, &m, &o, &e) || ff_job_prepare(&j, 1, &e) ||
	                 ff_reciprocal_cast(&j, 0, (uint32_t)m.patch.n, &rays, NULL, &e) || ff_share_rays(&j, &e), 0);
	*most = 0, *least = UINT32_MAX;
	for (uint32_t ps = 0; ps < 2 * m.patch.n; ps++) {
		uint32_t n = ff_row_rays(&j, ps);
		if (j.emits[ps])
			assert_int_equal(n, o.rays * o.emitter_gain);
		if (j.emits[ps] || !j.shoots_diffuse[ps])
			continue;
		rows++;
		sum += n;
		*most = n > *most ? n : *most;
		*least = n < *least ? n : *least;
	}
	ff_job_free(&j);
	model_free(&m);
	return sum / (rows * o.rays);
}

static void rays_go_where_light_is(void **state)
{
	uint32_t most, least;

	(void)state;
	assert_that(shared_rays(0, &most, &least), ==, 1);
	double part = shared_rays(1, &most, &least);
	assert_that(part, >, .5);
	assert_that(part, <, .95);
	assert_int_equal(most, 4096);
	assert_that(least, >=, 4096 >> FF_HALVINGS);
	assert_that(least, <, 4096);
	assert_int_equal(ff_most_halvings(8), 1);
	assert_int_equal(ff_most_halvings(4 * 3), 0);
	assert_int_equal(ff_most_halvings(4096), FF_HALVINGS);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(rays_go_where_light_is),
		cmocka_unit_test(gathered),
		slow_unit_test(emitter_seen),
		slow_unit_test(hidden),
		cmocka_unit_test(open_scene),
		cmocka_unit_test(close_by),
		cmocka_unit_test(by_formula),
		slow_unit_test(any_threads),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
