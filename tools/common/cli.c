#include "tools/common/cli.h"

#include <ctype.h>
#include <errno.h>
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

static volatile sig_atomic_t bar_on_screen;

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
	enum { WIDTH = 24 }; /* characters: a line of 80 holds the rest, too */
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
	double interval = p->drawn >= 0 ? .1 : 10; /* seconds: smooth to look at, or a few lines */
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
