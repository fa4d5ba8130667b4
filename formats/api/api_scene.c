#include "formats/api/api_scene.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/cache/mesh_file.h"
#include "formats/cache/rad_file.h"
#include "formats/container/history.h"
#include "formats/gltf/gltf_file.h"
#include "lib/base/parallel.h"
#include "lib/mesh/mesher.h"

const char *twopass_version(void)
{
	return TWOPASS_VERSION;
}

/* ---- making and freeing ---- */

/* Lists the sides of n things that are modelled. */
static uint32_t *list_sides(const struct model *m, size_t n, const uint32_t *patch_of,
                            size_t *count, struct err *e)
{
	uint32_t *list = mem_new(2 * n, sizeof *list, "sides", e);

	for (uint32_t i = 0; list && i < 2 * n; i++) {
		uint32_t patch = patch_of ? patch_of[i >> 1] : i >> 1;
		if (model_side_modelled(m, 2 * patch + (i & 1)))
			list[(*count)++] = i;
	}
	return list;
}

/* What handles have beside the model. */
static int prepare(struct twopass_scene *s, struct err *e)
{
	const struct model *m = &s->m;
	struct ff_file named = { .scene.patches = m->patch.n, .surfaces = m->surface.n,
	                         .surface_name = m->surface.name,
	                         .patch_surface = m->patch.surface };

	file_cache_ids(m, &s->info);
	s->patch = list_sides(m, m->patch.n, NULL, &s->patches, e);
	s->element = list_sides(m, m->element.n, m->element.patch, &s->elements, e);
	s->place = mem_new(2 * m->patch.n, sizeof *s->place, "sides", e);
	s->name = file_ff_side_names(&named, e);
	if (!s->patch || !s->element || !s->place || !s->name)
		return -1;
	for (size_t i = 0; i < s->patches; i++)
		s->place[s->patch[i]] = (uint32_t)i;
	return 0;
}

void twopass_free(struct twopass_scene *s)
{
	if (!s)
		return;
	ff_patch_matrix_free(&s->matrix);
	file_ff_close(&s->ff);
	solution_free(&s->s);
	file_cache_names_free(s->name, 2 * s->m.patch.n);
	free(s->patch);
	free(s->element);
	free(s->place);
	model_free(&s->m);
	file_cache_info_free(&s->info);
	free(s);
}

/* s, or NULL and error, with s freed, if something went wrong. */
static struct twopass_scene *finished(struct twopass_scene *s, const struct err *e,
                                      struct twopass_error *error)
{
	if (api_status(e, error) == 0)
		return s;
	twopass_free(s);
	return NULL;
}

/* ---- meshes ---- */

static struct twopass_length length(struct mesh_size s)
{
	return (struct twopass_length){ s.value, s.relative };
}

struct twopass_mesh_options twopass_mesh_defaults(void)
{
	const struct mesh_options m = MESH_OPTIONS_DEFAULT;
	const struct gltf_options g = GLTF_OPTIONS_DEFAULT;

	return (struct twopass_mesh_options){
		.patch = length(m.patch), .element = length(m.element),
		.element_within_patch = m.element_within_patch, .normal_cone = m.normal_cone,
		.no_imprint = m.no_imprint, .bands = g.bands, .clamp = g.clamp };
}

static int size(const char *what, struct twopass_length l, struct mesh_size *s, struct err *e)
{
	*s = (struct mesh_size){ l.value, l.relative != 0 };
	return l.value > 0 ? 0 : err_set(e, "%s is %g; it must be greater than 0", what, l.value);
}

static int mesh_options(const struct twopass_mesh_options *from, struct mesh_options *m,
                        struct gltf_options *g, struct err *e)
{
	*m = MESH_OPTIONS_DEFAULT;
	*g = GLTF_OPTIONS_DEFAULT;
	m->element_within_patch = from->element_within_patch;
	m->normal_cone = from->normal_cone;
	m->no_imprint = from->no_imprint;
	g->bands = from->bands;
	g->clamp = from->clamp;
	return size("patch", from->patch, &m->patch, e) ||
	       size("element", from->element, &m->element, e) ||
	       api_within("normal_cone", m->normal_cone, 0, 80, e) ||
	       api_within("bands", g->bands, 0, BANDS_MAX, e) ? -1 : 0;
}

static int make_mesh(struct twopass_scene *s, const char *path,
                     const struct twopass_mesh_options *options, struct err *e)
{
	struct mesh_options mesher;
	struct gltf_options gltf;
	struct mesh_report meshed = { 0 };
	struct gltf_report read = { 0 };
	struct err why = { 0 };

	int bad = mesh_options(options, &mesher, &gltf, e) ||
	          gltf_file_read(path, &gltf, &s->m, &read, e);
	if (!bad && mesh_run(&s->m, &mesher, &meshed, &why))
		bad = err_set(e, "%s: %s", path, why.text);
	mesh_report_free(&meshed);
	gltf_report_free(&read);
	return bad || api_history(&s->info, NULL, "twopass_mesh", path, e) || prepare(s, e)
	     ? -1 : 0;
}

struct twopass_scene *twopass_mesh(const char *gltf, const struct twopass_mesh_options *options,
                                   struct twopass_error *error)
{
	const struct twopass_mesh_options usual = twopass_mesh_defaults();
	struct err e = { 0 };
	struct twopass_scene *s = mem_new(1, sizeof *s, gltf, &e);

	if (s)
		(void)make_mesh(s, gltf, options ? options : &usual, &e);
	return finished(s, &e, error);
}

/* ---- files ---- */

static int read_scene(struct twopass_scene *s, const char *path, struct err *e)
{
	struct container *c = file_container_open(path, NULL, e);

	if (!c)
		return -1;
	int solved = strcmp(file_container_get_meta(c, "format"), "twopass.rad") == 0;
	file_container_close(c);
	return (solved ? file_rad_read(path, &s->m, &s->s, &s->info, e)
	               : file_mesh_read(path, &s->m, &s->info, e)) ||
	       prepare(s, e) ? -1 : 0;
}

struct twopass_scene *twopass_read(const char *path, struct twopass_error *error)
{
	struct err e = { 0 };
	struct twopass_scene *s = mem_new(1, sizeof *s, path, &e);

	if (s)
		(void)read_scene(s, path, &e);
	return finished(s, &e, error);
}

int twopass_write(const struct twopass_scene *s, const char *path, struct twopass_error *error)
{
	struct err e = { 0 };

	if (s->s.irradiance.direct)
		(void)file_rad_write(path, &s->m, &s->s, &s->info, &e);
	else
		(void)file_mesh_write(path, &s->m, &s->info, &e);
	return api_status(&e, error);
}
