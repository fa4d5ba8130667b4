/* The pass over elements: irradiance from the flux that every row has sent.
 *
 * Threads own ranges of receivers, so sums do not depend on their number; each reads
 * only the entries that land in its range. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/channels.h"
#include "lib/base/parallel.h"
#include "lib/radiosity/propagate.h"
#include "lib/radiosity/radiosity.h"
#include "lib/scatter/bsdf.h"
#include "lib/scatter/bsdf.h"

/* Feeds whose entries are on the way from memory, a count: about what a core can have in flight.
 * A guess; `make bench` (shoot, GB/s) shows what it does. */
enum { AHEAD = 8 };

/* Element-sides that a thread takes at a time when it writes them: any large number does. */
enum { SIDES_AT_A_TIME = 4096 };

enum part { DIRECT, CAUSTIC, INDIRECT, H_PARTS };

/* A block that carries flux: what it adds to every receiver it lands on, per unit of
 * value. */
struct feed {
	lanes from_emitter, from_diffuse;
	lanes_f32 variance;
	const struct ff *f;
	uint64_t block;              /* of f */
	uint8_t emitter_part;        /* enum part that light from emitters adds to */
	uint8_t carries;             /* bits 1 << FROM_EMITTER, 1 << FROM_DIFFUSE */
};

/* Where a feed's entries in a range begin. */
struct place {
	uint64_t word, entry;        /* of f */
	uint32_t done;               /* entries of the span that begins there */
};

struct element_pass {
	const struct transport *t;
	struct solution *s;
	int to_patches;
	size_t receivers;            /* elements or patches, 2 sides each */
	const double *block_flux[2]; /* [blocks][channels] by origin, over the block's sum */
	size_t ranges;               /* one a thread */
	uint32_t *cut;               /* [ranges+1] receivers */
	size_t feeds;
	struct feed *feed;
	lanes *flux[H_PARTS];        /* [2][receivers] by side: landing flux */
	lanes_f32 *variance[2];      /* [2][receivers], in units of `unit`: of rows that bring
	                                direct light, and of others */
	double unit;                 /* the largest that a whole block adds */
	lanes ideal[2];              /* what variances of either are to be multiplied with on ideal
	                                sides, which rays alone tell of: see row_cast */
	size_t channels;
	size_t first;                /* channel of the four in work */
	double bytes;
};

/* ---- a block into a range ---- */

/* Where a feed adds. */
struct into {
	lanes *from_emitter, *from_diffuse;
	lanes_f32 *variance;
};

static ALWAYS_INLINE void add(const struct feed *x, const struct into *to, size_t at,
                              double v, int emitter, int diffuse)
{
	if (emitter)
		to->from_emitter[at] += x->from_emitter * v;
	if (diffuse)
		to->from_diffuse[at] += x->from_diffuse * v;
	to->variance[at] += x->variance * (float)v;
}

/* A feed's entries from p on that lie below a receiver. Inlined with constants, so
 * that each case is a loop of its own. */
static ALWAYS_INLINE void add_list(const struct element_pass *pass, const struct feed *x,
                                   const struct into *to, struct place p, uint32_t below,
                                   int f32, int emitter, int diffuse)
{
	const struct ff *f = x->f;
	const uint64_t n = f->block.start[x->block + 1] - p.entry;

	for (uint64_t i = 0; i < n; i++) {
		uint32_t column = ff_word(f, p.word + i);
		if (column >> 1 >= below)
			break;
		size_t at = (column >> 1) + (column & 1 ? pass->receivers : 0);
		double v = f32 ? (double)f->value[p.entry + i] : f->value64[p.entry + i];
		add(x, to, at, v, emitter, diffuse);
	}
}

