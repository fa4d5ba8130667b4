/* .mesh, .ff and .rad files: round trips and refusals. */
#include <fcntl.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "formats/cache/ff_file.h"
#include "formats/cache/mesh_file.h"
#include "formats/cache/rad_file.h"
#include "lib/data/model_check.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/small_scene.h"

static char directory[] = "/tmp/twopass-caches-XXXXXX";
static char mesh_path[64], ff_path[64], rad_path[64];
static struct model model;
static struct ff ff;
static struct solution solution;
static struct cache_info info = { .history = "mesh a.gltf", .options = "{}",
                                  .report = "{\"n\":1}", .key = "k" };

static int set_up(void **state)
{
	(void)state;
	if (!mkdtemp(directory))
		return -1;
	snprintf(mesh_path, sizeof mesh_path, "%s/a.mesh", directory);
	snprintf(ff_path, sizeof ff_path, "%s/a.ff", directory);
	snprintf(rad_path, sizeof rad_path, "%s/a.rad", directory);
	small_model(&model);
	small_ff(&ff);
	small_solution(&solution, &model);
	return 0;
}

static int tear_down(void **state)
{
	char command[128];

	(void)state;
	model_free(&model);
	ff_free(&ff);
	solution_free(&solution);
	snprintf(command, sizeof command, "rm -rf %s", directory);
	return system(command);
}

static void must(int status, const struct err *e)
{
	if (status)
		fail_msg("%s", e->text);
}

/* ---- writing the three files ---- */

static void write_mesh(void)
{
	struct err e = { 0 };

	must(file_mesh_write(mesh_path, &model, &info, &e), &e);
}

static void write_rad(void)
{
	struct err e = { 0 };

	must(file_rad_write(rad_path, &model, &solution, &info, &e), &e);
}

/* In two batches: rows of patch 0, then the row of patch 1. */
static int try_write_ff(const struct ff *f, int to_patches, struct err *e)
{
	const uint64_t blocks[] = { 0, 1 }, entries[] = { 0, 3 }, arrivals[] = { 0, 0 };
	struct ff_writer *w = file_ff_create(ff_path, &model, 0, to_patches, e);

	if (!w)
		return -1;
	struct ff first = *f, second = *f;
	first.row.n = 2, first.block.n = 3, first.entries = 3, first.link.n = 0;
	second.row.n = 1, second.block.n = 1, second.entries = 3;
	second.arrival.n = second.link.n = 0;
	second.row.side += 2, second.row.kind += 2, second.row.samples += 2;
	second.row.scale += 2, second.row.residual += 2, second.row.error += 2;
	second.row.block = (uint64_t *)blocks;
	second.block.chain += 3, second.block.escape += 3, second.block.black += 3;
	second.block.lost += 3, second.block.cut += 3;
	second.block.start = (uint64_t *)entries;
	second.block.arrival = (uint64_t *)arrivals;
	second.column += 3, second.value += 3;
	if (file_ff_append(w, &first, e) || file_ff_append(w, &second, e)) {
		file_ff_abandon(w);
		return -1;
	}
	/* The lobe row comes in a batch of its own with the link to it. */
	const uint64_t last_entries[] = { 0, 1 };
	const uint32_t link_row[] = { 0, FF_NO_ROW };
	struct ff third = *f;
	third.row.n = 1, third.block.n = 1, third.entries = 1, third.arrival.n = 0;
	third.row.side += 3, third.row.kind += 3, third.row.samples += 3;
	third.row.scale += 3, third.row.residual += 3, third.row.error += 3;
	third.row.block = (uint64_t *)blocks;
	third.block.chain += 4, third.block.escape += 4, third.block.black += 4;
	third.block.lost += 4, third.block.cut += 4;
	third.block.start = (uint64_t *)last_entries;
	third.block.arrival = (uint64_t *)arrivals;
	third.column += 6, third.value += 6;
	third.link.row = (uint32_t *)link_row;
	if (file_ff_append(w, &third, e)) {
		file_ff_abandon(w);
		return -1;
	}
	return file_ff_finish(w, f, &info, e);
}

