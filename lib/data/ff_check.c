#include "lib/data/ff_check.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

#include "lib/base/index_check.h"
#include "lib/base/mem.h"
#include "lib/data/landing.h"

/* Part of a row's flux by which stored rows may fail to close: a guess, far above the rounding of
 * sums in float64 and far below the error of any sampling. */
static const double closure_slack = 1e-9;
/* By how much the length of a direction may differ from 1. Directions are float32, which rounds to
 * 1e-7: a guess that lets pass what other programs write, and no error that matters. */
static const double unit_slack = 1e-3;

static int not_negative_f32(const char *name, const float *v, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++)
		if (!(v[i] >= 0 && isfinite(v[i])))
			return err_set(e, "array %s: value %zu is %g", name, i, (double)v[i]);
	return 0;
}

static int not_negative(const char *name, const double *v, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++)
		if (!(v[i] >= 0 && isfinite(v[i])))
			return err_set(e, "array %s: value %zu is %g", name, i, v[i]);
	return 0;
}

static int unit_vectors(const char *name, const float *v, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		double x = (double)v[3 * i], y = (double)v[3 * i + 1], z = (double)v[3 * i + 2];
		if (!(fabs(x * x + y * y + z * z - 1) <= 2 * unit_slack))
			return err_set(e, "array %s: direction %zu is not a unit vector", name, i);
	}
	return 0;
}

/* ---- scene and chains ---- */

static int check_scene(const struct ff_scene *s, struct err *e)
{
	if (s->elements == 0 || s->elements > INT32_MAX || s->patches == 0)
		return err_set(e, "array patch_start: %zu patches of %zu elements", s->patches,
		               s->elements);
	if (s->patch_start[0] != 0 || s->patch_start[s->patches] != s->elements)
		return err_set(e, "array patch_start: it runs from %" PRIu32 " to %" PRIu32
		               " and should from 0 to %zu", s->patch_start[0],
		               s->patch_start[s->patches], s->elements);
	for (size_t p = 0; p < s->patches; p++) {
		if (s->patch_start[p + 1] <= s->patch_start[p])
			return err_set(e, "array patch_start: patch %zu has no elements", p);
		if (!(s->patch_area[p] > 0 && isfinite(s->patch_area[p])))
			return err_set(e, "array patch_area: value %zu is %g", p, s->patch_area[p]);
		if (s->patch_sides[p] != 1 && s->patch_sides[p] != 3)
			return err_set(e, "array patch_sides: value %zu is %d, neither 1 nor 3", p,
			               s->patch_sides[p]);
	}
	return 0;
}

static int check_chains(const struct ff *f, size_t materials, struct err *e)
{
	if (f->chain.n == 0)
		return err_set(e, "array chain_start: there is no chain 0");
	if (f->chain.most == 0)
		return err_set(e, "array chain_most: it is 0");
	if (err_check_starts("chain_start", f->chain.start, f->chain.n, f->chain.events, 0, e) ||
	    err_check_below("chain_event", f->chain.event, f->chain.events, 4 * materials, e))
		return -1;
	if (f->chain.start[1] != 0)
		return err_set(e, "array chain_start: chain 0 is not empty");
	for (size_t c = 0; c < f->chain.n; c++)
		for (uint64_t i = f->chain.start[c]; i < f->chain.start[c + 1]; i++) {
			if (f->chain.count[i] == 0)
				return err_set(e, "array chain_count: value %" PRIu64 " is 0", i);
			if (i > f->chain.start[c] && f->chain.event[i] <= f->chain.event[i - 1])
				return err_set(e, "array chain_event: values %" PRIu64 " and %"
				               PRIu64 " do not ascend", i - 1, i);
		}
	return 0;
}

static uint64_t chain_length(const struct ff *f, uint32_t chain)
{
	uint64_t n = 0;

	for (uint64_t i = f->chain.start[chain]; i < f->chain.start[chain + 1]; i++)
		n += f->chain.count[i];
	return n;
}

/* ---- rows and blocks ---- */

static size_t sources(const struct ff_scene *s)
{
	return 2 * s->patches + s->lights;
}

