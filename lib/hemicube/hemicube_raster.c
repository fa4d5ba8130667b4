/* Triangles onto one face of the item buffer.
 *
 * Closed surfaces stay closed: whether a pixel's centre is left of an edge is a
 * function of the edge's two end points alone, so the two triangles at an edge
 * split a row at the same pixel, and rows are split half-open at the vertices.
 * Triangles that cross or pass behind the eye are clipped by the planes of a
 * pyramid somewhat wider than the face, whose apex is the eye: there is no near
 * plane. Depth is 1/w, which is affine in a face's pixels. */
#include <math.h>
#include <string.h>

#include "lib/hemicube/hemicube.h"
#include "lib/hemicube/hemicube_raster.h"
#include "lib/hemicube/hemicube_scene.h"

typedef double v4d __attribute__((vector_size(32)));
typedef float v4f __attribute__((vector_size(16)));
typedef float v8f __attribute__((vector_size(32)));
typedef int32_t v8i __attribute__((vector_size(32)));
typedef uint32_t v8u __attribute__((vector_size(32)));

/* Pixels; a guess, some steps of float32 at the size of the grid. */
static const double THIN = 1e-7;

/* 1/w = q0 + qx x + qy y over a triangle, (x, y) in pixels. */
struct depth_plane {
	double q0, qx, qy;
};

/* Draws columns [left, right) of a row. A pixel's depth is a function of the plane
 * and the pixel alone, so coincident surfaces get the same. */
static inline void draw_span(const struct hemicube_target *t, int row, int left, int right,
                             const struct depth_plane *p, uint32_t item)
{
	static const v8i lane = { 0, 1, 2, 3, 4, 5, 6, 7 };
	static const v4d low = { .5, 1.5, 2.5, 3.5 }, high = { 4.5, 5.5, 6.5, 7.5 };
	size_t first = (size_t)row * (size_t)t->columns;
	double q = p->q0 + p->qy * (row + .5);
	v8u id = item - (v8u){ 0 };

	for (int i = left; i < right; i += HEMICUBE_LANES) {
		v4f a = __builtin_convertvector(q + p->qx * (low + i), v4f);
		v4f b = __builtin_convertvector(q + p->qx * (high + i), v4f);
		v8f z, near = __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
		v8u seen;
		memcpy(&z, t->depth + first + i, sizeof z);
		memcpy(&seen, t->item + first + i, sizeof seen);
		v8i wins = (lane < right - i) &
		           ((near > z) | ((near == z) & (v8i)(id < seen)));
		z = (v8f)(((v8i)near & wins) | ((v8i)z & ~wins));
		seen = (id & (v8u)wins) | (seen & ~(v8u)wins);
		memcpy(t->depth + first + i, &z, sizeof z);
		memcpy(t->item + first + i, &seen, sizeof seen);
	}
}

/* An edge from a to b, a->row < b->row: where it crosses rows. */
struct edge {
	double x, y, slope, low, high;
};

static inline struct edge edge_between(const struct hemicube_corner *a, const struct hemicube_corner *b)
{
	return (struct edge){ a->x - .5, a->y - .5, (b->x - a->x) / (b->y - a->y),
	                      min_d(a->x, b->x) - .5, max_d(a->x, b->x) - .5 };
}

/* First column whose centre is not left of the edge at a row's centre. */
static inline int edge_column(const struct edge *e, int row)
{
	double x = e->x + (row - e->y) * e->slope;

	return (int)ceil(max_d(min_d(x, e->high), e->low));
}

static inline void draw_rows(const struct hemicube_target *t, int begin, int end,
                             const struct edge *e, const struct edge *f,
                             const struct depth_plane *p, uint32_t item)
{
	for (int row = begin; row < end; row++) {
		int i = edge_column(e, row), j = edge_column(f, row);
		int left = max_i(min_i(i, j), 0), right = min_i(max_i(i, j), t->columns);
		if (left < right)
			draw_span(t, row, left, right, p, item);
	}
}

/* Sorts by row and draws above and below the middle corner. */
static void draw_triangle(const struct hemicube_target *t, const struct hemicube_corner *a,
                          const struct hemicube_corner *b, const struct hemicube_corner *c,
                          const struct depth_plane *p, uint32_t item)
{
	const struct hemicube_corner *swap;

	if (b->row < a->row)
		swap = a, a = b, b = swap;
	if (c->row < b->row) {
		swap = b, b = c, c = swap;
		if (b->row < a->row)
			swap = a, a = b, b = swap;
	}
	int begin = max_i(a->row, 0), end = min_i(c->row, t->rows);
	if (begin >= end)
		return;
	struct edge whole = edge_between(a, c);
	int middle = max_i(begin, min_i(b->row, end));
	if (begin < middle) {
		struct edge upper = edge_between(a, b);
		draw_rows(t, begin, middle, &whole, &upper, p, item);
	}
	if (middle < end) {
		struct edge lower = edge_between(b, c);
		draw_rows(t, middle, end, &whole, &lower, p, item);
	}
}

