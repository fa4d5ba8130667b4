/* Command lines, each run in a process of its own. */
#include <fcntl.h>
#include <getopt.h>
#include <sys/wait.h>

/* The front end of the programs is not in the library. */
#include "tools/common/cli.c"
#include "tests/unit/fixtures/check.h"
#include "tools/common/options.c"

struct demo {
	const char *output, *name;
	int number, extra, method, pixels[2];
	uint64_t big;
	unsigned layers;
	double share, at[3];
	uint32_t part[2];
	struct mesh_size size;
	struct option_list camera;
	char *mix;
};

#undef REQUEST
#define REQUEST struct demo

static const char *const methods[] = { "rays", "auto", NULL };
static const char *const layers[] = { "Z", "N", "patch", "all", NULL };
static const char *const none[] = { "none", NULL };

static const struct option_spec table[] = {
	{ 'o', "output", "FILE", "write FILE", TEXT(output), .role = OPTION_ASIDE },
	{ 'n', "number", "N", "how many (default %s)", INTEGER(number, 1, 10) },
	{ 0, "share", "X", "the share (default %s)", NUMBER(share, 0, INFINITY), .words = none },
	{ 'x', "extra", NULL, "more of it, %s", FLAG(extra) },
	{ 0, "big", "N", "seed", INTEGER(big, 0, INT64_MAX) },
	{ 0, "method", "HOW", "rays or %s (default)", WORD(method, methods) },
	{ 0, "layers", "LIST", "Z, N, patch", SET(layers, layers) },
	{ 0, "part", "K/N", "shard", RATIO(part) },
	{ 0, "pixels", "WxH", "size", RESOLUTION(pixels) },
	{ 0, "at", "X,Y,Z", "place", VECTOR(at) },
	{ 0, "size", "SIZE", "length (default %s)", LENGTH(size) },
	{ 0, "camera", "NAME", "view", LIST(camera), .role = OPTION_RECORDED },
	{ 0, "mix", "LIST", "groups", JOINED(mix) },
	{ 0 }
};

/* Its method is auto. */
static const struct demo usual = { .number = 4, .share = .25, .method = 1, .size = { .05, 1 } };

static struct cli demo(void)
{
	return (struct cli){ .program = "demo", .synopsis = "[OPTION]... IN -o OUT",
		             .about = "Shows.", .options = table, .uses_threads = 1 };
}

/* What a child printed and how it ended. */
static struct {
	char out[8192], err[8192];
	int status;
} child;

static void read_back(int fd, char *text)
{
	ssize_t n = pread(fd, text, sizeof child.out - 1, 0);

	text[n > 0 ? n : 0] = 0;
	close(fd);
}

static int scratch(void)
{
	char name[] = "/tmp/twopass-cli-XXXXXX";
	int fd = mkstemp(name);

	unlink(name);
	return fd;
}

/* Runs fn with stdout (or `to`, if not NULL) and stderr kept in `child`. */
static void run(int (*fn)(int argc, char **argv), const char *to, char **argv)
{
	int out = to ? open(to, O_WRONLY) : scratch(), err = scratch(), argc = 0;
	pid_t pid;

	while (argv[argc])
		argc++;
	fflush(NULL);
	pid = fork();
	if (pid == 0) {
		dup2(out, STDOUT_FILENO);
		dup2(err, STDERR_FILENO);
		optind = 0;
		/* No atexit: cmocka's and the leak checker's state is the parent's. */
		int status = fn(argc, argv);
		_exit(status);
	}
	assert_that(pid, >, 0);
	waitpid(pid, &child.status, 0);
	read_back(to ? dup(err) : out, child.out);
	read_back(err, child.err);
	if (to)
		close(out);
}

