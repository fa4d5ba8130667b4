/* The safetensors container: round trips, atomicity, and refusals. */
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "formats/cache/cache.h"
#include "formats/container/container.h"
#include "formats/container/container_internal.h"
#include "formats/container/history.h"
#include "tests/unit/fixtures/check.h"

static char directory[] = "/tmp/twopass-container-XXXXXX";
static char path[64];

static int set_up(void **state)
{
	(void)state;
	if (!mkdtemp(directory))
		return -1;
	snprintf(path, sizeof path, "%s/a.mesh", directory);
	return 0;
}

static int tear_down(void **state)
{
	char command[128];

	(void)state;
	snprintf(command, sizeof command, "rm -rf %s", directory);
	return system(command);
}

static const double doubles[6] = { 1, 2, 3, 4, 5, 1e300 };
static const uint8_t bytes3[3] = { 7, 8, 9 };

/* A file of four small arrays, the narrow one declared first. */
static void write_sample(const char *where, const char *mark)
{
	struct err e = { 0 };
	struct container_writer *w = file_container_create(where, &e);
	const uint64_t three = 3, shape[2] = { 3, 2 }, open[2] = { 0, 2 }, none[2] = { 0, 3 };

	assert_non_null(w);
	assert_int_equal(file_container_meta(w, "format", "twopass.mesh", &e), 0);
	assert_int_equal(file_container_meta(w, "version", CACHE_VERSION, &e), 0);
	assert_int_equal(file_container_meta(w, "key", mark, &e), 0);
	assert_int_equal(file_container_put(w, "narrow", DT_U8, 1, &three, bytes3, &e), 0);
	int rows = file_container_array(w, "rows", DT_F32, 2, open, &e);
	assert_int_equal(file_container_put(w, "wide", DT_F64, 2, shape, doubles, &e), 0);
	assert_int_equal(file_container_put(w, "empty", DT_I32, 2, none, NULL, &e), 0);
	for (int i = 0; i < 5; i++)
		assert_int_equal(file_container_write(w, rows, (float[2]){ (float)i, -1 }, 8, &e), 0);
	assert_int_equal(file_container_finish(w, &e), 0);
	assert_int_equal(e.set, 0);
}

static void check_sample(const char *where, const char *mark)
{
	struct err e = { 0 };
	struct container *c = file_container_open(where, "twopass.mesh", &e);

	if (!c)
		fail_msg("%s", e.text);
	assert_string_equal(file_container_get_meta(c, "key"), mark);
	assert_int_equal(file_container_verify_all(c, &e), 0);
	file_container_close(c);
}

static void test_round_trip(void **state)
{
	struct err e = { 0 };
	const uint64_t any[2] = { UINT64_MAX, 2 };

	(void)state;
	write_sample(path, "one");
	struct container *c = file_container_open(path, NULL, &e);
	assert_non_null(c);
	assert_int_equal(file_container_arrays(c), 4);
	const struct container_view *v = file_container_need(c, "wide", DT_F64, 2, any, &e);
	assert_non_null(v);
	assert_int_equal(v->count, 6);
	assert_memory_equal(v->data, doubles, sizeof doubles);
	assert_int_equal((uintptr_t)v->data % 8, 0);
	v = file_container_need(c, "rows", DT_F32, 2, any, &e);
	assert_int_equal(v->shape[0], 5);
	assert_that(((const float *)v->data)[8], ==, 4.f);
	assert_memory_equal(file_container_find(c, "narrow")->data, bytes3, 3);
	assert_int_equal(file_container_find(c, "empty")->count, 0);
	assert_string_equal(file_container_at(c, 0)->name, "wide");
	assert_string_equal(file_container_at(c, 3)->name, "narrow");
	assert_int_equal(file_container_verify_all(c, &e), 0);
	file_container_close(c);
}

static void test_need_says_what_is_wrong(void **state)
{
	const uint64_t five = 5;
	struct err e = { 0 };

	(void)state;
	write_sample(path, "one");
	struct container *c = file_container_open(path, NULL, &e);
	assert_null(file_container_need(c, "absent", DT_F64, 1, &five, &e));
	assert_non_null(strstr(e.text, "a.mesh: array absent: missing; run mesh again"));
	e.set = 0;
	assert_null(file_container_need(c, "narrow", DT_U8, 1, &five, &e));
	assert_non_null(strstr(e.text, "array narrow: it is U8 [3] and should be U8 [5]"));
	file_container_close(c);
	e.set = 0;
	assert_null(file_container_open(path, "twopass.ff", &e));
	assert_non_null(strstr(e.text, "a.mesh: this is a twopass.mesh file; a twopass.ff "
	                       "file is needed"));
}

