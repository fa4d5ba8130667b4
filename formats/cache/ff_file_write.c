/* Form factors into a .ff file, batch by batch. */
#include "formats/cache/ff_file.h"

#include <stdlib.h>
#include <string.h>

#include "formats/cache/ff_file_pack.h"
#include "formats/container/fields.h"
#include "lib/base/mem.h"

#define FORMAT "twopass.ff"

/* Arrays that grow with every batch. */
enum grown {
	ROW_SCALE, ROW_BLOCK, BLOCK_START, BLOCK_COLUMN, BLOCK_ESCAPE, BLOCK_BLACK, BLOCK_LOST,
	BLOCK_CUT, BLOCK_ARRIVAL, ROW_RESIDUAL, ROW_ERROR, ROW_SIDE, ROW_SAMPLES, BLOCK_CHAIN, COLUMN,
	VALUE, VALUE_ERROR, ARRIVAL_TARGET, ARRIVAL_DIRECTION, LINK_TARGET, LINK_SOURCE, LINK_LAST,
	LINK_CHAIN, LINK_DIRECTION, LINK_ROW, ROW_KIND, GATHERED_RAYS, GATHERED_LOST,
	GATHERED_COUNT, GATHERED_LANDING, GATHERED_CHAIN, GROWN
};

static const struct {
	const char *name;
	enum dtype type;
	enum field_absent absent;
	uint64_t columns; /* 1 = a plain list */
} declared[GROWN] = {
	[ROW_SCALE] = { "row_scale", DT_F64, FIELD_NEVER, 1 },
	[ROW_BLOCK] = { "row_block", DT_U64, FIELD_ORDER, 1 },
	[BLOCK_START] = { "block_start", DT_U64, FIELD_NEVER, 1 },
	[BLOCK_COLUMN] = { "block_column", DT_U64, FIELD_NEVER, 1 },
	[BLOCK_ESCAPE] = { "block_escape", DT_F64, FIELD_ZEROS, 1 },
	[BLOCK_BLACK] = { "block_black", DT_F64, FIELD_ZEROS, 1 },
	[BLOCK_LOST] = { "block_lost", DT_F64, FIELD_ZEROS, 1 },
	[BLOCK_CUT] = { "block_cut", DT_F64, FIELD_ZEROS, 1 },
	[BLOCK_ARRIVAL] = { "block_arrival", DT_U64, FIELD_ZEROS, 1 },
	[ROW_RESIDUAL] = { "row_residual", DT_F32, FIELD_NEVER, 1 },
	[ROW_ERROR] = { "row_error", DT_F32, FIELD_NEVER, 1 },
	[ROW_SIDE] = { "row_side", DT_U32, FIELD_EVEN, 1 },
	[ROW_SAMPLES] = { "row_samples", DT_U32, FIELD_ZEROS, 1 },
	[BLOCK_CHAIN] = { "block_chain", DT_U32, FIELD_ZEROS, 1 },
	[COLUMN] = { "column", DT_U32, FIELD_NEVER, 1 },
	[VALUE] = { "value", DT_F32, FIELD_NEVER, 1 },
	[VALUE_ERROR] = { "value_error", DT_F32, FIELD_ZEROS, 1 },
	[ARRIVAL_TARGET] = { "arrival_target", DT_U32, FIELD_EMPTY, 1 },
	[ARRIVAL_DIRECTION] = { "arrival_direction", DT_F32, FIELD_EMPTY, 3 },
	[LINK_TARGET] = { "link_target", DT_U32, FIELD_EMPTY, 1 },
	[LINK_SOURCE] = { "link_source", DT_U32, FIELD_EMPTY, 1 },
	[LINK_LAST] = { "link_last", DT_U32, FIELD_EMPTY, 1 },
	[LINK_CHAIN] = { "link_chain", DT_U32, FIELD_EMPTY, 1 },
	[LINK_DIRECTION] = { "link_direction", DT_F32, FIELD_EMPTY, 3 },
	[LINK_ROW] = { "link_row", DT_U32, FIELD_EMPTY, 2 },
	[ROW_KIND] = { "row_kind", DT_U8, FIELD_ZEROS, 1 },
	[GATHERED_RAYS] = { "gathered_rays", DT_U32, FIELD_EMPTY, 1 },
	[GATHERED_LOST] = { "gathered_lost", DT_U32, FIELD_EMPTY, 1 },
	[GATHERED_COUNT] = { "gathered_count", DT_U32, FIELD_EMPTY, 1 },
	[GATHERED_LANDING] = { "gathered_landing", DT_U32, FIELD_EMPTY, 1 },
	[GATHERED_CHAIN] = { "gathered_chain", DT_U32, FIELD_EMPTY, 1 },
};

