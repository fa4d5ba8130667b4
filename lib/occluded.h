/* Exchange areas of partly hidden facets: the exact form factor of what each point of one
 * sees of the other (Lambert's formula over the polygons that the blockers' silhouettes
 * leave), by adaptive cubature over the one. */
#ifndef TWOPASS_OCCLUDED_H
#define TWOPASS_OCCLUDED_H

#include "mem.h"
#include "sight.h"

/* One thread's scratch space; begin with {0}, release with occluded_free. */
struct occluded {
	struct blocker blocker[SIGHT_BLOCKERS];
	int blockers;
	struct vec piece, next;       /* struct facet_piece: what is still visible */
	struct vec cell;              /* struct cell */
	double evaluations;           /* so far */
};

void occluded_free(struct occluded *o);

/* Exchange area, m^2, of the facets of a sight line found SIGHT_PART, to an absolute
 * error of `tolerance` m^2 if `most` evaluations reach that; the error estimate goes to
 * *error. NaN and e when memory is short. */
double occluded_exchange(struct occluded *o, const struct sight_line *l, double tolerance,
                         int most, double *error, struct err *e);

#endif
