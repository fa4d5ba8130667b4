/* Rows that need no tally (private to lib/ff_*.c). */
#ifndef TWOPASS_FF_EXACT_H
#define TWOPASS_FF_EXACT_H

#include "ff_tally.h"

/* What a diffuse row says beside its values. */
struct exact_row {
	uint32_t side;
	double scale, residual, error;
	double escape, black;
};

/* Appends an entry into reserved room; returns its value as it is stored. */
double batch_put_value(struct ff_batch *b, uint32_t column, double value);

/* Closes a diffuse row of one block, chain 0, after its values. 0, or -1 and e. */
int batch_put_exact(struct ff_batch *b, const struct exact_row *r, struct err *e);

#endif
