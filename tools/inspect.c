/* inspect: what is in a .mesh, .ff or .rad file, and whether it is right. */
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "formats/cache/array_stats.h"
#include "formats/cache/ff_file.h"
#include "formats/cache/mesh_file.h"
#include "formats/cache/rad_file.h"
#include "formats/picture/npy_file.h"
#include "lib/audit/side_table.h"
#include "lib/audit/verify.h"
#include "lib/base/mem.h"
#include "tools/common/cli.h"
#include "tools/common/print_ff.h"

enum { SHOWN = 60 }; /* bytes of a text that the overview shows: a line */

#define PATCH_MATRIX "patch-matrix"

struct request {
	const char *file, *npy, *output;
	int json, verify, csv, matrix;
	long row; /* negative: not asked for */
};

#define REQUEST struct request

static const struct option_spec options[] = {
	{ 'J', "json", NULL, "print JSON", FLAG(json) },
	{ 'V', "verify", NULL, "check digests, structure and physics; exit 1 if anything is wrong",
	  FLAG(verify) },
	{ 'c', "csv", NULL, "print a line for each element-side (.mesh, .rad)", FLAG(csv) },
	{ 'r', "row", "I", "print row I (.ff) or element-side I (.mesh, .rad)",
	  INTEGER(row, 0, UINT32_MAX) },
	{ 'p', PATCH_MATRIX, NULL, "print form factors between patch-sides as CSV (.ff)",
	  FLAG(matrix) },
	{ 'n', "npy", "ARRAY", "write ARRAY, or " PATCH_MATRIX ", as .npy", TEXT(npy) },
	{ 'o', "output", "FILE", "where --npy goes (default standard output)", TEXT(output) },
	{ 0 }
};

/* The file as its kind has it; the rest is zero. */
struct content {
	struct container *container;
	const char *format;
	struct model model;
	struct solution solution;
	struct ff_file ff;
	struct cache_info info;
};

static void check(const struct cli *c, int operand, struct request *r)
{
	if (c->argc - operand != 1)
		cli_usage(c, "one .mesh, .ff or .rad file is needed");
	r->file = c->argv[operand];
	if (r->csv + r->matrix + (r->row >= 0) + (r->npy != NULL) + (r->json || r->verify) > 1)
		cli_usage(c, "--json (with or without --verify), --csv, --row, --patch-matrix and "
		             "--npy are different outputs; ask for one");
	if (r->output && !r->npy)
		cli_usage(c, "--output is where --npy goes; redirect other output");
	if (r->npy && (!r->output || strcmp(r->output, "-") == 0) && isatty(STDOUT_FILENO))
		cli_usage(c, "--npy is binary; redirect it or give --output");
	cli_keep_input(c, r->output, r->file);
}

static void content_free(struct content *x)
{
	file_container_close(x->container);
	file_ff_close(&x->ff);
	solution_free(&x->solution);
	model_free(&x->model);
	file_cache_info_free(&x->info);
}

/* Reads the whole file with all checks that other tools make. */
static int read_content(const struct request *r, struct content *x, struct err *e)
{
	if (strcmp(x->format, "twopass.ff") == 0)
		return file_ff_open(r->file, NULL, NULL, &x->ff, e);
	if (strcmp(x->format, "twopass.rad") == 0)
		return file_rad_read(r->file, &x->model, &x->solution, &x->info, e);
	return file_mesh_read(r->file, &x->model, &x->info, e);
}

static int need_kind(const struct request *r, const struct content *x, const char *option,
                     int form_factors, struct err *e)
{
	if (form_factors == (strcmp(x->format, "twopass.ff") == 0))
		return 0;
	return err_set(e, "%s: this is a %s file; %s needs %s", r->file, x->format, option,
	               form_factors ? "form factors (.ff)" : "a .mesh or .rad file");
}

/* ---- overview ---- */

static int is_digest(const char *key)
{
	return strncmp(key, "digest.", 7) == 0;
}

/* Metadata that holds JSON text as JSON, else as a string. */
static json_t *meta_value(const char *value)
{
	json_t *nested = *value == '{' || *value == '[' ? json_loads(value, 0, NULL) : NULL;

	return nested ? nested : json_string(value);
}

/* JSON has no infinity and no NaN. */
static json_t *json_number(double x)
{
	return isfinite(x) ? json_real(x) : json_string(isnan(x) ? "nan" : x > 0 ? "inf" : "-inf");
}

static json_t *json_array_entry(const struct container_view *v)
{
	struct array_stats s;
	json_t *shape = json_array();

	file_array_stats(v, &s);
	for (int d = 0; d < v->dims; d++)
		json_array_append_new(shape, json_integer((json_int_t)v->shape[d]));
	return json_pack("{s:s, s:s, s:o, s:o, s:o, s:o, s:I}", "name", v->name, "dtype",
	                 file_dtype_name(v->type), "shape", shape, "min", json_number(s.min), "mean",
	                 json_number(s.mean), "max", json_number(s.max), "nans",
	                 (json_int_t)s.nans);
}

