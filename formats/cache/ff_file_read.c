/* Form factors from a .ff file, which stays mapped. */
#include "formats/cache/ff_file.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/container/fields.h"
#include "lib/base/mem.h"

#define FORMAT "twopass.ff"

static enum dtype value_type(const struct container *c)
{
	const struct container_view *v = file_container_find(c, "value");

	return v && v->type == DT_F64 ? DT_F64 : DT_F32;
}

static enum dtype column_type(const struct container *c)
{
	const struct container_view *v = file_container_find(c, "column");

	return v && v->type == DT_U16 ? DT_U16 : DT_U32;
}

/* 0 where there are none. */
static int size_if_any(const struct container *c, const char *name, size_t *size, struct err *e)
{
	*size = 0;
	return file_container_find(c, name) ? file_fields_size(c, name, DT_U32, 1, 0, size, e) : 0;
}

/* Sizes from the arrays that have them to themselves. */
static int get_counts(const struct container *c, struct ff *f, struct err *e)
{
	if (file_fields_size(c, "chain_start", DT_U64, 1, 0, &f->chain.n, e) ||
	    size_if_any(c, "chain_event", &f->chain.events, e) ||
	    file_fields_size(c, "row_scale", DT_F64, 1, 0, &f->row.n, e) ||
	    file_fields_size(c, "block_column", DT_U64, 1, 0, &f->block.n, e) ||
	    file_fields_size(c, "column", column_type(c), 1, 0, &f->columns, e) ||
	    file_fields_size(c, "value", value_type(c), 1, 0, &f->entries, e) ||
	    size_if_any(c, "arrival_target", &f->arrival.n, e) ||
	    size_if_any(c, "link_target", &f->link.n, e) ||
	    size_if_any(c, "gathered_rays", &f->gathered.sides, e) ||
	    size_if_any(c, "gathered_landing", &f->gathered.n, e))
		return -1;
	if (f->chain.n == 0)
		return file_container_refuse(c, e, "array chain_start: it is empty");
	f->chain.n--; /* starts are one more than what they start */
	return 0;
}

static int map_arrays(const struct container *c, struct ff *f, uint32_t **part,
                      uint32_t **most, struct array *made, struct err *e)
{
	const int f64 = value_type(c) == DT_F64, narrow = column_type(c) == DT_U16;
	const int chains = file_container_find(c, "gathered_chain") != NULL;
	struct ff_gathered *g = &f->gathered;
	uint32_t *chain = NULL;
	const struct field_or_not field[] = {
		{ { &f->chain.start, "chain_start", DT_U64, 1, { f->chain.n + 1 } }, FIELD_NEVER },
		{ { &f->chain.event, "chain_event", DT_U32, 1, { f->chain.events } }, FIELD_EMPTY },
		{ { &f->chain.count, "chain_count", DT_U32, 1, { f->chain.events } }, FIELD_EMPTY },
		{ { &f->row.side, "row_side", DT_U32, 1, { f->row.n } }, FIELD_EVEN },
		{ { &f->row.kind, "row_kind", DT_U8, 1, { f->row.n } }, FIELD_ZEROS },
		{ { &f->row.samples, "row_samples", DT_U32, 1, { f->row.n } }, FIELD_ZEROS },
		{ { &f->row.scale, "row_scale", DT_F64, 1, { f->row.n } }, FIELD_NEVER },
		{ { &f->row.residual, "row_residual", DT_F32, 1, { f->row.n } }, FIELD_NEVER },
		{ { &f->row.error, "row_error", DT_F32, 1, { f->row.n } }, FIELD_NEVER },
		{ { &f->row.block, "row_block", DT_U64, 1, { f->row.n + 1 } }, FIELD_ORDER },
		{ { &f->block.chain, "block_chain", DT_U32, 1, { f->block.n } }, FIELD_ZEROS },
		{ { &f->block.start, "block_start", DT_U64, 1, { f->block.n + 1 } }, FIELD_NEVER },
		{ { &f->block.column, "block_column", DT_U64, 1, { f->block.n } }, FIELD_NEVER },
		{ { &f->block.escape, "block_escape", DT_F64, 1, { f->block.n } }, FIELD_ZEROS },
		{ { &f->block.black, "block_black", DT_F64, 1, { f->block.n } }, FIELD_ZEROS },
		{ { &f->block.lost, "block_lost", DT_F64, 1, { f->block.n } }, FIELD_ZEROS },
		{ { &f->block.cut, "block_cut", DT_F64, 1, { f->block.n } }, FIELD_ZEROS },
		{ { &f->block.arrival, "block_arrival", DT_U64, 1, { f->block.n + 1 } }, FIELD_ZEROS },
		{ { &f->arrival.target, "arrival_target", DT_U32, 1, { f->arrival.n } }, FIELD_EMPTY },
		{ { &f->arrival.direction, "arrival_direction", DT_F32, 2, { f->arrival.n, 3 } },
		  FIELD_EMPTY },
		{ { &f->link.target, "link_target", DT_U32, 1, { f->link.n } }, FIELD_EMPTY },
		{ { &f->link.source, "link_source", DT_U32, 1, { f->link.n } }, FIELD_EMPTY },
		{ { &f->link.last, "link_last", DT_U32, 1, { f->link.n } }, FIELD_EMPTY },
		{ { &f->link.chain, "link_chain", DT_U32, 1, { f->link.n } }, FIELD_EMPTY },
		{ { &f->link.direction, "link_direction", DT_F32, 2, { f->link.n, 3 } }, FIELD_EMPTY },
		{ { &f->link.row, "link_row", DT_U32, 2, { f->link.n, 2 } }, FIELD_EMPTY },
		{ { &g->rays, "gathered_rays", DT_U32, 1, { g->sides } }, FIELD_EMPTY },
		{ { &g->lost, "gathered_lost", DT_U32, 1, { g->sides } }, FIELD_EMPTY },
		{ { &g->count, "gathered_count", DT_U32, 1, { g->sides } }, FIELD_EMPTY },
		{ { &g->landing, "gathered_landing", DT_U32, 1, { g->n } }, FIELD_EMPTY },
		{ { &chain, "gathered_chain", DT_U32, 1, { chains ? g->n : 0 } }, FIELD_EMPTY },
		{ { part, "part", DT_U32, 1, { 4 } }, FIELD_NEVER },
		{ { most, "chain_most", DT_U32, 1, { 1 } }, FIELD_ZEROS },
		{ { narrow ? (void *)&f->column16 : (void *)&f->column, "column",
		  narrow ? DT_U16 : DT_U32, 1, { f->columns } }, FIELD_NEVER },
		{ { f64 ? (void *)&f->value64 : (void *)&f->value, "value",
		  f64 ? DT_F64 : DT_F32, 1, { f->entries } }, FIELD_NEVER },
	};

	if (file_fields_map_or_make(c, field, sizeof field / sizeof *field, made, e))
		return -1;
	g->chain = chains ? chain : NULL;
	return 0;
}

