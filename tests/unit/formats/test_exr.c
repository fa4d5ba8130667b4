/* OpenEXR pictures: round trips, files of other writers, broken files. */
#include <dirent.h>
#include <fcntl.h>
#include <math.h>
#include <openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "formats/container/atomic_file.h"
#include "formats/picture/exr_file.h"
#include "lib/base/rng.h"
#include "tests/unit/fixtures/check.h"

static char directory[] = "/tmp/twopass-exr-XXXXXX";

static const char *place(const char *name)
{
	static char path[4][128];
	static int next;

	next = (next + 1) % 4;
	snprintf(path[next], sizeof path[next], "%s/%s", directory, name);
	return path[next];
}

static int files_in_directory(void)
{
	DIR *d = opendir(directory);
	struct dirent *f;
	int n = -2; /* . and .. */

	while ((f = readdir(d)))
		n++;
	closedir(d);
	return n;
}

static unsigned char *slurp(const char *path, size_t *size)
{
	FILE *f = fopen(path, "rb");
	unsigned char *bytes = malloc(1 << 20);

	assert_non_null(f);
	*size = fread(bytes, 1, 1 << 20, f);
	fclose(f);
	return bytes;
}

/* Overwrites in place: a file that is emptied first is written to the disk each time. */
static void spill(const char *path, const void *bytes, size_t size)
{
	int f = open(path, O_WRONLY | O_CREAT, 0666);

	assert_int_equal(write(f, bytes, size), size);
	assert_int_equal(ftruncate(f, (off_t)size), 0);
	close(f);
}

static const char long_name[] =
    "a.layer.with.a.name.that.needs.the.long.names.of.version.two.R";

static void make_image(struct image *im, int width, int height)
{
	static const char *const name[] = { "R", "G", "B", "Z", "element", long_name };
	struct err e = { 0 };

	assert_int_equal(picture_image_new(im, width, height, 6, name, &e), 0);
	for (int c = 0; c < im->channels; c++)
		for (int i = 0; i < width * height; i++)
			picture_image_plane(im, c)[i] = sinf((float)(i * (c + 1))) * (float)(1 << 2 * c);
	picture_image_plane(im, 0)[0] = NAN;
	picture_image_plane(im, 1)[1] = INFINITY;
	picture_image_plane(im, 2)[2] = 1e6f;
	picture_image_plane(im, 4)[0] = 16777215;
}

static void round_trip(int width, int height, enum exr_file_compression compression, int half)
{
	struct exr_file_options o = { compression, half };
	struct image a, b;
	struct err e = { 0 };
	size_t clipped;

	make_image(&a, width, height);
	assert_int_equal(file_exr_write(place("a.exr"), &a, NULL, &o, &clipped, &e), 0);
	assert_int_equal(clipped, half ? 1 : 0);
	assert_int_equal(file_exr_read(place("a.exr"), &b, NULL, &e), 0);
	assert_int_equal(b.width, width);
	assert_int_equal(b.height, height);
	assert_int_equal(b.channels, a.channels);
	for (int c = 0; c < a.channels; c++) {
		const float *x = picture_image_plane(&a, c);
		const float *y = picture_image_plane(&b, picture_image_channel(&b, a.name[c]));
		int as_half = half && (c < 3 || c == 5);

		for (int i = 0; i < width * height; i++) {
			if (isnan(x[i]))
				assert_true(isnan(y[i]));
			else if (as_half && isfinite(x[i]))
				/* half an ulp of 11 bits, or of the denormals */
				assert_that(fabsf(fminf(x[i], 65504) - y[i]), <=,
				            fmaxf(fabsf(x[i]) / 2048, 3e-8f));
			else
				assert_that(x[i], ==, y[i]);
		}
	}
	picture_image_free(&a);
	picture_image_free(&b);
}

