/* Closed rows made to add up, by least squares (for lib/ff). */
#ifndef TWOPASS_CLOSURE_H
#define TWOPASS_CLOSURE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"

/* A factor whose error is not just the relative one of all: an exchange area between sides
 * i < j, and the estimate of its absolute error. */
struct doubt {
	uint32_t i, j;
	double error;
};

/* The smallest changes of exchange areas, each in units of its estimated error, that make
 * the sums of rows grow by missing[row] where closed[row] is set: change = error^2 (l_i +
 * l_j), the multipliers l by conjugate gradients. Both ways of a pair change alike, so
 * reciprocity stays. doubt: [n], change: [n] out. Rows without doubts stay as they are.
 * O(n x iterations). 0, or -1 and e. */
int ff_closure(const struct doubt *doubt, size_t n, size_t rows, const double *missing,
               const uint8_t *closed, double *change, struct err *e);

#endif
