#include "tools/common/pattern.h"

#include <string.h>

#include "lib/base/mem.h"

char *pattern_fill(const char *pattern, const char *name, struct err *e)
{
	size_t uses = 0, n = strlen(name);

	for (const char *p = pattern; (p = strstr(p, "%s")); p += 2)
		uses++;
	char *path = mem_new(strlen(pattern) + uses * n + 1, 1, "path", e), *out = path;
	while (path && *pattern) {
		if (strncmp(pattern, "%s", 2) != 0) {
			*out++ = *pattern++;
			continue;
		}
		for (size_t i = 0; i < n; i++)
			*out++ = name[i] == '/' ? '_' : name[i];
		pattern += 2;
	}
	return path;
}
