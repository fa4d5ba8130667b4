/* The command history that caches and pictures carry. */
#ifndef TWOPASS_HISTORY_H
#define TWOPASS_HISTORY_H

#include "lib/base/err.h"

/* An option that is left out. */
struct history_option {
	int letter;        /* or 0 */
	const char *name;  /* long name; NULL ends a list */
	int argument;      /* 1 if it takes one, which is left out, too */
};

/* `before` (may be NULL or empty) followed by a line for this command: argv, which
 * getopt_long has accepted, shell-quoted, paths reduced to base names, without the options
 * aside. To be freed; NULL and e when out of memory. */
char *file_history_append(const char *before, int argc, char *const argv[],
                          const struct history_option *aside, struct err *e);

#endif
