/* Channels (bands, of each light group) in vectors of four doubles. */
#ifndef TWOPASS_CHANNELS_H
#define TWOPASS_CHANNELS_H

#include <stdint.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"

/* Counts. Four doubles are a vector of AVX. 384 channels are 128 light groups of RGB or 12 of
 * BANDS_MAX bands: a guess at what anybody mixes. It bounds arrays on stacks (3 kB). */
enum { LANES = 4, CHANNELS_MAX = 384, VECTORS_MAX = CHANNELS_MAX / LANES };

/* For loops that are to be made anew for each set of constants. */
#define ALWAYS_INLINE inline __attribute__((always_inline))

typedef double lanes __attribute__((vector_size(32)));
typedef float lanes_f32 __attribute__((vector_size(16)));

/* Vectors that hold so many channels. */
static inline size_t lanes_vectors(size_t channels)
{
	return (channels + LANES - 1) / LANES;
}

/* n zeroed vectors, aligned to lines of the cache; *room is what to free. NULL and e when out of
 * memory. */
static inline lanes *lanes_new(size_t n, void **room, const char *what, struct err *e)
{
	enum { LINE = 64 };          /* bytes; calloc aligns to 16 only */

	*room = mem_new(n + LINE / sizeof(lanes), sizeof(lanes), what, e);
	return *room ? (lanes *)(((uintptr_t)*room + LINE - 1) & ~(uintptr_t)(LINE - 1)) : NULL;
}

/* Rows of n doubles to rows of vectors, padded with what is there (0), and back. */
static inline void lanes_pack(lanes *to, const double *from, size_t rows, size_t n)
{
	size_t vectors = lanes_vectors(n);

	for (size_t i = 0; i < rows; i++)
		memcpy(to + i * vectors, from + i * n, n * sizeof *from);
}

static inline void lanes_unpack(double *to, const lanes *from, size_t rows, size_t n)
{
	size_t vectors = lanes_vectors(n);

	for (size_t i = 0; i < rows; i++)
		memcpy(to + i * n, from + i * vectors, n * sizeof *to);
}

static inline double lanes_total(const lanes *x, size_t n)
{
	lanes sum = { 0 };

	for (size_t i = 0; i < n; i++)
		sum += x[i];
	return sum[0] + sum[1] + sum[2] + sum[3];
}

/* x, or 0 where not `yes`, without a branch. */
static inline lanes lanes_if(lanes x, int yes)
{
	return (lanes)((four_mask)x & -(long long)yes);
}

static inline lanes lanes_min(lanes a, lanes b)
{
	return four_choose(a < b, a, b);
}

static inline lanes lanes_max(lanes a, lanes b)
{
	return four_choose(a > b, a, b);
}

/* Sum of the absolute values of n vectors. */
static inline double lanes_magnitude(const lanes *x, size_t n)
{
	lanes sum = { 0 };

	for (size_t i = 0; i < n; i++)
		sum += four_abs(x[i]);
	return sum[0] + sum[1] + sum[2] + sum[3];
}

#endif
