/* What one hemicube for a whole patch-side is off by (private to lib/ff). */
#ifndef TWOPASS_HEMICUBE_PILOT_H
#define TWOPASS_HEMICUBE_PILOT_H

#include "lib/ff_rays/ff_internal.h"

/* For rows of a hemicube alone (o.points 1). 0, or -1 and e. */
int ff_hemicube_pilot_init(struct ff_thread *t, struct err *e);

/* Gives the diffuse row of a patch-side, tallied from one hemicube, its squared error: its
 * difference from hemicubes at other points of the side, none of which is in the row.
 * O(elements + pixels). */
void ff_hemicube_pilot(struct ff_thread *t, uint32_t ps);

#endif
