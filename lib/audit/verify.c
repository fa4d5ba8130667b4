#include "lib/audit/verify.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/audit/patch_matrix.h"
#include "lib/base/mem.h"
#include "lib/scatter/bsdf.h"

static void add(struct verify *v, const char *name, const char *unit, double value,
                double limit)
{
	v->item[v->n++] = (struct verify_item){ name, unit, value, limit };
}

/* ---- form factors ---- */

/* Of a flow A F: what float32 values of the file (6e-8 each) and row scales leave at most; a
 * guess. */
static const double float_rounding = 1e-6;

/* How often a law may seem to be broken by chance, over all pairs of a file. */
static const double chance = .01;

/* What rows may miss 1 by after scaling, which is to 1e-12, and elements the ledger, over what
 * is emitted: float32 values summed in another order. Guesses with room for large scenes. */
static const double closure_limit = 1e-9, elements_limit = 1e-9;

/* What the ledger may miss, over what is emitted: rounding in float64 alone, which `shoot` prints
 * as residual. A guess with room for it. */
static const double ledger_limit = 1e-13;

/* Diffuse form factors between patch-sides, one sparse row for each side. */
struct pairs {
	struct patch_matrix pm;
	const struct ff_scene *scene;
	uint64_t *start;   /* [sides+1] */
	struct array column; /* uint32_t, ascending in a row */
	struct array value;  /* double */
};

/* Entries come ordered by patch-side: equal columns are neighbours. */
static int sum_entry(struct pairs *p, uint64_t first, uint32_t at, double value, struct err *e)
{
	uint32_t *column = p->column.data;

	if (at == FF_NO_ROW)
		return 0;
	if (p->column.n > first && column[p->column.n - 1] == at) {
		((double *)p->value.data)[p->value.n - 1] += value;
		return 0;
	}
	return mem_append(&p->column, &at, 1, sizeof at, e) ||
	       mem_append(&p->value, &value, 1, sizeof value, e) ? -1 : 0;
}

static int sum_row(struct pairs *p, uint32_t r, struct err *e)
{
	const struct ff *f = p->pm.f;
	const uint64_t first = p->column.n;
	struct ff_span s;

	for (struct ff_cursor c = ff_begin(f, f->row.block[r]); ff_next(&c, &s);)
		for (uint32_t k = 0; k < s.count; k++)
			if (sum_entry(p, first, p->pm.place[s.column + 2 * k],
			              f->row.scale[r] * ff_value(f, s.entry + k), e))
				return -1;
	return 0;
}

static int pairs_init(struct pairs *p, const struct ff *f, const struct ff_scene *s,
                      struct err *e)
{
	*p = (struct pairs){ .scene = s };
	if (ff_patch_matrix_init(&p->pm, f, s, e) ||
	    !(p->start = mem_new(p->pm.sides + 1, sizeof *p->start, "patch pairs", e)))
		return -1;
	for (size_t i = 0; i < p->pm.sides; i++) {
		uint32_t r = p->pm.row[i];
		if (r != FF_NO_ROW && f->row.kind[r] != FF_DIFFUSE)
			p->pm.row[i] = r = FF_NO_ROW; /* lobes are not reciprocal */
		if (r != FF_NO_ROW && sum_row(p, r, e))
			return -1;
		p->start[i + 1] = p->column.n;
	}
	return 0;
}

static void pairs_free(struct pairs *p)
{
	ff_patch_matrix_free(&p->pm);
	free(p->start);
	free(p->column.data);
	free(p->value.data);
}

/* F from side i to side j, and whether an entry for it is stored. */
static double find_pair(const struct pairs *p, size_t i, uint32_t j, int *there)
{
	const uint32_t *column = p->column.data;
	uint64_t low = p->start[i], high = p->start[i + 1];

	while (low < high) {
		uint64_t middle = low + (high - low) / 2;
		if (column[middle] < j)
			low = middle + 1;
		else
			high = middle;
	}
	*there = low < p->start[i + 1] && column[low] == j;
	return *there ? ((const double *)p->value.data)[low] : 0;
}

