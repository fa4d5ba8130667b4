/* Rays against the input triangles (Embree). World coordinates at the interface;
 * inside, float32 about the scene's centre at unit scale. */
#ifndef TWOPASS_RAY_H
#define TWOPASS_RAY_H

#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"

struct ray_scene;

#define RAY_MISS UINT32_MAX

struct ray_hit {
	uint32_t triangle;  /* input triangle, or RAY_MISS */
	int side;           /* side of the triangle that was hit */
	double t;           /* distance in world units along the unit direction */
	double w[3];        /* barycentric weights of the triangle's corners */
};

/* Builds the BVH over m's input triangles, O(n log n). m must outlive it.
 * NULL and e on failure. */
struct ray_scene *ray_scene_new(const struct model *m, struct err *e);
void ray_scene_free(struct ray_scene *s);

/* The world distance by which origins must leave a surface (along its normal)
 * to be safely beyond it: a few float32 steps of the whole scene. */
double ray_offset(const struct ray_scene *s);

/* Moves point x by ray_offset along n (unit normal of the side a ray leaves). */
void ray_leave(const struct ray_scene *s, const double n[3], double x[3]);

/* Part of the way to the centre of a triangle of that area, by which all of it is clear of its
 * edges by a few tens of float32 steps of the scene. From closer points rays may leave between
 * two walls that meet at the edge. */
double ray_inset(const struct ray_scene *s, double area);

/* A point of an input triangle by weights of its corners, which is closer to the plane than
 * along a ray, and if need be moved to be as clear of the edges. */
void ray_point(const struct ray_scene *s, const struct model *m, uint32_t triangle,
               const double weight[3], double x[3]);

/* Nearest hit of the ray from org along unit dir, any distance > 0. */
void ray_nearest(const struct ray_scene *s, const double org[3], const double dir[3],
                 struct ray_hit *hit);

/* Rays by the batch. Origins are in the units of the inside: (world - centre) per_unit. */
enum { RAY_BATCH = 64 };  /* a count, of whole packets of 8: a guess, 2 kB of the cache */

struct ray_units {
	double centre[3], per_unit;
};

struct ray_batch {
	float org[3][RAY_BATCH], dir[3][RAY_BATCH]; /* directions unit */
	uint32_t triangle[RAY_BATCH];               /* hit, or RAY_MISS */
	uint32_t side[RAY_BATCH];
	float w[2][RAY_BATCH];                      /* barycentric weights of corners 1, 2 */
};

struct ray_units ray_units(const struct ray_scene *s);

/* Nearest hits of rays [0, n). Which of surfaces at equal distance is found may differ
 * from ray_nearest's choice. */
void ray_nearest_batch(const struct ray_scene *s, struct ray_batch *b, uint32_t n);

/* 1 if anything stands between a and b (points already moved off their
 * surfaces with ray_leave). */
int ray_blocked(const struct ray_scene *s, const double a[3], const double b[3]);

#endif
