/* Surfaces as rays of a view meet them (private to lib/view). */
#ifndef TWOPASS_SURFACE_POINT_H
#define TWOPASS_SURFACE_POINT_H

#include "lib/view/view_scene.h"

struct view_point {
	uint32_t element, material;
	int side;
	double x[3], n[3];  /* n: front normal */
	double w[3];        /* weights of the element's corners */
	double cosine;      /* |n.dir| */
	double way;         /* to it */
};

/* The surface that a ray meets first, or past the backs of one-sided materials if `passes`; all
 * but x. Returns 0 where nothing, or only a black back, is met. Adds to *rays. */
int view_see(const struct view_scene *v, const double org[3], const double dir[3], int passes,
             struct view_point *p, uint64_t *rays);

/* x, from the corners: closer to the plane than along the ray. */
void view_locate(const struct view_scene *v, struct view_point *p);

/* Where rays that leave by a side begin. Needs x. */
void view_leave(const struct view_scene *v, const struct view_point *p, int side, double x[3]);

/* The material there, as it is seen. */
const struct view_side *view_side_at(const struct view_scene *v, const struct view_point *p);

#endif