static double area(const struct pairs *p, size_t i)
{
	return p->scene->patch_area[p->pm.side[i] >> 1];
}

/* Variance of A F for any one receiver: at most that of the whole row, never below
 * what float32 values leave. */
static double variance(const struct pairs *p, size_t i, double flow)
{
	double error = area(p, i) * (double)p->pm.f->row.error[p->pm.row[i]];
	double rounding = float_rounding * flow;

	return error * error + rounding * rounding;
}

/* The number of standard errors that n normal values all stay within in 99 of 100
 * cases: n erfc(z / sqrt 2) = chance. By bisection: erfc(40 / sqrt 2) is below any 1 / n, and 60
 * halvings leave all bits of a double. */
static double family_z(double n)
{
	double low = 0, high = 40;

	for (int i = 0; i < 60; i++) {
		double z = (low + high) / 2;
		if (n * erfc(z / sqrt(2.)) > chance)
			low = z;
		else
			high = z;
	}
	return high;
}

struct reciprocity {
	double worst;             /* |A_i F_ij - A_j F_ji| in standard errors */
	double squares, expected; /* summed over all pairs: found, and stated */
	double pairs;
};

static void compare_pair(const struct pairs *p, size_t i, size_t j, double ij, double ji,
                         struct reciprocity *r)
{
	double a = area(p, i) * ij, b = area(p, j) * ji, flow = fmax(a, b);
	double z = fabs(a - b) / sqrt(variance(p, i, flow) + variance(p, j, flow));

	r->worst = fmax(r->worst, z);
	r->squares += (a - b) * (a - b);
	r->pairs++;
}

static void compare_pairs(const struct pairs *p, struct reciprocity *r)
{
	const uint32_t *column = p->column.data;
	const double *value = p->value.data;

	for (size_t i = 0; i < p->pm.sides; i++) {
		double largest = 0;
		for (uint64_t k = p->start[i]; k < p->start[i + 1]; k++) {
			size_t j = column[k];
			int there;
			if (p->pm.row[j] == FF_NO_ROW)
				continue;
			double back = find_pair(p, j, (uint32_t)i, &there);
			largest = fmax(largest, area(p, i) * value[k]);
			/* Every pair once: from its first side, or from the only entry. */
			if (i <= j || !there)
				compare_pair(p, i, j, value[k], back, r);
		}
		/* A row's stated error is the root of the sum over its receivers, and each
		 * difference has the variances of two rows. */
		if (p->start[i + 1] > p->start[i])
			r->expected += variance(p, i, largest);
	}
}

/* How far the sum of a row all by formula is from 1 before scaling, over the error it states and
 * rounding: the largest. */
static double worst_residual(const struct ff *f)
{
	double worst = 0;

	for (size_t r = 0; r < f->row.n; r++)
		if (f->row.samples[r] == 0)
			worst = fmax(worst, fabs((double)f->row.residual[r]) /
			                        ((double)f->row.error[r] + float_rounding));
	return worst;
}

static double worst_closure(const struct ff *f, double *residual)
{
	double worst = 0;

	*residual = 0;
	for (size_t r = 0; r < f->row.n; r++) {
		uint64_t b = f->row.block[r];
		double sum = f->block.escape[b] + f->block.black[b] + f->block.lost[b] +
		             f->block.cut[b];
		for (uint64_t k = f->block.start[b]; k < f->block.start[b + 1]; k++)
			sum += ff_value(f, k);
		worst = fmax(worst, fabs(1 - f->row.scale[r] * sum));
		*residual = fmax(*residual, fabs((double)f->row.residual[r]));
	}
	return worst;
}

