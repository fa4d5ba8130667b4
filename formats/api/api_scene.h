/* What a handle of the public header stands for. */
#ifndef TWOPASS_API_SCENE_H
#define TWOPASS_API_SCENE_H

#include "formats/api/twopass.h"
#include "formats/cache/ff_file.h"
#include "lib/audit/patch_matrix.h"
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
int api_status(const struct err *e, struct twopass_error *error);

/* 0, or -1 and e if x is not in [least, most], NaN included. */
int api_within(const char *what, double x, double least, double most, struct err *e);

/* How many threads that makes. */
int api_threads(int threads);

/* The history of i becomes `before` and a line for this call, its other texts nothing.
 * operand may be NULL. 0, or -1 and e. */
int api_history(struct cache_info *i, const char *before, const char *call,
                const char *operand, struct err *e);

#endif
