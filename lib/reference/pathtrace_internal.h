/* What eye paths and particles share: emitters to choose from, points on the
 * surfaces, Russian roulette. Private to lib/reference. */
#ifndef TWOPASS_PATHTRACE_INTERNAL_H
#define TWOPASS_PATHTRACE_INTERNAL_H

#include "lib/base/rng.h"
#include "lib/ray/light_visibility.h"
#include "lib/reference/pathtrace.h"

/* A side of a triangle that emits. */
struct emitter {
	uint32_t triangle;
	int side;
	double chance;    /* of being chosen: its share of the flux (mean of the bands) */
	double below;     /* sum of the chances of those before it */
};

struct pathtrace {
	const struct model *m;
	const struct ray_scene *rays;
	double *normal;            /* [triangles][3] unit front normals */
	double *area;              /* [triangles] */
	size_t emitters;
	struct emitter *emitter;
	double *density;           /* [2 triangles] chance / area of a side, per m^2 */
	double emitted[BANDS_MAX]; /* flux, also of lights */
	double *light_below;       /* [lights+1] sum of the chances of the lights before, by flux
	                              among all that emits */
	struct light_visibility ways;
};

/* A surface point as a ray meets it. */
struct vertex {
	uint32_t triangle, material;
	int side;                  /* that the ray meets */
	double t;                  /* distance along the ray */
	double w[3];               /* barycentric weights of the triangle's corners */
	double x[3];
	const double *n;           /* front normal */
};

/* 1 if the ray from org along dir meets a surface. */
int pathtrace_meet(const struct pathtrace *p, const double org[3], const double dir[3],
                   struct vertex *v);

/* Where a ray along dir from point x of a triangle begins: off the surface, on the
 * side that dir points to. */
void pathtrace_leave(const struct pathtrace *p, const double n[3], const double x[3],
                     const double dir[3], double org[3]);

/* Chooses an emitter and a point on it. O(log emitters). */
const struct emitter *pathtrace_emitter(const struct pathtrace *p, const double u[3],
                                        double x[3]);

/* Goes on with a chance of the largest throughput (below 1), which is divided by
 * it: a path's weight neither dies away nor grows. 0 = the path ends. */
int pathtrace_roulette(double *throughput, int bands, struct rng *r);

#endif
