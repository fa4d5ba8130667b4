/* Batches of rows: put together, chain numbers and links made those of the whole
 * (for lib/ff). */
#ifndef TWOPASS_FF_BATCH_H
#define TWOPASS_FF_BATCH_H

#include "lib/base/mem.h"
#include "lib/data/ff.h"
#include "lib/scatter/chain.h"

/* Growing arrays of a struct ff. */
struct ff_batch {
	int f64;
	struct array row_side, row_kind, row_samples, row_scale, row_residual, row_error;
	struct array row_block, block_chain, block_start, escape, black, lost, cut;
	struct array block_arrival, column, value, value_error;
	struct array arrival_target, arrival_direction;
	struct array link_target, link_source, link_last, link_chain, link_direction, link_row;
	struct array gathered_rays, gathered_lost, gathered_count, gathered_landing, gathered_chain;
};

/* Flux of a chain that reaches no modelled element-side. */
struct tally_rest {
	double escape, black, lost, cut;
};

/* What a row says beside its blocks: as struct ff has it. */
struct ff_batch_row {
	uint32_t side;
	enum ff_row_kind kind;
	uint32_t samples;
	double scale, residual, error;
};

/* A row is put piece by piece: begin, then for each block its values into reserved room and
 * its arrivals, then the block, last the row. 0, or -1 and e; ff_batch_put_value returns the
 * value as it is stored. */
int ff_batch_begin(struct ff_batch *b, struct err *e);
int ff_batch_reserve(struct ff_batch *b, size_t values, struct err *e);
double ff_batch_put_value(struct ff_batch *b, uint32_t column, double value);

/* The same for those of n values x (double, or float unless b->f64) that are above 0, times
 * `scale`; returns the sum of what is stored. */
double ff_batch_put_values(struct ff_batch *b, const uint32_t *column, const void *x, size_t n,
                           double scale);

/* Errors of the last n values, by column; a batch has them for all of its values or none. */
int ff_batch_put_errors(struct ff_batch *b, const float *error_of_column, size_t n, struct err *e);
int ff_batch_put_block(struct ff_batch *b, uint32_t chain, const struct tally_rest *rest,
                       struct err *e);
int ff_batch_put_row(struct ff_batch *b, const struct ff_batch_row *r, struct err *e);

/* Chain numbers of the batch and order of links: local -> whole. `map` (vec of
 * uint32_t, CHAIN_NONE = not met yet) belongs to the thread whose chains these
 * are. Called in row order, so numbers do not depend on threads. */
int ff_batch_renumber(struct ff_batch *b, const struct chains *local, struct array *map,
                      struct chains *whole, struct err *e);

/* The same for n chain numbers that belong to others. */
int ff_batch_renumber_chains(uint32_t *chain, size_t n, const struct chains *local,
                             struct array *map, struct chains *whole, struct err *e);

/* The batch seen as a struct ff (borrowed arrays). */
struct ff ff_batch_view(const struct ff_batch *b);
void ff_batch_free(struct ff_batch *b);

#endif
