#include "lib/geometry/cubature.h"

#include "lib/base/constants.h"
#include "lib/base/vec.h"

/* Points of a triangle or quadrilateral, multiples of four: 3 or 2 x 2, 7, 4 x 4, 6 x 6, filled
 * up with points of weight 0. Which rules there are is a guess at what errors ask for. */
static const int level_points[CUBATURE_LEVELS] = { 4, 8, 16, 36 };

/* Gauss-Legendre abscissae and weights on [-1, 1], the positive half. */
static const int half_order[CUBATURE_LEVELS] = { 1, 0, 2, 3 };
static const double legendre_x[CUBATURE_LEVELS][3] = {
	{ .577350269189625764509148780501957 }, { 0 },
	{ .861136311594052575223946488892810, .339981043584856264802665759103245 },
	{ .932469514203152027812301554493995, .661209386466264513661399595019905,
	  .238619186083196908630501721680712 }
};
static const double legendre_w[CUBATURE_LEVELS][3] = {
	{ 1 }, { 0 },
	{ .347854845137453857373063949221999, .652145154862546142626936050778001 },
	{ .171324492379170345040296142172733, .360761573048138607569833513837716,
	  .467913934572691047389870343989551 }
};

static int cuts(int corners)
{
	return (corners - 1) / 2;
}

int geo_cubature_points(int corners, int level)
{
	return cuts(corners) * level_points[level];
}

static void put(struct cubature *c, const double x[3], double w)
{
	c->x[c->n] = x[0];
	c->y[c->n] = x[1];
	c->z[c->n] = x[2];
	c->w[c->n++] = w;
}

/* Twice the area of a triangle. */
static double twice_area(const double *a, const double *b, const double *c)
{
	double n[3];

	v3_area(a, b, c, n);
	return 2 * v3_length(n);
}

/* A point of a quadrilateral by (u, v) in [-1, 1]^2, and the area per unit of du dv. */
static double bilinear(const double *const q[4], double u, double v, double x[3])
{
	double du[3], dv[3], n[3];

	for (int k = 0; k < 3; k++) {
		double low = (1 - u) * q[0][k] + (1 + u) * q[1][k];
		double high = (1 - u) * q[3][k] + (1 + u) * q[2][k];
		x[k] = ((1 - v) * low + (1 + v) * high) / 4;
		du[k] = ((1 - v) * (q[1][k] - q[0][k]) + (1 + v) * (q[2][k] - q[3][k])) / 4;
		dv[k] = (high - low) / 4;
	}
	v3_cross(du, dv, n);
	return v3_length(n);
}

static void product_points(const double *const q[4], int level, struct cubature *c)
{
	int half = half_order[level];
	double x[3];

	for (int i = 0; i < 2 * half; i++)
		for (int j = 0; j < 2 * half; j++) {
			double u = (i < half ? -1 : 1) * legendre_x[level][i % half];
			double v = (j < half ? -1 : 1) * legendre_x[level][j % half];
			double area = bilinear(q, u, v, x);
			put(c, x, area * legendre_w[level][i % half] * legendre_w[level][j % half]);
		}
}

/* 3 points of degree 2 on a triangle, and a fourth of weight 0. */
static void triangle_points_2(const double *const q[3], struct cubature *c)
{
	double area = twice_area(q[0], q[1], q[2]) / 2, x[3];

	for (int i = 0; i < 3; i++) {
		for (int k = 0; k < 3; k++)
			x[k] = (4 * q[i][k] + q[(i + 1) % 3][k] + q[(i + 2) % 3][k]) / 6;
		put(c, x, area / 3);
	}
	put(c, x, 0);
}

/* Radon's 7 points of degree 5 on a triangle, and an eighth of weight 0. */
static void triangle_points(const double *const q[3], struct cubature *c)
{
	const double root = sqrt(15);
	double area = twice_area(q[0], q[1], q[2]) / 2, x[3];

	for (int ring = 0; ring < 2; ring++) {
		double s = ring ? root : -root, apart = (6 + s) / 21, w = (155 + s) / 1200;
		for (int i = 0; i < 3; i++) {
			for (int k = 0; k < 3; k++)
				x[k] = apart * (q[(i + 1) % 3][k] + q[(i + 2) % 3][k]) +
				       (1 - 2 * apart) * q[i][k];
			put(c, x, w * area);
		}
	}
	for (int k = 0; k < 3; k++)
		x[k] = (q[0][k] + q[1][k] + q[2][k]) / 3;
	put(c, x, area * 9 / 40);
	put(c, x, 0);
}