struct ff_writer {
	struct container_writer *container;
	char geometry_id[33];      /* of the model; .ff files depend on nothing else */
	struct array shifted;      /* scratch for indices moved behind earlier batches */
	struct array narrow;       /* scratch for words of 16 bits */
	struct ff_packed packed;
	const struct model *m;
	uint64_t rows, blocks, entries, arrivals;
	int f64, to_patches;
	int narrow_columns;        /* words of columns have 16 bits */
	struct {
		int handle;        /* of the container, or -1: absent so far */
		uint64_t left_out; /* values that stand for themselves */
	} array[GROWN];
};

/* ---- arrays that are there if need be ---- */

static int begin(struct ff_writer *w, enum grown a, struct err *e)
{
	const uint64_t columns = declared[a].columns, shape[2] = { 0, columns };
	enum dtype type = a == VALUE && w->f64 ? DT_F64
	                : a == COLUMN && w->narrow_columns ? DT_U16 : declared[a].type;

	w->array[a].handle = file_container_array(w->container, declared[a].name, type,
	                                          columns == 1 ? 1 : 2, shape, e);
	return w->array[a].handle < 0 ? -1 : 0;
}

static int declare(struct ff_writer *w, struct err *e)
{
	for (int a = 0; a < GROWN; a++) {
		w->array[a].handle = -1;
		if (declared[a].absent == FIELD_NEVER && begin(w, (enum grown)a, e))
			return -1;
	}
	return 0;
}

/* Value i of an array that is not there. */
static uint64_t usual(enum grown a, uint64_t i)
{
	return declared[a].absent == FIELD_EVEN ? 2 * i : declared[a].absent == FIELD_ORDER ? i : 0;
}

/* 1 if the next values of an array are what they are taken for in its absence. */
static int goes_without_saying(const struct ff_writer *w, enum grown a, const void *data,
                               size_t n, size_t size)
{
	const unsigned char *byte = data;

	if (declared[a].absent <= FIELD_EMPTY)
		return declared[a].absent == FIELD_EMPTY && n == 0;
	for (size_t i = 0; i < n; i++) {
		uint64_t value = usual(a, w->array[a].left_out + i);
		if (memcmp(byte + i * size, &value, size))
			return 0;
	}
	return 1;
}

static int write_left_out(struct ff_writer *w, enum grown a, struct err *e)
{
	for (uint64_t i = 0; i < w->array[a].left_out; i++) {
		uint64_t value = usual(a, i);
		if (file_container_write(w->container, w->array[a].handle, &value,
		                         file_dtype_size(declared[a].type), e))
			return -1;
	}
	return 0;
}

static int put(struct ff_writer *w, enum grown a, const void *data, size_t n, size_t size,
               struct err *e)
{
	if (w->array[a].handle < 0 && goes_without_saying(w, a, data, n, size)) {
		w->array[a].left_out += n;
		return 0;
	}
	if (w->array[a].handle < 0 && (begin(w, a, e) || write_left_out(w, a, e)))
		return -1;
	return file_container_write(w->container, w->array[a].handle, data, n * size, e);
}

/* ---- the model ---- */

