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

/* An array of a struct, to be allocated with the others: the address of the pointer to it, how many
 * elements it has, and how many bytes each. MEM_ARRAY: `width` values an element. */
struct mem_array {
	void *slot;
	size_t n, size;
};
#define MEM_ARRAY(pointer, n, width) { &(pointer), n, (width) * sizeof *(pointer) }

/* Allocates n arrays, zeroed, as mem_new does. 0, or -1 and e: then some are NULL. */
int mem_new_arrays(const struct mem_array *a, size_t n, const char *what, struct err *e);

/* Frees all of these pointers. */
#define MEM_FREE(...) \
	mem_free_arrays((void *[]){ __VA_ARGS__ }, sizeof((void *[]){ __VA_ARGS__ }) / sizeof(void *))
void mem_free_arrays(void *const *array, size_t n);

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
