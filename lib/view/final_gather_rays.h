/* Rays of one gathering point (private to lib/view). */
#ifndef TWOPASS_FINAL_GATHER_RAYS_H
#define TWOPASS_FINAL_GATHER_RAYS_H

#include "lib/view/final_gather.h"
#include "lib/view/final_gather_specular.h"
#include "lib/view/final_gather_table.h"

/* A point close to the one in work where direct light is computed. */
struct gather_close {
	size_t place;               /* element-side */
	uint32_t turn;              /* in which it was met */
	double x[3], w[2];          /* world; weights of corners 1 and 2 of its triangle */
	double *sum;                /* that its radiance goes into */
};

/* A count: points that wait, to be looked at side by side (128 KB a thread). A guess. */
enum { GATHER_CLOSES = 2048 };

/* One thread's. */
struct gather_worker {
	const struct gather_table *t;
	struct gather_tails *tails;
	struct gather_close close[GATHER_CLOSES];
	uint32_t closes;
	double normal[3];           /* of the point in work */
	double blur[BANDS_MAX];     /* variance of radiance by the errors of the solution, summed */
	double blurs;               /* over so many rays */
	struct direct_worker *direct;
	struct err e;
	uint64_t rays;
};

int view_gather_worker_init(struct gather_worker *w, const struct gather_table *t,
                            const struct view_scene *v, int depth, struct err *e);
void view_gather_worker_free(struct gather_worker *w);

/* Indirect irradiance at a point that has left its surface, whose side has unit normal n:
 * pi times the mean radiance of `rays` rays by the cosine; with relative > 0 as many as it
 * takes for a standard error of that times scale[bands]. */
void view_gather_point(struct gather_worker *w, const double x[3], const double n[3], uint64_t seed,
                       int rays, double relative, const double *scale, struct gathered *to);

#endif
