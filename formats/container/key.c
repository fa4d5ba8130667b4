#include "formats/container/key.h"

#include <string.h>

enum key_fit file_key_fit(const char *have, const char *want, int any_version)
{
	size_t made_of = strcspn(want, ":");

	if (!have || !*want)
		return KEY_DIFFERS;
	if (strcmp(have, want) == 0)
		return KEY_FITS;
	return any_version && strncmp(have, want, made_of + 1) == 0 ? KEY_OTHER_VERSION
	                                                            : KEY_DIFFERS;
}
