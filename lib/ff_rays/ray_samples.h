/* Where rays begin, go and land (for lib/ff). */
#ifndef TWOPASS_RAY_SAMPLES_H
#define TWOPASS_RAY_SAMPLES_H

#include "lib/ff_rays/ff_internal.h"

/* Fills job->element. O(elements). */
void ff_element_table(struct ff_job *j);

/* The element of a patch that a number in [0,1) chooses by area; what is left of the
 * number, again uniform, replaces it. */
uint32_t ff_choose(const struct ff_job *j, uint32_t patch, double *u);

/* A point on a patch, uniform by area, from two numbers in [0,1): its element and
 * position (on the surface, not moved off it). */
uint32_t ff_point(const struct ff_job *j, uint32_t patch, double u0, double u1, double x[3]);

/* The scramble of a replicate of the rays of a row; row: twice its patch-side, and 1 more
 * for its emission. */
struct ff_scramble {
	uint32_t seed[FF_DIMS];
};
struct ff_scramble ff_scramble(const struct ff_job *j, uint32_t row, uint32_t replicate);

/* The numbers of rays first to first + n (n <= RAY_BATCH) of a scrambled replicate. */
void ff_rays_numbers(const struct ff_samples *s, const uint32_t seed[4], uint32_t first,
                     uint32_t n, struct ff_ray_batch *b);

/* Elements of a patch for the rays, by area; u[0] becomes what is left of the choice. */
void ff_rays_elements(const struct ff_job *j, uint32_t patch, uint32_t n,
                      struct ff_ray_batch *b);

/* Origins off a side of the elements, and Lambertian directions from there. */
void ff_rays_origins(const struct ff_job *j, int side, uint32_t n, struct ff_ray_batch *b);
void ff_rays_directions(const struct ff_job *j, int side, uint32_t n,
                        struct ff_ray_batch *b);

/* Casts n rays and finds the elements where they land. */
void ff_rays_cast(const struct ff_job *j, uint32_t n, struct ff_ray_batch *b);

/* The n rays of numbers that the batch has, from a patch-side: elements, origins, Lambertian
 * directions, and cast. */
void ff_rays_from_patch(const struct ff_job *j, uint32_t patch_side, uint32_t n,
                        struct ff_ray_batch *b);

/* The same from one element-side, with their numbers: rays first to first + n of a replicate. */
void ff_rays_from_element(const struct ff_job *j, const struct ff_samples *s,
                          const uint32_t seed[4], uint32_t column, uint32_t first,
                          uint32_t n, struct ff_ray_batch *b);

/* Unit normal of a side of an element. */
void ff_normal(const struct ff_job *j, uint32_t element, int side, double n[3]);

#endif
