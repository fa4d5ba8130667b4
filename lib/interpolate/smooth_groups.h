/* Smooth groups: which elements are smoothed together about a vertex. */
#ifndef TWOPASS_SMOOTH_GROUPS_H
#define TWOPASS_SMOOTH_GROUPS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"

/* A corner is 3 element + its place in the element. Corners of one group share a
 * vertex and a surface, and their elements are joined through edges at that vertex
 * whose normals differ by less than the crease angle. */
struct smooth_groups {
	size_t groups;
	uint32_t *group;   /* [3 elements] of each corner */
	uint32_t *start;   /* [groups+1] first corner in `corner` */
	uint32_t *corner;  /* [3 elements] corners by group, ascending in each */
};

/* O(elements log(valence)). 0, or -1 and e. */
int interp_smooth_groups_new(const struct model *m, double cos_crease, struct smooth_groups *g,
                             struct err *e);
void interp_smooth_groups_free(struct smooth_groups *g);

#endif
