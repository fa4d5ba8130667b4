#include "rng.h"

/* Direction numbers of dimensions 1 to 4 (dimension 0 is bit reversal), from
 * the primitive polynomials and initial values of new-joe-kuo-6. */
static const struct {
	int s;
	uint32_t a, m[3];
} joe_kuo[] = { { 1, 0, { 1 } }, { 2, 1, { 1, 3 } }, { 3, 1, { 1, 3, 1 } },
	{ 3, 2, { 1, 1, 1 } } };

static uint32_t direction[5][32];

static void fill_directions(void) __attribute__((constructor));

static void fill_directions(void)
{
	for (int i = 0; i < 32; i++)
		direction[0][i] = 1u << (31 - i);
	for (int d = 1; d < 5; d++) {
		int s = joe_kuo[d - 1].s;
		uint32_t a = joe_kuo[d - 1].a, *v = direction[d];
		for (int i = 0; i < 32; i++) {
			if (i < s) {
				v[i] = joe_kuo[d - 1].m[i] << (31 - i);
				continue;
			}
			v[i] = v[i - s] ^ (v[i - s] >> s);
			for (int k = 1; k < s; k++)
				if ((a >> (s - 1 - k)) & 1)
					v[i] ^= v[i - k];
		}
	}
}

static uint32_t reverse_bits(uint32_t x)
{
	x = __builtin_bswap32(x);
	x = ((x & 0x0f0f0f0fu) << 4) | ((x >> 4) & 0x0f0f0f0fu);
	x = ((x & 0x33333333u) << 2) | ((x >> 2) & 0x33333333u);
	return ((x & 0x55555555u) << 1) | ((x >> 1) & 0x55555555u);
}

/* Each output bit depends only on the lower input bits: a nested scramble of
 * the bit-reversed number. */
static uint32_t owen_reversed(uint32_t x, uint32_t seed)
{
	x ^= x * 0x3d20adeau;
	x += seed;
	x *= (seed >> 16) | 1;
	x ^= x * 0x05526c56u;
	x ^= x * 0x53a22864u;
	return x;
}

double rng_sobol(uint32_t index, int dim, uint64_t seed)
{
	uint32_t x = 0, i = index;

	for (const uint32_t *v = direction[dim]; i; v++, i >>= 1)
		if (i & 1)
			x ^= *v;
	x = owen_reversed(reverse_bits(x), (uint32_t)rng_mix(seed + (uint64_t)dim * 0x632be59bd9b4e019u));
	return (double)reverse_bits(x) * 0x1p-32;
}
