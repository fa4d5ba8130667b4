#include "lib/occlusion/occluder.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/occlusion/occluder_polygons.h"

/* ---- what of an occluder is in front of a facet ---- */

static void put_corner(struct occluder *o, const double x[3])
{
	memcpy(o->corner[o->corners++], x, 3 * sizeof *x);
}

static void put_edge(struct occluder *o, const double a[3], const double b[3],
                     const double along[3], int left, int right)
{
	memcpy(o->edge[o->edges].a, a, 3 * sizeof *a);
	memcpy(o->edge[o->edges].b, b, 3 * sizeof *b);
	memcpy(o->edge[o->edges].along, along, 3 * sizeof *along);
	o->edge[o->edges].left = left;
	o->edge[o->edges++].right = right;
}

/* Where the plane that cuts an occluder crosses each of its faces. */
struct cut {
	int points[OCCLUDER_SHAPE_FACES];
	double point[OCCLUDER_SHAPE_FACES][2][3];
};

static void note_cut(struct cut *c, int face, const double x[3])
{
	if (c->points[face] < 2)
		memcpy(c->point[face][c->points[face]++], x, 3 * sizeof *x);
}

/* Edges, and what is cut off them. h: heights of the corners over the plane. */
static void put_edges(const struct occluder_set *s, const struct occluder_shape *b, const double *h,
                      struct occluder *out, struct cut *cut)
{
	for (uint32_t i = 0; i < b->edges; i++) {
		const struct occluder_edge *e = &s->edge[b->edge + i];
		const double *p = &s->corner[3 * (size_t)e->a], *q = &s->corner[3 * (size_t)e->b];
		double hp = h[e->a - b->corner], hq = h[e->b - b->corner], x[3];
		int p_in = hp >= -s->near, q_in = hq >= -s->near;
		if (p_in && q_in) {
			put_edge(out, p, q, e->along, e->left, e->right);
			continue;
		}
		if (!p_in && !q_in)
			continue;
		if (p_in ? hp > s->near : hq > s->near) {
			geo_edge_divide(p, hp, q, hq, x);
			put_corner(out, x);
			put_edge(out, p_in ? p : x, p_in ? x : q, e->along, e->left, e->right);
		} else {
			memcpy(x, p_in ? p : q, sizeof x);
		}
		note_cut(cut, e->left, x);
		if (!b->flat)
			note_cut(cut, e->right, x);
	}
}

int occ_occluder_make(const struct occluder_set *s, uint32_t occluder, const struct facet *f,
                      struct occluder *out)
{
	const struct occluder_shape *b = &s->occluder[occluder];
	struct cut cut = { { 0 }, { { { 0 } } } };
	double h[OCCLUDER_CORNERS], along[3];

	out->corners = out->edges = 0;
	out->faces = (int)b->faces;
	out->flat = b->flat;
	memcpy(out->face, &s->face[b->face], b->faces * sizeof *out->face);
	out->face[b->faces].offset = -f->offset;
	for (int k = 0; k < 3; k++)
		out->face[b->faces].normal[k] = -f->normal[k];
	for (uint32_t i = 0; i < b->corners; i++) {
		const double *x = &s->corner[3 * (size_t)(b->corner + i)];
		h[i] = v3_dot(f->normal, x) - f->offset;
		if (h[i] >= -s->near)
			put_corner(out, x);
	}
	put_edges(s, b, h, out, &cut);
	for (int i = 0; i < out->faces && out->edges; i++)
		if (cut.points[i] == 2) {
			v3_sub(cut.point[i][1], cut.point[i][0], along);
			v3_normalise(along);
			put_edge(out, cut.point[i][0], cut.point[i][1], along, i,
			         b->flat ? i : out->faces);
		}
	for (int k = 0; k < 3; k++) {
		out->centre[k] = 0;
		for (int i = 0; i < out->corners; i++)
			out->centre[k] += out->corner[i][k] / out->corners;
	}
	return out->edges >= 3;
}

/* ---- what it hides ---- */

/* Does the segment from p to q meet the occluder? */
static int cuts_flat(const struct occluder *b, const double p[3], const double q[3], double near)
{
	const struct plane *plane = &b->face[0];
	double hp = occ_plane_height(plane, p), hq = occ_plane_height(plane, q), x[3];

	if (!((hp > near && hq < -near) || (hp < -near && hq > near)))
		return 0;
	for (int k = 0; k < 3; k++)
		x[k] = p[k] + hp / (hp - hq) * (q[k] - p[k]);
	for (int i = 0; i < b->edges; i++) {
		double u[3], v[3], w[3], c[3], d[3];
		v3_sub(b->edge[i].b, b->edge[i].a, u);
		v3_sub(x, b->edge[i].a, v);
		v3_sub(b->centre, b->edge[i].a, w);
		v3_cross(u, v, c);
		v3_cross(u, w, d);
		if (v3_dot(c, d) < -near * v3_length(u) * v3_length(d))
			return 0;
	}
	return 1;
}

static int cuts_solid(const struct occluder *b, const double p[3], const double q[3], double near)
{
	double from = 0, to = 1;

	for (int i = 0; i < b->faces; i++) {
		double hp = occ_plane_height(&b->face[i], p) - near;
		double hq = occ_plane_height(&b->face[i], q) - near;
		if (hp > 0 && hq > 0)
			return 0;
		if (hp > 0)
			from = fmax(from, hp / (hp - hq));
		else if (hq > 0)
			to = fmin(to, hp / (hp - hq));
	}
	return from <= to;
}

int occ_occluder_hides(const struct occluder *b, const struct facet *f, const struct facet *g,
                       double near)
{
	for (int i = 0; i < f->n; i++)
		for (int j = 0; j < g->n; j++)
			if (!(b->flat ? cuts_flat(b, &f->v[3 * i], &g->v[3 * j], near)
			              : cuts_solid(b, &f->v[3 * i], &g->v[3 * j], near)))
				return 0;
	return 1;
}

int occ_occluders_hide(const struct occluder *b, uint64_t from, const struct facet *f,
                       const struct facet *g, double near, int depth)
{
	struct facet_room half[2];
	struct facet eye = { .n = 1, .v = f->centre }, aim = { .n = 1, .v = g->centre };
	int crossed = 0;

	for (uint64_t i = from; i; i &= i - 1) {
		const struct occluder *k = &b[__builtin_ctzll(i)];
		if (!occ_occluder_hides(k, &eye, &aim, near))
			continue;
		crossed = 1;
		if (occ_occluder_hides(k, f, g, near))
			return 1;
	}
	return crossed && depth > 0 && geo_facet_halve(g, half) &&
	       occ_occluders_hide(b, from, f, &half[0].f, near, depth - 1) &&
	       occ_occluders_hide(b, from, f, &half[1].f, near, depth - 1);
}
