/* One element-side in numbers, for tables. */
#ifndef TWOPASS_SIDE_TABLE_H
#define TWOPASS_SIDE_TABLE_H

#include "lib/data/solution.h"

struct side_row {
	uint32_t element, patch, material, surface;
	int side;
	double area, centre[3], normal[3];                    /* that side's normal */
	double h[BANDS_MAX], m[BANDS_MAX], e[BANDS_MAX];      /* irradiance, exitance
	                                                         without emission, emitted */
};

/* Fills out for an element-side; h and m only with a solution (else NULL). */
void solution_side_row(const struct model *m, const struct solution *s, size_t element_side,
                       struct side_row *out);

#endif
