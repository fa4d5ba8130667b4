#include "formats/cache/cache.h"

#include <fcntl.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "formats/container/digest.h"
#include "lib/base/mem.h"

enum { ID_DIGITS = 32 }; /* hexadecimal, of XXH3-128 */

void file_cache_info_free(struct cache_info *i)
{
	free(i->history);
	free(i->options);
	free(i->report);
	free(i->key);
	*i = (struct cache_info){ 0 };
}

/* ---- ids ---- */

static void number(struct digest *d, uint64_t n)
{
	file_digest_bytes(d, &n, sizeof n);
}

/* 1 if a coefficient of a side is non-zero in some band. */
static int present(const struct materials *mt, const double *coefficient, size_t m, int side)
{
	const double *c = &coefficient[model_material_at(mt, m, side)];

	for (int b = 0; b < mt->bands; b++)
		if (c[b] != 0)
			return 1;
	return 0;
}

/* 1 if a coefficient is exactly 1 in all bands: chains of mirrors leave out such
 * events (lib/chain.h). */
static int perfect(const struct materials *mt, const double *coefficient, size_t m, int side)
{
	const double *c = &coefficient[model_material_at(mt, m, side)];

	for (int b = 0; b < mt->bands; b++)
		if (c[b] != 1)
			return 0;
	return 1;
}

/* An exponent counts only where its coefficient is there. */
static void exponent(struct digest *d, int here, double k)
{
	uint8_t flag = (uint8_t)here;

	file_digest_bytes(d, &flag, 1);
	if (here)
		file_digest_bytes(d, &k, sizeof k);
}

/* What of the materials steers light, colours aside. */
static void digest_materials(struct digest *d, const struct materials *mt)
{
	number(d, mt->n);
	file_digest_bytes(d, mt->one_sided, mt->n);
	for (size_t m = 0; m < mt->n; m++)
		for (int side = FRONT; side <= BACK; side++) {
			size_t at = 2 * m + (size_t)side;
			uint8_t diffuse[2] = { (uint8_t)present(mt, mt->rho_d, m, side),
			                       (uint8_t)present(mt, mt->tau_d, m, side) };
			uint8_t colourless[2] = { (uint8_t)perfect(mt, mt->rho_s, m, side),
			                          (uint8_t)perfect(mt, mt->tau_s, m, side) };
			file_digest_bytes(d, diffuse, sizeof diffuse);
			file_digest_bytes(d, colourless, sizeof colourless);
			exponent(d, present(mt, mt->rho_s, m, side), mt->alpha[at]);
			exponent(d, present(mt, mt->tau_s, m, side), mt->beta[at]);
			exponent(d, present(mt, mt->emission, m, side),
			         mt->emission_exponent[at]);
		}
}

static void digest_lights(struct digest *d, const struct lights *l)
{
	number(d, l->n);
	file_digest_bytes(d, l->kind, l->n);
	file_digest_bytes(d, l->position, l->n * 3 * sizeof *l->position);
	file_digest_bytes(d, l->direction, l->n * 3 * sizeof *l->direction);
	file_digest_bytes(d, l->cone, l->n * 2 * sizeof *l->cone);
}

