#include "formats/container/digest.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <xxhash.h>

/* struct digest is never defined: it is xxHash's own state under our name. */

struct digest *file_digest_new(void)
{
	XXH3_state_t *s = XXH3_createState();

	if (s)
		XXH3_128bits_reset(s);
	return (struct digest *)s;
}

void file_digest_bytes(struct digest *d, const void *data, size_t bytes)
{
	if (d && bytes)
		XXH3_128bits_update((XXH3_state_t *)d, data, bytes);
}

void file_digest_string(struct digest *d, const char *s)
{
	uint64_t n = strlen(s);

	file_digest_bytes(d, &n, sizeof n);
	file_digest_bytes(d, s, n);
}

void file_digest_end(struct digest *d, char hex[33])
{
	hex[0] = '\0';
	if (!d)
		return;
	XXH128_hash_t h = XXH3_128bits_digest((XXH3_state_t *)d);
	snprintf(hex, 33, "%016llx%016llx", (unsigned long long)h.high64,
	         (unsigned long long)h.low64);
	XXH3_freeState((XXH3_state_t *)d);
}