static ALWAYS_INLINE void add_spans(const struct element_pass *pass, const struct feed *x,
                                    const struct into *to, struct place p, uint32_t below,
                                    int f32, int emitter, int diffuse)
{
	const struct ff *f = x->f;
	const uint64_t end = f->block.start[x->block + 1];

	for (int cut = 0; p.entry < end && !cut; p.word += 2, p.done = 0) {
		uint32_t column = ff_word(f, p.word), first = (column >> 1) + p.done;
		uint32_t last = first + ff_word(f, p.word + 1) - p.done;
		size_t back = column & 1 ? pass->receivers : 0;
		if (first >= below)
			break;
		cut = last > below;
		if (cut)
			last = below;
		for (size_t at = first + back; at < last + back; at++, p.entry++) {
			double v = f32 ? (double)f->value[p.entry] : f->value64[p.entry];
			add(x, to, at, v, emitter, diffuse);
		}
	}
}

static ALWAYS_INLINE void add_as(const struct element_pass *pass, const struct feed *x,
                                 const struct into *to, struct place p, uint32_t below,
                                 int f32, int emitter, int diffuse)
{
	if (ff_has_spans(x->f, x->block))
		add_spans(pass, x, to, p, below, f32, emitter, diffuse);
	else
		add_list(pass, x, to, p, below, f32, emitter, diffuse);
}

static void add_feed(const struct element_pass *pass, const struct feed *x, struct place p,
                     uint32_t below)
{
	const struct into to = { pass->flux[x->emitter_part], pass->flux[INDIRECT],
		                 pass->variance[x->emitter_part != DIRECT || !(x->carries & 1)] };

	if (x->f->value && x->carries == 2)
		add_as(pass, x, &to, p, below, 1, 0, 1);
	else if (x->f->value && x->carries == 1)
		add_as(pass, x, &to, p, below, 1, 1, 0);
	else if (x->f->value)
		add_as(pass, x, &to, p, below, 1, 1, 1);
	else
		add_as(pass, x, &to, p, below, 0, x->carries & 1, x->carries >> 1);
}

static void seek_span(const struct feed *x, uint32_t receiver, struct place *p)
{
	const struct ff *f = x->f;
	const uint64_t end = f->block.start[x->block + 1];

	for (; p->entry < end; p->word += 2) {
		uint32_t first = ff_word(f, p->word) >> 1, count = ff_word(f, p->word + 1);
		if (first >= receiver)
			return;
		p->done = receiver - first < count ? receiver - first : 0;
		p->entry += p->done ? p->done : count;
		if (p->done)
			return;
	}
}

/* Ranges are whole patches: both sides of a patch are on one side of a bound. */
static void seek_word(const struct feed *x, uint32_t receiver, struct place *p)
{
	uint64_t n = x->f->block.start[x->block + 1] - p->entry, at = 0;

	while (n) {
		uint64_t half = n / 2;
		int below = ff_word(x->f, p->word + at + half) >> 1 < receiver;
		at += below ? half + 1 : 0;
		n = below ? n - half - 1 : half;
	}
	p->word += at;
	p->entry += at;
}

/* A feed's first entry at or beyond a receiver. It and what follows is fetched. */
static struct place find_place(const struct feed *x, uint32_t receiver)
{
	const struct ff *f = x->f;
	struct place p = { ff_first_word(f, x->block), f->block.start[x->block], 0 };

	if (receiver && ff_has_spans(f, x->block))
		seek_span(x, receiver, &p);
	else if (receiver)
		seek_word(x, receiver, &p);
	__builtin_prefetch(f->column16 ? (const void *)(f->column16 + p.word) : f->column + p.word);
	__builtin_prefetch(f->value ? (const void *)(f->value + p.entry) : f->value64 + p.entry);
	return p;
}

