/* A Morton curve (Morton 1966) through a cube: points near each other on it are near
 * each other in space. */
#ifndef TWOPASS_MORTON_H
#define TWOPASS_MORTON_H

#include <math.h>
#include <stdint.h>

struct morton_curve {
	double centre[3], scale;  /* of the cube; scale = 1 / side */
};

/* The curve over the cube about a box. */
static inline struct morton_curve geo_morton_curve(const double lo[3], const double hi[3])
{
	struct morton_curve c;
	double side = 0;

	for (int k = 0; k < 3; k++) {
		c.centre[k] = .5 * (lo[k] + hi[k]);
		side = fmax(side, hi[k] - lo[k]);
	}
	c.scale = 1 / side;
	return c;
}

/* 21 bits of x moved to every third place: three times 21 fill a code of 64 bits. */
static inline uint64_t spread_bits(uint64_t x)
{
	x = (x | x << 32) & 0x1f00000000ffffu;
	x = (x | x << 16) & 0x1f0000ff0000ffu;
	x = (x | x << 8) & 0x100f00f00f00f00fu;
	x = (x | x << 4) & 0x10c30c30c30c30c3u;
	return (x | x << 2) & 0x1249249249249249u;
}

/* Code of a point given relative to the box's centre. */
static inline uint64_t geo_morton(const struct morton_curve *c, const double x[3])
{
	uint64_t code = 0;

	for (int k = 0; k < 3; k++) {
		double cell = floor((x[k] * c->scale + .5) * 0x1p21);
		code |= spread_bits((uint64_t)fmin(fmax(cell, 0), 0x1p21 - 1)) << k;
	}
	return code;
}

#endif
