/* Command lines, each run in a process of its own. */
#include <fcntl.h>
#include <sys/wait.h>

/* The front end of the programs is not in the library. */
#include "tools/common/cli.c"
#include "tests/unit/fixtures/check.h"

enum { OPT_SHARE = 256 };

static const struct cli_option table[] = {
	{ 'o', "output", "FILE", "write FILE" },
	{ 'n', "number", "N", "how many" },
	{ OPT_SHARE, "share", "X", "the share" },
	{ 'x', "extra", NULL, "more of it" },
	{ 0, NULL, NULL, NULL }
};

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
	int letter;

	while ((letter = cli_next(&c, argc, argv)) != -1) {
		if (letter == 'n')
			printf("n=%ld ", cli_integer(&c, "--number", optarg, 1, 10));
		else if (letter == OPT_SHARE)
			printf("share=%g ", cli_number(&c, "--share", optarg, 0, INFINITY));
		else if (letter == 'o')
			printf("out=%s ", optarg);
		else
			printf("%c ", letter);
	}
	printf("operands=%d q=%d v=%d j=%d", argc - optind, c.quiet, c.verbose, c.threads);
	return cli_finish(&c, 0);
}

static void accepts(const char *expected, char **argv)
{
	run(parse, NULL, argv);
	assert_true(WIFEXITED(child.status));
	assert_int_equal(WEXITSTATUS(child.status), 0);
	assert_string_equal(child.out, expected);
	assert_string_equal(child.err, "");
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
	accepts("out=a n=7 share=inf x operands=1 q=0 v=0 j=3",
	        ARGS("-oa", "in", "--number=7", "--share", "inf", "-xj3"));
	accepts("operands=1 q=1 v=1 j=1", ARGS("-qv", "--threads", "1", "--", "-x"));
	accepts("share=0.5 operands=0 q=0 v=0 j=2", ARGS("--sha", ".5", "-j2"));
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
	struct cli c = demo();

	(void)argc;
	printf("%g", cli_number(&c, "--share", argv[1], -1, 1));
	return cli_finish(&c, 0);
}

static void test_numbers(void **state)
{
	(void)state;
	run(bounded, NULL, ARGS("-1e-320"));
	assert_int_equal(WEXITSTATUS(child.status), 0);
	run(bounded, NULL, ARGS("inf"));
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
	    "  -n, --number N     how many\n"
	    "      --share X      the share\n"
	    "  -x, --extra        more of it\n"
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
	struct err e = { 0 };

	while (cli_next(&c, argc, argv) != -1)
		;
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
	struct cli_progress p;
	struct progress report;

	while (cli_next(&c, argc, argv) != -1)
		;
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
		cmocka_unit_test(test_numbers),     cmocka_unit_test(test_help),
		cmocka_unit_test(test_full_output), cmocka_unit_test(test_messages),
		cmocka_unit_test(test_progress),    cmocka_unit_test(test_signals),
		cmocka_unit_test(test_measures),
	};

	setenv("TERM", "xterm", 1);
	return cmocka_run_group_tests(tests, NULL, NULL);
}
