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

enum { LANES = 4, RANGES = 16 };

enum part { DIRECT, CAUSTIC, INDIRECT };

struct gather {
	const struct transport *t;
	struct solution *s;
	const double *block_flux[2]; /* [blocks][bands] by freshness, over the block's sum */
	uint32_t *cut;               /* [RANGES+1] patch-sides */
	four *flux;                  /* [2E][lanes of four] landing flux of one part */
	double *variance;            /* [2E][bands] */
	enum part part;
	int first_band;              /* of the four in work */
};

static enum part part_of(const struct transport *t, uint32_t row, uint32_t chain, int freshness)
{
	if (freshness == MIXED)
		return INDIRECT;
	return chain == 0 && t->row_kind[row] <= FF_EMISSION ? DIRECT : CAUSTIC;
}

static void add_run32(four *flux, const uint32_t *column, const float *value, uint32_t n,
                      four scale)
{
	for (uint32_t i = 0; i < n; i++)
		flux[column[i]] += scale * (double)value[i];
}

static void add_run64(four *flux, const uint32_t *column, const double *value, uint32_t n,
                      four scale)
{
	for (uint32_t i = 0; i < n; i++)
		flux[column[i]] += scale * value[i];
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

static void add_block(const struct gather *g, uint64_t b, int freshness, uint32_t begin,
                      uint32_t end)
{
	const struct transport *t = g->t;
	const struct ff *f = t->shard[t->block[b].shard];
	const double *in = g->block_flux[freshness] + b * (size_t)g->s->bands;
	four scale = { 0 };
	double any = 0;

	for (int k = 0; k < LANES && g->first_band + k < g->s->bands; k++) {
		scale[k] = in[g->first_band + k];
		any += scale[k];
	}
	if (!(any > 0))
		return;
	for (uint64_t i = seek(t, b, begin); i < t->block[b + 1].run; i++) {
		const struct run *r = &t->run[i];
		if (r->target >= end)
			return;
		if (f->value)
			add_run32(g->flux, f->column + r->first, f->value + r->first, r->count, scale);
		else
			add_run64(g->flux, f->column + r->first, f->value64 + r->first, r->count,
			          scale);
	}
}

static void add_range(void *arg, size_t begin, size_t end, int thread)
{
	const struct gather *g = arg;
	const struct transport *t = g->t;

	(void)thread;
	for (size_t range = begin; range < end; range++)
		for (uint32_t r = 0; r < t->rows; r++)
			for (int fresh = 0; fresh < 2; fresh++)
				for (uint64_t b = t->row_block[r]; b < t->row_block[r + 1]; b++)
					if (part_of(t, r, t->block[b].chain, fresh) == g->part)
						add_block(g, b, fresh, g->cut[range], g->cut[range + 1]);
}

/* Variance of an element's irradiance from the sampling of the rows, as if each
 * sample were independent (stratification makes it smaller): a row of n samples
 * that sends flux U, of which f lands here, adds U^2 f / n. */
static void add_variance(void *arg, size_t begin, size_t end, int thread)
{
	const struct gather *g = arg;
	const struct transport *t = g->t;
	size_t bands = (size_t)g->s->bands;

	(void)thread;
	for (size_t range = begin; range < end; range++)
		for (uint32_t r = 0; r < t->rows; r++)
			for (uint64_t b = t->row_block[r]; b < t->row_block[r + 1]; b++) {
				const struct ff *f = t->shard[t->block[b].shard];
				const double *in[2] = { g->block_flux[0] + b * bands,
				                        g->block_flux[1] + b * bands };
				double u2[BANDS_MAX], any = 0, whole = t->block[t->row_block[r]].sum;
				for (size_t k = 0; k < bands; k++) {
					double u = in[0][k] + in[1][k];
					u2[k] = u * u * whole / t->row_samples[r];
					any += u2[k];
				}
				for (uint64_t i = any > 0 ? seek(t, b, g->cut[range]) : UINT64_MAX;
				     i < t->block[b + 1].run && t->run[i].target < g->cut[range + 1]; i++)
					for (uint64_t k = t->run[i].first;
					     k < t->run[i].first + t->run[i].count; k++)
						for (size_t c = 0; c < bands; c++)
							g->variance[f->column[k] * bands + c] += u2[c] * ff_value(f, k);
			}
}

static void put_part(const struct gather *g, double *irradiance)
{
	const struct model *m = g->t->m;
	size_t bands = (size_t)g->s->bands;

	for (size_t es = 0; es < 2 * m->elements; es++)
		for (int k = 0; k < LANES && g->first_band + k < g->s->bands; k++)
			irradiance[es * bands + (size_t)(g->first_band + k)] =
				g->flux[es][k] / m->element_area[es >> 1];
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

static void cut_ranges(const struct model *m, uint32_t cut[RANGES + 1])
{
	for (uint32_t i = 0, p = 0; i <= RANGES; i++) {
		while (p < m->patches && m->patch_start[p] * (uint64_t)RANGES < i * (uint64_t)m->elements)
			p++;
		cut[i] = i == RANGES ? 2 * (uint32_t)m->patches : 2 * p;
	}
}

int radiosity_gather(struct solution *s, const struct transport *t, int threads,
                     struct radiosity_report *r, struct err *e)
{
	double *flux[2], *to[] = { s->direct, s->caustic, s->indirect };
	uint32_t cut[RANGES + 1];
	struct gather g = { .t = t, .s = s, .cut = cut, .variance = s->error };
	void *room = mem_new(s->element_sides + 1, sizeof *g.flux, "irradiance", e);

	for (int i = 0; i < 2; i++)
		g.block_flux[i] = flux[i] = mem_new(t->blocks, (size_t)s->bands * sizeof(double),
		                                    "flux by chain", e);
	int bad = !room || !flux[0] || !flux[1] || block_fluxes(t, s, flux, e);
	/* calloc aligns to 16 bytes, vectors want 32 */
	g.flux = (four *)(((uintptr_t)room + 31) & ~(uintptr_t)31);
	cut_ranges(t->m, cut);
	for (int part = DIRECT; !bad && part <= INDIRECT; part++)
		for (g.first_band = 0; g.first_band < s->bands; g.first_band += LANES) {
			g.part = (enum part)part;
			memset(g.flux, 0, s->element_sides * sizeof *g.flux);
			par_for(RANGES, 1, threads, add_range, &g, NULL);
			put_part(&g, to[part]);
		}
	if (!bad) {
		size_t bands = (size_t)s->bands;
		memset(s->error, 0, s->element_sides * bands * sizeof *s->error);
		par_for(RANGES, 1, threads, add_variance, &g, NULL);
		for (size_t i = 0; i < s->element_sides * bands; i++)
			s->error[i] = sqrt(s->error[i]) / t->m->element_area[i / bands >> 1];
		r->gather_bytes = (double)t->entries * (t->shard[0]->value ? 8 : 12);
	}
	free(room);
	free(flux[0]);
	free(flux[1]);
	return bad ? -1 : 0;
}
