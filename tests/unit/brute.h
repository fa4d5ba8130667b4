/* Brute force: what a point sees of a polygon past the triangles of a scene, each cut
 * out on its own, and its integral over another polygon. Shares no code with lib/. */
#ifndef TEST_BRUTE_H
#define TEST_BRUTE_H

#include <math.h>
#include <string.h>

#include "../../lib/facet.h"
#include "../../lib/model.h"
#include "../../lib/rng.h"
#include "../../lib/vec3.h"

enum { BRUTE_CORNERS = 48, BRUTE_PIECES = 4096, BRUTE_TRIANGLES = 2048 };

struct brute_piece {
	int n;
	double v[BRUTE_CORNERS][3];
};

struct brute {
	double triangle[BRUTE_TRIANGLES][3][3];
	int triangles;
	const struct facet *f, *g;
	double evaluations;
	uint64_t dice;
	struct brute_piece piece[2][BRUTE_PIECES];
};

/* The part of p where normal . v >= offset. */
static inline void brute_clip(const struct brute_piece *p, const double normal[3], double offset,
                              struct brute_piece *out)
{
	struct brute_piece q = { 0 };

	for (int i = 0; i < p->n; i++) {
		const double *a = p->v[i], *b = p->v[(i + 1) % p->n];
		double ha = v3_dot(normal, a) - offset, hb = v3_dot(normal, b) - offset;
		if (ha >= 0)
			memcpy(q.v[q.n++], a, sizeof q.v[0]);
		if ((ha > 0 && hb < 0) || (ha < 0 && hb > 0)) {
			for (int k = 0; k < 3; k++)
				q.v[q.n][k] = a[k] + ha / (ha - hb) * (b[k] - a[k]);
			q.n++;
		}
	}
	if (q.n < 3)
		q.n = 0;
	*out = q;
}

/* Lambert's formula with arc cosines. */
static inline double brute_lambert(const double x[3], const double normal[3],
                                   const struct brute_piece *p)
{
	double sum = 0;

	for (int i = 0; i < p->n; i++) {
		double a[3], b[3], c[3];
		v3_sub(p->v[i], x, a);
		v3_sub(p->v[(i + 1) % p->n], x, b);
		double la = v3_normalise(a), lb = v3_normalise(b);
		v3_cross(a, b, c);
		double s = v3_normalise(c), cosine = v3_dot(a, b);
		if (!(la > 0 && lb > 0 && s > 0))
			continue;
		double angle = fabs(cosine) < .9 ? acos(cosine)
		               : cosine > 0      ? asin(s)
		                                 : 3.14159265358979323846 - asin(s);
		sum -= angle * v3_dot(c, normal);
	}
	return sum / 6.28318530717958647693;
}

/* Triangles of m that may be between f and g. */
static inline void brute_begin(struct brute *b, const struct model *m, const double centre[3],
                               const struct facet *f, const struct facet *g, double near)
{
	b->f = f;
	b->g = g;
	b->triangles = 0;
	for (size_t t = 0; t < m->triangles; t++) {
		double (*v)[3] = b->triangle[b->triangles];
		double of_f = -1, of_g = -1;
		for (int i = 0; i < 3; i++) {
			v3_sub(&m->vertex[3 * (size_t)m->triangle[3 * t + (size_t)i]], centre, v[i]);
			of_f = fmax(of_f, v3_dot(f->normal, v[i]) - f->offset);
			of_g = fmax(of_g, v3_dot(g->normal, v[i]) - g->offset);
		}
		if (of_f > near && of_g > near && b->triangles + 1 < BRUTE_TRIANGLES)
			b->triangles++;
	}
}

