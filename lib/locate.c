#include "locate.h"

#include <stdlib.h>
#include <string.h>

#include "mem.h"

enum { CELLS_AN_ELEMENT = 16, SIZE_MAX_CELLS = 2048 };

/* Cells along an edge of a triangle of k elements: a power of two, so that the
 * bisections' edges fall on cells' edges. The triangle covers half of the square. */
static uint32_t grid_size(uint32_t k)
{
	uint32_t n = 1;

	if (k <= 1)
		return 0;
	while (n < SIZE_MAX_CELLS && (uint64_t)n * n < 2 * (uint64_t)k * CELLS_AN_ELEMENT)
		n *= 2;
	return n;
}

/* The functions of a child from those of its parent, as model_locate halves weights. */
static void halve(struct locator_node *n, const struct split *s, int second)
{
	int a = s->edge, b = a == 2 ? 0 : a + 1;
	int keep = second ? b : a, twice = second ? a : b;

	n->a[keep] -= n->a[twice];
	n->b[keep] -= n->b[twice];
	n->d[keep] -= n->d[twice];
	n->a[twice] *= 2;
	n->b[twice] *= 2;
	n->d[twice] *= 2;
}

/* The functions of every node below a triangle's root. Children follow parents in no
 * special order, so a stack of nodes to visit is kept. */
static int fill_nodes(struct locator *l, struct vec *stack, uint32_t tri, struct err *e)
{
	int32_t at = l->m->triangle_split[tri];

	if (at < 0)
		return 0;
	l->node[at] = (struct locator_node){ { 1, 0, 0 }, { -1, 1, 0 }, { -1, 0, 1 } };
	stack->n = 0;
	if (vec_append(stack, &at, 1, sizeof at, e))
		return -1;
	while (stack->n) {
		at = ((int32_t *)stack->data)[--stack->n];
		const struct split *s = &l->m->split[at];
		for (int k = 0; k < 2; k++) {
			if (s->child[k] < 0)
				continue;
			l->node[s->child[k]] = l->node[at];
			halve(&l->node[s->child[k]], s, k);
			if (vec_append(stack, &s->child[k], 1, sizeof at, e))
				return -1;
		}
	}
	return 0;
}

/* The deepest node, or the element, that holds all of a cell: its corners, a little
 * inwards, go down the tree together for as long as they agree. Corners beyond the
 * triangle do not count. */
static int32_t cell_node(const struct model *m, uint32_t tri, uint32_t n, uint32_t i, uint32_t j)
{
	const double in = 1e-6;
	double w[4][3];
	int32_t at = m->triangle_split[tri];
	int corners = 0;

	for (int k = 0; k < 4; k++) {
		double x = (i + (k & 1 ? 1 - in : in)) / n, y = (j + (k >> 1 ? 1 - in : in)) / n;
		if (x + y > 1)
			continue;
		w[corners][0] = 1 - x - y;
		w[corners][1] = x;
		w[corners++][2] = y;
	}
	while (at >= 0 && corners) {
		const struct split *s = &m->split[at];
		int a = s->edge, b = a == 2 ? 0 : a + 1, second = w[0][a] < w[0][b];
		for (int k = 1; k < corners; k++)
			if ((w[k][a] < w[k][b]) != second)
				return at;
		for (int k = 0; k < corners; k++) {
			int keep = second ? b : a, twice = second ? a : b;
			w[k][keep] -= w[k][twice];
			w[k][twice] *= 2;
		}
		at = s->child[second];
	}
	return at;
}

static int fill(struct locator *l, struct err *e)
{
	struct vec stack = { 0 };
	int bad = 0;

	for (uint32_t t = 0; !bad && t < l->m->triangles; t++) {
		if (l->root[t] < 0)
			continue;
		const struct locator_grid *g = &l->grid[l->root[t]];
		bad = fill_nodes(l, &stack, t, e);
		for (uint32_t k = 0; !bad && k < g->size * g->size; k++)
			l->cell[g->first + k] = cell_node(l->m, t, g->size, k % g->size, k / g->size);
	}
	free(stack.data);
	return bad;
}

/* Grids of the subdivided triangles; the others name their element. */
static int lay_grids(struct locator *l, uint64_t *cells, struct err *e)
{
	const struct model *m = l->m;
	uint32_t *elements = mem_new(m->triangles, sizeof *elements, "element lookup", e);
	size_t grids = 0;

	for (size_t i = 0; elements && i < m->elements; i++)
		grids += elements[m->element_triangle[i]]++ == 1;
	l->grid = mem_new(grids, sizeof *l->grid, "element lookup", e);
	*cells = grids = 0;
	for (size_t t = 0; elements && l->grid && t < m->triangles; t++) {
		uint32_t n = grid_size(elements[t]);
		l->root[t] = n ? (int32_t)grids : m->triangle_split[t];
		if (!n)
			continue;
		l->grid[grids++] = (struct locator_grid){ *cells, n };
		*cells += (uint64_t)n * n;
	}
	free(elements);
	return elements && l->grid ? 0 : -1;
}

int locator_init(struct locator *l, const struct model *m, struct err *e)
{
	uint64_t cells;

	*l = (struct locator){ .m = m };
	l->root = mem_new(m->triangles, sizeof *l->root, "element lookup", e);
	l->node = mem_new(m->splits, sizeof *l->node, "element lookup", e);
	if (!l->root || !l->node || lay_grids(l, &cells, e))
		return -1;
	l->cell = mem_new(cells, sizeof *l->cell, "element lookup", e);
	return l->cell ? fill(l, e) : -1;
}

void locator_free(struct locator *l)
{
	free(l->root);
	free(l->grid);
	free(l->cell);
	free(l->node);
	*l = (struct locator){ 0 };
}
