#include "lib/geometry/half_edge.h"

#include <stdlib.h>

#include "lib/base/mem.h"

/* A half-edge waiting to be matched, filed under its lower vertex. */
struct spoke {
	uint32_t high, half;
};

static int compare_spokes(const void *pa, const void *pb)
{
	const struct spoke *a = pa, *b = pb;

	if (a->high != b->high)
		return a->high < b->high ? -1 : 1;
	return a->half < b->half ? -1 : a->half > b->half;
}

static uint32_t lower_end(const uint32_t *triangle, uint32_t h)
{
	uint32_t a = geo_half_edge_from(triangle, h), b = geo_half_edge_to(triangle, h);
	return a < b ? a : b;
}

/* Files all half-edges under their lower vertices: fills first[vertices+1]. */
static void file_spokes(const uint32_t *triangle, size_t halves, size_t vertices,
                        uint32_t *first, struct spoke *spoke)
{
	for (uint32_t h = 0; h < halves; h++)
		first[lower_end(triangle, h) + 1]++;
	for (size_t v = 0; v < vertices; v++)
		first[v + 1] += first[v];
	for (uint32_t h = 0; h < halves; h++) {
		uint32_t a = geo_half_edge_from(triangle, h), b = geo_half_edge_to(triangle, h);
		uint32_t *at = &first[a < b ? a : b];
		spoke[(*at)++] = (struct spoke){ a < b ? b : a, h };
	}
	/* Filling moved every beginning to the next one's place. */
	for (size_t v = vertices; v > 0; v--)
		first[v] = first[v - 1];
	first[0] = 0;
}

static void number_edges(struct half_edges *g, struct spoke *spoke, const uint32_t *first,
                         size_t vertices)
{
	for (size_t v = 0; v < vertices; v++) {
		uint32_t begin = first[v], end = first[v + 1];
		qsort(spoke + begin, end - begin, sizeof *spoke, compare_spokes);
		for (uint32_t i = begin; i < end; i++) {
			if (i == begin || spoke[i].high != spoke[i - 1].high)
				g->start[g->n++] = i;
			g->of[spoke[i].half] = (uint32_t)(g->n - 1);
			g->use[i] = spoke[i].half;
		}
	}
}

int geo_half_edges_build(struct half_edges *g, const uint32_t *triangle, size_t triangles,
                         size_t vertices, struct err *e)
{
	int status = -1;
	uint32_t *first = NULL;
	struct spoke *spoke = NULL;

	*g = (struct half_edges){ 0 };
	if (triangles > UINT32_MAX / 3)
		return err_set(e, "%zu triangles are too many: at most %u", triangles,
		               UINT32_MAX / 3);
	first = mem_new(vertices + 1, sizeof *first, "edges", e);
	spoke = mem_new(3 * triangles, sizeof *spoke, "edges", e);
	g->of = mem_new(3 * triangles, sizeof *g->of, "edges", e);
	g->use = mem_new(3 * triangles, sizeof *g->use, "edges", e);
	g->start = mem_new(3 * triangles + 1, sizeof *g->start, "edges", e);
	if (!first || !spoke || !g->of || !g->use || !g->start)
		goto done;
	file_spokes(triangle, 3 * triangles, vertices, first, spoke);
	number_edges(g, spoke, first, vertices);
	g->start[g->n] = (uint32_t)(3 * triangles);
	status = 0;
done:
	free(first);
	free(spoke);
	if (status)
		geo_half_edges_free(g);
	return status;
}

void geo_half_edges_free(struct half_edges *g)
{
	free(g->of);
	free(g->start);
	free(g->use);
	*g = (struct half_edges){ 0 };
}

uint32_t *geo_sets_new(size_t n, struct err *e)
{
	uint32_t *set = mem_new(n, sizeof *set, "sets", e);

	for (size_t i = 0; set && i < n; i++)
		set[i] = (uint32_t)i;
	return set;
}
