/* Form factors between plane patches by formula: a symmetric matrix of exchange areas,
 * each computed once for both ways (private to lib/ff). */
#ifndef TWOPASS_EXCHANGE_MATRIX_H
#define TWOPASS_EXCHANGE_MATRIX_H

#include "lib/ff/ff_build.h"
#include "lib/ff_rays/ff_internal.h"

/* 1 if a model is all plane patches without lobes, mirrors and panes. */
int ff_exchange_matrix_can(const struct ff_job *j);

/* All diffuse rows of patches [begin, end) to the sink, in batches with patch-sides as
 * columns. O(patch-sides^2) time for what nothing hides, a bounded part of the matrix in
 * memory at a time: pairs with a patch outside it are computed once more with the other.
 * 0, or -1 and e. */
int ff_exchange_matrix(const struct ff_job *j, uint32_t begin, uint32_t end, const struct ff_sink *sink,
                       struct ff_stats *stats, const struct progress *progress, struct err *e);

#endif
