/* What a user can ask of the computation of form factors. */
#ifndef TWOPASS_FF_OPTIONS_H
#define TWOPASS_FF_OPTIONS_H

#include <stdint.h>

#include "lib/base/err.h"

/* The paper's algorithm as printed, or with eq. (3) summed over all that a lobe sees, what
 * escapes included. */
enum ff_paper { FF_PAPER_NO, FF_PAPER_PRINTED, FF_PAPER_CLOSED };

enum ff_method { FF_RAYS, FF_HEMICUBE, FF_ANALYTIC, FF_AUTO };

struct ff_options {
	enum ff_method method;
	uint32_t rays;        /* rays: a patch-side; hemicube: pixels along an edge */
	uint32_t points;      /* hemicube: sample points on a patch */
	uint32_t emitter_gain;/* rays: this many times the rays for emitters */
	uint32_t gather;      /* rays: that an element-side gathers with; 0: rows alone */
	uint32_t lobe_rays;   /* rays spent on the G rows of a patch-side and lobe */
	enum ff_paper paper;  /* one hemicube at each centre, lobes by its pixels */
	int centroid;         /* links as in the paper: a direction for each source */
	uint32_t lobe_depth;  /* lobes in succession that light of a lobe is followed through */
	uint32_t depth;       /* longest chain of events followed */
	uint64_t seed;
	double target;        /* analytic: absolute error of a partly hidden factor */
	int evaluations;      /* analytic: the most spent on one */
	int pair_errors;      /* formulas to patches: the error of each factor is kept */
	int close;            /* formulas to patches: closed rows are made to add up */
	int to_patches;       /* columns are patch-sides */
	int f64;
	uint32_t shard, shards; /* 1-based shard */
	int threads;
};

/* What is left to ff_options_complete: the number of rays and the target are 0, gather
 * this. */
#define FF_GATHER_UNSET UINT32_MAX

#define FF_OPTIONS_DEFAULT \
	((struct ff_options){ .method = FF_AUTO, .points = 16, .emitter_gain = 8, \
	                      .gather = FF_GATHER_UNSET, .lobe_rays = 4096, .lobe_depth = 4, \
	                      .depth = 256, .seed = 1, .evaluations = 50000, .shard = 1, .shards = 1 })

/* Fills in what is unset and depends on other options, and makes the number of rays one
 * that the method can use. 0, or -1 and e if options contradict one another. */
int ff_options_complete(struct ff_options *o, struct err *e);

#endif
