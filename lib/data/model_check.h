/* Whether a model is what model.h says, before anybody relies on it. */
#ifndef TWOPASS_MODEL_CHECK_H
#define TWOPASS_MODEL_CHECK_H

#include "lib/data/model.h"

/* An albedo: sums of coefficients up to 1 + this count as energy-conserving. A guess, some
 * roundings of float32 (1.2e-7), of which files' colours are. */
#define MODEL_ALBEDO_SLACK 1e-6

/* Checks everything but the derived arrays, which need not be there: ranges of
 * indices, starts that ascend, split trees that end in the triangle's own
 * elements, each element reached once, coefficients in [0, 1] that sum to at most
 * 1 + 1e-6, exponents >= 0, unique names, finite numbers, cameras that can see.
 * 0, or -1 and e with "array NAME: what is wrong at which index".
 * O(vertices + triangles + elements + n log n names). */
int model_check(const struct model *m, struct err *e);

#endif