/* Patch sides and starts, if they are not what they are taken for. */
static int put_patches(struct ff_writer *w, const struct model *m, struct err *e)
{
	uint8_t *sides = mem_new(m->patch.n, 1, "patch sides", e);
	const uint64_t n = m->patch.n, n1 = n + 1;
	int plain = 1, even = m->element.n % m->patch.n == 0, bad = !sides;

	for (size_t p = 0; sides && p < m->patch.n; p++) {
		sides[p] = model_side_modelled(m, (uint32_t)(2 * p + 1)) ? 3 : 1;
		plain &= sides[p] == 1;
		even &= m->patch.start[p] == m->element.n / m->patch.n * p;
	}
	bad = bad ||
	      (!even && file_container_put(w->container, "patch_start", DT_U32, 1, &n1, m->patch.start, e)) ||
	      (!plain && file_container_put(w->container, "patch_sides", DT_U8, 1, &n, sides, e));
	free(sides);
	return bad ? -1 : 0;
}

/* Keeps what makes the file readable without its .mesh. */
static int put_scene(struct ff_writer *w, const struct model *m, struct err *e)
{
	const uint64_t n = m->patch.n, five = 5;
	const uint64_t counts[5] = { n, m->element.n, m->material.n, m->surface.n, m->light.n };

	return file_container_put(w->container, "patch_area", DT_F64, 1, &n, m->patch.area, e) ||
	       file_container_put(w->container, "model_counts", DT_U64, 1, &five, counts, e) ||
	       file_container_put(w->container, "patch_surface", DT_U32, 1, &n, m->patch.surface, e) ||
	       put_patches(w, m, e) ||
	       file_container_meta(w->container, "receivers", w->to_patches ? "patches" : "elements", e) ||
	       file_cache_write_names(w->container, "materials", m->material.name, m->material.n, e) ||
	       file_cache_write_names(w->container, "surfaces", m->surface.name, m->surface.n, e) ||
	       file_cache_write_names(w->container, "lights", m->light.name, m->light.n, e) ? -1 : 0;
}

struct ff_writer *file_ff_create(const char *path, const struct model *m, int f64,
                                 int to_patches, struct err *e)
{
	struct ff_writer *w = mem_new(1, sizeof *w, path, e);

	if (!w)
		return NULL;
	struct cache_info ids = { 0 };
	w->m = m;
	w->f64 = f64;
	w->to_patches = to_patches;
	w->narrow_columns = (to_patches ? m->patch.n : m->element.n) <= (UINT16_MAX + 1) / 2;
	file_cache_ids(m, &ids);
	memcpy(w->geometry_id, ids.geometry_id, sizeof w->geometry_id);
	w->container = file_container_create(path, e);
	if (w->container && declare(w, e) == 0 && put_scene(w, m, e) == 0)
		return w;
	file_ff_abandon(w);
	return NULL;
}

void file_ff_abandon(struct ff_writer *w)
{
	if (!w)
		return;
	file_container_abandon(w->container);
	free(w->shifted.data);
	free(w->narrow.data);
	file_ff_packed_free(&w->packed);
	free(w);
}

/* Starts of a batch, which begin with 0, behind `base` earlier ones. */
static int put_starts(struct ff_writer *w, enum grown a, const uint64_t *start, size_t n,
                      uint64_t base, struct err *e)
{
	w->shifted.n = 0;
	if (mem_reserve(&w->shifted, n, sizeof *start, e))
		return -1;
	uint64_t *out = w->shifted.data;
	for (size_t i = 0; i < n; i++)
		out[i] = start[i] + base;
	return put(w, a, out, n, sizeof *out, e);
}

static int put_link_rows(struct ff_writer *w, const struct ff *b, struct err *e)
{
	w->shifted.n = 0;
	/* The scratch holds 64-bit starts too: its unit stays 8 bytes. */
	if (mem_reserve(&w->shifted, b->link.n, sizeof(uint64_t), e))
		return -1;
	uint32_t *out = w->shifted.data;
	for (size_t i = 0; i < 2 * b->link.n; i++)
		out[i] = b->link.row[i] == FF_NO_ROW ? FF_NO_ROW
		                                     : b->link.row[i] + (uint32_t)w->rows;
	return put(w, LINK_ROW, out, 2 * b->link.n, sizeof *out, e);
}

