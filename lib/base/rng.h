/* Random and low-discrepancy numbers, all functions of explicit seeds. */
#ifndef TWOPASS_RNG_H
#define TWOPASS_RNG_H

#include <stdint.h>

/* A 64-bit mix (splitmix64 finaliser, Steele et al. 2014). */
static inline uint64_t rng_mix(uint64_t x)
{
	x += 0x9e3779b97f4a7c15u;
	x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
	x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
	return x ^ (x >> 31);
}

/* A stream of uniform numbers: splitmix64. Begin with rng_seed. */
struct rng {
	uint64_t state;
};

static inline struct rng rng_seed(uint64_t seed, uint64_t stream)
{
	return (struct rng){ rng_mix(seed) ^ rng_mix(~stream * 0xd1342543de82ef95u) };
}

static inline uint64_t rng_next(struct rng *r)
{
	uint64_t x = r->state += 0x9e3779b97f4a7c15u;
	x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
	x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
	return x ^ (x >> 31);
}

/* Uniform in (0, 1): never 0, never 1. */
static inline double rng_uniform(struct rng *r)
{
	return ((double)(rng_next(r) >> 12) + .5) * 0x1p-52;
}

/* Coordinate `dim` (0 to 5) of point `index` of the Sobol sequence, scrambled
 * by a nested uniform (Owen) scramble chosen by `seed`; in [0, 1) with 32 bits.
 * Points of one seed are jointly stratified over all dimensions. Direction
 * numbers: Joe & Kuo 2008; scramble by hashing: Laine & Karras 2011, with
 * Burley's constants (JCGT 9(4), 2020). */
double rng_sobol(uint32_t index, int dim, uint64_t seed);

/* The two halves of rng_sobol, for loops over many points of many scrambles:
 * the bits of an unscrambled coordinate, and the scramble of such bits by a
 * seed of rng_sobol_seed. */
uint32_t rng_sobol_bits(uint32_t index, int dim);
uint32_t rng_sobol_seed(uint64_t seed, int dim);

static inline uint32_t rng_reverse_bits(uint32_t x)
{
	x = __builtin_bswap32(x);
	x = ((x & 0x0f0f0f0fu) << 4) | ((x >> 4) & 0x0f0f0f0fu);
	x = ((x & 0x33333333u) << 2) | ((x >> 2) & 0x33333333u);
	return ((x & 0x55555555u) << 1) | ((x >> 1) & 0x55555555u);
}

static inline uint32_t rng_scramble_bits(uint32_t bits, uint32_t seed)
{
	uint32_t x = bits;
	/* Each output bit depends only on the lower input bits: a nested
	 * scramble of the bit-reversed number. */
	x ^= x * 0x3d20adeau;
	x += seed;
	x *= (seed >> 16) | 1;
	x ^= x * 0x05526c56u;
	x ^= x * 0x53a22864u;
	return rng_reverse_bits(x);
}

static inline double rng_scramble(uint32_t bits, uint32_t seed)
{
	return (double)rng_scramble_bits(bits, seed) * 0x1p-32;
}

/* The place of a point in an order of the sequence of its own, chosen by `seed`: blocks of 2^k
 * points stay blocks. What one path takes for one event after another is independent if each
 * event has an order, and a scramble, of its own, and evenly spread among paths all the same
 * (Burley, JCGT 9(4), 2020). A new scramble alone would keep points of one event next to one
 * another in the next. */
static inline uint32_t rng_shuffle(uint32_t index, uint64_t seed)
{
	uint32_t key = (uint32_t)rng_mix(~seed);
	/* The first 2^16 stay among themselves, so that few bits of them are set. */
	uint32_t block = rng_scramble_bits(0, key) & 0xffff0000u;

	return rng_scramble_bits(rng_reverse_bits(index), key) ^ block;
}

#endif