static void write_ff(void)
{
	struct err e = { 0 };

	must(try_write_ff(&ff, 0, &e), &e);
}

/* ---- round trips ---- */

#define SAME(a, b, n) assert_memory_equal(a, b, (n) * sizeof *(a))

static void check_model(const struct model *m)
{
	assert_int_equal(m->bands, 3);
	assert_int_equal(m->lobe, model.lobe);
	assert_string_equal(m->material.name[1], "lamp \"B\"");
	assert_string_equal(m->surface.name[1], "Lämpchen");
	SAME(m->material.rho_d, model.material.rho_d, 12);
	SAME(m->material.tau_s, model.material.tau_s, 12);
	SAME(m->material.alpha, model.material.alpha, 4);
	assert_true(isinf(m->material.beta[0]));
	SAME(m->material.emission, model.material.emission, 12);
	SAME(m->vertex, model.vertex, 15);
	SAME(m->split, model.split, 1);
	SAME(m->element.corner, model.element.corner, 9);
	SAME(m->patch.loop, model.patch.loop, 3);
	SAME(m->patch.loop_index, model.patch.loop_index, 4);
	SAME(m->patch.area, model.patch.area, 2);
	assert_int_equal(m->cameras, 2);
	assert_string_equal(m->camera[1].name, "far");
	assert_int_equal(m->camera[1].orthographic, 1);
	assert_that(m->camera[0].yfov, ==, .7);
	assert_that(m->camera[0].to_world[14], ==, 5);
}

static void test_mesh(void **state)
{
	struct model m = { 0 };
	struct cache_info i = { 0 };
	struct err e = { 0 };

	(void)state;
	write_mesh();
	must(file_mesh_read(mesh_path, &m, &i, &e), &e);
	check_model(&m);
	assert_string_equal(i.history, info.history);
	assert_string_equal(i.report, info.report);
	assert_int_equal(strlen(i.geometry_id), 32);
	model_free(&m);
	file_cache_info_free(&i);
}

static void test_rad(void **state)
{
	struct model m = { 0 };
	struct solution s = { 0 };
	struct cache_info i = { 0 };
	struct err e = { 0 };

	(void)state;
	write_rad();
	must(file_rad_read(rad_path, &m, &s, &i, &e), &e);
	check_model(&m);
	assert_int_equal(s.shots, 42);
	assert_int_equal(s.links, 1);
	SAME(s.irradiance.direct, solution.irradiance.direct, 18);
	SAME(s.error.sampling, solution.error.sampling, 18);
	SAME(s.error.sampling_direct, solution.error.sampling_direct, 18);
	SAME(s.error.discretisation_direct, solution.error.discretisation_direct, 18);
	SAME(s.error.discretisation, solution.error.discretisation, 18);
	SAME(s.error.uneven, solution.error.uneven, 18);
	SAME(s.uneven, solution.uneven, 18);
	SAME(s.unshot.link, solution.unshot.link, 6);
	SAME(s.ledger, solution.ledger, LEDGER_TERMS * 3);
	model_free(&m);
	solution_free(&s);
	file_cache_info_free(&i);
}

