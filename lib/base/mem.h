/* Memory: sizes are multiplied with overflow checks. */
#ifndef TWOPASS_MEM_H
#define TWOPASS_MEM_H

#include <stddef.h>

#include "lib/base/err.h"

/* For programs, at their start: memory that is freed is kept for what is allocated next, and
 * the heap begins with large pages. Else the system's work on pages is a fifth of what a
 * small scene takes. */
void mem_keep(void);

/* Zeroed array of n elements of `size` bytes (never NULL for n = 0), to be
 * released with free(). NULL and an error naming `what` when the product
 * overflows or memory is short. */
void *mem_new(size_t n, size_t size, const char *what, struct err *e);

/* A growable array. Begin with {0}; release with free(a.data). */
struct array {
	void *data;
	size_t n, capacity;
};

/* Makes room for `more` further elements of `size` bytes. 0, or -1 and e. */
int mem_reserve(struct array *a, size_t more, size_t size, struct err *e);

/* Appends n elements copied from src. 0, or -1 and e. */
int mem_append(struct array *a, const void *src, size_t n, size_t size, struct err *e);

#endif
