/* Small glTF files for tests: JSON with ' for ", one external buffer, in a scratch
 * directory. */
#ifndef TESTS_GLTF_FILES_H
#define TESTS_GLTF_FILES_H

#include <assert.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "../../formats/gltf_file.h"

enum { BUFFER = 176, TEXT = 16384 };

static char scratch[64];

/* Accessors: 0 four positions (unit square), 1 six uint16 indices, 2 four normals
 * +Z, 3 four UVs in uint16, 4 the positions with corner 2 replaced by (2,2,0) by a
 * sparse value, 5 four positions as int8. */
static const char base[] =
"{'asset':{'version':'2.0'},'scene':0,'scenes':[{'nodes':[0,1]}],"
"'nodes':[{'name':'floor','mesh':0},{'name':'eye','camera':0}],"
"'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1,'material':0}]}],"
"'materials':[{'name':'paint','pbrMetallicRoughness':{'metallicFactor':0}}],"
"'cameras':[{'type':'perspective','perspective':{'yfov':1,'znear':0.1}}],"
"'accessors':["
"{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'},"
"{'bufferView':1,'componentType':5123,'count':6,'type':'SCALAR'},"
"{'bufferView':2,'componentType':5126,'count':4,'type':'VEC3'},"
"{'bufferView':3,'componentType':5123,'normalized':true,'count':4,'type':'VEC2'},"
"{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3','sparse':{'count':1,"
"'indices':{'bufferView':4,'componentType':5123},'values':{'bufferView':5}}},"
"{'bufferView':6,'componentType':5120,'count':4,'type':'VEC3'}],"
"'bufferViews':["
"{'buffer':0,'byteOffset':0,'byteLength':48},"
"{'buffer':0,'byteOffset':48,'byteLength':12},"
"{'buffer':0,'byteOffset':60,'byteLength':48},"
"{'buffer':0,'byteOffset':108,'byteLength':16},"
"{'buffer':0,'byteOffset':124,'byteLength':2},"
"{'buffer':0,'byteOffset':128,'byteLength':12},"
"{'buffer':0,'byteOffset':140,'byteLength':16,'byteStride':4}],"
"'buffers':[{'byteLength':176,'uri':'b.bin'}]}";

static inline void fill_buffer(unsigned char b[BUFFER])
{
	static const float corner[4][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 1, 1, 0 }, { 0, 1, 0 } };
	static const float up[4][3] = { { 0, 0, 1 }, { 0, 0, 2 }, { 0, 0, 1 }, { 0, 0, 1 } };
	static const uint16_t index[6] = { 0, 1, 2, 0, 2, 3 }, two = 2;
	static const uint16_t uv[4][2] = { { 0, 0 }, { 65535, 0 }, { 65535, 65535 }, { 0, 65535 } };
	static const float replaced[3] = { 2, 2, 0 };
	static const int8_t small[4][4] = { { 0 }, { 127 }, { 127, 127 }, { -128, 127 } };

	memset(b, 0, BUFFER);
	memcpy(b, corner, 48);
	memcpy(b + 48, index, 12);
	memcpy(b + 60, up, 48);
	memcpy(b + 108, uv, 16);
	memcpy(b + 124, &two, 2);
	memcpy(b + 128, replaced, 12);
	memcpy(b + 140, small, 16);
}

static inline const char *in_scratch(const char *name)
{
	static char path[256];

	snprintf(path, sizeof path, "%s/%s", scratch, name);
	return path;
}

static inline void put(const char *name, const void *data, size_t bytes)
{
	FILE *f;

	remove(in_scratch(name)); /* some file systems flush a file that is truncated */
	f = fopen(in_scratch(name), "wb");
	assert_non_null(f);
	assert_int_equal(fwrite(data, 1, bytes, f), bytes);
	assert_int_equal(fclose(f), 0);
}

/* base with edits: pairs of a text and what replaces its first occurrence, up to
 * NULL; then ' becomes ". */
static inline void edit_base(char out[TEXT], va_list edits)
{
	static char before[TEXT];
	const char *from;

	strcpy(out, base);
	while ((from = va_arg(edits, const char *))) {
		strcpy(before, out);
		const char *to = va_arg(edits, const char *), *at = strstr(before, from);
		if (!at)
			fail_msg("no %s to replace", from);
		snprintf(out, TEXT, "%.*s%s%s", (int)(at - before), before, to,
		         at + strlen(from));
	}
	for (char *p = out; *p; p++)
		if (*p == '\'')
			*p = '"';
}

static inline void base_with(char out[TEXT], ...)
{
	va_list edits;

	va_start(edits, out);
	edit_base(out, edits);
	va_end(edits);
}

/* A GLB of JSON text (its buffer must have no uri) and the test buffer. */
static inline size_t make_glb(const char *json, unsigned char *out)
{
	size_t n = strlen(json), padded = (n + 3) / 4 * 4;
	uint32_t header[5] = { 0x46546c67, 2, (uint32_t)(28 + padded + BUFFER),
		(uint32_t)padded, 0x4e4f534a }, chunk[2] = { BUFFER, 0x004e4942 };

	memcpy(out, header, 20);
	memset(out + 20, ' ', padded);
	memcpy(out + 20, json, n);
	memcpy(out + 20 + padded, chunk, 8);
	fill_buffer(out + 28 + padded);
	return 28 + padded + BUFFER;
}

static inline int make_scratch(void **state)
{
	unsigned char b[BUFFER];

	(void)state;
	strcpy(scratch, "/tmp/twopass-gltf.XXXXXX");
	assert_non_null(mkdtemp(scratch));
	fill_buffer(b);
	put("b.bin", b, sizeof b);
	return 0;
}

static inline int remove_scratch(void **state)
{
	(void)state;
	remove(in_scratch("b.bin"));
	remove(in_scratch("s.gltf"));
	remove(in_scratch("s.glb"));
	return rmdir(scratch);
}

#endif