static void test_ff(void **state)
{
	struct cache_info ids = { 0 };
	struct ff_file f;
	struct err e = { 0 };

	(void)state;
	write_ff();
	file_cache_ids(&model, &ids);
	must(file_ff_open(ff_path, &model, &ids, &f, &e), &e);
	assert_int_equal(f.f.row.n, ff.row.n);
	SAME(f.f.row.block, ff.row.block, 5);
	SAME(f.f.block.start, ff.block.start, 6);
	const uint64_t words[] = { 2 * 0, 2 * 2, 2 * 3, 2 * 3 + 1, 2 * 5 };
	const uint16_t column[] = { 1, 4, 4, 0, 3, 4 }; /* the fourth block is a span */
	SAME(f.f.block.column, words, 5);
	SAME(f.f.column16, column, 6);
	assert_that(f.f.columns, ==, 6);
	assert_true(!f.f.to_patches);
	assert_true(!f.f.column);
	assert_true(ff_has_spans(&f.f, 3) && !ff_has_spans(&f.f, 0));
	SAME(f.f.value, ff.value, 7);
	assert_null(f.f.value64);
	SAME(f.f.block.escape, ff.block.escape, 5);
	SAME(f.f.link.row, ff.link.row, 2);
	SAME(f.f.chain.start, ff.chain.start, 3);
	assert_int_equal(f.f.patch_end, 2);
	assert_int_equal(f.patches, 2);
	assert_string_equal(f.surface_name[f.patch_surface[1]], "Lämpchen");
	assert_int_equal(f.scene.patch_sides[0], 3);
	assert_int_equal(f.scene.patch_sides[1], 1);
	SAME(f.scene.patch_area, model.patch.area, 2);
	file_ff_close(&f);
}

/* What a block holds, whatever its words are. */
static void expect_block(const struct ff *f, uint64_t block, const uint32_t *column,
                         const float *value, uint32_t n)
{
	struct ff_span s;
	uint32_t i = 0;

	for (struct ff_cursor c = ff_begin(f, block); ff_next(&c, &s);)
		for (uint32_t k = 0; k < s.count; k++, i++) {
			assert_that(i, <, n);
			assert_int_equal(s.column + 2 * k, column[i]);
			assert_that(ff_value(f, s.entry + k), ==, (double)value[i]);
		}
	assert_int_equal(i, n);
}

static void test_lists_and_spans(void **state)
{
	struct ff_file f;
	struct err e = { 0 };

	(void)state;
	write_ff();
	must(file_ff_open(ff_path, &model, NULL, &f, &e), &e);
	for (uint64_t b = 0; b < ff.block.n; b++) {
		given("b %d", (int)b);
		const uint64_t *start = ff.block.start + b;
		expect_block(&ff, b, ff.column + start[0], ff.value + start[0],
		             (uint32_t)(start[1] - start[0]));
		expect_block(&f.f, b, ff.column + start[0], ff.value + start[0],
		             (uint32_t)(start[1] - start[0]));
	}
	file_ff_close(&f);
}

/* Elements 0 and 1 are patch 0, element 2 is patch 1. */
static void test_ff_to_patches(void **state)
{
	const uint32_t one[] = { 1, 2 }, sum[] = { 0, 2 };
	const float same[] = { .25f, .25f }, summed[] = { .25f, .125f };
	struct ff_file f;
	struct err e = { 0 };

	(void)state;
	must(try_write_ff(&ff, 1, &e), &e);
	must(file_ff_open(ff_path, &model, NULL, &f, &e), &e);
	assert_int_equal(f.f.to_patches, 1);
	assert_int_equal(f.f.entries, 6);
	expect_block(&f.f, 0, one, same, 2);
	expect_block(&f.f, 3, sum, summed, 2);
	file_ff_close(&f);
}

static void test_ff_of_another_geometry(void **state)
{
	struct cache_info ids = { 0 };
	struct ff_file f;
	struct err e = { 0 };

	(void)state;
	write_ff();
	model.vertex[0] = 1e-9;
	file_cache_ids(&model, &ids);
	model.vertex[0] = 0;
	assert_int_equal(file_ff_open(ff_path, &model, &ids, &f, &e), -1);
	assert_non_null(strstr(e.text, "a.ff: made for another geometry; run ffcalc again"));
}

/* ---- ids ---- */

static void ids_after(double *where, double value, struct cache_info *i)
{
	double old = *where;

	*where = value;
	file_cache_ids(&model, i);
	*where = old;
}