static int parse(int argc, char **argv)
{
	struct cli c = demo();
	struct demo d = usual;
	int operand = options_parse(&c, argc, argv, &d);

	printf("n=%d share=%g out=%s x=%d%d operands=%d q=%d v=%d j=%d", d.number, d.share,
	       d.output ? d.output : "-", d.extra, options_given(&c, "extra"), argc - operand, c.quiet,
	       c.verbose, c.threads);
	return cli_finish(&c, 0);
}

static int parse_others(int argc, char **argv)
{
	struct cli c = demo();
	struct demo d = usual;

	options_parse(&c, argc, argv, &d);
	printf("%s%d %llu %u %u/%u %dx%d %g,%g,%g %g%s", methods[d.method], options_given(&c, "method"),
	       (unsigned long long)d.big, d.layers, d.part[0], d.part[1], d.pixels[0], d.pixels[1],
	       d.at[0], d.at[1], d.at[2], d.size.value, d.size.relative ? "r" : "");
	for (size_t i = 0; i < d.camera.n; i++)
		printf(" %s", d.camera.item[i]);
	printf(" %s", d.mix ? d.mix : "");
	free(d.camera.item);
	free(d.mix);
	return cli_finish(&c, 0);
}

/* The digest, then the history. */
static int tell(int argc, char **argv)
{
	struct cli c = demo();
	struct demo d = usual;
	struct err e = { 0 };
	struct digest *digest = file_digest_new();
	char hex[33];

	options_parse(&c, argc, argv, &d);
	options_digest(&c, &d, digest);
	file_digest_end(digest, hex);
	char *history = options_history(&c, NULL, &e);
	printf("%s %s", hex, history);
	free(history);
	free(d.camera.item);
	free(d.mix);
	return cli_finish(&c, 0);
}

static void accepts_by(int (*fn)(int argc, char **argv), const char *expected, char **argv)
{
	run(fn, NULL, argv);
	assert_true(WIFEXITED(child.status));
	assert_int_equal(WEXITSTATUS(child.status), 0);
	assert_string_equal(child.out, expected);
	assert_string_equal(child.err, "");
}

static void accepts(const char *expected, char **argv)
{
	accepts_by(parse, expected, argv);
}

static void refuses(const char *expected, char **argv)
{
	char all[512];

	run(parse, NULL, argv);
	assert_true(WIFEXITED(child.status));
	assert_int_equal(WEXITSTATUS(child.status), 2);
	snprintf(all, sizeof all, "demo: %s\nTry 'demo --help' for more information.\n",
	         expected);
	assert_string_equal(child.err, all);
}

#define ARGS(...) ((char *[]){ "demo", __VA_ARGS__, NULL })

static void test_options(void **state)
{
	(void)state;
	accepts("n=7 share=inf out=a x=11 operands=1 q=0 v=0 j=3",
	        ARGS("-oa", "in", "--number=7", "--share", "inf", "-xj3"));
	accepts("n=4 share=0.25 out=- x=00 operands=1 q=1 v=1 j=1", ARGS("-qv", "--threads", "1", "--", "-x"));
	accepts("n=4 share=0.5 out=- x=00 operands=0 q=0 v=0 j=2", ARGS("--sha", ".5", "-j2"));
	accepts("n=4 share=nan out=- x=00 operands=0 q=0 v=0 j=2", ARGS("--share=none", "-j2"));
}

static void test_types(void **state)
{
	(void)state;
	accepts_by(parse_others, "auto0 0 0 0/0 0x0 0,0,0 0.05r ", ARGS("in"));
	accepts_by(parse_others, "rays1 9223372036854775807 5 2/4 64x48 1,-2,0.5 inf a,b c all x=1,y=2",
	           ARGS("--method", "rays", "--big", "9223372036854775807", "--layers=patch,Z", "--part",
	                "2/4", "--pixels=64x48", "--at=1,-2,.5", "--size=inf", "--camera", "a,b",
	                "--mix=x=1", "--camera=c", "--mix", "y=2", "--camera", "all"));
	accepts_by(parse_others, "auto1 0 7 1/1 65536x1 0,0,0 2 ",
	           ARGS("--method=auto", "--layers", "all", "--part=1/1", "--pixels", "65536x1", "--size", "2"));
}

