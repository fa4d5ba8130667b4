/* The pass over elements: irradiance from the flux that every row has sent.
 *
 * Threads own ranges of receivers, so sums do not depend on their number; each reads
 * only the entries that land in its range. A range fits the cache: rows come by one
 * after the other, and what they add to stays near. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "lanes.h"
#include "par.h"
#include "radiosity.h"
#include "send.h"

/* Receivers of a range: their sums are a good part of a core's second-level cache. */
enum { RANGE = 1 << 13 };

enum part { DIRECT, CAUSTIC, INDIRECT, H_PARTS };

struct gather {
	const struct transport *t;
	struct solution *s;
	int to_patches;
	size_t receivers;            /* elements or patches, 2 sides each */
	const double *block_flux[2]; /* [blocks][bands] by freshness, over the block's sum */
	const uint8_t *carries;      /* [blocks] bit 0: fresh flux, bit 1: mixed */
	size_t ranges;
	uint32_t *cut;               /* [ranges+1] receivers */
	lanes *flux[H_PARTS];        /* [2][receivers] by side: landing flux */
	lanes_f32 *variance;         /* [2][receivers], in units of `unit` */
	double unit;                 /* the largest that a whole block adds */
	int first_band;              /* of the four in work */
};

/* ---- a block into a range ---- */

/* What a block adds to every receiver it lands on, per unit of value. */
struct scales {
	lanes fresh, mixed;
	lanes_f32 variance;
	lanes *to_fresh, *to_mixed;
	lanes_f32 *to_variance;
};

static inline void add(const struct scales *s, size_t at, double v, int fresh, int mixed)
{
	if (fresh)
		s->to_fresh[at] += s->fresh * v;
	if (mixed)
		s->to_mixed[at] += s->mixed * v;
	s->to_variance[at] += s->variance * (float)v;
}

/* Entries of a list or a span, and what they hold. */
struct stretch {
	const uint32_t *column;      /* [count], NULL: receivers of a span, from `at` on */
	size_t at, back;             /* `back` lies between the two sides of a receiver */
	const float *v32;            /* one of the two is NULL */
	const double *v64;
	size_t count;
};

/* Inlined with constants, so that each case is a loop of its own. */
static inline void add_as(const struct scales *s, const struct stretch *x, int list, int f32,
                          int fresh, int mixed)
{
	for (size_t i = 0; i < x->count; i++) {
		uint32_t c = list ? x->column[i] : 0;
		size_t at = list ? (c >> 1) + (c & 1 ? x->back : 0) : x->at + i;
		add(s, at, f32 ? (double)x->v32[i] : x->v64[i], fresh, mixed);
	}
}

static void add_stretch(const struct scales *s, const struct stretch *x, int carries)
{
	if (x->column && x->v32 && carries == 2)
		add_as(s, x, 1, 1, 0, 1);
	else if (x->column && x->v32)
		add_as(s, x, 1, 1, carries & 1, carries >> 1);
	else if (x->column)
		add_as(s, x, 1, 0, carries & 1, carries >> 1);
	else if (x->v32)
		add_as(s, x, 0, 1, carries & 1, carries >> 1);
	else
		add_as(s, x, 0, 0, carries & 1, carries >> 1);
}

static struct stretch stretch_at(const struct gather *g, const struct ff *f, uint64_t entry,
                                 uint64_t count)
{
	return (struct stretch){ .back = g->receivers, .v32 = f->value ? f->value + entry : NULL,
	                         .v64 = f->value ? NULL : f->value64 + entry,
	                         .count = (size_t)count };
}

/* First of a list's words at or beyond a receiver: ranges are whole patches, so that
 * both sides of a patch are on one side of it. */
static const uint32_t *seek(const uint32_t *word, const uint32_t *end, uint32_t receiver)
{
	size_t n = (size_t)(end - word);

	while (n) {
		size_t half = n / 2;
		int below = word[half] >> 1 < receiver;
		word += below ? half + 1 : 0;
		n = below ? n - half - 1 : half;
	}
	return word;
}

static void add_list(const struct gather *g, const struct ff *f, uint64_t b, size_t range,
                     const struct scales *s, int carries)
{
	const uint64_t *word = ff_block_column(f) + b;
	const uint32_t *begin = f->column + word[0], *end = f->column + word[1];
	const uint32_t *first = seek(begin, end, g->cut[range]);
	const uint32_t *last = seek(first, end, g->cut[range + 1]);
	struct stretch x = stretch_at(g, f, f->block_start[b] + (uint64_t)(first - begin),
	                              (uint64_t)(last - first));

	x.column = first;
	add_stretch(s, &x, carries);
}