static void add_range(void *arg, size_t begin, size_t end, int thread)
{
	const struct element_pass *pass = arg;
	struct place place[AHEAD];

	(void)thread;
	for (size_t range = begin; range < end; range++)
		for (size_t i = 0; i < pass->feeds + AHEAD; i++) {
			struct place *p = &place[i % AHEAD];
			if (i >= AHEAD)
				add_feed(pass, &pass->feed[i - AHEAD], *p, pass->cut[range + 1]);
			if (i < pass->feeds)
				*p = find_place(&pass->feed[i], pass->cut[range]);
		}
}

/* ---- what blocks carry ---- */

static enum part part_of(const struct transport *t, uint32_t row, uint32_t chain)
{
	int directional = t->row_kind[row] == FF_REFLECTED || t->row_kind[row] == FF_TRANSMITTED;

	return chain == 0 && !directional ? DIRECT : CAUSTIC;
}

/* Variance of an element's irradiance, all groups together, from the sampling of the
 * rows, as if each sample were independent, as row_samples allows for: a row of n
 * samples that sends flux U, of which f lands here, adds U^2 f / n; one without samples,
 * 0. For the four bands with the number of the channels in work. */
static lanes variance_of(const struct element_pass *pass, uint32_t row, uint64_t b)
{
	const struct transport *t = pass->t;
	uint32_t samples = t->block[b].chain ? t->row_cast[row] : t->row_samples[row];
	size_t bands = (size_t)pass->s->bands;
	double one = samples ? t->block[t->row_block[row]].sum / samples : 0;
	lanes v = { 0 };

	for (size_t k = 0; k < LANES && pass->first + k < bands; k++) {
		double all = 0;
		for (size_t c = pass->first + k; c < pass->channels; c += bands)
			all += pass->block_flux[0][b * pass->channels + c] +
			       pass->block_flux[1][b * pass->channels + c];
		v[k] = all * all * one;
	}
	return v;
}

/* Float sums of variances stay in range whatever the unit of flux is. */
static void set_unit(struct element_pass *pass)
{
	const struct transport *t = pass->t;

	pass->unit = 0;
	for (uint32_t row = 0; row < t->rows; row++)
		for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
			lanes v = variance_of(pass, row, b);
			for (int k = 0; k < LANES; k++)
				pass->unit = fmax(pass->unit, v[k]);
		}
	if (!(pass->unit >= DBL_MIN))
		pass->unit = 1;
}

static void set_feed(const struct element_pass *pass, uint32_t row, uint64_t b, uint8_t carries,
                     struct feed *x)
{
	const struct block *block = &pass->t->block[b];
	size_t at = b * pass->channels + pass->first;

	*x = (struct feed){ .f = pass->t->shard[block->shard], .block = block->local,
	                    .emitter_part = (uint8_t)part_of(pass->t, row, block->chain),
	                    .carries = carries };
	for (size_t k = 0; k < LANES && pass->first + k < pass->channels; k++) {
		x->from_emitter[k] = pass->block_flux[0][at + k];
		x->from_diffuse[k] = pass->block_flux[1][at + k];
	}
	x->variance = __builtin_convertvector(variance_of(pass, row, b) * (1 / pass->unit),
	                                      lanes_f32);
}

/* Whether a block has flux of an origin, in any channel. */
static int carries(const struct element_pass *pass, int origin, uint64_t b)
{
	for (size_t c = 0; c < pass->channels; c++)
		if (pass->block_flux[origin][b * pass->channels + c] != 0)
			return 1;
	return 0;
}

/* The mean of what rows that light straight are worth over their rays, by the variance that each has:
 * one number for all, as only an error depends on it. */
static void set_ideal(struct element_pass *pass)
{
	const struct transport *t = pass->t;
	lanes all[2] = { { 0 } }, cast[2] = { { 0 } };

	for (uint32_t row = 0; row < t->rows; row++) {
		uint64_t b = t->row_block[row];
		int other = part_of(t, row, 0) != DIRECT || !carries(pass, 0, b);
		lanes v = variance_of(pass, row, b);
		all[other] += v;
		cast[other] += v * ((double)t->row_samples[row] / fmax(1, t->row_cast[row]));
	}
	for (int i = 0; i < 2; i++)
		for (int k = 0; k < LANES; k++)
			pass->ideal[i][k] = all[i][k] > 0 ? fmax(1, cast[i][k] / all[i][k]) : 1;
}

