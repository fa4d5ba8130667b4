#include "formats/container/fields.h"

#include <stdlib.h>
#include <string.h>

int file_fields_put(struct container_writer *w, const struct field *f, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		const void *data;
		memcpy(&data, f[i].slot, sizeof data);
		if (file_container_put(w, f[i].name, f[i].type, f[i].dims, f[i].shape, data, e))
			return -1;
	}
	return 0;
}

int file_fields_map(const struct container *c, const struct field *f, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		const struct container_view *v = file_container_need(c, f[i].name, f[i].type,
		                                                     f[i].dims, f[i].shape, e);
		if (!v)
			return -1;
		memcpy(f[i].slot, &v->data, sizeof v->data);
	}
	return 0;
}

static void *make(const struct field *f, enum field_absent absent, struct err *e)
{
	const size_t step = absent == FIELD_EVEN ? 2 : absent == FIELD_ORDER ? 1 : 0;
	size_t n = 1;

	for (int d = 0; d < f->dims; d++)
		if (__builtin_mul_overflow(n, f->shape[d], &n)) {
			err_set(e, "array %s: too large", f->name);
			return NULL;
		}
	void *made = mem_new(n, file_dtype_size(f->type), f->name, e);
	for (size_t i = 0; made && step && i < n; i++)
		if (f->type == DT_U64)
			((uint64_t *)made)[i] = step * i;
		else
			((uint32_t *)made)[i] = (uint32_t)(step * i);
	return made;
}

int file_fields_map_or_make(const struct container *c, const struct field_or_not *f, size_t n,
                            struct array *made, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		const struct field *field = &f[i].field;
		enum field_absent absent = f[i].absent;
		int may = absent > FIELD_EMPTY || (absent == FIELD_EMPTY && !field->shape[0]);
		if (!may || file_container_find(c, field->name)) {
			if (file_fields_map(c, field, 1, e))
				return -1;
			continue;
		}
		void *array = make(field, absent, e);
		if (!array)
			return -1;
		memcpy(field->slot, &array, sizeof array);
		if (mem_append(made, &array, 1, sizeof array, e)) {
			free(array);
			return -1;
		}
	}
	return 0;
}

int file_fields_copy(const struct container *c, const struct field *f, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		const struct container_view *v = file_container_need(c, f[i].name, f[i].type,
		                                                     f[i].dims, f[i].shape, e);
		void *copy = v ? mem_new(v->count, file_dtype_size(v->type), f[i].name, e) : NULL;
		if (!copy)
			return -1;
		memcpy(copy, v->data, v->count * file_dtype_size(v->type));
		memcpy(f[i].slot, &copy, sizeof copy);
	}
	return 0;
}

int file_fields_size(const struct container *c, const char *name, enum dtype t, int dims, int dim,
                     size_t *size, struct err *e)
{
	const uint64_t any[CONTAINER_DIMS] = { UINT64_MAX, UINT64_MAX, UINT64_MAX, UINT64_MAX };
	const struct container_view *v = file_container_need(c, name, t, dims, any, e);

	if (!v)
		return -1;
	*size = (size_t)v->shape[dim];
	return 0;
}
