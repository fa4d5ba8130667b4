/* The writer of container.h: collects arrays, then puts the file together. */
#include "formats/container/container.h"

#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "formats/container/atomic_file.h"
#include "formats/container/container_internal.h"
#include "formats/container/digest.h"
#include "lib/base/mem.h"

/* Bytes of an array that are kept in memory before it goes to a file of its own: 1 MiB makes
 * writes long, a guess. */
enum { BUFFER = 1 << 20 };

struct tensor {
	char *name;
	enum dtype type;
	int dims;
	uint64_t shape[CONTAINER_DIMS];
	uint64_t bytes;        /* received so far */
	struct digest *digest;
	struct array buffer;   /* bytes not spooled: all of a small array */
	FILE *spool;           /* NULL while everything fits the buffer */
	char hex[CONTAINER_HEX + 1];
};

struct container_writer {
	char *path;
	struct atomic_file *file;
	json_t *meta;
	struct array arrays;   /* struct tensor */
};

static struct tensor *array_at(const struct container_writer *w, size_t i)
{
	return (struct tensor *)w->arrays.data + i;
}

void file_container_abandon(struct container_writer *w)
{
	char hex[CONTAINER_HEX + 1];

	if (!w)
		return;
	for (size_t i = 0; i < w->arrays.n; i++) {
		struct tensor *a = array_at(w, i);
		free(a->name);
		free(a->buffer.data);
		if (a->digest)
			file_digest_end(a->digest, hex);
		if (a->spool)
			fclose(a->spool);
	}
	free(w->arrays.data);
	json_decref(w->meta);
	file_atomic_abandon(w->file);
	free(w->path);
	free(w);
}

struct container_writer *file_container_create(const char *path, struct err *e)
{
	struct container_writer *w = mem_new(1, sizeof *w, path, e);

	if (!w)
		return NULL;
	w->path = strdup(path);
	w->meta = json_object();
	if (!w->path || !w->meta)
		err_set(e, "%s: out of memory", path);
	else if ((w->file = file_atomic_create(path, e)))
		return w;
	file_container_abandon(w);
	return NULL;
}

const char *file_container_writer_path(const struct container_writer *w)
{
	return w->path;
}

int file_container_meta(struct container_writer *w, const char *key, const char *value,
                        struct err *e)
{
	json_t *text = json_string(value);

	if (!text)
		return err_set(e, "%s: cannot write: metadata %s is not UTF-8 text", w->path, key);
	if (json_object_set_new(w->meta, key, text))
		return err_set(e, "%s: out of memory", w->path);
	return 0;
}

/* ---- arrays ---- */

static int check_declaration(const struct container_writer *w, const char *name, int dims,
                             struct err *e)
{
	if (dims < 1 || dims > CONTAINER_DIMS)
		return err_set(e, "%s: array %s: %d dimensions cannot be written", w->path, name,
		               dims);
	if (strcmp(name, CONTAINER_METADATA) == 0 || strcmp(name, "header") == 0)
		return err_set(e, "%s: array %s: the name is reserved", w->path, name);
	for (size_t i = 0; i < w->arrays.n; i++)
		if (strcmp(array_at(w, i)->name, name) == 0)
			return err_set(e, "%s: array %s: declared twice", w->path, name);
	return 0;
}

int file_container_array(struct container_writer *w, const char *name, enum dtype t, int dims,
                         const uint64_t *shape, struct err *e)
{
	struct tensor a = { .type = t, .dims = dims };

	if (check_declaration(w, name, dims, e))
		return -1;
	memcpy(a.shape, shape, (size_t)dims * sizeof *shape);
	if (mem_append(&w->arrays, &a, 1, sizeof a, e))
		return -1;
	struct tensor *kept = array_at(w, w->arrays.n - 1);
	kept->name = strdup(name);
	kept->digest = file_digest_new();
	if (!kept->name || !kept->digest)
		return err_set(e, "%s: out of memory", w->path);
	return (int)w->arrays.n - 1;
}

