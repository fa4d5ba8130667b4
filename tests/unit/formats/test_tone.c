/* Exposure, the display curve, false colours and their legend. */
#include <math.h>

#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "formats/picture/png_file.h"
#include "lib/picture/tonemap.h"
#include "tests/unit/fixtures/check.h"

static const char *const names[] = { "R", "G", "B" };
static const int rgb[3] = { 0, 1, 2 };

static void grey_image(struct image *im, int width, int height, float value)
{
	struct err e = { 0 };

	assert_int_equal(picture_image_new(im, width, height, 3, names, &e), 0);
	for (int i = 0; i < 3 * width * height; i++)
		im->pixel[i] = value;
}

static void set_grey(struct image *im, int at, float value)
{
	for (int c = 0; c < 3; c++)
		picture_image_plane(im, c)[at] = value;
}

static void test_black(void **state)
{
	struct image im;
	struct canvas c;
	struct tone_curve curve = { .white = 1 };
	struct err e = { 0 };
	size_t lit = 1;

	(void)state;
	grey_image(&im, 8, 8, 0);
	assert_that(picture_tonemap_exposure(&im, rgb, &lit), ==, 0);
	assert_int_equal(lit, 0);
	assert_int_equal(picture_canvas_new(&c, 8, 8, &e), 0);
	for (curve.compress = 0; curve.compress < 2; curve.compress++) {
		assert_int_equal(picture_tonemap_curve(&im, rgb, &curve, &c), 0);
		for (int i = 0; i < 3 * 64; i++) {
			given("i %d", i);
			assert_that(c.rgb[i], ==, 0);
		}
	}
	for (int logarithmic = 0; logarithmic < 2; logarithmic++) {
		given("logarithmic %d", logarithmic);
		struct tone_scale s = { NAN, NAN, logarithmic };

		assert_int_equal(picture_tonemap_scale(&im, rgb, &s, &e), 0);
		assert_near(s.min, logarithmic ? .01 : 0, 1e-15);
		assert_near(s.max, 1, 0);
		assert_int_equal(picture_tonemap_false_colour(&im, rgb, &s, &c), 0);
	}
	picture_canvas_free(&c);
	picture_image_free(&im);
}

static void test_exposure(void **state)
{
	static const float levels[] = { 1e-42f, 1e-10f, .18f, 1, 1e4f, 3e38f };
	struct image im;
	size_t lit;

	(void)state;
	for (size_t i = 0; i < sizeof levels / sizeof *levels; i++) {
		given("level %g", (double)levels[i]);
		grey_image(&im, 10, 10, levels[i]);
		assert_near(picture_tonemap_exposure(&im, rgb, &lit), log2(.18 / levels[i]), .01);
		/* Lamps, black and broken pixels do not matter. */
		set_grey(&im, 0, 3e38f);
		set_grey(&im, 1, 3e38f);
		for (int k = 50; k < 90; k++)
			set_grey(&im, k, 0);
		set_grey(&im, 2, NAN);
		set_grey(&im, 3, -1);
		assert_near(picture_tonemap_exposure(&im, rgb, &lit), log2(.18 / levels[i]), .01);
		assert_int_equal(lit, 58);
		picture_image_free(&im);
	}
}