static void geometry_id(const struct model *m, char hex[33])
{
	struct digest *d = file_digest_new();

	number(d, (uint64_t)m->lobe);
	digest_materials(d, &m->material);
	digest_lights(d, &m->light);
	const size_t counts[] = { m->surface.n, m->vertices, m->triangle.n, m->splits,
	                          m->element.n, m->patch.n, m->patch.loops, m->patch.loop_indices };
	file_digest_bytes(d, counts, sizeof counts);
	file_digest_bytes(d, m->surface.material, m->surface.n * sizeof *m->surface.material);
	file_digest_bytes(d, m->vertex, m->vertices * 3 * sizeof *m->vertex);
	file_digest_bytes(d, m->triangle.corner, m->triangle.n * 3 * sizeof *m->triangle.corner);
	file_digest_bytes(d, m->triangle.surface, m->triangle.n * sizeof *m->triangle.surface);
	file_digest_bytes(d, m->triangle.split, m->triangle.n * sizeof *m->triangle.split);
	file_digest_bytes(d, m->split, m->splits * sizeof *m->split);
	file_digest_bytes(d, m->element.corner, m->element.n * 3 * sizeof *m->element.corner);
	file_digest_bytes(d, m->element.triangle, m->element.n * sizeof *m->element.triangle);
	file_digest_bytes(d, m->patch.start, (m->patch.n + 1) * sizeof *m->patch.start);
	file_digest_bytes(d, m->patch.surface, m->patch.n * sizeof *m->patch.surface);
	file_digest_bytes(d, m->patch.loop, (m->patch.n + 1) * sizeof *m->patch.loop);
	file_digest_bytes(d, m->patch.loop_start,
	                  (m->patch.loops + 1) * sizeof *m->patch.loop_start);
	file_digest_bytes(d, m->patch.loop_index,
	                  m->patch.loop_indices * sizeof *m->patch.loop_index);
	file_digest_end(d, hex);
}

static void material_id(const struct model *m, char hex[33])
{
	const struct materials *mt = &m->material;
	struct digest *d = file_digest_new();
	const double *banded[] = { mt->rho_d, mt->tau_d, mt->rho_s, mt->tau_s, mt->emission };

	number(d, mt->n);
	number(d, (uint64_t)mt->bands);
	for (size_t i = 0; i < sizeof banded / sizeof *banded; i++)
		file_digest_bytes(d, banded[i], 2 * mt->n * (size_t)mt->bands * sizeof *banded[i]);
	file_digest_bytes(d, m->light.intensity,
	                  m->light.n * (size_t)m->bands * sizeof *m->light.intensity);
	file_digest_end(d, hex);
}

void file_cache_camera_id(const struct camera *c, char hex[33])
{
	struct digest *d = file_digest_new();
	const double lens[] = { c->yfov, c->aspect, c->xmag, c->ymag };

	file_digest_string(d, c->name);
	number(d, (uint64_t)c->orthographic);
	file_digest_bytes(d, c->to_world, sizeof c->to_world);
	file_digest_bytes(d, lens, sizeof lens);
	file_digest_end(d, hex);
}

void file_cache_ids(const struct model *m, struct cache_info *i)
{
	struct digest *d = file_digest_new();

	geometry_id(m, i->geometry_id);
	material_id(m, i->material_id);
	for (size_t c = 0; c < m->cameras; c++) {
		char hex[33];
		file_cache_camera_id(&m->camera[c], hex);
		file_digest_string(d, hex);
	}
	file_digest_end(d, i->camera_id);
}

/* ---- metadata ---- */

/* What this program writes and reads of a format. */
static const char *version_of(const char *format)
{
	return strcmp(format, "twopass.ff") == 0 ? CACHE_FF_VERSION : CACHE_VERSION;
}

int file_cache_write_info(struct container_writer *w, const char *format,
                          const struct cache_info *i, struct err *e)
{
	const struct {
		const char *key, *value;
	} meta[] = {
		{ "format", format }, { "version", version_of(format) }, { "history", i->history },
		{ "options", i->options }, { "report", i->report }, { "key", i->key },
		{ "geometry_id", i->geometry_id }, { "material_id", i->material_id },
		{ "camera_id", i->camera_id }
	};

	for (size_t k = 0; k < sizeof meta / sizeof *meta; k++)
		if (meta[k].value && *meta[k].value &&
		    file_container_meta(w, meta[k].key, meta[k].value, e))
			return -1;
	return 0;
}

static int read_text(const struct container *c, const char *key, char **out, struct err *e)
{
	const char *text = file_container_get_meta(c, key);

	if (text && !(*out = strdup(text)))
		return err_set(e, "%s: out of memory", file_container_path(c));
	return 0;
}