int ff_verify(const struct ff *f, const struct ff_scene *s, struct verify *v, struct err *e)
{
	struct pairs p;
	struct reciprocity r = { 0 };
	double residual, closure = worst_closure(f, &residual);
	int failed = pairs_init(&p, f, s, e);

	*v = (struct verify){ 0 };
	if (!failed) {
		compare_pairs(&p, &r);
		add(v, "rows: closure after scaling", "", closure, closure_limit);
		add(v, "rows: residual before scaling", "", residual, (double)INFINITY);
		add(v, "rows by formula: residual", "of the stated error", worst_residual(f), 1);
	}
	if (!failed && r.pairs > 0) {
		add(v, "reciprocity: worst pair", "standard errors", r.worst, family_z(r.pairs));
		/* Near 1 for many pairs; a few scatter by chance, as do error estimates: 2 is a guess
		 * for these, 3 / sqrt(pairs) three standard deviations of a mean. */
		add(v, "reciprocity: all pairs", "of the stated error",
		    r.expected > 0 ? sqrt(r.squares / r.expected) : 0, 2 + 3 / sqrt(r.pairs));
	}
	pairs_free(&p);
	return failed ? -1 : 0;
}

/* ---- solutions ---- */

/* Unshot flux of a band, or the sum of its magnitudes. */
static double unshot(const struct solution *s, size_t band, int magnitude)
{
	const size_t bands = (size_t)s->bands, channels = solution_channels(s);
	const struct {
		const double *flux;
		size_t n, channels;
	} list[] = { { s->unshot.emission, s->sources, bands },
	             { s->unshot.diffuse, s->patch_sides, channels },
	             { s->unshot.link, 2 * s->links, channels } };
	double sum = 0;

	for (size_t k = 0; k < sizeof list / sizeof *list; k++)
		for (size_t i = 0; i < list[k].n; i++)
			for (size_t c = band; c < list[k].channels; c += bands) {
				double x = list[k].flux[i * list[k].channels + c];
				sum += magnitude ? fabs(x) : x;
			}
	return sum;
}

/* A term of the ledger for a band, all groups. */
static double ledger(const struct solution *s, int term, size_t band)
{
	double sum = 0;

	for (size_t g = 0; g < s->groups; g++)
		sum += s->ledger[((size_t)term * s->groups + g) * (size_t)s->bands + band];
	return sum;
}

/* Flux that the modelled sides of all elements absorb. */
static double absorbed(const struct model *m, const struct solution *s, int band)
{
	double sum = 0;

	for (size_t i = 0; i < s->element_sides; i++) {
		uint32_t material = model_patch_material(m, m->element.patch[i >> 1]);
		double a = bsdf_albedo(&m->material, material, (int)(i & 1), band);
		sum += m->element.area[i >> 1] * (1 - a) * solution_irradiance(s, i, band);
	}
	return sum;
}

static int all_two_sided(const struct model *m)
{
	for (size_t p = 0; p < m->patch.n; p++)
		if (m->material.one_sided[model_patch_material(m, (uint32_t)p)])
			return 0;
	return 1;
}

void solution_verify(const struct model *m, const struct solution *s, struct verify *v)
{
	const size_t bands = (size_t)s->bands;
	double residual = 0, missing = 0, left = 0;

	*v = (struct verify){ 0 };
	for (size_t b = 0; b < bands; b++) {
		double emitted = ledger(s, LEDGER_EMITTED, b), sum = unshot(s, b, 0);
		if (!(emitted > 0))
			continue;
		for (int term = LEDGER_ABSORBED; term < LEDGER_TERMS; term++)
			sum += ledger(s, term, b);
		double at_elements = ledger(s, LEDGER_ABSORBED, b) - absorbed(m, s, (int)b);
		residual = fmax(residual, fabs(emitted - sum) / emitted);
		left = fmax(left, unshot(s, b, 1) / emitted);
		/* Black backs absorb too, without an irradiance of their own. */
		missing = fmax(missing, (all_two_sided(m) ? fabs(at_elements) : -at_elements) /
		                        emitted);
	}
	add(v, "ledger: emitted - absorbed - escaped - lost - cut - unshot", "of what is emitted",
	    residual, ledger_limit);
	add(v, "elements: absorbed flux against the ledger", "of what is emitted", missing, elements_limit);
	add(v, "unshot", "of what is emitted", left, (double)INFINITY);
}
