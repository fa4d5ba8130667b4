#include "fields.h"

#include <string.h>

#include "../lib/mem.h"

int fields_put(struct container_writer *w, const struct field *f, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		const void *data;
		memcpy(&data, f[i].slot, sizeof data);
		if (container_put(w, f[i].name, f[i].type, f[i].dims, f[i].shape, data, e))
			return -1;
	}
	return 0;
}

int fields_map(const struct container *c, const struct field *f, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		const struct container_view *v = container_need(c, f[i].name, f[i].type,
		                                                f[i].dims, f[i].shape, e);
		if (!v)
			return -1;
		memcpy(f[i].slot, &v->data, sizeof v->data);
	}
	return 0;
}

int fields_copy(const struct container *c, const struct field *f, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		const struct container_view *v = container_need(c, f[i].name, f[i].type,
		                                                f[i].dims, f[i].shape, e);
		void *copy = v ? mem_new(v->count, dtype_size(v->type), f[i].name, e) : NULL;
		if (!copy)
			return -1;
		memcpy(copy, v->data, v->count * dtype_size(v->type));
		memcpy(f[i].slot, &copy, sizeof copy);
	}
	return 0;
}

int fields_size(const struct container *c, const char *name, enum dtype t, int dims, int dim,
                size_t *size, struct err *e)
{
	const uint64_t any[CONTAINER_DIMS] = { UINT64_MAX, UINT64_MAX, UINT64_MAX, UINT64_MAX };
	const struct container_view *v = container_need(c, name, t, dims, any, e);

	if (!v)
		return -1;
	*size = (size_t)v->shape[dim];
	return 0;
}