/* An unlinked file beside the target, where there is room for the target too. */
static FILE *spool_open(const struct container_writer *w, struct err *e)
{
	const char *slash = strrchr(w->path, '/'), *scratch = getenv("TMPDIR");
	int length = slash ? (int)(slash - w->path) : 1;
	const char *directory = slash ? w->path : ".";
	char name[4096];

	if (file_atomic_direct(w->file)) {
		directory = scratch && *scratch ? scratch : "/tmp";
		length = (int)strlen(directory);
	}
	if (snprintf(name, sizeof name, "%.*s/.twopass-XXXXXX", length, directory) >=
	    (int)sizeof name) {
		err_set(e, "%s: the directory's name is too long; choose another", w->path);
		return NULL;
	}
	int fd = mkstemp(name);
	FILE *f = fd < 0 ? NULL : fdopen(fd, "w+b");
	if (!f)
		err_set(e, "%s: cannot write: %s: %s", w->path, name, strerror(errno));
	if (fd >= 0)
		unlink(name);
	if (fd >= 0 && !f)
		close(fd);
	if (f)
		setvbuf(f, NULL, _IONBF, 0);
	return f;
}

static int spool_write(const struct container_writer *w, struct tensor *a, const void *data,
                       size_t bytes, struct err *e)
{
	if (!a->spool && !(a->spool = spool_open(w, e)))
		return -1;
	if (bytes && fwrite(data, 1, bytes, a->spool) != bytes)
		return err_set(e, "%s: array %s: cannot write: %s", w->path, a->name,
		               strerror(errno));
	return 0;
}

int file_container_write(struct container_writer *w, int array, const void *data, size_t bytes,
                         struct err *e)
{
	struct tensor *a = array_at(w, (size_t)array);

	file_digest_bytes(a->digest, data, bytes);
	a->bytes += bytes;
	if (bytes > BUFFER - a->buffer.n) {
		if (spool_write(w, a, a->buffer.data, a->buffer.n, e))
			return -1;
		a->buffer.n = 0;
		if (bytes >= BUFFER)
			return spool_write(w, a, data, bytes, e);
	}
	return mem_append(&a->buffer, data, bytes, 1, e);
}

int file_container_put(struct container_writer *w, const char *name, enum dtype t, int dims,
                       const uint64_t *shape, const void *data, struct err *e)
{
	int array = file_container_array(w, name, t, dims, shape, e);
	size_t bytes = file_dtype_size(t);

	if (array < 0)
		return -1;
	for (int d = 0; d < dims; d++)
		if (__builtin_mul_overflow(bytes, shape[d], &bytes))
			return err_set(e, "%s: array %s: too large", w->path, name);
	return file_container_write(w, array, data, bytes, e);
}

/* ---- finishing ---- */

/* Completes an open shape[0] and compares the shape with what was written. */
static int close_array(struct container_writer *w, struct tensor *a, struct err *e)
{
	uint64_t row = file_dtype_size(a->type), bytes;

	for (int d = 1; d < a->dims; d++)
		if (__builtin_mul_overflow(row, a->shape[d], &row))
			return err_set(e, "%s: array %s: too large", w->path, a->name);
	if (a->shape[0] == 0 && row)
		a->shape[0] = a->bytes / row;
	if (__builtin_mul_overflow(row, a->shape[0], &bytes) || bytes != a->bytes)
		return err_set(e, "%s: array %s: %llu bytes were written, its shape needs %llu",
		               w->path, a->name, (unsigned long long)a->bytes,
		               (unsigned long long)bytes);
	file_digest_end(a->digest, a->hex);
	a->digest = NULL;
	char key[256];
	if (snprintf(key, sizeof key, CONTAINER_DIGEST "%s", a->name) >= (int)sizeof key)
		return err_set(e, "%s: array %s: the name is too long", w->path, a->name);
	return file_container_meta(w, key, a->hex, e);
}

/* Describes one array in the header and moves the offset behind it. */
static int describe(const struct container_writer *w, json_t *header, const struct tensor *a,
                    uint64_t *offset, struct err *e)
{
	json_t *shape = json_array();
	uint64_t end = *offset + a->bytes;

	for (int d = 0; d < a->dims; d++)
		json_array_append_new(shape, json_integer((json_int_t)a->shape[d]));
	json_t *entry = json_pack("{s:s, s:o, s:[I,I]}", "dtype", file_dtype_name(a->type), "shape",
	                          shape, "data_offsets", (json_int_t)*offset, (json_int_t)end);
	*offset = end;
	if (!entry || json_object_set_new(header, a->name, entry))
		return err_set(e, "%s: array %s: out of memory", w->path, a->name);
	return 0;
}

