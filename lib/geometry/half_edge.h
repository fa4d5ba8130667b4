/* Edges of a triangle mesh: which triangles share them.
 *
 * Half-edge 3t+k runs from corner k of triangle t to corner k+1 (mod 3). */
#ifndef TWOPASS_HALF_EDGE_H
#define TWOPASS_HALF_EDGE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"

struct half_edges {
	size_t n;
	uint32_t *of;     /* [3 triangles] edge of each half-edge */
	uint32_t *start;  /* [n+1] first use of each edge */
	uint32_t *use;    /* [3 triangles] half-edges by edge, ascending */
};

/* Finds the undirected edges of `triangles` triangles with corners in
 * [0, vertices), ordered by lower, then higher vertex. 0, or -1 and e.
 * O(n + sum of d log d) for vertices of degree d. */
int geo_half_edges_build(struct half_edges *g, const uint32_t *triangle, size_t triangles,
                         size_t vertices, struct err *e);
void geo_half_edges_free(struct half_edges *g);

/* Where half-edge h begins and ends. */
static inline uint32_t geo_half_edge_from(const uint32_t *triangle, uint32_t h)
{
	return triangle[h];
}

static inline uint32_t geo_half_edge_to(const uint32_t *triangle, uint32_t h)
{
	return triangle[h % 3 == 2 ? h - 2 : h + 1];
}

/* The corner opposite. */
static inline uint32_t geo_half_edge_apex(const uint32_t *triangle, uint32_t h)
{
	return triangle[h % 3 == 0 ? h + 2 : h - 1];
}

/* Disjoint sets over [0, n): set[i] = i to begin with; the lowest member
 * represents its set. */
static inline uint32_t geo_sets_find(uint32_t *set, uint32_t i)
{
	while (set[i] != i) {
		set[i] = set[set[i]];
		i = set[i];
	}
	return i;
}

static inline void geo_sets_join(uint32_t *set, uint32_t i, uint32_t j)
{
	i = geo_sets_find(set, i);
	j = geo_sets_find(set, j);
	if (i < j)
		set[j] = i;
	else
		set[i] = j;
}

/* n singletons, to be released with free(). NULL and e when memory is short. */
uint32_t *geo_sets_new(size_t n, struct err *e);

#endif