static void test_ids(void **state)
{
	struct cache_info a = { 0 }, b = { 0 };

	(void)state;
	file_cache_ids(&model, &a);
	ids_after(&model.material.rho_d[0], .4, &b); /* repainted */
	assert_string_equal(a.geometry_id, b.geometry_id);
	assert_string_not_equal(a.material_id, b.material_id);
	ids_after(&model.material.rho_s[0], 0, &b); /* still glossy in other bands */
	assert_string_equal(a.geometry_id, b.geometry_id);
	ids_after(&model.material.alpha[0], 21, &b);
	assert_string_not_equal(a.geometry_id, b.geometry_id);
	ids_after(&model.material.alpha[2], 21, &b); /* of a coefficient that is 0 */
	assert_string_equal(a.geometry_id, b.geometry_id);
	ids_after(&model.camera[0].yfov, .8, &b);
	assert_string_equal(a.geometry_id, b.geometry_id);
	assert_string_equal(a.material_id, b.material_id);
	assert_string_not_equal(a.camera_id, b.camera_id);
	model.lobe = LOBE_RECIPROCAL;
	file_cache_ids(&model, &b);
	model.lobe = LOBE_PAPER;
	assert_string_not_equal(a.geometry_id, b.geometry_id);
}

/* ---- models that are refused ---- */

static void refuse_model(const char *message)
{
	struct err e = { 0 };

	if (!model_check(&model, &e) || !strstr(e.text, message))
		fail_msg("'%s' instead of '%s'", e.set ? e.text : "accepted", message);
}

static void refuse_double(double *where, double value, const char *message)
{
	double old = *where;

	*where = value;
	refuse_model(message);
	*where = old;
}

static void refuse_uint(uint32_t *where, uint32_t value, const char *message)
{
	uint32_t old = *where;

	*where = value;
	refuse_model(message);
	*where = old;
}

static void refuse_int(int32_t *where, int32_t value, const char *message)
{
	int32_t old = *where;

	*where = value;
	refuse_model(message);
	*where = old;
}

static void test_refused_models(void **state)
{
	struct materials *mt = &model.material;
	struct err e = { 0 };

	(void)state;
	must(model_check(&model, &e), &e);
	refuse_double(&mt->rho_d[1], .7, "material 'glossy', front, band 1: they sum to 1.075");
	refuse_double(&mt->rho_d[4], -.1, "material_rho_d: material 'glossy', back, band 1");
	refuse_double(&mt->tau_s[0], (double)NAN, "array material_tau_s: material 'glossy'");
	refuse_double(&mt->alpha[1], -1, "array material_alpha: material 'glossy', back");
	refuse_double(&mt->beta[0], (double)NAN, "array material_beta");
	refuse_double(&mt->emission[6], (double)INFINITY, "array material_emission: material 'lamp");
	refuse_double(&mt->emission_exponent[2], (double)INFINITY, "material_emission_exponent");
	refuse_double(&mt->tau_d[6], .1, "one-sided but transmits");
	refuse_double(&model.vertex[4], (double)NAN, "array vertex: value 4 is nan");
	refuse_double(&model.light.cone[0], .75, "array light_cone: light 'spot': 0.75, 0.5");
	refuse_double(&model.light.cone[1], 2, "array light_cone: light 'spot': 0.25, 2");
	refuse_double(&model.light.direction[0], 1, "array light_direction: light 'spot': length");
	refuse_double(&model.light.position[0], NAN, "array light_position: light 'spot'");
	refuse_double(&model.light.intensity[1], -1, "array light_intensity: light 'spot', band 1");
	refuse_double(&model.camera[0].yfov, 4, "array camera_yfov: camera 'near'");
	refuse_double(&model.camera[0].yfov, 0, "array camera_yfov: camera 'near'");
	refuse_double(&model.camera[1].xmag, 0, "camera_xmag, camera_ymag: camera 'far'");
	refuse_double(&model.camera[0].to_world[0], 2, "array camera_to_world: camera 'near'");
	refuse_double(&model.camera[0].to_world[12], (double)NAN, "array camera_to_world");
	refuse_uint(&model.triangle.corner[5], 5, "array triangle: value 5 is 5, which must be below 5");
	refuse_uint(&model.element.corner[0], 99, "array element: value 0 is 99");
	refuse_uint(&model.element.corner[0], 4, "array element: element 0 has area 0");
	refuse_uint(&model.surface.material[0], 2, "array surface_material");
	refuse_uint(&model.triangle.surface[1], 2, "array triangle_surface");
	refuse_uint(&model.triangle.surface[1], 0, "patch 1 holds element 2 of another surface");
	refuse_uint(&model.element.triangle[0], 1, "array element_triangle: the tree of");
	refuse_uint(&model.patch.start[1], 3, "array patch_start: patch 1 has no elements");
	refuse_uint(&model.patch.start[1], 4000000000u, "array patch_start: patch");
	refuse_uint(&model.patch.start[2], 2, "array patch_start: it runs from 0 to 2");
	refuse_uint(&model.patch.surface[0], 7, "array patch_surface");
	refuse_uint(&model.patch.loop_index[3], 5, "array loop_index");
	refuse_int(&model.triangle.split[0], 1, "leads to split 1 of 1");
	refuse_int(&model.triangle.split[1], ~3, "leads to element 3 of 3");
	refuse_int(&model.triangle.split[1], ~0, "element 0 is reached twice");
	refuse_int(&model.triangle.split[1], INT32_MIN, "leads to element 2147483647");
	refuse_int(&model.split[0].child[0], 0, "split 0 is reached twice");
	refuse_int(&model.split[0].edge, 3, "split 0 has edge 3");
	model.patch.loop_start[1] = 2;
	refuse_model("array loop_start: it runs from 0 to 2");
	model.patch.loop_start[1] = 4;
	char *name = model.surface.name[0];
	model.surface.name[0] = model.surface.name[1];
	refuse_model("names of surfaces: 'Lämpchen' is there twice");
	model.surface.name[0] = name;
}

