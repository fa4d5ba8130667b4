/* Is the scene watertight? Edges by position, over all surfaces. */
#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/geometry/half_edge.h"
#include "lib/mesh/stages.h"

/* Neighbours in one surface should run along their shared edge in opposite ways. */
static int count_opposite(const struct model *m, struct mesh_report *r, struct err *e)
{
	struct half_edges g;

	if (geo_half_edges_build(&g, m->triangle.corner, m->triangle.n, m->vertices, e))
		return -1;
	for (size_t i = 0; i < g.n; i++) {
		uint32_t a = g.use[g.start[i]], b = g.use[g.start[i + 1] - 1];
		uint32_t s = m->triangle.surface[a / 3];
		if (g.start[i + 1] - g.start[i] != 2 ||
		    geo_half_edge_from(m->triangle.corner, a) !=
		    geo_half_edge_from(m->triangle.corner, b))
			continue;
		r->total.opposite++;
		if (s < r->surfaces)
			r->surface[s].opposite++;
	}
	geo_half_edges_free(&g);
	return 0;
}

/* Joins the triangles of each edge and notes those whose edges are not whole. */
static void walk_edges(const struct half_edges *g, uint32_t *piece, uint8_t *open,
                       struct mesh_report *r)
{
	for (size_t i = 0; i < g->n; i++) {
		uint32_t begin = g->start[i], end = g->start[i + 1];
		r->open_edges += end - begin == 1;
		r->crowded_edges += end - begin > 2;
		for (uint32_t u = begin; u < end; u++) {
			geo_sets_join(piece, g->use[begin] / 3, g->use[u] / 3);
			open[g->use[u] / 3] |= end - begin != 2;
		}
	}
}

int mesh_check_watertight(const struct model *m, const uint32_t *position, size_t places,
                          struct mesh_report *r, struct err *e)
{
	int status = -1;
	size_t n = m->triangle.n;
	struct half_edges g = { 0 };
	uint32_t *corner = mem_new(3 * n, sizeof *corner, "pieces", e);
	uint32_t *piece = geo_sets_new(n, e);
	uint8_t *open = mem_new(n, 1, "pieces", e);

	if (!corner || !piece || !open || count_opposite(m, r, e))
		goto done;
	for (size_t i = 0; i < 3 * n; i++)
		corner[i] = position[m->triangle.corner[i]];
	if (geo_half_edges_build(&g, corner, n, places, e))
		goto done;
	walk_edges(&g, piece, open, r);
	for (uint32_t t = 0; t < n; t++)
		open[geo_sets_find(piece, t)] |= open[t];
	for (uint32_t t = 0; t < n; t++)
		if (piece[t] == t) {
			r->components++;
			r->closed_components += !open[t];
		}
	status = 0;
done:
	geo_half_edges_free(&g);
	free(corner);
	free(piece);
	free(open);
	return status;
}
