/* Landings by chains longer than 0, sparse: kept as a list and added up now and then
 * (for lib/ff). */
#ifndef TWOPASS_TALLY_CHAINS_H
#define TWOPASS_TALLY_CHAINS_H

#include <stdint.h>

#include "lib/base/mem.h"

struct tally_landing {
	uint64_t key;              /* their order, the same for equal places */
	uint32_t column;
	double w;
};

struct tally_chains {
	struct array list;         /* struct tally_landing */
	struct array sort;         /* scratch for sorting them */
	size_t most;               /* when to add up equal ones */
};

/* Begin with {0}; release with ff_tally_chains_free. */
void ff_tally_chains_free(struct tally_chains *f);

/* O(1) on the whole. 0, or -1 and e. */
int ff_tally_chains_add(struct tally_chains *f, const struct tally_landing *l, struct err *e);

/* Sorts by key and adds up equal ones: light that goes round between mirrors lands on the
 * same elements again and again. O(landings). 0, or -1 and e. */
int ff_tally_chains_merge(struct tally_chains *f, struct err *e);

/* Of merged landings, the first whose key is not below `key`: its index, or their number. */
size_t ff_tally_chains_find(const struct tally_chains *f, uint64_t key);

#endif
