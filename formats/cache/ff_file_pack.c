#include "formats/cache/ff_file_pack.h"

#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

#include "lib/base/index_check.h"

/* Blocks of fewer words are not worth looking for: they take less than what tells them apart (a
 * digest of 16 bytes, 8 of a place). A guess. */
enum { WORTH_SHARING = 8 };

void file_ff_packed_free(struct ff_packed *p)
{
	struct array *v[] = { &p->word, &p->block_column, &p->column, &p->value, &p->start,
		            &p->scale };

	for (size_t i = 0; i < sizeof v / sizeof *v; i++)
		free(v[i]->data);
	*p = (struct ff_packed){ 0 };
}

/* ---- spans ---- */

static uint64_t count_spans(const struct ff *f, uint64_t block)
{
	uint64_t n = 0;
	struct ff_span s;

	for (struct ff_cursor c = ff_begin(f, block); ff_next(&c, &s);)
		n++;
	return n;
}

/* Appends the words of a block. 1 if they are spans, 0 if a list, -1 and e. */
static int pack_block(const struct ff *f, uint64_t block, struct array *word, struct err *e)
{
	const uint64_t first = f->block.start[block], n = f->block.start[block + 1] - first;
	const uint64_t spans = count_spans(f, block);
	struct ff_span s;

	if (2 * spans >= n)
		return mem_append(word, f->column + first, (size_t)n, sizeof *f->column, e);
	if (mem_reserve(word, (size_t)(2 * spans), sizeof *f->column, e))
		return -1;
	uint32_t *to = (uint32_t *)word->data + word->n;
	for (struct ff_cursor c = ff_begin(f, block); ff_next(&c, &s);) {
		*to++ = s.column;
		*to++ = s.count;
	}
	word->n += (size_t)(2 * spans);
	return 1;
}

/* ---- words that blocks share ---- */

/* The block_column of the words from `first` of the batch on, or of the same words
 * before: then they are taken back. */
static uint64_t share(struct ff_packed *p, size_t first, int spans)
{
	const uint64_t place = 2 * (p->words + first) + (uint64_t)spans;
	struct ff_known now = { .place = place };

	if (p->word.n - first < WORTH_SHARING)
		return place;
	const uint32_t *word = (const uint32_t *)p->word.data + first;
	XXH128_canonical_t digest;
	XXH128_canonicalFromHash(&digest, XXH3_128bits_withSeed(word, (p->word.n - first) * sizeof *word,
	                                                        (uint64_t)spans));
	memcpy(now.digest, digest.digest, sizeof now.digest);
	for (size_t i = 0; i < FF_PACK_KNOWN && i < p->packed; i++)
		if (memcmp(p->known[i].digest, now.digest, sizeof now.digest) == 0) {
			p->word.n = first;
			return p->known[i].place;
		}
	p->known[p->packed++ % FF_PACK_KNOWN] = now;
	return place;
}

int file_ff_pack_columns(const struct ff *batch, struct ff_packed *p, struct err *e)
{
	p->words += p->word.n;
	p->word.n = p->block_column.n = 0;
	if (err_check_starts("block_start", batch->block.start, batch->block.n, batch->entries, 0, e) ||
	    mem_reserve(&p->block_column, batch->block.n, sizeof(uint64_t), e))
		return -1;
	uint64_t *column = p->block_column.data;
	for (uint64_t b = 0; b < batch->block.n; b++) {
		size_t first = p->word.n;
		int spans = pack_block(batch, b, &p->word, e);
		if (spans < 0)
			return -1;
		column[b] = share(p, first, spans);
	}
	return 0;
}

/* ---- patches as receivers ---- */

static int put_sum(struct ff_packed *p, int f64, uint32_t column, double sum, struct err *e)
{
	float narrow = (float)sum;

	return mem_append(&p->column, &column, 1, sizeof column, e) ||
	       (f64 ? mem_append(&p->value, &sum, 1, sizeof sum, e)
	            : mem_append(&p->value, &narrow, 1, sizeof narrow, e)) ? -1 : 0;
}

static int sum_block(const struct ff *f, const struct model *m, uint64_t block,
                     struct ff_packed *p, struct err *e)
{
	uint64_t end = f->block.start[block + 1];

	for (uint64_t i = f->block.start[block]; i < end;) {
		uint32_t side = f->column[i] & 1, patch = m->element.patch[f->column[i] >> 1];
		double sum = 0;
		for (; i < end && (f->column[i] & 1) == side &&
		       m->element.patch[f->column[i] >> 1] == patch; i++)
			sum += ff_value(f, i);
		if (put_sum(p, !f->value, 2 * patch + side, sum, e))
			return -1;
	}
	return 0;
}

/* 1 over the sum of the row's first block. */
static double fitted_scale(const struct ff *f, size_t row)
{
	uint64_t b = f->row.block[row];
	double sum = f->block.escape[b] + f->block.black[b] + f->block.lost[b] + f->block.cut[b];

	for (uint64_t i = f->block.start[b]; i < f->block.start[b + 1]; i++)
		sum += ff_value(f, i);
	return 1 / sum;
}

int file_ff_sum_by_patch(const struct ff *batch, const struct model *m, struct ff_packed *p,
                         struct ff *out, struct err *e)
{
	p->column.n = p->value.n = 0;
	if (err_check_starts("block_start", batch->block.start, batch->block.n, batch->entries, 0, e) ||
	    mem_reserve(&p->start, batch->block.n + 1, sizeof(uint64_t), e) ||
	    mem_reserve(&p->scale, batch->row.n, sizeof(double), e))
		return -1;
	uint64_t *start = p->start.data;
	start[0] = 0;
	for (uint64_t b = 0; b < batch->block.n; b++) {
		if (sum_block(batch, m, b, p, e))
			return -1;
		start[b + 1] = p->column.n;
	}
	*out = *batch;
	out->to_patches = 1;
	out->entries = p->column.n;
	out->block.start = start;
	out->column = p->column.data;
	out->value = batch->value ? p->value.data : NULL;
	out->value64 = batch->value ? NULL : p->value.data;
	out->row.scale = p->scale.data;
	for (size_t r = 0; r < batch->row.n; r++)
		out->row.scale[r] = fitted_scale(out, r);
	return 0;
}
