#include "tools/common/print_ff.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/container/atomic_file.h"
#include "formats/picture/npy_file.h"
#include "lib/audit/patch_matrix.h"
#include "lib/base/mem.h"

void print_csv(const char *text, const char *after)
{
	if (!text[strcspn(text, ",\"\n\r")]) {
		printf("%s%s", text, after);
		return;
	}
	putchar('"');
	for (; *text; text++)
		printf(*text == '"' ? "\"%c" : "%c", *text);
	printf("\"%s", after);
}

/* ---- the matrix between patch-sides ---- */

static void print_matrix_line(double *row, const struct patch_matrix *pm, double black,
                              double escape)
{
	for (size_t k = 0; k < pm->sides; k++)
		printf(",%.17g", row[k]);
	if (pm->unmodelled)
		printf(",%.17g", black);
	printf(",%.17g\n", escape);
}

/* Sides without a row (black ones, other parts) have a column but no line. */
static int csv_matrix(const struct ff_file *ff, const struct patch_matrix *pm, struct err *e)
{
	char **name = file_ff_side_names(ff, e);
	double black, escape, *row = mem_new(pm->sides, sizeof *row, "a row", e);
	int failed = !name || !row;

	printf("%s", failed ? "" : "from,");
	for (size_t k = 0; k < pm->sides && !failed; k++)
		print_csv(name[pm->side[k]], ",");
	if (!failed)
		printf("%sescape\n", pm->unmodelled ? "unmodelled," : "");
	for (size_t i = 0; i < pm->sides && !failed; i++) {
		if (pm->row[i] == FF_NO_ROW)
			continue;
		ff_patch_matrix_row(pm, i, row, &black, &escape);
		print_csv(name[pm->side[i]], "");
		print_matrix_line(row, pm, black, escape);
	}
	free(row);
	file_cache_names_free(name, 2 * ff->scene.patches);
	return failed ? -1 : 0;
}

/* The columns of the CSV and a row for each of them, NaN where it has no line. */
static int npy_matrix(const struct patch_matrix *pm, const char *path, struct err *e)
{
	const size_t columns = pm->sides + 1 + (size_t)pm->unmodelled;
	const uint64_t shape[] = { pm->sides, columns };
	struct atomic_file *f = file_atomic_create(path, e);
	double black, *row = mem_new(columns, sizeof *row, "a row", e);
	int failed = !f || !row || file_npy_begin(f, DT_F64, 2, shape, e);

	for (size_t i = 0; i < pm->sides && !failed; i++) {
		ff_patch_matrix_row(pm, i, row, &black, &row[columns - 1]);
		if (pm->unmodelled)
			row[columns - 2] = black;
		failed = file_atomic_write(f, row, columns * sizeof *row, e);
	}
	free(row);
	if (!failed)
		return file_atomic_finish(f, e);
	file_atomic_abandon(f);
	return -1;
}

int print_patch_matrix(const struct ff_file *ff, const char *npy, struct err *e)
{
	struct patch_matrix pm = { 0 };

	if (ff_patch_matrix_init(&pm, &ff->f, &ff->scene, e))
		return -1;
	int failed = npy ? npy_matrix(&pm, npy, e) : csv_matrix(ff, &pm, e);
	ff_patch_matrix_free(&pm);
	return failed;
}

/* ---- a row ---- */

/* A block's entries; a file to patches has no elements to name. */
static void print_entries(const struct ff_file *ff, char *const *name, uint32_t row, uint64_t b)
{
	const struct ff *f = &ff->f;
	const uint32_t *start = ff->scene.patch_start;
	uint32_t patch = 0;
	struct ff_span s;

	for (struct ff_cursor c = ff_begin(f, b); ff_next(&c, &s);)
		for (uint32_t k = 0; k < s.count; k++) {
			uint32_t column = s.column + 2 * k, receiver = column >> 1;
			if (!f->to_patches && receiver < start[patch])
				patch = 0; /* the back's entries of a patch follow the front's */
			while (!f->to_patches && receiver >= start[patch + 1])
				patch++;
			printf("%" PRIu32 ",", f->block.chain[b]);
			print_csv(name[f->to_patches ? column : 2 * patch + (column & 1)], ",");
			if (!f->to_patches)
				printf("%" PRIu32, receiver);
			printf(",%.17g", f->row.scale[row] * ff_value(f, s.entry + k));
			if (f->value_error)
				printf(",%.9g", (double)f->value_error[s.entry + k]);
			putchar('\n');
		}
}

static void print_block_lines(const struct ff_file *ff, char *const *name, uint32_t row,
                              uint64_t b)
{
	const struct ff *f = &ff->f;
	const struct {
		const char *where;
		double value;
	} rest[] = { { "escape", f->block.escape[b] }, { "black", f->block.black[b] },
	             { "lost", f->block.lost[b] }, { "cut", f->block.cut[b] } };

	print_entries(ff, name, row, b);
	for (size_t i = 0; i < sizeof rest / sizeof *rest; i++)
		if (rest[i].value > 0)
			printf("%" PRIu32 ",%s,,%.17g%s\n", f->block.chain[b], rest[i].where,
			       f->row.scale[row] * rest[i].value, f->value_error ? "," : "");
}

int print_ff_row(const struct ff_file *ff, uint32_t row, struct err *e)
{
	static const char *const kind[] = { "diffuse", "emission", "reflected", "transmitted",
	                                   "light" };
	const struct ff *f = &ff->f;
	const uint32_t source = f->row.side[row];
	char **name = file_ff_side_names(ff, e);

	if (!name)
		return -1;
	printf("row       %" PRIu32 "\nfrom      %s\nkind      %s\nsamples   %" PRIu32
	       "\nscale     %.17g\nresidual  %.17g\nerror     %.17g\n\n", row,
	       f->row.kind[row] == FF_LIGHT ? ff->light_name[source - 2 * ff->scene.patches]
	                                    : name[source], kind[f->row.kind[row]], f->row.samples[row],
	       f->row.scale[row], (double)f->row.residual[row], (double)f->row.error[row]);
	printf("chain,to,element,value%s\n", f->value_error ? ",error" : "");
	for (uint64_t b = f->row.block[row]; b < f->row.block[row + 1]; b++)
		print_block_lines(ff, name, row, b);
	file_cache_names_free(name, 2 * ff->scene.patches);
	return 0;
}
