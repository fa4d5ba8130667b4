/* Pictures of solved scenes: furnaces, mirrors, panes, layers, cuts. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "tests/unit/fixtures/stage.h"

#include "lib/base/vec.h"

/* A closed box of irradiance 1: diffuse and mirror walls, and across its middle a
 * sheet that does everything. Everything must look 1 / pi bright. */
static void furnace(struct stage *t, double k)
{
	static const uint32_t material[6] = { 0, 1, 0, 1, 0, 0 };
	double lo[3] = { -1, -1, -1 }, hi[3] = { 1, 1, 1 };
	double o[3] = { -.9, -.8, -.1 }, x[3] = { 1.7, 0, .1 }, y[3] = { 0, 1.6, .2 };

	*t = (struct stage){ 0 };
	grid_new(&t->m, 7, 3, 3, 3);
	set(&t->m, 0, FRONT, .5, 0, 0, 0, (double)INFINITY);
	set(&t->m, 1, FRONT, .3, 0, .6, 0, k);
	t->m.material.one_sided[0] = t->m.material.one_sided[1] = 1;
	for (int side = 0; side < 2; side++)
		set(&t->m, 2, side, .1, .1, .3, .5, k);
	grid_box(&t->m, 3, material, lo, hi);
	grid_quad(&t->m, 3, 2, o, x, y);
	stage_end(t, 1);
}

static void test_furnace(void **state)
{
	double exponent[] = { (double)INFINITY, 20 }; /* the lobe's mirror ray: the same */
	struct view_options o = options();
	struct view_frame f = frame(.3, -.5, .6, -.2, .4, -.5, 40, 30);
	(void)state;

	o.samples = 4;
	o.depth = 60;
	o.cutoff = 1e-9;
	for (int i = 0; i < 2; i++) {
		given("exponent %g", exponent[i]);
		struct stage t;
		struct image im;
		furnace(&t, exponent[i]);
		struct view_stats s = render(&t, &f, &o, &im);
		for (size_t p = 0; p < 3 * 40 * 30; p++)
			assert_near((double)im.pixel[p] * PI, 1, 1e-6);
		assert_that(s.cut, <, 1e-6 * s.radiance);
		picture_image_free(&im);
		stage_free(&t);
	}
}

/* What is cut is bounded by what is said. */
static void test_cut_bound(void **state)
{
	struct view_frame f = frame(-.5, -.7, .3, .9, .8, .2, 24, 24);
	struct stage t;
	(void)state;

	furnace(&t, (double)INFINITY);
	for (int i = 0; i < 5; i++) {
		given("i %d", i);
		struct view_options o = options();
		struct image im;
		o.depth = i < 4 ? i : 32;
		o.cutoff = i < 4 ? 0 : .1;
		struct view_stats s = render(&t, &f, &o, &im);
		double missing = 3 / PI - s.radiance;
		assert_that(missing, >, 0);
		assert_that(missing, <=, s.cut * (1 + 1e-6));
		assert_that(missing, >, .5 * s.cut); /* and the bound is not idle */
		picture_image_free(&im);
	}
	stage_free(&t);
}

