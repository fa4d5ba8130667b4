/* Points of samples, shared by all rows (for lib/ff). */
#ifndef TWOPASS_SOBOL_POINTS_H
#define TWOPASS_SOBOL_POINTS_H

#include "lib/ff_rays/ff_internal.h"

/* Fills job->of_rows, of_reciprocal, of_small. O(points log points). 0, or -1 and e. */
int ff_sobol_points(struct ff_job *j, struct err *e);

#endif
