/* Form factors of a whole model, patch by patch. */
#ifndef TWOPASS_FF_BUILD_H
#define TWOPASS_FF_BUILD_H

#include "lib/base/err.h"
#include "lib/base/parallel.h"
#include "lib/data/ff.h"
#include "lib/data/model.h"

enum ff_method { FF_RAYS, FF_HEMICUBE, FF_ANALYTIC, FF_AUTO };

struct ff_options {
	enum ff_method method;
	uint32_t rays;        /* rays: a patch-side; hemicube: pixels along an edge */
	uint32_t points;      /* hemicube: sample points on a patch */
	uint32_t emitter_gain;/* rays: this many times the rays for emitters */
	uint32_t gather;      /* rays: that an element-side gathers with; 0: rows alone */
	uint32_t lobe_rays;   /* rays spent on the G rows of a patch-side and lobe */
	int centroid;         /* links as in the paper: a direction for each source */
	uint32_t lobe_depth;  /* lobes in succession that light of a lobe is followed through */
	uint32_t depth;       /* longest chain of events followed */
	uint64_t seed;
	double target;        /* analytic: absolute error of a partly hidden factor */
	int evaluations;      /* analytic: the most spent on one */
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

struct ff_stats {
	double rays;          /* traced, all kinds */
	double samples;       /* rays or pixels spent on diffuse rows */
	size_t rows[FF_ROW_KINDS]; /* by kind */
	size_t links, blocks, entries;
	double worst_residual;/* largest |raw 1 - sum| of a row */
	double mean_error;    /* mean and largest standard error of the diffuse rows */
	double worst_error;
	double pairs[4];      /* analytic: of facets, nothing between; hidden; partly hidden;
	                         with a crowd between, sampled */
	double evaluations;
	size_t sides, curved; /* analytic: modelled patch-sides; those no formula is for */
	int directional;      /* analytic to patches: lobes, mirrors or panes need rays */
	double cut;           /* largest fraction of a row cut at the depth limit */
};

/* Receives batches in patch order. */
struct ff_sink {
	int (*put)(void *arg, const struct ff *batch, struct err *e);
	void *arg;
};

/* Computes all rows and links that leave the patches of shard part/parts and
 * hands them to the sink in order; the result does not depend on threads.
 * `whole` receives the chain table, patch range and shard numbers (ff_free it).
 * 0, or -1 and e.
 * rays: O(patch-sides x rays x log triangles); hemicube: O(patch-sides x points
 * x (elements + pixels)); links: O(directional patch-sides x (sources + rays)). */
int ff_build(const struct model *m, const struct ff_options *o, struct ff *whole,
             struct ff_stats *stats, const struct ff_sink *sink,
             const struct progress *progress, struct err *e);

#endif
