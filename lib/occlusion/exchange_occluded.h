/* Exchange areas of partly hidden facets. One of them is cut where the shadows of occluders end,
 * and where what they hide changes its law; cells in no shadow, or from which all is surely hidden,
 * are exact; over the others what their points see exactly is integrated by adaptive cubature. */
#ifndef TWOPASS_EXCHANGE_OCCLUDED_H
#define TWOPASS_EXCHANGE_OCCLUDED_H

#include "lib/base/mem.h"
#include "lib/geometry/exchange_unoccluded.h"
#include "lib/occlusion/shadow_edges.h"
#include "lib/occlusion/visible_region.h"

/* One thread's scratch space; begin with {0}, release with occ_occluded_free. */
struct occluded {
	struct visible_point visible;
	struct shadows shadows;
	int occluders;
	struct array cell, heap;        /* struct cell; struct rank of them */
};

void occ_occluded_free(struct occluded *o);

/* Exchange area, m^2, of the facets of a shaft found SHAFT_PARTLY, to an absolute
 * error of `tolerance` m^2 if `most` evaluations of what a point sees reach that; the
 * error estimate goes to *error. NaN and e when memory is short. */
double occ_occluded_exchange(struct occluded *o, struct unoccluded *unoccluded,
                             const struct shaft *l, double tolerance, int most, double *error,
                             struct err *e);

#endif
