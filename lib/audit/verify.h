/* Whether form factors and solutions obey the physics. */
#ifndef TWOPASS_VERIFY_H
#define TWOPASS_VERIFY_H

#include "lib/data/ff_check.h"
#include "lib/data/solution.h"

/* One law: the largest departure from it and what may be. limit INFINITY: stated
 * for information. */
struct verify_item {
	const char *name, *unit;
	double value, limit;
};

enum { VERIFY_MAX = 8 }; /* items: ff_verify adds 5, solution_verify 3 */

struct verify {
	size_t n;
	struct verify_item item[VERIFY_MAX];
};

/* Closure of the rows, and reciprocity A_i F_ij = A_j F_ji between all patch-sides
 * whose diffuse rows are there, against the errors the rows state. 0, or -1 and e.
 * O(entries log row). */
int ff_verify(const struct ff *f, const struct ff_scene *s, struct verify *v, struct err *e);

/* The ledger, and the flux absorbed by elements against it. O(element sides x bands). */
void solution_verify(const struct model *m, const struct solution *s, struct verify *v);

static inline int verify_good(const struct verify_item *i)
{
	return i->value <= i->limit;
}

#endif
