/* Form factors as text, on standard output. */
#ifndef TWOPASS_PRINT_FF_H
#define TWOPASS_PRINT_FF_H

#include "formats/cache/ff_file.h"

/* A field as RFC 4180 has it, with what follows it. */
void print_csv(const char *text, const char *after);

/* The matrix between modelled patch-sides, its last column what escapes: as CSV, or into
 * the file npy (- is standard output) as .npy. O(entries). 0, or -1 and e. */
int print_patch_matrix(const struct ff_file *ff, const char *npy, struct err *e);

/* A row that is there: its head and a line of CSV for each entry. 0, or -1 and e. */
int print_ff_row(const struct ff_file *ff, uint32_t row, struct err *e);

#endif
