/* Coincident triangles: of those that fill the same place the lowest stays. A
 * quad given twice may be cut along either diagonal, so pairs of triangles that
 * make up the same plane quad count as well. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/geometry/half_edge.h"
#include "lib/mesh/stages.h"

/* Sine of what a triangle of a plane quad may stand out of the other's plane by. A guess. */
static const double in_plane = 1e-6;

/* Triangles a (and b) have these corners, as sorted positions; position[3] is
 * unused for single triangles. */
struct shape {
	uint32_t position[4];
	uint32_t a, b;
};

struct search {
	struct model *m;
	const uint32_t *position;
	struct mesh_report *r;
	uint8_t *keep;        /* [triangles] */
	uint64_t *twin;       /* [triangles], see mesh_merge_coincident_sheets */
};

static int compare_shapes(const void *px, const void *py)
{
	const struct shape *x = px, *y = py;

	for (int k = 0; k < 4; k++)
		if (x->position[k] != y->position[k])
			return x->position[k] < y->position[k] ? -1 : 1;
	if (x->a != y->a)
		return x->a < y->a ? -1 : 1;
	return x->b < y->b ? -1 : x->b > y->b;
}

static int same_corners(const struct shape *x, const struct shape *y)
{
	return memcmp(x->position, y->position, sizeof x->position) == 0;
}

static void sort_positions(uint32_t *p, int n)
{
	for (int i = 1; i < n; i++)
		for (int j = i; j > 0 && p[j] < p[j - 1]; j--) {
			uint32_t swap = p[j];
			p[j] = p[j - 1];
			p[j - 1] = swap;
		}
}

static void area_vector(const struct model *m, uint32_t t, double n[3])
{
	const uint32_t *c = &m->triangle.corner[3 * (size_t)t];

	v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
	        &m->vertex[3 * (size_t)c[2]], n);
}

void mesh_note_twin(const struct model *m, uint32_t t, uint32_t kept, uint64_t *twin)
{
	uint32_t surface = m->triangle.surface[t];
	double n[3], o[3];

	area_vector(m, t, n);
	area_vector(m, kept, o);
	/* The side of t that lies on the back of the kept one. */
	int side = v3_dot(n, o) < 0 ? FRONT : BACK;
	int black = side == BACK && m->material.one_sided[m->surface.material[surface]];
	if (!black && !twin[kept])
		twin[kept] = 1 + 2 * (uint64_t)surface + (uint64_t)side;
}

/* Triangle t goes because `kept` fills its place. */
static void drop(struct search *s, uint32_t t, uint32_t kept)
{
	uint32_t surface = s->m->triangle.surface[t];

	mesh_note_twin(s->m, t, kept, s->twin);
	s->keep[t] = 0;
	if (surface < s->r->surfaces)
		s->r->surface[surface].duplicate++;
	s->r->total.duplicate++;
}

static void drop_triangles(struct search *s, struct shape *shape, size_t n)
{
	qsort(shape, n, sizeof *shape, compare_shapes);
	for (size_t i = 1, first = 0; i < n; i++) {
		if (same_corners(&shape[i], &shape[first]))
			drop(s, shape[i].a, shape[first].a);
		else
			first = i;
	}
}

static int find_triangles(struct search *s, struct err *e)
{
	const struct model *m = s->m;
	struct shape *shape = mem_new(m->triangle.n, sizeof *shape, "duplicates", e);

	if (!shape)
		return -1;
	for (size_t t = 0; t < m->triangle.n; t++) {
		shape[t].a = (uint32_t)t;
		for (size_t k = 0; k < 3; k++)
			shape[t].position[k] = s->position[m->triangle.corner[3 * t + k]];
		sort_positions(shape[t].position, 3);
	}
	drop_triangles(s, shape, m->triangle.n);
	free(shape);
	return 0;
}

/* 1 if the triangles of half-edges g and h, which share an edge, lie in one plane
 * on either side of it. */
