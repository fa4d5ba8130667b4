/* Where do other triangles cross a triangle, or touch its inside? */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/geometry/box_tree.h"
#include "lib/mesh/imprint.h"
#include "lib/scatter/bsdf.h"

struct search {
	const struct model *m;
	const struct imprint_limits *limits;
	const struct half_edges *g;
	double (*normal)[3];      /* [triangles] unit */
	uint32_t *plane;          /* [triangles] sets of coplanar neighbours */
	struct boxes boxes;
	struct array near, cut;
	struct contacts *out;
	struct err *e;
};

/* A segment in which triangles of one plane meet the plane of another triangle. */
struct cut {
	uint32_t plane;           /* the lowest of these triangles */
	int flush;                /* 1: it is the border of triangles in that same plane, so
	                             that only inside the other one something changes */
	double shortest;          /* a shorter one is left out */
	double end[2][3];
	double along[2];          /* of the ends, on the common line of both planes */
};

static const double *corner(const struct model *m, size_t triangle, int k)
{
	return &m->vertex[3 * (size_t)m->triangle.corner[3 * triangle + (size_t)k]];
}

double mesh_longest_edge(const struct model *m, size_t triangle)
{
	double longest = 0, d[3];

	for (int k = 0; k < 3; k++) {
		v3_sub(corner(m, triangle, (k + 1) % 3), corner(m, triangle, k), d);
		longest = fmax(longest, v3_length(d));
	}
	return longest;
}

/* Do triangles of one surface share an edge? Then they meet there and nowhere else. */
static int neighbours(const struct model *m, uint32_t a, uint32_t b)
{
	int shared = 0;

	if (m->triangle.surface[a] != m->triangle.surface[b])
		return 0;
	for (size_t i = 0; i < 9; i++)
		shared += m->triangle.corner[3 * (size_t)a + i / 3] ==
		          m->triangle.corner[3 * (size_t)b + i % 3];
	return shared > 1;
}

/* Cosine of two normals, either way, from which triangles are of one plane: within 4.5e-5 radians,
 * far more than rounding turns a normal of no sliver. A guess. */
static const double one_plane = 1 - 1e-9;

/* The triangle beyond half-edge h in the plane of its own, or none (its own). */
static uint32_t coplanar(const struct search *s, uint32_t h)
{
	uint32_t edge = s->g->of[h];

	for (uint32_t u = s->g->start[edge]; u < s->g->start[edge + 1]; u++) {
		uint32_t other = s->g->use[u] / 3;
		if (other != h / 3 && fabs(v3_dot(s->normal[h / 3], s->normal[other])) > one_plane)
			return other;
	}
	return h / 3;
}

/* height[k][i] = how far end i lies within side k of triangle a, 0 if nearly on it. */
static void heights(const struct search *s, uint32_t a, double end[2][3], double height[3][2])
{
	for (int k = 0; k < 3; k++) {
		double edge[3], inward[3], d[3];
		v3_sub(corner(s->m, a, (k + 1) % 3), corner(s->m, a, k), edge);
		v3_cross(s->normal[a], edge, inward);
		v3_normalise(inward);
		for (int i = 0; i < 2; i++) {
			v3_sub(end[i], corner(s->m, a, k), d);
			height[k][i] = v3_dot(inward, d);
			if (fabs(height[k][i]) <= s->limits->thick)
				height[k][i] = 0;
		}
	}
}

/* The side along which all of [from, to] of a segment with these heights runs, or -1. */
static int side_along(const struct search *s, double height[3][2], double from, double to)
{
	double nearest = s->limits->apart;
	int side = -1;

	for (int k = 0; k < 3; k++) {
		double slope = height[k][1] - height[k][0];
		double reach = fmax(height[k][0] + from * slope, height[k][0] + to * slope);
		if (reach <= nearest) {
			nearest = reach;
			side = k;
		}
	}
	return side;
}

/* The part of a segment, given in the plane of triangle a, that lies in a. 0 if there
 * is none to speak of. *rim = the side of a along which it runs, or -1. */
static int clip(const struct search *s, uint32_t a, double end[2][3], int *rim)
{
	double from = 0, to = 1, height[3][2], d[3];

	heights(s, a, end, height);
	for (int k = 0; k < 3; k++) {
		double low = height[k][0], high = height[k][1];
		if (low < 0 && high < 0)
			return 0;
		if (low < 0)
			from = fmax(from, low / (low - high));
		if (high < 0)
			to = fmin(to, low / (low - high));
	}
	v3_sub(end[1], end[0], d);
	if (!((to - from) * v3_length(d) > s->limits->apart))
		return 0;
	*rim = side_along(s, height, from, to);
	v3_mad(end[0], to, d, end[1]);
	v3_mad(end[0], from, d, end[0]);
	return 1;
}

