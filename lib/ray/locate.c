#include "lib/ray/locate.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"

/* Counts: cells of the grid for each element, on average, and the most along an edge (16 MB for a
 * triangle). Few cells name splits, from where elements are looked for by steps; many do not fit in
 * the cache. Guesses. */
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

/* The barycentric weights of a node as affine functions of the weights (w1, w2) of the
 * whole triangle: weight c = a[c] + b[c] w1 + d[c] w2. */
struct weights {
	double a[3], b[3], d[3];
};

/* A table being made. */
struct filling {
	struct locator *l;
	struct weights *of;          /* [splits] */
	struct array stack;          /* int32_t nodes to visit */
};

/* The functions of a child from those of its parent, as model_locate halves weights. */
static void halve(struct weights *n, const struct split *s, int second)
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

/* The node of a split whose weights are known. */
static struct locator_node node_of(const struct split *s, const struct weights *w)
{
	int a = s->edge, b = a == 2 ? 0 : a + 1;

	return (struct locator_node){ (float)(w->a[a] - w->a[b]), (float)(w->b[a] - w->b[b]),
	                              (float)(w->d[a] - w->d[b]), { s->child[0], s->child[1] } };
}

/* Every node below a triangle's root. Children follow parents in no special order, so a
 * stack of nodes to visit is kept. */
static int fill_nodes(struct filling *f, uint32_t tri, struct err *e)
{
	struct locator *l = f->l;
	int32_t at = l->m->triangle.split[tri];

	if (at < 0)
		return 0;
	f->of[at] = (struct weights){ { 1, 0, 0 }, { -1, 1, 0 }, { -1, 0, 1 } };
	f->stack.n = 0;
	if (mem_append(&f->stack, &at, 1, sizeof at, e))
		return -1;
	while (f->stack.n) {
		at = ((int32_t *)f->stack.data)[--f->stack.n];
		const struct split *s = &l->m->split[at];
		l->node[at] = node_of(s, &f->of[at]);
		for (int k = 0; k < 2; k++) {
			if (s->child[k] < 0)
				continue;
			f->of[s->child[k]] = f->of[at];
			halve(&f->of[s->child[k]], s, k);
			if (mem_append(&f->stack, &s->child[k], 1, sizeof at, e))
				return -1;
		}
	}
	return 0;
}

/* A square of cells [i, i + size) x [j, j + size) of a triangle's grid of n x n, its corners a
 * little inwards: a power of two of cells, so that the long edge is a diagonal of it or
 * outside. Corners beyond the triangle do not count. */
struct square {
	uint32_t n, i, j, size;
};

/* The weights that the corners of a square have in a node. Returns how many there are. */
static int square_weights(const struct weights *f, const struct square *q, double w[4][3])
{
	const double in = 1e-6; /* of a cell: a guess, above rounding, below any element */
	int corners = 0;

	for (int k = 0; k < 4; k++) {
		double x = (q->i + (k & 1 ? q->size - in : in)) / q->n;
		double y = (q->j + (k >> 1 ? q->size - in : in)) / q->n;
		if (x + y > 1 + .5 / q->n)
			continue;
		for (int m = 0; m < 3; m++)
			w[corners][m] = f->a[m] + f->b[m] * x + f->d[m] * y;
		corners++;
	}
	return corners;
}

/* The deepest node below `at`, or the element, that holds all of a square: its corners go
 * down the tree together for as long as they agree. */
static int32_t square_node(const struct filling *f, int32_t at, const struct square *q)
{
	double w[4][3];
	int corners = square_weights(&f->of[at], q, w);

	while (at >= 0 && corners) {
		const struct split *s = &f->l->m->split[at];
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

/* Fills the cells of a square that lies in node `at`: a quarter at a time from the deepest
 * node that holds it. */
static void fill_square(const struct filling *f, int32_t *cell, int32_t at, struct square q)
{
	if (at >= 0)
		at = square_node(f, at, &q);
	if (at < 0 || q.size == 1) {
		for (uint32_t j = q.j; j < q.j + q.size; j++)
			for (uint32_t i = q.i; i < q.i + q.size; i++)
				cell[j * q.n + i] = at;
		return;
	}
	q.size /= 2;
	for (uint32_t k = 0; k < 4; k++)
		fill_square(f, cell, at, (struct square){ q.n, q.i + (k & 1) * q.size,
		                                          q.j + (k >> 1) * q.size, q.size });
}

static int fill(struct locator *l, struct err *e)
{
	struct filling f = { .l = l, .of = mem_new(l->m->splits, sizeof *f.of, "element lookup", e) };
	int bad = !f.of;

	for (uint32_t t = 0; !bad && t < l->m->triangle.n; t++) {
		if (l->root[t] < 0)
			continue;
		const struct locator_grid *g = &l->grid[l->root[t]];
		bad = fill_nodes(&f, t, e);
		if (!bad)
			fill_square(&f, l->cell + g->first, l->m->triangle.split[t],
			            (struct square){ g->size, 0, 0, g->size });
	}
	free(f.of);
	free(f.stack.data);
	return bad;
}

/* Grids of the subdivided triangles; the others name their element. */
static int lay_grids(struct locator *l, uint64_t *cells, struct err *e)
{
	const struct model *m = l->m;
	uint32_t *elements = mem_new(m->triangle.n, sizeof *elements, "element lookup", e);
	size_t grids = 0;

	for (size_t i = 0; elements && i < m->element.n; i++)
		grids += elements[m->element.triangle[i]]++ == 1;
	l->grid = mem_new(grids, sizeof *l->grid, "element lookup", e);
	*cells = grids = 0;
	for (size_t t = 0; elements && l->grid && t < m->triangle.n; t++) {
		uint32_t n = grid_size(elements[t]);
		l->root[t] = n ? (int32_t)grids : m->triangle.split[t];
		if (!n)
			continue;
		l->grid[grids++] = (struct locator_grid){ *cells, n };
		*cells += (uint64_t)n * n;
	}
	free(elements);
	return elements && l->grid ? 0 : -1;
}

int ray_locator_init(struct locator *l, const struct model *m, struct err *e)
{
	uint64_t cells;

	*l = (struct locator){ .m = m };
	l->root = mem_new(m->triangle.n, sizeof *l->root, "element lookup", e);
	l->node = mem_new(m->splits, sizeof *l->node, "element lookup", e);
	if (!l->root || !l->node || lay_grids(l, &cells, e))
		return -1;
	l->cell = mem_new(cells, sizeof *l->cell, "element lookup", e);
	return l->cell ? fill(l, e) : -1;
}

void ray_locator_free(struct locator *l)
{
	free(l->root);
	free(l->grid);
	free(l->cell);
	free(l->node);
	*l = (struct locator){ 0 };
}
