#include "tools/common/cli.h"

#include <ctype.h>
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "formats/container/atomic_file.h"
#include "lib/base/mem.h"

/* Letters of the common options that have no short form: beyond any table's. */
enum { LETTER_HELP = 100000, LETTER_VERSION };
enum { OPTIONS_MAX = 128 };

static volatile sig_atomic_t bar_on_screen;

static const struct cli_option common_options[] = {
	{ 'q', "quiet", NULL, "print errors and warnings only" },
	{ 'v', "verbose", NULL, "print more about what is done" },
	{ LETTER_HELP, "help", NULL, "print this help and exit" },
	{ LETTER_VERSION, "version", NULL, "print the version and exit" },
	{ 0, NULL, NULL, NULL }
};

static const struct cli_option threads_option[] = {
	{ 'j', "threads", "N", "threads to use (default: one for each processor)" },
	{ 0, NULL, NULL, NULL }
};

/* ---- messages ---- */

static void say(const struct cli *c, const char *format, va_list ap)
{
	char text[2048];

	/* One line whatever a file name holds. */
	vsnprintf(text, sizeof text, format, ap);
	for (char *s = text; *s; s++)
		if (iscntrl((unsigned char)*s))
			*s = '?';
	fprintf(stderr, "%s%s: %s\n", bar_on_screen ? "\r\033[K" : "", c->program, text);
	bar_on_screen = 0;
}

void cli_usage(const struct cli *c, const char *format, ...)
{
	va_list ap;

	va_start(ap, format);
	say(c, format, ap);
	va_end(ap);
	fprintf(stderr, "Try '%s --help' for more information.\n", c->program);
	exit(2);
}

void cli_keep_input(const struct cli *c, const char *output, const char *input)
{
	struct stat to, from;

	if (output && !stat(output, &to) && !stat(input, &from) && S_ISREG(from.st_mode) &&
	    to.st_dev == from.st_dev && to.st_ino == from.st_ino)
		cli_usage(c, "--output: %s is what is to be read", output);
}

void cli_warn(const struct cli *c, const char *format, ...)
{
	va_list ap;

	va_start(ap, format);
	say(c, format, ap);
	va_end(ap);
}

void cli_note(const struct cli *c, const char *format, ...)
{
	va_list ap;

	if (c->quiet)
		return;
	va_start(ap, format);
	say(c, format, ap);
	va_end(ap);
}

void cli_detail(const struct cli *c, const char *format, ...)
{
	va_list ap;

	if (c->quiet || !c->verbose)
		return;
	va_start(ap, format);
	say(c, format, ap);
	va_end(ap);
}

int cli_fail(const struct cli *c, const struct err *e)
{
	cli_warn(c, "%s", e->set ? e->text : "failed");
	return 1;
}

int cli_finish(const struct cli *c, int status)
{
	int failed = ferror(stdout);

	errno = 0;
	failed |= fflush(stdout) != 0;
	/* A stdout that was closed from the start is no error if nothing went there. */
	failed |= fclose(stdout) != 0 && errno != EBADF;
	if (!failed)
		return status;
	cli_warn(c, "standard output: %s", errno ? strerror(errno) : "write error");
	return status ? status : 1;
}

/* ---- the option table ---- */

static int label(const struct cli_option *o, char *text, size_t size)
{
	char letter[8] = "    ";

	if (o->letter < 256)
		snprintf(letter, sizeof letter, "-%c, ", o->letter);
	return snprintf(text, size, "  %s--%s%s%s", letter, o->name, o->argument ? " " : "",
	                o->argument ? o->argument : "");
}

static int widest(const struct cli_option *o)
{
	char text[256];
	int width = 0;

	for (; o->letter; o++) {
		int n = label(o, text, sizeof text);
		width = n > width ? n : width;
	}
	return width;
}

static void print_options(const struct cli_option *o, int width)
{
	char text[256];

	for (; o->letter; o++) {
		label(o, text, sizeof text);
		printf("%-*s  %s\n", width, text, o->help);
	}
}

static void print_help(const struct cli *c)
{
	int width = widest(c->options), common = widest(common_options);

	width = common > width ? common : width;
	printf("Usage: %s %s\n%s\n\n", c->program, c->synopsis, c->about);
	print_options(c->options, width);
	if (c->uses_threads)
		print_options(threads_option, width);
	print_options(common_options, width);
}

