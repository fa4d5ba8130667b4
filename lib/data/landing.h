/* Where a gathering ray landed: an element-side and one of 16 places on it, in 32 bits.
 *
 * A point of a triangle is (1 - r) corner 0 + r ((1 - s) corner 1 + s corner 2); r^2 and s are uniform
 * where points are by area. A place is a quarter of the one by a quarter of the other, so all
 * have the same area. */
#ifndef TWOPASS_LANDING_H
#define TWOPASS_LANDING_H

#include <math.h>
#include <stdint.h>

enum { LANDING_PARTS = 4, LANDING_PLACES = LANDING_PARTS * LANDING_PARTS };

/* Element-sides that a landing has room for. */
#define LANDING_SIDES (UINT32_MAX / LANDING_PLACES)

/* The landing of a point with these weights of corners 1 and 2. */
static inline uint32_t landing_at(uint32_t element_side, double w1, double w2)
{
	double r = w1 + w2, last = LANDING_PARTS - 1;
	double i = fmin(last, fmax(0, LANDING_PARTS * r * r));
	double k = r > 0 ? fmin(last, fmax(0, LANDING_PARTS * w2 / r)) : 0;

	return element_side * LANDING_PLACES + LANDING_PARTS * (uint32_t)i + (uint32_t)k;
}

static inline uint32_t landing_side(uint32_t landing)
{
	return landing / LANDING_PLACES;
}

/* The mean weights of corners 1 and 2 over a landing's place. */
static inline void landing_weights(uint32_t landing, double w[2])
{
	double i = landing % LANDING_PLACES / LANDING_PARTS, k = landing % LANDING_PARTS;
	double a = i / LANDING_PARTS, b = (i + 1) / LANDING_PARTS;
	double r = 2 * LANDING_PARTS * (b * sqrt(b) - a * sqrt(a)) / 3;

	w[1] = r * (k + .5) / LANDING_PARTS;
	w[0] = r - w[1];
}

#endif
