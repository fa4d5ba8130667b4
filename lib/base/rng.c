#include "lib/base/rng.h"

/* Direction numbers of dimensions 1 to 5 (dimension 0 is bit reversal), from
 * the primitive polynomials and initial values of new-joe-kuo-6. */
static const struct {
	int s;
	uint32_t a, m[4];
} joe_kuo[] = { { 1, 0, { 1 } }, { 2, 1, { 1, 3 } }, { 3, 1, { 1, 3, 1 } },
	{ 3, 2, { 1, 1, 1 } }, { 4, 1, { 1, 1, 3, 3 } } };

/* [dimensions][bits of an index] */
static uint32_t direction[6][32];

static void fill_directions(void) __attribute__((constructor));

static void fill_directions(void)
{
	for (int i = 0; i < 32; i++)
		direction[0][i] = 1u << (31 - i);
	for (int d = 1; d < 6; d++) {
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

uint32_t rng_sobol_bits(uint32_t index, int dim)
{
	uint32_t x = 0;

	for (const uint32_t *v = direction[dim]; index; v++, index >>= 1)
		if (index & 1)
			x ^= *v;
	return rng_reverse_bits(x);
}

uint32_t rng_sobol_seed(uint64_t seed, int dim)
{
	return (uint32_t)rng_mix(seed + (uint64_t)dim * 0x632be59bd9b4e019u);
}

double rng_sobol(uint32_t index, int dim, uint64_t seed)
{
	return rng_scramble(rng_sobol_bits(index, dim), rng_sobol_seed(seed, dim));
}
