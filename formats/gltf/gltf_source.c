/* The bytes of a glTF file: JSON, GLB chunks, buffers (gltf_doc.h). */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "formats/container/digest.h"
#include "formats/gltf/gltf_doc.h"
#include "lib/base/mem.h"

enum { GLB_HEADER = 12, CHUNK_HEADER = 8 };
enum { CHUNK_JSON = 0x4e4f534a, CHUNK_BIN = 0x004e4942 };

/* Reads a whole stream; a byte more than `known` is tried, so that a regular file
 * takes one allocation. */
static unsigned char *read_stream(FILE *f, const char *path, size_t known, size_t *bytes,
                                  struct err *e)
{
	struct array v = { 0 };
	size_t got;

	if (mem_reserve(&v, known + 1, 1, e))
		return NULL;
	while ((got = fread((char *)v.data + v.n, 1, v.capacity - v.n, f)) > 0) {
		v.n += got;
		if (v.n == v.capacity && mem_reserve(&v, 65536, 1, e))
			goto fail;
	}
	if (ferror(f)) {
		err_set(e, "%s: %s", path, strerror(errno));
		goto fail;
	}
	*bytes = v.n;
	return v.data;
fail:
	free(v.data);
	return NULL;
}

/* `name` is what messages call the file. */
static unsigned char *read_file(const char *path, const char *name, size_t *bytes,
                                struct err *e)
{
	struct stat st;
	unsigned char *data = NULL;
	FILE *f = fopen(path, "rb");

	if (!f || fstat(fileno(f), &st) != 0)
		err_set(e, "%s: %s", name, strerror(errno));
	else if (S_ISDIR(st.st_mode))
		err_set(e, "%s: is a directory; give a .gltf or .glb file", name);
	else
		data = read_stream(f, name, st.st_size > 0 ? (size_t)st.st_size : 0, bytes, e);
	if (f)
		fclose(f);
	return data;
}

static uint32_t le32(const unsigned char *p)
{
	return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 |
	       (uint32_t)p[3] << 24;
}

static int take_chunk(struct gltf_source *s, int number, size_t at, size_t length,
                      uint32_t type, struct err *e)
{
	if (number == 0) {
		if (type != CHUNK_JSON)
			return err_set(e, "%s: GLB: the first chunk is not JSON; export it again",
			               s->path);
		s->json = s->file + at;
		s->json_bytes = length;
	} else if (number == 1 && type == CHUNK_BIN) {
		s->bin = s->file + at;
		s->bin_bytes = length;
	}
	return 0;
}

/* GLB: a 12-byte header, then chunks of a length, a type and data, padded to 4. */
static int open_glb(struct gltf_source *s, struct err *e)
{
	if (s->bytes < GLB_HEADER + CHUNK_HEADER)
		return err_set(e, "%s: GLB: truncated, only %zu bytes; get it again", s->path,
		               s->bytes);
	uint32_t version = le32(s->file + 4), total = le32(s->file + 8);
	if (version != 2)
		return err_set(e, "%s: GLB: version %u is not read; convert it to glTF 2.0",
		               s->path, version);
	if (total > s->bytes)
		return err_set(e, "%s: GLB: truncated, its header says %u bytes, there are %zu; "
		               "get it again", s->path, total, s->bytes);
	if (total < s->bytes)
		return err_set(e, "%s: GLB: %zu bytes follow the %u its header says; "
		               "export it again", s->path, s->bytes - total, total);
	size_t at = GLB_HEADER;
	for (int number = 0; at < s->bytes; number++) {
		if (s->bytes - at < CHUNK_HEADER)
			return err_set(e, "%s: GLB: chunk %d: truncated header; get it again",
			               s->path, number);
		uint32_t length = le32(s->file + at), type = le32(s->file + at + 4);
		at += CHUNK_HEADER;
		if (length > s->bytes - at)
			return err_set(e, "%s: GLB: chunk %d: says %u bytes, %zu are left; "
			               "get it again", s->path, number, length, s->bytes - at);
		if (length % 4)
			return err_set(e, "%s: GLB: chunk %d: its length %u is no multiple of 4; "
			               "export it again", s->path, number, length);
		if (take_chunk(s, number, at, length, type, e))
			return -1;
		at += length;
	}
	return 0;
}

