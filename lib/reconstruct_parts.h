/* What reconstruct.c and reconstruct_fit.c share. */
#ifndef TWOPASS_RECONSTRUCT_PARTS_H
#define TWOPASS_RECONSTRUCT_PARTS_H

#include <stddef.h>
#include <stdint.h>

#include "model.h"
#include "reconstruct.h"
#include "smooth.h"
#include "solution.h"

/* cos 30 degrees: flatter edges are smoothed over. */
#define COS_CREASE .86602540378443865

enum {
	RINGS = 3,    /* of neighbours that a fit may reach */
	NEAR_MAX = 96,/* elements that one of them may add */
	SEEN_MAX = 4096 /* corners that may be looked at for it */
};

struct reconstruct_near {
	uint32_t element;
	double x, y, w;           /* tangent coordinates; weights sum to 1 */
};

struct reconstruct_scratch {
	uint32_t *stamp;          /* [elements] group + 1 that last listed it */
	struct reconstruct_near *near;
};

struct reconstruct_job {
	const struct model *m;
	const struct solution *s;
	struct smooth_groups g;
	int columns;              /* bands, twice where light straight from emitters and other
	                             light are interpolated apart: one has edges and little
	                             noise, the other noise and few edges */
	double *h;                /* [2 elements][columns] */
	double *error;            /* of them, or NULL */
	double *value;            /* [groups][2 sides][columns] at the vertices */
	double *rest;             /* [2 elements][columns] what their means still miss */
	double *shift;            /* [groups][2 sides][columns] */
	struct reconstruction *out;
	struct reconstruct_scratch *scratch;  /* one a thread */
};

/* Irradiance of an element in a channel: a side and a column. */
static inline double reconstruct_mean(const struct reconstruct_job *j, uint32_t element, size_t channel)
{
	return j->h[2 * (size_t)element * (size_t)j->columns + channel];
}

/* Fits the values at the vertices of groups [begin, end) of a struct reconstruct_job; for par_for. */
void reconstruct_fit(void *job, size_t begin, size_t end, int thread);

#endif
