/* From a hit on an input triangle to its element, faster than by the split tree. */
#ifndef TWOPASS_LOCATE_H
#define TWOPASS_LOCATE_H

#include "model.h"

/* The barycentric weights of a split tree's node as affine functions of the weights
 * (w1, w2) of the whole triangle: weight c = a[c] + b[c] w1 + d[c] w2. */
struct locator_node {
	float a[3], b[3], d[3];
};

/* A grid over the (w1, w2) plane of every subdivided triangle: a cell names the
 * element that holds it, or the deepest node of the split tree that does. */
struct locator {
	const struct model *m;
	uint64_t *first;             /* [triangles] first cell */
	uint32_t *size;              /* [triangles] cells along an edge, 0 = one element */
	int32_t *cell;               /* a split, or ~element */
	struct locator_node *node;   /* [splits] */
};

/* O(elements log elements). m must outlive it. 0, or -1 and e. */
int locator_init(struct locator *l, const struct model *m, struct err *e);
void locator_free(struct locator *l);

/* The element that model_locate finds (its neighbour, within float32 rounding of their
 * common edge), in three steps, so that a loop over many hits can ask for the memory of
 * each step ahead: the cell of a hit (subdivided triangles only), what it names, and
 * the way down from there. */
static inline uint64_t locate_cell(const struct locator *l, uint32_t tri, const double w[3])
{
	uint32_t n = l->size[tri];
	float x = (float)w[1], y = (float)w[2];
	int32_t i = (int32_t)(x * (float)n), j = (int32_t)(y * (float)n), last = (int32_t)n - 1;

	i = i < 0 ? 0 : i < last ? i : last;
	j = j < 0 ? 0 : j < last ? j : last;
	return l->first[tri] + (uint64_t)j * n + (uint64_t)i;
}

static inline uint32_t locate_below(const struct locator *l, int32_t at, const double w[3])
{
	if (at < 0)
		return (uint32_t)~at;
	const struct locator_node *node = &l->node[at];
	float x = (float)w[1], y = (float)w[2], v[3];
	for (int c = 0; c < 3; c++)
		v[c] = node->a[c] + node->b[c] * x + node->d[c] * y;
	while (at >= 0) {
		const struct split *s = &l->m->split[at];
		int a = s->edge, b = a == 2 ? 0 : a + 1, second = v[a] < v[b];
		float low = second ? v[a] : v[b], high = second ? v[b] : v[a];
		v[second ? b : a] = high - low;
		v[second ? a : b] = 2 * low;
		at = s->child[second];
	}
	return (uint32_t)~at;
}

static inline uint32_t locate(const struct locator *l, uint32_t tri, const double w[3])
{
	int32_t at = l->size[tri] ? l->cell[locate_cell(l, tri, w)] : l->m->triangle_split[tri];

	return locate_below(l, at, w);
}

#endif
