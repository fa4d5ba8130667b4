/* The safetensors container of .mesh, .ff and .rad files: 8 bytes of the header's length
 * (little-endian), the header in JSON, arrays as they are in memory (little-endian) without
 * gaps, the widest type first, so that all are aligned. mesh(5) has the format. */
#ifndef TWOPASS_CONTAINER_H
#define TWOPASS_CONTAINER_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"

enum dtype { DT_F64, DT_U64, DT_I64, DT_F32, DT_U32, DT_I32, DT_U16, DT_U8, DT_COUNT };

size_t file_dtype_size(enum dtype t);
const char *file_dtype_name(enum dtype t); /* safetensors: "F64", "U64", … "U8" */

enum { CONTAINER_DIMS = 4 }; /* of an array at most; ours have up to 3 */

/* ---- writing: streaming and atomic ---- */

struct container_writer;

/* Begins `path` ("-" = stdout). Nothing appears under that name before
 * file_container_finish. NULL and e on failure. */
struct container_writer *file_container_create(const char *path, struct err *e);

/* Declares an array. shape[0] may be 0 = as many rows as get written. Returns
 * its handle (>= 0), or -1 and e. All arrays are declared before any write. */
int file_container_array(struct container_writer *w, const char *name, enum dtype t, int dims,
                         const uint64_t *shape, struct err *e);

/* Appends bytes (a whole number of elements) to an array; arrays may be
 * interleaved in any order. */
int file_container_write(struct container_writer *w, int array, const void *data, size_t bytes,
                         struct err *e);

/* Declares and writes an array at once (may be called between other writes). */
int file_container_put(struct container_writer *w, const char *name, enum dtype t, int dims,
                       const uint64_t *shape, const void *data, struct err *e);

/* The path as given to file_container_create, for messages. */
const char *file_container_writer_path(const struct container_writer *w);

/* Adds or replaces a string of __metadata__. */
int file_container_meta(struct container_writer *w, const char *key, const char *value,
                        struct err *e);

/* Checks that every array got what its shape says, adds the digests, writes
 * everything through an atomic_file. Frees w in any case. 0, or -1 and e, with
 * the old file whole. Cost: one copy of the arrays (they are kept in memory
 * while small, else in unlinked files beside the target). */
int file_container_finish(struct container_writer *w, struct err *e);

/* Gives up: removes temporary files and frees w (NULL allowed). */
void file_container_abandon(struct container_writer *w);

/* ---- reading: memory-mapped, distrustful ---- */

struct container;

struct container_view {
	const char *name;
	enum dtype type;
	int dims;
	uint64_t shape[CONTAINER_DIMS];
	uint64_t count;            /* elements */
	const void *data;          /* aligned for the type, mapped read-only */
};

/* Opens and checks the structure (lengths, overlaps, gaps, alignment, JSON,
 * header digest) but not the arrays' digests. format: expected value of
 * __metadata__.format ("twopass.mesh"), or NULL for any twopass format.
 * "-" is not accepted. NULL and e on failure, e.g.
 * "room.ff: this is a twopass.mesh file; a twopass.ff file is needed". */
struct container *file_container_open(const char *path, const char *format, struct err *e);
void file_container_close(struct container *c);

const char *file_container_path(const struct container *c);
const char *file_container_get_meta(const struct container *c, const char *key); /* or NULL */
size_t file_container_metas(const struct container *c);
const char *file_container_meta_at(const struct container *c, size_t i, const char **value);

size_t file_container_arrays(const struct container *c);
const struct container_view *file_container_at(const struct container *c, size_t i);
/* NULL when absent. */
const struct container_view *file_container_find(const struct container *c, const char *name);

/* The array with this name, type and shape: dims sizes where shape[i] = UINT64_MAX
 * accepts any. NULL and e naming file, array and what is wrong otherwise. */
const struct container_view *file_container_need(const struct container *c, const char *name,
                                                 enum dtype t, int dims, const uint64_t *shape,
                                                 struct err *e);

/* Recomputes an array's digest (XXH3-128) and compares. */
int file_container_verify(const struct container *c, const struct container_view *v,
                          struct err *e);

/* Verifies every array. */
int file_container_verify_all(const struct container *c, struct err *e);

/* XXH3-128 of all array digests and the metadata: 32 hex digits and NUL. What a
 * file that builds on this one binds to. Left out is what changes without
 * touching a solution: arrays and keys beginning with "camera", the key, the
 * report and the header's own digest. */
void file_container_digest(const struct container *c, char hex[33]);

/* "PATH: <text>; run TOOL again", TOOL being what makes this kind of file: the
 * refusal of contents that file_container_open cannot judge. Returns -1. */
int file_container_refuse(const struct container *c, struct err *e, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
