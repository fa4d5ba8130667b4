/* Gives a .ff file the names of a scene whose surfaces, lights or materials were renamed. */
#include "formats/cache/ff_file.h"

#include <stdlib.h>
#include <string.h>

/* 1 if the list of names under `key` is this one. */
static int same_names(const struct container *c, const char *key, char *const *name, size_t n)
{
	struct err ignored = { 0 };
	char **have = NULL;
	int same = file_cache_read_names(c, key, &have, n, &ignored) == 0;

	for (size_t i = 0; same && i < n; i++)
		same = strcmp(have[i], name[i]) == 0;
	file_cache_names_free(have, n);
	return same;
}

/* All but the names and what file_container_finish writes itself. */
static int copy(struct container_writer *w, const struct container *c, struct err *e)
{
	for (size_t i = 0; i < file_container_arrays(c); i++) {
		const struct container_view *v = file_container_at(c, i);
		if (file_container_put(w, v->name, v->type, v->dims, v->shape, v->data, e))
			return -1;
	}
	for (size_t i = 0; i < file_container_metas(c); i++) {
		const char *value, *key = file_container_meta_at(c, i, &value);
		if (strncmp(key, "digest.", 7) && file_container_meta(w, key, value, e))
			return -1;
	}
	return 0;
}

int file_ff_rename(const char *path, const struct model *m, struct err *e)
{
	const struct materials *mt = &m->material;
	struct container *c = file_container_open(path, "twopass.ff", e);
	int status = -1;

	if (!c)
		return -1;
	if (same_names(c, "surfaces", m->surface.name, m->surface.n) &&
	    same_names(c, "lights", m->light.name, m->light.n) &&
	    same_names(c, "materials", mt->name, mt->n)) {
		file_container_close(c);
		return 0;
	}
	struct container_writer *w = file_container_verify_all(c, e)
	                           ? NULL : file_container_create(path, e);
	if (w && !copy(w, c, e) && !file_cache_write_names(w, "materials", mt->name, mt->n, e) &&
	    !file_cache_write_names(w, "surfaces", m->surface.name, m->surface.n, e) &&
	    !file_cache_write_names(w, "lights", m->light.name, m->light.n, e))
		status = file_container_finish(w, e) ? -1 : 1;
	else
		file_container_abandon(w);
	file_container_close(c);
	return status;
}
