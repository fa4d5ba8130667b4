/* A certified bound on what unshot flux can still do.
 *
 * q_k(side) = the fraction of flux becoming unshot on a patch-side's arrival that is
 * unshot still after k further shots, for the worst way it can leave. It falls with
 * k, and unit flux is shot at most (q_0 + ... + q_{K-1}) / (1 - q_K) times more, with
 * the largest q over all sides, once q_K < 1, since every K shots repeat the
 * argument. The first step alone gives the familiar 1 / (1 - a), a = the largest
 * albedo. A shot arrives once at its first landing and once more after each event that
 * its row follows: the largest number of arrivals a row makes multiplies the bound. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "mem.h"
#include "radiosity.h"
#include "send.h"

enum { STEPS = 64 };

struct tail {
	const struct transport *t;
	size_t bands, groups;
	double *in;           /* [blocks][bands] flux by each block of unit flux, over its sum */
	double *row;          /* [rows][bands] */
	lanes *q;             /* [2P][groups] */
	lanes *plain;         /* [2P][groups] the same without what lobes send on */
	double arrivals;      /* largest of a row */
	double bytes;         /* of runs read */
};

static void unit_rows(struct tail *x, struct sender *sender)
{
	const struct transport *t = x->t;
	double one[BANDS_MAX];

	for (size_t k = 0; k < BANDS_MAX; k++)
		one[k] = 1;
	for (uint32_t r = 0; r < t->rows; r++) {
		double *in = x->in + t->row_block[r] * x->bands, arrivals[BANDS_MAX] = { 0 };
		send_block_flux(sender, r, one, in);
		for (uint64_t b = t->row_block[r]; b < t->row_block[r + 1]; b++)
			for (size_t k = 0; k < x->bands; k++, in++) {
				arrivals[k] += *in;
				*in /= t->block[b].sum > 0 ? t->block[b].sum : 1;
				x->arrivals = fmax(x->arrivals, arrivals[k]);
			}
	}
}

/* What a block's runs make of unit flux by unit of value, for a vector of bands. */
static lanes block_step(const struct tail *x, uint64_t b, size_t group)
{
	const struct transport *t = x->t;
	lanes sum = { 0 };

	const struct block *block = &t->block[b];
	for (uint64_t i = block->run; i < block[1].run; i++) {
		int followed = i >= block->special &&
		               t->run_link[block->link + (i - block->special)] == RUN_FOLLOWED;
		sum += t->run_sum[i] * (followed ? x->plain : x->q)[t->run_target[i] * x->groups + group];
	}
	return sum;
}

static void rows_step(void *arg, size_t begin, size_t end, int thread)
{
	const struct tail *x = arg;
	const struct transport *t = x->t;

	(void)thread;
	for (size_t r = begin; r < end; r++) {
		double *row = x->row + r * x->bands;
		memset(row, 0, x->bands * sizeof *row);
		for (uint64_t b = t->row_block[r]; b < t->row_block[r + 1]; b++)
			for (size_t g = 0; g < x->groups; g++) {
				lanes sum = block_step(x, b, g);
				for (size_t k = g * LANES; k < x->bands && k < (g + 1) * LANES; k++)
					row[k] += x->in[b * x->bands + k] * sum[k % LANES];
			}
	}
}

/* Of flux arriving on a side, what is unshot again times what its rows make of it; `plain`
 * gets what that is without lobes. */
static double side_step(const struct tail *x, uint32_t ps, size_t k, double *plain)
{
	const struct transport *t = x->t;
	const struct materials *mt = &t->m->material;
	uint32_t material = model_patch_material(t->m, ps >> 1);
	size_t at = material_at(mt, material, (int)(ps & 1)) + k;
	double q = 0, lobe[2] = { 0, 0 };

	if (t->diffuse_row[ps] != FF_NO_ROW)
		q += mt->rho_d[at] * x->row[t->diffuse_row[ps] * x->bands + k];
	if (t->diffuse_row[ps ^ 1] != FF_NO_ROW)
		q += mt->tau_d[at] * x->row[t->diffuse_row[ps ^ 1] * x->bands + k];
	for (uint64_t l = 2 * t->target_link[ps]; l < 2 * t->target_link[ps + 1]; l++)
		if (t->link_row[l] != FF_NO_ROW)
			lobe[l & 1] = fmax(lobe[l & 1], x->row[t->link_row[l] * x->bands + k]);
	*plain = q;
	return q + mt->rho_s[at] * lobe[0] + mt->tau_s[at] * lobe[1];
}

static double albedo_shot(const struct transport *t, uint32_t ps, size_t k, double *plain)
{
	const struct materials *mt = &t->m->material;
	uint32_t material = model_patch_material(t->m, ps >> 1);
	int side = (int)(ps & 1);
	size_t at = material_at(mt, material, side) + k;

	*plain = mt->rho_d[at] + mt->tau_d[at];
	return *plain + (bsdf_has_lobe(mt, material, side, 0) ? mt->rho_s[at] : 0) +
	       (bsdf_has_lobe(mt, material, side, 1) ? mt->tau_s[at] : 0);
}

/* One step for all sides; the largest q. */
static double sides_step(struct tail *x, int first)
{
	const struct model *m = x->t->m;
	double top = 0;

	for (uint32_t ps = 0; ps < 2 * m->patches; ps++)
		for (size_t k = 0; k < x->bands; k++) {
			double *q = (double *)(x->q + ps * x->groups) + k;
			double *plain = (double *)(x->plain + ps * x->groups) + k;
			*q = *plain = 0;
			if (model_side_modelled(m, ps))
				*q = first ? albedo_shot(x->t, ps, k, plain)
				           : side_step(x, ps, k, plain);
			top = fmax(top, *q);
		}
	return top;
}

static double series(struct tail *x, int threads)
{
	double sum = 1, top = sides_step(x, 1);

	for (int k = 1; k < STEPS && top > .5; k++) {
		sum += top;
		par_for(x->t->rows, 64, threads, rows_step, x, NULL);
		x->bytes += (double)(x->t->runs * x->groups) *
		            (sizeof *x->t->run_target + sizeof *x->t->run_sum);
		top = sides_step(x, 0);
	}
	return top < 1 ? sum / (1 - top) * x->arrivals : INFINITY;
}

double radiosity_tail_bound(const struct transport *t, int threads, double *bytes)
{
	struct err e = { 0 };
	struct sender sender;
	size_t bands = (size_t)t->m->bands;
	struct tail x = { .t = t, .bands = bands, .groups = lanes_groups(t->m->bands),
	                  .arrivals = 1 };
	void *room[2];
	double bound = INFINITY;

	x.in = mem_new(t->blocks, bands * sizeof(double), "bound", &e);
	x.row = mem_new(t->rows, bands * sizeof(double), "bound", &e);
	x.q = lanes_new(2 * t->m->patches * x.groups, &room[0], "bound", &e);
	x.plain = lanes_new(2 * t->m->patches * x.groups, &room[1], "bound", &e);
	if (sender_init(&sender, t, &e) == 0 && x.in && x.row && x.q && x.plain) {
		unit_rows(&x, &sender);
		bound = series(&x, threads);
		*bytes += x.bytes;
	}
	sender_free(&sender);
	free(x.in);
	free(x.row);
	free(room[0]);
	free(room[1]);
	return bound;
}