/* Which ids a file has depends on its kind; readers compare those they need. */
static int read_id(const struct container *c, const char *key, char hex[33], struct err *e)
{
	const char *text = file_container_get_meta(c, key);

	if (!text)
		return 0;
	if (strlen(text) != ID_DIGITS)
		return file_container_refuse(c, e, "metadata %s: not %d hexadecimal digits", key,
		                             ID_DIGITS);
	memcpy(hex, text, ID_DIGITS + 1);
	return 0;
}

int file_cache_read_info(const struct container *c, struct cache_info *i, struct err *e)
{
	const char *version = file_container_get_meta(c, "version");
	const char *known = version_of(file_container_get_meta(c, "format"));

	*i = (struct cache_info){ 0 };
	if (!version || strcmp(version, known) != 0)
		return file_container_refuse(c, e, "version %.20s, this program knows version %s",
		                             version ? version : "missing", known);
	if (read_text(c, "history", &i->history, e) || read_text(c, "options", &i->options, e) ||
	    read_text(c, "report", &i->report, e) || read_text(c, "key", &i->key, e) ||
	    read_id(c, "geometry_id", i->geometry_id, e) ||
	    read_id(c, "material_id", i->material_id, e) ||
	    read_id(c, "camera_id", i->camera_id, e)) {
		file_cache_info_free(i);
		return -1;
	}
	return 0;
}

/* ---- names ---- */

int file_cache_write_names(struct container_writer *w, const char *key, char *const *name,
                           size_t n, struct err *e)
{
	json_t *list = json_array();
	int failed = 0;

	for (size_t i = 0; i < n && !failed; i++)
		if (json_array_append_new(list, json_string(name[i])))
			failed = err_set(e, "%s: cannot write: name %zu of %s is not UTF-8 text",
			                 file_container_writer_path(w), i, key);
	char *text = failed ? NULL : json_dumps(list, JSON_COMPACT);
	json_decref(list);
	if (!failed && !text)
		failed = err_set(e, "%s: out of memory", file_container_writer_path(w));
	failed = failed || file_container_meta(w, key, text, e);
	free(text);
	return failed ? -1 : 0;
}

void file_cache_names_free(char **name, size_t n)
{
	for (size_t i = 0; name && i < n; i++)
		free(name[i]);
	free(name);
}

static int copy_names(const struct container *c, const char *key, const json_t *list,
                      char **name, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		const char *text = json_string_value(json_array_get(list, i));
		if (!text)
			return file_container_refuse(c, e, "metadata %s: name %zu is not a string", key,
			                             i);
		if (!(name[i] = strdup(text)))
			return err_set(e, "%s: out of memory", file_container_path(c));
	}
	return 0;
}

int file_cache_read_names(const struct container *c, const char *key, char ***name, size_t n,
                          struct err *e)
{
	const char *text = file_container_get_meta(c, key);
	json_error_t je;
	json_t *list = text ? json_loads(text, 0, &je) : NULL;

	*name = NULL;
	/* Before there is room for them: n comes from the file, too. */
	int failed = !json_is_array(list) || json_array_size(list) != n;
	if (failed)
		file_container_refuse(c, e, "metadata %s: not a list of %zu names", key, n);
	else
		failed = !(*name = mem_new(n, sizeof **name, key, e)) ||
		         copy_names(c, key, list, *name, n, e);
	json_decref(list);
	if (!failed)
		return 0;
	file_cache_names_free(*name, n);
	*name = NULL;
	return -1;
}

enum key_fit file_cache_up_to_date(const char *path, const char *format, const char *key,
                                   int any_version)
{
	struct err ignored = { 0 };
	struct container *c = file_container_open(path, format, &ignored);
	enum key_fit fit = KEY_DIFFERS;

	if (!c)
		return KEY_DIFFERS;
	const char *version = file_container_get_meta(c, "version");
	if (version && strcmp(version, version_of(format)) == 0)
		fit = file_key_fit(file_container_get_meta(c, "key"), key, any_version);
	file_container_close(c);
	/* make(1) must see it newer than what it was made from. */
	return fit && utimensat(AT_FDCWD, path, NULL, 0) ? KEY_DIFFERS : fit;
}
