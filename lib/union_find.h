/* Disjoint sets: parent[i] = i at first; a root is the lowest member of its set, so
 * that the outcome does not depend on the order of joins. Path halving. */
#ifndef TWOPASS_UNION_FIND_H
#define TWOPASS_UNION_FIND_H

#include <stdint.h>

static inline uint32_t union_find_root(uint32_t *parent, uint32_t i)
{
	while (parent[i] != i)
		i = parent[i] = parent[parent[i]];
	return i;
}

static inline void union_find_join(uint32_t *parent, uint32_t a, uint32_t b)
{
	a = union_find_root(parent, a);
	b = union_find_root(parent, b);
	if (a < b)
		parent[b] = a;
	else
		parent[a] = b;
}

#endif
