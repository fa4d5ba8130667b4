#include "lib/geometry/cubature_pair.h"

#include <assert.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/base/vec.h"

/* In [-1, 1]^4 the 16 points (+-c, +-c, +-c, +-c) and the 8 points +-e on an axis: with these
 * weights the means of 1, u^2, u^4 and u^2 v^2 are 1, 1/3, 1/5 and 1/9, as they should be, so
 * the rule has degree 5. */
static const double c2 = .5, e2 = .8, corner_weight = 1. / 36, edge_weight = 5. / 72;

/* The area's centroid: of two triangles. */
static void find_centroid(const struct facet *f, double x[3])
{
	double area[2], n[3];

	for (int i = 0; i < 2; i++) {
		v3_area(f->v, &f->v[3 * i + 3], &f->v[3 * i + 6], n);
		area[i] = v3_dot(n, f->normal);
	}
	for (int k = 0; k < 3; k++) {
		const double *v = &f->v[k];
		double apart = (area[0] * v[3] + area[1] * v[9]) / (area[0] + area[1]);
		x[k] = (v[0] + v[6] + apart) / 3;
	}
}

void geo_pair_fill(const struct facet *f, struct cubature_pair *j)
{
	const double corner = sqrt(c2), edge = sqrt(e2);
	double skew[3];

	*j = (struct cubature_pair){ .skew = INFINITY };
	if (f->n != 4)
		return;
	find_centroid(f, j->centroid);
	for (int k = 0; k < 3; k++) {
		const double *x = &f->v[k];
		double u = (x[3] + x[6] - x[0] - x[9]) / 4, v = (x[6] + x[9] - x[0] - x[3]) / 4;
		skew[k] = x[0] - x[3] + x[6] - x[9];
		for (int i = 0; i < 4; i++) {
			double along = i & 1 ? v : u, sign = i & 2 ? 1 : -1;
			j->corner[k][i] = j->centroid[k] + corner * (sign * v + (i & 1 ? u : -u));
			j->edge[k][i] = j->centroid[k] + edge * sign * along;
		}
	}
	j->skew = v3_length(skew) / f->radius;
}

/* The error is of the sixth order in r / d where both heights hardly vary over the facets, of
 * the fifth or fourth where one or both do. Over 100 000 pairs of squares, rectangles and
 * parallelograms of radii in ratios to 100, most of them touching the other's plane, it
 * stayed below .85 of sixth r^6 + fifth r^5 d (ra / hb + rb / ha) + fourth r^4 d^2 ra rb / (ha hb),
 * by d^6; r d is below 6 r^2 + d^2 / 24. What is skew errs by its second moments. No
 * command repeats the fit; test_polygon checks the bound for some pairs (test_fitted_pair). */
static const double sixth = .75, fifth = .15, fourth = .025;

int geo_pair_reaches(const struct facet *a, const struct cubature_pair *ja, const struct facet *b,
                     const struct cubature_pair *jb, double tolerance)
{
	double r = a->radius + b->radius, s = r * r, d[3];
	double ha = v3_dot(a->normal, b->centre) - a->offset;
	double hb = v3_dot(b->normal, a->centre) - b->offset;

	v3_sub(b->centre, a->centre, d);
	double r2 = v3_dot(d, d), left = tolerance * r2 - (ja->skew + jb->skew) * s;
	double vary = (6 * fifth * s + fifth / 24 * r2) * (b->radius * hb + a->radius * ha);
	return s * s * (sixth * s * ha * hb + vary + fourth * r2 * a->radius * b->radius) <=
	       left * ha * hb * r2 * r2;
}

/* Heights of four points above a facet's plane. */
static four heights(const struct facet *f, const double (*x)[4])
{
	return f->normal[0] * four_load(x[0]) + f->normal[1] * four_load(x[1]) +
	       f->normal[2] * four_load(x[2]) - f->offset;
}

/* r^4 from four points to one. */
static four r4(const double (*x)[4], double px, double py, double pz)
{
	four dx = four_load(x[0]) - px, dy = four_load(x[1]) - py, dz = four_load(x[2]) - pz;
	four r2 = dx * dx + dy * dy + dz * dz;

	return r2 * r2;
}

