/* Whether a struct ff is what ff.h says, before anybody relies on it. */
#ifndef TWOPASS_FF_CHECK_H
#define TWOPASS_FF_CHECK_H

#include "lib/data/ff.h"

/* The model form factors were made for, as far as reading them needs it. */
struct ff_scene {
	size_t patches, elements, materials, lights;
	const uint32_t *patch_start;  /* [patches+1] */
	const double *patch_area;     /* [patches] */
	const uint8_t *patch_sides;   /* [patches] bit 0: front modelled, bit 1: back */
};

/* Starts, ranges, orders, finite values, and rows that close to 1e-9. 0, or -1
 * and e with "array NAME: what is wrong at which index".
 * O(rows + blocks + entries + links). */
int ff_check(const struct ff *f, const struct ff_scene *s, struct err *e);

#endif