/* What getopt_long wants, made from the tables. */
struct getopt_tables {
	char letters[3 + 2 * OPTIONS_MAX];
	struct option longs[OPTIONS_MAX + 1];
	int n;
};

static void add_options(struct getopt_tables *t, const struct cli_option *o)
{
	char *s = t->letters + strlen(t->letters);

	for (; o->letter && t->n < OPTIONS_MAX; o++) {
		t->longs[t->n++] = (struct option){
			.name = o->name, .val = o->letter,
			.has_arg = o->argument ? required_argument : no_argument };
		if (o->letter >= 256)
			continue;
		*s++ = (char)o->letter;
		if (o->argument)
			*s++ = ':';
	}
	*s = 0;
}

static const struct option *find_letter(const struct getopt_tables *t, int letter)
{
	for (int i = 0; i < t->n; i++)
		if (t->longs[i].val == letter)
			return &t->longs[i];
	return NULL;
}

static void __attribute__((noreturn)) wrong_option(const struct cli *c,
                                                   const struct getopt_tables *t, int code,
                                                   char **argv)
{
	const struct option *known = find_letter(t, optopt);

	if (code == ':' && known)
		cli_usage(c, "option --%s needs an argument", known->name);
	if (known)
		cli_usage(c, "option --%s takes no argument", known->name);
	if (optopt)
		cli_usage(c, "unknown option -%c", optopt);
	cli_usage(c, "unknown or ambiguous option %s", argv[optind - 1]);
}

int cli_next(struct cli *c, int argc, char **argv)
{
	struct getopt_tables t = { .letters = ":" };

	add_options(&t, c->options);
	if (c->uses_threads)
		add_options(&t, threads_option);
	add_options(&t, common_options);
	if (c->threads == 0)
		c->threads = par_cpus();
	opterr = 0;
	for (;;) {
		int letter = getopt_long(argc, argv, t.letters, t.longs, NULL);

		if (letter == 'q') {
			c->quiet = 1;
		} else if (letter == 'v') {
			c->verbose = 1;
		} else if (letter == 'j' && c->uses_threads) {
			c->threads = (int)cli_integer(c, "--threads", optarg, 1, 256);
		} else if (letter == LETTER_HELP) {
			print_help(c);
			exit(cli_finish(c, 0));
		} else if (letter == LETTER_VERSION) {
			printf("%s (twopass) %s\n", c->program, TWOPASS_VERSION);
			exit(cli_finish(c, 0));
		} else if (letter == '?' || letter == ':') {
			wrong_option(c, &t, letter, argv);
		} else {
			return letter;
		}
	}
}

/* ---- numbers ---- */

static void __attribute__((noreturn)) out_of_range(const struct cli *c, const char *option,
                                                   const char *text, double min, double max)
{
	if (min > -INFINITY && max < INFINITY)
		cli_usage(c, "%s: %s is not in the range from %g to %g", option, text, min, max);
	if (min > -INFINITY)
		cli_usage(c, "%s: %s is not a number of at least %g", option, text, min);
	cli_usage(c, "%s: %s is not a number of at most %g", option, text, max);
}

double cli_number(const struct cli *c, const char *option, const char *text, double min,
                  double max)
{
	char *end;
	double v;

	errno = 0;
	v = strtod(text, &end);
	if (end == text || *end || isspace((unsigned char)*text) || isnan(v))
		cli_usage(c, "%s: '%s' is not a number", option, text);
	/* 1e999 is a typing error, not infinity. */
	if ((errno == ERANGE && isinf(v)) || v < min || v > max)
		out_of_range(c, option, text, min, max);
	return v;
}

long cli_integer(const struct cli *c, const char *option, const char *text, long min,
                 long max)
{
	char *end;
	long v;

	errno = 0;
	v = strtol(text, &end, 10);
	if (end == text || *end || isspace((unsigned char)*text))
		cli_usage(c, "%s: '%s' is not a whole number", option, text);
	if (errno == ERANGE || v < min || v > max)
		cli_usage(c, "%s: %s is not in the range from %ld to %ld", option, text, min, max);
	return v;
}

/* ---- progress ---- */

