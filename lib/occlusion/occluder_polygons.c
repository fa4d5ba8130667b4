#include "lib/occlusion/occluder_polygons.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/geometry/half_edge.h"
#include "lib/geometry/weld.h"
#include "lib/occlusion/facet_set.h"

/* Heights up to this fraction of the diagonal of the scene count as on a plane: what float32,
 * which glTF stores positions in, does to them (1.2e-7 between neighbours, and twice rounded
 * by a node's transform). */
static const double near_fraction = 2e-7;

/* Sines up to this are no turn of an outline: what float32 leaves of a straight edge. */
static const double straight = 1e-7;

/* A chain of triangles, each within `near` of the plane of the last, may bend away from that of
 * the first: so many times `near` it may, a guess. */
static const double flat_most = 4;

/* Cosine of the angle up to which two triangles in one plane continue one another: anything that
 * tells 0 from 180 degrees (a fold). */
static const double unfolded = .5;

struct merger {
	const struct model *m;
	struct polygons *p;
	uint32_t *triangle;           /* [triangles][3] distinct points */
	size_t triangles;
	struct half_edges edges;
	uint32_t *set;                /* union-find of coplanar triangles */
	uint32_t *order;              /* triangles by set */
	uint32_t *next;               /* [points] next corner of the outline being traced */
	struct err *e;
};

static int weld(struct merger *g)
{
	const struct model *m = g->m;
	double lo[3], hi[3], centre[3], diagonal[3], tolerance;
	uint32_t *group = mem_new(m->vertices, sizeof *group, "points", g->e);
	uint32_t *id = mem_new(m->vertices, sizeof *id, "points", g->e);
	struct polygons *p = g->p;
	int bad = !group || !id;

	model_box(m, lo, hi);
	occ_facet_centre(m, centre);
	v3_sub(hi, lo, diagonal);
	p->near = near_fraction * v3_length(diagonal);
	tolerance = p->near;
	struct weld w = { m->vertices, m->vertex, group, 1, &tolerance, m->triangle.n,
	                  m->triangle.corner };
	bad = bad || geo_weld_points(&w, id, &p->points, g->e);
	p->point = bad ? NULL : mem_new(p->points, 3 * sizeof *p->point, "points", g->e);
	bad = bad || !p->point;
	for (size_t v = m->vertices; !bad && v-- > 0;) /* the first of each stays */
		v3_sub(&m->vertex[3 * v], centre, &p->point[3 * (size_t)id[v]]);
	for (size_t i = 0; !bad && i < 3 * m->triangle.n; i++)
		g->triangle[i] = id[m->triangle.corner[i]];
	free(group);
	free(id);
	return bad;
}

static const double *at(const struct merger *g, uint32_t point)
{
	return &g->p->point[3 * (size_t)point];
}

static struct plane plane_of(const struct merger *g, uint32_t t)
{
	const uint32_t *c = &g->triangle[3 * (size_t)t];
	struct plane p;

	v3_area(at(g, c[0]), at(g, c[1]), at(g, c[2]), p.normal);
	v3_normalise(p.normal);
	p.offset = v3_dot(p.normal, at(g, c[0]));
	return p;
}

/* Joins the two triangles of an edge if they continue one another in a plane. */
static void join(struct merger *g, uint32_t edge)
{
	const uint32_t *use = &g->edges.use[g->edges.start[edge]];
	uint32_t t = use[0] / 3, u = use[1] / 3;

	if (geo_half_edge_from(g->triangle, use[0]) != geo_half_edge_to(g->triangle, use[1]))
		return;
	struct plane p = plane_of(g, t), q = plane_of(g, u);
	double a = occ_plane_height(&p, at(g, geo_half_edge_apex(g->triangle, use[1])));
	double b = occ_plane_height(&q, at(g, geo_half_edge_apex(g->triangle, use[0])));
	if (v3_dot(p.normal, q.normal) > unfolded && fabs(a) <= g->p->near && fabs(b) <= g->p->near)
		geo_sets_join(g->set, t, u);
}

static int put_polygon(struct merger *g, const uint32_t *corner, uint32_t n, int two_sided)
{
	struct polygon q = { .first = (uint32_t)g->p->corner.n, .n = n, .two_sided = two_sided };
	double twice[3] = { 0 }, sum = 0;

	for (uint32_t i = 1; i + 1 < n; i++) {
		double a[3];
		v3_area(at(g, corner[0]), at(g, corner[i]), at(g, corner[i + 1]), a);
		v3_mad(twice, 1, a, twice);
	}
	memcpy(q.plane.normal, twice, sizeof twice);
	if (!(v3_normalise(q.plane.normal) > 0))
		return 0; /* an edge to every eye */
	for (uint32_t i = 0; i < n; i++)
		sum += v3_dot(q.plane.normal, at(g, corner[i]));
	q.plane.offset = sum / n;
	return mem_append(&g->p->corner, corner, n, sizeof *corner, g->e) ||
	       mem_append(&g->p->polygon, &q, 1, sizeof q, g->e) ? -1 : 0;
}

/* Is a half-edge on the outline of the set of its triangle? */
static int outer(const struct merger *g, uint32_t half)
{
	uint32_t edge = g->edges.of[half], set = geo_sets_find(g->set, half / 3);
	const uint32_t *use = &g->edges.use[g->edges.start[edge]];

	for (uint32_t i = 0; i < g->edges.start[edge + 1] - g->edges.start[edge]; i++)
		if (use[i] != half && geo_sets_find(g->set, use[i] / 3) == set)
			return 0;
	return 1;
}