static json_t *json_overview(const struct container *c)
{
	json_t *meta = json_object(), *arrays = json_array();

	for (size_t i = 0; i < file_container_metas(c); i++) {
		const char *value, *key = file_container_meta_at(c, i, &value);
		if (!is_digest(key))
			json_object_set_new(meta, key, meta_value(value));
	}
	for (size_t i = 0; i < file_container_arrays(c); i++)
		json_array_append_new(arrays, json_array_entry(file_container_at(c, i)));
	return json_pack("{s:s, s:o, s:o}", "file", file_container_path(c), "metadata", meta, "arrays",
	                 arrays);
}

static int print_json(json_t *j)
{
	int failed = json_dumpf(j, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(17));

	json_decref(j);
	putchar('\n');
	return failed;
}

/* Indented under its key: each command of the history, or a value's JSON lines. */
static void print_block(const char *key, const char *text)
{
	printf("%s\n", key);
	while (*text) {
		int n = (int)strcspn(text, "\n");
		printf("    %.*s\n", n, text);
		text += n + (text[n] == '\n');
	}
}

/* Bytes of a list to print: SHOWN, less what would cut a UTF-8 character. */
static int shown(const char *text)
{
	size_t n = strlen(text) < SHOWN ? strlen(text) : SHOWN;

	while (n && ((unsigned char)text[n] & 0xc0) == 0x80)
		n--;
	return (int)n;
}

static void print_meta(const char *key, const char *value)
{
	json_t *j = meta_value(value);
	char *lines = json_is_string(j) ? NULL : json_dumps(j, JSON_INDENT(2) |
	                                                   JSON_REAL_PRECISION(17));

	if (json_is_array(j)) /* names, which may be many */
		printf("%-12s %zu: %.*s%s\n", key, json_array_size(j), shown(value), value,
		       strlen(value) > SHOWN ? " ..." : "");
	else if (lines || strcmp(key, "history") == 0)
		print_block(key, lines ? lines : value);
	else
		printf("%-12s %s\n", key, value);
	free(lines);
	json_decref(j);
}

static void print_array(const struct container_view *v)
{
	char shape[96] = "";
	size_t n = 0;
	struct array_stats s;

	for (int d = 0; d < v->dims; d++)
		n += (size_t)snprintf(shape + n, sizeof shape - n, "%s%" PRIu64, d ? "," : "[",
		                      v->shape[d]);
	snprintf(shape + n, sizeof shape - n, "%s", v->dims ? "]" : "[]");
	file_array_stats(v, &s);
	printf("%-28s %-3s %-16s %-24.17g %-24.17g %.17g\n", v->name, file_dtype_name(v->type), shape,
	       s.min, s.mean, s.max);
}

static void print_overview(const struct container *c)
{
	for (size_t i = 0; i < file_container_metas(c); i++) {
		const char *value, *key = file_container_meta_at(c, i, &value);
		if (!is_digest(key))
			print_meta(key, value);
	}
	printf("\n%-28s %-3s %-16s %-24s %-24s %s\n", "array", "", "shape", "min", "mean", "max");
	for (size_t i = 0; i < file_container_arrays(c); i++)
		print_array(file_container_at(c, i));
}

/* ---- verify ---- */

static int run_checks(const struct request *r, struct content *x, struct verify *v,
                      struct err *e)
{
	*v = (struct verify){ 0 };
	if (read_content(r, x, e))
		return -1;
	if (x->ff.container)
		return ff_verify(&x->ff.f, &x->ff.scene, v, e);
	if (x->solution.irradiance.direct)
		solution_verify(&x->model, &x->solution, v);
	return 0;
}

static json_t *json_checks(const struct verify *v)
{
	json_t *list = json_array();

	for (size_t i = 0; i < v->n; i++)
		json_array_append_new(list, json_pack("{s:s, s:s, s:o, s:o, s:b}", "name",
		                                      v->item[i].name, "unit", v->item[i].unit,
		                                      "value", json_number(v->item[i].value),
		                                      "limit", json_number(v->item[i].limit),
		                                      "good", verify_good(&v->item[i])));
	return list;
}

static void print_checks(const struct container *c, const struct verify *v)
{
	printf("digests, structure, ranges: good, %zu arrays\n", file_container_arrays(c));
	for (size_t i = 0; i < v->n; i++) {
		const struct verify_item *item = &v->item[i];
		printf("%s: %.17g%s%s", item->name, item->value, *item->unit ? " " : "",
		       item->unit);
		if (isfinite(item->limit))
			printf(" (at most %.3g): %s", item->limit,
			       verify_good(item) ? "good" : "BAD");
		putchar('\n');
	}
}

static int verify(const struct request *r, struct content *x, struct err *e)
{
	struct verify v;

	if (run_checks(r, x, &v, e))
		return -1;
	if (r->json) {
		json_t *j = json_overview(x->container);
		json_object_set_new(j, "verify", json_checks(&v));
		print_json(j);
	} else {
		print_checks(x->container, &v);
	}
	for (size_t i = 0; i < v.n; i++)
		if (!verify_good(&v.item[i]))
			return err_set(e, "%s: %s: %.3g %s is more than %.3g; compute it again, with "
			               "more samples if it is sampled", r->file, v.item[i].name,
			               v.item[i].value, v.item[i].unit, v.item[i].limit);
	return 0;
}