static int plane_quad(const struct model *m, uint32_t g, uint32_t h)
{
	double n[3], o[3], d[3];

	if (geo_half_edge_from(m->triangle.corner, g) != geo_half_edge_to(m->triangle.corner, h))
		return 0;
	area_vector(m, g / 3, n);
	area_vector(m, h / 3, o);
	v3_sub(&m->vertex[3 * (size_t)geo_half_edge_apex(m->triangle.corner, h)],
	       &m->vertex[3 * (size_t)geo_half_edge_from(m->triangle.corner, g)], d);
	v3_normalise(n);
	return v3_dot(n, o) > 0 && fabs(v3_dot(n, d)) <= in_plane * v3_length(d);
}

/* Quads with the same corners: those that lose both triangles to the first. */
static void drop_quads(struct search *s, const struct shape *shape, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		if (!s->keep[shape[i].a] || !s->keep[shape[i].b])
			continue;
		for (size_t j = i + 1; j < n; j++) {
			uint32_t a = shape[j].a, b = shape[j].b;
			if (!s->keep[a] || !s->keep[b] || a == shape[i].a || a == shape[i].b ||
			    b == shape[i].a || b == shape[i].b)
				continue;
			drop(s, a, shape[i].a);
			drop(s, b, shape[i].b);
			/* The diagonals cross: the twin covers part of either. */
			if (!s->twin[shape[i].b])
				s->twin[shape[i].b] = s->twin[shape[i].a];
		}
	}
}

static int find_quads(struct search *s, struct err *e)
{
	const struct model *m = s->m;
	struct half_edges g = { 0 };
	struct shape *shape = mem_new(3 * m->triangle.n / 2 + 1, sizeof *shape, "duplicates", e);
	size_t n = 0;

	if (!shape || geo_half_edges_build(&g, m->triangle.corner, m->triangle.n, m->vertices, e)) {
		free(shape);
		return -1;
	}
	for (size_t i = 0; i < g.n; i++) {
		uint32_t h[2] = { g.use[g.start[i]], g.use[g.start[i + 1] - 1] };
		if (g.start[i + 1] - g.start[i] != 2 || !plane_quad(m, h[0], h[1]))
			continue;
		struct shape q = { .a = h[0] / 3, .b = h[1] / 3 };
		const uint32_t *of = m->triangle.corner;
		uint32_t corner[4] = { geo_half_edge_from(of, h[0]), geo_half_edge_to(of, h[0]),
			geo_half_edge_apex(of, h[0]), geo_half_edge_apex(of, h[1]) };
		for (int k = 0; k < 4; k++)
			q.position[k] = s->position[corner[k]];
		sort_positions(q.position, 4);
		shape[n++] = q;
	}
	qsort(shape, n, sizeof *shape, compare_shapes);
	for (size_t i = 0, j; i < n; i = j) {
		for (j = i + 1; j < n && same_corners(&shape[i], &shape[j]); j++)
			;
		drop_quads(s, shape + i, j - i);
	}
	free(shape);
	geo_half_edges_free(&g);
	return 0;
}

int mesh_drop_coincident(struct model *m, const uint32_t *position, struct mesh_report *r,
                         struct err *e)
{
	int status = -1;
	struct search s = { .m = m, .position = position, .r = r };

	s.keep = mem_new(m->triangle.n, 1, "duplicates", e);
	s.twin = mem_new(m->triangle.n, sizeof *s.twin, "duplicates", e);
	if (!s.keep || !s.twin)
		goto done;
	memset(s.keep, 1, m->triangle.n);
	if (find_triangles(&s, e))
		goto done;
	if (r->total.duplicate) {
		/* Dropped triangles must not be halves of quads. */
		if (mesh_merge_coincident_sheets(m, s.twin, s.keep, r, e))
			goto done;
		mesh_clean_compact(m, s.keep);
		memset(s.keep, 1, m->triangle.n);
		memset(s.twin, 0, m->triangle.n * sizeof *s.twin);
	}
	uint32_t before = r->total.duplicate;
	if (find_quads(&s, e))
		goto done;
	if (r->total.duplicate > before) {
		if (mesh_merge_coincident_sheets(m, s.twin, s.keep, r, e))
			goto done;
		mesh_clean_compact(m, s.keep);
	}
	status = 0;
done:
	free(s.keep);
	free(s.twin);
	return status;
}
