/* The pass over elements: irradiance from the flux that every row has sent.
 *
 * Threads own ranges of patch-sides, so sums do not depend on their number; each
 * reads only the entries that land in its range. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "mem.h"
#include "par.h"
#include "radiosity.h"
#include "send.h"

typedef double four __attribute__((vector_size(32)));

enum { LANES = 4 };

enum part { DIRECT, CAUSTIC, INDIRECT, PARTS };

struct gather {
	const struct transport *t;
	struct solution *s;
	const double *block_flux[2]; /* [blocks][bands] by freshness, over the block's sum */
	const uint8_t *carries;      /* [blocks] bit 0: fresh flux, bit 1: mixed */
	uint32_t *cut;               /* [ranges+1] patch-sides */
	uint32_t ranges;             /* one a thread */
	four *flux[PARTS];           /* [2E] landing flux, four bands at a time */
	four *variance;              /* [2E] */
	int first_band;              /* of the four in work */
};

static enum part part_of(const struct transport *t, uint32_t row, uint32_t chain)
{
	return chain == 0 && t->row_kind[row] <= FF_EMISSION ? DIRECT : CAUSTIC;
}

/* What a block adds to every element it lands on, per unit of value. */
struct scales {
	four fresh, mixed, variance;
	four *to_fresh, *to_mixed, *to_variance;
};

/* Inlined with constants, so that each case is a loop of its own. */
static inline void add_run(const struct scales *s, const uint32_t *column, const float *v32,
                           const double *v64, uint32_t n, int fresh, int mixed)
{
	for (uint32_t i = 0; i < n; i++) {
		double v = v32 ? (double)v32[i] : v64[i];
		uint32_t c = column[i];
		if (fresh)
			s->to_fresh[c] += s->fresh * v;
		if (mixed)
			s->to_mixed[c] += s->mixed * v;
		s->to_variance[c] += s->variance * v;
	}
}

static void add_entries(const struct scales *s, const struct ff *f, const struct run *r,
                        int carries)
{
	const uint32_t *column = f->column + r->first;
	const float *v32 = f->value ? f->value + r->first : NULL;
	const double *v64 = f->value ? NULL : f->value64 + r->first;

	if (v32 && carries == 2)
		add_run(s, column, v32, NULL, r->count, 0, 1);
	else if (v32)
		add_run(s, column, v32, NULL, r->count, carries & 1, carries >> 1);
	else
		add_run(s, column, NULL, v64, r->count, carries & 1, carries >> 1);
}

/* First run of a block at or beyond a patch-side. */
static uint64_t seek(const struct transport *t, uint64_t block, uint32_t ps)
{
	uint64_t lo = t->block[block].run, hi = t->block[block + 1].run;

	while (lo < hi) {
		uint64_t mid = lo + (hi - lo) / 2;
		if (t->run[mid].target < ps)
			lo = mid + 1;
		else
			hi = mid;
	}
	return lo;
}

/* Variance of an element's irradiance from the sampling of the rows, as if each
 * sample were independent (stratification makes it smaller): a row of n samples
 * that sends flux U, of which f lands here, adds U^2 f / n. */
static void set_scales(const struct gather *g, uint32_t row, uint64_t b, struct scales *s)
{
	const struct transport *t = g->t;
	const double *in[2] = { g->block_flux[0] + b * (size_t)g->s->bands,
	                        g->block_flux[1] + b * (size_t)g->s->bands };
	double one = t->block[t->row_block[row]].sum / t->row_samples[row];

	*s = (struct scales){ .to_fresh = g->flux[part_of(t, row, t->block[b].chain)],
	                      .to_mixed = g->flux[INDIRECT], .to_variance = g->variance };
	for (int k = 0; k < LANES && g->first_band + k < g->s->bands; k++) {
		s->fresh[k] = in[0][g->first_band + k];
		s->mixed[k] = in[1][g->first_band + k];
		s->variance[k] = (s->fresh[k] + s->mixed[k]) * (s->fresh[k] + s->mixed[k]) * one;
	}
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
				uint64_t i = g->carries[b] ? seek(t, b, g->cut[range]) : UINT64_MAX;
				if (i >= t->block[b + 1].run)
					continue;
				set_scales(g, row, b, &s);
				for (; i < t->block[b + 1].run && t->run[i].target < g->cut[range + 1]; i++)
					add_entries(&s, t->shard[t->block[b].shard], &t->run[i],
					            g->carries[b]);
			}
}

