/* What reconstruct.c and reconstruct_fit.c share (private to lib/interpolate). */
#ifndef TWOPASS_RECONSTRUCT_INTERNAL_H
#define TWOPASS_RECONSTRUCT_INTERNAL_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/channels.h"
#include "lib/base/constants.h"
#include "lib/data/model.h"
#include "lib/interpolate/reconstruct.h"
#include "lib/interpolate/smooth_groups.h"

/* Counts; guesses. */
enum {
	RINGS = 3,       /* of elements that a fit may reach */
	NEAR_MAX = 96,   /* elements that one may add: three times the third of a regular grid */
	SEEN_MAX = 4096  /* corners looked at for it: bounds the time of a fan of slivers */
};

/* Where an element is. */
struct reconstruct_place {
	double centre[3], normal[3], area;
};

struct reconstruct_near {
	uint32_t element;
	double area;
	double x, y, w;           /* tangent coordinates; weights sum to 1 */
};

struct reconstruct_scratch {
	uint32_t *listed;         /* [elements] group + 1 that last listed it */
	uint32_t *met;            /* [groups] group + 1 that last looked at its elements */
	struct reconstruct_near *near;
};

/* A row of channels, in vectors: those of the front, then of the back. Of each side the
 * bands; twice where light straight from emitters and other light are interpolated apart:
 * one has edges and little noise, the other noise and few edges. */
struct reconstruct_job {
	const struct model *m;
	const struct solution *s;
	struct smooth_groups g;
	int sides;                /* 1 where no back is modelled */
	int columns;              /* channels of a side */
	size_t vectors;           /* of a row */
	struct reconstruct_place *place; /* [elements] */
	lanes *h;                 /* [elements] rows: their means */
	lanes *precision;         /* [elements] rows: 1 over their variances, or NULL */
	lanes *value;             /* [groups] rows at the vertices */
	lanes *rest;              /* [elements] rows: what their means still miss */
	lanes *shift;             /* [groups] rows */
	void *room[5];            /* what holds these */
	struct reconstruction *out;
	struct reconstruct_scratch *scratch;  /* one a thread */
};

/* Fits the values at the vertices of groups [begin, end) of a struct reconstruct_job; for
 * par_for. */
void interp_reconstruct_fit(void *job, size_t begin, size_t end, int thread);

#endif