double geo_pair_exchange(const struct facet *a, const struct cubature_pair *ja,
                         const struct facet *b, const struct cubature_pair *jb)
{
	const double *ca = ja->centroid, *cb = jb->centroid;
	four of_b = heights(a, jb->corner), of_a = heights(b, ja->corner), p[4];
	four edge_b = heights(a, jb->edge) * (v3_dot(b->normal, ca) - b->offset);
	four edge_a = heights(b, ja->edge) * (v3_dot(a->normal, cb) - a->offset);

	for (int i = 0; i < 4; i++)
		p[i] = r4(jb->corner, ja->corner[0][i], ja->corner[1][i], ja->corner[2][i]);
	/* x / p + y / q by one division. */
	four sum = (of_a[0] * p[1] + of_a[1] * p[0]) / (p[0] * p[1]);
	sum = of_b * (sum + (of_a[2] * p[3] + of_a[3] * p[2]) / (p[2] * p[3]));
	four q = r4(jb->edge, ca[0], ca[1], ca[2]), r = r4(ja->edge, cb[0], cb[1], cb[2]);
	four all = corner_weight * sum + edge_weight * ((edge_b * r + edge_a * q) / (q * r));
	return a->area * b->area * ((all[0] + all[2]) + (all[1] + all[3])) / PI;
}

/* ---- four pairs at a time ---- */

/* Rows of a table: numbers of a facet. */
enum { NORMAL = 0, OFFSET = 3, CENTRE = 4, RADIUS = 7, AREA = 8, SKEW = 9, CENTROID = 10,
       CORNER = 13, EDGE = 25, ROWS = 37 };

int geo_pair_table_new(const struct facet *f, const struct cubature_pair *j, size_t n,
                       double tolerance, double near, struct cubature_pair_table *t, struct err *e)
{
	*t = (struct cubature_pair_table){ .n = n, .tolerance = tolerance, .near = near };
	if (n > SIZE_MAX - 3 || !(t->row = mem_new(n + 3, ROWS * sizeof *t->row, "facets", e)))
		return -1;
	for (size_t i = 0; i < n; i++) {
		const double one[] = { f[i].offset, f[i].centre[0], f[i].centre[1], f[i].centre[2],
			f[i].radius, f[i].area, j[i].skew };
		double *to = t->row + i;
		for (size_t k = 0; k < 3; k++) {
			to[(NORMAL + k) * (n + 3)] = f[i].normal[k];
			to[(CENTROID + k) * (n + 3)] = j[i].centroid[k];
		}
		for (size_t k = 0; k < sizeof one / sizeof *one; k++)
			to[(OFFSET + k) * (n + 3)] = one[k];
		for (size_t k = 0; k < 12; k++) {
			to[(CORNER + k) * (n + 3)] = j[i].corner[k / 4][k % 4];
			to[(EDGE + k) * (n + 3)] = j[i].edge[k / 4][k % 4];
		}
	}
	return 0;
}

void geo_pair_table_free(struct cubature_pair_table *t)
{
	free(t->row);
	*t = (struct cubature_pair_table){ 0 };
}

/* Four facets: of a table, or one of it four times. */
struct quad {
	const double *at;
	size_t stride;
};

static inline four number(const struct quad *q, size_t row)
{
	return four_load(q->at + row * q->stride);
}

/* Coordinate k of point i: CORNER or EDGE. */
static inline four coordinate(const struct quad *q, size_t points, size_t k, size_t i)
{
	return number(q, points + 4 * k + i);
}

/* Height above the plane of `of`. */
static inline four height(const struct quad *of, four x, four y, four z)
{
	return number(of, NORMAL) * x + number(of, NORMAL + 1) * y + number(of, NORMAL + 2) * z -
	       number(of, OFFSET);
}

static inline four height_of(const struct quad *of, const struct quad *q, size_t points, size_t i)
{
	return height(of, coordinate(q, points, 0, i), coordinate(q, points, 1, i),
	              coordinate(q, points, 2, i));
}

static inline four r4_to(const struct quad *q, size_t points, size_t i, four x, four y, four z)
{
	four dx = coordinate(q, points, 0, i) - x, dy = coordinate(q, points, 1, i) - y;
	four dz = coordinate(q, points, 2, i) - z, r2 = dx * dx + dy * dy + dz * dz;

	return r2 * r2;
}

/* The sum of h / r^4 over the four points of q as seen from one. */
static inline four sum_from(const struct quad *q, size_t points, const four h[4], four x, four y,
                            four z)
{
	four p[4];

	for (size_t i = 0; i < 4; i++)
		p[i] = r4_to(q, points, i, x, y, z);
	return (h[0] * p[1] + h[1] * p[0]) / (p[0] * p[1]) +
	       (h[2] * p[3] + h[3] * p[2]) / (p[2] * p[3]);
}