static int check_row(const struct ff *f, const struct ff_scene *s, size_t r, struct err *e)
{
	uint32_t source = f->row.side[r], patch = source >> 1;

	if (f->row.kind[r] >= FF_ROW_KINDS)
		return err_set(e, "array row_kind: value %zu is %d", r, f->row.kind[r]);
	if (f->row.kind[r] == FF_LIGHT && (patch < s->patches || source >= sources(s)))
		return err_set(e, "array row_side: row %zu leaves source %" PRIu32 ", which is no "
		               "light", r, source);
	if (f->row.kind[r] != FF_LIGHT && (patch < f->patch_begin || patch >= f->patch_end))
		return err_set(e, "array row_side: row %zu leaves patch %" PRIu32 ", which is not "
		               "in this part", r, patch);
	if (!(f->row.scale[r] > 0 && isfinite(f->row.scale[r])))
		return err_set(e, "array row_scale: value %zu is %g", r, f->row.scale[r]);
	if (!isfinite(f->row.residual[r]))
		return err_set(e, "array row_residual: value %zu is %g", r,
		               (double)f->row.residual[r]);
	return 0;
}

/* Chain 0 first, then ascending length. */
static int check_row_chains(const struct ff *f, size_t r, struct err *e)
{
	uint64_t begin = f->row.block[r], length = 0;

	if (f->block.chain[begin] != 0)
		return err_set(e, "array block_chain: row %zu does not begin with chain 0", r);
	for (uint64_t b = begin + 1; b < f->row.block[r + 1]; b++) {
		uint64_t n = chain_length(f, f->block.chain[b]);
		if (n == 0 || n < length)
			return err_set(e, "array block_chain: block %" PRIu64 " is out of order",
			               b);
		length = n;
	}
	return 0;
}

static int check_rows(const struct ff *f, const struct ff_scene *s, struct err *e)
{
	if (err_check_starts("row_block", f->row.block, f->row.n, f->block.n, 1, e) ||
	    err_check_starts("block_start", f->block.start, f->block.n, f->entries, 0, e) ||
	    err_check_starts("block_arrival", f->block.arrival, f->block.n, f->arrival.n, 0, e) ||
	    err_check_below("block_chain", f->block.chain, f->block.n, f->chain.n, e) ||
	    not_negative_f32("row_error", f->row.error, f->row.n, e) ||
	    (f->value_error && not_negative_f32("value_error", f->value_error, f->entries, e)) ||
	    not_negative("block_escape", f->block.escape, f->block.n, e) ||
	    not_negative("block_black", f->block.black, f->block.n, e) ||
	    not_negative("block_lost", f->block.lost, f->block.n, e) ||
	    not_negative("block_cut", f->block.cut, f->block.n, e))
		return -1;
	for (size_t r = 0; r < f->row.n; r++)
		if (check_row(f, s, r, e) || check_row_chains(f, r, e))
			return -1;
	return 0;
}

/* ---- entries and arrivals ---- */

/* Where columns may lie, and in which order. */
struct columns {
	const struct ff *f;
	uint64_t limit;           /* receivers: elements or patches */
	uint32_t *patch_of;       /* of elements; NULL: receivers are patches */
};

/* Ascends with the order of columns, from 1 on. */
static uint64_t place(const struct columns *c, uint32_t column)
{
	uint32_t receiver = column >> 1, patch = c->patch_of ? c->patch_of[receiver] : receiver;

	return ((2 * (uint64_t)patch + (column & 1)) << 32 | receiver) + 1;
}

/* Columns first, first + 2, ...; `word` is where they stand, `last` the place of the
 * column before them, then of their last. */
static int check_span(const struct columns *c, uint64_t word, uint32_t first, uint32_t count,
                      uint64_t *last, struct err *e)
{
	uint64_t end = (uint64_t)first + 2 * ((uint64_t)count - 1);

	if (count == 0)
		return err_set(e, "array column: value %" PRIu64 " is 0 and counts columns",
		               word + 1);
	if (first >> 1 >= c->limit)
		return err_set(e, "array column: value %" PRIu64 " is %" PRIu32 ", which must be "
		               "below %" PRIu64, word, first, 2 * c->limit);
	if (end >> 1 >= c->limit)
		return err_set(e, "array column: value %" PRIu64 " is %" PRIu32 ", with which %"
		               PRIu32 " columns end beyond %" PRIu64, word + 1, count, count,
		               2 * c->limit);
	if (place(c, first) <= *last)
		return err_set(e, "array column: value %" PRIu64 " is out of order", word);
	*last = place(c, (uint32_t)end);
	return 0;
}

static uint64_t words(const struct ff *f)
{
	return f->block.column ? f->columns : f->entries;
}

