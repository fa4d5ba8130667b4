/* Tables that tie arrays of a container to pointers of a struct, so that what is
 * written and what is read is one list. */
#ifndef TWOPASS_FIELDS_H
#define TWOPASS_FIELDS_H

#include "formats/container/container.h"
#include "lib/base/mem.h"

struct field {
	void *slot;           /* address of the struct's pointer to the array */
	const char *name;
	enum dtype type;
	int dims;
	uint64_t shape[CONTAINER_DIMS];
};

/* What an array that is not in the file stands for. */
enum field_absent {
	FIELD_NEVER,  /* it is always there */
	FIELD_EMPTY,  /* nothing, where it has no elements */
	FIELD_ZEROS,
	FIELD_ORDER,  /* 0, 1, 2, ... (U32, U64) */
	FIELD_EVEN    /* 0, 2, 4, ... (U32, U64) */
};

struct field_or_not {
	struct field field;
	enum field_absent absent;
};

/* Writes all arrays. 0, or -1 and e. */
int file_fields_put(struct container_writer *w, const struct field *f, size_t n, struct err *e);

/* Sets the pointers to allocated copies, or into the mapped file. Every array must
 * be there with this type and shape. 0, or -1 and e; pointers already set stay. */
int file_fields_copy(const struct container *c, const struct field *f, size_t n, struct err *e);
int file_fields_map(const struct container *c, const struct field *f, size_t n, struct err *e);

/* As file_fields_map, but an array that may be absent and is gets made, and added to `made`
 * (void *, for the caller to free). 0, or -1 and e. */
int file_fields_map_or_make(const struct container *c, const struct field_or_not *f, size_t n,
                            struct array *made, struct err *e);

/* shape[dim] of an array, which must exist with this type and number of
 * dimensions. 0, or -1 and e. */
int file_fields_size(const struct container *c, const char *name, enum dtype t, int dims, int dim,
                     size_t *size, struct err *e);

#endif
