/* What the container's writer and reader share. */
#ifndef TWOPASS_CONTAINER_INTERNAL_H
#define TWOPASS_CONTAINER_INTERNAL_H

#include <stddef.h>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "cache files are mapped as they are: only little-endian machines are supported"
#endif

enum {
	CONTAINER_PREFIX = 8,             /* bytes of the header's length */
	CONTAINER_HEADER_MAX = 100000000, /* as safetensors has it */
	CONTAINER_HEX = 32                /* digits of a digest */
};

#define CONTAINER_METADATA "__metadata__"
#define CONTAINER_DIGEST "digest."
#define CONTAINER_HEADER_DIGEST "digest.header"
#define CONTAINER_BLANK_DIGEST "00000000000000000000000000000000"

/* Where the 32 digits of the header's own digest stand in its JSON text (written
 * without spaces), or NULL. A quotation mark inside a JSON string is escaped, so
 * the text looked for cannot stand inside another value. */
char *file_container_header_slot(const char *json, size_t bytes);

/* Digest of the length prefix and the header with that slot taken as blank. */
void file_container_header_digest(const char *json, size_t bytes, const char *slot,
                                  char hex[CONTAINER_HEX + 1]);

#endif
