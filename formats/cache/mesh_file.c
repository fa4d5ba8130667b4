#include "formats/cache/mesh_file.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "formats/container/fields.h"
#include "lib/base/mem.h"
#include "lib/data/model_check.h"

#define FORMAT "twopass.mesh"

enum { FIELDS_MAX = 40 }; /* room for the lists of fields below, in one file */

static_assert(sizeof(struct split) == 3 * sizeof(int32_t), "splits are stored as they are");

/* Cameras are few: in memory structs, in the file an array for each member. */
struct camera_arrays {
	double *to_world, *yfov, *aspect, *xmag, *ymag;
	uint8_t *orthographic;
};

/* ---- one list of arrays for writing and reading ---- */

/* The model's arrays with shapes from its counts (the derived ones are not stored). */
static size_t model_fields(struct model *m, struct field out[FIELDS_MAX])
{
	struct materials *mt = &m->material;
	struct surfaces *s = &m->surface;
	struct lights *l = &m->light;
	const uint64_t mats = mt->n, b = (uint64_t)m->bands, t = m->triangle.n;
	const struct field f[] = {
		{ &mt->rho_d, "material_rho_d", DT_F64, 3, { mats, 2, b } },
		{ &mt->tau_d, "material_tau_d", DT_F64, 3, { mats, 2, b } },
		{ &mt->rho_s, "material_rho_s", DT_F64, 3, { mats, 2, b } },
		{ &mt->tau_s, "material_tau_s", DT_F64, 3, { mats, 2, b } },
		{ &mt->emission, "material_emission", DT_F64, 3, { mats, 2, b } },
		{ &mt->alpha, "material_alpha", DT_F64, 2, { mats, 2 } },
		{ &mt->beta, "material_beta", DT_F64, 2, { mats, 2 } },
		{ &mt->emission_exponent, "material_emission_exponent", DT_F64, 2, { mats, 2 } },
		{ &mt->one_sided, "material_one_sided", DT_U8, 1, { mats } },
		{ &s->material, "surface_material", DT_U32, 1, { s->n } },
		{ &s->has_normals, "surface_has_normals", DT_U8, 1, { s->n } },
		{ &l->position, "light_position", DT_F64, 2, { l->n, 3 } },
		{ &l->direction, "light_direction", DT_F64, 2, { l->n, 3 } },
		{ &l->cone, "light_cone", DT_F64, 2, { l->n, 2 } },
		{ &l->intensity, "light_intensity", DT_F64, 2, { l->n, b } },
		{ &l->kind, "light_kind", DT_U8, 1, { l->n } },
		{ &m->vertex, "vertex", DT_F64, 2, { m->vertices, 3 } },
		{ &m->triangle.corner, "triangle", DT_U32, 2, { t, 3 } },
		{ &m->triangle.surface, "triangle_surface", DT_U32, 1, { t } },
		{ &m->triangle.uv, "triangle_uv", DT_F32, 3, { t, 3, 2 } },
		{ &m->triangle.normal, "triangle_normal", DT_F32, 3, { t, 3, 3 } },
		{ &m->triangle.split, "triangle_split", DT_I32, 1, { t } },
		{ &m->split, "split", DT_I32, 2, { m->splits, 3 } },
		{ &m->element.corner, "element", DT_U32, 2, { m->element.n, 3 } },
		{ &m->element.triangle, "element_triangle", DT_U32, 1, { m->element.n } },
		{ &m->patch.start, "patch_start", DT_U32, 1, { m->patch.n + 1 } },
		{ &m->patch.surface, "patch_surface", DT_U32, 1, { m->patch.n } },
		{ &m->patch.loop, "patch_loop", DT_U64, 1, { m->patch.n + 1 } },
		{ &m->patch.loop_start, "loop_start", DT_U64, 1, { m->patch.loops + 1 } },
		{ &m->patch.loop_index, "loop_index", DT_U32, 1, { m->patch.loop_indices } },
	};

	static_assert(sizeof f / sizeof *f <= FIELDS_MAX, "FIELDS_MAX");
	memcpy(out, f, sizeof f);
	return sizeof f / sizeof *f;
}

static size_t camera_fields(struct camera_arrays *a, uint64_t n, struct field out[FIELDS_MAX])
{
	const struct field f[] = {
		{ &a->to_world, "camera_to_world", DT_F64, 2, { n, 16 } },
		{ &a->yfov, "camera_yfov", DT_F64, 1, { n } },
		{ &a->aspect, "camera_aspect", DT_F64, 1, { n } },
		{ &a->xmag, "camera_xmag", DT_F64, 1, { n } },
		{ &a->ymag, "camera_ymag", DT_F64, 1, { n } },
		{ &a->orthographic, "camera_orthographic", DT_U8, 1, { n } },
	};

	memcpy(out, f, sizeof f);
	return sizeof f / sizeof *f;
}

