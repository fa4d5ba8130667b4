/* The reader of container.h: maps a file and believes nothing in it. */
#include "formats/container/container.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "formats/container/container_internal.h"
#include "formats/container/digest.h"
#include "lib/base/mem.h"

struct pair {
	const char *key, *value;
};

struct container {
	char *path;
	void *map;
	size_t bytes;               /* of the file */
	uint64_t header;            /* bytes of the JSON text */
	json_t *json;               /* owns every name and metadata string */
	size_t views, metas;
	struct container_view *view; /* in the file's order */
	struct pair *meta;
};

/* What makes a kind of file. */
static const struct {
	const char *format, *tool;
} makers[] = {
	{ "twopass.mesh", "mesh" }, { "twopass.ff", "ffcalc" }, { "twopass.rad", "shoot" }
};

/* Names from a crafted file must not steer the terminal or break the line. */
static void make_printable(char *text)
{
	for (; *text; text++)
		if ((unsigned char)*text < ' ' || *text == 0x7f)
			*text = '?';
}

int file_container_refuse(const struct container *c, struct err *e, const char *format, ...)
{
	const char *kind = file_container_get_meta(c, "format"), *tool = NULL;
	char text[512];
	va_list ap;

	va_start(ap, format);
	vsnprintf(text, sizeof text, format, ap);
	va_end(ap);
	make_printable(text);
	for (size_t i = 0; kind && i < sizeof makers / sizeof *makers; i++)
		if (strcmp(kind, makers[i].format) == 0)
			tool = makers[i].tool;
	if (!tool)
		return err_set(e, "%s: %s; make the file again", c->path, text);
	return err_set(e, "%s: %s; run %s again", c->path, text, tool);
}

/* ---- opening ---- */

static int map_file(struct container *c, struct err *e)
{
	struct stat st;
	int fd = open(c->path, O_RDONLY | O_CLOEXEC | O_NONBLOCK), failed = fd < 0;

	if (failed || fstat(fd, &st)) {
		failed = err_set(e, "%s: cannot read: %s", c->path, strerror(errno));
	} else if (!S_ISREG(st.st_mode)) {
		failed = err_set(e, "%s: not a regular file; cache files are mapped, so name one",
		                 c->path);
	} else if (st.st_size < CONTAINER_PREFIX) {
		failed = err_set(e, "%s: truncated: %lld bytes; make the file again", c->path,
		                 (long long)st.st_size);
	} else {
		c->bytes = (size_t)st.st_size;
		c->map = mmap(NULL, c->bytes, PROT_READ, MAP_PRIVATE, fd, 0);
		if (c->map == MAP_FAILED) {
			c->map = NULL;
			failed = err_set(e, "%s: cannot map: %s", c->path, strerror(errno));
		}
	}
	if (fd >= 0)
		close(fd);
	return failed ? -1 : 0;
}

static const char *header_json(const struct container *c)
{
	return (const char *)c->map + CONTAINER_PREFIX;
}

static int parse_header(struct container *c, struct err *e)
{
	json_error_t je;

	memcpy(&c->header, c->map, sizeof c->header);
	uint64_t room = c->bytes - CONTAINER_PREFIX;
	if (c->header > CONTAINER_HEADER_MAX || c->header % 8 || c->header < 2)
		return err_set(e, "%s: not a twopass file (its header would have %" PRIu64
		               " bytes); name a .mesh, .ff or .rad file", c->path, c->header);
	if (c->header > room)
		return err_set(e, "%s: truncated: the header has %" PRIu64 " bytes, the file %zu; "
		               "make the file again", c->path, c->header, c->bytes);
	c->json = json_loadb(header_json(c), c->header, JSON_REJECT_DUPLICATES, &je);
	if (!json_is_object(c->json))
		return err_set(e, "%s: header: not a JSON object (%.100s); name a .mesh, .ff or "
		               ".rad file, or make it again", c->path,
		               c->json ? "another value" : je.text);
	return 0;
}