static void add_spans(const struct gather *g, const struct ff *f, uint64_t b, size_t range,
                      const struct scales *s, int carries)
{
	uint32_t low = g->cut[range], high = g->cut[range + 1];
	struct ff_span span;

	for (struct ff_cursor c = ff_begin(f, b); ff_next(&c, &span);) {
		uint32_t begin = span.column >> 1, end = begin + span.count;
		uint32_t from = begin > low ? begin : low, to = end < high ? end : high;
		if (begin >= high)
			break;
		if (from >= to)
			continue;
		struct stretch x = stretch_at(g, f, span.entry + (from - begin), to - from);
		x.at = from + (span.column & 1 ? g->receivers : 0);
		add_stretch(s, &x, carries);
	}
}

/* ---- all blocks ---- */

static enum part part_of(const struct transport *t, uint32_t row, uint32_t chain)
{
	return chain == 0 && t->row_kind[row] <= FF_EMISSION ? DIRECT : CAUSTIC;
}

/* Variance of an element's irradiance from the sampling of the rows, as if each
 * sample were independent (stratification makes it smaller): a row of n samples
 * that sends flux U, of which f lands here, adds U^2 f / n. */
static lanes variance_of(const struct gather *g, uint32_t row, uint64_t b)
{
	const struct transport *t = g->t;
	double one = t->block[t->row_block[row]].sum / t->row_samples[row];
	lanes v = { 0 };

	for (int k = 0; k < LANES && g->first_band + k < g->s->bands; k++) {
		size_t at = b * (size_t)g->s->bands + (size_t)(g->first_band + k);
		double all = g->block_flux[0][at] + g->block_flux[1][at];
		v[k] = all * all * one;
	}
	return v;
}

static void set_scales(const struct gather *g, uint32_t row, uint64_t b, struct scales *s)
{
	const struct transport *t = g->t;
	size_t at = b * (size_t)g->s->bands + (size_t)g->first_band;

	*s = (struct scales){ .to_fresh = g->flux[part_of(t, row, t->block[b].chain)],
	                      .to_mixed = g->flux[INDIRECT], .to_variance = g->variance };
	for (int k = 0; k < LANES && g->first_band + k < g->s->bands; k++) {
		s->fresh[k] = g->block_flux[0][at + (size_t)k];
		s->mixed[k] = g->block_flux[1][at + (size_t)k];
	}
	s->variance = __builtin_convertvector(variance_of(g, row, b) * (1 / g->unit), lanes_f32);
}

static void add_range(void *arg, size_t begin, size_t end, int thread)
{
	const struct gather *g = arg;
	const struct transport *t = g->t;
	struct scales s;

	(void)thread;
	for (size_t range = begin; range < end; range++)
		for (uint32_t row = 0; row < t->rows; row++)
			for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
				const struct ff *f = t->shard[t->block[b].shard];
				uint64_t local = t->block[b].local;
				if (!g->carries[b])
					continue;
				set_scales(g, row, b, &s);
				if (ff_has_spans(f, local))
					add_spans(g, f, local, range, &s, g->carries[b]);
				else
					add_list(g, f, local, range, &s, g->carries[b]);
			}
}

/* ---- irradiance ---- */

static void put_bands(const struct gather *g)
{
	const struct model *m = g->t->m;
	double *to[H_PARTS] = { g->s->direct, g->s->caustic, g->s->indirect };
	size_t bands = (size_t)g->s->bands;

	for (size_t es = 0; es < 2 * m->elements; es++) {
		uint32_t element = (uint32_t)(es >> 1), patch = m->element_patch[element];
		size_t side = (es & 1) * g->receivers, at = es * bands + (size_t)g->first_band;
		size_t from = side + (g->to_patches ? patch : element);
		double area = g->to_patches ? m->patch_area[patch] : m->element_area[element];
		for (int k = 0; k < LANES && g->first_band + k < g->s->bands; k++, at++) {
			for (int p = 0; p < H_PARTS; p++)
				to[p][at] = g->flux[p][from][k] / area;
			g->s->error[at] = sqrt((double)g->variance[from][k] * g->unit) / area;
		}
	}
}

/* Float sums of variances stay in range whatever the unit of flux is. */
static void set_unit(struct gather *g)
{
	const struct transport *t = g->t;

	g->unit = 0;
	for (uint32_t row = 0; row < t->rows; row++)
		for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
			lanes v = variance_of(g, row, b);
			for (int k = 0; k < LANES; k++)
				g->unit = fmax(g->unit, v[k]);
		}
	if (!(g->unit > 0))
		g->unit = 1;
}

