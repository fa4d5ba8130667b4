#include "lib/ff_tally/ff_batch.h"

#include <stdlib.h>
#include <string.h>

#include "lib/data/link_key.h"

int ff_batch_begin(struct ff_batch *b, struct err *e)
{
	const uint64_t zero = 0;

	/* Start arrays hold ends while a batch grows and a leading 0. */
	if (b->row_block.n)
		return 0;
	return mem_append(&b->row_block, &zero, 1, sizeof zero, e) ||
	       mem_append(&b->block_start, &zero, 1, sizeof zero, e) ||
	       mem_append(&b->block_arrival, &zero, 1, sizeof zero, e) ? -1 : 0;
}

int ff_batch_reserve(struct ff_batch *b, size_t n, struct err *e)
{
	return mem_reserve(&b->column, n, sizeof(uint32_t), e) ||
	       mem_reserve(&b->value, n, b->f64 ? sizeof(double) : sizeof(float), e) ? -1 : 0;
}

double ff_batch_put_value(struct ff_batch *b, uint32_t column, double w)
{
	((uint32_t *)b->column.data)[b->column.n++] = column;
	if (b->f64)
		return ((double *)b->value.data)[b->value.n++] = w;
	return (double)(((float *)b->value.data)[b->value.n++] = (float)w);
}

double ff_batch_put_values(struct ff_batch *b, const uint32_t *column, const void *x, size_t n,
                           double scale)
{
	uint32_t *to = (uint32_t *)b->column.data + b->column.n;
	float *narrow = b->f64 ? NULL : (float *)b->value.data + b->value.n;
	double *wide = b->f64 ? (double *)b->value.data + b->value.n : NULL, sum = 0;
	size_t k = 0;

	/* Stores first and looks then: no branch to be guessed. */
	for (size_t j = 0; j < n; j++) {
		double w = scale * (wide ? ((const double *)x)[j] : (double)((const float *)x)[j]);
		to[k] = column[j];
		if (wide)
			wide[k] = w;
		else
			narrow[k] = (float)w;
		sum += wide ? w : (double)narrow[k];
		k += w > 0;
	}
	b->column.n += k;
	b->value.n += k;
	return sum;
}

int ff_batch_put_errors(struct ff_batch *b, const float *error_of_column, size_t n, struct err *e)
{
	const uint32_t *column = (const uint32_t *)b->column.data + b->column.n - n;

	if (mem_reserve(&b->value_error, n, sizeof(float), e))
		return -1;
	float *to = (float *)b->value_error.data + b->value_error.n;
	for (size_t i = 0; i < n; i++)
		to[i] = error_of_column[column[i]];
	b->value_error.n += n;
	return 0;
}

int ff_batch_put_block(struct ff_batch *b, uint32_t chain, const struct tally_rest *r,
                       struct err *e)
{
	uint64_t entries = b->column.n, arrivals = b->arrival_target.n;

	return mem_append(&b->block_chain, &chain, 1, sizeof chain, e) ||
	       mem_append(&b->block_start, &entries, 1, sizeof entries, e) ||
	       mem_append(&b->block_arrival, &arrivals, 1, sizeof arrivals, e) ||
	       mem_append(&b->escape, &r->escape, 1, sizeof r->escape, e) ||
	       mem_append(&b->black, &r->black, 1, sizeof r->black, e) ||
	       mem_append(&b->lost, &r->lost, 1, sizeof r->lost, e) ||
	       mem_append(&b->cut, &r->cut, 1, sizeof r->cut, e) ? -1 : 0;
}

int ff_batch_put_row(struct ff_batch *b, const struct ff_batch_row *r, struct err *e)
{
	uint64_t blocks = b->block_chain.n;
	uint8_t kind = (uint8_t)r->kind;
	float residual = (float)r->residual, error = (float)r->error;

	return mem_append(&b->row_side, &r->side, 1, sizeof r->side, e) ||
	       mem_append(&b->row_kind, &kind, 1, sizeof kind, e) ||
	       mem_append(&b->row_samples, &r->samples, 1, sizeof r->samples, e) ||
	       mem_append(&b->row_scale, &r->scale, 1, sizeof r->scale, e) ||
	       mem_append(&b->row_residual, &residual, 1, sizeof residual, e) ||
	       mem_append(&b->row_error, &error, 1, sizeof error, e) ||
	       mem_append(&b->row_block, &blocks, 1, sizeof blocks, e) ? -1 : 0;
}

/* ---- the numbers of the whole ---- */

static int map_chain(uint32_t *chain, const struct chains *local, struct array *map,
                     struct chains *whole, struct err *e)
{
	const uint32_t none = CHAIN_NONE;

