/* How the exitance of an element-side varies: what it and its neighbours are on average, as a
 * function linear over the element (private to lib/radiosity). */
#ifndef TWOPASS_EXITANCE_SLOPE_H
#define TWOPASS_EXITANCE_SLOPE_H

#include "lib/base/channels.h"
#include "lib/data/model.h"

/* Elements about a vertex, and their centres. */
struct neighbours {
	const struct model *m;
	uint64_t *start;          /* [vertices+1] */
	uint32_t *element;        /* [3E] */
	double (*centre)[3];      /* [E] */
};

/* O(elements). 0, or -1 and e; to be freed either way. */
int radiosity_neighbours_init(struct neighbours *n, const struct model *m, struct err *e);
void radiosity_neighbours_free(struct neighbours *n);

/* The linear function fitted by least squares to the values [2E] of an element-side and of those of
 * its surface that share a vertex with it: slope[k] times the weight of corner k + 1 beyond a
 * third. 0 where fewer than three or too narrow a ring of them leave it open. */
void radiosity_exitance_slope(const struct neighbours *n, const lanes *value,
                              uint32_t element_side, lanes slope[2]);

#endif
