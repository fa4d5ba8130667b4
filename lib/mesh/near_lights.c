/* Elements close to lights. What a point gets of a panel is a sum over the edges of its outline
 * (Lambert's): the angle of an edge times how the plane through it and the point stands to the
 * surface. Where the edge is at distance d and h above the surface, that plane turns by h / d^2 a
 * length; so d^2 / h is how long edges of elements may be. (Opposite the middle of a large panel light is
 * even, however close it is, and on a wall that meets a panel at its edge, too.) */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/geometry/box_tree.h"
#include "lib/geometry/half_edge.h"
#include "lib/mesh/stages.h"
#include "lib/scatter/bsdf.h"

/* The longest edge over d^2 / h. A guess; tests/bench/uneven.py shows what it does where lamps
 * stand close to walls. */
static const double longest = 1;

/* Halvings of the element size at most, each to half the edge; a guess: to a sixteenth. */
enum { HALVINGS = 4, BISECTIONS = 2 * HALVINGS };

/* Sine of what is in the plane of a light, but for rounding, and cosine of panels in one plane: 5
 * degrees. Guesses. */
static const double in_plane = 1e-3, one_plane = .9962;

/* Edges of outlines of what emits, and punctual lights, which are edges of no length. */
struct sources {
	size_t n;
	double *vertex;           /* [n][3][3] of the triangle that emits, its edge first */
	uint32_t *corner;         /* [n][3] the edge as a triangle, for boxes */
	double (*normal)[3];      /* [n] unit, of the side that emits; 0: all around */
	struct boxes boxes;
};

static uint32_t material_of(const struct model *m, size_t triangle)
{
	return m->surface.material[m->triangle.surface[triangle]];
}

static void unit_normal(const struct model *m, size_t triangle, double n[3])
{
	const uint32_t *c = &m->triangle.corner[3 * triangle];

	v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
	        &m->vertex[3 * (size_t)c[2]], n);
	v3_normalise(n);
}

static void add_source(struct sources *s, const double *const x[3], const double n[3])
{
	for (size_t c = 0; c < 3; c++) {
		memcpy(&s->vertex[9 * s->n + 3 * c], x[c], 3 * sizeof *s->vertex);
		s->corner[3 * s->n + c] = (uint32_t)(3 * s->n + (c < 2 ? c : 0));
	}
	memcpy(s->normal[s->n++], n, sizeof *s->normal);
}

/* Does the panel that emits by this side end at a half-edge? Not where another goes on in its
 * plane. */
static int is_outline(const struct model *m, const struct half_edges *g, uint32_t h, int side)
{
	double n[3], o[3];

	unit_normal(m, h / 3, n);
	for (uint32_t i = g->start[g->of[h]]; i < g->start[g->of[h] + 1]; i++) {
		uint32_t other = g->use[i];
		if (other / 3 == h / 3)
			continue;
		unit_normal(m, other / 3, o);
		int same = geo_half_edge_from(m->triangle.corner, other) !=
		           geo_half_edge_from(m->triangle.corner, h);
		if (bsdf_emits(&m->material, material_of(m, other / 3), same ? side : !side) &&
		    (same ? 1 : -1) * v3_dot(n, o) > one_plane)
			return 0;
	}
	return 1;
}

static void add_triangle(const struct model *m, const struct half_edges *g, uint32_t t,
                         struct sources *s)
{
	const uint32_t *corner = m->triangle.corner;

	for (int side = 0; side < 2; side++) {
		double n[3];
		if (!bsdf_emits(&m->material, material_of(m, t), side))
			continue;
		unit_normal(m, t, n);
		for (int k = 0; k < 3; k++)
			n[k] *= side == FRONT ? 1 : -1;
		for (uint32_t h = 3 * t; h < 3 * t + 3; h++)
			if (is_outline(m, g, h, side))
				add_source(s, (const double *const[3]){
					&m->vertex[3 * (size_t)geo_half_edge_from(corner, h)],
					&m->vertex[3 * (size_t)geo_half_edge_to(corner, h)],
					&m->vertex[3 * (size_t)geo_half_edge_apex(corner, h)] }, n);
	}
}

/* How many there can be. */
static size_t count_sources(const struct model *m)
{
	size_t n = m->light.n;

	for (size_t t = 0; t < m->triangle.n; t++)
		for (int side = 0; side < 2; side++)
			n += bsdf_emits(&m->material, material_of(m, t), side) ? 3 : 0;
	return n;
}

static int find_sources(const struct model *m, struct sources *s, struct err *e)
{
	size_t most = count_sources(m);
	struct half_edges g = { 0 };
	const struct mem_array array[] = {
		MEM_ARRAY(s->vertex, most, 9), MEM_ARRAY(s->corner, most, 3),
		MEM_ARRAY(s->normal, most, 1)
	};

	int bad = mem_new_arrays(array, sizeof array / sizeof *array, "lights", e) ||
	          geo_half_edges_build(&g, m->triangle.corner, m->triangle.n, m->vertices, e);
	for (uint32_t t = 0; !bad && t < m->triangle.n; t++)
		add_triangle(m, &g, t, s);
	geo_half_edges_free(&g);
	for (size_t i = 0; !bad && i < m->light.n; i++) {
		const double *p = &m->light.position[3 * i];
		if (m->light.kind[i] != LIGHT_DIRECTIONAL)
			add_source(s, (const double *const[3]){ p, p, p }, (const double[3]){ 0 });
	}
	return bad || geo_boxes_build(&s->boxes, s->vertex, s->corner, s->n, e) ? -1 : 0;
}

