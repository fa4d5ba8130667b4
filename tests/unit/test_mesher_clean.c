/* What the mesher drops, welds and merges. */
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/shapes.h"

static void test_sliver(void **state)
{
	struct model m;
	struct mesh_report r;

	(void)state;
	for (int turn = 0; turn < 2; turn++) {
		given("turn %d", turn);
		begin(&m, 3, 0);
		add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 0);
		add_rectangle(&m, (double[]){ 1, 0, 0 }, (double[]){ 1e-6, 0, 0 },
		              (double[]){ 0, 1, 0 }, 1);
		add_rectangle(&m, (double[]){ 1 + 1e-6, 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 2);
		transform(&m, 1, turn, 0);
		r = run(&m, sizes(.5, .25, 0));
		assert_int_equal(m.triangle.n, 6);
		assert_int_equal(r.total.degenerate, 0);
		assert_int_equal(r.total.duplicate, 0);
		assert_int_equal(r.components, 1);
		assert_int_equal(r.open_edges, 8);
		assert_near(r.area_front, 2.000001, 1e-12);
		mesh_report_free(&r);
		model_free(&m);
	}
}

static void test_degenerate(void **state)
{
	struct model m;
	struct mesh_report r;
	struct mesh_options o = sizes(.5, .5, 0);
	struct err e = { 0 };

	(void)state;
	o.no_imprint = 1; /* the last triangle lies half in each of the square's */
	begin(&m, 2, 0);
	add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 0, 1, 0 }, 0);
	for (int i = 0; i < 4; i++) /* float32 positions that mean to be collinear */
		mesh_add_vertex(&m, (double)(.1f * (float)i), (double)(.2f * (float)i),
		                (double)(.3f * (float)i));
	add_triangle(&m, 4, 5, 7, 1);
	add_triangle(&m, 5, 5, 6, 1);
	add_triangle(&m, 5, 6, 5, 1);
	add_triangle(&m, 0, 1, 3, 1);
	r = run(&m, o);
	/* The last one was no copy of a square's half, cut along the other diagonal. */
	assert_int_equal(m.triangle.n, 3);
	assert_int_equal(r.total.degenerate, 3);
	assert_int_equal(r.surface[1].degenerate, 3);
	assert_int_equal(r.total.duplicate, 0);
	assert_that(m.triangle.uv[6 * 2], ==, 5);
	mesh_report_free(&r);
	model_free(&m);

	begin(&m, 1, 0);
	mesh_add_vertex(&m, 1, 2, 3);
	add_triangle(&m, 0, 0, 0, 0);
	assert_int_equal(mesh_run(&m, &(struct mesh_options){ 0 }, &r, &e), -1);
	assert_non_null(strstr(e.text, "no geometry"));
	mesh_report_free(&r);
	model_free(&m);
}

/* Equal, opposite and otherwise cut copies of a square, rounded otherwise. */
static void test_duplicates(void **state)
{
	static const uint32_t copy[4][4] = { { 0, 1, 2, 3 }, { 0, 3, 2, 1 }, { 3, 2, 1, 0 },
		{ 1, 2, 3, 0 } };

	(void)state;
	for (int one_sided = 0; one_sided < 2; one_sided++)
		for (int c = 0; c < 4; c++)
			for (int other = 0; other < 2; other++) {
				given("one_sided %d, c %d, other %d", one_sided, c, other);
				struct model m;
				const uint32_t *q = copy[c];
				int opposite = c == 1 || c == 2;
				begin(&m, 2, one_sided);
				for (int i = 0; i < 2; i++)
					add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
					              (double[]){ 0, 1, 0 }, 0);
				m.triangle.n = 2;
				for (size_t i = 12; i < 24; i++)
					m.vertex[i] += i % 5 > 1 ? 2e-7 : 0;
				add_quad(&m, 4 + q[0], 4 + q[1], 4 + q[2], 4 + q[3], (uint32_t)other);
				struct mesh_report r = run(&m, sizes((double)INFINITY, .5, 0));
				assert_int_equal(m.triangle.n, 2);
				assert_int_equal(r.total.duplicate, 2);
				assert_int_equal(m.patch.n, 1);
				assert_int_equal(r.merged, one_sided && opposite ? 2 : 0);
				assert_int_equal(m.patch.surface[0], 0);
				uint32_t material = model_patch_material(&m, 0);
				if (one_sided && opposite) {
					assert_int_equal(m.material.one_sided[material], 0);
					assert_that(m.material.rho_d[2 * material], ==, .5);
					assert_that(m.material.rho_d[2 * material + 1], ==,
					            .5 + .01 * other);
				} else {
					assert_int_equal(material, 0);
				}
				mesh_report_free(&r);
				model_free(&m);
			}
}

/* Only half of a surface has a twin: it becomes a surface of its own. */
static void test_partial_sandwich(void **state)
{
	struct model m;
	struct mesh_report r;

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
	assert_int_equal(m.patch.n, 2);
	assert_near(r.area_front, 2, 1e-15);
	assert_near(r.area_back, 1, 1e-15);
	mesh_report_free(&r);
	model_free(&m);
}

static void test_winding(void **state)
{
	struct model m;
	struct mesh_report r;

	(void)state;
	make_cube(&m);
	uint32_t swap = m.triangle.corner[1];
	m.triangle.corner[1] = m.triangle.corner[2];
	m.triangle.corner[2] = swap;
	r = run(&m, sizes((double)INFINITY, (double)INFINITY, 0));
	assert_int_equal(r.surface[0].opposite, 3);
	assert_int_equal(m.patch.n, 7);
	mesh_report_free(&r);
	model_free(&m);
}

/* Vertices a rounding error apart are one; a crack of 1e-6 stays. */
static void test_weld(void **state)
{
	static const double gap[2] = { 1e-11, 1e-6 };

	(void)state;
	for (int i = 0; i < 2; i++) {
		given("i %d", i);
		struct model m;
		begin(&m, 1, 0);
		add_rectangle(&m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 0);
		add_rectangle(&m, (double[]){ 1 + gap[i], 0, 0 }, (double[]){ 1, 0, 0 },
		              (double[]){ 0, 1, 0 }, 0);
		struct mesh_report r = run(&m, sizes((double)INFINITY, .3, 0));
		assert_int_equal(r.surface[0].welded, i ? 0 : 2);
		assert_int_equal(m.patch.n, i ? 2 : 1);
		mesh_report_free(&r);
		model_free(&m);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_sliver),
		cmocka_unit_test(test_degenerate),
		cmocka_unit_test(test_duplicates),
		cmocka_unit_test(test_partial_sandwich),
		cmocka_unit_test(test_winding),
		cmocka_unit_test(test_weld),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
