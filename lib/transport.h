/* Form factors made ready for shooting: shards joined, chains numbered in common,
 * entries summed by receiving patch-side, arrivals tied to links. */
#ifndef TWOPASS_TRANSPORT_H
#define TWOPASS_TRANSPORT_H

#include "chain.h"
#include "ff.h"
#include "model.h"

/* The entries of a block that lie on one patch-side. */
struct run {
	uint32_t target;     /* patch-side */
	uint32_t count;      /* entries */
	uint32_t link;       /* of a target with a lobe, else FF_NO_ROW */
	uint32_t guessed;    /* 1: the link is the nearest in direction, not the source's */
	uint64_t first;      /* entry, in the shard's numbering */
	double sum;          /* of the values */
};

struct block {
	uint32_t chain;
	uint32_t shard;
	uint64_t run;        /* first; ends where the next block's begins */
	double sum;          /* runs + the rest below: what comes in by this chain */
	double escape, black, lost, cut;
};

struct transport {
	const struct model *m;
	const struct ff *const *shard;   /* sorted by part */
	size_t shards;
	struct chains chains;

	size_t rows;
	uint32_t *row_side;
	uint8_t *row_kind;
	uint32_t *row_samples;
	uint64_t *row_block;             /* [rows+1] */
	uint32_t *diffuse_row, *emission_row; /* [2P], FF_NO_ROW where there is none */

	size_t blocks, runs;
	struct block *block;             /* [blocks+1] */
	struct run *run;

	size_t links;                    /* sorted by target, chain, source */
	uint32_t *link_target;
	uint32_t *link_row;              /* [links][2] */
	uint64_t *target_link;           /* [2P+1] first link of a patch-side */
	size_t entries;
};

/* Joins the shards (f[i] stay with the caller and must outlive t). They must be
 * parts 1..N of one whole, each once; names[i] is used in messages.
 * O(entries + links log links). 0, or -1 and e. */
int transport_init(struct transport *t, const struct model *m, const struct ff **f,
                   const char *const *names, size_t n, int threads, struct err *e);
void transport_free(struct transport *t);

#endif
