/* Smallest, mean and largest value of an array of a cache file. */
#ifndef TWOPASS_ARRAY_STATS_H
#define TWOPASS_ARRAY_STATS_H

#include "formats/container/container.h"

struct array_stats {
	double min, mean, max; /* NaN for an empty array; NaNs in it are counted only */
	uint64_t nans;
};

/* O(elements). */
void file_array_stats(const struct container_view *v, struct array_stats *out);

#endif
