/* Form factors computed into memory: batches appended to one struct ff. */
#ifndef TWOPASS_TEST_MEMORY_FF_H
#define TWOPASS_TEST_MEMORY_FF_H

#include <stdlib.h>
#include <string.h>

#include "../../lib/ff_build.h"

static inline void *grow(void *to, size_t have, const void *more, size_t n, size_t size)
{
	char *p = realloc(to, (have + n) * size + 1);

	assert_non_null(p);
	if (n)
		memcpy(p + have * size, more, n * size);
	return p;
}

/* Starts of a batch behind those of the whole: the leading 0 is left out. */
static inline uint64_t *grow_starts(uint64_t *to, size_t have, const uint64_t *more, size_t n,
                                    uint64_t base)
{
	uint64_t *p = realloc(to, (have + n + 1) * sizeof *p);

	assert_non_null(p);
	if (!to)
		p[0] = 0;
	for (size_t i = 1; i <= n; i++)
		p[have + i] = base + more[i];
	return p;
}

#define GROW(name, have, n, width) \
	f->name = grow(f->name, (have) * (width), b->name, (n) * (width), sizeof *f->name)

static inline int memory_put(void *arg, const struct ff *b, struct err *e)
{
	struct ff *f = arg;

	(void)e;
	f->row_block = grow_starts(f->row_block, f->rows, b->row_block, b->rows, f->blocks);
	f->block_start = grow_starts(f->block_start, f->blocks, b->block_start, b->blocks, f->entries);
	f->block_arrival = grow_starts(f->block_arrival, f->blocks, b->block_arrival, b->blocks,
	                               f->arrivals);
	GROW(row_side, f->rows, b->rows, 1);
	GROW(row_kind, f->rows, b->rows, 1);
	GROW(row_samples, f->rows, b->rows, 1);
	GROW(row_scale, f->rows, b->rows, 1);
	GROW(row_residual, f->rows, b->rows, 1);
	GROW(row_error, f->rows, b->rows, 1);
	GROW(block_chain, f->blocks, b->blocks, 1);
	GROW(block_escape, f->blocks, b->blocks, 1);
	GROW(block_black, f->blocks, b->blocks, 1);
	GROW(block_lost, f->blocks, b->blocks, 1);
	GROW(block_cut, f->blocks, b->blocks, 1);
	GROW(column, f->entries, b->entries, 1);
	if (b->value)
		GROW(value, f->entries, b->entries, 1);
	else
		GROW(value64, f->entries, b->entries, 1);
	GROW(arrival_target, f->arrivals, b->arrivals, 1);
	GROW(arrival_direction, f->arrivals, b->arrivals, 3);
	GROW(link_target, f->links, b->links, 1);
	GROW(link_source, f->links, b->links, 1);
	GROW(link_last, f->links, b->links, 1);
	GROW(link_chain, f->links, b->links, 1);
	GROW(link_direction, f->links, b->links, 3);
	GROW(link_row, f->links, b->links, 2);
	for (size_t i = 2 * f->links; i < 2 * (f->links + b->links); i++)
		if (f->link_row[i] != FF_NO_ROW)
			f->link_row[i] += (uint32_t)f->rows;
	f->rows += b->rows;
	f->blocks += b->blocks;
	f->entries += b->entries;
	f->arrivals += b->arrivals;
	f->links += b->links;
	return 0;
}

/* Form factors of a model in memory (ff_free them). */
static inline void memory_ff(const struct model *m, const struct ff_options *o, struct ff *f,
                             struct ff_stats *stats)
{
	struct err e = { 0 };
	struct ff head = { 0 };
	struct ff_sink sink = { memory_put, f };

	*f = (struct ff){ 0 };
	int bad = ff_build(m, o, &head, stats, &sink, NULL, &e);
	if (bad)
		print_error("%s\n", e.text);
	assert_int_equal(bad, 0);
	f->chains = head.chains;
	f->chain_events = head.chain_events;
	f->chain_most = head.chain_most;
	f->chain_start = head.chain_start;
	f->chain_event = head.chain_event;
	f->chain_count = head.chain_count;
	f->patch_begin = head.patch_begin;
	f->patch_end = head.patch_end;
	f->part = head.part;
	f->parts = head.parts;
}

#endif
