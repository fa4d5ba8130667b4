/* Form factors made ready for shooting: shards joined, chains numbered in common,
 * entries summed by receiving patch-side, arrivals tied to links. */
#ifndef TWOPASS_TRANSPORT_H
#define TWOPASS_TRANSPORT_H

#include "lib/data/ff.h"
#include "lib/data/model.h"
#include "lib/scatter/chain.h"

/* How a patch-side takes part in shooting. */
enum side_kind {
	SIDE_PLAIN,          /* absorbs and reflects diffusely, no more */
	SIDE_SPECIAL,        /* lets light through diffusely or has a finite lobe */
	SIDE_IDEAL,          /* sends light on by an event that the row follows, too */
	SIDE_KINDS
};

/* What comes in by one chain, and where it lands: runs, one for each patch-side, in
 * stretches by kind of side, ascending in each. Those that are not plain have a link
 * beside. */
struct block {
	uint32_t chain, shard;
	uint64_t local;      /* its number in the shard */
	uint64_t run;        /* first; ends where the next block's begins */
	uint64_t special;    /* first run on a special side */
	uint64_t ideal;      /* first run that the row follows on */
	uint64_t link;       /* run_link of the first special run */
	uint64_t onward;     /* first; ends where the next block's begins */
	double sum;          /* runs + the rest below: what comes in by this chain */
	double escape, black, lost, cut;
};

/* Light of a block that the row follows on, from all its runs with the same event. */
struct onward {
	uint32_t chain;      /* where it comes to: the block's own where counts have stopped,
	                        CHAIN_NONE if no sample followed it */
	uint32_t event;      /* id: ff.h */
	double sum;          /* of the runs' values */
};

/* A run_link: the link, with the bit set if it is the nearest in direction and not the
 * source's, FF_NO_ROW on a side without, or RUN_FOLLOWED where the row itself says what
 * lobes make of the light. */
#define RUN_GUESSED 0x80000000u
#define RUN_FOLLOWED (FF_NO_ROW - 1)

struct transport {
	const struct model *m;
	const struct ff *const *shard;   /* sorted by part */
	size_t shards;
	struct chains chains;
	uint32_t **shard_chain;          /* [shards] numbers of a shard's chains here */

	size_t rows;
	uint32_t *row_side;              /* source: ff.h */
	uint8_t *row_kind;
	uint32_t *row_samples;           /* that what lands straight is worth; 0: by formula */
	uint32_t *row_cast;              /* and what comes by longer chains: at most its rays */
	uint64_t *row_block;             /* [rows+1] */
	uint32_t *diffuse_row, *emission_row; /* [2P], FF_NO_ROW where there is none */
	uint32_t *light_row;             /* [L] */

	size_t blocks, runs, special_runs;
	struct block *block;             /* [blocks+1] */
	uint32_t *run_target;            /* [runs] patch-side */
	double *run_sum;                 /* [runs] of the values */
	uint32_t *run_link;              /* [special_runs] */
	struct onward *onward;

	size_t links;                    /* sorted by target, chain, source */
	uint32_t *link_target;
	uint32_t *link_row;              /* [links][2] */
	uint64_t *target_link;           /* [2P+1] first link of a patch-side */
};

/* Joins the shards (f[i] stay with the caller and must outlive t). They must be
 * parts 1..N of one whole, each once; names[i] is used in messages.
 * O(entries + links log links). 0, or -1 and e. */
int radiosity_transport_init(struct transport *t, const struct model *m, const struct ff **f,
                             const char *const *names, size_t n, int threads, struct err *e);
void radiosity_transport_free(struct transport *t);

#endif
