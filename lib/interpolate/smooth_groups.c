#include "lib/interpolate/smooth_groups.h"

#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"

/* An edge at a vertex, seen from a corner there. */
struct spoke {
	uint64_t edge;            /* its surface, then its far end */
	uint32_t corner;
};

struct builder {
	const struct model *m;
	double cos_crease;
	uint32_t *start, *corner; /* corners by vertex */
	uint32_t *parent;         /* union-find over corners */
	struct spoke *spoke;      /* [2 valence] */
};

static uint32_t root(uint32_t *parent, uint32_t c)
{
	while (parent[c] != c) {
		parent[c] = parent[parent[c]];
		c = parent[c];
	}
	return c;
}

/* The lower corner becomes the root, so the outcome does not depend on order. */
static void join(uint32_t *parent, uint32_t a, uint32_t b)
{
	a = root(parent, a);
	b = root(parent, b);
	if (a < b)
		parent[b] = a;
	else
		parent[a] = b;
}

/* start[v], corner[]: counting sort of the corners by vertex. */
static uint32_t sort_corners(struct builder *b)
{
	const struct model *m = b->m;
	size_t n = 3 * m->element.n;
	uint32_t most = 0;

	for (size_t i = 0; i < n; i++)
		b->start[m->element.corner[i] + 1]++;
	for (size_t v = 0; v < m->vertices; v++) {
		if (b->start[v + 1] > most)
			most = b->start[v + 1];
		b->start[v + 1] += b->start[v];
	}
	for (size_t i = n; i-- > 0;) /* backwards: fills each vertex from its end */
		b->corner[--b->start[m->element.corner[i] + 1]] = (uint32_t)i;
	for (size_t v = 0; v < m->vertices; v++)
		b->start[v] = b->start[v + 1];
	b->start[m->vertices] = (uint32_t)n;
	return most;
}

static int is_after(const struct spoke *a, const struct spoke *b)
{
	return a->edge > b->edge || (a->edge == b->edge && a->corner > b->corner);
}

static int compare_spokes(const void *a, const void *b)
{
	return is_after(a, b) - is_after(b, a);
}

/* Nearly always a dozen: then by insertion, which is faster for few (32: a guess). */
static void sort_spokes(struct spoke *spoke, size_t n)
{
	enum { FEW = 32 };

	if (n > FEW) {
		qsort(spoke, n, sizeof *spoke, compare_spokes);
		return;
	}
	for (size_t i = 1; i < n; i++) {
		struct spoke s = spoke[i];
		size_t at = i;
		for (; at > 0 && is_after(&spoke[at - 1], &s); at--)
			spoke[at] = spoke[at - 1];
		spoke[at] = s;
	}
}

static int is_smooth(const struct builder *b, uint32_t c, uint32_t d)
{
	const double *n = b->m->element.normal;
	return v3_dot(&n[3 * (size_t)(c / 3)], &n[3 * (size_t)(d / 3)]) > b->cos_crease;
}

/* Joins what is smooth across each edge at vertex v. More than a few elements at
 * one edge (8: a guess) are not a surface: each is compared with the preceding ones only. */
static void join_at_vertex(struct builder *b, size_t v)
{
	enum { SHEETS = 8 };
	const struct model *m = b->m;
	size_t n = 0;

	for (uint32_t i = b->start[v]; i < b->start[v + 1]; i++) {
		uint32_t c = b->corner[i], first = c - c % 3;
		uint64_t surface = m->patch.surface[m->element.patch[c / 3]];
		for (uint32_t k = 1; k < 3; k++)
			b->spoke[n++] = (struct spoke){
				surface << 32 | m->element.corner[first + (c + k - first) % 3], c };
	}
	sort_spokes(b->spoke, n);
	for (size_t i = 1; i < n; i++)
		for (size_t j = i; j-- > 0 && i - j <= SHEETS;) {
			if (b->spoke[j].edge != b->spoke[i].edge)
				break;
			if (is_smooth(b, b->spoke[j].corner, b->spoke[i].corner))
				join(b->parent, b->spoke[j].corner, b->spoke[i].corner);
		}
}

/* Numbers the roots and sorts the corners by group. */
static int collect(struct builder *b, struct smooth_groups *g, struct err *e)
{
	size_t n = 3 * b->m->element.n;

	for (size_t i = 0; i < n; i++) {
		uint32_t r = root(b->parent, (uint32_t)i);
		g->group[i] = r == i ? (uint32_t)g->groups++ : g->group[r];
	}
	g->start = mem_new(g->groups + 2, sizeof *g->start, "smooth groups", e);
	if (!g->start)
		return -1;
	for (size_t i = 0; i < n; i++)
		g->start[g->group[i] + 2]++;
	for (size_t i = 0; i < g->groups; i++)
		g->start[i + 2] += g->start[i + 1];
	for (size_t i = 0; i < n; i++)
		g->corner[g->start[g->group[i] + 1]++] = (uint32_t)i;
	return 0;
}

int interp_smooth_groups_new(const struct model *m, double cos_crease, struct smooth_groups *g,
                             struct err *e)
{
	struct builder b = { .m = m, .cos_crease = cos_crease };
	size_t n = 3 * m->element.n;
	int bad = -1;

	*g = (struct smooth_groups){ 0 };
	if (m->element.n > (UINT32_MAX - 2) / 3)
		return err_set(e, "%zu elements are too many to interpolate", m->element.n);
	b.start = mem_new(m->vertices + 2, sizeof *b.start, "corners by vertex", e);
	b.corner = mem_new(n, sizeof *b.corner, "corners by vertex", e);
	b.parent = mem_new(n, sizeof *b.parent, "smooth groups", e);
	g->group = mem_new(n, sizeof *g->group, "smooth groups", e);
	g->corner = mem_new(n, sizeof *g->corner, "smooth groups", e);
	if (b.start && b.corner && b.parent && g->group && g->corner)
		b.spoke = mem_new(2 * (size_t)sort_corners(&b), sizeof *b.spoke, "edges", e);
	if (b.spoke) {
		for (size_t i = 0; i < n; i++)
			b.parent[i] = (uint32_t)i;
		for (size_t v = 0; v < m->vertices; v++)
			join_at_vertex(&b, v);
		bad = collect(&b, g, e);
	}
	free(b.start);
	free(b.corner);
	free(b.parent);
	free(b.spoke);
	if (bad)
		interp_smooth_groups_free(g);
	return bad;
}

void interp_smooth_groups_free(struct smooth_groups *g)
{
	free(g->group);
	free(g->start);
	free(g->corner);
	*g = (struct smooth_groups){ 0 };
}