static void test_bad_model_is_not_written(void **state)
{
	struct err e = { 0 };
	struct stat before, after;

	(void)state;
	write_mesh();
	assert_int_equal(stat(mesh_path, &before), 0);
	model.vertex[0] = (double)NAN;
	assert_int_equal(file_mesh_write(mesh_path, &model, &info, &e), -1);
	model.vertex[0] = 0;
	assert_non_null(strstr(e.text, "a.mesh: cannot write: array vertex: value 0 is nan"));
	assert_int_equal(stat(mesh_path, &after), 0);
	assert_int_equal(before.st_ino, after.st_ino);
	e.set = 0;
	solution.irradiance.direct[3] = (double)INFINITY;
	assert_int_equal(file_rad_write(rad_path, &model, &solution, &info, &e), -1);
	solution.irradiance.direct[3] = 1.5;
	assert_non_null(strstr(e.text, "a.rad: cannot write: array irradiance_direct: value 3"));
}

/* ---- form factors that are refused ---- */

/* Writes the file again with bytes of an array or a metadata string replaced, and
 * digests that fit. */
static void forge(const char *path, const char *name, size_t at, const void *value, size_t bytes)
{
	struct err e = { 0 };
	struct container *c = file_container_open(path, NULL, &e);
	struct container_writer *w = file_container_create(path, &e);

	assert_true(c && w);
	for (size_t i = 0; i < file_container_metas(c); i++) {
		const char *text, *key = file_container_meta_at(c, i, &text);
		if (strncmp(key, "digest.", 7))
			must(file_container_meta(w, key, strcmp(key, name) ? text : value, &e), &e);
	}
	for (size_t i = 0; i < file_container_arrays(c); i++) {
		const struct container_view *v = file_container_at(c, i);
		size_t size = v->count * file_dtype_size(v->type);
		char *data = copy(v->data, size);
		if (strcmp(v->name, name) == 0) {
			assert_that(at + bytes, <=, size);
			memcpy(data + at, value, bytes);
		}
		must(file_container_put(w, v->name, v->type, v->dims, v->shape, data, &e), &e);
		free(data);
	}
	must(file_container_finish(w, &e), &e);
	file_container_close(c);
}