static void test_wrong_types(void **state)
{
	static char *const pixels[] = { "", "x", "64", "64x", "3x", "x3", "3x0", "0x3", "-3x4", "3x4x5",
		"3 x4", "3x+4", "99999999999x1", "3x4 ", "1e2x3", "65537x1" };
	static char *const sets[] = { "", "z", "Z,", ",Z", "Z,,N", "pat", "patch.R", "Z N" };
	static char *const parts[] = { "", "1", "0/2", "3/2", "1/2/3", "1/1000001", "a/b" };
	static char *const vectors[] = { "", "1,2", "1,2,3,4", "1,2,inf", "1,2,x", "nan,0,0" };
	char text[128];

	(void)state;
	refuses("--method: 'ray' is not one of rays, auto", ARGS("--method", "ray"));
	refuses("--size: '5%' is not a number", ARGS("--size", "5%%"));
	refuses("--size: a size must be greater than 0", ARGS("--size", "0%"));
	refuses("--size: -1 is not a number of at least 0", ARGS("--size", "-1"));
	for (size_t i = 0; i < sizeof pixels / sizeof *pixels; i++) {
		snprintf(text, sizeof text, "--pixels: '%s' is not a size such as 640x480", pixels[i]);
		refuses(text, ARGS("--pixels", pixels[i]));
	}
	for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
		snprintf(text, sizeof text, "--layers: '%s' is not a list of Z, N, patch, all", sets[i]);
		refuses(text, ARGS("--layers", sets[i]));
	}
	for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
		snprintf(text, sizeof text, "--part: '%s' is not K/N with 1 <= K <= N, such as 2/4",
		         parts[i]);
		refuses(text, ARGS("--part", parts[i]));
	}
	for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) {
		snprintf(text, sizeof text, "--at: '%s' is not three numbers X,Y,Z", vectors[i]);
		refuses(text, ARGS("--at", vectors[i]));
	}
}

/* What tell says, the digest's 32 digits apart. */
static const char *told(char digest[33], char **argv)
{
	run(tell, NULL, argv);
	assert_int_equal(WEXITSTATUS(child.status), 0);
	snprintf(digest, 33, "%.32s", child.out);
	return child.out + 33;
}

/* All options but those that say where, how fast and which inputs, are in the key. */
static void test_key_and_history(void **state)
{
	static char *const other[] = { "-n5", "--share=1", "-x", "--big=1", "--method=rays", "--layers=Z",
		"--part=1/2", "--pixels=1x1", "--at=1,2,3", "--size=.05", "--mix=a=1" };
	char plain[33], same[33], digest[33];

	(void)state;
	assert_string_equal(told(plain, ARGS("in")), "demo in");
	assert_string_equal(told(same, ARGS("-q", "-o", "a", "in", "-n4", "--camera=b", "--thr=3", "-vj2", "-ob")),
	                    "demo -n4 --camera=b in");
	assert_string_equal(same, plain);
	for (size_t i = 0; i < sizeof other / sizeof *other; i++) {
		told(digest, ARGS(other[i], "in"));
		assert_string_not_equal(digest, plain);
	}
}

