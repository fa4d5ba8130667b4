/* Picture sizes, primary rays, depth and matrices of views. */
#include <math.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/picture/camera.h"
#include "tests/unit/fixtures/check.h"

static const double identity[16] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };

static struct camera perspective(double yfov, double aspect)
{
	struct camera c = { .name = (char *)"c", .yfov = yfov, .aspect = aspect };
	memcpy(c.to_world, identity, sizeof identity);
	return c;
}

static void near_vector(const double a[3], double x, double y, double z)
{
	assert_that(fabs(a[0] - x) + fabs(a[1] - y) + fabs(a[2] - z), <, 1e-12);
}

static void test_resolution(void **state)
{
	struct camera c = perspective(1, 2), o = { .orthographic = 1, .xmag = 3, .ymag = 1 };
	struct view_frame f;
	struct err e = { 0 };
	(void)state;

	assert_int_equal(picture_camera_frame(&c, 0, 0, &f, &e), 0);
	assert_int_equal(f.width, 640);
	assert_int_equal(f.height, 320);
	assert_int_equal(picture_camera_frame(&c, 100, 100, &f, &e), 0); /* the size wins */
	assert_that(f.half_x, ==, f.half_y);
	c.aspect = 0;
	assert_int_equal(picture_camera_frame(&c, 0, 0, &f, &e), 0);
	assert_int_equal(f.height, 480);
	memcpy(o.to_world, identity, sizeof identity);
	assert_int_equal(picture_camera_frame(&o, 300, 0, &f, &e), 0);
	assert_int_equal(f.height, 100);
	c.aspect = 1e-6;
	assert_int_equal(picture_camera_frame(&c, 0, 0, &f, &e), -1);
	assert_non_null(strstr(e.text, "camera 'c'"));
	struct camera blind = perspective(0, 1);
	assert_int_equal(picture_camera_frame(&blind, 0, 0, &f, &e), -1);
}

static void test_perspective_rays(void **state)
{
	struct camera c = perspective(2 * atan(.5), 2);
	struct view_frame f;
	struct err e = { 0 };
	double org[3], dir[3];
	(void)state;

	assert_int_equal(picture_camera_frame(&c, 200, 100, &f, &e), 0);
	picture_camera_ray(&f, 100, 50, org, dir);
	near_vector(org, 0, 0, 0);
	near_vector(dir, 0, 0, -1);
	picture_camera_ray(&f, 0, 0, org, dir); /* top left: x = -1, y = .5 at z = -1 */
	near_vector(dir, -1 / 1.5, .5 / 1.5, -1 / 1.5);
	picture_camera_ray(&f, 200, 100, org, dir);
	near_vector(dir, 1 / 1.5, -.5 / 1.5, -1 / 1.5);
}

static void test_orthographic_rays(void **state)
{
	struct camera c = { .orthographic = 1, .xmag = 2, .ymag = 1 };
	struct view_frame f;
	struct err e = { 0 };
	double org[3], dir[3];
	(void)state;

	memcpy(c.to_world, identity, sizeof identity);
	c.to_world[14] = 5;
	assert_int_equal(picture_camera_frame(&c, 4, 2, &f, &e), 0);
	picture_camera_ray(&f, 0, 0, org, dir);
	near_vector(org, -2, 1, 5);
	near_vector(dir, 0, 0, -1);
	double p[3] = { 7, 8, 2 };
	assert_near(picture_camera_depth(&f, p), 3, 1e-12);
}

static void test_look_at(void **state)
{
	double eye[3] = { 1, 2, 3 }, target[3] = { 4, 2, 3 }, up[3] = { .3, 0, 2 };
	double along[3] = { -2, 0, 0 }, zero[3] = { 0, 0, 0 }, org[3], dir[3];
	struct camera c;
	struct view_frame f;
	struct err e = { 0 };
	float w[16];
	(void)state;

	assert_int_equal(picture_camera_look_at(eye, target, up, 90, &c, &e), 0);
	assert_int_equal(picture_camera_frame(&c, 10, 10, &f, &e), 0);
	picture_camera_ray(&f, 5, 5, org, dir);
	near_vector(org, 1, 2, 3);
	near_vector(dir, 1, 0, 0);
	picture_camera_ray(&f, 5, 0, org, dir);
	near_vector(dir, sqrt(.5), 0, sqrt(.5));
	picture_camera_world_to_camera(&f, w);
	double x[4] = { 4, 1, 7, 1 }, y[3] = { 0, 0, 0 }; /* right is -y here */
	for (int j = 0; j < 3; j++)
		for (int k = 0; k < 4; k++)
			y[j] += x[k] * (double)w[4 * k + j];
	assert_that(fabs(y[0] - 1) + fabs(y[1] - 4) + fabs(y[2] - 3), <, 1e-6);
	assert_int_equal(picture_camera_look_at(eye, eye, up, 90, &c, &e), -1);
	assert_int_equal(picture_camera_look_at(eye, target, along, 90, &c, &e), -1);
	assert_int_equal(picture_camera_look_at(eye, target, zero, 90, &c, &e), -1);
	assert_int_equal(picture_camera_look_at(eye, target, up, 180, &c, &e), -1);
}

static void test_names(void **state)
{
	struct camera list[2] = { perspective(1, 1), perspective(1, 1) };
	struct model m = { .cameras = 2, .camera = list }, none = { 0 };
	struct err e = { 0 };
	(void)state;

	list[0].name = (char *)"front";
	list[1].name = (char *)"side";
	assert_int_equal(picture_camera_find(&m, "side", &e), 1);
	assert_int_equal(picture_camera_find(&m, "top", &e), -1);
	assert_string_equal(e.text, "no camera 'top'; there are: front, side");
	e.set = 0;
	assert_int_equal(picture_camera_find(&none, "top", &e), -1);
	assert_non_null(strstr(e.text, "--eye"));
}

int main(void)
{
	const struct CMUnitTest tests[] = { cmocka_unit_test(test_resolution),
		cmocka_unit_test(test_perspective_rays), cmocka_unit_test(test_orthographic_rays),
		cmocka_unit_test(test_look_at), cmocka_unit_test(test_names)
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
