#include "formats/picture/npy_file.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* Magic, version and length are 10 bytes; with the text they fill whole lines of 64
 * (numpy.lib.format). */
enum { PREFIX = 10, HEADER = 256 };

int file_npy_begin(struct atomic_file *f, enum dtype t, int dims, const uint64_t *shape,
                   struct err *e)
{
	static const char *const descr[DT_COUNT] = {
		[DT_F64] = "<f8", [DT_U64] = "<u8", [DT_I64] = "<i8", [DT_F32] = "<f4",
		[DT_U32] = "<u4", [DT_I32] = "<i4", [DT_U16] = "<u2", [DT_U8] = "|u1"
	};
	char header[HEADER] = "\x93NUMPY\x01";
	size_t n = PREFIX, total;

	n += (size_t)snprintf(header + n, HEADER - n,
	                      "{'descr': '%s', 'fortran_order': False, 'shape': (", descr[t]);
	for (int d = 0; d < dims; d++)
		n += (size_t)snprintf(header + n, HEADER - n, "%" PRIu64 ",%s", shape[d],
		                      d + 1 < dims ? " " : "");
	n += (size_t)snprintf(header + n, HEADER - n, "), }");
	total = (n + 1 + 63) / 64 * 64;
	memset(header + n, ' ', total - n);
	header[total - 1] = '\n';
	header[8] = (char)((total - PREFIX) & 0xff);
	header[9] = (char)((total - PREFIX) >> 8);
	return file_atomic_write(f, header, total, e);
}

int file_npy_write(const char *path, const struct container_view *v, struct err *e)
{
	struct atomic_file *f = file_atomic_create(path, e);

	if (!f)
		return -1;
	if (file_npy_begin(f, v->type, v->dims, v->shape, e) ||
	    file_atomic_write(f, v->data, v->count * file_dtype_size(v->type), e)) {
		file_atomic_abandon(f);
		return -1;
	}
	return file_atomic_finish(f, e);
}