/* Blocks with flux in the four channels in work, or any where they have variances. */
static void set_feeds(struct element_pass *pass)
{
	const struct transport *t = pass->t;
	const size_t last = pass->first < (size_t)pass->s->bands ? pass->channels
	                                                         : pass->first + LANES;

	pass->feeds = 0;
	for (uint32_t row = 0; row < t->rows; row++)
		for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
			unsigned carries = 0;
			for (size_t c = pass->first; c < last && c < pass->channels; c++) {
				size_t at = b * pass->channels + c;
				carries |= (pass->block_flux[0][at] != 0) |
				           (unsigned)(pass->block_flux[1][at] != 0) << 1;
			}
			if (carries)
				set_feed(pass, row, b, (uint8_t)carries,
				         &pass->feed[pass->feeds++]);
		}
}

/* ---- irradiance ---- */

static int is_ideal(const struct model *m, uint32_t patch, int side)
{
	uint32_t material = model_patch_material(m, patch);

	return bsdf_has_ideal(&m->material, material, side, 0) ||
	       bsdf_has_ideal(&m->material, material, side, 1);
}

static void put_channels(void *arg, size_t begin, size_t end, int thread)
{
	const struct element_pass *pass = arg;
	const struct model *m = pass->t->m;
	const struct irradiance *h = &pass->s->irradiance;
	double *to[H_PARTS] = { h->direct, h->caustic, h->indirect };
	size_t bands = (size_t)pass->s->bands;

	(void)thread;
	for (size_t es = begin; es < end; es++) {
		uint32_t element = (uint32_t)(es >> 1), patch = m->element.patch[element];
		size_t side = (es & 1) * pass->receivers;
		size_t from = side + (pass->to_patches ? patch : element);
		double area = pass->to_patches ? m->patch.area[patch] : m->element.area[element];
		int ideal = is_ideal(m, patch, (int)(es & 1));
		for (size_t k = 0; k < LANES && pass->first + k < pass->channels; k++) {
			size_t c = pass->first + k;
			size_t at = (c / bands * pass->s->element_sides + es) * bands + c % bands;
			for (int p = 0; p < H_PARTS; p++)
				to[p][at] = pass->flux[p][from][k] / area;
			h->indirect[at] += (double)pass->s->uneven[at];
			if (c < bands) {
				double direct = (double)pass->variance[0][from][k] * pass->unit *
				                (ideal ? pass->ideal[0][k] : 1);
				double other = (double)pass->variance[1][from][k] * pass->unit *
				               (ideal ? pass->ideal[1][k] : 1);
				pass->s->error.sampling_direct[at] = sqrt(direct) / area;
				pass->s->error.sampling[at] = sqrt(direct + other) / area;
			}
		}
	}
}

/* Bytes of the values that are read and, where columns are lists, of these. */
static double bytes_of(const struct element_pass *pass)
{
	double bytes = 0;

	for (size_t i = 0; i < pass->feeds; i++) {
		const struct ff *f = pass->feed[i].f;
		const uint64_t *entry = f->block.start + pass->feed[i].block;
		size_t word = f->column16 ? sizeof *f->column16 : sizeof *f->column;
		size_t value = f->value ? sizeof *f->value : sizeof *f->value64;
		bytes += (double)(entry[1] - entry[0]) *
		         (double)(value + (ff_has_spans(f, pass->feed[i].block) ? 0 : word));
	}
	return bytes;
}

