/* Differences of pictures, against sums done by hand. */
#include <math.h>

#include "lib/picture/compare.h"
#include "tests/unit/fixtures/check.h"

static const char *const names[] = { "R", "G", "B" };
static const int rgb[3] = { 0, 1, 2 }, red[1] = { 0 };

static void two_images(struct image *a, struct image *b)
{
	struct err e = { 0 };

	assert_int_equal(picture_image_new(a, 4, 2, 3, names, &e), 0);
	assert_int_equal(picture_image_new(b, 4, 2, 3, names, &e), 0);
}

static void compare(const struct image *a, const int *channel, const struct image *b, int n,
                    const unsigned char *mask, struct compare *d)
{
	struct err e = { 0 };

	assert_int_equal(picture_compare_channels(a, channel, b, channel, n, mask, d, &e), 0);
}

static void test_equal(void **state)
{
	struct image a, b;
	struct compare d;

	(void)state;
	two_images(&a, &b);
	compare(&a, rgb, &b, 3, NULL, &d);
	assert_int_equal(d.pixels, 8);
	assert_that(d.rmse, ==, 0);
	assert_that(d.relative_rmse, ==, 0);
	assert_that(d.bias, ==, 0);
	assert_that(d.relative_bias, ==, 0);
	assert_that(d.max, ==, 0);
	assert_that(d.max_x, ==, 0);
	assert_that(d.max_y, ==, 0);
	picture_image_free(&a);
	picture_image_free(&b);
}

static void test_numbers(void **state)
{
	struct image a, b;
	struct compare d;

	(void)state;
	two_images(&a, &b);
	for (int i = 0; i < 24; i++)
		b.pixel[i] = 2;
	for (int i = 0; i < 24; i++)
		a.pixel[i] = i == 6 ? 5.f : i == 8 + 6 ? -2.f : 2.f;
	compare(&a, red, &b, 1, NULL, &d);
	assert_close(d.mean_a, 19. / 8, 1e-14);
	assert_close(d.mean_b, 2, 1e-14);
	assert_close(d.bias, 3. / 8, 1e-14);
	assert_close(d.relative_bias, 3. / 16, 1e-14);
	assert_close(d.rmse, sqrt(9. / 8), 1e-14);
	assert_close(d.relative_rmse, sqrt(9. / 8) / 2, 1e-14);
	compare(&a, rgb, &b, 3, NULL, &d);
	assert_close(d.rmse, sqrt(25. / 24), 1e-14);
	assert_close(d.bias, -1. / 24, 1e-14);
	assert_close(d.max, 4, 1e-14);
	assert_int_equal(d.max_x, 2);
	assert_int_equal(d.max_y, 1);
	picture_image_free(&a);
	picture_image_free(&b);
}

static void test_not_finite(void **state)
{
	struct image a, b;
	struct compare d;

	(void)state;
	two_images(&a, &b);
	a.pixel[0] = NAN;
	b.pixel[8 + 1] = INFINITY;
	compare(&a, rgb, &b, 3, NULL, &d);
	assert_int_equal(d.pixels, 6);
	assert_int_equal(d.left_out, 2);
	compare(&a, red, &b, 1, NULL, &d);
	assert_int_equal(d.pixels, 7);
	for (int i = 0; i < 8; i++)
		a.pixel[i] = -INFINITY;
	compare(&a, rgb, &b, 3, NULL, &d);
	assert_int_equal(d.pixels, 0);
	assert_int_equal(d.left_out, 8);
	assert_that(d.rmse, ==, 0);
	assert_that(d.max_x, ==, -1);
	picture_image_free(&a);
	picture_image_free(&b);
}

static void test_black_yardstick(void **state)
{
	struct image a, b;
	struct compare d;

	(void)state;
	two_images(&a, &b);
	a.pixel[3] = -1;
	compare(&a, rgb, &b, 3, NULL, &d);
	assert_true(isinf(d.relative_rmse));
	assert_that(d.relative_rmse, >, 0);
	assert_true(isinf(d.relative_bias));
	assert_that(d.relative_bias, <, 0);
	picture_image_free(&a);
	picture_image_free(&b);
}

/* 100 pixels with errors of 1 to 100 per mille, against hand counts. */
static void test_percentiles(void **state)
{
	static const char *const one[] = { "R" };
	unsigned char mask[100] = { 0 };
	struct image a, b;
	struct compare d;
	struct err e = { 0 };

	(void)state;
	assert_int_equal(picture_image_new(&a, 10, 10, 1, one, &e), 0);
	assert_int_equal(picture_image_new(&b, 10, 10, 1, one, &e), 0);
	for (int i = 0; i < 100; i++) {
		b.pixel[i] = -1000;
		a.pixel[i] = b.pixel[i] + (float)(1 + (37 * i) % 100) * (i % 2 ? 1 : -1);
	}
	compare(&a, red, &b, 1, NULL, &d);
	for (int i = 0; i < COMPARE_PERCENTILES; i++) {
		given("i %d", i);
		assert_near(d.percentile[i], picture_compare_percentile[i] * 1e-3, 1e-7);
	}
	for (int i = 0; i < 100; i++)
		mask[i] = 1 + (37 * i) % 100 > 10;
	compare(&a, red, &b, 1, mask, &d);
	assert_int_equal(d.pixels, 10);
	assert_int_equal(d.excluded, 90);
	assert_near(d.percentile[0], .005, 1e-7);
	assert_near(d.percentile[2], .01, 1e-7);
	picture_image_free(&a);
	picture_image_free(&b);
}

