/* Irradiance that comes straight from emitters and punctual lights, at points where a picture
 * needs it.
 *
 * What a point sees of an emitter's polygon past the convex occluders between is found by
 * clipping, and its irradiance by Lambert's formula: exact, without noise. Emitters that
 * more occluders stand before than that pays for, and scenes of many emitters, are sampled
 * by shadow rays instead, which come with a standard error. A punctual light takes one
 * shadow ray and has no error. Light through mirrors and panes is not direct: everything hides
 * what is behind it. */
#ifndef TWOPASS_DIRECT_H
#define TWOPASS_DIRECT_H

#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"
#include "lib/ray/ray.h"

/* What all points share. Read-only once made. */
struct direct;

/* One thread's scratch space, and what stands between one element-side and the emitters. */
struct direct_worker;

/* m and rays must outlive it. O(triangles log triangles). NULL and e on failure. */
struct direct *occ_direct_new(const struct model *m, const struct ray_scene *rays, struct err *e);
void occ_direct_free(struct direct *d);

struct direct_worker *occ_direct_worker_new(const struct direct *d, struct err *e);
void occ_direct_worker_free(struct direct_worker *w);

/* Makes the side the one that the points of occ_direct_at are on; free if it already was.
 * O(emitters x occluders near the lines between). */
void occ_direct_begin(struct direct_worker *w, uint32_t element_side);

/* Irradiance of the side at a point x (world) of its element from all emitters and lights, into
 * h[bands], and its standard error into error[bands] (0 where it is exact). Shadow rays
 * are aimed by `seed`, as many as it takes for an error of `relative` times h and what the
 * point has beside, other[bands], within limits. The result depends on nothing else. 0, or
 * -1 and e when memory is short.
 * O(emitters x occluders between + lights). */
int occ_direct_at(struct direct_worker *w, const double x[3], uint64_t seed, double relative,
                  const double *other, double *h, double *error, struct err *e);

/* A weight of directions: at(unit direction, arg), which is smooth over angles of `width` and
 * nothing to speak of beyond the angle `reach` from the unit vector `axis`. */
struct direct_weight {
	double (*at)(const double dir[3], const void *arg);
	const void *arg;
	double axis[3], width, reach;
};

/* 1 if the side of occ_direct_begin has to sample some emitter. */
int occ_direct_sampled(const struct direct_worker *w);

/* The radiance that a point of a side that samples none gets straight from emitters,
 * integrated over directions with a weight, into h[bands]. Punctual lights have none. 0, or
 * -1 and e when memory is short. O(emitters x occluders between). */
int occ_direct_weighted(struct direct_worker *w, const double x[3],
                        const struct direct_weight *weight, double *h, struct err *e);

/* 1 if emitters are few enough to be looked at one by one. */
int occ_direct_exact(const struct direct *d);

#endif