/* More than the writer keeps in memory, in interleaved pieces of awkward sizes. */
static void test_spooled_arrays(void **state)
{
	enum { N = 700001 };
	const uint64_t open = 0;
	struct err e = { 0 };
	struct container_writer *w = file_container_create(path, &e);

	(void)state;
	uint32_t *a = malloc(N * sizeof *a);
	for (uint32_t i = 0; i < N; i++)
		a[i] = i * 2654435761u;
	file_container_meta(w, "format", "twopass.ff", &e);
	int x = file_container_array(w, "x", DT_U32, 1, &open, &e);
	int y = file_container_array(w, "y", DT_U32, 1, &open, &e);
	for (size_t i = 0, n; i < N; i += n) {
		n = i % 7919 + 1 < N - i ? i % 7919 + 1 : N - i;
		assert_int_equal(file_container_write(w, x, a + i, 4 * n, &e), 0);
		assert_int_equal(file_container_write(w, y, a + i, 4 * n, &e), 0);
	}
	assert_int_equal(file_container_write(w, y, a, 4 * N, &e), 0);
	assert_int_equal(file_container_finish(w, &e), 0);
	struct container *c = file_container_open(path, "twopass.ff", &e);
	assert_non_null(c);
	assert_int_equal(file_container_verify_all(c, &e), 0);
	assert_int_equal(file_container_find(c, "x")->count, N);
	assert_memory_equal(file_container_find(c, "x")->data, a, 4 * N);
	assert_memory_equal(file_container_find(c, "y")->data, a, 4 * N);
	assert_memory_equal((const uint32_t *)file_container_find(c, "y")->data + N, a, 4 * N);
	file_container_close(c);
	free(a);
}

/* ---- writing that fails ---- */

static void test_wrong_amount(void **state)
{
	const uint64_t four = 4;
	struct err e = { 0 };

	(void)state;
	write_sample(path, "old");
	struct container_writer *w = file_container_create(path, &e);
	int a = file_container_array(w, "short", DT_F64, 1, &four, &e);
	file_container_write(w, a, doubles, 24, &e);
	assert_int_equal(file_container_finish(w, &e), -1);
	assert_non_null(strstr(e.text, "array short: 24 bytes were written, its shape needs 32"));
	check_sample(path, "old");
}

static void test_abandoned(void **state)
{
	struct err e = { 0 };
	const uint64_t n = 6;

	(void)state;
	write_sample(path, "old");
	struct container_writer *w = file_container_create(path, &e);
	file_container_put(w, "x", DT_F64, 1, &n, doubles, &e);
	file_container_abandon(w);
	file_container_abandon(NULL);
	check_sample(path, "old");
}

static void test_bad_declarations(void **state)
{
	struct err e = { 0 };
	const uint64_t n = 6;

	(void)state;
	struct container_writer *w = file_container_create(path, &e);
	assert_that(file_container_array(w, "x", DT_F64, 1, &n, &e), >=, 0);
	assert_int_equal(file_container_array(w, "x", DT_F64, 1, &n, &e), -1);
	assert_non_null(strstr(e.text, "array x: declared twice"));
	e.set = 0;
	assert_int_equal(file_container_array(w, "__metadata__", DT_F64, 1, &n, &e), -1);
	e.set = 0;
	assert_int_equal(file_container_meta(w, "bad", "\xff\xfe", &e), -1);
	assert_non_null(strstr(e.text, "metadata bad is not UTF-8"));
	file_container_abandon(w);
}

static void write_large(const char *where, struct err *e)
{
	const size_t n = 1 << 20;
	const uint64_t open = 0;
	struct container_writer *w = file_container_create(where, e);
	char *zeros = calloc(n, 1);

	if (w) {
		int a = file_container_array(w, "large", DT_U8, 1, &open, e), failed = 0;
		file_container_meta(w, "format", "twopass.mesh", e);
		for (int i = 0; i < 32 && !failed; i++)
			failed = file_container_write(w, a, zeros, n, e);
		if (failed)
			file_container_abandon(w);
		else
			file_container_finish(w, e);
	}
	free(zeros);
}

static void test_full_device(void **state)
{
	struct err e = { 0 };

	(void)state;
	write_large("/dev/full", &e);
	assert_int_equal(e.set, 1);
	assert_non_null(strstr(e.text, "/dev/full: "));
	assert_non_null(strstr(e.text, "No space left on device"));
}

