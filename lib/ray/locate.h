/* From a hit on an input triangle to its element, faster than by the split tree. */
#ifndef TWOPASS_LOCATE_H
#define TWOPASS_LOCATE_H

#include "lib/data/model.h"

/* A node of the split tree: which half a point is in, by the sign of a + b w1 + d w2, an affine
 * function of the weights of corners 1 and 2 of the whole triangle. */
struct locator_node {
	float a, b, d;
	int32_t child[2];            /* where it is not negative, and where it is: a node, or
	                                ~element */
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

static inline int32_t ray_locate_step(const struct locator_node *node, float x, float y)
{
	return node->child[node->a + node->b * x + node->d * y < 0];
}

static inline uint32_t ray_locate_below(const struct locator *l, int32_t at, float x, float y)
{
	/* Whether a cell names an element cannot be foreseen, so the first step has no branch. */
	int32_t named = at >> 31, below = ray_locate_step(&l->node[at & ~named], x, y);

	at = (at & named) | (below & ~named);
	while (at >= 0)
		at = ray_locate_step(&l->node[at], x, y);
	return (uint32_t)~at;
}

static inline uint32_t ray_locate(const struct locator *l, uint32_t tri, float x, float y)
{
	return ray_locate_below(l, *ray_locate_begin(l, tri, x, y), x, y);
}

#endif