/* The header's text, padded and with its digest; NULL and e on failure. Arrays
 * stand in it as they stand in the file: widest type first. */
static char *header_text(const struct container_writer *w, size_t *bytes, struct err *e)
{
	json_t *header = json_pack("{s:O}", CONTAINER_METADATA, w->meta);
	uint64_t offset = 0;
	int failed = 0;

	for (size_t size = 8; size; size /= 2)
		for (size_t i = 0; i < w->arrays.n && !failed; i++)
			if (file_dtype_size(array_at(w, i)->type) == size)
				failed = describe(w, header, array_at(w, i), &offset, e);
	char *json = failed ? NULL : json_dumps(header, JSON_COMPACT);
	json_decref(header);
	size_t length = json ? strlen(json) : 0;
	*bytes = (length + 7) / 8 * 8;
	char *text = json ? malloc(*bytes) : NULL, hex[CONTAINER_HEX + 1] = "";
	if (text) {
		memset(text, ' ', *bytes);
		memcpy(text, json, length);
		char *slot = file_container_header_slot(text, *bytes);
		file_container_header_digest(text, *bytes, slot, hex);
		memcpy(slot, hex, CONTAINER_HEX);
	}
	free(json);
	if (*hex)
		return text;
	free(text);
	err_set(e, "%s: out of memory", w->path);
	return NULL;
}

static int write_header(struct container_writer *w, struct err *e)
{
	size_t bytes;
	char *text = header_text(w, &bytes, e);

	if (!text)
		return -1;
	uint64_t prefix = bytes;
	int failed = bytes > CONTAINER_HEADER_MAX;
	if (failed)
		err_set(e, "%s: cannot write: the header has more than %d bytes", w->path,
		        CONTAINER_HEADER_MAX);
	failed = failed || file_atomic_write(w->file, &prefix, sizeof prefix, e) ||
	         file_atomic_write(w->file, text, bytes, e);
	free(text);
	return failed ? -1 : 0;
}

/* Copies an array's spooled bytes, then those still in its buffer. */
static int write_array(struct container_writer *w, struct tensor *a, char *block,
                       struct err *e)
{
	uint64_t left = a->bytes - a->buffer.n;

	if (a->spool)
		rewind(a->spool);
	while (left) {
		size_t n = left < BUFFER ? (size_t)left : BUFFER;
		if (fread(block, 1, n, a->spool) != n)
			return err_set(e, "%s: array %s: cannot read it back: %s", w->path,
			               a->name, strerror(errno));
		if (file_atomic_write(w->file, block, n, e))
			return -1;
		left -= n;
	}
	if (file_atomic_write(w->file, a->buffer.data, a->buffer.n, e))
		return -1;
	if (a->spool)
		fclose(a->spool); /* gives its disk space back early */
	a->spool = NULL;
	return 0;
}

static int write_all(struct container_writer *w, struct err *e)
{
	char *block = NULL;
	int failed = 0;

	for (size_t i = 0; i < w->arrays.n && !failed; i++)
		failed = close_array(w, array_at(w, i), e);
	failed = failed ||
	         file_container_meta(w, CONTAINER_HEADER_DIGEST, CONTAINER_BLANK_DIGEST, e) ||
	         write_header(w, e) || !(block = mem_new(BUFFER, 1, w->path, e));
	for (size_t size = 8; size; size /= 2)
		for (size_t i = 0; i < w->arrays.n && !failed; i++)
			if (file_dtype_size(array_at(w, i)->type) == size)
				failed = write_array(w, array_at(w, i), block, e);
	free(block);
	return failed ? -1 : 0;
}

int file_container_finish(struct container_writer *w, struct err *e)
{
	int failed = write_all(w, e);

	if (!failed) {
		failed = file_atomic_finish(w->file, e);
		w->file = NULL;
	}
	file_container_abandon(w);
	return failed;
}
