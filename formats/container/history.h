/* The command history that caches and pictures carry. */
#ifndef TWOPASS_HISTORY_H
#define TWOPASS_HISTORY_H

#include "lib/base/err.h"

/* `before` (may be NULL or empty) followed by a line for this command: argv
 * shell-quoted, paths reduced to base names, without -j -q -v -o and their long
 * forms (--threads --quiet --verbose --output) and without an option's value
 * where it is one of these. To be freed; NULL and e when out of memory. */
char *file_history_append(const char *before, int argc, char *const argv[], struct err *e);

#endif
