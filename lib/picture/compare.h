/* The difference of two pictures in numbers. */
#ifndef TWOPASS_COMPARE_H
#define TWOPASS_COMPARE_H

#include <stddef.h>

#include "lib/base/err.h"
#include "lib/picture/image.h"

/* The relative errors of pixels that are kept: 50, 95 and 99 % of pixels have no more. */
enum { COMPARE_PERCENTILES = 3 };
extern const int picture_compare_percentile[COMPARE_PERCENTILES];

/* Over the pixels that are not left out and finite in all compared channels of both
 * pictures; every channel of such a pixel is one value of the means. The relative error
 * of a pixel is |a - b| / |b|, lengths over its channels. */
struct compare {
	size_t pixels, left_out; /* counted, not finite */
	size_t excluded;         /* by the mask */
	double mean_a, mean_b;
	double rmse;             /* root of the mean of (a - b)^2 */
	double relative_rmse;    /* rmse / |mean b|; 0 for 0/0, else INFINITY */
	double bias;             /* mean a - mean b */
	double relative_bias;    /* bias / |mean b|, likewise */
	double max;              /* largest |a - b| */
	int max_x, max_y;        /* where; the first in reading order; -1 if no pixel */
	double percentile[COMPARE_PERCENTILES]; /* nearest rank; INFINITY where b is 0 */
};

/* Compares n channels of a with n of b. The pictures have the same size. mask: a byte
 * for each pixel, other than 0 where it is left out; or NULL. O(pixels log pixels). 0, or
 * -1 and e when memory is short. */
int picture_compare_channels(const struct image *a, const int *channel_a, const struct image *b,
                             const int *channel_b, int n, const unsigned char *mask,
                             struct compare *out, struct err *e);

/* Sets the mask where a picture shows an emitter: any channel of its layer `emission` is
 * not 0. Or where it shows nothing: `element` is negative, or Z infinite. 0, or -1 if it
 * has no such channels. */
int picture_compare_mask_emitters(const struct image *im, unsigned char *mask);
int picture_compare_mask_nothing(const struct image *im, unsigned char *mask);

/* The picture a - b of these channels, with a's names. 0, or -1 and e. */
int picture_compare_difference(const struct image *a, const int *channel_a, const struct image *b,
                               const int *channel_b, int n, struct image *out, struct err *e);

#endif
