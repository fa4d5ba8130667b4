#include "formats/container/container.h"

#include <string.h>

#include "formats/container/container_internal.h"
#include "formats/container/digest.h"

static const struct {
	const char *name;
	size_t size;
} dtypes[DT_COUNT] = {
	[DT_F64] = { "F64", 8 }, [DT_U64] = { "U64", 8 }, [DT_I64] = { "I64", 8 },
	[DT_F32] = { "F32", 4 }, [DT_U32] = { "U32", 4 }, [DT_I32] = { "I32", 4 },
	[DT_U16] = { "U16", 2 }, [DT_U8] = { "U8", 1 },
};

size_t file_dtype_size(enum dtype t)
{
	return dtypes[t].size;
}

const char *file_dtype_name(enum dtype t)
{
	return dtypes[t].name;
}

char *file_container_header_slot(const char *json, size_t bytes)
{
	static const char key[] = "\"" CONTAINER_HEADER_DIGEST "\":\"";
	const size_t length = sizeof key - 1;

	for (const char *p = json; bytes - (size_t)(p - json) > length + CONTAINER_HEX; p++) {
		p = memchr(p, '"', bytes - (size_t)(p - json));
		if (!p || bytes - (size_t)(p - json) <= length + CONTAINER_HEX)
			return NULL;
		if (memcmp(p, key, length) == 0 && p[length + CONTAINER_HEX] == '"')
			return (char *)p + length;
	}
	return NULL;
}

void file_container_header_digest(const char *json, size_t bytes, const char *slot,
                                  char hex[CONTAINER_HEX + 1])
{
	struct digest *d = file_digest_new();
	size_t before = (size_t)(slot - json);
	uint64_t prefix = bytes;

	file_digest_bytes(d, &prefix, sizeof prefix);
	file_digest_bytes(d, json, before);
	file_digest_bytes(d, CONTAINER_BLANK_DIGEST, CONTAINER_HEX);
	file_digest_bytes(d, slot + CONTAINER_HEX, bytes - before - CONTAINER_HEX);
	file_digest_end(d, hex);
}
