/* The facets of a model: all places that send or receive light in plane pieces. */
#ifndef TWOPASS_FACET_SET_H
#define TWOPASS_FACET_SET_H

#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"
#include "lib/geometry/cubature.h"
#include "lib/geometry/cubature_pair.h"

/* A place is a patch-side or an element-side. Corners are relative to the scene's
 * centre. A place without facets is curved, or not modelled. */
struct facet_set {
	size_t places, facets;
	uint32_t *start;          /* [places+1] first facet */
	struct facet *facet;      /* their corners are in `corner` */
	double *corner;
	struct cubature (*stored)[CUBATURE_LEVELS]; /* [facets], n = 0: not kept */
	double *points;           /* of all of them */
	struct cubature_pair *pair;      /* [facets] */
};

enum facet_places { FACETS_OF_PATCHES, FACETS_OF_ELEMENTS };

/* The centre that all facets of a model are relative to. */
void occ_facet_centre(const struct model *m, double centre[3]);

/* Planar patch-sides: their outline, cut up where it has many corners, or their elements
 * where it is not convex; or all element-sides. O(elements). 0, or -1 and e. */
int occ_facet_set_init(struct facet_set *s, const struct model *m, enum facet_places of,
                       struct err *e);
void occ_facet_set_free(struct facet_set *s);

/* The part of a facet in front of another's plane, heights up to `near` being none: f itself, a
 * part of it in `room`, or NULL. */
const struct facet *occ_facet_front(const struct facet *f, const struct facet *of, double near,
                                    struct facet_room *room);

#endif
