/* Where on a facet the shadows of blockers begin and end. */
#ifndef TWOPASS_SHADOW_H
#define TWOPASS_SHADOW_H

#include "sight.h"

enum { SHADOW_CUTS = 24 };

/* Planes that cut facet f where what its points see of facet g past the blockers changes
 * its law: through an edge of one and a corner of the other that have all of each on one
 * side (edges of the whole shadow and of its core), or through parallel edges of both.
 * Returns their number, at most SHADOW_CUTS. O(blockers x edges x corners^2). */
int shadow_cuts(const struct blocker *b, int blockers, const struct facet *f,
                const struct facet *g, double near, struct plane cut[SHADOW_CUTS]);

/* 1 if a blocker hides all of f from all of g: the shadow of a convex body from a point is
 * convex, so corners speak for facets. */
int blocker_hides(const struct blocker *b, const struct facet *f, const struct facet *g,
                  double near);

/* What blockers do to the view from a convex cell in the plane of f to g: those of the set
 * bits of `from` that may hide something stay set; 0: nothing does. *hidden is set if one
 * of them hides all. */
uint64_t shadow_on(const struct blocker *b, uint64_t from, const struct facet *cell,
                   const struct facet *g, double near, int *hidden);

#endif