/* `left` values from word w on. */
static int check_spans(const struct columns *c, uint64_t b, uint64_t w, uint64_t left,
                       struct err *e)
{
	const struct ff *f = c->f;
	uint64_t last = 0;

	for (; left; w += 2) {
		if (words(f) - w < 2)
			return err_set(e, "array block_column: block %" PRIu64 " ends beyond the "
			               "last column", b);
		uint32_t count = ff_word(f, w + 1);
		if (check_span(c, w, ff_word(f, w), count, &last, e))
			return -1;
		if (count > left)
			return err_set(e, "array column: value %" PRIu64 " is %" PRIu32 ", with "
			               "which block %" PRIu64 " has more columns than values",
			               w + 1, count, b);
		left -= count;
	}
	return 0;
}

static int check_list(const struct columns *c, uint64_t b, uint64_t w, uint64_t n,
                      struct err *e)
{
	uint64_t last = 0;

	if (n > words(c->f) - w)
		return err_set(e, "array block_column: block %" PRIu64 " ends beyond the last "
		               "column", b);
	for (uint64_t end = w + n; w < end; w++)
		if (check_span(c, w, ff_word(c->f, w), 1, &last, e))
			return -1;
	return 0;
}

static int check_columns(const struct columns *c, uint64_t b, struct err *e)
{
	const struct ff *f = c->f;
	uint64_t first = ff_first_word(f, b), n = f->block.start[b + 1] - f->block.start[b];

	if (first > words(f))
		return err_set(e, "array block_column: block %" PRIu64 " begins beyond the last "
		               "column", b);
	return ff_has_spans(f, b) ? check_spans(c, b, first, n, e) : check_list(c, b, first, n, e);
}

/* Finite values >= 0 that sum to *sum. */
static int check_values(const struct ff *f, uint64_t b, double *sum, struct err *e)
{
	double least = 0;

	*sum = 0;
	for (uint64_t i = f->block.start[b]; i < f->block.start[b + 1]; i++) {
		double v = ff_value(f, i);
		*sum += v;
		least = v < least ? v : least;
	}
	if (least >= 0 && isfinite(*sum))
		return 0;
	for (uint64_t i = f->block.start[b]; i < f->block.start[b + 1]; i++)
		if (!(ff_value(f, i) >= 0 && isfinite(ff_value(f, i))))
			return err_set(e, "array value: value %" PRIu64 " is %g", i,
			               ff_value(f, i));
	return err_set(e, "array value: block %" PRIu64 " sums to %g", b, *sum);
}

static int check_row_entries(const struct columns *c, size_t r, struct err *e)
{
	const struct ff *f = c->f;
	double whole = 0, sum;

	for (uint64_t b = f->row.block[r]; b < f->row.block[r + 1]; b++) {
		if (check_columns(c, b, e) || check_values(f, b, &sum, e))
			return -1;
		if (b == f->row.block[r])
			whole = sum + f->block.escape[b] + f->block.black[b] + f->block.lost[b] +
			        f->block.cut[b];
	}
	whole *= f->row.scale[r];
	if (!(fabs(whole - 1) <= closure_slack))
		return err_set(e, "array value: row %zu sums to %.12g instead of 1", r, whole);
	return 0;
}

static int check_entries(const struct ff *f, const struct ff_scene *s, struct err *e)
{
	struct columns c = { .f = f, .limit = f->to_patches ? s->patches : s->elements };
	int failed = !f->to_patches &&
	             !(c.patch_of = mem_new(s->elements, sizeof *c.patch_of,
	                                    "patches of elements", e));

	for (size_t p = 0; c.patch_of && p < s->patches; p++)
		for (uint32_t i = s->patch_start[p]; i < s->patch_start[p + 1]; i++)
			c.patch_of[i] = (uint32_t)p;
	for (size_t r = 0; r < f->row.n && !failed; r++)
		failed = check_row_entries(&c, r, e);
	free(c.patch_of);
	return failed ? -1 : 0;
}

/* ---- links ---- */

static int check_link_row(const struct ff *f, size_t l, int transmitted, struct err *e)
{
	uint32_t row = f->link.row[2 * l + (size_t)transmitted], target = f->link.target[l];

	if (row == FF_NO_ROW)
		return 0;
	if (row >= f->row.n)
		return err_set(e, "array link_row: link %zu has row %" PRIu32 " of %zu", l, row,
		               f->row.n);
	/* Light through a sheet leaves its other side. */
	if (f->row.kind[row] != (transmitted ? FF_TRANSMITTED : FF_REFLECTED) ||
	    f->row.side[row] != (transmitted ? target ^ 1 : target))
		return err_set(e, "array link_row: link %zu has row %" PRIu32 ", which is not one "
		               "of its target", l, row);
	return 0;
}

