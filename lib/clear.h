/* Exchange areas of facets with nothing between them: by cubature where both are small for
 * their distance, by Lambert's formula over the points of a small one near a large one, by
 * contour integrals for near and touching ones. */
#ifndef TWOPASS_CLEAR_H
#define TWOPASS_CLEAR_H

#include "cubature.h"

/* One thread's scratch space and what accuracy asks for. */
struct clear {
	double reach[CUBATURE_LEVELS];
	double points[2][4][FACET_CORNERS * 18];
};

/* relative: error of exchange areas. */
void clear_init(struct clear *c, double relative);

/* Exchange area, m^2, of facets that lie in front of one another. pa, pb: their stored
 * points [CUBATURE_LEVELS], or NULL. */
double clear_exchange(struct clear *c, const struct facet *a, const struct cubature *pa,
                      const struct facet *b, const struct cubature *pb);

#endif
