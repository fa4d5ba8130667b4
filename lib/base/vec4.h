/* Vectors of four doubles. */
#ifndef TWOPASS_VEC4_H
#define TWOPASS_VEC4_H

#include <immintrin.h>
#include <stdint.h>

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