/* By target, then chain, then source; runs of sources do not overlap, only
 * direction bins may repeat. */
static int link_order(const struct ff *f, size_t l)
{
	const uint32_t *key[] = { f->link.target, f->link.chain, f->link.source };

	for (size_t k = 0; k < sizeof key / sizeof *key; k++)
		if (key[k][l] != key[k][l - 1])
			return key[k][l] > (k == 2 ? f->link.last : key[k])[l - 1];
	return f->link.source[l] == FF_ANY;
}

static int check_links(const struct ff *f, const struct ff_scene *s, struct err *e)
{
	if (err_check_below("link_target", f->link.target, f->link.n, 2 * s->patches, e) ||
	    err_check_below("link_chain", f->link.chain, f->link.n, f->chain.n, e) ||
	    unit_vectors("link_direction", f->link.direction, f->link.n, e))
		return -1;
	for (size_t l = 0; l < f->link.n; l++) {
		if (f->link.source[l] != FF_ANY && f->link.source[l] >= sources(s))
			return err_set(e, "array link_source: value %zu is %" PRIu32, l,
			               f->link.source[l]);
		if (f->link.last[l] < f->link.source[l] ||
		    (f->link.source[l] != FF_ANY && f->link.last[l] >= sources(s)))
			return err_set(e, "array link_last: value %zu is %" PRIu32, l,
			               f->link.last[l]);
		if (l && !link_order(f, l))
			return err_set(e, "array link_target: link %zu is out of order", l);
		if (check_link_row(f, l, 0, e) || check_link_row(f, l, 1, e))
			return -1;
	}
	return 0;
}

/* ---- what was gathered ---- */

static int check_gathered(const struct ff *f, const struct ff_scene *s, struct err *e)
{
	const struct ff_gathered *g = &f->gathered;
	size_t elements = s->patch_start[f->patch_end] - s->patch_start[f->patch_begin];
	uint64_t landings = 0;

	if (g->sides && g->sides != 2 * elements)
		return err_set(e, "array gathered_rays: %zu values for the %zu element-sides of this "
		               "part", g->sides, 2 * elements);
	for (size_t i = 0; i < g->sides; i++) {
		if (g->count[i] && !g->rays[i])
			return err_set(e, "array gathered_count: value %zu is %" PRIu32 " of 0 rays", i,
			               g->count[i]);
		if (g->lost[i] > g->rays[i])
			return err_set(e, "array gathered_lost: value %zu is %" PRIu32 " of %" PRIu32
			               " rays", i, g->lost[i], g->rays[i]);
		landings += g->count[i];
	}
	if (landings != g->n)
		return err_set(e, "array gathered_count: its sum is %" PRIu64 " of %zu landings",
		               landings, g->n);
	return err_check_below("gathered_landing", g->landing, g->n,
	                       2 * (uint64_t)LANDING_PLACES * s->elements, e) ||
	       (g->chain && err_check_below("gathered_chain", g->chain, g->n, f->chain.n, e)) ? -1 : 0;
}

static int check_part(const struct ff *f, size_t patches, struct err *e)
{
	if (f->patch_begin > f->patch_end || f->patch_end > patches)
		return err_set(e, "array part: patches %" PRIu32 " to %" PRIu32 " of %zu",
		               f->patch_begin, f->patch_end, patches);
	if (f->shard < 1 || f->shard > f->shards)
		return err_set(e, "array part: part %" PRIu32 " of %" PRIu32, f->shard, f->shards);
	return 0;
}

int ff_check(const struct ff *f, const struct ff_scene *s, struct err *e)
{
	return check_scene(s, e) || check_part(f, s->patches, e) ||
	       check_chains(f, s->materials, e) || check_rows(f, s, e) ||
	       check_entries(f, s, e) ||
	       err_check_below("arrival_target", f->arrival.target, f->arrival.n,
	                       2 * s->patches, e) ||
	       unit_vectors("arrival_direction", f->arrival.direction, f->arrival.n, e) ||
	       check_links(f, s, e) || check_gathered(f, s, e) ? -1 : 0;
}
