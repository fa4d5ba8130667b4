/* The difference of two pictures in numbers. */
#ifndef TWOPASS_COMPARE_H
#define TWOPASS_COMPARE_H

#include <stddef.h>

#include "err.h"
#include "image.h"

/* Over the pixels that are finite in all compared channels of both pictures;
 * every channel of such a pixel is one value of the means. */
struct compare {
	size_t pixels, left_out; /* counted, not finite */
	double mean_a, mean_b;
	double rmse;             /* root of the mean of (a - b)^2 */
	double relative_rmse;    /* rmse / |mean b|; 0 for 0/0, else INFINITY */
	double bias;             /* mean a - mean b */
	double relative_bias;    /* bias / |mean b|, likewise */
	double max;              /* largest |a - b| */
	int max_x, max_y;        /* where; the first in reading order; -1 if no pixel */
};

/* Compares n channels of a with n of b. The pictures have the same size. O(pixels). */
void compare_channels(const struct image *a, const int *channel_a, const struct image *b,
                      const int *channel_b, int n, struct compare *out);

/* The picture a - b of these channels, with a's names. 0, or -1 and e. */
int compare_difference(const struct image *a, const int *channel_a, const struct image *b,
                       const int *channel_b, int n, struct image *out, struct err *e);

#endif
