/* What a handle of the public header stands for. */
#ifndef TWOPASS_API_SCENE_H
#define TWOPASS_API_SCENE_H

#include <stdint.h>
#include <stdio.h>

#include "formats/api/twopass.h"
#include "formats/cache/ff_file.h"
#include "formats/container/history.h"
#include "lib/audit/patch_matrix.h"
#include "lib/base/parallel.h"
#include "lib/data/solution.h"

struct twopass_scene {
	struct model m;
	struct cache_info info;
	/* Patch-side and element-side: twice the number in the model, + 1 for the back. */
	size_t patches, elements;
	uint32_t *patch;          /* [patches] the modelled patch-sides */
	uint32_t *element;        /* [elements] the modelled element-sides */
	uint32_t *place;          /* [2P] where a patch-side is in `patch` */
	char **name;              /* [2P] */
	struct ff_file ff;        /* container NULL: none */
	struct patch_matrix matrix;
	struct solution s;        /* direct NULL: none */
};

/* Copies what happened to `error`, which may be NULL. 0, or -1 if e is set. */
static inline int api_status(const struct err *e, struct twopass_error *error)
{
	if (error)
		snprintf(error->text, sizeof error->text, "%s", e->set ? e->text : "");
	return e->set ? -1 : 0;
}

/* 0, or -1 and e if x is not in [least, most], NaN included. */
static inline int api_within(const char *what, double x, double least, double most,
                             struct err *e)
{
	return x >= least && x <= most ? 0 : err_set(e, "%s is %g, not between %g and %g", what, x,
	                                             least, most);
}

/* How many threads that makes. */
static inline int api_threads(int threads)
{
	return threads > 0 ? threads : par_cpus();
}

/* The history of i becomes `before` and a line for this call, its other texts nothing.
 * operand may be NULL. 0, or -1 and e. */
static inline int api_history(struct cache_info *i, const char *before, const char *call,
                              const char *operand, struct err *e)
{
	static const struct history_option none = { 0 };
	/* Nobody writes to them, though their type would allow it. */
	char *argv[] = { (char *)(uintptr_t)call, (char *)(uintptr_t)operand };
	char *history = file_history_append(before, operand ? 2 : 1, argv, &none, e);

	file_cache_info_free(i);
	i->history = history;
	return history ? 0 : -1;
}

#endif
