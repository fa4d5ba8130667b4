#include "shadow.h"

#include <math.h>

#include "body_polygons.h"
#include "vec3.h"

/* ---- cuts ---- */

struct cuts {
	const struct facet *f;
	double near;
	struct plane *cut;
	int n;
};

/* 1 if the corners are all on one side of a plane (on it counts as either). */
static int one_side(const struct plane *p, const double *x, int n, int stride, double near)
{
	int above = 0, below = 0;

	for (int i = 0; i < n && !(above && below); i++) {
		double h = plane_height(p, x + i * stride);
		above |= h > near;
		below |= h < -near;
	}
	return !(above && below);
}

static void add(struct cuts *c, const struct plane *p)
{
	double lowest, highest;

	facet_heights(c->f, p->normal, p->offset, &lowest, &highest);
	if (lowest >= -c->near || highest <= c->near || c->n == SHADOW_CUTS)
		return;
	for (int i = 0; i < c->n; i++)
		if (fabs(fabs(v3_dot(c->cut[i].normal, p->normal)) - 1) < 1e-12 &&
		    fabs(fabs(c->cut[i].offset) - fabs(p->offset)) < c->near)
			return;
	c->cut[c->n++] = *p;
}

/* The plane through an edge and a point; 0 if they are in line. */
static int plane_through(const double a[3], const double b[3], const double x[3], double near,
                         struct plane *p)
{
	double u[3], v[3];

	v3_sub(b, a, u);
	v3_sub(x, a, v);
	v3_cross(u, v, p->normal);
	double sine = v3_length(p->normal);
	if (!(sine > near * v3_length(u)))
		return 0;
	for (int k = 0; k < 3; k++)
		p->normal[k] /= sine;
	p->offset = v3_dot(p->normal, a);
	return 1;
}

/* Corners of a blocker: where its edges begin, and end. */
static int blocker_one_side(const struct blocker *b, const struct plane *p, double near)
{
	const int stride = (int)(sizeof b->edge[0] / sizeof(double));

	return one_side(p, b->edge[0].a, b->edges, stride, near) &&
	       one_side(p, b->edge[0].b, b->edges, stride, near);
}

static int parallel(const double a[3], const double b[3], const double c[3], const double d[3])
{
	double u[3], v[3], s[3];

	v3_sub(b, a, u);
	v3_sub(d, c, v);
	v3_cross(u, v, s);
	return v3_dot(s, s) <= 1e-12 * v3_dot(u, u) * v3_dot(v, v);
}

static void blocker_cuts(struct cuts *c, const struct blocker *b, const struct facet *g)
{
	struct plane p;

	for (int i = 0; i < b->edges; i++)
		for (int j = 0; j < g->n; j++) {
			const double *from = b->edge[i].a, *to = b->edge[i].b, *v = &g->v[3 * j];
			const double *next = &g->v[3 * ((j + 1) % g->n)];
			if (plane_through(from, to, v, c->near, &p) &&
			    (parallel(from, to, v, next) ||
			     (one_side(&p, g->v, g->n, 3, c->near) && blocker_one_side(b, &p, c->near))))
				add(c, &p);
			if (plane_through(v, next, from, c->near, &p) &&
			    one_side(&p, g->v, g->n, 3, c->near) && blocker_one_side(b, &p, c->near))
				add(c, &p);
		}
}

int shadow_cuts(const struct blocker *b, int blockers, const struct facet *f,
                const struct facet *g, double near, struct plane cut[SHADOW_CUTS])
{
	struct cuts c = { f, near, cut, 0 };

	for (int i = 0; i < blockers; i++)
		blocker_cuts(&c, &b[i], g);
	return c.n;
}

/* ---- cells ---- */

/* Is the blocker beyond one of the planes that hold both facets behind them? */
static int outside(const struct blocker *b, const struct plane *shaft, int planes, double near)
{
	for (int p = 0; p < planes; p++) {
		int i = 0;
		while (i < b->edges && plane_height(&shaft[p], b->edge[i].a) >= -near &&
		       plane_height(&shaft[p], b->edge[i].b) >= -near)
			i++;
		if (i == b->edges)
			return 1;
	}
	return 0;
}

/* Does the segment from p to q meet the blocker? */
static int cuts_flat(const struct blocker *b, const double p[3], const double q[3], double near)
{
	const struct plane *plane = &b->face[0];
	double hp = plane_height(plane, p), hq = plane_height(plane, q), x[3];

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
		if (v3_dot(c, d) < 0)
			return 0;
	}
	return 1;
}

static int cuts_solid(const struct blocker *b, const double p[3], const double q[3])
{
	double from = 0, to = 1;

	for (int i = 0; i < b->faces; i++) {
		double hp = plane_height(&b->face[i], p), hq = plane_height(&b->face[i], q);
		if (hp > 0 && hq > 0)
			return 0;
		if (hp > 0)
			from = fmax(from, hp / (hp - hq));
		else if (hq > 0)
			to = fmin(to, hp / (hp - hq));
	}
	return from <= to;
}

int blocker_hides(const struct blocker *b, const struct facet *f, const struct facet *g,
                  double near)
{
	for (int i = 0; i < f->n; i++)
		for (int j = 0; j < g->n; j++)
			if (!(b->flat ? cuts_flat(b, &f->v[3 * i], &g->v[3 * j], near)
			              : cuts_solid(b, &f->v[3 * i], &g->v[3 * j])))
				return 0;
	return 1;
}

uint64_t shadow_on(const struct blocker *b, uint64_t from, const struct facet *cell,
                   const struct facet *g, double near, int *hidden)
{
	struct plane shaft[SHAFT_PLANES];
	int planes = shaft_planes(cell, g, near, shaft);
	uint64_t left = from;

	*hidden = 0;
	for (uint64_t i = from; i; i &= i - 1) {
		int k = __builtin_ctzll(i);
		if (outside(&b[k], shaft, planes, near))
			left &= ~((uint64_t)1 << k);
		else if ((*hidden = blocker_hides(&b[k], cell, g, near)))
			return left;
	}
	return left;
}
