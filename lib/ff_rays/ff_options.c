#include "lib/ff_rays/ff_options.h"

/* Counts, the defaults of ffcalc; what they cost and bring is in tests/bench/RESULTS.md (make
 * report). An element gathers with at least 16 rays, four replicates of four; beside hemicubes, only
 * for what uneven patches do, a guess. */
enum { RAYS = 4096, HEMICUBE_PIXELS = 64, HEMICUBE_PIXELS_MAX = 8192, GATHER_LEAST = 16,
       HEMICUBE_GATHER = 64 };

/* A sixteenth of the rays; formulas need some in any case. */
static uint32_t usual_gather(const struct ff_options *o)
{
	uint32_t gather = o->rays / 16;

	return gather >= GATHER_LEAST ? gather : o->method == FF_RAYS ? 0 : GATHER_LEAST;
}

int ff_options_complete(struct ff_options *o, struct err *e)
{
	if (o->target == 0)
		o->target = o->to_patches ? 1e-6 : 1e-4;
	if (o->paper) {
		o->method = FF_HEMICUBE;
		o->points = 1;
		o->centroid = 1;
	}
	if (o->centroid)
		o->lobe_depth = 0;
	if (o->method == FF_HEMICUBE) {
		if (!o->rays)
			o->rays = HEMICUBE_PIXELS;
		if (o->rays % 2 || o->rays > HEMICUBE_PIXELS_MAX)
			return err_set(e, "%u samples: a hemicube's resolution is even and at most %d",
			               o->rays, HEMICUBE_PIXELS_MAX);
		if (o->paper || o->gather == FF_GATHER_UNSET)
			o->gather = o->paper ? 0 : HEMICUBE_GATHER;
		return 0;
	}
	o->rays = o->rays ? (o->rays + 3) / 4 * 4 : RAYS;
	if (o->gather == FF_GATHER_UNSET)
		o->gather = usual_gather(o);
	if (o->method == FF_ANALYTIC && o->gather == 0)
		return err_set(e, "formulas (-m analytic) need rays that elements gather with (--gather)");
	return 0;
}
