#include "lib/ff_tally/closure.h"

#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"

/* A count that ends what rounding might keep going in conjugate gradients; a guess. */
enum { MOST_STEPS = 1000 };

/* Of the residual, relative: near rounding of a sum of a thousand terms. */
static const double small_enough = 1e-12;

/* The normal equations: A[i][i] = sum of w of a row, A[i][j] = w of a pair, w = error^2,
 * scaled by the diagonal on both sides. */
struct normal {
	const struct doubt *doubt;
	size_t n, rows;
	double *scale;            /* [rows] 1 / root of the diagonal; 0: not asked for */
};

static void apply(const struct normal *a, const double *x, double *y)
{
	for (size_t r = 0; r < a->rows; r++)
		y[r] = 0;
	for (size_t k = 0; k < a->n; k++) {
		const struct doubt *d = &a->doubt[k];
		double w = d->error * d->error, si = a->scale[d->i], sj = a->scale[d->j];
		double both = w * (si * x[d->i] + sj * x[d->j]);
		y[d->i] += si * both;
		y[d->j] += sj * both;
	}
}

static double dot(const double *x, const double *y, size_t n)
{
	double sum = 0;

	for (size_t i = 0; i < n; i++)
		sum += x[i] * y[i];
	return sum;
}

/* Conjugate gradients from 0; x, r, p, q: [rows], r the right-hand side. */
static void solve(const struct normal *a, double *x, double *r, double *p, double *q)
{
	double rr = dot(r, r, a->rows), stop = small_enough * small_enough * rr;

	for (size_t i = 0; i < a->rows; i++)
		p[i] = r[i];
	for (int step = 0; step < MOST_STEPS && rr > stop; step++) {
		apply(a, p, q);
		double pq = dot(p, q, a->rows), before = rr;
		if (!(pq > 0))
			return;
		for (size_t i = 0; i < a->rows; i++) {
			x[i] += rr / pq * p[i];
			r[i] -= rr / pq * q[i];
		}
		rr = dot(r, r, a->rows);
		for (size_t i = 0; i < a->rows; i++)
			p[i] = r[i] + rr / before * p[i];
	}
}

int ff_closure(const struct doubt *doubt, size_t n, size_t rows, const double *missing,
               const uint8_t *closed, double *change, struct err *e)
{
	double *room = mem_new(5 * rows, sizeof *room, "closing rows", e);
	double *x = room, *r = room + rows, *p = r + rows, *q = p + rows;
	struct normal a = { doubt, n, rows, room + 4 * rows };

	if (!room)
		return -1;
	for (size_t k = 0; k < n; k++) {
		double w = doubt[k].error * doubt[k].error;
		a.scale[doubt[k].i] += closed[doubt[k].i] ? w : 0;
		a.scale[doubt[k].j] += closed[doubt[k].j] ? w : 0;
	}
	for (size_t i = 0; i < rows; i++) {
		a.scale[i] = a.scale[i] > 0 ? 1 / sqrt(a.scale[i]) : 0;
		r[i] = a.scale[i] * missing[i];
	}
	solve(&a, x, r, p, q);
	for (size_t k = 0; k < n; k++)
		change[k] = doubt[k].error * doubt[k].error *
		            (a.scale[doubt[k].i] * x[doubt[k].i] + a.scale[doubt[k].j] * x[doubt[k].j]);
	free(room);
	return 0;
}
