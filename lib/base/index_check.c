#include "lib/base/index_check.h"

#include <inttypes.h>

int err_check_below(const char *name, const uint32_t *index, size_t n, size_t limit,
                    struct err *e)
{
	for (size_t i = 0; i < n; i++)
		if (index[i] >= limit)
			return err_set(e, "array %s: value %zu is %" PRIu32 ", which must be below "
			               "%zu", name, i, index[i], limit);
	return 0;
}

int err_check_starts(const char *name, const uint64_t *start, size_t n, uint64_t end,
                     uint64_t least, struct err *e)
{
	if (start[0] != 0 || start[n] != end)
		return err_set(e, "array %s: it runs from %" PRIu64 " to %" PRIu64
		               " and should from 0 to %" PRIu64, name, start[0], start[n], end);
	for (size_t i = 0; i < n; i++)
		if (start[i + 1] < start[i] || start[i + 1] - start[i] < least)
			return err_set(e, "array %s: values %zu and %zu do not ascend as they "
			               "should", name, i, i + 1);
	return 0;
}