/* Does a triangle give light, on either side? */
static int emits(const struct model *m, uint32_t triangle)
{
	uint32_t material = m->surface.material[m->triangle.surface[triangle]];

	return bsdf_emits(&m->material, material, FRONT) ||
	       bsdf_emits(&m->material, material, BACK);
}

/* Notes that triangle b meets the plane of triangle a between p and q. The light that a lamp
 * throws on what is close behind it must not come out beside it. */
static int add_cut(struct search *s, uint32_t a, uint32_t b, const double p[3],
                   const double q[3], int flush, int fine)
{
	const double *given[2] = { p, q }, *n = s->normal[a];
	struct cut c = { .plane = geo_sets_find(s->plane, b), .flush = flush,
	                 .shortest = fine || emits(s->m, b) ? s->limits->fine
	                                                    : s->limits->shortest };
	double d[3];

	for (int i = 0; i < 2; i++) {
		v3_sub(given[i], corner(s->m, a, 0), d);
		v3_mad(given[i], -v3_dot(n, d), n, c.end[i]);
	}
	return mem_append(&s->cut, &c, 1, sizeof c, s->e);
}

/* Triangle b has corners on both sides of the plane of a, at `height` above it. */
static int add_crossing(struct search *s, uint32_t a, uint32_t b, const double height[3])
{
	double end[2][3];
	int n = 0;

	for (int k = 0; k < 3; k++) {
		int next = (k + 1) % 3;
		const double *p = corner(s->m, b, k), *q = corner(s->m, b, next);
		double d[3];
		if (height[k] == 0 && n < 2)
			memcpy(end[n++], p, sizeof end[0]);
		if (height[k] * height[next] < 0 && n < 2) {
			v3_sub(q, p, d);
			v3_mad(p, height[k] / (height[k] - height[next]), d, end[n++]);
		}
	}
	return n == 2 ? add_cut(s, a, b, end[0], end[1], 0, 0) : 0;
}

/* Triangle b stays on one side of the plane of a: what little light comes through between
 * them shows in no element, so that the parts of its border which are close count as if
 * they stood on it. */
static int add_close(struct search *s, uint32_t a, uint32_t b, const double height[3])
{
	int status = 0, close = 0;

	for (int k = 0; k < 3; k++)
		close += fabs(height[k]) <= s->limits->close;
	for (uint32_t k = 0; k < 3 && !status; k++)
		if (fabs(height[k]) <= s->limits->close &&
		    fabs(height[(k + 1) % 3]) <= s->limits->close && coplanar(s, 3 * b + k) == b)
			status = add_cut(s, a, b, corner(s->m, b, (int)k),
			                 corner(s->m, b, (int)(k + 1) % 3), close == 3, 0);
	return status;
}

static int add_pair(struct search *s, uint32_t a, uint32_t b)
{
	double height[3], d[3];
	int flat = 0, above = 0, below = 0, status = 0;

	for (int k = 0; k < 3; k++) {
		v3_sub(corner(s->m, b, k), corner(s->m, a, 0), d);
		height[k] = v3_dot(s->normal[a], d);
		if (fabs(height[k]) <= s->limits->thick)
			height[k] = 0;
		flat += height[k] == 0;
		above += height[k] > 0;
		below += height[k] < 0;
	}
	if (flat < 2)
		return above && below ? add_crossing(s, a, b, height) : add_close(s, a, b, height);
	for (int k = 0; k < 3 && !status; k++)
		if (height[k] == 0 && height[(k + 1) % 3] == 0 &&
		    (flat < 3 || coplanar(s, 3 * b + (uint32_t)k) == b))
			status = add_cut(s, a, b, corner(s->m, b, k), corner(s->m, b, (k + 1) % 3),
			                 flat == 3, flat == 3);
	return status;
}

static int compare_cuts(const void *pa, const void *pb)
{
	const struct cut *a = pa, *b = pb;

	if (a->plane != b->plane)
		return a->plane < b->plane ? -1 : 1;
	if (a->flush != b->flush)
		return a->flush - b->flush;
	if (a->along[0] != b->along[0])
		return a->along[0] < b->along[0] ? -1 : 1;
	return (a->along[1] > b->along[1]) - (a->along[1] < b->along[1]);
}

