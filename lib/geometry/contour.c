#include "lib/geometry/contour.h"

#include "lib/base/constants.h"
#include "lib/base/vec.h"
#include "lib/geometry/point_polygon.h"

/* Bisections of an edge, at most: towards a corner that it nearly meets, each halves the rest,
 * and after some 50 that is the rounding of the edge's length. */
enum { DEEPEST = 48 };

/* Cosine of two edges below which they are perpendicular: what they contribute, which is in
 * proportion to it, is rounding. */
static const double perpendicular = 1e-16;

/* Squared sine of two edges below which they are parallel: 1e-12 is well above the rounding of
 * their directions and moves an end by as little. The value is a guess. */
static const double parallel_sine2 = 1e-24;

/* Error that the adaptive quadrature of two edges may have, over the product of their
 * lengths: a few roundings; tests/unit/geometry/test_polygon.c compares with exact values. */
static const double quadrature_error = 1e-15;

double geo_contour_point(const double x[3], const double normal[3], int n, const double *v)
{
	struct point_polygon p;

	geo_point_polygon_make(&p, x, n, v);
	return geo_point_polygon_factor(&p, normal);
}

/* ---- the integral of ln r over a pair of edges ---- */

struct edge {
	double a[3], b[3], t[3], length; /* from a to b along the unit vector t */
};

/* Integral of ln |x - y| over y on an edge. */
static double to_edge(const double x[3], const struct edge *f)
{
	double d[3], c[3];

	v3_sub(f->a, x, d);
	double p = v3_dot(d, f->t), q = p + f->length;
	v3_cross(d, f->t, c);
	double h2 = v3_dot(c, c), h = sqrt(h2), p2 = p * p + h2, q2 = q * q + h2;
	double sum = -f->length;

	if (q2 > 0)
		sum += .5 * q * log(q2);
	if (p2 > 0)
		sum -= .5 * p * log(p2);
	if (h > 0)
		sum += h * atan2(h * f->length, h2 + p * q);
	return sum;
}

/* Second antiderivative of ln sqrt(u^2 + h^2). */
static double twice_integrated(double u, double h)
{
	double r2 = u * u + h * h;

	if (!(r2 > 0))
		return 0;
	return .25 * (u * u - h * h) * log(r2) - .75 * u * u + (h > 0 ? h * u * atan2(u, h) : 0);
}

/* Parallel edges, same or opposite direction (c = +-1). */
static double parallel(const struct edge *e, const struct edge *f, double c)
{
	double d[3], s[3];

	v3_sub(f->a, e->a, d);
	double p = v3_dot(d, e->t), q = p + c * f->length;
	v3_cross(d, e->t, s);
	double h = v3_length(s), lo = fmin(p, q), hi = fmax(p, q);

	return twice_integrated(e->length - lo, h) - twice_integrated(e->length - hi, h) -
	       twice_integrated(-lo, h) + twice_integrated(-hi, h);
}

static int same_point(const double a[3], const double b[3])
{
	return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* Edges with a common corner. About it ln r is homogeneous but for a constant, so by
 * Euler's theorem the area integral is one over the far sides of the rectangle. */
static double cornered(const struct edge *e, const double e_far[3], const struct edge *f,
                       const double f_far[3])
{
	return .5 * (e->length * to_edge(e_far, f) + f->length * to_edge(f_far, e) -
	             e->length * f->length);
}

/* Abscissae and weights of the Gauss-Kronrod pair (7, 15) on [-1, 1]: QUADPACK, 1983. */
static const double kronrod_x[8] = {
	.991455371120812639206854697526329, .949107912342758524526189684047851,
	.864864423359769072789712788640926, .741531185599394439863864773280788,
	.586087235467691130294144691693013, .405845151377397166906606412076961,
	.207784955007898467600689403773245, 0
};
static const double kronrod_w[8] = {
	.022935322010529224963732008058970, .063092092629978553290700663189204,
	.104790010322250183839876322541518, .140653259715525918745189590510238,
	.169004726639267902826583426598550, .190350578064785409913256402421014,
	.204432940075298892414161999234649, .209482141084727828012999174891714
};
static const double gauss_w[4] = {
	.129484966168869693270611432679082, .279705391489276667901467771423780,
	.381830050505118944950369775488975, .417959183673469387755102040816327
};

static double adaptive(const struct edge *e, const struct edge *f, double s0, double s1,
                       double tolerance, int depth)
{
	double half = (s1 - s0) / 2, mid = (s0 + s1) / 2, k = 0, g = 0, x[3];

	for (int i = 0; i < 8; i++)
		for (int sign = 1; sign >= (i == 7 ? 1 : -1); sign -= 2) {
			v3_mad(e->a, mid + sign * half * kronrod_x[i], e->t, x);
			double y = to_edge(x, f);
			k += kronrod_w[i] * y;
			g += i & 1 ? gauss_w[i / 2] * y : 0;
		}
	/* The Kronrod value is as good as (200 x the difference)^1.5: both are QUADPACK's. */
	double scale = f->length * half, off = fabs(k - g) * half / scale;
	if (depth == 0 || scale * fmin(off, pow(200 * off, 1.5)) <= tolerance)
		return k * half;
	return adaptive(e, f, s0, mid, tolerance / 2, depth - 1) +
	       adaptive(e, f, mid, s1, tolerance / 2, depth - 1);
}

static double edge_pair(const struct edge *e, const struct edge *f)
{
	double c = v3_dot(e->t, f->t), s[3];

	if (fabs(c) < perpendicular)
		return 0;
	v3_cross(e->t, f->t, s);
	if (v3_dot(s, s) < parallel_sine2)
		return c * parallel(e, f, c > 0 ? 1 : -1);
	if (same_point(e->a, f->a))
		return c * cornered(e, e->b, f, f->b);
	if (same_point(e->b, f->b))
		return c * cornered(e, e->a, f, f->a);
	if (same_point(e->a, f->b))
		return c * cornered(e, e->b, f, f->a);
	if (same_point(e->b, f->a))
		return c * cornered(e, e->a, f, f->b);
	const struct edge *outer = e->length < f->length ? e : f, *inner = outer == e ? f : e;
	return c * adaptive(outer, inner, 0, outer->length,
	                    quadrature_error * e->length * f->length, DEEPEST);
}

static void make_edge(const struct facet *p, int i, const double origin[3], double unit,
                      struct edge *e)
{
	for (int k = 0; k < 3; k++) {
		e->a[k] = (p->v[3 * i + k] - origin[k]) / unit;
		e->b[k] = (p->v[3 * ((i + 1) % p->n) + k] - origin[k]) / unit;
	}
	v3_sub(e->b, e->a, e->t);
	e->length = v3_normalise(e->t);
}

double geo_contour_exchange(const struct facet *p, const struct facet *q)
{
	double sum = 0, unit = p->radius + q->radius;
	struct edge e, f;

	for (int i = 0; i < p->n; i++) {
		make_edge(p, i, p->centre, unit, &e);
		for (int j = 0; e.length > 0 && j < q->n; j++) {
			make_edge(q, j, p->centre, unit, &f);
			if (f.length > 0)
				sum += edge_pair(&e, &f);
		}
	}
	return fmax(0, sum / (2 * PI) * unit * unit);
}