static void test_round_trip(void **state)
{
	static const int size[][2] = { { 7, 37 }, { 3, 1 }, { 130, 33 }, { 257, 16 } };

	(void)state;
	for (size_t s = 0; s < sizeof size / sizeof *size; s++)
		for (int c = EXR_FILE_AUTO; c <= EXR_FILE_NONE; c++)
			for (int half = 0; half < 2; half++)
				round_trip(size[s][0], size[s][1], (enum exr_file_compression)c, half);
}

/* Bytes of a picture of floats. From row `noisy` on 11 of 12 differ from all others. */
static size_t size_with_noise(int noisy, enum exr_file_compression compression)
{
	enum { WIDTH = 64, HEIGHT = 512 };
	static const char *const rgb[] = { "R", "G", "B" };
	struct exr_file_options o = { compression, 0 };
	struct rng g = rng_seed(1, 0);
	struct image a, b;
	struct err e = { 0 };
	size_t size;

	assert_int_equal(picture_image_new(&a, WIDTH, HEIGHT, 3, rgb, &e), 0);
	for (int c = 0; c < 3; c++)
		for (int i = noisy * WIDTH; i < WIDTH * HEIGHT; i++)
			picture_image_plane(&a, c)[i] = c > 0 || i % 4 ? (float)rng_uniform(&g) : 0;
	assert_int_equal(file_exr_write(place("a.exr"), &a, NULL, &o, NULL, &e), 0);
	assert_int_equal(file_exr_read(place("a.exr"), &b, NULL, &e), 0);
	for (int c = 0; c < 3; c++)
		assert_memory_equal(picture_image_plane(&a, c), picture_image_plane(&b, picture_image_channel(&b, rgb[c])),
		                    WIDTH * HEIGHT * sizeof *a.pixel);
	free(slurp(place("a.exr"), &size));
	picture_image_free(&a);
	picture_image_free(&b);
	return size;
}

/* What zip makes hardly smaller stays as it is, and the rest is compressed. */
static void test_auto(void **state)
{
	(void)state;
	size_t zip = size_with_noise(0, EXR_FILE_ZIP), half = size_with_noise(256, EXR_FILE_ZIP);

	assert_that(size_with_noise(0, EXR_FILE_AUTO), >, zip * 101 / 100);
	assert_that(half, <, zip * 6 / 10);
	assert_that(size_with_noise(256, EXR_FILE_AUTO), <, half * 108 / 100);
	assert_int_equal(size_with_noise(512, EXR_FILE_AUTO), size_with_noise(512, EXR_FILE_ZIP));
}

static void test_names(void **state)
{
	(void)state;
	assert_string_equal(file_exr_compression_name[EXR_FILE_AUTO], "auto");
	assert_string_equal(file_exr_compression_name[EXR_FILE_ZIP], "zip");
	assert_string_equal(file_exr_compression_name[EXR_FILE_NONE], "none");
	assert_null(file_exr_compression_name[EXR_FILE_NONE + 1]);
}

static void test_attributes(void **state)
{
	struct exr_file_info i = { .white_luminance = 1, .has_world_to_camera = 1 }, j;
	struct image im;
	struct err e = { 0 };

	(void)state;
	make_image(&im, 5, 40);
	for (int k = 0; k < 16; k++)
		i.world_to_camera[k] = (float)k / 3;
	assert_int_equal(file_exr_info_set(&i, EXR_FILE_CAMERA, "wrong", &e), 0);
	assert_int_equal(file_exr_info_set(&i, EXR_FILE_CAMERA, "door", &e), 0);
	assert_int_equal(file_exr_info_set(&i, EXR_FILE_HISTORY, "mesh a\nffcalc b\n", &e), 0);
	assert_int_equal(file_exr_info_set(&i, "twopassAnAttributeWithAVeryLongName", "", &e), 0);
	assert_int_equal(file_exr_write(place("b.exr"), &im, &i, NULL, NULL, &e), 0);
	picture_image_free(&im);
	assert_int_equal(file_exr_read(place("b.exr"), &im, &j, &e), 0);
	assert_int_equal(j.strings, 3);
	assert_string_equal(file_exr_info_get(&j, "camera"), "door");
	assert_string_equal(file_exr_info_get(&j, "history"), "mesh a\nffcalc b\n");
	assert_string_equal(file_exr_info_get(&j, "twopassAnAttributeWithAVeryLongName"), "");
	assert_null(file_exr_info_get(&j, "missing"));
	assert_that(j.white_luminance, ==, 1);
	assert_true(j.has_world_to_camera);
	assert_memory_equal(j.world_to_camera, i.world_to_camera, sizeof i.world_to_camera);
	file_exr_info_free(&i);
	file_exr_info_free(&j);
	picture_image_free(&im);
}