static void test_layers(void **state)
{
	struct view_options o = options();
	struct view_frame f = frame(.3, -.5, .6, -.2, .4, -.5, 24, 20);
	struct stage t;
	struct image im;
	(void)state;

	furnace(&t, (double)INFINITY);
	o.samples = 3;
	o.layers = VIEW_ALL;
	render(&t, &f, &o, &im);
	static const char *const name[] = { "R", "G", "B", "diffuse.R", "diffuse.G", "diffuse.B",
		"directional.R", "directional.G", "directional.B", "emission.R", "emission.G",
		"emission.B", "Z", "N.X", "N.Y", "N.Z", "element", "patch", "error.R", "error.G",
		"error.B" };
	assert_int_equal(im.channels, 21);
	for (int c = 0; c < 21; c++) {
		given("c %d", c);
		assert_string_equal(im.name[c], name[c]);
	}
	for (size_t p = 0; p < 24 * 20; p++)
		for (int c = 0; c < 3; c++) {
			given("p %zu, c %d", p, c);
			float sum = picture_image_plane(&im, 3 + c)[p] + picture_image_plane(&im, 6 + c)[p] +
			            picture_image_plane(&im, 9 + c)[p];
			assert_that(fabsf(sum - picture_image_plane(&im, c)[p]), <, 1e-6f);
		}
	for (size_t j = 0; j < 20; j++)
		for (size_t i = 0; i < 24; i++) {
			given("j %zu, i %zu", j, i);
			double org[3], dir[3], n[3], x[3];
			size_t p = j * 24 + i, element = (size_t)picture_image_plane(&im, 16)[p];
			picture_camera_ray(&f, (double)i + .5, (double)j + .5, org, dir);
			for (int k = 0; k < 3; k++)
				n[k] = (double)picture_image_plane(&im, 13 + k)[p];
			assert_that(v3_dot(n, dir), <, 0);
			assert_near(v3_length(n), 1, 1e-6);
			double t1 = (double)picture_image_plane(&im, 12)[p] / v3_dot(dir, f.forward);
			v3_mad(org, t1, dir, x); /* Z leads to the element's plane */
			v3_sub(x, &t.m.vertex[3 * (size_t)t.m.element.corner[3 * element]], x);
			assert_that(fabs(v3_dot(x, n)), <, 1e-5);
			assert_that(picture_image_plane(&im, 17)[p], ==, (float)t.m.element.patch[element]);
		}
	picture_image_free(&im);
	stage_free(&t);
}

static void test_layer_names(void **state)
{
	(void)state;
	assert_string_equal(view_layer_name[0], "diffuse");
	for (unsigned i = 0; view_layer_name[i]; i++) {
		int is_last = !view_layer_name[i + 1];
		assert_int_equal(strcmp(view_layer_name[i], "Z") == 0, 1u << i == VIEW_Z);
		assert_int_equal(strcmp(view_layer_name[i], "error") == 0, 1u << i == VIEW_ERROR);
		assert_int_equal(strcmp(view_layer_name[i], "all") == 0, is_last);
		assert_true(!is_last || (1u << i) - 1 == VIEW_ALL);
	}
}

static void test_threads(void **state)
{
	struct view_options o = options();
	struct view_frame f = frame(.3, -.5, .6, -.2, .4, -.5, 50, 37);
	struct stage t;
	struct image a, b;
	(void)state;

	furnace(&t, 7);
	o.samples = 5;
	o.lobe_samples = 3;
	o.layers = VIEW_ALL;
	struct view_stats sa = render(&t, &f, &o, &a);
	o.threads = 4;
	struct view_stats sb = render(&t, &f, &o, &b);
	assert_memory_equal(a.pixel, b.pixel, 50 * 37 * 21 * sizeof *a.pixel);
	assert_that(sa.rays, ==, sb.rays);
	assert_that(sa.radiance, ==, sb.radiance);
	assert_that(sa.cut, ==, sb.cut);
	picture_image_free(&a);
	picture_image_free(&b);
	stage_free(&t);
}

static void test_sides(void **state)
{
	struct view_options o = options();
	struct stage t;
	(void)state;

	wall(&t, LOBE_PAPER);
	stage_end(&t, 0);
	for (size_t i = 0; i < 8; i++) /* the wall: H front 2, back 3 */
		t.s.irradiance.indirect[2 * i] = 2, t.s.irradiance.indirect[2 * i + 1] = 3;
	use_method(&t, VIEW_MESH);
	/* Front: rho_s = 0 there, tau_s of the back; the lamp below shines through. */
	double front = .5 + (.1 * 2 + .25 * 3) / PI + .05 * 20;
	assert_near(look(&t, &o, .1, .2, 1, .3, .1, 0), front, 1e-5);
	/* Back: its own rho_s shows the lamp below, the front's tau_s the one above. */
	double back = .25 + (.15 * 3 + .2 * 2) / PI + .4 * 20 + .3 * 10;
	assert_near(look(&t, &o, .1, .2, -1, .3, .1, 0), back, 1e-5);
	stage_free(&t);
}