/* The depth plane of the triangle abc (face coordinates), whose 1/w lies in
 * [low, high], and the side of it that faces the eye. With normal N and D = N.a,
 * 1/w = N.(u/w, v/w, 1) / D. */
static inline int depth_plane(const struct hemicube_target *t, const double a[3], const double b[3],
                              const double c[3], double low, double high,
                              struct depth_plane *p)
{
	double d[3], e[3];

	for (int k = 0; k < 3; k++)
		d[k] = b[k] - a[k], e[k] = c[k] - a[k];
	double n[3] = { d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2],
		        d[0] * e[1] - d[1] * e[0] };
	double D = n[0] * a[0] + n[1] * a[1] + n[2] * a[2], inverse = 1 / D;
	p->qx = n[0] * inverse * t->pixel;
	p->qy = n[1] * inverse * t->pixel;
	p->q0 = (n[2] - n[0]) * inverse - p->qy * t->centre_row;
	/* Seen edge on, thinner than THIN pixels: the plane is ill defined, but gaps
	 * must not open. */
	if (!((fabs(p->qx) + fabs(p->qy)) * THIN < high - low))
		p->q0 = high, p->qx = p->qy = 0;
	return D < 0 ? FRONT : BACK;
}

static int32_t ceil_centre(double x)
{
	return (int32_t)ceil(x - .5);
}

/* Distance inside plane k of the pyramid, times a constant. */
static double inside_plane(int k, const double p[3])
{
	double x = p[k / 2];

	return k % 2 ? HEMICUBE_GUARD * p[2] + x : HEMICUBE_GUARD * p[2] - x;
}

/* Clips the polygon a of n corners by the pyramid's planes (Sutherland and
 * Hodgman 1974); the number of corners left in a, at most n + 4. Where an edge
 * is cut does not depend on its direction. */
static int clip(double (*a)[3], int n)
{
	double b[8][3];

	for (int k = 0; k < 4; k++) {
		int m = 0;
		for (int i = 0; i < n; i++) {
			const double *p = a[i], *q = a[i + 1 < n ? i + 1 : 0];
			double dp = inside_plane(k, p), dq = inside_plane(k, q);
			if (dp >= 0)
				memcpy(b[m++], p, sizeof b[0]);
			if ((dp >= 0) == (dq >= 0))
				continue;
			for (int j = 0; j < 3; j++)
				b[m][j] = (p[j] * dq - q[j] * dp) / (dq - dp);
			m++;
		}
		n = m;
		memcpy(a, b, (size_t)n * sizeof a[0]);
	}
	return n;
}

static void corner_project(const struct hemicube_target *t, const double p[3], struct hemicube_corner *c)
{
	double limit = (HEMICUBE_GUARD + 1) * t->half;

	c->q = 1 / p[2];
	c->x = (p[0] * c->q + 1) * t->half;
	c->y = p[1] * c->q * t->half + t->centre_row;
	c->x = max_d(-limit, min_d(c->x, limit));
	c->y = max_d(-limit, min_d(c->y, limit));
	c->column = ceil_centre(c->x);
	c->row = ceil_centre(c->y);
}

void ff_hemicube_draw_clipped(const struct hemicube_target *t, double v[3][3], uint32_t element)
{
	double polygon[8][3];
	struct hemicube_corner c[8];
	struct depth_plane p;
	double low = INFINITY, high = 0;

	memcpy(polygon, v, 3 * sizeof polygon[0]);
	int n = clip(polygon, 3);
	for (int i = 0; i < n; i++) {
		if (!(polygon[i][2] > 0))
			return; /* touches the eye: it is seen edge on */
		corner_project(t, polygon[i], &c[i]);
		low = min_d(low, c[i].q);
		high = max_d(high, c[i].q);
	}
	if (n < 3)
		return;
	uint32_t side = (uint32_t)depth_plane(t, v[0], v[1], v[2], low, high, &p);
	for (int i = 2; i < n; i++)
		draw_triangle(t, &c[0], &c[i - 1], &c[i], &p, 2 * element + side);
}

void ff_hemicube_draw(const struct hemicube_target *t, double v[3][3], const struct hemicube_corner c[3],
                      uint32_t element)
{
	struct depth_plane p;
	uint32_t side = (uint32_t)depth_plane(t, v[0], v[1], v[2],
	                                      min_d(c[0].q, min_d(c[1].q, c[2].q)),
	                                      max_d(c[0].q, max_d(c[1].q, c[2].q)), &p);

	draw_triangle(t, &c[0], &c[1], &c[2], &p, 2 * element + side);
}