static void test_wrong_usage(void **state)
{
	(void)state;
	refuses("unknown option -z", ARGS("-z"));
	refuses("unknown option -z", ARGS("--extra", "-xz"));
	refuses("unknown or ambiguous option --zoo", ARGS("--zoo"));
	refuses("option --number needs an argument", ARGS("-n"));
	refuses("option --extra takes no argument", ARGS("--extra=3"));
	refuses("--number: 'x' is not a whole number", ARGS("-n", "x"));
	refuses("--number: '7.5' is not a whole number", ARGS("-n", "7.5"));
	refuses("--number: '' is not a whole number", ARGS("-n", ""));
	refuses("--number: 11 is not in the range from 1 to 10", ARGS("-n", "11"));
	refuses("--number: 99999999999999999999 is not in the range from 1 to 10",
	        ARGS("-n", "99999999999999999999"));
	refuses("--share: -1 is not a number of at least 0", ARGS("--share", "-1"));
	refuses("--share: 'nan' is not a number", ARGS("--share", "nan"));
	refuses("--share: '1x' is not a number", ARGS("--share", "1x"));
	refuses("--share: ' 1' is not a number", ARGS("--share", " 1"));
	refuses("--share: 1e999 is not a number of at least 0", ARGS("--share", "1e999"));
	refuses("--threads: 0 is not in the range from 1 to 256", ARGS("-j", "0"));
}

static int bounded(int argc, char **argv)
{
	static const struct option_spec one[] = { { 0, "share", "X", "the share", NUMBER(share, -1, 1) },
		                                  { 0 } };
	struct cli c = { .program = "demo", .options = one };
	struct demo d = { 0 };

	options_parse(&c, argc, argv, &d);
	printf("%g", d.share);
	return cli_finish(&c, 0);
}

static void test_numbers(void **state)
{
	(void)state;
	run(bounded, NULL, ARGS("--share=-1e-320"));
	assert_int_equal(WEXITSTATUS(child.status), 0);
	run(bounded, NULL, ARGS("--share=inf"));
	assert_int_equal(WEXITSTATUS(child.status), 2);
	assert_non_null(strstr(child.err, "--share: inf is not in the range from -1 to 1"));
}

static void test_help(void **state)
{
	(void)state;
	run(parse, NULL, ARGS("--help"));
	assert_int_equal(WEXITSTATUS(child.status), 0);
	assert_string_equal(child.err, "");
	assert_string_equal(child.out,
	    "Usage: demo [OPTION]... IN -o OUT\n"
	    "Shows.\n"
	    "\n"
	    "  -o, --output FILE  write FILE\n"
	    "  -n, --number N     how many (default 4)\n"
	    "      --share X      the share (default .25)\n"
	    "  -x, --extra        more of it, %s\n"
	    "      --big N        seed\n"
	    "      --method HOW   rays or auto (default)\n"
	    "      --layers LIST  Z, N, patch\n"
	    "      --part K/N     shard\n"
	    "      --pixels WxH   size\n"
	    "      --at X,Y,Z     place\n"
	    "      --size SIZE    length (default 5%)\n"
	    "      --camera NAME  view\n"
	    "      --mix LIST     groups\n"
	    "  -j, --threads N    threads to use (default: one for each processor)\n"
	    "  -q, --quiet        print errors and warnings only\n"
	    "  -v, --verbose      print more about what is done\n"
	    "      --help         print this help and exit\n"
	    "      --version      print the version and exit\n");
	run(parse, NULL, ARGS("--version"));
	assert_string_equal(child.out, "demo (twopass) 0.1.0\n");
}

static void test_full_output(void **state)
{
	(void)state;
	run(parse, "/dev/full", ARGS("--help"));
	assert_int_equal(WEXITSTATUS(child.status), 1);
	assert_string_equal(child.err, "demo: standard output: No space left on device\n");
	run(parse, "/dev/full", ARGS("-x"));
	assert_int_equal(WEXITSTATUS(child.status), 1);
}

static int messages(int argc, char **argv)
{
	struct cli c = demo();
	struct demo d = { 0 };
	struct err e = { 0 };

	options_parse(&c, argc, argv, &d);
	cli_warn(&c, "warn %d", 1);
	cli_note(&c, "note");
	cli_detail(&c, "detail");
	err_set(&e, "strange\nfile\033: broken");
	return cli_finish(&c, cli_fail(&c, &e));
}