static void test_same_bytes(void **state)
{
	struct image im;
	struct err e = { 0 };
	size_t n, m;
	unsigned char *a, *b;

	(void)state;
	make_image(&im, 130, 33);
	assert_int_equal(file_exr_write(place("a.exr"), &im, NULL, NULL, NULL, &e), 0);
	assert_int_equal(file_exr_write(place("another.exr"), &im, NULL, NULL, NULL, &e), 0);
	a = slurp(place("a.exr"), &n);
	b = slurp(place("another.exr"), &m);
	assert_int_equal(n, m);
	assert_memory_equal(a, b, n);
	free(a);
	free(b);
	picture_image_free(&im);
}

static void test_bad_names(void **state)
{
	static const char *const twice[] = { "R", "R" }, *const empty[] = { "" };
	struct image im;
	struct err e = { 0 }, f = { 0 };

	(void)state;
	assert_int_equal(picture_image_new(&im, 1, 1, 2, twice, &e), 0);
	assert_int_equal(file_exr_write(place("n.exr"), &im, NULL, NULL, NULL, &e), -1);
	assert_non_null(strstr(e.text, "given twice"));
	picture_image_free(&im);
	assert_int_equal(picture_image_new(&im, 1, 1, 1, empty, &f), 0);
	assert_int_equal(file_exr_write(place("n.exr"), &im, NULL, NULL, NULL, &f), -1);
	picture_image_free(&im);
	assert_int_not_equal(access(place("n.exr"), F_OK), 0);
}

/* ---- files that others write ---- */

struct foreign {
	exr_storage_t storage;
	exr_pixel_type_t type;
	int x0, y0, width, height, tile, parts, sampling;
};

/* Pixel (x, y) of the data window's corner-based coordinates is 1000 y + x. */
static void fill_chunk(exr_encode_pipeline_t *p, uint32_t *row, int x0, int y0)
{
	for (int y = 0; y < p->chunk.height; y++) {
		for (int x = 0; x < p->chunk.width; x++) {
			uint32_t n = (uint32_t)(1000 * (y0 + y) + x0 + x);
			float v = (float)n;

			memcpy(&row[y * p->chunk.width + x],
			       p->channels[0].data_type == EXR_PIXEL_UINT ? (void *)&n : (void *)&v, 4);
		}
	}
	if (p->channels[0].data_type != EXR_PIXEL_UINT)
		p->channels[0].user_data_type = EXR_PIXEL_FLOAT;
	p->channels[0].user_bytes_per_element = 4;
	p->channels[0].user_pixel_stride = 4;
	p->channels[0].user_line_stride = 4 * p->chunk.width;
	p->channels[0].encode_from_ptr = (const uint8_t *)row;
}

static void put_chunk(exr_context_t c, int part, const exr_chunk_info_t *chunk, int x, int y)
{
	exr_encode_pipeline_t p = EXR_ENCODE_PIPELINE_INITIALIZER;
	uint32_t row[64 * 64];

	assert_int_equal(exr_encoding_initialize(c, part, chunk, &p), 0);
	fill_chunk(&p, row, x, y);
	assert_int_equal(exr_encoding_choose_default_routines(c, part, &p), 0);
	assert_int_equal(exr_encoding_run(c, part, &p), 0);
	exr_encoding_destroy(c, &p);
}