static int put_values(struct ff_writer *w, const struct ff *b, struct err *e)
{
	return w->f64 ? put(w, VALUE, b->value64, b->entries, sizeof *b->value64, e)
	              : put(w, VALUE, b->value, b->entries, sizeof *b->value, e);
}

/* Values of a batch without errors of their own have 0. */
static int put_value_errors(struct ff_writer *w, const struct ff *b, struct err *e)
{
	const float zero = 0;

	if (b->value_error)
		return put(w, VALUE_ERROR, b->value_error, b->entries, sizeof *b->value_error, e);
	if (w->array[VALUE_ERROR].handle < 0)
		w->array[VALUE_ERROR].left_out += b->entries;
	else
		for (size_t i = 0; i < b->entries; i++)
			if (put(w, VALUE_ERROR, &zero, 1, sizeof zero, e))
				return -1;
	return 0;
}

static int put_rows_and_blocks(struct ff_writer *w, const struct ff *b, struct err *e)
{
	const struct {
		enum grown array;
		const void *data;
		size_t n, size;
	} plain[] = {
		{ ROW_SCALE, b->row.scale, b->row.n, sizeof *b->row.scale },
		{ ROW_RESIDUAL, b->row.residual, b->row.n, sizeof *b->row.residual },
		{ ROW_ERROR, b->row.error, b->row.n, sizeof *b->row.error },
		{ ROW_SIDE, b->row.side, b->row.n, sizeof *b->row.side },
		{ ROW_SAMPLES, b->row.samples, b->row.n, sizeof *b->row.samples },
		{ ROW_KIND, b->row.kind, b->row.n, sizeof *b->row.kind },
		{ BLOCK_CHAIN, b->block.chain, b->block.n, sizeof *b->block.chain },
		{ BLOCK_ESCAPE, b->block.escape, b->block.n, sizeof *b->block.escape },
		{ BLOCK_BLACK, b->block.black, b->block.n, sizeof *b->block.black },
		{ BLOCK_LOST, b->block.lost, b->block.n, sizeof *b->block.lost },
		{ BLOCK_CUT, b->block.cut, b->block.n, sizeof *b->block.cut },
		{ ARRIVAL_TARGET, b->arrival.target, b->arrival.n, sizeof *b->arrival.target },
		{ ARRIVAL_DIRECTION, b->arrival.direction, b->arrival.n, 3 * sizeof(float) },
		{ LINK_TARGET, b->link.target, b->link.n, sizeof *b->link.target },
		{ LINK_SOURCE, b->link.source, b->link.n, sizeof *b->link.source },
		{ LINK_LAST, b->link.last, b->link.n, sizeof *b->link.last },
		{ LINK_CHAIN, b->link.chain, b->link.n, sizeof *b->link.chain },
		{ LINK_DIRECTION, b->link.direction, b->link.n, 3 * sizeof(float) },
	};

	for (size_t i = 0; i < sizeof plain / sizeof *plain; i++)
		if (put(w, plain[i].array, plain[i].data, plain[i].n, plain[i].size, e))
			return -1;
	return put_starts(w, ROW_BLOCK, b->row.block, b->row.n, w->blocks, e) ||
	       put_starts(w, BLOCK_START, b->block.start, b->block.n, w->entries, e) ||
	       put_starts(w, BLOCK_ARRIVAL, b->block.arrival, b->block.n, w->arrivals, e) ? -1 : 0;
}

static int put_gathered(struct ff_writer *w, const struct ff_gathered *g, struct err *e)
{
	return put(w, GATHERED_RAYS, g->rays, g->sides, sizeof *g->rays, e) ||
	       put(w, GATHERED_LOST, g->lost, g->sides, sizeof *g->lost, e) ||
	       put(w, GATHERED_COUNT, g->count, g->sides, sizeof *g->count, e) ||
	       put(w, GATHERED_LANDING, g->landing, g->n, sizeof *g->landing, e) ||
	       (g->chain && put(w, GATHERED_CHAIN, g->chain, g->n, sizeof *g->chain, e)) ? -1 : 0;
}

