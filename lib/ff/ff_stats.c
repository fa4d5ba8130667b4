#include "lib/ff/ff_stats.h"

#include <math.h>

void ff_stats_count(struct ff_stats *s, const struct ff *f)
{
	for (size_t r = 0; r < f->row.n; r++) {
		double cut = 0;
		s->rows[f->row.kind[r]]++;
		s->worst_residual = fmax(s->worst_residual, fabs((double)f->row.residual[r]));
		for (uint64_t b = f->row.block[r]; b < f->row.block[r + 1]; b++)
			cut += f->block.cut[b] * f->row.scale[r];
		s->cut = fmax(s->cut, cut);
		if (f->row.kind[r] == FF_DIFFUSE) {
			s->samples += f->row.samples[r];
			s->mean_error += (double)f->row.error[r];
			s->worst_error = fmax(s->worst_error, (double)f->row.error[r]);
		}
	}
	s->links += f->link.n;
	s->blocks += f->block.n;
	s->entries += f->entries;
}

void ff_stats_count_pairs(struct ff_stats *s, const struct exchange_counts *c)
{
	s->pairs[0] += c->unoccluded;
	s->pairs[1] += c->hidden;
	s->pairs[2] += c->partly;
	s->pairs[3] += c->crowded;
	s->evaluations += c->evaluations;
}
