/* What all rows share, and what each thread has for itself (private to lib/ff). */
#ifndef TWOPASS_FF_JOB_H
#define TWOPASS_FF_JOB_H

#include "lib/ff_rays/ff_internal.h"

static inline int ff_by_formula(const struct ff_options *o)
{
	return o->method == FF_ANALYTIC || o->method == FF_AUTO;
}

/* What a job needs whatever it makes. O(elements + triangles log triangles). 0, or -1 and e;
 * either way free it. */
int ff_job_init(struct ff_job *j, const struct model *m, const struct ff_options *o,
                struct err *e);
void ff_job_free(struct ff_job *j);

/* What rows that are computed one by one, of patches or of lights alone, need beside. */
int ff_job_prepare(struct ff_job *j, int patches, struct err *e);

int ff_thread_init(struct ff_thread *t, const struct ff_job *j, struct err *e);
void ff_thread_free(struct ff_thread *t);

#endif