static void test_curve(void **state)
{
	struct tone_curve curve = { .exposure = 1, .white = 1 };
	struct image im;
	struct canvas c;
	struct err e = { 0 };
	uint8_t bytes[15];
	uint16_t words[15];

	(void)state;
	grey_image(&im, 5, 1, .25f);
	set_grey(&im, 1, .001f);
	set_grey(&im, 2, 7);
	set_grey(&im, 3, -7);
	picture_image_plane(&im, 1)[4] = INFINITY;
	assert_int_equal(picture_canvas_new(&c, 5, 1, &e), 0);
	assert_int_equal(picture_tonemap_curve(&im, rgb, &curve, &c), 1);
	assert_near(c.rgb[0], 1.055 * pow(.5, 1 / 2.4) - .055, 1e-6);
	assert_near(c.rgb[3], .002 * 12.92, 1e-6);
	picture_canvas_quantise(&c, 8, bytes);
	assert_int_equal(bytes[0], 188); /* the sRGB code of one half */
	assert_int_equal(bytes[6], 255);
	assert_int_equal(bytes[9], 0);
	assert_that(bytes[12], ==, 255);
	assert_that(bytes[13], ==, 0);
	assert_that(bytes[14], ==, 255);
	picture_canvas_quantise(&c, 16, words);
	assert_int_equal(words[6], 65535);

	/* White stays white and .5 becomes .5 (1 + .5 / 16) / 1.5. */
	curve = (struct tone_curve){ .exposure = 1, .white = 4, .compress = 1 };
	set_grey(&im, 2, 2);
	assert_int_equal(picture_tonemap_curve(&im, rgb, &curve, &c), 1);
	assert_near(c.rgb[0], 1.055 * pow(.34375, 1 / 2.4) - .055, 1e-6);
	assert_near(c.rgb[6], 1, 1e-6);
	picture_canvas_free(&c);
	picture_image_free(&im);
}

static void test_colours(void **state)
{
	double before = -1;
	float c[3];

	(void)state;
	for (int i = 0; i <= 1000; i++) {
		given("i %d", i);
		picture_tonemap_colour(i / 1000., c);
		double l = .299 * (double)c[0] + .587 * (double)c[1] + .114 * (double)c[2];
		for (int k = 0; k < 3; k++)
			assert_true(c[k] >= 0 && c[k] <= 1);
		assert_that(l, >, before - 1e-3);
		/* far from the magenta of broken pixels */
		assert_that(fabsf(c[0] - 1) + c[1] + fabsf(c[2] - 1), >, .5f);
		before = l;
	}
	picture_tonemap_colour(0, c);
	assert_near((double)(c[0] + c[1] + c[2]), 0, 1e-6);
	picture_tonemap_colour(1, c);
	assert_near((double)(c[0] + c[1] + c[2]), 3, 1e-6);
}

static void check_scale(float low, float high, int logarithmic, double min, double max)
{
	struct tone_scale s = { NAN, NAN, logarithmic };
	struct image im;
	struct err e = { 0 };

	grey_image(&im, 10, 10, high);
	for (int i = 0; i < 50; i++)
		set_grey(&im, i, low);
	if (picture_tonemap_scale(&im, rgb, &s, &e))
		fail_msg("%s", e.text);
	assert_near(s.min, min, 1e-9 * (fabs(min) + fabs(max)));
	assert_near(s.max, max, 1e-9 * (fabs(min) + fabs(max)));
	assert_that(picture_tonemap_position(&s, s.min), ==, 0);
	assert_that(picture_tonemap_position(&s, s.max), ==, 1);
	picture_image_free(&im);
}

static void test_scale(void **state)
{
	struct tone_scale s = { NAN, 3, 1 }, bad = { 5, NAN, 0 };
	struct image im;
	struct err e = { 0 };

	(void)state;
	check_scale(.3f, 7, 1, .2, 10);
	check_scale(1, 1, 1, .1, 1);
	check_scale(1e-9f, 3, 1, 5e-4, 5);
	check_scale(0, 4e30f, 1, 2e30, 5e30);
	check_scale(.3f, 7, 0, 0, 10);
	check_scale(-.3f, 15, 0, -.5, 20);
	check_scale(-.3f, -.2f, 0, -.5, 0);
	grey_image(&im, 4, 4, 100);
	assert_int_equal(picture_tonemap_scale(&im, rgb, &s, &e), 0);
	assert_near(s.min, .3, 1e-12);
	assert_near(picture_tonemap_position(&s, .3 * sqrt(10)), .5, 1e-12);
	set_grey(&im, 0, 1);
	picture_image_free(&im);
	grey_image(&im, 4, 4, 1);
	assert_int_equal(picture_tonemap_scale(&im, rgb, &bad, &e), -1);
	picture_image_free(&im);
}

