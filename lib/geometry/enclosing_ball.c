#include "lib/geometry/enclosing_ball.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"

/* Points that hold a ball in three dimensions, and with one that is outside it. */
enum { HOLD = 4, HOLD_MORE = HOLD + 1 };

/* How far a point is outside that counts, of the radius: rounding. And steps at most, which end by
 * themselves but for rounding: a guess. */
static const double slack = 1e-12;
enum { STEPS = 1000 };

/* The smallest ball with all n <= 4 points on its surface: its centre is in their span, equally far
 * from each. Radius NAN where they are not independent. */
static struct ball through(const double (*x)[3], int n)
{
	double a[3][4] = { { 0 } }, e[3][3], l[3];
	struct ball b = { { x[0][0], x[0][1], x[0][2] }, 0 };
	int m = n - 1;

	for (int i = 0; i < m; i++)
		v3_sub(x[i + 1], x[0], e[i]);
	for (int i = 0; i < m; i++) {
		for (int k = 0; k < m; k++)
			a[i][k] = 2 * v3_dot(e[i], e[k]);
		a[i][3] = v3_dot(e[i], e[i]);
	}
	for (int i = 0; i < m; i++) { /* positive definite: no pivots needed */
		if (!(a[i][i] > slack * v3_dot(e[i], e[i])))
			return (struct ball){ .radius = (double)NAN };
		for (int k = i + 1; k < m; k++) {
			double f = a[k][i] / a[i][i];
			for (int c = i; c < 4; c++)
				a[k][c] -= f * a[i][c];
		}
	}
	for (int i = m - 1; i >= 0; i--) {
		l[i] = a[i][3];
		for (int k = i + 1; k < m; k++)
			l[i] -= a[i][k] * l[k];
		l[i] /= a[i][i];
		v3_mad(b.centre, l[i], e[i], b.centre);
	}
	double d[3];
	v3_sub(b.centre, x[0], d);
	b.radius = v3_length(d);
	return b;
}

static double distance(const struct ball *b, const double x[3])
{
	double d[3];

	v3_sub(x, b->centre, d);
	return v3_length(d);
}

/* The smallest of the balls through some of n <= 5 points that hold all; those become x[0, *held). */
static struct ball smallest(double (*x)[3], int n, int *held)
{
	struct ball best = { .radius = (double)INFINITY };
	double by[HOLD][3];

	for (unsigned set = 1; set < 1u << n; set++) {
		double some[HOLD_MORE][3] = { { 0 } };
		int k = 0, all = 1;
		for (int i = 0; i < n; i++)
			if (set >> i & 1)
				memcpy(some[k++], x[i], sizeof some[0]);
		if (k > HOLD)
			continue;
		struct ball b = through((const double (*)[3])some, k);
		for (int i = 0; i < n; i++)
			all &= distance(&b, x[i]) <= b.radius * (1 + slack);
		if (all && b.radius < best.radius) {
			best = b;
			*held = k;
			memcpy(by, some, sizeof by);
		}
	}
	memcpy(x, by, (size_t)*held * sizeof *x);
	return best;
}

/* The middle of the points' box, and half its longest edge: units in which squares are in range. */
static struct ball unit_of(const double *x, size_t n)
{
	struct ball u = { .radius = 0 };

	for (size_t k = 0; k < 3; k++) {
		double lo = x[k], hi = x[k];
		for (size_t i = 1; i < n; i++) {
			lo = fmin(lo, x[3 * i + k]);
			hi = fmax(hi, x[3 * i + k]);
		}
		u.centre[k] = lo / 2 + hi / 2;
		u.radius = fmax(u.radius, hi / 2 - lo / 2);
	}
	return u;
}

static void to_unit(const struct ball *u, const double x[3], double out[3])
{
	v3_sub(x, u->centre, out);
	for (int k = 0; k < 3; k++)
		out[k] /= u->radius;
}

/* The point farthest from the ball's centre, in units, and how far. */
static double farthest(const struct ball *b, const struct ball *u, const double *x, size_t n,
                       double point[3])
{
	double most = -1, at[3];

	for (size_t i = 0; i < n; i++) {
		to_unit(u, x + 3 * i, at);
		double d = distance(b, at);
		if (d > most) {
			most = d;
			memcpy(point, at, sizeof at);
		}
	}
	return most;
}

struct ball geo_enclosing_ball(const double *x, size_t n)
{
	struct ball u = unit_of(x, n), b = { .radius = 0 };
	double hold[HOLD_MORE][3];
	int held = 1;

	if (!(u.radius > 0))
		return u;
	to_unit(&u, x, hold[0]);
	memcpy(b.centre, hold[0], sizeof b.centre);
	for (int step = 0; step < STEPS; step++) {
		if (farthest(&b, &u, x, n, hold[held]) <= b.radius * (1 + slack))
			break;
		struct ball next = smallest(hold, held + 1, &held);
		if (!(next.radius > b.radius) || !isfinite(next.radius))
			break;
		b = next;
	}
	b.radius *= u.radius;
	for (int k = 0; k < 3; k++)
		b.centre[k] = u.centre[k] + u.radius * b.centre[k];
	return b;
}