/* The ends of cuts as distances along the line of their planes, in ascending order. */
static void measure_cuts(const struct search *s, uint32_t a)
{
	struct cut *c = s->cut.data;

	for (size_t i = 0; i < s->cut.n; i++) {
		double line[3], d[3];
		v3_cross(s->normal[a], s->normal[c[i].plane], line);
		v3_normalise(line);
		for (int k = 0; k < 2; k++) {
			v3_sub(c[i].end[k], corner(s->m, a, 0), d);
			c[i].along[k] = c[i].flush ? (double)i : v3_dot(d, line);
		}
		if (c[i].along[0] > c[i].along[1]) {
			struct cut given = c[i];
			for (int k = 0; k < 2; k++) {
				memcpy(c[i].end[k], given.end[1 - k], sizeof given.end[0]);
				c[i].along[k] = given.along[1 - k];
			}
		}
	}
}

/* Cuts in one line become one where they follow each other: across the diagonals of the
 * quads that meet triangle a. */
static void join_cuts(struct search *s, uint32_t a)
{
	struct cut *c = s->cut.data;
	size_t n = 0;

	measure_cuts(s, a);
	if (s->cut.n > 1)
		qsort(c, s->cut.n, sizeof *c, compare_cuts);
	for (size_t i = 0; i < s->cut.n; i++) {
		struct cut *last = n ? &c[n - 1] : NULL;
		if (!last || c[i].flush || last->flush || last->plane != c[i].plane ||
		    c[i].along[0] > last->along[1] + s->limits->apart) {
			c[n++] = c[i];
		} else if (c[i].along[1] > last->along[1]) {
			last->along[1] = c[i].along[1];
			memcpy(last->end[1], c[i].end[1], sizeof last->end[1]);
		}
	}
	s->cut.n = n;
}

/* The part of a cut within triangle a becomes a contact, if it is worth one. */
static int add_contact(struct search *s, uint32_t a, const struct cut *cut)
{
	struct contact c = { .triangle = a };
	double d[3];
	int rim;

	v3_sub(cut->end[1], cut->end[0], d);
	memcpy(c.end, cut->end, sizeof c.end);
	if (!clip(s, a, c.end, &rim))
		return 0;
	if (rim >= 0) {
		uint32_t edge = s->g->of[3 * a + (uint32_t)rim];
		if (cut->flush || s->g->start[edge + 1] - s->g->start[edge] < 2)
			return 0;
	}
	if (v3_length(d) < cut->shortest) {
		s->out->fine++;
		return 0;
	}
	return mem_append(&s->out->list, &c, 1, sizeof c, s->e);
}

static int search_triangle(struct search *s, uint32_t a)
{
	s->near.n = s->cut.n = 0;
	if (geo_boxes_find(&s->boxes, &s->boxes.box[a], s->limits->close, &s->near, s->e))
		return -1;
	const uint32_t *b = s->near.data;
	for (size_t i = 0; i < s->near.n; i++)
		if (b[i] != a && !neighbours(s->m, a, b[i]) && add_pair(s, a, b[i]))
			return -1;
	join_cuts(s, a);
	const struct cut *cut = s->cut.data;
	for (size_t i = 0; i < s->cut.n; i++)
		if (add_contact(s, a, &cut[i]))
			return -1;
	return 0;
}

static int prepare(struct search *s)
{
	const struct model *m = s->m;

	s->normal = mem_new(m->triangle.n, sizeof *s->normal, "normals", s->e);
	s->plane = geo_sets_new(m->triangle.n, s->e);
	if (!s->normal || !s->plane ||
	    geo_boxes_build(&s->boxes, m->vertex, m->triangle.corner, m->triangle.n, s->e))
		return -1;
	for (size_t t = 0; t < m->triangle.n; t++) {
		v3_area(corner(m, t, 0), corner(m, t, 1), corner(m, t, 2), s->normal[t]);
		v3_normalise(s->normal[t]);
	}
	for (uint32_t h = 0; h < 3 * m->triangle.n; h++)
		geo_sets_join(s->plane, h / 3, coplanar(s, h));
	return 0;
}

int mesh_find_contacts(const struct model *m, const struct half_edges *g,
                       const struct imprint_limits *limits, struct contacts *out, struct err *e)
{
	struct search s = { .m = m, .limits = limits, .g = g, .out = out, .e = e };
	int status = prepare(&s);

	for (uint32_t t = 0; !status && t < m->triangle.n; t++)
		if (mesh_longest_edge(m, t) > limits->size)
			status = search_triangle(&s, t);
	free(s.normal);
	free(s.plane);
	free(s.near.data);
	free(s.cut.data);
	geo_boxes_free(&s.boxes);
	return status;
}
