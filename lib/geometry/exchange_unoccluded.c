#include "lib/geometry/exchange_unoccluded.h"

#include "lib/base/vec.h"
#include "lib/geometry/contour.h"

void geo_unoccluded_init(struct unoccluded *x, double relative)
{
	x->relative = relative;
	geo_cubature_reach(relative, x->reach);
}

/* Distance of a point from a facet. */
static double distance(const double p[3], const struct facet *f)
{
	double least = INFINITY, h = v3_dot(f->normal, p) - f->offset;
	int inside = 1;

	for (int i = 0; i < f->n; i++) {
		const double *a = &f->v[3 * i], *b = &f->v[3 * ((i + 1) % f->n)];
		double u[3], v[3], c[3];
		v3_sub(b, a, u);
		v3_sub(p, a, v);
		v3_cross(u, v, c);
		inside = inside && v3_dot(c, f->normal) >= 0;
		double t = v3_dot(u, v) / v3_dot(u, u);
		v3_mad(v, -fmin(1, fmax(0, t)), u, v);
		least = fmin(least, v3_length(v));
	}
	return inside ? fabs(h) : least;
}

/* The lowest level for a facet seen from a distance of `gap` around its centre. */
static int level(const struct unoccluded *x, const struct facet *f, double gap)
{
	int l = f->n % 2 ? 1 : 0; /* level 0 is for quadrilaterals */

	while (l < CUBATURE_LEVELS && gap < x->reach[l] * f->radius)
		l++;
	return l;
}

static const struct cubature *points(struct unoccluded *x, int which, const struct facet *f,
                                     const struct cubature *stored, int l, struct cubature *room)
{
	if (stored && stored[l].n)
		return &stored[l];
	*room = (struct cubature){ 0, x->points[which][0], x->points[which][1],
	                           x->points[which][2], x->points[which][3] };
	geo_cubature_fill(f, l, room);
	return room;
}

/* Lambert's formula for all of b, over the points of the smaller facet a. */
static double lambert(const struct facet *a, const struct cubature *c, const struct facet *b)
{
	double sum = 0;

	for (int i = 0; i < c->n; i++) {
		double at[3] = { c->x[i], c->y[i], c->z[i] };
		if (c->w[i] > 0)
			sum += c->w[i] * geo_contour_point(at, a->normal, b->n, b->v);
	}
	return sum;
}

double geo_unoccluded_exchange(struct unoccluded *x, const struct facet *a,
                               struct unoccluded_points pa, const struct facet *b,
                               struct unoccluded_points pb)
{
	struct cubature ra, rb;
	double d[3];

	if (pa.pair && pb.pair && geo_pair_reaches(a, pa.pair, b, pb.pair, x->relative))
		return geo_pair_exchange(a, pa.pair, b, pb.pair);
	v3_sub(b->centre, a->centre, d);
	double apart = v3_length(d);
	int la = level(x, a, apart - b->radius), lb = level(x, b, apart - a->radius);

	if (la < CUBATURE_LEVELS && lb < CUBATURE_LEVELS) {
		return geo_cubature_exchange(a, points(x, 0, a, pa.level, la, &ra), b,
		                             points(x, 1, b, pb.level, lb, &rb));
	}
	/* A small facet close to a large one. */
	const struct facet *small = a->radius < b->radius ? a : b, *large = small == a ? b : a;
	int l = level(x, small, distance(small->centre, large));
	/* With the finest level's 36 points Lambert's formula costs as much as the contour: a
	 * guess. */
	if (l < CUBATURE_LEVELS - 1)
		return lambert(small, points(x, 0, small, NULL, l, &ra), large);
	return geo_contour_exchange(a, b);
}