	while (map->n < local->n)
		if (mem_append(map, &none, 1, sizeof none, e))
			return -1;
	uint32_t *to = (uint32_t *)map->data + *chain;
	if (*to == CHAIN_NONE)
		*to = bsdf_chains_find(whole, bsdf_chains_count(local, *chain), e);
	*chain = *to;
	return *to == CHAIN_NONE ? -1 : 0;
}

static int sort_links(struct ff_batch *b, struct err *e)
{
	size_t n = b->link_target.n;
	struct link_key *l = mem_new(n, sizeof *l, "links", e);
	uint32_t *target = b->link_target.data, *source = b->link_source.data;
	uint32_t *last = b->link_last.data;
	uint32_t *chain = b->link_chain.data, *row = b->link_row.data;
	float *direction = b->link_direction.data;

	if (!l)
		return -1;
	for (size_t i = 0; i < n; i++) {
		l[i] = (struct link_key){ target[i], source[i], last[i], chain[i],
		                      { row[2 * i], row[2 * i + 1] }, (uint32_t)i, { 0 } };
		memcpy(l[i].direction, &direction[3 * i], sizeof l[i].direction);
	}
	if (n)
		qsort(l, n, sizeof *l, link_key_order);
	for (size_t i = 0; i < n; i++) {
		target[i] = l[i].target;
		source[i] = l[i].source;
		last[i] = l[i].last;
		chain[i] = l[i].chain;
		memcpy(&row[2 * i], l[i].row, sizeof l[i].row);
		memcpy(&direction[3 * i], l[i].direction, sizeof l[i].direction);
	}
	free(l);
	return 0;
}

int ff_batch_renumber_chains(uint32_t *chain, size_t n, const struct chains *local,
                             struct array *map, struct chains *whole, struct err *e)
{
	for (size_t i = 0; i < n; i++)
		if (map_chain(&chain[i], local, map, whole, e))
			return -1;
	return 0;
}

int ff_batch_renumber(struct ff_batch *b, const struct chains *local, struct array *map,
                      struct chains *whole, struct err *e)
{
	return ff_batch_renumber_chains(b->block_chain.data, b->block_chain.n, local, map, whole, e) ||
	       ff_batch_renumber_chains(b->link_chain.data, b->link_chain.n, local, map, whole, e) ||
	       sort_links(b, e) ? -1 : 0;
}

struct ff ff_batch_view(const struct ff_batch *b)
{
	struct ff f = {
		.row.n = b->row_side.n, .row.side = b->row_side.data,
		.row.kind = b->row_kind.data, .row.samples = b->row_samples.data,
		.row.scale = b->row_scale.data, .row.residual = b->row_residual.data,
		.row.error = b->row_error.data, .row.block = b->row_block.data,
		.block.n = b->block_chain.n, .block.chain = b->block_chain.data,
		.block.start = b->block_start.data, .block.escape = b->escape.data,
		.block.black = b->black.data, .block.lost = b->lost.data,
		.block.cut = b->cut.data, .block.arrival = b->block_arrival.data,
		.entries = b->column.n, .column = b->column.data,
		.value = b->f64 ? NULL : b->value.data, .value64 = b->f64 ? b->value.data : NULL,
		.value_error = b->value_error.n ? b->value_error.data : NULL,
		.arrival.n = b->arrival_target.n, .arrival.target = b->arrival_target.data,
		.arrival.direction = b->arrival_direction.data,
		.link.n = b->link_target.n, .link.target = b->link_target.data,
		.link.source = b->link_source.data, .link.last = b->link_last.data,
		.link.chain = b->link_chain.data,
		.link.direction = b->link_direction.data, .link.row = b->link_row.data,
		.gathered.sides = b->gathered_rays.n, .gathered.rays = b->gathered_rays.data,
		.gathered.lost = b->gathered_lost.data,
		.gathered.count = b->gathered_count.data, .gathered.n = b->gathered_landing.n,
		.gathered.landing = b->gathered_landing.data,
		.gathered.chain = b->gathered_chain.n ? b->gathered_chain.data : NULL,
	};
	return f;
}

void ff_batch_free(struct ff_batch *b)
{
	struct array *v[] = { &b->row_side, &b->row_kind, &b->row_samples, &b->row_scale,
		&b->row_residual, &b->row_error, &b->row_block, &b->block_chain,
		&b->block_start, &b->escape, &b->black, &b->lost, &b->cut, &b->block_arrival,
		&b->column, &b->value, &b->value_error, &b->arrival_target, &b->arrival_direction,
		&b->link_target, &b->link_source, &b->link_last, &b->link_chain, &b->link_direction,
		&b->link_row, &b->gathered_rays, &b->gathered_lost, &b->gathered_count, &b->gathered_landing,
		&b->gathered_chain };

	for (size_t i = 0; i < sizeof v / sizeof *v; i++)
		free(v[i]->data);
	*b = (struct ff_batch){ .f64 = b->f64 };
}