/* Camera rays and their straight-through continuations pass black backs, mirrored
 * rays do not. */
static void test_one_sided(void **state)
{
	double lamp[3] = { -5, -5, 2 }, screen[3] = { -5, -5, 1 }, pane[3] = { -5, -5, 0 };
	double below[3] = { -5, -5, -1 }, x[3] = { 10, 0, 0 }, y[3] = { 0, 10, 0 };
	struct view_options o = options();
	struct stage t = { 0 };
	(void)state;

	grid_new(&t.m, 4, 1, 4, 1);
	set(&t.m, 0, FRONT, 0, 0, 0, 0, 1);        /* lamp, seen from below: its back */
	t.m.material.emission[1] = 7;
	t.m.material.emission[0] = 0;
	t.m.material.one_sided[1] = 1;             /* screen: front up, black below */
	t.m.material.emission[2] = 3;
	for (int side = 0; side < 2; side++) {
		set(&t.m, 2, side, 0, 0, 0, 1, (double)INFINITY); /* clear pane */
		set(&t.m, 3, side, 0, 0, 1, 0, (double)INFINITY); /* mirror */
	}
	grid_quad(&t.m, 1, 0, lamp, x, y);
	grid_quad(&t.m, 1, 1, screen, x, y);
	grid_quad(&t.m, 1, 2, pane, x, y);
	grid_quad(&t.m, 1, 3, below, x, y);
	stage_end(&t, 0);
	assert_near(look(&t, &o, .1, .2, .5, .3, .1, 2), 7, 1e-6);
	assert_near(look(&t, &o, .1, .2, -.5, .3, .1, 2), 7, 1e-6);
	assert_that(look(&t, &o, .1, .2, .5, .3, .1, -1), ==, 0);
	assert_near(look(&t, &o, .1, .2, 1.5, .3, .1, -1), 3, 1e-6);
	stage_free(&t);
}

static void test_background_and_bands(void **state)
{
	double p[3] = { -1, -1, 0 }, x[3] = { 2, 0, 0 }, y[3] = { 0, 2, 0 };
	struct view_options o = options();
	(void)state;

	for (int bands = 1; bands <= 5; bands++) {
		given("bands %d", bands);
		struct stage t = { 0 };
		struct image im;
		struct view_frame f = frame(0, 0, 2, .01, 0, 0, 9, 9);
		grid_new(&t.m, 1, 1, 1, bands);
		set(&t.m, 0, FRONT, 0, 0, 0, 0, 1);
		for (int b = 0; b < bands; b++)
			t.m.material.emission[b] = b + 1;
		grid_quad(&t.m, 1, 0, p, x, y);
		stage_end(&t, 0);
		o.layers = VIEW_Z | VIEW_ELEMENT;
		render(&t, &f, &o, &im);
		int named = bands == 1 || bands == 3 ? 0 : bands;
		assert_int_equal(im.channels, 3 + named + 2);
		for (int c = 0; c < 3; c++)
			assert_that(picture_image_plane(&im, c)[40], ==, (float)(c < bands ? c + 1 : bands));
		for (int b = 0; b < named; b++) {
			char name[16];
			snprintf(name, sizeof name, "band.%d", b);
			assert_int_equal(picture_image_channel(&im, name), 3 + b);
			assert_that(picture_image_plane(&im, 3 + b)[40], ==, (float)(b + 1));
		}
		assert_that(im.pixel[0], ==, 0); /* the corner looks past it */
		assert_true(isinf(picture_image_plane(&im, picture_image_channel(&im, "Z"))[0]));
		assert_that(picture_image_plane(&im, picture_image_channel(&im, "element"))[0], ==, -1);
		picture_image_free(&im);
		stage_free(&t);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_furnace), cmocka_unit_test(test_cut_bound),
		cmocka_unit_test(test_layers), cmocka_unit_test(test_layer_names),
		slow_unit_test(test_threads), cmocka_unit_test(test_sides),
		cmocka_unit_test(test_one_sided),
		cmocka_unit_test(test_background_and_bands)
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