static int find_json(struct gltf_source *s, struct err *e)
{
	static const unsigned char bom[] = { 0xef, 0xbb, 0xbf };
	size_t at = 0;

	if (!s->bytes)
		return err_set(e, "%s: is empty; give a .gltf or .glb file", s->path);
	if (s->bytes >= 4 && memcmp(s->file, "glTF", 4) == 0)
		return open_glb(s, e);
	if (s->bytes >= sizeof bom && memcmp(s->file, bom, sizeof bom) == 0)
		at = sizeof bom;
	size_t start = at;
	while (at < s->bytes && s->file[at] && strchr(" \t\r\n", s->file[at]))
		at++;
	if (at == s->bytes || s->file[at] != '{')
		return err_set(e, "%s: is not glTF, neither JSON nor GLB; give a .gltf or .glb "
		               "file", s->path);
	s->json = s->file + start;
	s->json_bytes = s->bytes - start;
	return 0;
}

/* jansson refuses what tinygltf would trip over: nesting beyond 2048 levels, a
 * key given twice, numbers out of range, text that is not UTF-8. */
static int parse(struct gltf_source *s, struct err *e)
{
	json_error_t at;

	s->root = json_loadb((const char *)s->json, s->json_bytes, JSON_REJECT_DUPLICATES, &at);
	if (s->root)
		return 0;
	if (json_error_code(&at) == json_error_stack_overflow)
		return err_set(e, "%s: line %d: JSON is nested too deeply; export it again",
		               s->path, at.line);
	return err_set(e, "%s: line %d, column %d: not valid JSON: %s; export it again",
	               s->path, at.line, at.column, at.text);
}

int gltf_source_open(struct gltf_source *s, const char *path, struct err *e)
{
	*s = (struct gltf_source){ .path = path };
	if (strcmp(path, "-") == 0) {
		s->path = "standard input";
		s->file = read_stream(stdin, s->path, 0, &s->bytes, e);
	} else {
		s->file = read_file(path, path, &s->bytes, e);
	}
	if (!s->file || find_json(s, e))
		return -1;
	return parse(s, e);
}

