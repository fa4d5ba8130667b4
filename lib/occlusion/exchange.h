/* The exchange area of two facets, A_a F_ab = A_b F_ba = integral over both of
 * cos cos / (pi r^2) where they see one another: computed once for both ways. */
#ifndef TWOPASS_EXCHANGE_H
#define TWOPASS_EXCHANGE_H

#include "lib/geometry/exchange_unoccluded.h"
#include "lib/occlusion/exchange_occluded.h"
#include "lib/occlusion/facet_set.h"
#include "lib/ray/ray.h"

struct exchange_options {
	double relative;      /* error of what nothing hides, relative */
	double absolute;      /* error of a form factor, of either facet, that is partly hidden */
	int most;             /* evaluations spent on one such */
	int occluders;        /* between two facets, beyond which it is a crowd */
	int crowd_rays;       /* spent on one with a crowd between; 0: it is left at 0 */
};

/* What was done, by pairs of facets. */
struct exchange_counts {
	double pairs, unoccluded, hidden, partly, crowded;
	double evaluations;
};

/* One thread's scratch space. */
struct exchanger {
	struct exchange_options o;
	const struct occluder_set *occluders;
	struct ray_scene *rays;               /* for crowded pairs */
	const double *centre;                 /* what facets are relative to */
	struct unoccluded unoccluded;
	struct shaft shaft;
	struct occluded occluded;
	struct exchange_counts counts;
};

void occ_exchanger_init(struct exchanger *x, const struct exchange_options *o,
                        const struct occluder_set *occluders, struct ray_scene *rays,
                        const double centre[3]);
void occ_exchanger_free(struct exchanger *x);

/* Exchange area, m^2, of facets i of a set and j of a set; *error is an estimate of its
 * absolute error. NaN and e when memory is short. */
double occ_exchange(struct exchanger *x, const struct facet_set *a, uint32_t i,
                    const struct facet_set *b, uint32_t j, double *error, struct err *e);

#endif