/* ---- CSV ---- */

static void csv_header(const struct model *m, int solved)
{
	printf("element,side,patch,name,material,area,cx,cy,cz,nx,ny,nz");
	for (int q = solved ? 0 : 2; q < 3; q++)
		for (int b = 0; b < m->bands; b++)
			printf(",%c_%d", "HME"[q], b);
	putchar('\n');
}

static void csv_line(const struct content *x, size_t element_side, int solved)
{
	const struct model *m = &x->model;
	struct side_row row;

	solution_side_row(m, solved ? &x->solution : NULL, element_side, &row);
	printf("%" PRIu32 ",%c,%" PRIu32 ",", row.element, "fb"[row.side], row.patch);
	print_csv(m->surface.name[row.surface], ",");
	print_csv(m->material.name[row.material], "");
	printf(",%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g", row.area, row.centre[0],
	       row.centre[1], row.centre[2], row.normal[0], row.normal[1], row.normal[2]);
	const double *quantity[] = { row.h, row.m, row.e };
	for (int q = solved ? 0 : 2; q < 3; q++)
		for (int b = 0; b < m->bands; b++)
			printf(",%.17g", quantity[q][b]);
	putchar('\n');
}

static int is_modelled(const struct model *m, size_t element_side)
{
	return model_side_modelled(m, 2 * m->element.patch[element_side >> 1] +
	                                  (uint32_t)(element_side & 1));
}

static int print_sides(const struct request *r, struct content *x, struct err *e)
{
	if (need_kind(r, x, r->csv ? "--csv" : "--row", 0, e) || read_content(r, x, e))
		return -1;
	const struct model *m = &x->model;
	size_t begin = r->csv ? 0 : (size_t)r->row, end = r->csv ? 2 * m->element.n : begin + 1;
	int solved = x->solution.irradiance.direct != NULL;
	if (end > 2 * m->element.n)
		return err_set(e, "%s: there is no element-side %zu; the last is %zu", r->file, begin,
		               2 * m->element.n - 1);
	if (!r->csv && !is_modelled(m, begin))
		return err_set(e, "%s: element-side %zu is not modelled; it is the black back of a "
		               "one-sided surface", r->file, begin);
	csv_header(m, solved);
	for (size_t i = begin; i < end; i++)
		if (is_modelled(m, i))
			csv_line(x, i, solved);
	return 0;
}

/* ---- form factors ---- */

static int patch_matrix(const struct request *r, struct content *x, struct err *e)
{
	if (need_kind(r, x, "--" PATCH_MATRIX, 1, e) || read_content(r, x, e))
		return -1;
	return print_patch_matrix(&x->ff, r->npy && !r->output ? "-" : r->output, e);
}

static int print_row(const struct request *r, struct content *x, struct err *e)
{
	if (read_content(r, x, e))
		return -1;
	if ((size_t)r->row >= x->ff.f.row.n)
		return err_set(e, "%s: there is no row %ld; the file has %zu", r->file, r->row,
		               x->ff.f.row.n);
	return print_ff_row(&x->ff, (uint32_t)r->row, e);
}

/* ---- */

static int write_npy(const struct request *r, const struct content *x, struct err *e)
{
	const struct container_view *v = file_container_find(x->container, r->npy);

	if (!v)
		return err_set(e, "%s: there is no array %s; inspect %s lists them", r->file, r->npy,
		               r->file);
	return file_container_verify(x->container, v, e) ||
	       file_npy_write(r->output ? r->output : "-", v, e) ? -1 : 0;
}

static int inspect(const struct request *r, struct content *x, struct err *e)
{
	int matrix = r->matrix || (r->npy && strcmp(r->npy, PATCH_MATRIX) == 0);

	if (!(x->container = file_container_open(r->file, NULL, e)))
		return -1;
	x->format = file_container_get_meta(x->container, "format");
	if (r->verify)
		return verify(r, x, e);
	if (matrix)
		return patch_matrix(r, x, e);
	if (r->npy)
		return write_npy(r, x, e);
	if (r->row >= 0 && strcmp(x->format, "twopass.ff") == 0)
		return print_row(r, x, e);
	if (r->csv || r->row >= 0)
		return print_sides(r, x, e);
	if (r->json)
		print_json(json_overview(x->container));
	else
		print_overview(x->container);
	return 0;
}

int main(int argc, char **argv)
{
	struct cli c = { .program = "inspect", .synopsis = "[options] FILE",
		.about = "Shows what is in a .mesh, .ff or .rad file, and whether it is right.",
		.options = options };
	struct request r = { .row = -1 };
	struct content x = { 0 };
	struct err e = { 0 };

	cli_signals();
	check(&c, options_parse(&c, argc, argv, &r), &r);
	int failed = inspect(&r, &x, &e);
	content_free(&x);
	return cli_finish(&c, failed ? cli_fail(&c, &e) : 0);
}
