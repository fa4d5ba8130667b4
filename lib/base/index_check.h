/* What arrays of indices must be. Each check returns 0, or -1 and e with
 * "array NAME: what is wrong at which index". */
#ifndef TWOPASS_INDEX_CHECK_H
#define TWOPASS_INDEX_CHECK_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"

/* All n indices are below limit. */
int err_check_below(const char *name, const uint32_t *index, size_t n, size_t limit,
                    struct err *e);

/* start[0] = 0, steps of at least `least`, start[n] = end. */
int err_check_starts(const char *name, const uint64_t *start, size_t n, uint64_t end,
                     uint64_t least, struct err *e);

#endif
