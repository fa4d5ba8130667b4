/* Tallies: where the flux of one row lands, gathered and sorted into blocks. */
#ifndef TWOPASS_TALLY_H
#define TWOPASS_TALLY_H

#include "lib/base/mem.h"
#include "lib/data/model.h"
#include "lib/ff_tally/ff_batch.h"
#include "lib/ff_tally/tally_chains.h"
#include "lib/scatter/chain.h"

/* Element-sides in the order of a block's entries: by patch-side, then element. */
struct tally_places {
	uint32_t *place;           /* [2E] of an element-side; TALLY_APART may be set */
	uint32_t *column;          /* [2E] element-side at a place */
};

/* A mark for element-sides where more happens than a count. */
#define TALLY_APART 0x80000000u

/* A count: from so many independent parts of a row's rays its standard error is known to 41 %.
 * A guess at where more parts would stratify each too little. */
enum { TALLY_REPLICATES = 4 };

/* One thread's scratch space; a row at a time. */
struct tally {
	const struct model *m;
	const struct tally_places *places;
	const uint8_t *has_lobe;   /* [2P] patch-sides whose arrivals keep a direction */
	struct chains chains;      /* this thread's own numbering */

	/* Chain 0, by place: landings of weight 1 in each replicate, and other weights. */
	uint32_t (*count)[TALLY_REPLICATES];
	double *dense;
	uint64_t *touched, *words_touched; /* bits of places with either, and of words of those */
	size_t words;              /* of words_touched */
	int weighed;               /* any other weights */
	double *replicate;         /* [2P] other weights, the current replicate */
	double *square;            /* [2P] their sums of squares over replicates */
	double *variance;          /* [2P] of the summed weight, where ff_tally_set gave it */
	double (*toward)[3];       /* [2P] summed directions to where light comes from */
	double escape_before, escape_square;
	int replicates;
	double worth;              /* the row is worth so many samples; 0: not known yet */
	int dependent;             /* samples of a replicate are no independent ones */

	struct tally_chains far;      /* longer chains */
	struct array rest;         /* struct tally_rest by slot */
	struct tally_rest spill;   /* takes what comes after running out of memory */
	struct array slot_chain;   /* uint32_t chain by slot; slot 0 = chain 0 */
	struct array chain_slot;   /* uint32_t 1 + slot by chain, 0 = unused */
	struct array arrival;      /* struct tally_arrival */
	struct err err;            /* out of memory, checked once a row */
};

/* O(elements). Marks the element-sides of patch-sides with apart[] set. */
int ff_tally_places_init(struct tally_places *p, const struct model *m, const uint8_t *apart,
                         struct err *e);
void ff_tally_places_free(struct tally_places *p);

/* chain_most: see chain.h. */
int ff_tally_init(struct tally *t, const struct model *m, const struct tally_places *places,
                  const uint8_t *has_lobe, uint32_t chain_most, struct err *e);
void ff_tally_free(struct tally *t);

static inline void ff_tally_touch(struct tally *t, uint32_t place)
{
	t->touched[place >> 6] |= (uint64_t)1 << (place & 63);
	t->words_touched[place >> 12] |= (uint64_t)1 << (place >> 6 & 63);
}

/* Landings of weight 1, or one of a whole weight, by chain 0 at a place without a lobe. */
static inline void ff_tally_count(struct tally *t, uint32_t place, uint32_t weight)
{
	int r = t->replicates < TALLY_REPLICATES ? t->replicates : TALLY_REPLICATES - 1;

	t->count[place][r] += weight;
	ff_tally_touch(t, place);
}

/* Weight w of the row's flux arriving by `chain` on an element-side, travelling
 * along dir (unit). */
void ff_tally_hit(struct tally *t, uint32_t chain, uint32_t element_side, double w,
                  const double dir[3]);

/* What became of flux of `chain` that lands nowhere. The pointer is good until
 * the next call with a chain that is new in this row. */
struct tally_rest *ff_tally_rest(struct tally *t, uint32_t chain);

/* The first place touched in chain 0 at or after `place`, or UINT32_MAX; the patch-side of
 * a place, and the place after its last. */
uint32_t ff_tally_next(const struct tally *t, uint64_t place);
uint32_t ff_tally_side_at(const struct tally *t, uint32_t place);
uint32_t ff_tally_side_end(const struct tally *t, uint32_t patch_side);

/* Landings of weight 1 tallied at a place. */
double ff_tally_counted(const struct tally *t, uint32_t place);

/* Makes w, of that variance, the weight at a place in chain 0. */
void ff_tally_set(struct tally *t, uint32_t place, double w, double variance);

/* Closes a replicate: equal, independently scrambled parts of a row's samples,
 * whose spread gives the row's standard error. */
void ff_tally_replicate(struct tally *t);

/* Appends the row to the batch and clears the tally. total: the weight that was
 * cast, from which the raw residual follows. The standard error comes from the
 * replicates where there are two or more, otherwise it is that of `samples`
 * random samples; none (0) stands for exact values. The row says that it is worth `samples`,
 * or with t->dependent as many independent ones, if fewer, as have that error.
 * O(hits + log). 0, or -1 and e. */
int ff_tally_finish(struct tally *t, struct ff_batch *b, uint32_t row_side,
                    enum ff_row_kind kind, uint32_t samples, double total, struct err *e);

/* Order of chains by length, then counts: independent of their numbers. */
int ff_chains_compare(const struct chains *c, uint32_t a, uint32_t b);

#endif
