/* Form factors, diffuse and directional: what a .ff file holds.
 *
 * A ROW is a distribution of flux leaving one patch-side: where it first lands,
 * and where it lands after each chain of ideal mirrors and clear panes.
 * Patch-side = 2 patch + side, element-side = 2 element + side. A punctual light is a
 * source too, numbered behind the patch-sides: 2 patches + light.
 *
 * A BLOCK of a row is what arrives by one CHAIN: the multiset of directional events
 * passed on the way (chain 0: none). Values are colourless fractions of the
 * row's flux; every block keeps what left the scene (escape), what met a black
 * back (black), what a reciprocal lobe loses (lost) and what was not followed
 * further (cut). Light that a surface sends on directionally appears again in the
 * block of the longer chain, so blocks are not additive: block 0 alone closes,
 *     row_scale (sum of values + escape + black + lost + cut) = 1,
 * and the others close against the entries that feed them. Ideal events are followed
 * in every row, lobes in rows of directional light only: those of emission and of
 * links. Where a row has no block for light that a lobe sends on, the light goes to a
 * link.
 *
 * A LINK belongs to a patch-side ("target") with a finite lobe and names a
 * source of light as the target sees it: the patch-sides that the light left (an
 * emitter by itself, other sources in runs of neighbours that look alike from the
 * target) and the chain it came by. Its rows are the directional form factors G of
 * eq. (3) of the paper for light from that source: one about R, one about T. Links
 * with source FF_ANY stand for a direction bin and serve sources without their own.
 *
 * GATHERED is where rays of element-sides landed. Rows take a patch-side for evenly lit;
 * a solution is put right by these, which know of elements. */
#ifndef TWOPASS_FF_H
#define TWOPASS_FF_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"

#define FF_ANY UINT32_MAX    /* link_source: no particular one */
#define FF_NO_ROW UINT32_MAX /* link_row: no such lobe */

enum ff_row_kind {
	FF_DIFFUSE = 0,     /* Lambertian, one for each patch-side that can shoot */
	FF_EMISSION = 1,    /* cos^m lobe about the normal (emission_exponent != 1) */
	FF_REFLECTED = 2,   /* G about R for one link */
	FF_TRANSMITTED = 3, /* G about T for one link */
	FF_LIGHT = 4,       /* of a punctual light: of all its flux, see punctual.h */
	FF_ROW_KINDS
};

/* Chains of directional events. Event id = ((2 material + side light arrives on) 2 + T),
 * T = 1 straight through. Chain c passed events event[i] count[i] times (or more, where
 * that is the most that is counted), i in [start[c], start[c+1]), ascending. */
struct ff_chains {
	size_t n, events;
	uint64_t *start;          /* [n+1] */
	uint32_t *event, *count;  /* [events] */
	uint32_t most;            /* where counts of ideal events of a colour stop */
};

struct ff_rows {
	size_t n;
	uint32_t *side;           /* [n] patch-side, or light, that the flux leaves */
	uint8_t *kind;            /* [n] enum ff_row_kind */
	uint32_t *samples;        /* [n] rays or hemicube pixels spent on block 0, or as many
	                             independent rays as gathered values are worth to the
	                             irradiance of elements; 0: all by formula */
	double *scale;            /* [n] */
	float *residual;          /* [n] 1 - sum before scaling (raw closure error) */
	float *error;             /* [n] over receiving patch-sides: the root of the summed
	                             squares of standard errors; of a row all by formula the
	                             sum of the estimated errors */
	uint64_t *block;          /* [n+1] first block */
};

struct ff_blocks {
	size_t n;
	uint32_t *chain;          /* [n] chain 0 first, then ascending length */
	uint64_t *start;          /* [n+1] first entry */
	double *escape, *black, *lost, *cut; /* [n] */
	uint64_t *arrival;        /* [n+1] first arrival */
	uint64_t *column;         /* [n] twice the first word of its columns, + 1 where spans
	                             begin there; NULL: all lists, one after the other */
};

/* Mean direction of light of a block arriving at a patch-side with a lobe. */
struct ff_arrivals {
	size_t n;
	uint32_t *target;         /* [n] patch-side */
	float *direction;         /* [n][3] unit vector towards where it comes from */
};

