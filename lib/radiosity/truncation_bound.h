/* The certified bound on what unshot flux can still do (private to lib/radiosity). */
#ifndef TWOPASS_TRUNCATION_BOUND_H
#define TWOPASS_TRUNCATION_BOUND_H

#include "lib/data/solution.h"
#include "lib/radiosity/components.h"

/* An upper bound of the flux that will still arrive anywhere because of what is unshot;
 * INFINITY if it cannot be bounded. Adds to *bytes what it reads of runs.
 * O(runs x steps), at most STEPS_MAX of them. */
double radiosity_truncation_bound(const struct transport *t, const struct components *components,
                                  const struct solution *s, int threads, double *bytes);

#endif