static int add_channels(struct element_pass *pass, int threads, struct err *e)
{
	size_t n = 2 * pass->receivers;
	void *room, *variance, *feed;
	lanes *at = lanes_new(H_PARTS * n, &room, "irradiance", e);

	pass->variance[0] = (lanes_f32 *)lanes_new(n, &variance, "irradiance", e);
	pass->variance[1] = pass->variance[0] + n;
	pass->feed = (struct feed *)lanes_new(pass->t->blocks * (sizeof *pass->feed / sizeof(lanes)),
	                                      &feed, "flux by chain", e);
	int bad = !at || !variance || !pass->feed;
	for (int p = 0; !bad && p < H_PARTS; p++)
		pass->flux[p] = at + (size_t)p * n;
	for (pass->first = 0; !bad && pass->first < pass->channels; pass->first += LANES) {
		if (pass->first) {
			memset(at, 0, H_PARTS * n * sizeof *at);
			memset(pass->variance[0], 0, 2 * n * sizeof **pass->variance);
		}
		set_unit(pass);
		set_ideal(pass);
		set_feeds(pass);
		par_for(pass->ranges, 1, threads, add_range, pass, NULL);
		par_for(pass->s->element_sides, SIDES_AT_A_TIME, threads, put_channels, pass, NULL);
		pass->bytes += bytes_of(pass);
	}
	free(room);
	free(variance);
	free(feed);
	return bad ? -1 : 0;
}

/* ---- flux by block ---- */

/* Flux by block over the block's sum of values, for every row. O(runs). */
static int block_fluxes(const struct transport *t, const struct solution *s, double *flux[2],
                        struct err *e)
{
	struct propagator propagator;
	size_t channels = solution_channels(s);
	int bad = radiosity_propagator_init(&propagator, t, s->groups, e);

	for (uint32_t r = 0; !bad && r < t->rows; r++)
		for (int origin = 0; origin < ORIGINS; origin++) {
			double *to = flux[origin] + t->row_block[r] * channels;
			const double *shot = s->shot + (2 * (size_t)r + (size_t)origin) * channels;
			radiosity_propagate_block_flux(&propagator, r, shot, to);
			for (uint64_t b = t->row_block[r]; b < t->row_block[r + 1]; b++)
				for (size_t c = 0; c < channels; c++)
					*to++ /= t->block[b].sum > 0 ? t->block[b].sum : 1;
		}
	radiosity_propagator_free(&propagator);
	return bad;
}

static int cut_ranges(struct element_pass *pass, struct err *e)
{
	const struct model *m = pass->t->m;
	uint32_t i = 0;

	if (!(pass->cut = mem_new(pass->ranges + 1, sizeof *pass->cut, "irradiance", e)))
		return -1;
	for (uint32_t p = 0; p <= m->patch.n; p++) {
		uint32_t begin = pass->to_patches ? p : m->patch.start[p];
		while (i <= pass->ranges &&
		       begin * (uint64_t)pass->ranges >= i * (uint64_t)pass->receivers)
			pass->cut[i++] = begin;
	}
	return 0;
}

int radiosity_element_irradiance(struct solution *s, const struct transport *t, int threads,
                                 struct radiosity_report *r, struct err *e)
{
	double *flux[2];
	struct element_pass pass = { .t = t, .s = s, .to_patches = t->shard[0]->to_patches,
	                    .channels = solution_channels(s),
	                    .ranges = threads > 1 ? (size_t)threads : 1 };

	pass.receivers = pass.to_patches ? t->m->patch.n : t->m->element.n;
	for (int i = 0; i < 2; i++)
		pass.block_flux[i] = flux[i] = mem_new(t->blocks, pass.channels * sizeof(double),
		                                    "flux by chain", e);
	int bad = !flux[0] || !flux[1] || block_fluxes(t, s, flux, e) ||
	          cut_ranges(&pass, e) || add_channels(&pass, threads, e);
	r->element_bytes = pass.bytes;
	free(pass.cut);
	free(flux[0]);
	free(flux[1]);
	return bad ? -1 : 0;
}