struct ff_links {
	size_t n;
	uint32_t *target;         /* [n] ascending; then by chain, source */
	uint32_t *source;         /* [n] first patch-side, or a light, or FF_ANY */
	uint32_t *last;           /* [n] last patch-side (the same for light), or FF_ANY */
	uint32_t *chain;          /* [n] */
	float *direction;         /* [n][3] mean direction to the source */
	uint32_t *row;            /* [n][2] rows about R and T, or FF_NO_ROW */
};

/* Landings of the rays that the element-sides of the shard's patches cast, by patch-side, then
 * element: where light comes from that arrives there directly (chain 0), or by directional events. Each stands for
 * a part 1 / rays of what arrives; rays that meet nothing, or black sides, have none. */
struct ff_gathered {
	size_t sides;             /* 2 elements of the shard, or 0: nothing was gathered */
	uint32_t *rays;           /* [sides] that it cast; 0: none */
	uint32_t *lost;           /* [sides] of these, met nothing or black sides */
	uint32_t *count;          /* [sides] landings */
	size_t n;
	uint32_t *landing;        /* [n] landing.h */
	uint32_t *chain;          /* [n] as light passes it; NULL: all 0 */
};

struct ff {
	struct ff_chains chain;
	struct ff_rows row;
	struct ff_blocks block;

	/* The columns of a block are a list, a word for each entry, or spans: pairs of
	 * words (first column, count) that stand for the columns first, first + 2, ...,
	 * the same side of consecutive elements. Blocks may share words. Columns ascend by
	 * patch-side, then element. Read them by ff_next. */
	size_t entries, columns;
	int to_patches;           /* 0: a column is an element-side, 1: a patch-side */
	uint32_t *column;         /* [columns] words; one of column, column16 is NULL */
	uint16_t *column16;
	float *value;             /* [entries]; one of value, value64 is NULL */
	double *value64;
	float *value_error;       /* [entries] estimated absolute error of a value, beyond what
	                             it is rounded to; NULL: values have none of their own */

	struct ff_arrivals arrival;
	struct ff_links link;
	struct ff_gathered gathered;

	/* The shard: patches [patch_begin, patch_end), and as large a part of the lights,
	 * leave through these rows. */
	uint32_t patch_begin, patch_end;
	uint32_t shard, shards;   /* K/N, 1-based */
};

void ff_free(struct ff *f);

static inline double ff_value(const struct ff *f, uint64_t i)
{
	return f->value ? (double)f->value[i] : f->value64[i];
}

static inline uint32_t ff_word(const struct ff *f, uint64_t i)
{
	return f->column16 ? f->column16[i] : f->column[i];
}

static inline uint64_t ff_first_word(const struct ff *f, uint64_t block)
{
	return f->block.column ? f->block.column[block] >> 1 : f->block.start[block];
}

static inline int ff_has_spans(const struct ff *f, uint64_t block)
{
	return f->block.column && (f->block.column[block] & 1);
}

/* Neighbouring entries: columns column, column + 2, ... with values from `entry` on. */
struct ff_span {
	uint32_t column, count;
	uint64_t entry;
};

/* A block's entries, span by span:
 *     struct ff_span s;
 *     for (struct ff_cursor c = ff_begin(f, block); ff_next(&c, &s);)
 * Lists come in spans too, each as long as it can be. f must have passed ff_check. */
struct ff_cursor {
	const struct ff *f;
	uint64_t word, entry, end; /* end: of the entries */
	int spans;
};

static inline struct ff_cursor ff_begin(const struct ff *f, uint64_t block)
{
	return (struct ff_cursor){ f, ff_first_word(f, block), f->block.start[block],
	                           f->block.start[block + 1], ff_has_spans(f, block) };
}

static inline int ff_next(struct ff_cursor *c, struct ff_span *s)
{
	if (c->entry == c->end)
		return 0;
	*s = (struct ff_span){ ff_word(c->f, c->word++), 1, c->entry++ };
	if (c->spans) {
		s->count = ff_word(c->f, c->word++);
		c->entry = s->entry + s->count;
		return 1;
	}
	for (; c->entry < c->end && ff_word(c->f, c->word) == s->column + 2 * s->count;
	     c->entry++) {
		s->count++;
		c->word++;
	}
	return 1;
}

#endif