static void write_part(exr_context_t c, int part, const struct foreign *f)
{
	exr_chunk_info_t chunk;
	int32_t lines = f->tile;

	if (f->storage == EXR_STORAGE_SCANLINE)
		exr_get_scanlines_per_chunk(c, part, &lines);
	for (int y = 0; y < f->height; y += lines) {
		if (f->storage == EXR_STORAGE_SCANLINE) {
			exr_write_scanline_chunk_info(c, part, f->y0 + y, &chunk);
			put_chunk(c, part, &chunk, 0, y);
			continue;
		}
		for (int x = 0; x < f->width; x += f->tile) {
			exr_write_tile_chunk_info(c, part, x / f->tile, y / f->tile, 0, 0, &chunk);
			put_chunk(c, part, &chunk, x, y);
		}
	}
}

/* The library would remove a file whose pixels were not written. */
static int64_t keep_bytes(exr_const_context_t c, void *user, const void *data, uint64_t size,
                          uint64_t offset, exr_stream_error_func_ptr_t report)
{
	(void)c;
	(void)report;
	return pwrite(fileno(user), data, size, (off_t)offset);
}

static void write_foreign(const char *path, const struct foreign *f)
{
	exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
	exr_context_t c;
	exr_attr_box2i_t w = { .min = { { { f->x0, f->y0 } } },
	                       .max = { { { f->x0 + f->width - 1, f->y0 + f->height - 1 } } } };
	exr_attr_v2f_t centre = { { { 0, 0 } } };
	char name[16];

	init.write_fn = keep_bytes;
	init.user_data = fopen(path, "wb");
	assert_int_equal(exr_start_write(&c, path, EXR_WRITE_FILE_DIRECTLY, &init), 0);
	for (int p = 0; p < f->parts; p++) {
		snprintf(name, sizeof name, "p%d", p);
		exr_add_part(c, f->parts > 1 ? name : NULL, f->storage, NULL);
		exr_initialize_required_attr(c, p, &w, &w, 1, &centre, 1, EXR_LINEORDER_INCREASING_Y,
		                             EXR_COMPRESSION_ZIPS);
		if (f->storage == EXR_STORAGE_TILED)
			exr_set_tile_descriptor(c, p, (uint32_t)f->tile, (uint32_t)f->tile,
			                        EXR_TILE_ONE_LEVEL, EXR_TILE_ROUND_DOWN);
		exr_add_channel(c, p, "Y", f->type, EXR_PERCEPTUALLY_LINEAR, f->sampling,
		                f->sampling);
	}
	assert_int_equal(exr_write_header(c), 0);
	for (int p = 0; p < f->parts && f->sampling == 1; p++)
		if (f->storage == EXR_STORAGE_SCANLINE || f->storage == EXR_STORAGE_TILED)
			write_part(c, p, f);
	exr_finish(&c);
	fclose(init.user_data);
}

static void test_foreign(void **state)
{
	static const struct foreign file[] = {
		{ EXR_STORAGE_SCANLINE, EXR_PIXEL_UINT, -3, 5, 33, 40, 0, 1, 1 },
		{ EXR_STORAGE_SCANLINE, EXR_PIXEL_FLOAT, 100, -50, 1, 17, 0, 1, 1 },
		{ EXR_STORAGE_TILED, EXR_PIXEL_FLOAT, 4, -7, 50, 37, 16, 1, 1 },
		{ EXR_STORAGE_TILED, EXR_PIXEL_UINT, 0, 0, 16, 16, 16, 1, 1 },
		{ EXR_STORAGE_TILED, EXR_PIXEL_UINT, 0, 0, 5, 90, 64, 1, 1 },
	};

	(void)state;
	for (size_t i = 0; i < sizeof file / sizeof *file; i++) {
		given("i %zu", i);
		struct image im;
		struct err e = { 0 };

		write_foreign(place("f.exr"), &file[i]);
		if (file_exr_read(place("f.exr"), &im, NULL, &e))
			fail_msg("%s", e.text);
		assert_int_equal(im.width, file[i].width);
		assert_int_equal(im.height, file[i].height);
		for (int y = 0; y < im.height; y++)
			for (int x = 0; x < im.width; x++)
				assert_that(im.pixel[y * im.width + x], ==, (float)(1000 * y + x));
		picture_image_free(&im);
	}
}