/* The legend's bar runs through all colours, and something white stands beside it. */
static void check_legend(const struct tone_scale *s, int width, int height)
{
	struct canvas c;
	struct err e = { 0 };
	int old_width = width, bar, white = 0;
	float top[3], *p;

	assert_int_equal(picture_canvas_new(&c, width, height, &e), 0);
	for (int i = 0; i < 3 * width * height; i++)
		c.rgb[i] = .25f;
	assert_int_equal(picture_legend_append(&c, s, &e), 0);
	assert_that(c.width, >, old_width);
	assert_int_equal(c.height, height < 40 ? 40 : height);
	for (int x = 0; x < old_width; x++)
		assert_that(c.rgb[3 * x], ==, .25f);
	int dot = 1 + c.height / 500;
	bar = old_width + 6 * dot + 6 * dot;
	picture_tonemap_colour(1, top);
	p = c.rgb + 3 * (6 * dot * c.width + bar);
	for (int k = 0; k < 3; k++)
		assert_near((double)p[k], (double)top[k], 1e-6);
	for (int y = 0; y < c.height; y++)
		for (int x = old_width + (6 + 12 + 6) * dot; x < c.width; x++)
			white += c.rgb[3 * (y * c.width + x)] == 1;
	assert_that(white, >, 20 * dot * dot);
	/* The numbers end before the edge. */
	for (int y = 0; y < c.height; y++)
		assert_that(c.rgb[3 * (y * c.width + c.width - 1)], ==, 0);
	picture_canvas_free(&c);
}

static void test_legend(void **state)
{
	static const struct tone_scale scales[] = {
		{ 0, 1, 0 },         { -5, 5, 0 },        { 1e-30, 1e30, 1 }, { .9, 1.1, 1 },
		{ .2, 10, 1 },       { 1e9, 1e9 + 1, 0 }, { -1e38, 1e38, 0 }, { 1e-38, 2e-38, 0 },
		{ 1.234, 5.678, 0 }, { 3, 4, 1 },
	};

	(void)state;
	for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
		given("i %zu", i);
		check_legend(&scales[i], 1, 1);
		check_legend(&scales[i], 64, 48);
		check_legend(&scales[i], 3, 480);
		check_legend(&scales[i], 3, 2160);
	}
}

static void test_png(void **state)
{
	char path[] = "/tmp/twopass-png-XXXXXX";
	uint16_t out[12] = { 0, 1, 2, 256, 257, 258, 65535, 30000, 4, 5, 6, 7 }, in[12];
	struct err e = { 0 }, f = { 0 };
	png_image png = { .version = PNG_IMAGE_VERSION };
	int fd = mkstemp(path);

	(void)state;
	assert_that(fd, >=, 0);
	close(fd);
	assert_int_equal(file_png_write(path, 2, 2, 16, out, "caf\xc3\xa9", &e), 0);
	assert_true(png_image_begin_read_from_file(&png, path));
	assert_int_equal(png.width, 2);
	assert_int_equal(png.height, 2);
	png_image_free(&png);

	FILE *file = fopen(path, "rb");
	png_structp p = png_create_read_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
	png_infop info = png_create_info_struct(p);
	png_init_io(p, file);
	png_read_png(p, info, PNG_TRANSFORM_SWAP_ENDIAN, NULL);
	for (int y = 0; y < 2; y++)
		memcpy(in + 6 * y, png_get_rows(p, info)[y], 12);
	assert_memory_equal(in, out, sizeof in);
	assert_true(png_get_valid(p, info, PNG_INFO_sRGB));
	assert_false(png_get_valid(p, info, PNG_INFO_tIME));
	png_destroy_read_struct(&p, &info, NULL);
	fclose(file);
	unlink(path);

	assert_int_equal(file_png_write("/dev/full", 2, 2, 8, out, NULL, &f), -1);
	assert_string_equal(f.text, "/dev/full: cannot write: No space left on device");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_black),   cmocka_unit_test(test_exposure),
		cmocka_unit_test(test_curve),   cmocka_unit_test(test_colours),
		cmocka_unit_test(test_scale),   cmocka_unit_test(test_legend),
		cmocka_unit_test(test_png),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
