/* Numbering along a Morton curve: every cube of the octree over the
 * scene's box is a contiguous range of patches, and of elements. */
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/geometry/morton.h"
#include "lib/mesh/stages.h"

struct place {
	uint64_t code;      /* Morton code of the centroid */
	uint32_t patch;     /* new number */
	uint32_t old;       /* old number of the patch or element */
};

static struct morton_curve scene_curve(const struct model *m)
{
	double lo[3], hi[3];

	model_box(m, lo, hi);
	return geo_morton_curve(lo, hi);
}

static int compare_places(const void *pa, const void *pb)
{
	const struct place *a = pa, *b = pb;

	if (a->patch != b->patch)
		return a->patch < b->patch ? -1 : 1;
	if (a->code != b->code)
		return a->code < b->code ? -1 : 1;
	return a->old < b->old ? -1 : a->old > b->old;
}

/* Centroid of an element relative to the centre; returns its area. */
static double centroid(const struct model *m, const struct morton_curve *c, size_t element,
                       double x[3])
{
	const uint32_t *v = &m->element.corner[3 * element];
	double a[3];

	x[0] = x[1] = x[2] = 0;
	for (int k = 0; k < 3; k++) {
		v3_sub(&m->vertex[3 * (size_t)v[k]], c->centre, a);
		v3_mad(x, 1. / 3, a, x);
	}
	v3_area(&m->vertex[3 * (size_t)v[0]], &m->vertex[3 * (size_t)v[1]],
	        &m->vertex[3 * (size_t)v[2]], a);
	return v3_length(a);
}

/* rank[old patch] = new patch, by the code of its centroid. */
static int rank_patches(const struct model *m, const struct morton_curve *c, const uint32_t *patch,
                        size_t patches, uint32_t *rank, struct err *e)
{
	struct place *place = mem_new(patches, sizeof *place, "patches", e);
	double *sum = mem_new(patches, 4 * sizeof *sum, "patches", e);

	for (size_t i = 0; place && sum && i < m->element.n; i++) {
		double x[3], area = centroid(m, c, i, x), *s = &sum[4 * (size_t)patch[i]];
		v3_mad(s, area, x, s);
		s[3] += area;
	}
	for (size_t p = 0; place && sum && p < patches; p++) {
		double x[3];
		for (size_t k = 0; k < 3; k++)
			x[k] = sum[4 * p + k] / sum[4 * p + 3];
		place[p] = (struct place){ geo_morton(c, x), 0, (uint32_t)p };
	}
	int status = place && sum ? 0 : -1;
	if (!status) {
		qsort(place, patches, sizeof *place, compare_places);
		for (size_t p = 0; p < patches; p++)
			rank[place[p].old] = (uint32_t)p;
	}
	free(place);
	free(sum);
	return status;
}

/* The elements in their new order, with their new patches. */
static struct place *sort_elements(const struct model *m, const struct morton_curve *c,
                                   const uint32_t *patch, const uint32_t *rank,
                                   struct err *e)
{
	struct place *place = mem_new(m->element.n, sizeof *place, "elements", e);

	if (!place)
		return NULL;
	for (size_t i = 0; i < m->element.n; i++) {
		double x[3];
		centroid(m, c, i, x);
		place[i] = (struct place){ geo_morton(c, x), rank[patch[i]], (uint32_t)i };
	}
	qsort(place, m->element.n, sizeof *place, compare_places);
	return place;
}

/* Moves elements to their new places and tells the split trees. */
static int move_elements(struct model *m, const struct place *place, struct err *e)
{
	size_t n = m->element.n;
	uint32_t *element = mem_new(n, 3 * sizeof *element, "elements", e);
	uint32_t *triangle = mem_new(n, sizeof *triangle, "elements", e);
	uint32_t *moved = mem_new(n, sizeof *moved, "elements", e);

	if (!element || !triangle || !moved) {
		free(element);
		free(triangle);
		free(moved);
		return -1;
	}
	for (size_t i = 0; i < n; i++) {
		uint32_t old = place[i].old;
		memcpy(&element[3 * i], &m->element.corner[3 * (size_t)old], 3 * sizeof *element);
		triangle[i] = m->element.triangle[old];
		moved[old] = (uint32_t)i;
	}
	for (size_t t = 0; t < m->triangle.n; t++)
		if (m->triangle.split[t] < 0)
			m->triangle.split[t] = ~(int32_t)moved[~m->triangle.split[t]];
	for (size_t s = 0; s < m->splits; s++)
		for (int k = 0; k < 2; k++)
			if (m->split[s].child[k] < 0)
				m->split[s].child[k] = ~(int32_t)moved[~m->split[s].child[k]];
	free(moved);
	free(m->element.corner);
	free(m->element.triangle);
	m->element.corner = element;
	m->element.triangle = triangle;
	return 0;
}