/* Not made where it is absent: it is as large as the values. */
static int map_value_errors(const struct container *c, struct ff *f, struct err *e)
{
	const struct field field = { &f->value_error, "value_error", DT_F32, 1, { f->entries } };

	return file_container_find(c, field.name) ? file_fields_map(c, &field, 1, e) : 0;
}

static int get_receivers(const struct container *c, struct ff *f, struct err *e)
{
	const char *text = file_container_get_meta(c, "receivers");

	f->to_patches = text && strcmp(text, "patches") == 0;
	if (text && (f->to_patches || strcmp(text, "elements") == 0))
		return 0;
	return file_container_refuse(c, e, "metadata receivers: %.20s, neither elements nor patches",
	                             text ? text : "missing");
}

static int map_ff(struct ff_file *o, struct err *e)
{
	const struct container *c = o->container;
	struct ff *f = &o->f;
	uint32_t *part = NULL, *most = NULL;

	if (get_receivers(c, f, e) || get_counts(c, f, e) ||
	    map_arrays(c, f, &part, &most, &o->made, e) || map_value_errors(c, f, e))
		return -1;
	f->patch_begin = part[0];
	f->patch_end = part[1];
	f->shard = part[2];
	f->shards = part[3];
	f->chain.most = file_container_find(c, "chain_most") ? *most : 1;
	return 0;
}

/* Starts and sides, which may be left out: as many elements in each patch, and the back
 * of none is modelled. */
static int map_patches(struct ff_file *o, struct err *e)
{
	struct ff_scene *s = &o->scene;
	uint32_t *start = NULL;
	uint8_t *sides = NULL;
	const struct field_or_not field[] = {
		{ { &start, "patch_start", DT_U32, 1, { s->patches + 1 } }, FIELD_ORDER },
		{ { &sides, "patch_sides", DT_U8, 1, { s->patches } }, FIELD_ZEROS },
	};

	if (file_fields_map_or_make(o->container, field, sizeof field / sizeof *field, &o->made, e))
		return -1;
	if (!file_container_find(o->container, "patch_start"))
		for (size_t p = 0; p <= s->patches; p++)
			start[p] *= (uint32_t)(s->patches ? s->elements / s->patches : 0);
	if (!file_container_find(o->container, "patch_sides"))
		memset(sides, 1, s->patches);
	s->patch_start = start;
	s->patch_sides = sides;
	return 0;
}

