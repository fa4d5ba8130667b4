/* Links (ff.h) while they are put in order. */
#ifndef TWOPASS_LINK_KEY_H
#define TWOPASS_LINK_KEY_H

#include <stdint.h>

struct link_key {
	uint32_t target, source, last, chain, row[2];
	uint32_t order;           /* among equals */
	float direction[3];
};

/* For qsort: by target, chain, first source, order. */
static inline int link_key_order(const void *a, const void *b)
{
	const struct link_key *x = a, *y = b;

	if (x->target != y->target)
		return x->target < y->target ? -1 : 1;
	if (x->chain != y->chain)
		return x->chain < y->chain ? -1 : 1;
	if (x->source != y->source)
		return x->source < y->source ? -1 : 1;
	return (x->order > y->order) - (x->order < y->order);
}

#endif