static int collect_metadata(struct container *c, struct err *e)
{
	json_t *meta = json_object_get(c->json, CONTAINER_METADATA), *value;
	const char *key;

	if (!json_is_object(meta))
		return err_set(e, "%s: header: no %s object; name a .mesh, .ff or .rad file",
		               c->path, CONTAINER_METADATA);
	c->meta = mem_new(json_object_size(meta), sizeof *c->meta, c->path, e);
	if (!c->meta)
		return -1;
	json_object_foreach(meta, key, value) {
		if (!json_is_string(value))
			return file_container_refuse(c, e, "header: metadata %.100s is not a string", key);
		c->meta[c->metas++] = (struct pair){ key, json_string_value(value) };
	}
	return 0;
}

static int check_format(const struct container *c, const char *format, struct err *e)
{
	const char *have = file_container_get_meta(c, "format");

	if (!have || strncmp(have, "twopass.", 8) != 0)
		return err_set(e, "%s: a safetensors file of another program; name a .mesh, .ff or "
		               ".rad file", c->path);
	if (format && strcmp(have, format) != 0) {
		char kind[40];
		snprintf(kind, sizeof kind, "%s", have);
		make_printable(kind);
		return err_set(e, "%s: this is a %s file; a %s file is needed", c->path, kind,
		               format);
	}
	return 0;
}

static int check_header_digest(const struct container *c, struct err *e)
{
	const char *json = header_json(c), *slot = file_container_header_slot(json, c->header);
	char hex[CONTAINER_HEX + 1];

	if (!slot)
		return file_container_refuse(c, e, "header: it has no digest");
	file_container_header_digest(json, c->header, slot, hex);
	if (strncmp(slot, hex, CONTAINER_HEX) != 0)
		return file_container_refuse(c, e, "header: damaged (its digest does not match)");
	return 0;
}

/* ---- array descriptions ---- */

static int parse_dtype(const json_t *text, enum dtype *t)
{
	const char *name = json_string_value(text);

	for (int i = 0; name && i < DT_COUNT; i++)
		if (strcmp(name, file_dtype_name((enum dtype)i)) == 0) {
			*t = (enum dtype)i;
			return 0;
		}
	return -1;
}

/* Sizes and their product; -1 unless all are integers >= 0 without overflow. */
static int parse_shape(const json_t *shape, struct container_view *v, uint64_t *bytes)
{
	size_t dims = json_array_size(shape);

	if (!json_is_array(shape) || dims > CONTAINER_DIMS)
		return -1;
	v->dims = (int)dims;
	v->count = 1;
	for (size_t d = 0; d < dims; d++) {
		const json_t *n = json_array_get(shape, d);
		if (!json_is_integer(n) || json_integer_value(n) < 0)
			return -1;
		v->shape[d] = (uint64_t)json_integer_value(n);
		if (__builtin_mul_overflow(v->count, v->shape[d], &v->count))
			return -1;
	}
	return __builtin_mul_overflow(v->count, file_dtype_size(v->type), bytes) ? -1 : 0;
}

static int parse_view(struct container *c, const char *name, const json_t *entry,
                      struct container_view *v, struct err *e)
{
	const json_t *offsets = json_object_get(entry, "data_offsets");
	const json_t *from = json_array_get(offsets, 0), *to = json_array_get(offsets, 1);
	uint64_t bytes, room = c->bytes - CONTAINER_PREFIX - c->header;

