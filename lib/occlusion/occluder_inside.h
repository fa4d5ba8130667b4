/* What goes on inside convex solids (private to lib/occlusion). */
#ifndef TWOPASS_OCCLUDER_INSIDE_H
#define TWOPASS_OCCLUDER_INSIDE_H

#include "lib/occlusion/occluder_solids.h"

/* Polygons, a count: a solid with more inside stays its faces, since they are compared pair by
 * pair. A guess. */
enum { INSIDERS = 64 };

/* 1 if a solid may stand for its faces: if what is seen inside it is between places that
 * are in it as a whole (see occ_shaft_cull), or nothing. A closed one may hold polygons, or
 * be crossed by some that see neither it nor one another; an open one is empty, with
 * black backs. set: see occ_solids_group. O(polygons). */
int occ_solid_is_opaque(const struct polygons *p, const struct solid *s, const uint32_t *set);

#endif
