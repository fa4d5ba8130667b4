#include "lib/data/ff.h"

#include <stdlib.h>

void ff_free(struct ff *f)
{
	void *array[] = { f->chain_start, f->chain_event, f->chain_count, f->row_side,
		f->row_kind, f->row_samples, f->row_scale, f->row_residual, f->row_error,
		f->row_block, f->block_chain, f->block_start, f->block_escape, f->block_black,
		f->block_lost, f->block_cut, f->block_arrival, f->block_column, f->column, f->column16,
		f->value, f->value64,
		f->arrival_target, f->arrival_direction, f->link_target, f->link_source, f->link_last,
		f->link_chain, f->link_direction, f->link_row };

	for (size_t i = 0; i < sizeof array / sizeof *array; i++)
		free(array[i]);
	*f = (struct ff){ 0 };
}
