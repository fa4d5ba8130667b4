/* Form factors of a whole model, patch by patch. */
#ifndef TWOPASS_FF_BUILD_H
#define TWOPASS_FF_BUILD_H

#include "lib/base/err.h"
#include "lib/base/parallel.h"
#include "lib/data/ff.h"
#include "lib/data/model.h"
#include "lib/ff_rays/ff_options.h"

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

/* Computes all rows and links that leave the patches of the shard and
 * hands them to the sink in order; the result does not depend on threads.
 * `whole` receives the chain table, patch range and shard numbers (ff_free it).
 * 0, or -1 and e.
 * rays: O(patch-sides x rays x log triangles); hemicube: O(patch-sides x points
 * x (elements + pixels)); links: O(directional patch-sides x (sources + rays)). */
int ff_build(const struct model *m, const struct ff_options *o, struct ff *whole,
             struct ff_stats *stats, const struct ff_sink *sink,
             const struct progress *progress, struct err *e);

#endif
