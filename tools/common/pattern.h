/* Names of files from a pattern. */
#ifndef TWOPASS_PATTERN_H
#define TWOPASS_PATTERN_H

#include "lib/base/err.h"

/* The pattern with each %s replaced by the name; slashes in it become underscores. To be
 * freed. NULL and e when memory is short. */
char *pattern_fill(const char *pattern, const char *name, struct err *e);

#endif
