/* Points that are one, found through a grid of cells a few tolerances wide. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/rng.h"
#include "lib/geometry/weld.h"

#define NOBODY UINT32_MAX

/* Side of a cell, in tolerances: wider cells hold more points to compare, narrower ones make
 * more points look into several. A guess; the result does not depend on it. */
enum { CELL = 8 };

/* The points that stand for their likes, chained by hash bucket. */
struct grid {
	const struct weld *w;
	size_t buckets;      /* a power of two */
	uint32_t *head;      /* [buckets] */
	uint32_t *next;      /* [points] */
	uint8_t *exact;      /* [points] 1: needs bitwise equality */
	uint32_t *leader;    /* [points] lowest point that stands for each */
};

static void cell_of(const struct grid *g, uint32_t point, double shift, int64_t cell[2][3])
{
	double size = CELL * g->w->tolerance[g->w->group[point]];

	for (int k = 0; k < 3; k++) {
		double x = g->w->at[3 * (size_t)point + (size_t)k];
		cell[0][k] = size > 0 ? (int64_t)floor((x - shift * size) / size) : 0;
		cell[1][k] = size > 0 ? (int64_t)floor((x + shift * size) / size) : 0;
	}
}

static size_t bucket(const struct grid *g, uint32_t group, const int64_t cell[3])
{
	uint64_t x = rng_mix(group);

	for (int k = 0; k < 3; k++)
		x = rng_mix(x ^ (uint64_t)cell[k]);
	return (size_t)x & (g->buckets - 1);
}

static int same_place(const struct grid *g, uint32_t i, uint32_t j)
{
	const double *a = &g->w->at[3 * (size_t)i], *b = &g->w->at[3 * (size_t)j];
	double tolerance = g->w->tolerance[g->w->group[i]];

	if (g->w->group[i] != g->w->group[j])
		return 0;
	if (a[0] == b[0] && a[1] == b[1] && a[2] == b[2])
		return 1;
	return !g->exact[i] && fabs(a[0] - b[0]) <= tolerance &&
	       fabs(a[1] - b[1]) <= tolerance && fabs(a[2] - b[2]) <= tolerance;
}

/* The lowest leader within reach of point i, or NOBODY. */
static uint32_t find_leader(const struct grid *g, uint32_t i)
{
	int64_t reach[2][3];
	uint32_t best = NOBODY;

	cell_of(g, i, 1. / CELL, reach);
	for (int corner = 0; corner < 8; corner++) {
		int64_t cell[3];
		int seen = 0;
		for (int k = 0; k < 3; k++) {
			int high = corner >> k & 1;
			seen |= high && reach[1][k] == reach[0][k];
			cell[k] = reach[high][k];
		}
		if (seen)
			continue;
		uint32_t j = g->head[bucket(g, g->w->group[i], cell)];
		for (; j != NOBODY; j = g->next[j])
			if (j < best && same_place(g, i, j))
				best = j;
	}
	return best;
}

static void choose_leaders(struct grid *g)
{
	memset(g->head, 0xff, g->buckets * sizeof *g->head);
	for (uint32_t i = 0; i < g->w->points; i++) {
		g->leader[i] = find_leader(g, i);
		if (g->leader[i] != NOBODY)
			continue;
		int64_t cell[2][3];
		cell_of(g, i, 0, cell);
		uint32_t *head = &g->head[bucket(g, g->w->group[i], cell[0])];
		g->leader[i] = i;
		g->next[i] = *head;
		*head = i;
	}
}

/* Marks the corners of collapsed triangles; returns how many became marked. */
static size_t protect_triangles(struct grid *g)
{
	size_t marked = 0;

	for (size_t t = 0; t < g->w->triangles; t++) {
		const uint32_t *c = &g->w->triangle[3 * t];
		uint32_t a = g->leader[c[0]], b = g->leader[c[1]], d = g->leader[c[2]];
		if (a != b && b != d && d != a)
			continue;
		for (int k = 0; k < 3; k++) {
			marked += !g->exact[c[k]];
			g->exact[c[k]] = 1;
		}
	}
	return marked;
}

int geo_weld_points(const struct weld *w, uint32_t *id, size_t *count, struct err *e)
{
	int status = -1;
	struct grid g = { .w = w, .buckets = 16 };

	while (g.buckets < 2 * w->points)
		g.buckets *= 2;
	g.head = mem_new(g.buckets, sizeof *g.head, "welding", e);
	g.next = mem_new(w->points, sizeof *g.next, "welding", e);
	g.exact = mem_new(w->points, 1, "welding", e);
	g.leader = mem_new(w->points, sizeof *g.leader, "welding", e);
	if (!g.head || !g.next || !g.exact || !g.leader)
		goto done;
	do
		choose_leaders(&g);
	while (protect_triangles(&g));
	*count = 0;
	for (size_t i = 0; i < w->points; i++)
		id[i] = g.leader[i] == i ? (uint32_t)(*count)++ : id[g.leader[i]];
	status = 0;
done:
	free(g.head);
	free(g.next);
	free(g.exact);
	free(g.leader);
	return status;
}

double geo_weld_tolerance(const double lo[3], const double hi[3])
{
	double diagonal = 0, largest = 0;

	for (int k = 0; k < 3; k++) {
		diagonal = hypot(diagonal, hi[k] - lo[k]);
		largest = fmax(largest, fmax(fabs(lo[k]), fabs(hi[k])));
	}
	return fmax(1e-9 * diagonal, 0x1p-50 * largest);
}