static void refuse(const char *path, const char *why)
{
	struct image im;
	struct exr_file_info info;
	struct err e = { 0 };

	assert_int_equal(file_exr_read(path, &im, &info, &e), -1);
	assert_null(im.pixel);
	assert_null(info.string);
	if (!strstr(e.text, why))
		fail_msg("'%s' does not say '%s'", e.text, why);
	assert_that(strncmp(e.text, path, strlen(path)), ==, 0);
	assert_null(strchr(e.text, '\n'));
}

static void test_refusals(void **state)
{
	static const struct foreign two = { EXR_STORAGE_SCANLINE, EXR_PIXEL_FLOAT, 0, 0, 4, 4, 0,
	                                    2, 1 };
	static const struct foreign sampled = { EXR_STORAGE_SCANLINE, EXR_PIXEL_FLOAT, 0, 0, 4, 4,
	                                        0, 1, 2 };
	static const struct foreign deep = { EXR_STORAGE_DEEP_SCANLINE, EXR_PIXEL_FLOAT, 0, 0, 4,
	                                     4, 0, 1, 1 };

	(void)state;
	write_foreign(place("f.exr"), &two);
	refuse(place("f.exr"), "2 parts");
	write_foreign(place("f.exr"), &sampled);
	refuse(place("f.exr"), "subsampled");
	write_foreign(place("f.exr"), &deep);
	refuse(place("f.exr"), "deep data");
	spill(place("f.exr"), "P6 4 4 255 what a picture", 24);
	refuse(place("f.exr"), "not an OpenEXR file");
	spill(place("f.exr"), "", 0);
	refuse(place("f.exr"), "not an OpenEXR file");
	refuse(place("missing.exr"), "No such file");
	refuse(directory, "is a directory");
}

static void write_small(int width, int height, enum exr_file_compression compression)
{
	struct exr_file_options o = { compression, 0 };
	struct exr_file_info i = { .white_luminance = 1 };
	struct image im;
	struct err e = { 0 };

	make_image(&im, width, height);
	assert_int_equal(file_exr_info_set(&i, EXR_FILE_KEY, "k", &e), 0);
	assert_int_equal(file_exr_write(place("small.exr"), &im, &i, &o, NULL, &e), 0);
	file_exr_info_free(&i);
	picture_image_free(&im);
}

static void test_truncated(void **state)
{
	size_t size;
	unsigned char *bytes;

	(void)state;
	write_small(6, 20, EXR_FILE_ZIP);
	bytes = slurp(place("small.exr"), &size);
	assert_int_equal(file_exr_up_to_date(place("small.exr"), "k", 0), KEY_FITS);
	assert_int_equal(file_exr_up_to_date(place("small.exr"), "l", 0), 0);
	for (size_t n = 0; n < size; n++) {
		given("n %zu", n);
		spill(place("t.exr"), bytes, n);
		refuse(place("t.exr"), "OpenEXR file");
		assert_int_equal(file_exr_up_to_date(place("t.exr"), "k", 0), 0);
	}
	free(bytes);
}

/* A flipped pixel byte may pass (the format has no checksums), but never crashes.
 * Returns how many flips were refused. */
static int flip_all(enum exr_file_compression compression)
{
	static const unsigned char mask[] = { 0x01, 0x80, 0xff };
	size_t size;
	unsigned char *bytes;
	int refused = 0;

	write_small(6, 20, compression);
	bytes = slurp(place("small.exr"), &size);
	for (size_t n = 0; n < size * 3; n++) {
		struct image im;
		struct exr_file_info info;
		struct err e = { 0 };

		bytes[n / 3] ^= mask[n % 3];
		spill(place("t.exr"), bytes, size);
		refused += file_exr_read(place("t.exr"), &im, &info, &e) != 0;
		picture_image_free(&im);
		file_exr_info_free(&info);
		bytes[n / 3] ^= mask[n % 3];
	}
	free(bytes);
	return refused;
}

