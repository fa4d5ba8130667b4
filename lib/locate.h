/* From a hit on an input triangle to its element, faster than by the split tree. */
#ifndef TWOPASS_LOCATE_H
#define TWOPASS_LOCATE_H

#include "model.h"

/* A grid over the (w1, w2) plane of every subdivided triangle: cells that lie
 * inside one element name it, the others send to the tree. */
struct locator {
	const struct model *m;
	uint64_t *first;     /* [triangles] first cell */
	uint32_t *size;      /* [triangles] cells along an edge, 0 = one element only */
	uint32_t *cell;      /* element, or UINT32_MAX = ask the tree */
};

/* O(elements). m must outlive it. 0, or -1 and e. */
int locator_init(struct locator *l, const struct model *m, struct err *e);
void locator_free(struct locator *l);

/* The element that model_locate finds. */
static inline uint32_t locate(const struct locator *l, uint32_t tri, const double w[3])
{
	uint32_t n = l->size[tri];

	if (n == 0)
		return (uint32_t)~l->m->triangle_split[tri];
	double x = w[1] * n, y = w[2] * n;
	uint32_t i = x > 0 ? (uint32_t)x : 0, j = y > 0 ? (uint32_t)y : 0;
	i = i < n ? i : n - 1;
	j = j < n ? j : n - 1;
	uint32_t element = l->cell[l->first[tri] + (uint64_t)j * n + i];
	if (element != UINT32_MAX)
		return element;
	double copy[3] = { w[0], w[1], w[2] };
	return model_locate(l->m, tri, copy);
}

#endif
