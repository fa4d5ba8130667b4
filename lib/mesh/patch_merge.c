/* Merging: cutting along planes leaves crumbs where a region is curved or crooked.
 * The smallest patch joins the neighbour with which it shares most border, as long
 * as that makes neither too large nor too curved a patch; then the next smallest. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/mesh/stages.h"

#define NONE UINT32_MAX

/* Uses of an edge beyond which it makes no neighbours: so many coincident edges are of a heap of
 * things rather than of a surface, and comparing all is quadratic. A count; a guess. */
enum { CROWD = 8 };

/* Rounding, as ratios: of a cosine, and of a length against the patch size. */
static const double cosine_slack = 1e-9, length_slack = 1e-6;

struct group {
	double lo[3], hi[3];     /* in the region's frame */
	double normal[3];        /* summed area vectors */
	double area;             /* coarse */
	uint64_t name;           /* from its vertices: orders equals, whatever the
	                            order of the triangles */
	uint32_t region, first;  /* first element of its list, NONE: merged away */
	uint32_t last, version;
};

/* A group as it was when it was queued. */
struct entry {
	double area;
	uint64_t name;
	uint32_t group, version;
};

struct border {
	double length;
	uint64_t name;
	uint32_t group;
};

struct merger {
	const struct division *d;
	uint32_t *patch;         /* [elements] the group */
	uint32_t *next;          /* [elements] lists of groups */
	struct group *group;
	struct array heap, border;
	struct err *e;
};

static int lower(double a, uint64_t name_a, double b, uint64_t name_b)
{
	return a != b ? a < b : name_a < name_b;
}

static int entry_before(const struct entry *a, const struct entry *b)
{
	return lower(a->area, a->name, b->area, b->name);
}

static int queue_group(struct merger *g, uint32_t i)
{
	struct entry new = { g->group[i].area, g->group[i].name, i, g->group[i].version };

	if (mem_append(&g->heap, &new, 1, sizeof new, g->e))
		return -1;
	struct entry *h = g->heap.data;
	size_t at = g->heap.n - 1;
	for (; at > 0 && entry_before(&new, &h[(at - 1) / 2]); at = (at - 1) / 2)
		h[at] = h[(at - 1) / 2];
	h[at] = new;
	return 0;
}

static struct entry take_smallest(struct merger *g)
{
	struct entry *h = g->heap.data, top = h[0], last = h[--g->heap.n];
	size_t n = g->heap.n, at = 0, child;

	while ((child = 2 * at + 1) < n) {
		if (child + 1 < n && entry_before(&h[child + 1], &h[child]))
			child++;
		if (!entry_before(&h[child], &last))
			break;
		h[at] = h[child];
		at = child;
	}
	h[at] = last;
	return top;
}

/* The same for an element whatever its number and first corner. */
static uint64_t element_name(const uint32_t *c)
{
	uint32_t lo = c[0] < c[1] ? c[0] : c[1], hi = c[0] < c[1] ? c[1] : c[0];

	lo = c[2] < lo ? c[2] : lo;
	hi = c[2] > hi ? c[2] : hi;
	uint32_t middle = c[0] + c[1] + c[2] - lo - hi;
	return rng_mix(rng_mix((uint64_t)lo << 32 | hi) ^ middle);
}

static void add_element(struct merger *g, uint32_t element)
{
	const struct division *d = g->d;
	struct group *to = &g->group[g->patch[element]];
	uint64_t name = element_name(&d->m->element.corner[3 * (size_t)element]);

	g->next[element] = NONE;
	if (to->first == NONE) {
		to->first = element;
		to->name = name;
		to->region = d->element_region[element];
	} else {
		g->next[to->last] = element;
		to->name = name < to->name ? name : to->name;
	}
	to->last = element;
	to->area += v3_length(&d->area[3 * (size_t)element]);
	v3_mad(to->normal, 1, &d->area[3 * (size_t)element], to->normal);
	for (int k = 0; k < 3; k++) {
		double lo, hi;
		mesh_division_extent(d, element, d->region[to->region].axis[k], &lo, &hi);
		to->lo[k] = fmin(to->lo[k], lo);
		to->hi[k] = fmax(to->hi[k], hi);
	}
}

static int make_groups(struct merger *g, size_t count)
{
	for (size_t i = 0; i < count; i++)
		g->group[i] = (struct group){ .lo = { INFINITY, INFINITY, INFINITY },
			                      .hi = { -INFINITY, -INFINITY, -INFINITY },
			                      .first = NONE };
	for (uint32_t i = 0; i < g->d->m->element.n; i++)
		add_element(g, i);
	for (uint32_t i = 0; i < count; i++) {
		g->group[i].area = coarse(g->group[i].area);
		if (queue_group(g, i))
			return -1;
	}
	return 0;
}

static int add_border(struct merger *g, uint32_t group, double length)
{
	struct border new = { length, g->group[group].name, group }, *b = g->border.data;

	for (size_t i = 0; i < g->border.n; i++)
		if (b[i].group == group) {
			b[i].length += length;
			return 0;
		}
	return mem_append(&g->border, &new, 1, sizeof new, g->e);
}

