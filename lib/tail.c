/* A certified bound on what unshot flux can still do.
 *
 * q_k(side) = the largest fraction, over bands, of flux arriving on a patch-side
 * that is still in flight after k further arrivals. It falls with k, and unit flux
 * arrives at most sum_k max q_k = (q_0 + ... + q_{K-1}) / (1 - q_K) more times once
 * q_K < 1, as every K arrivals repeat the argument. With a = max albedo < 1 the
 * first term alone gives the familiar 1 / (1 - a). */
#include <math.h>
#include <stdlib.h>

#include "bsdf.h"
#include "mem.h"
#include "radiosity.h"

enum { STEPS = 64 };

struct tail {
	const struct transport *t;
	double *row;          /* [rows] mean q of where a row's flux lands */
	double *q;            /* [2P] */
};

/* Ideal events keep flux inside a row: a bound on a row is its first landing's,
 * where light that goes on by a mirror counts in full. */
static void rows_step(struct tail *x)
{
	const struct transport *t = x->t;

	for (uint32_t r = 0; r < t->rows; r++) {
		uint64_t b = t->row_block[r];
		double sum = 0;
		for (uint64_t i = t->block[b].run; i < t->block[b + 1].run; i++)
			sum += t->run[i].sum * x->q[t->run[i].target];
		x->row[r] = t->block[b].sum > 0 ? sum / t->block[b].sum : 0;
	}
}

static double side_step(const struct tail *x, uint32_t ps, int band)
{
	const struct transport *t = x->t;
	const struct materials *mt = &t->m->material;
	uint32_t material = model_patch_material(t->m, ps >> 1);
	int side = (int)(ps & 1);
	size_t at = material_at(mt, material, side) + (size_t)band;
	double q = 0, lobe[2] = { 0, 0 };

	if (t->diffuse_row[ps] != FF_NO_ROW)
		q += mt->rho_d[at] * x->row[t->diffuse_row[ps]];
	if (t->diffuse_row[ps ^ 1] != FF_NO_ROW)
		q += mt->tau_d[at] * x->row[t->diffuse_row[ps ^ 1]];
	for (uint64_t l = 2 * t->target_link[ps]; l < 2 * t->target_link[ps + 1]; l++)
		if (t->link_row[l] != FF_NO_ROW)
			lobe[l & 1] = fmax(lobe[l & 1], x->row[t->link_row[l]]);
	for (int way = 0; way < 2; way++) {
		double c = (way ? mt->tau_s : mt->rho_s)[at];
		q += c * (bsdf_has_ideal(mt, material, side, way) ? 1 : lobe[way]);
	}
	return q;
}

static double sides_step(struct tail *x)
{
	const struct model *m = x->t->m;
	double top = 0;

	for (uint32_t ps = 0; ps < 2 * m->patches; ps++) {
		double q = 0;
		if (model_side_modelled(m, ps))
			for (int k = 0; k < m->bands; k++)
				q = fmax(q, side_step(x, ps, k));
		x->q[ps] = q;
		top = fmax(top, q);
	}
	return top;
}

double radiosity_tail_bound(const struct transport *t)
{
	struct err e = { 0 };
	struct tail x = { .t = t };
	double sum = 1, top = 1;

	x.row = mem_new(t->rows, sizeof *x.row, "bound", &e);
	x.q = mem_new(2 * t->m->patches, sizeof *x.q, "bound", &e);
	if (!x.row || !x.q) {
		free(x.row);
		free(x.q);
		return INFINITY;
	}
	for (uint32_t ps = 0; ps < 2 * t->m->patches; ps++)
		x.q[ps] = 1;
	for (int k = 0; k < STEPS && top > .5; k++) {
		rows_step(&x);
		top = sides_step(&x);
		if (top > .5)
			sum += top;
	}
	free(x.row);
	free(x.q);
	return top < 1 ? sum / (1 - top) : INFINITY;
}
