/* What the division into elements costs: an estimate of how far the irradiance inside
 * an element-side is from what interpolation between elements shows there.
 *
 * A linear function through the elements at the edges of an element predicts its mean;
 * what it misses is a second difference of the field. Over an element and those that
 * touch it, the mean of that is its curvature, which costs interpolation a third of it.
 * Its variation, less what the standard errors of the elements put into it, is of steps
 * (shadow edges, contacts, rims of caustics), which cost more than they show: a step
 * through the middle of an element is felt through its neighbours. Light straight from
 * emitters is looked at apart from other light.
 *
 * The same differences tell how good the standard errors are: they take samples for
 * independent, while stratified ones do better. */
#ifndef TWOPASS_DISCRETISATION_H
#define TWOPASS_DISCRETISATION_H

#include "lib/data/model.h"

struct solution;

/* Scales standard errors, where they are `independent` of element, of each part all alike, down to what most elements differ by from
 * their neighbours, if that is less (not where the elements of each patch share a value,
 * which then says nothing). What one hemicube for a whole patch is off by is smooth over its
 * neighbours, who do not show it: it is not independent. Fills s->error.discretisation and its part
 * s->error.discretisation_direct [2E][bands], in units of irradiance: root mean square over the
 * element-side. 0 where too few others of the same smooth surface touch it and its
 * neighbours, since nothing is known there. Light groups are summed. O(elements), the same
 * for any number of threads. 0, or -1 and e. */
int interp_discretisation(const struct model *m, struct solution *s, int independent, int threads,
                          struct err *e);

#endif
