/* Where do other triangles cross a triangle, or touch its inside? */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boxes.h"
#include "imprint.h"
#include "mem.h"
#include "vec3.h"

struct search {
	const struct model *m;
	const struct imprint_limits *limits;
	const struct edges *g;
	double (*normal)[3];      /* [triangles] unit */
	struct boxes boxes;
	struct vec near;
	struct contacts *out;
	struct err *e;
};

static const double *corner(const struct model *m, size_t triangle, int k)
{
	return &m->vertex[3 * (size_t)m->triangle[3 * triangle + (size_t)k]];
}

double longest_edge(const struct model *m, size_t triangle)
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

	if (m->triangle_surface[a] != m->triangle_surface[b])
		return 0;
	for (size_t i = 0; i < 9; i++)
		shared += m->triangle[3 * (size_t)a + i / 3] == m->triangle[3 * (size_t)b + i % 3];
	return shared > 1;
}

/* Is half-edge h inside a plane piece of its surface, like the diagonal of a quad? */
static int inside_plane(const struct search *s, uint32_t h)
{
	uint32_t edge = s->g->of[h];

	for (uint32_t u = s->g->start[edge]; u < s->g->start[edge + 1]; u++) {
		uint32_t other = s->g->use[u] / 3;
		if (other != h / 3 && fabs(v3_dot(s->normal[h / 3], s->normal[other])) > 1 - 1e-9)
			return 1;
	}
	return 0;
}

/* The part of a segment, given in the plane of triangle a, that lies in a. 0 if there
 * is none to speak of. *rim = the side of a along which it runs, or -1. */
static int clip(const struct search *s, uint32_t a, double end[2][3], int *rim)
{
	double from = 0, to = 1, height[3][2], d[3];

	for (int k = 0; k < 3; k++) {
		double edge[3], inward[3];
		v3_sub(corner(s->m, a, (k + 1) % 3), corner(s->m, a, k), edge);
		v3_cross(s->normal[a], edge, inward);
		v3_normalise(inward);
		for (int i = 0; i < 2; i++) {
			v3_sub(end[i], corner(s->m, a, k), d);
			height[k][i] = v3_dot(inward, d);
		}
		double low = height[k][0] + s->limits->thick, high = height[k][1] + s->limits->thick;
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
	*rim = -1;
	for (int k = 0; k < 3; k++) {
		double slope = height[k][1] - height[k][0];
		if (fmax(height[k][0] + from * slope, height[k][0] + to * slope) <= s->limits->apart)
			*rim = k;
	}
	v3_mad(end[0], to, d, end[1]);
	v3_mad(end[0], from, d, end[0]);
	return 1;
}

/* Notes that a segment near the plane of triangle a lies in triangle b. `flush`: b lies
 * in that plane itself, so that only where its border crosses a something changes. */
static int add_contact(struct search *s, uint32_t a, const double p[3], const double q[3],
                       int flush)
{
	const double *n = s->normal[a];
	struct contact c = { .triangle = a };
	const double *given[2] = { p, q };
	double d[3];
	int rim;

	for (int i = 0; i < 2; i++) {
		v3_sub(given[i], corner(s->m, a, 0), d);
		v3_mad(given[i], -v3_dot(n, d), n, c.end[i]);
	}
	v3_sub(c.end[1], c.end[0], d);
	double length = v3_length(d);
	if (!clip(s, a, c.end, &rim))
		return 0;
	if (rim >= 0) {
		uint32_t edge = s->g->of[3 * a + (uint32_t)rim];
		if (flush || s->g->start[edge + 1] - s->g->start[edge] < 2)
			return 0;
	}
	if (length < s->limits->shortest) {
		s->out->fine++;
		return 0;
	}
	return vec_append(&s->out->list, &c, 1, sizeof c, s->e);
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
	return n == 2 ? add_contact(s, a, end[0], end[1], 0) : 0;
}

static int add_pair(struct search *s, uint32_t a, uint32_t b)
{
	double height[3], d[3];
	int flat = 0, status = 0;

	for (int k = 0; k < 3; k++) {
		v3_sub(corner(s->m, b, k), corner(s->m, a, 0), d);
		height[k] = v3_dot(s->normal[a], d);
		if (fabs(height[k]) <= s->limits->thick)
			height[k] = 0;
		flat += height[k] == 0;
	}
	if (flat < 2)
		return add_crossing(s, a, b, height);
	for (int k = 0; k < 3 && !status; k++)
		if (height[k] == 0 && height[(k + 1) % 3] == 0 &&
		    !(flat == 3 && inside_plane(s, 3 * b + (uint32_t)k)))
			status = add_contact(s, a, corner(s->m, b, k), corner(s->m, b, (k + 1) % 3),
			                     flat == 3);
	return status;
}

static int search_triangle(struct search *s, uint32_t a)
{
	s->near.n = 0;
	if (boxes_find(&s->boxes, &s->boxes.box[a], s->limits->thick, &s->near, s->e))
		return -1;
	const uint32_t *b = s->near.data;
	for (size_t i = 0; i < s->near.n; i++)
		if (b[i] != a && !neighbours(s->m, a, b[i]) && add_pair(s, a, b[i]))
			return -1;
	return 0;
}

int find_contacts(const struct model *m, const struct edges *g,
                  const struct imprint_limits *limits, struct contacts *out, struct err *e)
{
	struct search s = { .m = m, .limits = limits, .g = g, .out = out, .e = e };
	int status = -1;

	s.normal = mem_new(m->triangles, sizeof *s.normal, "normals", e);
	if (!s.normal || boxes_build(&s.boxes, m->vertex, m->triangle, m->triangles, e))
		goto done;
	for (size_t t = 0; t < m->triangles; t++) {
		v3_area(corner(m, t, 0), corner(m, t, 1), corner(m, t, 2), s.normal[t]);
		v3_normalise(s.normal[t]);
	}
	status = 0;
	for (uint32_t t = 0; !status && t < m->triangles; t++)
		if (longest_edge(m, t) > limits->size)
			status = search_triangle(&s, t);
done:
	free(s.normal);
	free(s.near.data);
	boxes_free(&s.boxes);
	return status;
}