/* Radon's 7 points of degree 5 on a square, mapped, and an eighth of weight 0. */
static void square_points(const double *const q[4], struct cubature *c)
{
	const double far = sqrt(14. / 15), a = sqrt(.6), b = sqrt(1. / 3);
	const double at[7][3] = { { 0, 0, 8. / 7 }, { 0, far, 20. / 63 }, { 0, -far, 20. / 63 },
	                          { a, b, 5. / 9 }, { a, -b, 5. / 9 }, { -a, b, 5. / 9 },
	                          { -a, -b, 5. / 9 } };
	double x[3];

	for (int i = 0; i < 7; i++) {
		double area = bilinear(q, at[i][0], at[i][1], x);
		put(c, x, area * at[i][2]);
	}
	put(c, x, 0);
}

void geo_cubature_fill(const struct facet *f, int level, struct cubature *c)
{
	c->n = 0;
	for (int i = 0; i < cuts(f->n); i++) {
		const double *q[4];
		int last = 2 * i + 3;
		for (int k = 0; k < 4; k++)
			q[k] = &f->v[3 * (k == 0 ? 0 : 2 * i + k < f->n ? 2 * i + k : f->n - 1)];
		int triangle = last == f->n;
		if (level == 0 && triangle)
			triangle_points_2(q, c);
		else if (level == 1 && triangle)
			triangle_points(q, c);
		else if (level == 1)
			square_points(q, c);
		else
			product_points(q, level, c);
	}
}

/* r^4 from four points to one. */
static four fourth_power(const struct cubature *c, int j, const double p[3])
{
	four x = *(const four *)(c->x + j) - p[0], y = *(const four *)(c->y + j) - p[1];
	four z = *(const four *)(c->z + j) - p[2], r2 = x * x + y * y + z * z;

	return r2 * r2;
}

/* The sum of height / r^4 over all points as seen from one, in four parts. */
static four seen_from(const struct cubature *from, int i, const struct cubature *c,
                      const double *height)
{
	const double p[3] = { from->x[i], from->y[i], from->z[i] };
	four sum = { 0 };
	int j = 0;

	/* x / p + y / q by one division. */
	for (; j + 4 < c->n; j += 8) {
		four a = fourth_power(c, j, p), b = fourth_power(c, j + 4, p);
		sum += (*(const four *)(height + j) * b + *(const four *)(height + j + 4) * a) /
		       (a * b);
	}
	if (j < c->n)
		sum += *(const four *)(height + j) / fourth_power(c, j, p);
	return sum;
}

double geo_cubature_exchange(const struct facet *a, const struct cubature *ca,
                             const struct facet *b, const struct cubature *cb)
{
	double height[FACET_CORNERS * 18];
	four sum = { 0 };

	/* The cosines' distances from each plane depend on one point only. */
	for (int j = 0; j < cb->n; j += 4) {
		const four *x = (const four *)(cb->x + j), *y = (const four *)(cb->y + j);
		const four *z = (const four *)(cb->z + j), *w = (const four *)(cb->w + j);
		*(four *)(height + j) = *w * (a->normal[0] * *x + a->normal[1] * *y +
		                              a->normal[2] * *z - a->offset);
	}
	for (int i = 0; i < ca->n; i++) {
		if (ca->w[i] == 0)
			continue;
		double h = b->normal[0] * ca->x[i] + b->normal[1] * ca->y[i] +
		           b->normal[2] * ca->z[i] - b->offset;
		sum += ca->w[i] * h * seen_from(ca, i, cb, height);
	}
	return (sum[0] + sum[1] + sum[2] + sum[3]) / PI;
}

/* Relative errors are below factor (r / gap)^power, where the power is the rule's order and the
 * factor was fitted to errors of triangles and rectangles seen by far smaller ones (test_polygon
 * checks the bounds: test_cubature_reach); level 0 is for quadrilaterals only. */
static const struct {
	double factor, power;
} level_error[CUBATURE_LEVELS] = { { 16, 4 }, { 8, 6 }, { 2, 8 }, { .04, 12 } };

void geo_cubature_reach(double tolerance, double reach[CUBATURE_LEVELS])
{
	for (int l = 0; l < CUBATURE_LEVELS; l++)
		reach[l] = pow(level_error[l].factor / tolerance, 1 / level_error[l].power);
}
