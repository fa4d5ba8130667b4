/* NumPy's .npy files, version 1.0: one array, written as it comes. */
#ifndef TWOPASS_NPY_FILE_H
#define TWOPASS_NPY_FILE_H

#include "formats/container/atomic_file.h"
#include "formats/container/container.h"

/* Writes the header; the elements follow by file_atomic_write, the last dimension
 * varying fastest. 0, or -1 and e. */
int file_npy_begin(struct atomic_file *f, enum dtype t, int dims, const uint64_t *shape,
                   struct err *e);

/* Writes a whole array of a cache file to path ("-" = stdout). 0, or -1 and e. */
int file_npy_write(const char *path, const struct container_view *v, struct err *e);

#endif