/* A limit on file sizes stands for a full disk. */
static void test_full_disk_keeps_old(void **state)
{
	char command[256];

	(void)state;
	write_sample(path, "old");
	pid_t child = fork();
	if (child == 0) {
		struct err e = { 0 };
		signal(SIGXFSZ, SIG_IGN);
		setrlimit(RLIMIT_FSIZE, &(struct rlimit){ 3 << 20, 3 << 20 });
		write_large(path, &e);
		_exit(e.set && strstr(e.text, path) ? 0 : 1);
	}
	int status;
	waitpid(child, &status, 0);
	assert_int_equal(status, 0);
	check_sample(path, "old");
	snprintf(command, sizeof command, "test $(ls -A %s | wc -l) = 1", directory);
	assert_int_equal(system(command), 0);
}

static void test_no_directory(void **state)
{
	struct err e = { 0 };

	(void)state;
	assert_null(file_container_create("/proc/nothing/here.mesh", &e));
	assert_non_null(strstr(e.text, "/proc/nothing/here.mesh: "));
	e.set = 0;
	assert_null(file_container_create(directory, &e));
	assert_int_equal(e.set, 1);
}

static void test_killed(void **state)
{
	(void)state;
	write_sample(path, "old");
	for (int i = 0; i < 12; i++) {
		given("i %d", i);
		pid_t child = fork();
		if (child == 0) {
			struct err e = { 0 };
			for (;;)
				write_large(path, &e);
		}
		/* Early kills hit the spooling, late ones the copy and the rename. */
		nanosleep(&(struct timespec){ .tv_nsec = 1000000L << i % 6 }, NULL);
		kill(child, SIGKILL);
		waitpid(child, NULL, 0);
		struct err e = { 0 };
		struct container *c = file_container_open(path, "twopass.mesh", &e);
		if (!c)
			fail_msg("%s", e.text);
		assert_int_equal(file_container_verify_all(c, &e), 0);
		file_container_close(c);
	}
}

static void test_pipe(void **state)
{
	char command[192], pipe_path[80];
	struct err e = { 0 };

	(void)state;
	snprintf(pipe_path, sizeof pipe_path, "%s/fifo", directory);
	assert_int_equal(mkfifo(pipe_path, 0600), 0);
	snprintf(command, sizeof command, "cat %s > %s", pipe_path, path);
	pid_t child = fork();
	if (child == 0)
		_exit(system(command) != 0);
	write_sample(pipe_path, "piped");
	waitpid(child, NULL, 0);
	check_sample(path, "piped");
	assert_null(file_container_open(pipe_path, NULL, &e));
	assert_non_null(strstr(e.text, "not a regular file"));
	unlink(pipe_path);
}

/* ---- reading what is damaged ---- */

/* Opens, verifies and uses the file as a reader would: 0 if all was accepted. */
static int read_through(const char *where, struct err *e)
{
	struct container *c = file_container_open(where, "twopass.mesh", e);
	int failed = !c || file_container_verify_all(c, e);

	file_container_close(c);
	return failed;
}

static void check_refusal(const struct err *e, const char *where)
{
	assert_int_equal(e->set, 1);
	assert_int_equal(strncmp(e->text, where, strlen(where)), 0);
	assert_null(strchr(e->text, '\n'));
	assert_non_null(strchr(e->text, ';'));
}

static void test_flipped_bytes(void **state)
{
	static const unsigned char flips[] = { 0x01, 0x20, 0xff };
	struct stat st;

	(void)state;
	write_sample(path, "one");
	int fd = open(path, O_RDWR);
	assert_int_equal(fstat(fd, &st), 0);
	for (off_t i = 0; i < st.st_size; i++)
		for (size_t k = 0; k < sizeof flips; k++) {
			given("i %ld, k %zu", (long)i, k);
			unsigned char good, bad;
			struct err e = { 0 };
			assert_int_equal(pread(fd, &good, 1, i), 1);
			bad = good ^ flips[k];
			assert_int_equal(pwrite(fd, &bad, 1, i), 1);
			if (!read_through(path, &e))
				fail_msg("byte %ld: a flip by %d was accepted", (long)i, flips[k]);
			check_refusal(&e, path);
			assert_int_equal(pwrite(fd, &good, 1, i), 1);
		}
	close(fd);
	check_sample(path, "one");
}

