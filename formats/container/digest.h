/* XXH3-128 digests as 32 hex digits. A NULL digest takes bytes in silence and ends
 * as "", which no reader accepts, so callers may check once, at the end. */
#ifndef TWOPASS_DIGEST_H
#define TWOPASS_DIGEST_H

#include <stddef.h>

struct digest;

struct digest *file_digest_new(void); /* NULL when out of memory */
void file_digest_bytes(struct digest *d, const void *data, size_t bytes);
void file_digest_string(struct digest *d, const char *s); /* with its length */
/* Writes the digest and frees d. */
void file_digest_end(struct digest *d, char hex[33]);

#endif