/* The corners of a set's outline where it turns, if it is one convex loop of few of
 * them; 0 otherwise. Leaves g->next cleared. */
static uint32_t outline(struct merger *g, const uint32_t *tri, size_t n, uint32_t *corner)
{
	size_t halves = 0, walked = 0;
	uint32_t first = UINT32_MAX, count = 0, simple = 1;
	struct plane p = plane_of(g, tri[0]);

	for (size_t i = 0; i < 3 * n; i++) {
		uint32_t half = 3 * tri[i / 3] + (uint32_t)(i % 3);
		if (!outer(g, half))
			continue;
		first = geo_half_edge_from(g->triangle, half);
		simple = simple && g->next[first] == UINT32_MAX;
		g->next[first] = geo_half_edge_to(g->triangle, half);
		halves++;
	}
	for (uint32_t a = first, b; simple && walked < halves; a = b, walked++) {
		b = g->next[a];
		uint32_t c = b == UINT32_MAX ? b : g->next[b];
		if (c == UINT32_MAX || (walked && a == first))
			break;
		double u[3], v[3], turn[3];
		v3_sub(at(g, b), at(g, a), u);
		v3_sub(at(g, c), at(g, b), v);
		v3_cross(u, v, turn);
		double sine = v3_dot(turn, p.normal) / (v3_length(u) * v3_length(v));
		if (sine < -straight || (sine < straight && v3_dot(u, v) < 0) ||
		    count == FLAT_CORNERS)
			break;
		if (sine >= straight)
			corner[count++] = b;
	}
	for (size_t i = 0; i < 3 * n; i++)
		g->next[g->triangle[3 * tri[i / 3] + i % 3]] = UINT32_MAX;
	return walked == halves && count >= 3 ? count : 0;
}

/* Are all corners of the set in one plane? Joining compared neighbours only. */
static int flat(const struct merger *g, const uint32_t *tri, size_t n)
{
	struct plane p = plane_of(g, tri[0]);

	for (size_t i = 0; i < 3 * n; i++)
		if (fabs(occ_plane_height(&p, at(g, g->triangle[3 * tri[i / 3] + i % 3]))) >
		    flat_most * g->p->near)
			return 0;
	return 1;
}

static int has_back(const struct merger *g, uint32_t triangle)
{
	const struct model *m = g->m;

	return !m->material.one_sided[m->surface.material[m->triangle.surface[triangle]]];
}

static int put_set(struct merger *g, const uint32_t *tri, size_t n)
{
	uint32_t corner[FLAT_CORNERS];
	uint32_t count = n > 1 && flat(g, tri, n) ? outline(g, tri, n, corner) : 0;
	int two_sided = 0;

	for (size_t i = 0; i < n; i++)
		two_sided |= has_back(g, tri[i]);
	if (count)
		return put_polygon(g, corner, count, two_sided);
	for (size_t i = 0; i < n; i++)
		if (put_polygon(g, &g->triangle[3 * (size_t)tri[i]], 3, has_back(g, tri[i])))
			return -1;
	return 0;
}

/* Triangles by set: a counting sort. */
static int order_sets(struct merger *g)
{
	uint32_t *count = mem_new(g->triangles + 1, sizeof *count, "polygons", g->e);

	if (!count)
		return -1;
	for (uint32_t t = 0; t < g->triangles; t++)
		count[geo_sets_find(g->set, t) + 1]++;
	for (size_t t = 0; t < g->triangles; t++)
		count[t + 1] += count[t];
	for (uint32_t t = 0; t < g->triangles; t++)
		g->order[count[geo_sets_find(g->set, t)]++] = t;
	free(count);
	return 0;
}

static int merge(struct merger *g)
{
	for (uint32_t i = 0; i < g->edges.n; i++)
		if (g->edges.start[i + 1] - g->edges.start[i] == 2)
			join(g, i);
	if (order_sets(g))
		return -1;
	memset(g->next, 0xff, g->p->points * sizeof *g->next);
	for (size_t i = 0, end; i < g->triangles; i = end) {
		uint32_t set = geo_sets_find(g->set, g->order[i]);
		for (end = i; end < g->triangles && geo_sets_find(g->set, g->order[end]) == set;)
			end++;
		if (put_set(g, g->order + i, end - i))
			return -1;
	}
	return 0;
}

int occ_polygons_init(struct polygons *p, const struct model *m, struct err *e)
{
	struct merger g = { .m = m, .p = p, .triangles = m->triangle.n, .e = e };

	*p = (struct polygons){ 0 };
	g.triangle = mem_new(m->triangle.n, 3 * sizeof *g.triangle, "polygons", e);
	g.order = mem_new(m->triangle.n, sizeof *g.order, "polygons", e);
	g.set = geo_sets_new(m->triangle.n, e);
	int bad = !g.triangle || !g.order || !g.set || weld(&g) ||
	          geo_half_edges_build(&g.edges, g.triangle, g.triangles, p->points, e) ||
	          !(g.next = mem_new(p->points, sizeof *g.next, "polygons", e)) || merge(&g);
	free(g.triangle);
	free(g.order);
	free(g.set);
	free(g.next);
	geo_half_edges_free(&g.edges);
	return bad ? -1 : 0;
}

void occ_polygons_free(struct polygons *p)
{
	free(p->point);
	free(p->polygon.data);
	free(p->corner.data);
	*p = (struct polygons){ 0 };
}
