/* What a .ff file makes of a batch's columns (private to the writer). */
#ifndef TWOPASS_FF_FILE_PACK_H
#define TWOPASS_FF_FILE_PACK_H

#include "lib/base/mem.h"
#include "lib/data/ff.h"
#include "lib/data/model.h"

/* Blocks back that equal columns are looked for: a patch's two sides and its neighbours see the
 * same. A guess; the size of a .ff file shows what it does. */
enum { FF_PACK_KNOWN = 64 };

/* Columns of a block that later ones may have too. */
struct ff_known {
	unsigned char digest[16];
	uint64_t place;
};

/* Scratch of one file, begin with {0}; release with file_ff_packed_free. */
struct ff_packed {
	struct array word, block_column;             /* uint32_t, uint64_t */
	uint64_t words;                              /* of all batches */
	struct ff_known known[FF_PACK_KNOWN];        /* the last `packed` of them, in turn */
	uint64_t packed;
	struct array column, value, start, scale;    /* of a batch summed by patch */
};

void file_ff_packed_free(struct ff_packed *p);

/* The words of the file's next batch of lists, which become spans in each block where
 * that takes fewer, and are left out where one of the last blocks had the same: p->word
 * [p->words so far], and p->block_column [blocks] as struct ff has it. O(entries). 0, or
 * -1 and e. */
int file_ff_pack_columns(const struct ff *batch, struct ff_packed *p, struct err *e);

/* Turns a batch of lists of element-sides into one of patch-sides: values are summed,
 * and row scales made to fit them after rounding. *out borrows the batch's other
 * arrays and p's. O(entries). 0, or -1 and e. */
int file_ff_sum_by_patch(const struct ff *batch, const struct model *m, struct ff_packed *p,
                         struct ff *out, struct err *e);

#endif