static void refuse_forged(const char *name, size_t at, const void *value, size_t bytes,
                          const char *message)
{
	struct ff_file f;
	struct err e = { 0 };

	write_ff();
	forge(ff_path, name, at, value, bytes);
	if (!file_ff_open(ff_path, NULL, NULL, &f, &e) || !strstr(e.text, message))
		fail_msg("'%s' instead of '%s'", e.set ? e.text : "accepted", message);
	assert_non_null(strstr(e.text, "; run ffcalc again"));
}

#define FORGE(array, i, type, value, message) \
	refuse_forged(array, (i) * sizeof(type), &(type){ value }, sizeof(type), message)

static void test_forged_form_factors(void **state)
{
	(void)state;
	FORGE("block_start", 1, uint64_t, 1000, "array block_start");
	FORGE("block_start", 4, uint64_t, 5, "array column: value 4 is 3, with which block 3 has more");
	FORGE("block_column", 0, uint64_t, 2 * 5, "array block_column: block 0 ends beyond the last");
	FORGE("block_column", 1, uint64_t, 2 * 7, "array block_column: block 1 begins beyond the last");
	FORGE("block_column", 3, uint64_t, 2 * 5 + 1, "array block_column: block 3 ends beyond the last");
	FORGE("block_column", 4, uint64_t, UINT64_MAX, "array block_column: block 4 begins beyond");
	FORGE("column", 3, uint16_t, 6, "array column: value 3 is 6, which must be below 6");
	FORGE("column", 3, uint16_t, 2, "array column: value 4 is 3, with which 3 columns end beyond");
	FORGE("column", 4, uint16_t, 0, "array column: value 4 is 0 and counts columns");
	FORGE("column", 4, uint16_t, UINT16_MAX, "array column: value 4 is 65535, with which");
	FORGE("column", 4, uint16_t, 2, "array block_column: block 3 ends beyond the last column");
	refuse_forged("receivers", 0, "walls", 0, "metadata receivers: walls, neither elements");
	refuse_forged("receivers", 0, "patches", 0, "array column: value 1 is 4, which must be below 4");
	refuse_forged("version", 0, "1", 0, "version 1, this program knows version 5");
}

static void refuse_ff(void *where, const void *value, size_t bytes, const char *message)
{
	unsigned char old[8];
	struct ff_file f;
	struct err e = { 0 };

	memcpy(old, where, bytes);
	memcpy(where, value, bytes);
	must(try_write_ff(&ff, 0, &e), &e);
	memcpy(where, old, bytes);
	if (!file_ff_open(ff_path, NULL, NULL, &f, &e) || !strstr(e.text, message))
		fail_msg("'%s' instead of '%s'", e.set ? e.text : "accepted", message);
	assert_non_null(strstr(e.text, "a.ff: array "));
	assert_non_null(strstr(e.text, "; run ffcalc again"));
}

#define REFUSE(where, type, value, message) \
	refuse_ff(&(where), &(type){ value }, sizeof(type), message)