static void put_bands(const struct gather *g)
{
	const struct model *m = g->t->m;
	double *to[PARTS] = { g->s->direct, g->s->caustic, g->s->indirect };
	size_t bands = (size_t)g->s->bands;

	for (size_t es = 0; es < 2 * m->elements; es++)
		for (int k = 0; k < LANES && g->first_band + k < g->s->bands; k++) {
			size_t at = es * bands + (size_t)(g->first_band + k);
			double area = m->element_area[es >> 1];
			for (int p = 0; p < PARTS; p++)
				to[p][at] = g->flux[p][es][k] / area;
			g->s->error[at] = sqrt(g->variance[es][k]) / area;
		}
}

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

static void cut_ranges(const struct model *m, uint32_t ranges, uint32_t *cut)
{
	for (uint32_t i = 0, p = 0; i <= ranges; i++) {
		while (p < m->patches &&
		       m->patch_start[p] * (uint64_t)ranges < i * (uint64_t)m->elements)
			p++;
		cut[i] = i == ranges ? 2 * (uint32_t)m->patches : 2 * p;
	}
}

static void set_carries(const struct transport *t, const struct solution *s,
                        double *const flux[2], uint8_t *carries)
{
	size_t bands = (size_t)s->bands;

	for (size_t i = 0; i < t->blocks * bands; i++)
		for (int fresh = 0; fresh < 2; fresh++)
			if (flux[fresh][i] > 0)
				carries[i / bands] |= (uint8_t)(1 << fresh);
}

static void gather_bands(struct gather *g, void *room, int threads)
{
	size_t n = g->s->element_sides;
	/* calloc aligns to 16 bytes, vectors want 32 */
	four *at = (four *)(((uintptr_t)room + 31) & ~(uintptr_t)31);

	for (int p = 0; p < PARTS; p++)
		g->flux[p] = at + (size_t)p * n;
	g->variance = at + PARTS * n;
	for (g->first_band = 0; g->first_band < g->s->bands; g->first_band += LANES) {
		memset(at, 0, (PARTS + 1) * n * sizeof *at);
		par_for(g->ranges, 1, threads, add_range, g, NULL);
		put_bands(g);
	}
}

int radiosity_gather(struct solution *s, const struct transport *t, int threads,
                     struct radiosity_report *r, struct err *e)
{
	double *flux[2];
	uint32_t ranges = threads > 1 ? (uint32_t)threads : 1;
	uint32_t *cut = mem_new(ranges + 1, sizeof *cut, "irradiance", e);
	void *room = mem_new((PARTS + 1) * s->element_sides + 1, sizeof(four), "irradiance", e);
	uint8_t *carries = mem_new(t->blocks, 1, "irradiance", e);
	struct gather g = { .t = t, .s = s, .cut = cut, .ranges = ranges,
	                    .carries = carries };

	for (int i = 0; i < 2; i++)
		g.block_flux[i] = flux[i] = mem_new(t->blocks, (size_t)s->bands * sizeof(double),
		                                    "flux by chain", e);
	int bad = !room || !carries || !cut || !flux[0] || !flux[1] || block_fluxes(t, s, flux, e);
	if (!bad) {
		set_carries(t, s, flux, carries);
		cut_ranges(t->m, ranges, cut);
		gather_bands(&g, room, threads);
		r->gather_bytes = (double)t->entries * (t->shard[0]->value ? 8 : 12);
	}
	free(room);
	free(carries);
	free(cut);
	free(flux[0]);
	free(flux[1]);
	return bad ? -1 : 0;
}