static void test_messages(void **state)
{
	(void)state;
	run(messages, NULL, ARGS("-v"));
	assert_int_equal(WEXITSTATUS(child.status), 1);
	assert_string_equal(child.err, "demo: warn 1\ndemo: note\ndemo: detail\n"
	                               "demo: strange?file?: broken\n");
	run(messages, NULL, ARGS("-q"));
	assert_string_equal(child.err, "demo: warn 1\ndemo: strange?file?: broken\n");
}

static int progress(int argc, char **argv)
{
	struct cli c = demo();
	struct demo d = { 0 };
	struct cli_progress p;
	struct progress report;

	options_parse(&c, argc, argv, &d);
	report = cli_progress_begin(&p, &c, "rows");
	if (!report.fn)
		return 5;
	report.fn(report.arg, 1, 4); /* too early */
	p.begun -= 20;
	p.printed -= 20;
	report.fn(report.arg, 1, 4);
	report.fn(report.arg, 2, 4); /* too soon */
	p.drawn = 0;                 /* as on a terminal */
	p.printed -= 1;
	report.fn(report.arg, 2, 4);
	cli_note(&c, "note");
	cli_progress_end(&p);
	return 0;
}

static void test_progress(void **state)
{
	(void)state;
	run(progress, NULL, ARGS("-x"));
	assert_int_equal(WEXITSTATUS(child.status), 5);
	run(progress, NULL, ARGS("-qv"));
	assert_int_equal(WEXITSTATUS(child.status), 5);
	run(progress, NULL, ARGS("-v"));
	assert_int_equal(WEXITSTATUS(child.status), 0);
	assert_string_equal(child.err,
	    "demo: rows: 25 %, 0.05/s, 1:00 min left\n"
	    "\rdemo: rows [############............]  50 %  0.1/s  20 s left\033[K"
	    "\r\033[Kdemo: note\n");
}

static char directory[] = "/tmp/twopass-cli-XXXXXX";

static int killed(int argc, char **argv)
{
	struct cli c = demo();
	struct err e = { 0 };
	char path[64];

	(void)argc;
	cli_signals();
	snprintf(path, sizeof path, "%s/out", directory);
	struct atomic_file *f = file_atomic_create(path, &e);
	if (!f || file_atomic_write(f, "x", 1, &e))
		return cli_fail(&c, &e);
	raise(atoi(argv[1]));
	return 0;
}

static void test_signals(void **state)
{
	static const int numbers[] = { SIGINT, SIGTERM, SIGHUP, SIGPIPE };

	(void)state;
	assert_non_null(mkdtemp(directory));
	for (size_t i = 0; i < 4; i++) {
		given("signal %d", numbers[i]);
		char number[16];

		/* Whoever runs the tests may ignore some (nohup, a shell's background). */
		signal(numbers[i], SIG_DFL);
		snprintf(number, sizeof number, "%d", numbers[i]);
		run(killed, NULL, ARGS(number));
		assert_true(WIFSIGNALED(child.status));
		assert_int_equal(WTERMSIG(child.status), numbers[i]);
	}
	/* Fails if a file was left. */
	assert_int_equal(rmdir(directory), 0);
}

static void test_measures(void **state)
{
	double begin = cli_seconds();

	(void)state;
	assert_that(cli_seconds(), >=, begin);
	assert_that(cli_peak_megabytes(), >, .5);
	assert_that(cli_peak_megabytes(), <, 1e5);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_options),     cmocka_unit_test(test_wrong_usage),
		cmocka_unit_test(test_types),       cmocka_unit_test(test_wrong_types),
		cmocka_unit_test(test_key_and_history),
		cmocka_unit_test(test_numbers),     cmocka_unit_test(test_help),
		cmocka_unit_test(test_full_output), cmocka_unit_test(test_messages),
		cmocka_unit_test(test_progress),    cmocka_unit_test(test_signals),
		cmocka_unit_test(test_measures),
	};

	setenv("TERM", "xterm", 1);
	return cmocka_run_group_tests(tests, NULL, NULL);
}
