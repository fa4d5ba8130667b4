#include "lib/geometry/point_polygon.h"

#include <math.h>

#include "lib/base/constants.h"

static void put(struct point_polygon *p, double x, double y, double z)
{
	p->x[p->n] = x;
	p->y[p->n] = y;
	p->z[p->n++] = z;
}

/* Repeats the first corner, or empties what is less than a triangle. */
static void close_up(struct point_polygon *p)
{
	if (p->n < 3) {
		p->n = 0;
		return;
	}
	four_store(p->x + p->n, four_all(p->x[0]));
	four_store(p->y + p->n, four_all(p->y[0]));
	four_store(p->z + p->n, four_all(p->z[0]));
}

void geo_point_polygon_make(struct point_polygon *p, const double x[3], int n, const double *v)
{
	p->n = 0;
	for (int i = 0; i < n; i++)
		put(p, v[3 * i] - x[0], v[3 * i + 1] - x[1], v[3 * i + 2] - x[2]);
	close_up(p);
}

/* ---- cutting ---- */

/* Where the edge between corners i and j meets the plane; the same bits whichever way round. */
static void divide(const struct point_polygon *p, int i, double hi, int j, double hj, double at[3])
{
	int low = hi < hj ? i : j, high = hi < hj ? j : i;
	double w = hi < hj ? hi / (hi - hj) : hj / (hj - hi);

	at[0] = p->x[low] + w * (p->x[high] - p->x[low]);
	at[1] = p->y[low] + w * (p->y[high] - p->y[low]);
	at[2] = p->z[low] + w * (p->z[high] - p->z[low]);
}

void geo_point_polygon_cut(const struct point_polygon *p, const double normal[3], double zero,
                           struct point_polygon *in, struct point_polygon *away)
{
	double h[POINT_POLYGON_CORNERS + 4], at[3];

	for (int i = 0; i < p->n; i += 4)
		four_store(h + i, normal[0] * four_load(p->x + i) +
		                  normal[1] * four_load(p->y + i) +
		                  normal[2] * four_load(p->z + i));
	in->n = away->n = 0;
	for (int i = 0; i < p->n; i++) {
		int j = i + 1 < p->n ? i + 1 : 0;
		int above = h[i] > zero, below = h[i] < -zero;
		if (!below)
			put(in, p->x[i], p->y[i], p->z[i]);
		if (!above)
			put(away, p->x[i], p->y[i], p->z[i]);
		if ((above && h[j] < -zero) || (below && h[j] > zero)) {
			divide(p, i, h[i], j, h[j], at);
			put(in, at[0], at[1], at[2]);
			put(away, at[0], at[1], at[2]);
		}
	}
	close_up(in);
	close_up(away);
}

/* ---- Lambert's formula ---- */

/* atan(q) / q by powers of q^2, for q up to tan(pi / 8): interpolated in the zeros of a
 * Chebyshev polynomial, relative error 2e-16. */
static const double arc[12] = {
	1, -.33333333333333182, .19999999999952708, -.14285714280170506, .11111110782158419,
	-.090908976950599713, .07692058574795152, -.06663080022293745, .058476826593243575,
	-.050382640574518106, .038036092419210431, -.017874484523130386
};

/* Angles of the directions (x, y), y >= 0. */
static four angle(four y, four x)
{
	const double eighth = .41421356237309505;    /* tan(pi / 8) */
	four far = four_abs(x);
	four_mask steep = y > far;
	four low = four_choose(steep, far, y), high = four_choose(steep, y, far);
	four_mask turned = low > eighth * high;     /* by 45 degrees */
	four up = four_choose(turned, low - high, low);
	four across = four_choose(turned, low + high, high);
	four q = up / four_choose(across > 0, across, four_all(1)), t = q * q;
	/* In pairs and fours, which wait less for one another. */
	four t2 = t * t, t4 = t2 * t2, third[3];
	for (int i = 0; i < 3; i++)
		third[i] = arc[4 * i] + arc[4 * i + 1] * t +
		           t2 * (arc[4 * i + 2] + arc[4 * i + 3] * t);
	four sum = (third[0] + t4 * (third[1] + t4 * third[2])) * q +
	           four_choose(turned, four_all(PI / 4), four_all(0));
	sum = four_choose(steep, PI / 2 - sum, sum);
	return four_choose(x < 0, PI - sum, sum);
}

double geo_point_polygon_factor(const struct point_polygon *p, const double normal[3])
{
	four sum = { 0 };

	for (int i = 0; i < p->n; i += 4) {
		four ax = four_load(p->x + i), bx = four_load(p->x + i + 1);
		four ay = four_load(p->y + i), by = four_load(p->y + i + 1);
		four az = four_load(p->z + i), bz = four_load(p->z + i + 1);
		four cx = ay * bz - az * by, cy = az * bx - ax * bz, cz = ax * by - ay * bx;
		four s = four_sqrt(cx * cx + cy * cy + cz * cz);
		four up = normal[0] * cx + normal[1] * cy + normal[2] * cz;
		four term = up / four_choose(s > 0, s, four_all(1)) *
		            angle(s, ax * bx + ay * by + az * bz);
		sum += four_choose(s > 0, term, four_all(0));
	}
	return -four_sum(sum) / (2 * PI);
}
