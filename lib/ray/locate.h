/* From a hit on an input triangle to its element, faster than by the split tree. */
#ifndef TWOPASS_LOCATE_H
#define TWOPASS_LOCATE_H

#include "lib/data/model.h"

/* The barycentric weights of a split tree's node as affine functions of the weights
 * (w1, w2) of the whole triangle: weight c = a[c] + b[c] w1 + d[c] w2. */
struct locator_node {
	float a[3], b[3], d[3];
};

/* A grid over the (w1, w2) plane of a subdivided triangle: a cell names the element
 * that holds it, or the deepest node of the split tree that does. */
struct locator_grid {
	uint64_t first;              /* cell */
	uint32_t size;               /* cells along an edge */
};

struct locator {
	const struct model *m;
	int32_t *root;               /* [triangles] ~element if it is one, else its grid */
	struct locator_grid *grid;
	int32_t *cell;               /* a split, or ~element */
	struct locator_node *node;   /* [splits] */
};

/* O(elements log elements). m must outlive it. 0, or -1 and e. */
int ray_locator_init(struct locator *l, const struct model *m, struct err *e);
void ray_locator_free(struct locator *l);

/* The element that model_locate finds (its neighbour, within float32 rounding of their
 * common edge) for weights x, y of the triangle's corners 1 and 2, in two steps, so that
 * a loop over many hits can ask for the memory of each ahead: what is known of a hit's
 * place, and the way down from there. */
static inline const int32_t *ray_locate_begin(const struct locator *l, uint32_t tri, float x,
                                              float y)
{
	int32_t root = l->root[tri];

	if (root < 0)
		return &l->root[tri];
	const struct locator_grid *g = &l->grid[root];
	int32_t last = (int32_t)g->size - 1;
	int32_t i = (int32_t)(x * (float)g->size), j = (int32_t)(y * (float)g->size);
	i = i < 0 ? 0 : i < last ? i : last;
	j = j < 0 ? 0 : j < last ? j : last;
	return &l->cell[g->first + (uint64_t)j * g->size + (uint64_t)i];
}

static inline uint32_t ray_locate_below(const struct locator *l, int32_t at, float x, float y)
{
	if (at < 0)
		return (uint32_t)~at;
	const struct locator_node *node = &l->node[at];
	float v[3];
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

static inline uint32_t ray_locate(const struct locator *l, uint32_t tri, float x, float y)
{
	return ray_locate_below(l, *ray_locate_begin(l, tri, x, y), x, y);
}

#endif
