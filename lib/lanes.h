/* Bands in vectors of four doubles. */
#ifndef TWOPASS_LANES_H
#define TWOPASS_LANES_H

#include <stdint.h>

#include "mem.h"

enum { LANES = 4 };

typedef double lanes __attribute__((vector_size(32)));
typedef float lanes_f32 __attribute__((vector_size(16)));

/* Vectors that hold so many bands. */
static inline size_t lanes_groups(int bands)
{
	return ((size_t)bands + LANES - 1) / LANES;
}

/* n zeroed vectors, aligned as such; *room is what to free. NULL and e when out of
 * memory. */
static inline lanes *lanes_new(size_t n, void **room, const char *what, struct err *e)
{
	*room = mem_new(n + 1, sizeof(lanes), what, e); /* calloc aligns to 16 bytes only */
	return *room ? (lanes *)(((uintptr_t)*room + 31) & ~(uintptr_t)31) : NULL;
}

#endif
