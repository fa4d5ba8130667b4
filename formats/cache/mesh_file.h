/* .mesh files: a struct model. Array and metadata names: mesh(5). */
#ifndef TWOPASS_MESH_FILE_H
#define TWOPASS_MESH_FILE_H

#include "formats/cache/cache.h"

/* The ids written are those of m, whatever i says. O(model). */
int file_mesh_write(const char *path, const struct model *m, const struct cache_info *i,
                    struct err *e);

/* Reads and checks everything (digests, ranges, finite values, coefficient sums,
 * monotone starts, split trees that end in the triangle's own elements, loops),
 * copies it into m and derives the rest. m and i must be zeroed; on failure they
 * are freed. */
int file_mesh_read(const char *path, struct model *m, struct cache_info *i, struct err *e);

/* The model's part of a container, shared with .rad files. What is put is checked
 * as what is got: no file is written that would be refused. Get frees m on failure. */
int file_mesh_put_model(struct container_writer *w, const struct model *m, struct err *e);
int file_mesh_get_model(const struct container *c, struct model *m, struct err *e);

/* Compares the ids of the metadata with those computed from the model. */
int file_mesh_check_ids(const struct container *c, const struct model *m,
                        const struct cache_info *i, struct err *e);

#endif