static int put_words(struct ff_writer *w, const struct array *word, struct err *e)
{
	const uint32_t *from = word->data;

	if (!w->narrow_columns)
		return put(w, COLUMN, from, word->n, sizeof *from, e);
	w->narrow.n = 0;
	if (mem_reserve(&w->narrow, word->n, sizeof(uint16_t), e))
		return -1;
	uint16_t *to = w->narrow.data;
	for (size_t i = 0; i < word->n; i++)
		to[i] = (uint16_t)from[i];
	return put(w, COLUMN, to, word->n, sizeof *to, e);
}

static int put_columns(struct ff_writer *w, const struct ff *b, struct err *e)
{
	return file_ff_pack_columns(b, &w->packed, e) ||
	       put(w, BLOCK_COLUMN, w->packed.block_column.data, b->block.n, sizeof(uint64_t), e) ||
	       put_words(w, &w->packed.word, e) ? -1 : 0;
}

int file_ff_append(struct ff_writer *w, const struct ff *batch, struct err *e)
{
	struct ff by_patch;

	if (batch->entries && (w->f64 ? !batch->value64 : !batch->value))
		return err_set(e, "%s: array value: a batch has the other precision",
		               file_container_writer_path(w->container));
	if (batch->to_patches && !w->to_patches)
		return err_set(e, "%s: array column: a batch has patches, not elements",
		               file_container_writer_path(w->container));
	if (w->to_patches && !batch->to_patches) {
		if (file_ff_sum_by_patch(batch, w->m, &w->packed, &by_patch, e))
			return -1;
		batch = &by_patch;
	}
	if (batch->row.n >= FF_NO_ROW - w->rows)
		return err_set(e, "%s: more than 2^32 rows; compute it in parts",
		               file_container_writer_path(w->container));
	if (put_rows_and_blocks(w, batch, e) || put_columns(w, batch, e) ||
	    put_values(w, batch, e) || put_value_errors(w, batch, e) || put_link_rows(w, batch, e) ||
	    (!w->to_patches && put_gathered(w, &batch->gathered, e)))
		return -1;
	w->rows += batch->row.n;
	w->blocks += batch->block.n;
	w->entries += batch->entries;
	w->arrivals += batch->arrival.n;
	return 0;
}

static int put_table(struct ff_writer *w, const struct ff *whole, struct err *e)
{
	struct container_writer *c = w->container;
	const uint64_t starts = whole->chain.n + 1, events = whole->chain.events, four = 4, one = 1;
	const uint32_t part[4] = { whole->patch_begin, whole->patch_end, whole->shard,
	                           whole->shards };
	const uint64_t end[3] = { w->blocks, w->entries, w->arrivals };

	return put(w, ROW_BLOCK, &end[0], 1, sizeof *end, e) ||
	       put(w, BLOCK_START, &end[1], 1, sizeof *end, e) ||
	       put(w, BLOCK_ARRIVAL, &end[2], 1, sizeof *end, e) ||
	       file_container_put(c, "chain_start", DT_U64, 1, &starts, whole->chain.start, e) ||
	       (events && (file_container_put(c, "chain_event", DT_U32, 1, &events, whole->chain.event, e) ||
	                   file_container_put(c, "chain_count", DT_U32, 1, &events, whole->chain.count, e))) ||
	       (whole->chain.most != 1 &&
	        file_container_put(c, "chain_most", DT_U32, 1, &one, &whole->chain.most, e)) ||
	       file_container_put(c, "part", DT_U32, 1, &four, part, e) ? -1 : 0;
}

int file_ff_finish(struct ff_writer *w, const struct ff *whole, const struct cache_info *i,
                   struct err *e)
{
	struct cache_info info = *i;

	memcpy(info.geometry_id, w->geometry_id, sizeof info.geometry_id);
	info.material_id[0] = info.camera_id[0] = '\0';
	int failed = put_table(w, whole, e) || file_cache_write_info(w->container, FORMAT, &info, e);
	if (!failed) {
		failed = file_container_finish(w->container, e);
		w->container = NULL;
	}
	file_ff_abandon(w);
	return failed ? -1 : 0;
}
