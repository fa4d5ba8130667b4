/* The attributes of a picture. */
#include <stdlib.h>
#include <string.h>

#include "formats/picture/exr_file.h"
#include "lib/base/mem.h"

static char *copy_string(const char *s, struct err *e)
{
	size_t bytes = strlen(s) + 1;
	char *copy = mem_new(bytes, 1, "a picture's attribute", e);

	return copy ? memcpy(copy, s, bytes) : NULL;
}

static struct exr_file_string *find(const struct exr_file_info *i, const char *name)
{
	for (size_t k = 0; k < i->strings; k++)
		if (strcmp(i->string[k].name, name) == 0)
			return &i->string[k];
	return NULL;
}

static int append(struct exr_file_info *i, char *name, char *value, struct err *e)
{
	struct array v = { i->string, i->strings, i->strings };
	struct exr_file_string s = { name, value };
	int status = mem_append(&v, &s, 1, sizeof s, e);

	i->string = v.data;
	i->strings = v.n;
	return status;
}

int file_exr_info_set(struct exr_file_info *i, const char *name, const char *value,
                      struct err *e)
{
	struct exr_file_string *old = find(i, name);
	char *v = copy_string(value, e), *n;

	if (!v)
		return -1;
	if (old) {
		free(old->value);
		old->value = v;
		return 0;
	}
	n = copy_string(name, e);
	if (n && append(i, n, v, e) == 0)
		return 0;
	free(n);
	free(v);
	return -1;
}

const char *file_exr_info_get(const struct exr_file_info *i, const char *name)
{
	const struct exr_file_string *s = find(i, name);

	return s ? s->value : NULL;
}

void file_exr_info_free(struct exr_file_info *i)
{
	for (size_t k = 0; k < i->strings; k++) {
		free(i->string[k].name);
		free(i->string[k].value);
	}
	free(i->string);
	*i = (struct exr_file_info){ 0 };
}
