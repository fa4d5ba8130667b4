#include "lib/geometry/solid_angle.h"

#include <math.h>

#include "lib/base/vec.h"

static void towards(const double *v, const double x[3], double to[3][3])
{
	for (int i = 0; i < 3; i++) {
		v3_sub(&v[3 * i], x, to[i]);
		v3_normalise(to[i]);
	}
}

double geo_solid_angle(const double *v, const double x[3])
{
	double to[3][3], normal[3];

	towards(v, x, to);
	v3_cross(to[1], to[2], normal);
	return 2 * fabs(atan2(fabs(v3_dot(to[0], normal)),
	                      1 + v3_dot(to[0], to[1]) + v3_dot(to[1], to[2]) +
	                      v3_dot(to[2], to[0])));
}

/* On the arc from a towards b, where the cosine to a is c. */
static void along(const double a[3], const double b[3], double c, double out[3])
{
	double aside[3] = { b[0], b[1], b[2] };

	v3_mad(aside, -v3_dot(a, b), a, aside);
	v3_normalise(aside);
	for (int k = 0; k < 3; k++)
		out[k] = c * a[k] + sqrt(fmax(0, 1 - c * c)) * aside[k];
}

/* The triangle is cut by an arc from its second corner to the edge between the others, so
 * that one part has the share u[0] of its angle; the direction is on that arc. */
void geo_solid_angle_sample(const double *v, const double x[3], double angle,
                            const double u[2], double dir[3])
{
	double to[3][3], ab[3], ac[3], end[3];

	towards(v, x, to);
	v3_cross(to[0], to[1], ab);
	v3_cross(to[0], to[2], ac);
	v3_normalise(ab);
	v3_normalise(ac);
	double cosine = fmin(1, fmax(-1, v3_dot(ab, ac))), sine = sqrt(1 - cosine * cosine);
	double turn = u[0] * angle - acos(cosine), s = sin(turn), t = cos(turn);
	double p = t - cosine, q = s + sine * v3_dot(to[0], to[1]);
	double below = (q * s + p * t) * sine;
	double c = below != 0 ? ((q * t - p * s) * cosine - q) / below : 1;
	along(to[0], to[2], fmin(1, fmax(-1, c)), end);
	along(to[1], end, 1 - u[1] * (1 - v3_dot(end, to[1])), dir);
}