	v->name = name;
	if (parse_dtype(json_object_get(entry, "dtype"), &v->type))
		return file_container_refuse(c, e, "array %.100s: unknown dtype", name);
	if (parse_shape(json_object_get(entry, "shape"), v, &bytes))
		return file_container_refuse(c, e, "array %.100s: impossible shape", name);
	if (json_array_size(offsets) != 2 || !json_is_integer(from) || !json_is_integer(to) ||
	    json_integer_value(from) < 0 || json_integer_value(to) < json_integer_value(from))
		return file_container_refuse(c, e, "array %.100s: impossible data_offsets", name);
	uint64_t begin = (uint64_t)json_integer_value(from);
	uint64_t end = (uint64_t)json_integer_value(to);
	if (end - begin != bytes)
		return file_container_refuse(c, e, "array %.100s: %" PRIu64 " bytes, its shape needs %"
		                             PRIu64, name, end - begin, bytes);
	if (end > room)
		return file_container_refuse(c, e, "array %.100s: truncated: it ends at byte %" PRIu64
		                             " of the data, the file has %" PRIu64, name, end, room);
	if (begin % file_dtype_size(v->type))
		return file_container_refuse(c, e, "array %.100s: not aligned to its type", name);
	v->data = header_json(c) + c->header + begin;
	return 0;
}

static int by_place(const void *a, const void *b)
{
	const struct container_view *x = a, *y = b;
	const char *p = x->data, *q = y->data;

	if (p != q)
		return p < q ? -1 : 1;
	/* Empty arrays first, so that what follows each begins where it ends. */
	return (x->count > 0) - (y->count > 0);
}

/* Sorted arrays must follow one another to the end of the file. */
static int check_layout(struct container *c, struct err *e)
{
	const char *at = header_json(c) + c->header, *end = (const char *)c->map + c->bytes;

	qsort(c->view, c->views, sizeof *c->view, by_place);
	for (size_t i = 0; i < c->views; i++) {
		const struct container_view *v = &c->view[i];
		if ((const char *)v->data != at)
			return file_container_refuse(c, e, "array %.100s: %s", v->name,
			                             (const char *)v->data < at ?
			                             "overlaps another" : "there is a gap before it");
		at += v->count * file_dtype_size(v->type);
	}
	if (at != end)
		return file_container_refuse(c, e, "%lld bytes follow the last array",
		                             (long long)(end - at));
	return 0;
}

static int collect_arrays(struct container *c, struct err *e)
{
	const char *name;
	json_t *entry;

	c->view = mem_new(json_object_size(c->json), sizeof *c->view, c->path, e);
	if (!c->view)
		return -1;
	json_object_foreach(c->json, name, entry) {
		if (strcmp(name, CONTAINER_METADATA) == 0)
			continue;
		if (parse_view(c, name, entry, &c->view[c->views], e))
			return -1;
		c->views++;
	}
	return check_layout(c, e);
}

struct container *file_container_open(const char *path, const char *format, struct err *e)
{
	struct container *c = mem_new(1, sizeof *c, path, e);

	if (!c)
		return NULL;
	if (!(c->path = strdup(path)))
		err_set(e, "%s: out of memory", path);
	else if (map_file(c, e) == 0 && parse_header(c, e) == 0 && collect_metadata(c, e) == 0 &&
	         check_format(c, format, e) == 0 && check_header_digest(c, e) == 0 &&
	         collect_arrays(c, e) == 0)
		return c;
	file_container_close(c);
	return NULL;
}

void file_container_close(struct container *c)
{
	if (!c)
		return;
	if (c->map)
		munmap(c->map, c->bytes);
	json_decref(c->json);
	free(c->view);
	free(c->meta);
	free(c->path);
	free(c);
}

/* ---- what is in it ---- */

const char *file_container_path(const struct container *c)
{
	return c->path;
}

const char *file_container_get_meta(const struct container *c, const char *key)
{
	return json_string_value(json_object_get(json_object_get(c->json, CONTAINER_METADATA),
	                                         key));
}

size_t file_container_metas(const struct container *c)
{
	return c->metas;
}

const char *file_container_meta_at(const struct container *c, size_t i, const char **value)
{
	*value = c->meta[i].value;
	return c->meta[i].key;
}

size_t file_container_arrays(const struct container *c)
{
	return c->views;
}

const struct container_view *file_container_at(const struct container *c, size_t i)
{
	return &c->view[i];
}

const struct container_view *file_container_find(const struct container *c, const char *name)
{
	for (size_t i = 0; i < c->views; i++)
		if (strcmp(c->view[i].name, name) == 0)
			return &c->view[i];
	return NULL;
}