static void test_refused_form_factors(void **state)
{
	(void)state;
	REFUSE(ff.value[0], float, .3125f, "array value: row 0 sums to 1.0625 instead of 1");
	REFUSE(ff.value[1], float, -1, "array value: value 1 is -1");
	REFUSE(ff.value[2], float, (float)NAN, "array value: value 2 is nan");
	REFUSE(ff.column[0], uint32_t, 6, "array column: value 0 is 6");
	REFUSE(ff.column[1], uint32_t, 1, "array column: value 1 is out of order");
	REFUSE(ff.column[1], uint32_t, 0, "array column: value 1 is out of order");
	REFUSE(ff.row.scale[3], double, 0, "array row_scale: value 3 is 0");
	REFUSE(ff.row.error[0], float, -1, "array row_error");
	REFUSE(ff.row.residual[0], float, (float)NAN, "array row_residual");
	REFUSE(ff.row.side[1], uint32_t, 4, "array row_side: row 1 leaves patch 2");
	REFUSE(ff.row.kind[1], uint8_t, 5, "array row_kind: value 1 is 5");
	REFUSE(ff.row.kind[1], uint8_t, 4, "array row_side: row 1 leaves source 1, which is no light");
	REFUSE(ff.row.block[1], uint64_t, 0, "array row_block");
	REFUSE(ff.row.block[1], uint64_t, UINT64_MAX, "array row_block");
	REFUSE(ff.block.arrival[1], uint64_t, 2, "array block_arrival");
	REFUSE(ff.block.chain[0], uint32_t, 1, "array block_chain: row 0 does not begin");
	REFUSE(ff.block.chain[1], uint32_t, 0, "array block_chain: block 1 is out of order");
	REFUSE(ff.block.chain[1], uint32_t, 2, "array block_chain: value 1 is 2");
	REFUSE(ff.block.escape[1], double, -1, "array block_escape");
	REFUSE(ff.chain.event[0], uint32_t, 8, "array chain_event");
	REFUSE(ff.chain.count[0], uint32_t, 0, "array chain_count");
	REFUSE(ff.chain.start[1], uint64_t, 1, "chain 0 is not empty");
	REFUSE(ff.arrival.target[0], uint32_t, 4, "array arrival_target");
	REFUSE(ff.arrival.direction[0], float, 1, "array arrival_direction");
	REFUSE(ff.link.source[0], uint32_t, 5, "array link_source");
	REFUSE(ff.link.chain[0], uint32_t, 2, "array link_chain");
	REFUSE(ff.link.target[0], uint32_t, 1, "array link_row: link 0 has row 3");
	REFUSE(ff.patch_end, uint32_t, 3, "array part: patches 0 to 3 of 2");
	REFUSE(ff.shard, uint32_t, 2, "array part: part 2 of 1");
}

/* ---- damaged files ---- */

static int read_file(const char *path, struct err *e)
{
	struct model m = { 0 };
	struct solution s = { 0 };
	struct cache_info i = { 0 };
	struct ff_file f;
	int failed;

	if (path == ff_path) {
		failed = file_ff_open(path, NULL, NULL, &f, e);
		if (!failed)
			file_ff_close(&f);
		return failed;
	}
	failed = path == mesh_path ? file_mesh_read(path, &m, &i, e)
	                           : file_rad_read(path, &m, &s, &i, e);
	model_free(&m);
	solution_free(&s);
	file_cache_info_free(&i);
	return failed;
}

static void damage(const char *path)
{
	struct stat st;
	uint64_t header;
	int fd = open(path, O_RDWR);

	assert_int_equal(fstat(fd, &st), 0);
	assert_int_equal(pread(fd, &header, 8, 0), 8);
	for (off_t i = 0; i < st.st_size; i++) {
		unsigned char good, bad;
		struct err e = { 0 };
		assert_int_equal(pread(fd, &good, 1, i), 1);
		bad = good ^ (unsigned char)(1u << i % 8);
		assert_int_equal(pwrite(fd, &bad, 1, i), 1);
		if (!read_file(path, &e))
			fail_msg("%s: flipped byte %ld was accepted", path, (long)i);
		assert_int_equal(strncmp(e.text, path, strlen(path)), 0);
		if ((uint64_t)i >= 8 + header)
			assert_non_null(strstr(e.text, "array "));
		assert_int_equal(pwrite(fd, &good, 1, i), 1);
	}
	for (off_t n = st.st_size - 1; n >= 0; n -= 1 + n % 3) {
		struct err e = { 0 };
		assert_int_equal(ftruncate(fd, n), 0);
		assert_int_equal(read_file(path, &e), -1);
	}
	close(fd);
}

