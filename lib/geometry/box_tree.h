/* A tree of boxes about triangles, to find those near a box. */
#ifndef TWOPASS_BOX_TREE_H
#define TWOPASS_BOX_TREE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/base/mem.h"

struct box {
	double lo[3], hi[3];
};

/* About the triangles order[begin, end); its children, if any, follow it. */
struct boxes_node {
	struct box box;
	uint32_t begin, end;
	uint32_t next;        /* the first node that is not below this one */
};

struct boxes {
	size_t n;
	uint32_t *order;      /* [n] triangles along a Morton curve */
	struct box *box;      /* [n] of each triangle */
	size_t nodes;
	struct boxes_node *node;  /* depth first */
};

/* O(n log n). 0, or -1 and e; to be freed in any case. */
int geo_boxes_build(struct boxes *b, const double *vertex, const uint32_t *triangle, size_t n,
                    struct err *e);
void geo_boxes_free(struct boxes *b);

/* Appends (uint32_t) the triangles whose boxes come within `margin` of `near`.
 * O(log n + found) for well-shaped triangles. 0, or -1 and e. */
int geo_boxes_find(const struct boxes *b, const struct box *near, double margin,
                   struct array *found, struct err *e);

#endif
