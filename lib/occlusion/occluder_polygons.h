/* The scene's triangles merged into convex polygons (private to lib/occlusion). */
#ifndef TWOPASS_OCCLUDER_POLYGONS_H
#define TWOPASS_OCCLUDER_POLYGONS_H

#include "lib/base/mem.h"
#include "lib/occlusion/occluder_set.h"

struct polygon {
	uint32_t first, n;            /* corners in polygons.corner, counter-clockwise */
	struct plane plane;
	int two_sided;                /* a back of it is modelled */
};

struct polygons {
	double *point;                /* [points][3] distinct corners */
	size_t points;
	struct array polygon, corner; /* struct polygon; uint32_t points */
	double near;                  /* see occluder_set */
};

/* O(n log n). 0, or -1 and e. */
int occ_polygons_init(struct polygons *p, const struct model *m, struct err *e);
void occ_polygons_free(struct polygons *p);

static inline const double *occ_polygon_point(const struct polygons *p, uint32_t corner)
{
	return &p->point[3 * (size_t)((const uint32_t *)p->corner.data)[corner]];
}

static inline double occ_plane_height(const struct plane *p, const double x[3])
{
	return p->normal[0] * x[0] + p->normal[1] * x[1] + p->normal[2] * x[2] - p->offset;
}

#endif