static void test_truncated(void **state)
{
	struct stat st;

	(void)state;
	write_sample(path, "one");
	assert_int_equal(stat(path, &st), 0);
	for (off_t n = st.st_size; n-- > 0;) {
		given("n %ld", (long)n);
		struct err e = { 0 };
		assert_int_equal(truncate(path, n), 0);
		if (!read_through(path, &e))
			fail_msg("%ld bytes were accepted", (long)n);
		check_refusal(&e, path);
	}
}

/* Writes a file with this header (its digest put right) and 64 bytes of data. */
static void forge(const char *header, uint64_t claimed)
{
	char text[4096], hex[33];
	size_t n = (strlen(header) + 7) / 8 * 8;
	FILE *f = fopen(path, "wb");

	memset(text, ' ', sizeof text);
	memcpy(text, header, strlen(header));
	char *slot = file_container_header_slot(text, n);
	if (slot) {
		file_container_header_digest(text, n, slot, hex);
		memcpy(slot, hex, 32);
	}
	uint64_t prefix = claimed ? claimed : n;
	fwrite(&prefix, 8, 1, f);
	fwrite(text, 1, n, f);
	fwrite(doubles, 8, 6, f);
	fwrite(doubles, 8, 2, f);
	fclose(f);
}

#define META "{\"__metadata__\":{\"format\":\"twopass.mesh\",\"digest.header\":" \
             "\"00000000000000000000000000000000\"}"
#define ARRAY(name, type, shape, from, to) \
	",\"" name "\":{\"dtype\":\"" type "\",\"shape\":" shape \
	",\"data_offsets\":[" from "," to "]}"

static void test_forged_headers(void **state)
{
	static const struct {
		const char *header, *message;
	} cases[] = {
		{ META ARRAY("a", "F64", "[8]", "0", "64") "}", NULL },
		{ META ARRAY("b", "F64", "[4]", "32", "64") ARRAY("a", "F64", "[4]", "0", "32")
		  "}", NULL },
		{ META ARRAY("a", "F64", "[9]", "0", "72") "}", "array a: truncated" },
		{ META ARRAY("a", "F64", "[7]", "0", "64") "}", "its shape needs 56" },
		{ META ARRAY("a", "F64", "[7]", "0", "56") "}", "8 bytes follow the last array" },
		{ META ARRAY("a", "F64", "[4]", "0", "32") ARRAY("b", "F64", "[5]", "24", "64")
		  "}", "array b: overlaps" },
		{ META ARRAY("a", "F64", "[4]", "0", "32") ARRAY("b", "F64", "[3]", "40", "64")
		  "}", "array b: there is a gap" },
		{ META ARRAY("a", "F64", "[8]", "0", "64") ARRAY("a", "F64", "[8]", "0", "64")
		  "}", "header: not a JSON object" },
		{ META ARRAY("a", "U8", "[4]", "0", "4") ARRAY("b", "F32", "[15]", "4", "64")
		  "}", NULL },
		{ META ARRAY("a", "U8", "[2]", "0", "2") ARRAY("b", "U16", "[31]", "2", "64")
		  "}", NULL },
		{ META ARRAY("a", "U8", "[4]", "0", "4") ARRAY("b", "F64", "[7]", "4", "60")
		  ARRAY("c", "U8", "[4]", "60", "64") "}", "array b: not aligned" },
		{ META ARRAY("a", "F16", "[32]", "0", "64") "}", "array a: unknown dtype" },
		{ META ARRAY("a", "F64", "[-8]", "0", "64") "}", "array a: impossible shape" },
		{ META ARRAY("a", "F64", "[8.0]", "0", "64") "}", "array a: impossible shape" },
		{ META ARRAY("a", "F64", "[1,1,1,1,8]", "0", "64") "}", "impossible shape" },
		{ META ARRAY("a", "F64", "[4294967296,4294967296]", "0", "64") "}",
		  "array a: impossible shape" },
		{ META ARRAY("a", "F64", "[2305843009213693952]", "0", "64") "}",
		  "array a: impossible shape" },
		{ META ARRAY("a", "F64", "8", "0", "64") "}", "array a: impossible shape" },
		{ META ARRAY("a", "F64", "[8]", "64", "0") "}", "array a: impossible data_off" },
		{ META ARRAY("a", "F64", "[8]", "-64", "0") "}", "array a: impossible data_off" },
		{ META ARRAY("a", "F64", "[8]", "0", "9223372036854775807") "}",
		  "array a: 9223372036854775807 bytes" },
		{ META ARRAY("a", "F64", "[8]", "0", "64000000000000000000") "}",
		  "header: not a JSON object" },
		{ META ",\"a\":7}", "array a: unknown dtype" },
		{ META ARRAY("a\\nb", "F64", "[9]", "0", "64") "}", "array a?b: " },
		{ "[1,2]", "header: not a JSON object" },
		{ "{\"a\":{}}", "header: no __metadata__" },
		{ "{\"__metadata__\":7}", "header: no __metadata__" },
		{ "{\"__metadata__\":{\"format\":\"pt\"}}", "of another program" },
		{ "{\"__metadata__\":{\"format\":\"twopass.mesh\",\"n\":7}}",
		  "metadata n is not a string" },
		{ "{\"__metadata__\":{\"format\":\"twopass.mesh\"}}", "it has no digest" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		given("i %zu", i);
		struct err e = { 0 };
		forge(cases[i].header, 0);
		struct container *c = file_container_open(path, "twopass.mesh", &e);
		if (!cases[i].message) {
			if (!c)
				fail_msg("case %zu: %s", i, e.text);
		} else {
			if (c || !strstr(e.text, cases[i].message))
				fail_msg("case %zu: '%s' instead of '%s'", i, e.text,
				         cases[i].message);
			check_refusal(&e, path);
		}
		file_container_close(c);
	}
}

static void test_absurd_lengths(void **state)
{
	static const uint64_t lengths[] = { 1, 7, 12, UINT64_MAX, UINT64_MAX - 7,
		(uint64_t)1 << 63, 100000008, 8192 };

	(void)state;
	for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
		given("i %zu", i);
		struct err e = { 0 };
		forge(META ARRAY("a", "F64", "[8]", "0", "64") "}", lengths[i]);
		assert_null(file_container_open(path, NULL, &e));
		check_refusal(&e, path);
	}
}