/* "F64 [3,any]" */
static void describe(char *text, size_t size, enum dtype t, int dims, const uint64_t *shape)
{
	size_t n = (size_t)snprintf(text, size, "%s [", file_dtype_name(t));

	for (int d = 0; d < dims && n < size; d++)
		n += (size_t)(shape[d] == UINT64_MAX ?
		              snprintf(text + n, size - n, "%sany", d ? "," : "") :
		              snprintf(text + n, size - n, "%s%" PRIu64, d ? "," : "", shape[d]));
	if (n < size)
		snprintf(text + n, size - n, "]");
}

const struct container_view *file_container_need(const struct container *c, const char *name,
                                                 enum dtype t, int dims, const uint64_t *shape,
                                                 struct err *e)
{
	const struct container_view *v = file_container_find(c, name);
	int match = v && v->type == t && v->dims == dims;
	char need[120], have[120];

	if (!v) {
		file_container_refuse(c, e, "array %s: missing", name);
		return NULL;
	}
	for (int d = 0; match && d < dims; d++)
		match = shape[d] == UINT64_MAX || shape[d] == v->shape[d];
	if (match)
		return v;
	describe(need, sizeof need, t, dims, shape);
	describe(have, sizeof have, v->type, v->dims, v->shape);
	file_container_refuse(c, e, "array %s: it is %s and should be %s", name, have, need);
	return NULL;
}

/* ---- digests ---- */

static const char *array_digest(const struct container *c, const struct container_view *v)
{
	char key[256];

	snprintf(key, sizeof key, CONTAINER_DIGEST "%s", v->name);
	return file_container_get_meta(c, key);
}

int file_container_verify(const struct container *c, const struct container_view *v,
                          struct err *e)
{
	const char *stored = array_digest(c, v);
	struct digest *d = file_digest_new();
	char hex[CONTAINER_HEX + 1];

	file_digest_bytes(d, v->data, v->count * file_dtype_size(v->type));
	file_digest_end(d, hex);
	if (!*hex)
		return err_set(e, "%s: out of memory", c->path);
	if (!stored)
		return file_container_refuse(c, e, "array %.100s: it has no digest", v->name);
	if (strcmp(stored, hex) != 0)
		return file_container_refuse(c, e, "array %.100s: damaged (its digest does not match)",
		                             v->name);
	return 0;
}

int file_container_verify_all(const struct container *c, struct err *e)
{
	for (size_t i = 0; i < c->views; i++)
		if (file_container_verify(c, &c->view[i], e))
			return -1;
	return 0;
}

static int by_key(const void *a, const void *b)
{
	return strcmp(((const struct pair *)a)->key, ((const struct pair *)b)->key);
}

/* What may differ between files that mean the same solution. */
static int loose_key(const char *key)
{
	static const char digest_of_camera[] = CONTAINER_DIGEST "camera";

	return strncmp(key, "camera", 6) == 0 ||
	       strncmp(key, digest_of_camera, sizeof digest_of_camera - 1) == 0 ||
	       strcmp(key, CONTAINER_HEADER_DIGEST) == 0 || strcmp(key, "key") == 0 ||
	       strcmp(key, "report") == 0;
}

void file_container_digest(const struct container *c, char hex[33])
{
	struct digest *d = file_digest_new();
	struct pair *sorted = calloc(c->metas + 1, sizeof *sorted);

	/* Array digests are metadata too. */
	if (sorted && c->metas)
		memcpy(sorted, c->meta, c->metas * sizeof *sorted);
	if (sorted)
		qsort(sorted, c->metas, sizeof *sorted, by_key);
	for (size_t i = 0; sorted && i < c->metas; i++)
		if (!loose_key(sorted[i].key)) {
			file_digest_string(d, sorted[i].key);
			file_digest_string(d, sorted[i].value);
		}
	free(sorted);
	file_digest_end(d, hex);
}