static int hex(char c)
{
	if (c >= '0' && c <= '9')
		return c - '0';
	c |= 0x20;
	return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* Undoes %XX in place. -1 if there is a NUL among them. */
static int decode_percent(char *uri)
{
	char *to = uri;

	for (const char *from = uri; *from; from++) {
		if (*from == '%' && hex(from[1]) >= 0 && hex(from[2]) >= 0) {
			*to = (char)(hex(from[1]) * 16 + hex(from[2]));
			from += 2;
			if (!*to)
				return -1;
		} else {
			*to = *from;
		}
		to++;
	}
	*to = '\0';
	return 0;
}

static int leaves_directory(const char *path)
{
	if (path[0] == '/' || strchr(path, '\\'))
		return 1;
	for (const char *p = path; p; p = strchr(p, '/')) {
		p += *p == '/';
		if (p[0] == '.' && p[1] == '.' && (!p[2] || p[2] == '/'))
			return 1;
	}
	return 0;
}

/* A scheme is letters, digits, + - . up to a colon. */
static int has_scheme(const char *uri)
{
	return uri[strcspn(uri, ":/?#")] == ':';
}

/* The file that a buffer's URI means, beside the glTF. */
static char *resolve(const struct gltf_source *s, const char *uri, size_t number,
                     struct err *e)
{
	const char *slash = strrchr(s->path, '/');
	size_t directory = slash ? (size_t)(slash - s->path) + 1 : 0;
	char *path;

	if (has_scheme(uri)) {
		err_set(e, "%s: buffers[%zu]: '%.80s' is not a file beside it; only relative "
		        "and data: URIs are read", s->path, number, uri);
		return NULL;
	}
	path = mem_new(directory + strlen(uri) + 1, 1, "a file name", e);
	if (!path)
		return NULL;
	memcpy(path, s->path, directory);
	strcpy(path + directory, uri);
	if (!uri[0] || decode_percent(path + directory) || leaves_directory(path + directory)) {
		err_set(e, "%s: buffers[%zu]: '%.80s' leaves the directory of the file; put the "
		        "buffer beside it", s->path, number, uri);
		free(path);
		return NULL;
	}
	return path;
}

static int load_external(const struct gltf_source *s, const char *uri, size_t number,
                         struct gltf_buffer *b, struct err *e)
{
	size_t got;
	struct stat st;
	char *path = resolve(s, uri, number, e), name[600];

	if (!path)
		return -1;
	snprintf(name, sizeof name, "%.250s: buffers[%zu]: %.300s", s->path, number, uri);
	if (stat(path, &st) == 0 && !S_ISREG(st.st_mode))
		err_set(e, "%s: is not a regular file; put the buffer there", name);
	else
		b->data = read_file(path, name, &got, e);
	free(path);
	if (b->data && got < b->bytes)
		err_set(e, "%s: has %zu bytes, byteLength says %zu; get the file again", name,
		        got, b->bytes);
	return e->set ? -1 : 0;
}

static int load_buffer(struct gltf_source *s, size_t number, struct err *e)
{
	const json_t *o = json_array_get(json_object_get(s->root, "buffers"), number);
	const char *uri = gltf_string(o, "uri");
	struct gltf_buffer *b = &s->buffer[number];
	size_t got = 0;

	b->bytes = (size_t)json_integer_value(json_object_get(o, "byteLength"));
	if (!uri) {
		if (number || !s->bin)
			return err_set(e, "%s: buffers[%zu]: has no uri and the file no BIN chunk "
			               "for it; give the buffer a uri", s->path, number);
		b->data = s->bin;
		if (s->bin_bytes < b->bytes)
			return err_set(e, "%s: buffers[0]: byteLength is %zu, the BIN chunk has %zu "
			               "bytes; export it again", s->path, b->bytes, s->bin_bytes);
		return 0;
	}
	b->owned = 1;
	switch (gltf_load_data_uri(uri, b->bytes, &b->data, &got)) {
	case 0:
		return load_external(s, uri, number, b, e);
	case 1:
		return 0;
	default:
		if (!got)
			return err_set(e, "%s: buffers[%zu]: its data: URI is not base64 of "
			               "application/octet-stream; export it again", s->path, number);
		return err_set(e, "%s: buffers[%zu]: its data: URI has %zu bytes, byteLength says "
		               "%zu; export it again", s->path, number, got, b->bytes);
	}
}

int gltf_source_buffers(struct gltf_source *s, struct err *e)
{
	size_t n = json_array_size(json_object_get(s->root, "buffers"));

	s->buffer = mem_new(n, sizeof *s->buffer, "buffers", e);
	if (!s->buffer)
		return -1;
	s->buffers = n;
	for (size_t i = 0; i < n; i++)
		if (load_buffer(s, i, e))
			return -1;
	return 0;
}

int gltf_source_digest(const struct gltf_source *s, char hex_digits[33], struct err *e)
{
	struct digest *d = file_digest_new();

	if (!d)
		return err_set(e, "out of memory");
	file_digest_bytes(d, s->file, s->bytes);
	for (size_t i = 0; i < s->buffers; i++)
		if (s->buffer[i].owned)
			file_digest_bytes(d, s->buffer[i].data, s->buffer[i].bytes);
	file_digest_end(d, hex_digits);
	return 0;
}

void gltf_source_close(struct gltf_source *s)
{
	for (size_t i = 0; i < s->buffers; i++)
		if (s->buffer[i].owned)
			free(s->buffer[i].data);
	free(s->buffer);
	json_decref(s->root);
	free(s->file);
	*s = (struct gltf_source){ 0 };
}