static void test_damaged(void **state)
{
	(void)state;
	write_mesh();
	damage(mesh_path);
	write_rad();
	damage(rad_path);
	write_ff();
	damage(ff_path);
}

static void test_wrong_kind(void **state)
{
	struct model m = { 0 };
	struct cache_info i = { 0 };
	struct err e = { 0 };

	(void)state;
	write_rad();
	assert_int_equal(file_mesh_read(rad_path, &m, &i, &e), -1);
	assert_non_null(strstr(e.text, "this is a twopass.rad file; a twopass.mesh file"));
}

/* The ids are computed from what is written, so a stranger's are noticed. */
static void test_foreign_ids(void **state)
{
	struct err e = { 0 };
	struct cache_info ids = { 0 };
	struct model m = { 0 };
	struct container_writer *w = file_container_create(mesh_path, &e);

	(void)state;
	model.vertex[0] = 1e-9;
	file_cache_ids(&model, &ids);
	model.vertex[0] = 0;
	must(file_mesh_put_model(w, &model, &e), &e);
	must(file_cache_write_info(w, "twopass.mesh", &ids, &e), &e);
	must(file_container_finish(w, &e), &e);
	assert_int_equal(file_mesh_read(mesh_path, &m, &ids, &e), -1);
	assert_non_null(strstr(e.text, "metadata geometry_id: not that of the arrays"));
}

/* Moving a camera leaves what later files bind to; painting does not. */
static void test_digest(void **state)
{
	char a[33], b[33], d[33];
	struct err e = { 0 };

	(void)state;
	write_mesh();
	struct container *c = file_container_open(mesh_path, NULL, &e);
	file_container_digest(c, a);
	file_container_close(c);
	model.camera[0].to_world[12] = 3;
	write_mesh();
	c = file_container_open(mesh_path, NULL, &e);
	file_container_digest(c, b);
	file_container_close(c);
	model.camera[0].to_world[12] = 0;
	model.material.rho_d[0] = .4;
	write_mesh();
	c = file_container_open(mesh_path, NULL, &e);
	file_container_digest(c, d);
	file_container_close(c);
	model.material.rho_d[0] = .5;
	assert_string_equal(a, b);
	assert_string_not_equal(a, d);
}

/* The manual's reader and the manual's tables, against all three files. */
static void test_python(void **state)
{
	char command[512];
	const char *files[] = { mesh_path, ff_path, rad_path };

	(void)state;
	if (access("tests/independent/check_formats.py", R_OK))
		skip(); /* not run from the top of the source */
	write_mesh();
	write_ff();
	write_rad();
	snprintf(command, sizeof command, "/usr/bin/python3 tests/independent/check_formats.py man %s %s %s",
	         files[0], files[1], files[2]);
	assert_int_equal(system(command), 0);
	for (int i = 0; i < 3; i++) {
		given("%s", files[i]);
		snprintf(command, sizeof command, "/usr/bin/python3 tests/independent/read_cache.py %s | "
		         "grep '^%s [FU]' > /dev/null", files[i], i == 1 ? "value" : "vertex");
		assert_int_equal(system(command), 0);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_mesh),
		cmocka_unit_test(test_rad),
		cmocka_unit_test(test_ff),
		cmocka_unit_test(test_lists_and_spans),
		cmocka_unit_test(test_ff_to_patches),
		cmocka_unit_test(test_ff_of_another_geometry),
		cmocka_unit_test(test_ids),
		cmocka_unit_test(test_refused_models),
		cmocka_unit_test(test_bad_model_is_not_written),
		cmocka_unit_test(test_refused_form_factors),
		cmocka_unit_test(test_forged_form_factors),
		slow_unit_test(test_damaged),
		cmocka_unit_test(test_wrong_kind),
		cmocka_unit_test(test_foreign_ids),
		cmocka_unit_test(test_digest),
		cmocka_unit_test(test_python),
	};

	return cmocka_run_group_tests(tests, set_up, tear_down);
}
