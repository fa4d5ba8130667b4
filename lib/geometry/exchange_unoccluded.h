/* Exchange areas of facets with nothing between them: by cubature where both are small for
 * their distance (one rule for two parallelograms that are very small), by Lambert's formula
 * over the points of a small one near a large one, by contour integrals for near and touching
 * ones. */
#ifndef TWOPASS_EXCHANGE_UNOCCLUDED_H
#define TWOPASS_EXCHANGE_UNOCCLUDED_H

#include "lib/geometry/cubature.h"
#include "lib/geometry/cubature_pair.h"

/* Points of a facet that are kept: [CUBATURE_LEVELS], and those of the rule for pairs; or NULL. */
struct unoccluded_points {
	const struct cubature *level;
	const struct cubature_pair *pair;
};

/* One thread's scratch space and what accuracy asks for. */
struct unoccluded {
	double relative, reach[CUBATURE_LEVELS];
	/* Enough for the finest level: 36 points for every two corners but the first two. */
	double points[2][4][FACET_CORNERS * 18];
};

/* relative: error of exchange areas. */
void geo_unoccluded_init(struct unoccluded *c, double relative);

/* Exchange area, m^2, of facets that lie in front of one another. */
double geo_unoccluded_exchange(struct unoccluded *c, const struct facet *a,
                               struct unoccluded_points pa, const struct facet *b,
                               struct unoccluded_points pb);

#endif
