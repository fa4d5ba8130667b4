/* Command lines: options from one table, messages, progress. */
#ifndef TWOPASS_CLI_H
#define TWOPASS_CLI_H

#include "lib/base/err.h"
#include "lib/base/parallel.h"

/* An option; the last entry has letter 0. Options without a short form use
 * letters >= 256. --help prints the table; --help, --version, -q, -v and (where
 * `threads` is set) -j are handled by cli_next. */
struct cli_option {
	int letter;
	const char *name;      /* long name */
	const char *argument;  /* its name in --help, or NULL */
	const char *help;      /* one line */
};

struct cli {
	const char *program;
	const char *synopsis;  /* after the program's name */
	const char *about;     /* one sentence */
	const struct cli_option *options;
	int uses_threads;
	/* results */
	int quiet, verbose, threads;
};

/* The next option's letter (argument in optarg), or -1 at the end (operands from
 * optind). Prints help or version and exits 0; wrong usage exits 2. */
int cli_next(struct cli *c, int argc, char **argv);

/* Wrong usage: "prog: <text>" and a pointer to --help on stderr, exit 2. */
void cli_usage(const struct cli *c, const char *format, ...)
    __attribute__((noreturn, format(printf, 2, 3)));

/* Wrong usage if `output` (may be NULL) is the regular file `input`, which would be lost. */
void cli_keep_input(const struct cli *c, const char *output, const char *input);

/* "prog: <text>" on stderr; cli_note not with -q, cli_detail only with -v. */
void cli_warn(const struct cli *c, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
void cli_note(const struct cli *c, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
void cli_detail(const struct cli *c, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* Prints e and returns 1, the exit status. */
int cli_fail(const struct cli *c, const struct err *e);

/* Flushes and closes stdout; `status`, or 1 with a message if that failed. */
int cli_finish(const struct cli *c, int status);

/* Numbers: exits 2 with the option's name when text is not a number in range. */
double cli_number(const struct cli *c, const char *option, const char *text, double min,
                  double max);
long cli_integer(const struct cli *c, const char *option, const char *text, long min,
                 long max);

/* Progress of one stage: a bar with rate and time left on a terminal (after one
 * second), a line every 10 s with -v otherwise, nothing with -q. */
struct cli_progress {
	const struct cli *cli;
	const char *what;
	double begun, printed;
	int drawn;
};
struct progress cli_progress_begin(struct cli_progress *p, const struct cli *c,
                                   const char *what);
void cli_progress_end(struct cli_progress *p);

double cli_seconds(void);          /* monotonic clock */
double cli_peak_megabytes(void);   /* of this process */

/* Removes half-written temporary files on SIGINT, SIGTERM and SIGHUP. */
void cli_signals(void);

#endif