static void test_flipped(void **state)
{
	(void)state;
	for (int c = EXR_FILE_ZIP; c <= EXR_FILE_NONE; c++) {
		given("c %d", c);
		assert_that(flip_all((enum exr_file_compression)c), >, 100);
	}
}

static void test_huge_window(void **state)
{
	static const int32_t edge[] = { 65535, 65536, 0x7fffffff, -2, -1000000 };
	size_t size;
	unsigned char *bytes;

	(void)state;
	write_small(6, 20, EXR_FILE_ZIP);
	bytes = slurp(place("small.exr"), &size);
	for (size_t n = 8; n + 40 < size; n++) {
		given("n %zu", n);
		if (memcmp(bytes + n, "dataWindow", 11) != 0)
			continue;
		for (size_t k = 0; k < 10; k++) {
			unsigned char *max = bytes + n + 11 + 6 + 4 + 8 + 4 * (k % 2), old[4];

			memcpy(old, max, 4);
			memcpy(max, &edge[k / 2], 4);
			spill(place("t.exr"), bytes, size);
			refuse(place("t.exr"), "");
			memcpy(max, old, 4);
		}
	}
	free(bytes);
}

/* ---- output ---- */

static void test_old_file_kept(void **state)
{
	struct image im;
	struct err e = { 0 }, f = { 0 };
	struct stat st;
	int files;

	(void)state;
	make_image(&im, 40, 40);
	assert_int_equal(file_exr_write("/dev/full", &im, NULL, NULL, NULL, &e), -1);
	assert_string_equal(e.text, "/dev/full: cannot write: No space left on device");
	assert_int_equal(file_exr_write("/nowhere/a.exr", &im, NULL, NULL, NULL, &f), -1);
	assert_non_null(strstr(f.text, "/nowhere/a.exr: cannot create"));
	picture_image_free(&im);

	spill(place("kept"), "old", 3);
	assert_int_equal(chmod(place("kept"), 0640), 0);
	assert_int_equal(symlink(place("kept"), place("link")), 0);
	files = files_in_directory();
	struct err g = { 0 };
	struct atomic_file *a = file_atomic_create(place("link"), &g);
	assert_non_null(a);
	assert_int_equal(file_atomic_write(a, "new", 3, &g), 0);
	assert_int_equal(files_in_directory(), files + 1);
	file_atomic_abandon(a);
	assert_int_equal(files_in_directory(), files);

	a = file_atomic_create(place("link"), &g);
	file_atomic_remove_temporaries();
	assert_int_equal(files_in_directory(), files);
	assert_int_equal(file_atomic_finish(a, &g), -1);
	size_t n;
	unsigned char *bytes = slurp(place("kept"), &n);
	assert_int_equal(n, 3);
	assert_memory_equal(bytes, "old", 3);
	free(bytes);

	struct err h = { 0 };
	assert_int_equal(file_atomic_put(place("link"), "newer", 5, &h), 0);
	assert_int_equal(lstat(place("link"), &st), 0);
	assert_true(S_ISLNK(st.st_mode));
	assert_int_equal(stat(place("kept"), &st), 0);
	assert_int_equal(st.st_size, 5);
	assert_int_equal(st.st_mode & 0777, 0640);
	assert_int_equal(files_in_directory(), files);
}

static int make_directory(void **state)
{
	(void)state;
	return mkdtemp(directory) ? 0 : -1;
}

static int remove_directory(void **state)
{
	char command[128];

	(void)state;
	snprintf(command, sizeof command, "rm -rf %s", directory);
	return system(command);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_round_trip),   cmocka_unit_test(test_auto),
		cmocka_unit_test(test_names),
		cmocka_unit_test(test_attributes),   cmocka_unit_test(test_same_bytes),
		cmocka_unit_test(test_bad_names),    cmocka_unit_test(test_foreign),
		cmocka_unit_test(test_refusals),     cmocka_unit_test(test_truncated),
		slow_unit_test(test_flipped),      cmocka_unit_test(test_huge_window),
		cmocka_unit_test(test_old_file_kept),
	};

	return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