static void test_deep_json(void **state)
{
	enum { DEPTH = 100000 };
	uint64_t n = DEPTH;
	struct err e = { 0 };
	char *deep = malloc(DEPTH);
	FILE *f = fopen(path, "wb");

	(void)state;
	memset(deep, '[', DEPTH);
	fwrite(&n, 8, 1, f);
	fwrite(deep, 1, DEPTH, f);
	fclose(f);
	free(deep);
	assert_null(file_container_open(path, NULL, &e));
	check_refusal(&e, path);
}

static void test_missing(void **state)
{
	struct err e = { 0 };

	(void)state;
	assert_null(file_container_open("/nowhere/a.mesh", NULL, &e));
	assert_non_null(strstr(e.text, "/nowhere/a.mesh: cannot read: No such file"));
	e.set = 0;
	assert_null(file_container_open("/dev/null", NULL, &e));
	assert_non_null(strstr(e.text, "not a regular file"));
}

/* ---- digests, keys, history ---- */

static void digest_of(const char *key, const char *value, char hex[33])
{
	struct err e = { 0 };
	const uint64_t n = 6;
	struct container_writer *w = file_container_create(path, &e);

	file_container_meta(w, "format", "twopass.mesh", &e);
	file_container_meta(w, "history", "mesh a.gltf", &e);
	file_container_meta(w, key, value, &e);
	file_container_put(w, "vertex", DT_F64, 1, &n, doubles, &e);
	if (strcmp(key, "camera_id") == 0)
		file_container_put(w, "camera_yfov", DT_F64, 1, &n,
		                   value[0] == '1' ? doubles : (double[6]){ 0 }, &e);
	assert_int_equal(file_container_finish(w, &e), 0);
	struct container *c = file_container_open(path, NULL, &e);
	file_container_digest(c, hex);
	file_container_close(c);
}

static void test_digest_is_loose_about_cameras(void **state)
{
	char a[33], b[33];

	(void)state;
	digest_of("camera_id", "1", a);
	digest_of("camera_id", "2", b);
	assert_string_equal(a, b);
	digest_of("key", "1", a);
	digest_of("key", "2", b);
	assert_string_equal(a, b);
	digest_of("material_id", "1", a);
	digest_of("material_id", "2", b);
	assert_string_not_equal(a, b);
}

#define MADE_OF "0123456789abcdef0123456789abcdef:"
#define KEY MADE_OF "00000000000000000000000000000001"

