#include "lib/data/ff.h"

#include "lib/base/mem.h"

void ff_free(struct ff *f)
{
	MEM_FREE(f->chain.start, f->chain.event, f->chain.count, f->row.side, f->row.kind,
	         f->row.samples, f->row.scale, f->row.residual, f->row.error, f->row.block,
	         f->block.chain, f->block.start, f->block.escape, f->block.black, f->block.lost,
	         f->block.cut, f->block.arrival, f->block.column, f->column, f->column16,
	         f->value, f->value64, f->arrival.target, f->arrival.direction, f->link.target,
	         f->link.source, f->link.last, f->link.chain, f->link.direction, f->link.row,
	         f->gathered.rays, f->gathered.lost, f->gathered.count, f->gathered.landing, f->gathered.chain);
	*f = (struct ff){ 0 };
}