/* patch_start and patch_surface. */
static int fill_patches(struct model *m, const struct place *place, size_t patches,
                        struct err *e)
{
	m->patch.start = mem_new(patches + 1, sizeof *m->patch.start, "patches", e);
	m->patch.surface = mem_new(patches, sizeof *m->patch.surface, "patches", e);
	if (!m->patch.start || !m->patch.surface)
		return -1;
	m->patch.n = patches;
	for (size_t i = m->element.n; i-- > 0;) {
		m->patch.start[place[i].patch] = (uint32_t)i;
		m->patch.surface[place[i].patch] = m->triangle.surface[m->element.triangle[i]];
	}
	m->patch.start[patches] = (uint32_t)m->element.n;
	return 0;
}

/* Vertices by first use; corners of triangles are corners of elements too. */
static int order_vertices(struct model *m, struct err *e)
{
	uint32_t *moved = mem_new(m->vertices, sizeof *moved, "vertices", e);
	double *vertex = mem_new(m->vertices, 3 * sizeof *vertex, "vertices", e);
	uint32_t n = 0;

	if (!moved || !vertex) {
		free(moved);
		free(vertex);
		return -1;
	}
	for (size_t i = 0; i < 3 * m->element.n; i++) {
		uint32_t *v = &m->element.corner[i];
		if (!moved[*v]) {
			memcpy(&vertex[3 * (size_t)n], &m->vertex[3 * (size_t)*v],
			       3 * sizeof *vertex);
			moved[*v] = ++n;
		}
		*v = moved[*v] - 1;
	}
	for (size_t i = 0; i < 3 * m->triangle.n; i++)
		m->triangle.corner[i] = moved[m->triangle.corner[i]] - 1;
	free(moved);
	free(m->vertex);
	m->vertex = vertex;
	m->vertices = n;
	return 0;
}

/* What the elements were made from goes with them. */
static int move_origins(uint32_t *origin, const struct place *place, size_t n, struct err *e)
{
	uint32_t *moved = mem_new(n, sizeof *moved, "elements", e);

	if (!moved)
		return -1;
	for (size_t i = 0; i < n; i++)
		moved[i] = origin[place[i].old];
	memcpy(origin, moved, n * sizeof *origin);
	free(moved);
	return 0;
}

static int order(struct model *m, const struct morton_curve *c, const uint32_t *patch,
                 size_t patches, const uint32_t *rank, uint32_t *origin, struct err *e)
{
	struct place *place = sort_elements(m, c, patch, rank, e);
	int status = place && (!origin || !move_origins(origin, place, m->element.n, e)) &&
	             !move_elements(m, place, e) && !fill_patches(m, place, patches, e) &&
	             !order_vertices(m, e) ? 0 : -1;

	free(place);
	return status;
}

int mesh_order_model(struct model *m, const uint32_t *patch, size_t patches, struct err *e)
{
	struct morton_curve c = scene_curve(m);
	uint32_t *rank = mem_new(patches, sizeof *rank, "patches", e);
	int status = rank && !rank_patches(m, &c, patch, patches, rank, e) &&
	             !order(m, &c, patch, patches, rank, NULL, e) ? 0 : -1;

	free(rank);
	return status;
}

int mesh_order_elements(struct model *m, const uint32_t *patch, size_t patches, uint32_t *origin,
                        struct err *e)
{
	struct morton_curve c = scene_curve(m);
	uint32_t *rank = mem_new(patches, sizeof *rank, "patches", e);

	for (size_t p = 0; rank && p < patches; p++)
		rank[p] = (uint32_t)p;
	int status = rank ? order(m, &c, patch, patches, rank, origin, e) : -1;
	free(rank);
	return status;
}
