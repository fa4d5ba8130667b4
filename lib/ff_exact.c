#include "ff_exact.h"

double batch_put_value(struct ff_batch *b, uint32_t column, double value)
{
	((uint32_t *)b->column.data)[b->column.n++] = column;
	if (b->f64)
		return ((double *)b->value.data)[b->value.n++] = value;
	return (double)(((float *)b->value.data)[b->value.n++] = (float)value);
}

int batch_put_exact(struct ff_batch *b, const struct exact_row *r, struct err *e)
{
	const uint64_t zero = 0, blocks = b->block_chain.n + 1, entries = b->column.n;
	const uint32_t none = 0;
	const uint8_t kind = FF_DIFFUSE;
	const double no_flux = 0;

	/* Start arrays hold ends while a batch grows and a leading 0. */
	if (!b->row_block.n &&
	    (vec_append(&b->row_block, &zero, 1, sizeof zero, e) ||
	     vec_append(&b->block_start, &zero, 1, sizeof zero, e) ||
	     vec_append(&b->block_arrival, &zero, 1, sizeof zero, e)))
		return -1;
	return vec_append(&b->row_side, &r->side, 1, sizeof r->side, e) ||
	       vec_append(&b->row_kind, &kind, 1, sizeof kind, e) ||
	       vec_append(&b->row_samples, &none, 1, sizeof none, e) ||
	       vec_append(&b->row_scale, &r->scale, 1, sizeof r->scale, e) ||
	       vec_append(&b->row_residual, &r->residual, 1, sizeof r->residual, e) ||
	       vec_append(&b->row_error, &r->error, 1, sizeof r->error, e) ||
	       vec_append(&b->row_block, &blocks, 1, sizeof blocks, e) ||
	       vec_append(&b->block_chain, &none, 1, sizeof none, e) ||
	       vec_append(&b->block_start, &entries, 1, sizeof entries, e) ||
	       vec_append(&b->block_arrival, &zero, 1, sizeof zero, e) ||
	       vec_append(&b->escape, &r->escape, 1, sizeof r->escape, e) ||
	       vec_append(&b->black, &r->black, 1, sizeof r->black, e) ||
	       vec_append(&b->lost, &no_flux, 1, sizeof no_flux, e) ||
	       vec_append(&b->cut, &no_flux, 1, sizeof no_flux, e) ? -1 : 0;
}
