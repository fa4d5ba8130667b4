/* Output files that appear whole or not at all. */
#ifndef TWOPASS_ATOMIC_FILE_H
#define TWOPASS_ATOMIC_FILE_H

#include <stddef.h>

#include "lib/base/err.h"

struct atomic_file;

/* 0 if the directory of `path` can be written to, else -1 and e: better known before
 * the work than after. */
int file_atomic_check(const char *path, struct err *e);

/* Begins `path` ("-" = stdout) in a temporary file of the same directory, with
 * the old file's permissions. A target that is not a regular file is written
 * directly; a symbolic link is followed. NULL and e on failure. */
struct atomic_file *file_atomic_create(const char *path, struct err *e);

/* Appends. 0, or -1 and e; after a failure only abandon is left. */
int file_atomic_write(struct atomic_file *f, const void *data, size_t bytes, struct err *e);

/* 1 if bytes go to the target as they come, which cannot be sought in. */
int file_atomic_direct(const struct atomic_file *f);

/* fsyncs and renames, so that the path holds the new bytes. Frees f in any case. */
int file_atomic_finish(struct atomic_file *f, struct err *e);

/* Gives up: the old file stays as it was. Frees f (NULL allowed). */
void file_atomic_abandon(struct atomic_file *f);

/* Creates, writes and finishes at once. */
int file_atomic_put(const char *path, const void *data, size_t bytes, struct err *e);

/* Removes the temporary files of unfinished output. Async-signal-safe. */
void file_atomic_remove_temporaries(void);

#endif
