/* What patches are made from: the elements of regions, measured (private to lib/mesh). */
#ifndef TWOPASS_DIVISION_H
#define TWOPASS_DIVISION_H

#include "lib/base/err.h"
#include "lib/data/model.h"
#include "lib/geometry/half_edge.h"

/* Connected triangles of one surface. */
struct region {
	double axis[3][3];  /* its own frame; axis[2] is the mean normal */
};

struct division {
	const struct model *m;
	struct half_edges g;           /* of the elements */
	double centre[3];         /* of the scene: coordinates are taken from here */
	double *centroid;         /* [elements][3] about the centre */
	double *area;             /* [elements][3] area vectors */
	struct region *region;
	uint32_t *element_region; /* [elements] */
	double size, cos_cone;
};

/* Finds the regions of a model, *regions of them, and measures its elements. size: of a patch, m;
 * cos_cone: of the angle that normals of a patch may be off its mean. O(elements log elements).
 * 0, or -1 and e; to be freed in any case. */
int mesh_division_init(struct division *d, const struct model *m, double size, double cos_cone,
                  size_t *regions, struct err *e);
void mesh_division_free(struct division *d);

/* Range of an element along an axis. */
void mesh_division_extent(const struct division *d, uint32_t element, const double axis[3],
                          double *lo, double *hi);

#endif
