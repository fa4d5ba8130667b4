#include "lib/audit/patch_matrix.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"

void ff_patch_matrix_free(struct patch_matrix *pm)
{
	free(pm->side);
	free(pm->row);
	free(pm->place);
	*pm = (struct patch_matrix){ 0 };
}

/* Numbers the modelled sides; column[2P] finds them again. */
static void number_sides(struct patch_matrix *pm, const struct ff_scene *s, uint32_t *column)
{
	for (uint32_t ps = 0; ps < 2 * s->patches; ps++) {
		column[ps] = FF_NO_ROW;
		if (!(s->patch_sides[ps >> 1] >> (ps & 1) & 1))
			continue;
		column[ps] = (uint32_t)pm->sides;
		pm->row[pm->sides] = FF_NO_ROW;
		pm->side[pm->sides++] = ps;
	}
	if (pm->f->to_patches) {
		memcpy(pm->place, column, 2 * s->patches * sizeof *column);
		return;
	}
	for (uint32_t p = 0; p < s->patches; p++)
		for (uint32_t e = s->patch_start[p]; e < s->patch_start[p + 1]; e++) {
			pm->place[2 * (size_t)e] = column[2 * (size_t)p];
			pm->place[2 * (size_t)e + 1] = column[2 * (size_t)p + 1];
		}
}

/* A side that emits by a lobe may have a diffuse row too, for what it reflects. */
static void choose_rows(struct patch_matrix *pm, const uint32_t *column)
{
	const struct ff *f = pm->f;

	for (uint32_t r = 0; r < f->row.n; r++) {
		if (f->row.kind[r] > FF_EMISSION)
			continue;
		uint32_t at = column[f->row.side[r]];
		if (at == FF_NO_ROW)
			continue;
		if (f->row.kind[r] == FF_DIFFUSE || pm->row[at] == FF_NO_ROW)
			pm->row[at] = r;
	}
	for (size_t i = 0; i < pm->sides; i++)
		if (pm->row[i] != FF_NO_ROW && f->block.black[f->row.block[pm->row[i]]] > 0)
			pm->unmodelled = 1;
}

int ff_patch_matrix_init(struct patch_matrix *pm, const struct ff *f, const struct ff_scene *s,
                         struct err *e)
{
	uint32_t *column = mem_new(2 * s->patches, sizeof *column, "patch-sides", e);

	*pm = (struct patch_matrix){ .f = f };
	pm->side = mem_new(2 * s->patches, sizeof *pm->side, "patch-sides", e);
	pm->row = mem_new(2 * s->patches, sizeof *pm->row, "patch-sides", e);
	pm->place = mem_new(2 * (f->to_patches ? s->patches : s->elements), sizeof *pm->place,
	                    "receivers", e);
	int failed = !column || !pm->side || !pm->row || !pm->place;
	if (!failed) {
		number_sides(pm, s, column);
		choose_rows(pm, column);
	}
	free(column);
	if (failed)
		ff_patch_matrix_free(pm);
	return failed ? -1 : 0;
}

void ff_patch_matrix_row(const struct patch_matrix *pm, size_t i, double *out,
                         double *unmodelled, double *escape)
{
	const struct ff *f = pm->f;
	const uint32_t r = pm->row[i];

	*unmodelled = *escape = (double)NAN;
	for (size_t k = 0; k < pm->sides; k++)
		out[k] = r == FF_NO_ROW ? (double)NAN : 0;
	if (r == FF_NO_ROW)
		return;
	const uint64_t b = f->row.block[r];
	*unmodelled = f->block.black[b];
	*escape = f->block.escape[b] + f->block.lost[b] + f->block.cut[b];
	struct ff_span s;
	for (struct ff_cursor c = ff_begin(f, b); ff_next(&c, &s);)
		for (uint32_t k = 0; k < s.count; k++) {
			uint32_t at = pm->place[s.column + 2 * k];
			double *to = at == FF_NO_ROW ? unmodelled : &out[at];
			*to += ff_value(f, s.entry + k);
		}
	for (size_t k = 0; k < pm->sides; k++)
		out[k] *= f->row.scale[r];
	*unmodelled *= f->row.scale[r];
	*escape *= f->row.scale[r];
}
