/* Mean and standard error of an estimate from a few replicates of it: equal, independent parts
 * of its samples. */
#ifndef TWOPASS_REPLICATES_H
#define TWOPASS_REPLICATES_H

#include <math.h>
#include <stddef.h>

/* A count. The standard error that four replicates give is itself known to 1 / sqrt(2 (4 - 1)),
 * 41 %: a guess at what is enough to stop sampling by, when more would each be stratified over
 * fewer samples. Four, so that two parts can be made of them when samples are doubled. */
enum { REPLICATES = 4 };

struct replicates {
	double mean;
	double squares;   /* sum of squared deviations from it */
};

/* Of x[0], x[stride], ... x[(n - 1) stride]. O(n). */
static inline struct replicates replicates_of(const double *x, size_t stride, int n)
{
	struct replicates r = { 0, 0 };

	for (int i = 0; i < n; i++)
		r.mean += x[(size_t)i * stride];
	r.mean /= n;
	for (int i = 0; i < n; i++) {
		double off = x[(size_t)i * stride] - r.mean;
		r.squares += off * off;
	}
	return r;
}

/* Standard error of the mean of n replicates, n > 1. */
static inline double replicates_error(struct replicates r, int n)
{
	return sqrt(r.squares / (n * (n - 1)));
}

/* Makes REPLICATES sums those of half as many parts, twice as long; the others begin at 0. */
static inline void replicates_halve(double *x, size_t stride)
{
	for (size_t i = 0; i < REPLICATES / 2; i++)
		x[i * stride] = x[2 * i * stride] + x[(2 * i + 1) * stride];
	for (size_t i = REPLICATES / 2; i < REPLICATES; i++)
		x[i * stride] = 0;
}

#endif