static void free_sources(struct sources *s)
{
	geo_boxes_free(&s->boxes);
	MEM_FREE(s->vertex, s->corner, s->normal);
}

/* From the nearest point of an edge to p. */
static void from_edge(const double p[3], const double *x, double d[3])
{
	double edge[3];

	v3_sub(x + 3, x, edge);
	v3_sub(p, x, d);
	double all = v3_dot(edge, edge);
	v3_mad(d, all > 0 ? -fmin(1, fmax(0, v3_dot(d, edge) / all)) : 0, edge, d);
}

/* An element: where it is looked at, and what it may show to light. */
struct receiver {
	double point[7][3];       /* corners, middles of edges, centre */
	double normal[3], edge;   /* the longest */
	int sides[2];             /* is modelled */
};

static void set_receiver(const struct model *m, size_t element, struct receiver *r)
{
	const uint32_t *c = &m->element.corner[3 * element];
	uint32_t material = material_of(m, m->element.triangle[element]);

	*r = (struct receiver){ .sides = { 1, !m->material.one_sided[material] } };
	for (int i = 0; i < 3; i++) {
		const double *a = &m->vertex[3 * (size_t)c[i]], *b = &m->vertex[3 * (size_t)c[(i + 1) % 3]];
		double d[3];
		v3_sub(b, a, d);
		r->edge = fmax(r->edge, v3_length(d));
		for (int k = 0; k < 3; k++) {
			r->point[i][k] = a[k];
			r->point[3 + i][k] = a[k] + d[k] / 2;
			r->point[6][k] += a[k] / 3;
		}
	}
	v3_area(r->point[0], r->point[1], r->point[2], r->normal);
	v3_normalise(r->normal);
}

/* Does some corner of the source stand above a side that is modelled? */
static int faces(const struct receiver *r, const double *x)
{
	for (int c = 0; c < 3; c++) {
		double d[3];
		v3_sub(x + 3 * c, r->point[6], d);
		double above = v3_dot(d, r->normal);
		if (fabs(above) > in_plane * r->edge && r->sides[above < 0])
			return 1;
	}
	return 0;
}

static int is_close(const struct sources *s, uint32_t source, const struct receiver *r)
{
	const double *x = &s->vertex[9 * (size_t)source], *n = s->normal[source];

	if (!faces(r, x))
		return 0;
	for (int i = 0; i < 7; i++) {
		double d[3], to[3];
		from_edge(r->point[i], x, d);
		v3_sub(r->point[i], x, to);
		int above = v3_dot(n, n) == 0 || v3_dot(to, n) > in_plane * r->edge;
		if (above && longest * v3_dot(d, d) < r->edge * fabs(v3_dot(d, r->normal)))
			return 1;
	}
	return 0;
}

/* Twice the halvings of an edge: a bisection halves the area. */
static int mark(const struct model *m, const struct sources *s, double least, uint8_t *halvings,
                struct err *e)
{
	struct array found = { 0 };
	int marked = 0, bad = 0;

	for (size_t i = 0; i < m->element.n && !bad; i++) {
		struct receiver r;
		struct box box;
		set_receiver(m, i, &r);
		halvings[i] = 0;
		if (r.edge <= least)
			continue;
		for (int k = 0; k < 3; k++) {
			box.lo[k] = fmin(r.point[0][k], fmin(r.point[1][k], r.point[2][k]));
			box.hi[k] = fmax(r.point[0][k], fmax(r.point[1][k], r.point[2][k]));
		}
		found.n = 0;
		bad = geo_boxes_find(&s->boxes, &box, r.edge / longest, &found, e); /* h <= d */
		for (size_t k = 0; k < found.n && !bad && !halvings[i]; k++)
			halvings[i] = is_close(s, ((uint32_t *)found.data)[k], &r) ? 2 : 0;
		marked |= halvings[i] > 0;
	}
	free(found.data);
	return bad ? -1 : marked;
}

int mesh_divide_near_lights(struct model *m, double size, struct err *e)
{
	struct sources s = { 0 };
	int more = find_sources(m, &s, e) ? -1 : s.n > 0;
	double least = size / (1 << HALVINGS);

	for (int i = 0; more > 0 && i < BISECTIONS; i++) {
		uint8_t *halvings = mem_new(m->element.n, 1, "elements", e);
		uint32_t *origin = NULL;
		more = halvings ? mark(m, &s, least, halvings, e) : -1;
		if (more > 0 && mesh_bisect_further(m, halvings, &origin, e))
			more = -1;
		free(halvings);
		free(origin);
	}
	free_sources(&s);
	return more < 0 ? -1 : 0;
}
