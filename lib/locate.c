#include "locate.h"

#include <stdlib.h>
#include <string.h>

#include "mem.h"

enum { CELLS_AN_ELEMENT = 6, SIZE_MAX_CELLS = 2048 };

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

/* The element at a corner of a cell, moved a little towards the cell's centre. */
static uint32_t corner(const struct model *m, uint32_t tri, uint32_t n, double x, double y)
{
	double w[3] = { 1 - (x + y) / n, x / n, y / n };

	return w[0] < 0 ? UINT32_MAX : model_locate(m, tri, w);
}

/* Elements are convex, so a cell whose corners lie in one element lies in it. */
static uint32_t cell_element(const struct model *m, uint32_t tri, uint32_t n, uint32_t i,
                             uint32_t j)
{
	const double in = 1e-6;
	double x[2] = { i + in, i + 1 - in }, y[2] = { j + in, j + 1 - in };
	uint32_t first = corner(m, tri, n, x[0], y[0]);

	for (int k = 1; k < 4 && first != UINT32_MAX; k++)
		if (corner(m, tri, n, x[k & 1], y[k >> 1]) != first)
			first = UINT32_MAX;
	return first;
}

int locator_init(struct locator *l, const struct model *m, struct err *e)
{
	uint64_t cells = 0;

	*l = (struct locator){ .m = m };
	l->first = mem_new(m->triangles, sizeof *l->first, "element lookup", e);
	l->size = mem_new(m->triangles, sizeof *l->size, "element lookup", e);
	if (!l->first || !l->size)
		return -1;
	for (size_t i = 0; i < m->elements; i++)
		l->size[m->element_triangle[i]]++;
	for (size_t t = 0; t < m->triangles; t++) {
		l->size[t] = grid_size(l->size[t]);
		l->first[t] = cells;
		cells += (uint64_t)l->size[t] * l->size[t];
	}
	if (!(l->cell = mem_new(cells, sizeof *l->cell, "element lookup", e)))
		return -1;
	for (uint32_t t = 0; t < m->triangles; t++)
		for (uint32_t k = 0, n = l->size[t]; k < n * n; k++)
			l->cell[l->first[t] + k] = cell_element(m, t, n, k % n, k / n);
	return 0;
}

void locator_free(struct locator *l)
{
	free(l->first);
	free(l->size);
	free(l->cell);
	*l = (struct locator){ 0 };
}