/* Form factor from x on f to what it sees of g. */
static inline double brute_point(struct brute *b, const double x[3])
{
	struct brute_piece *now = b->piece[0], *next = b->piece[1], *swap;
	int n = 1, m;
	double sum = 0;

	b->evaluations++;
	now[0].n = b->g->n;
	memcpy(now[0].v, b->g->v, (size_t)b->g->n * sizeof now[0].v[0]);
	for (int t = 0; t < b->triangles && n; t++) {
		struct brute_piece tri = { .n = 3 };
		double inner[3];
		memcpy(tri.v, b->triangle[t], sizeof b->triangle[t]);
		brute_clip(&tri, b->f->normal, v3_dot(b->f->normal, x) + 1e-12, &tri);
		brute_clip(&tri, b->g->normal, b->g->offset + 1e-12, &tri);
		if (!tri.n)
			continue;
		for (int k = 0; k < 3; k++) {
			inner[k] = -x[k];
			for (int i = 0; i < tri.n; i++)
				inner[k] += tri.v[i][k] / tri.n;
		}
		m = 0;
		for (int i = 0; i < n; i++) {
			struct brute_piece rest = now[i], away;
			int before = m, edge_on = 0;
			for (int e = 0; e < tri.n && rest.n; e++) {
				double p[3], q[3], plane[3], out[3];
				v3_sub(tri.v[e], x, p);
				v3_sub(tri.v[(e + 1) % tri.n], x, q);
				v3_cross(p, q, plane);
				v3_sub(q, p, out);
				/* Corners of no distance, as clipping makes them. */
				if (v3_length(out) < 1e-10 || !(v3_normalise(plane) > 0))
					continue;
				double side = v3_dot(plane, inner);
				edge_on |= fabs(side) < 1e-13 * v3_length(inner);
				for (int k = 0; k < 3; k++) {
					plane[k] = side > 0 ? plane[k] : -plane[k];
					out[k] = -plane[k];
				}
				double offset = v3_dot(plane, x);
				brute_clip(&rest, out, -offset, &away);
				brute_clip(&rest, plane, offset, &rest);
				if (away.n && m < BRUTE_PIECES)
					next[m++] = away;
			}
			if (edge_on || !rest.n) { /* nothing is hidden: in one piece again */
				m = before;
				next[m++] = now[i];
			}
		}
		swap = now;
		now = next;
		next = swap;
		n = m;
	}
	for (int i = 0; i < n; i++)
		sum += brute_lambert(x, b->f->normal, &now[i]);
	return sum;
}

/* Dunavant's rule of degree 5 (7 points) over a triangle. */
static inline double brute_rule(struct brute *b, const double t[3][3])
{
	static const double at[7][3] = { { 1. / 3, 1. / 3, .225 },
		{ .470142064105115, .470142064105115, .132394152788506 },
		{ .059715871789770, .470142064105115, .132394152788506 },
		{ .470142064105115, .059715871789770, .132394152788506 },
		{ .101286507323456, .101286507323456, .125939180544827 },
		{ .797426985353087, .101286507323456, .125939180544827 },
		{ .101286507323456, .797426985353087, .125939180544827 } };
	double n[3], sum = 0;

	v3_area(t[0], t[1], t[2], n);
	for (int i = 0; i < 7; i++) {
		double x[3];
		for (int k = 0; k < 3; k++)
			x[k] = t[0][k] + at[i][0] * (t[1][k] - t[0][k]) + at[i][1] * (t[2][k] - t[0][k]);
		sum += at[i][2] * brute_point(b, x);
	}
	return sum * v3_length(n);
}

/* Edges are not halved, so that no line can miss the points of all levels. */
static inline double brute_refine(struct brute *b, const double t[3][3], double whole,
                                  double tolerance, int depth)
{
	double m[3][3], part[4], sum = 0;

	for (int i = 0; i < 3; i++) {
		b->dice = rng_mix(b->dice);
		double w = .35 + .3 * (double)(b->dice >> 11) * 0x1p-53;
		for (int k = 0; k < 3; k++)
			m[i][k] = t[i][k] + w * (t[(i + 1) % 3][k] - t[i][k]);
	}
	double kid[4][3][3];
	for (int i = 0; i < 4; i++)
		for (int j = 0; j < 3; j++)
			memcpy(kid[i][j], i == 3 ? m[j] : j == 0 ? t[i] : j == 1 ? m[i] : m[(i + 2) % 3],
			       sizeof kid[i][j]);
	for (int i = 0; i < 4; i++)
		sum += part[i] = brute_rule(b, (const double (*)[3])kid[i]);
	if (depth <= 0 && (fabs(sum - whole) <= tolerance || depth <= -12))
		return sum;
	sum = 0;
	for (int i = 0; i < 4; i++)
		sum += brute_refine(b, (const double (*)[3])kid[i], part[i], tolerance / 2, depth - 1);
	return sum;
}

/* Exchange area: f is cut into 4^levels triangles at least, then adaptively. */
static inline double brute_exchange(struct brute *b, double tolerance, int levels)
{
	double sum = 0;

	b->dice = 1;
	for (int i = 1; i + 1 < b->f->n; i++) {
		double t[3][3];
		memcpy(t[0], b->f->v, sizeof t[0]);
		memcpy(t[1], &b->f->v[3 * i], sizeof t[0]);
		memcpy(t[2], &b->f->v[3 * i + 3], sizeof t[0]);
		sum += brute_refine(b, (const double (*)[3])t, brute_rule(b, (const double (*)[3])t),
		                    tolerance / b->f->n, levels);
	}
	return sum;
}

#endif