static int gather_bands(struct gather *g, int threads, struct err *e)
{
	size_t n = 2 * g->receivers;
	void *room, *variance;
	lanes *at = lanes_new(H_PARTS * n, &room, "irradiance", e);

	g->variance = (lanes_f32 *)lanes_new((n + 1) / 2, &variance, "irradiance", e);
	for (g->first_band = 0; at && g->variance && g->first_band < g->s->bands;
	     g->first_band += LANES) {
		for (int p = 0; p < H_PARTS; p++)
			g->flux[p] = at + (size_t)p * n;
		memset(at, 0, H_PARTS * n * sizeof *at);
		memset(g->variance, 0, n * sizeof *g->variance);
		set_unit(g);
		par_for(g->ranges, 1, threads, add_range, g, NULL);
		put_bands(g);
	}
	free(room);
	free(variance);
	return at && g->variance ? 0 : -1;
}

/* ---- flux by block ---- */

/* Flux by block over the block's sum of values, for every row. O(runs). */
static int block_fluxes(const struct transport *t, const struct solution *s, double *flux[2],
                        struct err *e)
{
	struct sender sender;
	size_t bands = (size_t)s->bands;
	int bad = sender_init(&sender, t, e);

	for (uint32_t r = 0; !bad && r < t->rows; r++)
		for (int fresh = 0; fresh < 2; fresh++) {
			double *to = flux[fresh] + t->row_block[r] * bands;
			send_block_flux(&sender, r, s->shot + (2 * (size_t)r + (size_t)fresh) * bands, to);
			for (uint64_t b = t->row_block[r]; b < t->row_block[r + 1]; b++)
				for (size_t k = 0; k < bands; k++)
					flux[fresh][b * bands + k] /=
						t->block[b].sum > 0 ? t->block[b].sum : 1;
		}
	sender_free(&sender);
	return bad;
}

static void set_carries(const struct transport *t, const struct solution *s,
                        double *const flux[2], uint8_t *carries)
{
	size_t bands = (size_t)s->bands;

	for (size_t b = 0; b < t->blocks; b++)
		for (size_t i = b * bands; i < (b + 1) * bands; i++)
			for (int fresh = 0; fresh < 2; fresh++)
				if (flux[fresh][i] > 0)
					carries[b] |= (uint8_t)(1 << fresh);
}

/* Bytes of the columns and values that are read. */
static double bytes_of(const struct gather *g)
{
	const struct transport *t = g->t;
	double bytes = 0;

	for (size_t b = 0; b < t->blocks; b++) {
		const struct ff *f = t->shard[t->block[b].shard];
		const uint64_t *word = ff_block_column(f) + t->block[b].local;
		const uint64_t *entry = f->block_start + t->block[b].local;
		if (g->carries[b])
			bytes += (double)(word[1] - word[0]) * sizeof *f->column +
			         (double)(entry[1] - entry[0]) *
			         (f->value ? sizeof *f->value : sizeof *f->value64);
	}
	return bytes * (double)lanes_groups(g->s->bands);
}

/* Ranges of whole patches, at least one a thread. */
static int cut_ranges(struct gather *g, int threads, struct err *e)
{
	const struct model *m = g->t->m;
	uint32_t i = 0;

	g->ranges = (g->receivers + RANGE - 1) / RANGE;
	g->ranges = (g->ranges + (size_t)threads - 1) / (size_t)threads * (size_t)threads;
	if (!(g->cut = mem_new(g->ranges + 1, sizeof *g->cut, "irradiance", e)))
		return -1;
	for (uint32_t p = 0; p <= m->patches; p++) {
		uint32_t begin = g->to_patches ? p : m->patch_start[p];
		for (; i <= g->ranges && begin * (uint64_t)g->ranges >= i * (uint64_t)g->receivers; i++)
			g->cut[i] = begin;
	}
	return 0;
}

int radiosity_gather(struct solution *s, const struct transport *t, int threads,
                     struct radiosity_report *r, struct err *e)
{
	double *flux[2];
	uint8_t *carries = mem_new(t->blocks, 1, "irradiance", e);
	struct gather g = { .t = t, .s = s, .to_patches = t->shard[0]->to_patches,
	                    .carries = carries };

	g.receivers = g.to_patches ? t->m->patches : t->m->elements;
	for (int i = 0; i < 2; i++)
		g.block_flux[i] = flux[i] = mem_new(t->blocks, (size_t)s->bands * sizeof(double),
		                                    "flux by chain", e);
	int bad = !carries || !flux[0] || !flux[1] || block_fluxes(t, s, flux, e) ||
	          cut_ranges(&g, threads > 1 ? threads : 1, e);
	if (!bad) {
		set_carries(t, s, flux, carries);
		bad = gather_bands(&g, threads, e);
		r->gather_bytes = bytes_of(&g);
	}
	free(carries);
	free(g.cut);
	free(flux[0]);
	free(flux[1]);
	return bad ? -1 : 0;
}