static void time_left(double s, char *text, size_t size)
{
	if (s < 60)
		snprintf(text, size, "%.0f s", s);
	else if (s < 3600)
		snprintf(text, size, "%d:%02d min", (int)s / 60, (int)s % 60);
	else if (s < 1e6)
		snprintf(text, size, "%d:%02d h", (int)s / 3600, (int)s / 60 % 60);
	else
		snprintf(text, size, "days");
}

static void rate_text(double rate, char *text, size_t size)
{
	const char *unit = "";
	double scale = 1;

	if (rate >= 1e6) {
		unit = " M";
		scale = 1e-6;
	} else if (rate >= 1e4) {
		unit = " k";
		scale = 1e-3;
	}
	snprintf(text, size, "%.3g%s/s", rate * scale, unit);
}

static void draw_bar(struct cli_progress *p, double part, const char *rate, const char *left)
{
	enum { WIDTH = 24 };
	char bar[WIDTH + 1];

	for (int i = 0; i < WIDTH; i++)
		bar[i] = i < (int)(part * WIDTH) ? '#' : '.';
	bar[WIDTH] = 0;
	fprintf(stderr, "\r%s: %.20s [%s] %3.0f %%  %s  %s left\033[K", p->cli->program, p->what,
	        bar, 100 * part, rate, left);
	bar_on_screen = 1;
	p->drawn = 1;
}

static void show_progress(void *arg, double done, double total)
{
	struct cli_progress *p = arg;
	double now = cli_seconds(), spent = now - p->begun;
	double interval = p->drawn >= 0 ? .1 : 10;
	char rate[32], left[32];

	/* drawn < 0: no terminal. */
	if (!(done > 0 && total > 0) || spent < 1 || now - p->printed < interval)
		return;
	p->printed = now;
	rate_text(done / spent, rate, sizeof rate);
	time_left(spent * (total > done ? total - done : 0) / done, left, sizeof left);
	if (p->drawn >= 0)
		draw_bar(p, fmin(1, done / total), rate, left);
	else
		cli_detail(p->cli, "%s: %.0f %%, %s, %s left", p->what, 100 * fmin(1, done / total),
		           rate, left);
}

struct progress cli_progress_begin(struct cli_progress *p, const struct cli *c,
                                   const char *what)
{
	const char *term = getenv("TERM");
	int terminal = isatty(STDERR_FILENO) && term && strcmp(term, "dumb") != 0;

	*p = (struct cli_progress){ .cli = c, .what = what, .begun = cli_seconds(),
	                            .drawn = terminal ? 0 : -1 };
	p->printed = p->begun;
	if (c->quiet || (!terminal && !c->verbose))
		return (struct progress){ NULL, NULL };
	return (struct progress){ show_progress, p };
}

void cli_progress_end(struct cli_progress *p)
{
	if (p->drawn > 0 && bar_on_screen)
		fputs("\r\033[K", stderr);
	bar_on_screen = 0;
	p->drawn = 0;
}

double cli_seconds(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double cli_peak_megabytes(void)
{
	FILE *f = fopen("/proc/self/status", "r");
	struct rusage usage;
	char line[256];
	long kib = 0;

	/* getrusage counts what the parent held before exec, so it comes second. */
	while (f && !kib && fgets(line, sizeof line, f))
		if (sscanf(line, "VmHWM: %ld", &kib) != 1)
			kib = 0;
	if (f)
		fclose(f);
	if (!kib && getrusage(RUSAGE_SELF, &usage) == 0)
		kib = usage.ru_maxrss;
	return (double)kib * 1024e-6;
}

/* ---- signals ---- */

static void tidy_and_die(int signal_number)
{
	file_atomic_remove_temporaries();
	if (bar_on_screen && write(STDERR_FILENO, "\n", 1) < 0)
		bar_on_screen = 0;
	/* SA_RESETHAND restored the default action, which follows on return. */
	raise(signal_number);
}

void cli_signals(void)
{
	static const int numbers[] = { SIGINT, SIGTERM, SIGHUP, SIGPIPE };
	struct sigaction old, tidy = { .sa_flags = (int)SA_RESETHAND };

	tidy.sa_handler = tidy_and_die;
	sigfillset(&tidy.sa_mask);
	for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
		if (sigaction(numbers[i], NULL, &old) == 0 && old.sa_handler != SIG_IGN)
			sigaction(numbers[i], &tidy, NULL);
	mem_keep();
	/* A file-size limit then shows as a write error, with its message. */
	signal(SIGXFSZ, SIG_IGN);
}