static void camera_arrays_free(struct camera_arrays *a)
{
	free(a->to_world);
	free(a->yfov);
	free(a->aspect);
	free(a->xmag);
	free(a->ymag);
	free(a->orthographic);
}

/* ---- writing ---- */

static int camera_arrays_new(struct camera_arrays *a, size_t n, struct err *e)
{
	a->to_world = mem_new(n, 16 * sizeof(double), "cameras", e);
	a->yfov = mem_new(n, sizeof(double), "cameras", e);
	a->aspect = mem_new(n, sizeof(double), "cameras", e);
	a->xmag = mem_new(n, sizeof(double), "cameras", e);
	a->ymag = mem_new(n, sizeof(double), "cameras", e);
	a->orthographic = mem_new(n, 1, "cameras", e);
	return a->to_world && a->yfov && a->aspect && a->xmag && a->ymag && a->orthographic
	           ? 0 : -1;
}

static int put_camera_names(struct container_writer *w, const struct model *m, struct err *e)
{
	char **name = mem_new(m->cameras, sizeof *name, "cameras", e);

	if (!name)
		return -1;
	for (size_t i = 0; i < m->cameras; i++)
		name[i] = m->camera[i].name;
	int failed = file_cache_write_names(w, "cameras", name, m->cameras, e);
	free(name);
	return failed;
}

static int put_cameras(struct container_writer *w, const struct model *m, struct err *e)
{
	struct camera_arrays a = { 0 };
	struct field f[FIELDS_MAX];
	int failed = camera_arrays_new(&a, m->cameras, e);

	for (size_t i = 0; i < m->cameras && !failed; i++) {
		const struct camera *c = &m->camera[i];
		memcpy(&a.to_world[16 * i], c->to_world, sizeof c->to_world);
		a.yfov[i] = c->yfov;
		a.aspect[i] = c->aspect;
		a.xmag[i] = c->xmag;
		a.ymag[i] = c->ymag;
		a.orthographic[i] = (uint8_t)c->orthographic;
	}
	failed = failed || file_fields_put(w, f, camera_fields(&a, m->cameras, f), e) ||
	         put_camera_names(w, m, e);
	camera_arrays_free(&a);
	return failed ? -1 : 0;
}

int file_mesh_put_model(struct container_writer *w, const struct model *m, struct err *e)
{
	struct field f[FIELDS_MAX];
	struct model view = *m; /* the list points at pointers: those of this copy */
	struct err why = { 0 };

	if (model_check(m, &why))
		return err_set(e, "%s: cannot write: %s", file_container_writer_path(w), why.text);
	return file_fields_put(w, f, model_fields(&view, f), e) ||
	       put_cameras(w, m, e) ||
	       file_container_meta(w, "lobe", m->lobe == LOBE_PAPER ? "paper" : "reciprocal", e) ||
	       file_cache_write_names(w, "materials", m->material.name, m->material.n, e) ||
	       file_cache_write_names(w, "surfaces", m->surface.name, m->surface.n, e) ||
	       file_cache_write_names(w, "lights", m->light.name, m->light.n, e) ? -1 : 0;
}

int file_mesh_write(const char *path, const struct model *m, const struct cache_info *i,
                    struct err *e)
{
	struct container_writer *w = file_container_create(path, e);
	struct cache_info info = *i;

	if (!w)
		return -1;
	file_cache_ids(m, &info); /* those of this very model */
	if (file_mesh_put_model(w, m, e) || file_cache_write_info(w, FORMAT, &info, e)) {
		file_container_abandon(w);
		return -1;
	}
	return file_container_finish(w, e);
}

/* ---- reading ---- */

