/* The smallest ball about points. */
#ifndef TWOPASS_ENCLOSING_BALL_H
#define TWOPASS_ENCLOSING_BALL_H

#include <stddef.h>

struct ball {
	double centre[3], radius;
};

/* The smallest ball about n > 0 points x [n][3], to rounding, however they are turned or ordered:
 * as long as a point is outside, the ball becomes the smallest about that and the points that held
 * the one before (Gaertner 1999). O(n) a step, of which there are a few tens. */
struct ball geo_enclosing_ball(const double *x, size_t n);

#endif