/* The relative error of a pixel is that of its colour as a vector. */
static void test_colour_error(void **state)
{
	struct image a, b;
	struct compare d;

	(void)state;
	two_images(&a, &b);
	for (int i = 0; i < 8; i++) {
		b.pixel[i] = 3, b.pixel[8 + i] = 0, b.pixel[16 + i] = 4;
		a.pixel[i] = 3, a.pixel[8 + i] = .3f, a.pixel[16 + i] = 4.4f;
	}
	compare(&a, rgb, &b, 3, NULL, &d);
	assert_near(d.percentile[0], .1, 1e-7);
	assert_near(d.percentile[2], .1, 1e-7);
	picture_image_free(&a);
	picture_image_free(&b);
}

static void test_masks(void **state)
{
	static const char *const many[] = { "emission.R", "emission.G", "emission.B", "Z" };
	unsigned char mask[8] = { 0 };
	struct image im;
	struct err e = { 0 };

	(void)state;
	assert_int_equal(picture_image_new(&im, 4, 2, 4, many, &e), 0);
	im.pixel[8 + 3] = 1;
	im.pixel[24 + 5] = INFINITY;
	assert_int_equal(picture_compare_mask_emitters(&im, mask), 0);
	for (int i = 0; i < 8; i++) {
		given("i %d", i);
		assert_int_equal(mask[i], i == 3);
	}
	assert_int_equal(picture_compare_mask_nothing(&im, mask), 0);
	for (int i = 0; i < 8; i++) {
		given("i %d", i);
		assert_int_equal(mask[i], i == 3 || i == 5);
	}
	picture_image_free(&im);
	assert_int_equal(picture_image_new(&im, 4, 2, 3, names, &e), 0);
	assert_int_equal(picture_compare_mask_emitters(&im, mask), -1);
	assert_int_equal(picture_compare_mask_nothing(&im, mask), -1);
	picture_image_free(&im);
}

static void test_difference(void **state)
{
	struct image a, b, c;
	struct err e = { 0 };
	const int green[1] = { 1 };

	(void)state;
	two_images(&a, &b);
	a.pixel[8 + 5] = 3;
	b.pixel[8 + 5] = 4.5f;
	assert_int_equal(picture_compare_difference(&a, green, &b, green, 1, &c, &e), 0);
	assert_int_equal(c.channels, 1);
	assert_string_equal(c.name[0], "G");
	assert_that(c.pixel[5], ==, -1.5f);
	assert_that(c.pixel[4], ==, 0);
	picture_image_free(&a);
	picture_image_free(&b);
	picture_image_free(&c);
}

static void test_layers(void **state)
{
	static const char *const many[] = { "Z", "diffuse.B", "diffuse.G", "diffuse.R", "N.X",
		                            "N.Y", "N.Z", "half.R" };
	struct image im;
	struct err e = { 0 };
	int c[3];

	(void)state;
	assert_int_equal(picture_image_new(&im, 1, 1, 8, many, &e), 0);
	assert_int_equal(picture_image_layer(&im, "diffuse", c), 3);
	assert_that(c[0], ==, 3);
	assert_that(c[1], ==, 2);
	assert_that(c[2], ==, 1);
	assert_int_equal(picture_image_layer(&im, "N", c), 3);
	assert_int_equal(picture_image_layer(&im, "Z", c), 1);
	assert_that(c[0], ==, 0);
	assert_that(c[2], ==, 0);
	assert_int_equal(picture_image_layer(&im, "half", c), 0);
	assert_int_equal(picture_image_layer(&im, "half.R", c), 1);
	assert_int_equal(picture_image_layer(&im, NULL, c), 0);
	picture_image_free(&im);
}

static void test_empty_image(void **state)
{
	struct image im;
	struct err e = { 0 }, f = { 0 };

	(void)state;
	assert_int_equal(picture_image_new(&im, 0, 5, 3, names, &e), -1);
	assert_int_equal(picture_image_new(&im, 0x7fffffff, 0x7fffffff, 3, names, &f), -1);
	assert_null(im.pixel);
	picture_image_free(&im);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_equal),           cmocka_unit_test(test_numbers),
		cmocka_unit_test(test_not_finite),      cmocka_unit_test(test_black_yardstick),
		cmocka_unit_test(test_percentiles),
		cmocka_unit_test(test_colour_error),
		cmocka_unit_test(test_masks),
		cmocka_unit_test(test_difference),      cmocka_unit_test(test_layers),
		cmocka_unit_test(test_empty_image),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