static int get_counts(const struct container *c, struct model *m, struct err *e)
{
	size_t bands;

	if (file_fields_size(c, "material_rho_d", DT_F64, 3, 0, &m->material.n, e) ||
	    file_fields_size(c, "material_rho_d", DT_F64, 3, 2, &bands, e) ||
	    file_fields_size(c, "surface_material", DT_U32, 1, 0, &m->surface.n, e) ||
	    file_fields_size(c, "light_kind", DT_U8, 1, 0, &m->light.n, e) ||
	    file_fields_size(c, "camera_to_world", DT_F64, 2, 0, &m->cameras, e) ||
	    file_fields_size(c, "vertex", DT_F64, 2, 0, &m->vertices, e) ||
	    file_fields_size(c, "triangle", DT_U32, 2, 0, &m->triangle.n, e) ||
	    file_fields_size(c, "split", DT_I32, 2, 0, &m->splits, e) ||
	    file_fields_size(c, "element", DT_U32, 2, 0, &m->element.n, e) ||
	    file_fields_size(c, "patch_surface", DT_U32, 1, 0, &m->patch.n, e) ||
	    file_fields_size(c, "loop_start", DT_U64, 1, 0, &m->patch.loops, e) ||
	    file_fields_size(c, "loop_index", DT_U32, 1, 0, &m->patch.loop_indices, e))
		return -1;
	if (bands < 1 || bands > BANDS_MAX)
		return file_container_refuse(c, e, "array material_rho_d: %zu bands are not between 1 "
		                             "and %d", bands, BANDS_MAX);
	if (m->patch.loops == 0)
		return file_container_refuse(c, e, "array loop_start: it is empty");
	m->patch.loops--; /* starts are one more than what they start */
	m->bands = m->material.bands = (int)bands;
	return 0;
}

static int get_lobe(const struct container *c, struct model *m, struct err *e)
{
	const char *lobe = file_container_get_meta(c, "lobe");

	m->lobe = lobe && strcmp(lobe, "reciprocal") == 0 ? LOBE_RECIPROCAL : LOBE_PAPER;
	if (!lobe || (m->lobe == LOBE_PAPER && strcmp(lobe, "paper") != 0))
		return file_container_refuse(c, e, "metadata lobe: neither paper nor reciprocal");
	return 0;
}

static int get_cameras(const struct container *c, struct model *m, struct err *e)
{
	struct camera_arrays a = { 0 };
	struct field f[FIELDS_MAX];
	char **name = NULL;
	int failed = file_fields_copy(c, f, camera_fields(&a, m->cameras, f), e) ||
	             file_cache_read_names(c, "cameras", &name, m->cameras, e) ||
	             !(m->camera = mem_new(m->cameras, sizeof *m->camera, "cameras", e));

	for (size_t i = 0; i < m->cameras && !failed; i++) {
		m->camera[i] = (struct camera){ .name = name[i], .yfov = a.yfov[i],
			.orthographic = a.orthographic[i], .aspect = a.aspect[i],
			.xmag = a.xmag[i], .ymag = a.ymag[i] };
		memcpy(m->camera[i].to_world, &a.to_world[16 * i], 16 * sizeof *a.to_world);
		name[i] = NULL; /* now the camera's */
	}
	if (name)
		file_cache_names_free(name, m->cameras);
	camera_arrays_free(&a);
	return failed ? -1 : 0;
}

int file_mesh_get_model(const struct container *c, struct model *m, struct err *e)
{
	struct field f[FIELDS_MAX];
	struct err why = { 0 };

	*m = (struct model){ 0 };
	if (get_counts(c, m, e) || get_lobe(c, m, e) ||
	    file_fields_copy(c, f, model_fields(m, f), e) ||
	    file_cache_read_names(c, "materials", &m->material.name, m->material.n, e) ||
	    file_cache_read_names(c, "surfaces", &m->surface.name, m->surface.n, e) ||
	    file_cache_read_names(c, "lights", &m->light.name, m->light.n, e) ||
	    get_cameras(c, m, e))
		goto failed;
	if (model_check(m, &why)) {
		file_container_refuse(c, e, "%s", why.text);
		goto failed;
	}
	if (model_derive(m, e) == 0)
		return 0;
failed:
	model_free(m);
	return -1;
}

/* The ids are what later files bind to: they must be those of the arrays. */
int file_mesh_check_ids(const struct container *c, const struct model *m,
                        const struct cache_info *i, struct err *e)
{
	struct cache_info own = { 0 };

	file_cache_ids(m, &own);
	if (strcmp(own.geometry_id, i->geometry_id) != 0)
		return file_container_refuse(c, e, "metadata geometry_id: not that of the arrays");
	if (strcmp(own.material_id, i->material_id) != 0)
		return file_container_refuse(c, e, "metadata material_id: not that of the arrays");
	if (strcmp(own.camera_id, i->camera_id) != 0)
		return file_container_refuse(c, e, "metadata camera_id: not that of the arrays");
	return 0;
}

int file_mesh_read(const char *path, struct model *m, struct cache_info *i, struct err *e)
{
	struct container *c = file_container_open(path, FORMAT, e);
	int failed = !c || file_container_verify_all(c, e) || file_cache_read_info(c, i, e) ||
	             file_mesh_get_model(c, m, e) || file_mesh_check_ids(c, m, i, e);

	file_container_close(c);
	if (!failed)
		return 0;
	model_free(m);
	file_cache_info_free(i);
	return -1;
}