static void test_up_to_date(void **state)
{
	static const char format[] = "twopass.mesh";
	static const char other_code[] = MADE_OF "00000000000000000000000000000002";
	static const char other[] = "1" KEY;
	struct timespec old[2] = { { .tv_sec = 1000 }, { .tv_sec = 1000 } };
	struct stat st;

	(void)state;
	write_sample(path, KEY);
	utimensat(AT_FDCWD, path, old, 0);
	assert_int_equal(file_cache_up_to_date(path, format, other, 0), KEY_DIFFERS);
	assert_int_equal(file_cache_up_to_date(path, format, other, 1), KEY_DIFFERS);
	assert_int_equal(file_cache_up_to_date(path, format, "", 1), KEY_DIFFERS);
	assert_int_equal(file_cache_up_to_date(path, format, other_code, 0), KEY_DIFFERS);
	assert_int_equal(file_cache_up_to_date(path, "twopass.ff", KEY, 1), KEY_DIFFERS);
	assert_int_equal(file_cache_up_to_date("/nowhere", format, KEY, 1), KEY_DIFFERS);
	assert_int_equal(stat(path, &st), 0);
	assert_int_equal(st.st_mtime, 1000);
	assert_int_equal(file_cache_up_to_date(path, format, other_code, 1), KEY_OTHER_VERSION);
	assert_int_equal(stat(path, &st), 0);
	assert_true(st.st_mtime > 1000);
	utimensat(AT_FDCWD, path, old, 0);
	assert_int_equal(file_cache_up_to_date(path, format, KEY, 0), KEY_FITS);
	assert_int_equal(file_cache_up_to_date(path, format, KEY, 1), KEY_FITS);
	assert_int_equal(stat(path, &st), 0);
	assert_that(st.st_mtime, >, 1000);
	assert_int_equal(truncate(path, st.st_size - 1), 0);
	assert_int_equal(file_cache_up_to_date(path, format, KEY, 0), KEY_DIFFERS);
}

static void test_history(void **state)
{
	static const struct history_option aside[] = {
		{ 'q', "quiet", 0 }, { 'v', "verbose", 0 }, { 'j', "threads", 1 }, { 'o', "output", 1 },
		{ 0, "any-version", 0 }, { 0, NULL, 0 }
	};
	static const struct {
		const char *before;
		char *argv[12];
		const char *after;
	} cases[] = {
		{ NULL, { "/usr/bin/mesh", "dir/room.gltf", "-o", "x.mesh" }, "mesh room.gltf" },
		{ "mesh room.gltf", { "ffcalc", "-j4", "-q", "room.mesh", "-n", "64", "-oa" },
		  "mesh room.gltf\nffcalc room.mesh -n 64" },
		{ "a\n", { "ffcalc", "--part", "1/4", "--threads=3", "--output", "f", "--verbose",
		  "r.mesh" }, "a\nffcalc --part 1/4 r.mesh" },
		{ "", { "trace", "--log=/tmp/a b", "it's", "", "-qvn", "3", "--thr", "2", "-" },
		  "trace --log='a b' 'it'\\''s' '' -n 3 -" },
		{ NULL, { "trace", "--any", "--o", "f", "-c", "o", "-qof", "-x", "--output=f" }, "trace -c o -x" },
		{ NULL, { "shoot", "x/y\n/", "\xff", "--", "-q" }, "shoot $'y\\012' $'\\377' -- -q" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		given("i %zu", i);
		struct err e = { 0 };
		int argc = 0;
		while (cases[i].argv[argc])
			argc++;
		char *h = file_history_append(cases[i].before, argc, cases[i].argv, aside, &e);
		assert_string_equal(h, cases[i].after);
		free(h);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_round_trip),
		cmocka_unit_test(test_need_says_what_is_wrong),
		cmocka_unit_test(test_spooled_arrays),
		cmocka_unit_test(test_wrong_amount),
		cmocka_unit_test(test_abandoned),
		cmocka_unit_test(test_bad_declarations),
		cmocka_unit_test(test_full_device),
		cmocka_unit_test(test_full_disk_keeps_old),
		cmocka_unit_test(test_no_directory),
		cmocka_unit_test(test_killed),
		cmocka_unit_test(test_pipe),
		cmocka_unit_test(test_flipped_bytes),
		cmocka_unit_test(test_truncated),
		cmocka_unit_test(test_forged_headers),
		cmocka_unit_test(test_absurd_lengths),
		cmocka_unit_test(test_deep_json),
		cmocka_unit_test(test_missing),
		cmocka_unit_test(test_digest_is_loose_about_cameras),
		cmocka_unit_test(test_up_to_date),
		cmocka_unit_test(test_history),
	};

	return cmocka_run_group_tests(tests, set_up, tear_down);
}
