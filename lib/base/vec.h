/* Three-vectors in double precision (v3_), and vectors of four doubles, a register (four_). */
#ifndef TWOPASS_VEC_H
#define TWOPASS_VEC_H

#include <immintrin.h>
#include <math.h>
#include <stdint.h>

static inline double v3_dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void v3_sub(const double a[3], const double b[3], double out[3])
{
	for (int k = 0; k < 3; k++)
		out[k] = a[k] - b[k];
}

/* out = a + s b */
static inline void v3_mad(const double a[3], double s, const double b[3], double out[3])
{
	for (int k = 0; k < 3; k++)
		out[k] = a[k] + s * b[k];
}

static inline void v3_cross(const double a[3], const double b[3], double out[3])
{
	double x = a[1] * b[2] - a[2] * b[1];
	double y = a[2] * b[0] - a[0] * b[2];
	double z = a[0] * b[1] - a[1] * b[0];
	out[0] = x, out[1] = y, out[2] = z;
}

static inline double v3_length(const double a[3])
{
	return sqrt(v3_dot(a, a));
}

/* Scales a to unit length and returns the length it had; 0 leaves it alone. */
static inline double v3_normalise(double a[3])
{
	double l = v3_length(a);
	if (l > 0)
		for (int k = 0; k < 3; k++)
			a[k] /= l;
	return l;
}

/* Two unit vectors t, b that make (t, b, n) a right-handed orthonormal frame
 * about the unit vector n. Duff et al., Building an Orthonormal Basis,
 * Revisited, JCGT 6(1), 2017. */
static inline void v3_frame(const double n[3], double t[3], double b[3])
{
	double s = copysign(1, n[2]), a = -1 / (s + n[2]), c = n[0] * n[1] * a;
	t[0] = 1 + s * n[0] * n[0] * a, t[1] = s * c, t[2] = -s * n[0];
	b[0] = c, b[1] = s + n[1] * n[1] * a, b[2] = -n[1];
}

/* Area vector (length = area, direction = front normal) of triangle abc. */
static inline void v3_area(const double a[3], const double b[3], const double c[3],
                           double out[3])
{
	double u[3], v[3];
	v3_sub(b, a, u);
	v3_sub(c, a, v);
	v3_cross(u, v, out);
	for (int k = 0; k < 3; k++)
		out[k] *= .5;
}

/* ---- four doubles ---- */

typedef double four __attribute__((vector_size(32), aligned(8), may_alias));
typedef long long four_mask __attribute__((vector_size(32), aligned(8), may_alias));

static inline four four_load(const double *x)
{
	return *(const four *)x;
}

static inline void four_store(double *x, four a)
{
	*(four *)x = a;
}

static inline four four_all(double x)
{
	return (four){ x, x, x, x };
}

static inline four four_choose(four_mask mask, four yes, four no)
{
	return (four)((mask & (four_mask)yes) | (~mask & (four_mask)no));
}

static inline four four_abs(four a)
{
	return (four)((four_mask)a & INT64_MAX);
}

static inline four four_sqrt(four a)
{
	return (four)_mm256_sqrt_pd((__m256d)a);
}

/* A bit for each that is set. */
static inline int four_bits(four_mask mask)
{
	return _mm256_movemask_pd((__m256d)mask);
}

static inline double four_sum(four a)
{
	return (a[0] + a[1]) + (a[2] + a[3]);
}

#endif