static int compare_borders(const void *pa, const void *pb)
{
	const struct border *a = pa, *b = pb;

	if (lower(b->length, b->name, a->length, a->name))
		return -1;
	return lower(a->length, a->name, b->length, b->name);
}

/* The neighbours of a group in its region, those with the longest border first. */
static int find_borders(struct merger *g, uint32_t group)
{
	const struct half_edges *edges = &g->d->g;
	const struct model *m = g->d->m;

	g->border.n = 0;
	for (uint32_t i = g->group[group].first; i != NONE; i = g->next[i])
		for (uint32_t h = 3 * i; h < 3 * i + 3; h++) {
			uint32_t begin = edges->start[edges->of[h]];
			uint32_t end = edges->start[edges->of[h] + 1];
			double d[3];
			v3_sub(&m->vertex[3 * (size_t)geo_half_edge_to(m->element.corner, h)],
			       &m->vertex[3 * (size_t)geo_half_edge_from(m->element.corner, h)], d);
			for (uint32_t u = begin; u < end && end - begin <= CROWD; u++) {
				uint32_t other = g->patch[edges->use[u] / 3];
				if (other != group &&
				    g->group[other].region == g->group[group].region &&
				    add_border(g, other, v3_length(d)))
					return -1;
			}
		}
	struct border *b = g->border.data;
	for (size_t i = 0; i < g->border.n; i++)
		b[i].length = coarse(b[i].length);
	if (g->border.n > 1)
		qsort(b, g->border.n, sizeof *b, compare_borders);
	return 0;
}

/* Are all normals of the group within the cone about n? */
static int within_cone(const struct merger *g, const struct group *a, const double n[3])
{
	double bound = (g->d->cos_cone - cosine_slack) * v3_length(n);

	for (uint32_t i = a->first; i != NONE; i = g->next[i]) {
		const double *area = &g->d->area[3 * (size_t)i];
		if (!(v3_dot(area, n) >= bound * v3_length(area)))
			return 0;
	}
	return 1;
}

/* May a join b? Their box must not be longer than a patch, or than b is already. */
static int fits(const struct merger *g, const struct group *a, const struct group *b)
{
	double n[3];

	for (int k = 0; k < 3; k++) {
		double length = fmax(a->hi[k], b->hi[k]) - fmin(a->lo[k], b->lo[k]);
		if (length > fmax(g->d->size, b->hi[k] - b->lo[k]) * (1 + length_slack))
			return 0;
	}
	v3_mad(a->normal, 1, b->normal, n);
	return within_cone(g, a, n) && within_cone(g, b, n);
}

/* Group i becomes part of group j. */
static int join(struct merger *g, uint32_t i, uint32_t j)
{
	struct group *a = &g->group[i], *b = &g->group[j];

	for (uint32_t t = a->first; t != NONE; t = g->next[t])
		g->patch[t] = j;
	g->next[b->last] = a->first;
	b->last = a->last;
	a->first = NONE;
	for (int k = 0; k < 3; k++) {
		b->lo[k] = fmin(a->lo[k], b->lo[k]);
		b->hi[k] = fmax(a->hi[k], b->hi[k]);
	}
	v3_mad(b->normal, 1, a->normal, b->normal);
	b->area = coarse(a->area + b->area);
	b->name = a->name < b->name ? a->name : b->name;
	b->version++;
	return queue_group(g, j);
}

static int merge_smallest(struct merger *g)
{
	struct entry top = take_smallest(g);

	if (g->group[top.group].version != top.version || g->group[top.group].first == NONE)
		return 0;
	if (find_borders(g, top.group))
		return -1;
	const struct border *b = g->border.data;
	for (size_t i = 0; i < g->border.n; i++)
		if (fits(g, &g->group[top.group], &g->group[b[i].group]))
			return join(g, top.group, b[i].group);
	return 0;
}

/* Numbers the groups that are left. */
static void renumber(struct merger *g, size_t *count)
{
	size_t left = 0;

	for (size_t i = 0; i < *count; i++)
		if (g->group[i].first != NONE)
			g->group[i].version = (uint32_t)left++;
	for (size_t i = 0; i < g->d->m->element.n; i++)
		g->patch[i] = g->group[g->patch[i]].version;
	*count = left;
}

int mesh_merge_patches(const struct division *d, uint32_t *patch, size_t *count, struct err *e)
{
	struct merger g = { .d = d, .patch = patch, .e = e };
	int status = -1;

	g.next = mem_new(d->m->element.n, sizeof *g.next, "patches", e);
	g.group = mem_new(*count, sizeof *g.group, "patches", e);
	if (!g.next || !g.group || make_groups(&g, *count))
		goto done;
	status = 0;
	while (!status && g.heap.n)
		status = merge_smallest(&g);
	if (!status)
		renumber(&g, count);
done:
	free(g.next);
	free(g.group);
	free(g.heap.data);
	free(g.border.data);
	return status;
}
