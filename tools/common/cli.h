/* What all programs say and how: messages, progress, signals. */
#ifndef TWOPASS_CLI_H
#define TWOPASS_CLI_H

#include <stdint.h>

#include "lib/base/err.h"
#include "lib/base/parallel.h"
#include "tools/common/options.h"

struct cli {
	const char *program;
	const char *synopsis;  /* after the program's name */
	const char *about;     /* one sentence */
	const struct option_spec *options;
	int uses_threads;      /* has -j */
	int keeps_output;      /* has --any-version: leaves alone what is up to date */
	/* what options_parse found */
	int quiet, verbose, help, version, any_version;
	int threads;           /* as -j says, else one for each processor (par_cpus) */
	uint64_t given;        /* bit i: options[i] was there */
	int argc;
	char **argv;
};

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