static int map_scene(struct ff_file *o, struct err *e)
{
	struct ff_scene *s = &o->scene;
	const struct container *c = o->container;
	const uint64_t *counts = NULL;
	const struct field number = { &counts, "model_counts", DT_U64, 1, { 5 } };

	if (file_fields_map(c, &number, 1, e))
		return -1;
	if (counts[0] >= INT32_MAX || counts[1] >= INT32_MAX || counts[2] >= INT32_MAX ||
	    counts[4] >= INT32_MAX)
		return file_container_refuse(c, e, "array model_counts: impossible");
	s->patches = (size_t)counts[0];
	s->elements = (size_t)counts[1];
	s->materials = (size_t)counts[2];
	o->surfaces = (size_t)counts[3];
	s->lights = (size_t)counts[4];
	o->patches = (uint32_t)counts[0];
	const struct field field[] = {
		{ &s->patch_area, "patch_area", DT_F64, 1, { s->patches } },
		{ &o->patch_surface, "patch_surface", DT_U32, 1, { s->patches } },
	};
	if (file_fields_map(c, field, sizeof field / sizeof *field, e) || map_patches(o, e))
		return -1;
	if (s->patch_start[s->patches] != s->elements)
		return file_container_refuse(c, e, "array patch_start: it ends with %" PRIu32 " of %zu "
		                             "elements", s->patch_start[s->patches], s->elements);
	for (size_t p = 0; p < s->patches; p++)
		if (o->patch_surface[p] >= o->surfaces)
			return file_container_refuse(c, e, "array patch_surface: value %zu is %" PRIu32
			                             " of %zu surfaces", p, o->patch_surface[p],
			                             o->surfaces);
	return file_cache_read_names(c, "surfaces", &o->surface_name, o->surfaces, e) ||
	       file_cache_read_names(c, "lights", &o->light_name, s->lights, e) ? -1 : 0;
}

static int check_id(const struct ff_file *o, const struct cache_info *m_info, struct err *e)
{
	return m_info && strcmp(m_info->geometry_id, o->info.geometry_id) != 0
	           ? file_container_refuse(o->container, e, "made for another geometry") : 0;
}

static int check_patches(const struct ff_file *o, const struct model *m, struct err *e)
{
	int other = m && (m->patch.n != o->scene.patches || m->element.n != o->scene.elements ||
	                  m->material.n != o->scene.materials ||
	                  m->light.n != o->scene.lights ||
	                  memcmp(m->patch.start, o->scene.patch_start,
	                         (m->patch.n + 1) * sizeof *m->patch.start) != 0);

	return other ? file_container_refuse(o->container, e, "made for another geometry") : 0;
}

static int open_ff(const char *path, const struct model *m, const struct cache_info *m_info,
                   struct ff_file *o, struct err *e)
{
	struct err why = { 0 };

	/* Binding first: for a file of another scene the rest does not matter. */
	if (!(o->container = file_container_open(path, FORMAT, e)) ||
	    file_cache_read_info(o->container, &o->info, e) || check_id(o, m_info, e) ||
	    file_container_verify_all(o->container, e) || map_scene(o, e) ||
	    check_patches(o, m, e) || map_ff(o, e))
		return -1;
	return ff_check(&o->f, &o->scene, &why) ? file_container_refuse(o->container, e, "%s", why.text)
	                                        : 0;
}

int file_ff_open(const char *path, const struct model *m, const struct cache_info *m_info,
                 struct ff_file *out, struct err *e)
{
	*out = (struct ff_file){ 0 };
	if (open_ff(path, m, m_info, out, e) == 0)
		return 0;
	file_ff_close(out);
	return -1;
}

void file_ff_close(struct ff_file *f)
{
	for (size_t i = 0; i < f->made.n; i++)
		free(((void **)f->made.data)[i]);
	free(f->made.data);
	file_cache_names_free(f->surface_name, f->surfaces);
	file_cache_names_free(f->light_name, f->scene.lights);
	file_cache_info_free(&f->info);
	file_container_close(f->container);
	*f = (struct ff_file){ 0 };
}

static char *side_name(const char *surface, int several, uint32_t nth, uint32_t side,
                       struct err *e)
{
	size_t size = strlen(surface) + 32;
	char *name = mem_new(size, 1, "names of patch-sides", e);

	if (name && several)
		snprintf(name, size, "%s[%" PRIu32 "]:%c", surface, nth, "fb"[side]);
	else if (name)
		snprintf(name, size, "%s:%c", surface, "fb"[side]);
	return name;
}

char **file_ff_side_names(const struct ff_file *f, struct err *e)
{
	const size_t sides = 2 * f->scene.patches;
	char **name = mem_new(sides, sizeof *name, "names of patch-sides", e);
	uint32_t *total = mem_new(f->surfaces, sizeof *total, "names of patch-sides", e);
	uint32_t *so_far = mem_new(f->surfaces, sizeof *so_far, "names of patch-sides", e);
	int failed = !name || !total || !so_far;

	for (size_t p = 0; p < f->scene.patches && !failed; p++)
		total[f->patch_surface[p]]++;
	for (size_t ps = 0; ps < sides && !failed; ps++) {
		uint32_t s = f->patch_surface[ps >> 1];
		name[ps] = side_name(f->surface_name[s], total[s] > 1, so_far[s], ps & 1, e);
		failed = !name[ps];
		so_far[s] += ps & 1;
	}
	free(total);
	free(so_far);
	if (!failed)
		return name;
	file_cache_names_free(name, sides);
	return NULL;
}
