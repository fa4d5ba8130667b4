/* What has been computed, in numbers (private to lib/ff). */
#ifndef TWOPASS_FF_STATS_H
#define TWOPASS_FF_STATS_H

#include "lib/ff/ff_build.h"
#include "lib/occlusion/exchange.h"

/* Adds a batch's rows to the statistics. */
void ff_stats_count(struct ff_stats *s, const struct ff *f);

/* Adds the pairs of facets that formulas were used on. */
void ff_stats_count_pairs(struct ff_stats *s, const struct exchange_counts *c);

#endif
