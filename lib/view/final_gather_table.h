/* What gathering rays find where they meet a surface (private to lib/view). */
#ifndef TWOPASS_FINAL_GATHER_TABLE_H
#define TWOPASS_FINAL_GATHER_TABLE_H

#include "lib/ray/locate.h"
#include "lib/view/view_scene.h"

/* Points of the sequence that are kept, a count: enough for --gather-rays 4096, and in the cache
 * (32 KB). */
enum { GATHER_BITS = 1 << 12 };

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

/* v must outlive it. 0, or -1 and e; to be freed in any case. O(elements). */
int view_gather_table_init(struct gather_table *t, const struct view_scene *v,
                           const struct solution *s, int threads, struct err *e);
void view_gather_table_free(struct gather_table *t);

/* The element-sides that the first n rays of a batch met, those of misses apart. */
void view_gather_places(const struct gather_table *t, const struct ray_batch *b, uint32_t n,
                        uint32_t place[RAY_BATCH]);

/* The point (world) that ray i of a batch met, in its triangle. */
void view_gather_hit(const struct gather_table *t, const struct ray_batch *b, uint32_t i,
                     double x[3]);

/* Adds weight[bands] times the radiance M / pi of what ray i of a batch met. */
void view_gather_add(const struct gather_table *t, const struct ray_batch *b, uint32_t i,
                     uint32_t place, const double *weight, double *sum);

#endif
