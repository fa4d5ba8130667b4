/* Rays of one gathering point (private to lib/gather*.c). */
#ifndef TWOPASS_FINAL_GATHER_RAYS_H
#define TWOPASS_FINAL_GATHER_RAYS_H

#include "lib/ray/locate.h"
#include "lib/view/final_gather.h"
#include "lib/view/final_gather_specular.h"
#include "lib/view/specular_path.h"

/* What rays find: the radiance of element-sides as a linear function of the weights of
 * corners 1 and 2 of their triangles, c0 + c1 w1 + c2 w2. */
struct gather_table {
	const struct view_scene *v;
	struct locator locator;
	float *radiance;            /* [2 elements][3][bands] */
	float *rest;                /* [2 elements][3][bands] the same without direct light */
	struct reconstruction indirect; /* as interpolated */
	unsigned char *kind;        /* [2 elements] GATHER_... */
	uint32_t *bits;             /* [2][GATHER_BITS] of Sobol points */
};

/* Where a ray goes on; where the light straight from emitters varies more than elements
 * tell: it is computed where rays meet such a side close by. */
enum { GATHER_TAIL = 1, GATHER_ROUGH = 2 };

/* A point close to the one in work where direct light is computed. */
struct gather_close {
	size_t place;               /* element-side */
	uint32_t turn;              /* in which it was met */
	double x[3], w[2];          /* world; weights of corners 1 and 2 of its triangle */
	double *sum;                /* that its radiance goes into */
};

enum { GATHER_CLOSES = 2048 };

/* One thread's. */
struct gather_worker {
	const struct gather_table *t;
	struct gather_tails *tails;
	struct gather_close close[GATHER_CLOSES];
	uint32_t closes;
	double normal[3];           /* of the point in work */
	double blur[BANDS_MAX];     /* variance of the radiance that the solution has found wrong, */
	double blurs;               /* summed over so many rays */
	struct direct_worker *direct;
	struct err e;
	uint64_t rays;
};

/* v must outlive it. 0, or -1 and e; to be freed in any case. O(elements). */
int view_gather_table_init(struct gather_table *t, const struct view_scene *v, const struct solution *s,
                           int threads, struct err *e);
void view_gather_table_free(struct gather_table *t);

int view_gather_worker_init(struct gather_worker *w, const struct gather_table *t,
                            const struct view_scene *v, int depth, struct err *e);
void view_gather_worker_free(struct gather_worker *w);

/* The element-sides that the first n rays of a batch met, those of misses apart. */
void view_gather_places(const struct gather_table *t, const struct ray_batch *b, uint32_t n,
                        uint32_t place[RAY_BATCH]);

/* Adds weight[bands] times the radiance M / pi of what ray i of a batch met. */
void view_gather_add(const struct gather_table *t, const struct ray_batch *b, uint32_t i, uint32_t place,
                     const double *weight, double *sum);

/* Indirect irradiance at a point that has left its surface, whose side has unit normal n:
 * pi times the mean radiance of `rays` rays by the cosine; with relative > 0 as many as it
 * takes for a standard error of that times scale[bands]. */
void view_gather_point(struct gather_worker *w, const double x[3], const double n[3], uint64_t seed,
                       int rays, double relative, const double *scale, struct gathered *to);

#endif