/* geo_pair_reaches, for facets wholly in front of one another. */
static four_mask quad_reaches(const struct quad *a, const struct quad *b, four ha, four hb,
                              double tolerance)
{
	four d[3], ra = number(a, RADIUS), rb = number(b, RADIUS);

	for (size_t k = 0; k < 3; k++)
		d[k] = number(b, CENTRE + k) - number(a, CENTRE + k);
	four r2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2], s = (ra + rb) * (ra + rb);
	four left = tolerance * r2 - (number(a, SKEW) + number(b, SKEW)) * s;
	four vary = (6 * fifth * s + fifth / 24 * r2) * (rb * hb + ra * ha);
	return (hb >= ra) & (ha >= rb) &
	       (s * s * (sixth * s * ha * hb + vary + fourth * r2 * ra * rb) <=
	        left * ha * hb * r2 * r2);
}

/* Are all corners of one facet behind the other's plane, or as good as in it? */
static four_mask quad_behind(const struct quad *a, const struct quad *b, four ha, four hb,
                             double near)
{
	four sine2 = { 0 };

	for (size_t k = 0; k < 3; k++) {
		size_t u = (k + 1) % 3, v = (k + 2) % 3;
		four c = number(a, NORMAL + u) * number(b, NORMAL + v) -
		         number(a, NORMAL + v) * number(b, NORMAL + u);
		sine2 += c * c;
	}
	four sine = four_sqrt(sine2);
	return (ha + number(b, RADIUS) * sine <= near) | (hb + number(a, RADIUS) * sine <= near);
}

static four quad_exchange(const struct quad *a, const struct quad *b)
{
	four ca[3], cb[3], of_b[4], edge_a[4], edge_b[4], corners = { 0 };

	for (size_t k = 0; k < 3; k++) {
		ca[k] = number(a, CENTROID + k);
		cb[k] = number(b, CENTROID + k);
	}
	for (size_t i = 0; i < 4; i++) {
		of_b[i] = height_of(a, b, CORNER, i);
		edge_a[i] = height_of(b, a, EDGE, i);
		edge_b[i] = height_of(a, b, EDGE, i);
	}
	for (size_t i = 0; i < 4; i++)
		corners += height_of(b, a, CORNER, i) *
		           sum_from(b, CORNER, of_b, coordinate(a, CORNER, 0, i),
		                    coordinate(a, CORNER, 1, i), coordinate(a, CORNER, 2, i));
	four edges = height(b, ca[0], ca[1], ca[2]) *
	             sum_from(b, EDGE, edge_b, ca[0], ca[1], ca[2]) +
	             height(a, cb[0], cb[1], cb[2]) *
	             sum_from(a, EDGE, edge_a, cb[0], cb[1], cb[2]);
	return number(a, AREA) * number(b, AREA) *
	       (corner_weight * corners + edge_weight * edges) * (1 / PI);
}

void geo_pair_one(const struct cubature_pair_table *t, size_t i, double one[PAIR_ONE])
{
	static_assert((int)PAIR_ONE == 4 * ROWS, "PAIR_ONE");

	for (size_t row = 0; row < ROWS; row++)
		for (size_t k = 0; k < 4; k++)
			one[4 * row + k] = t->row[row * (t->n + 3) + i];
}

int geo_pair_four(const struct cubature_pair_table *t, const double one[PAIR_ONE], size_t j,
                  int swap, double x[4])
{
	const struct quad same = { one, 4 }, other = { t->row + j, t->n + 3 };
	const struct quad *a = swap ? &other : &same, *b = swap ? &same : &other;
	four ha = height(a, number(b, CENTRE), number(b, CENTRE + 1), number(b, CENTRE + 2));
	four hb = height(b, number(a, CENTRE), number(a, CENTRE + 1), number(a, CENTRE + 2));
	four_mask behind = quad_behind(a, b, ha, hb, t->near);
	four_mask reached = quad_reaches(a, b, ha, hb, t->tolerance) & ~behind;
	four sum = { 0 };

	if (four_bits(reached))
		sum = four_choose(reached, quad_exchange(a, b), sum);
	four_store(x, sum);
	return four_bits(reached | behind);
}
