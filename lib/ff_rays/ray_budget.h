/* How many rays rows and elements cast (for lib/ff). */
#ifndef TWOPASS_RAY_BUDGET_H
#define TWOPASS_RAY_BUDGET_H

#include "lib/ff_rays/ff_internal.h"

/* How many rays each side of an element gathers with. */
static inline uint32_t ff_reciprocal_rays(const struct ff_job *j, uint32_t element)
{
	return j->m->element.area[element] < j->small_area ? j->o.gather / 4 : j->o.gather;
}

/* Rays that a patch-side's diffuse row casts, if any. */
static inline uint32_t ff_row_rays(const struct ff_job *j, uint32_t ps)
{
	return j->emits[ps] ? j->o.rays * j->o.emitter_gain
	                    : j->o.rays >> (j->halvings ? j->halvings[ps] : 0);
}

/* How often the rays of a row can be halved so that each replicate is a whole number. */
int ff_most_halvings(uint32_t rays);

/* Sets job->halvings by what was gathered: rows that carry less light than others cast fewer
 * rays. O(pairs seen). 0, or -1 and e. */
int ff_share_rays(struct ff_job *j, struct err *e);

#endif
