#include "send.h"

#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "mem.h"

/* How each patch-side splits the flux that arrives on it. */
static void fill_parts(struct sender *s)
{
	const struct materials *mt = &s->m->material;
	size_t bands = (size_t)s->bands;

	for (uint32_t ps = 0; ps < 2 * s->m->patches; ps++) {
		uint32_t material = model_patch_material(s->m, ps >> 1);
		int side = (int)(ps & 1);
		size_t at = material_at(mt, material, side);
		double *part = s->part + ps * 4 * bands;
		int lobe_r = bsdf_has_lobe(mt, material, side, 0);
		int lobe_t = bsdf_has_lobe(mt, material, side, 1);
		s->is_ideal[ps] = bsdf_has_ideal(mt, material, side, 0) ||
		                  bsdf_has_ideal(mt, material, side, 1);
		for (size_t k = 0; k < bands; k++) {
			part[k] = mt->rho_d[at + k];
			part[bands + k] = mt->tau_d[at + k];
			part[2 * bands + k] = (lobe_r ? mt->rho_s[at + k] : 0) +
			                      (lobe_t ? mt->tau_s[at + k] : 0);
			part[3 * bands + k] = 1 - bsdf_albedo(mt, material, side, (int)k);
		}
	}
}

int sender_init(struct sender *s, const struct transport *t, struct err *e)
{
	*s = (struct sender){ .t = t, .m = t->m, .bands = t->m->bands };
	s->chain_flux = mem_new(t->chains.n, (size_t)s->bands * sizeof(double), "chain flux", e);
	s->touched = mem_new(t->chains.n, sizeof *s->touched, "chain flux", e);
	s->is_touched = mem_new(t->chains.n, 1, "chain flux", e);
	s->part = mem_new(2 * t->m->patches, 4 * (size_t)s->bands * sizeof(double), "albedos", e);
	s->is_ideal = mem_new(2 * t->m->patches, 1, "albedos", e);
	if (!s->chain_flux || !s->touched || !s->is_touched || !s->part || !s->is_ideal)
		return -1;
	fill_parts(s);
	return 0;
}

void sender_free(struct sender *s)
{
	free(s->part);
	free(s->is_ideal);
	free(s->chain_flux);
	free(s->touched);
	free(s->is_touched);
	*s = (struct sender){ 0 };
}

static void into_chain(struct sender *s, uint32_t chain, const double *x, const double *part)
{
	double *flux = s->chain_flux + (size_t)chain * (size_t)s->bands;

	if (!s->is_touched[chain]) {
		s->is_touched[chain] = 1;
		s->touched[s->touches++] = chain;
	}
	for (int k = 0; k < s->bands; k++)
		flux[k] += x[k] * part[k];
}

/* Flux x of chain c on ideal patch-side: what goes on by R and by T. Chains that no
 * sample of the row followed stay in chain_flux and end up as cut. */
static void go_on(struct sender *s, uint32_t chain, uint32_t material, int side,
                  const double *x)
{
	const struct materials *mt = &s->m->material;
	const struct chains *c = &s->t->chains;
	size_t at = material_at(mt, material, side);

	for (int transmitted = 0; transmitted < 2; transmitted++) {
		uint32_t slot = c->slot[4 * material + 2 * (uint32_t)side + (uint32_t)transmitted];
		if (slot == CHAIN_NONE)
			continue;
		uint32_t child = ((const uint32_t *)c->child.data)[(size_t)chain * c->events + slot];
		if (child == chain) /* summed by go_round */
			continue;
		/* Chain 0 cannot be a child: it marks flux that no row follows. */
		into_chain(s, child == CHAIN_NONE ? 0 : child, x,
		           (transmitted ? mt->tau_s : mt->rho_s) + at);
	}
}

/* Takes the flux that waits for a chain. */
static void take(struct sender *s, uint32_t chain, double *x)
{
	double *flux = s->chain_flux + (size_t)chain * (size_t)s->bands;

	for (int k = 0; k < s->bands; k++) {
		x[k] = flux[k];
		flux[k] = 0;
	}
}

static void finish(struct sender *s, double *cut)
{
	double x[BANDS_MAX];

	for (size_t i = 0; i < s->touches; i++) {
		take(s, s->touched[i], x);
		for (int k = 0; cut && k < s->bands; k++)
			cut[k] += x[k];
		s->is_touched[s->touched[i]] = 0;
	}
	s->touches = 0;
}

/* Splits flux x arriving at a run's patch-side into what is absorbed and what is
 * unshot again. */
static void deposit(struct sender *s, struct solution *sol, const struct run *r, int to,
                    const double *x, struct sent *sent)
{
	int bands = s->bands;
	const double *part = s->part + (size_t)r->target * 4 * (size_t)bands;
	double *here = sol->unshot_diffuse + (size_t)r->target * (size_t)bands;
	double *there = sol->unshot_diffuse + (size_t)(r->target ^ 1) * (size_t)bands;

	for (int k = 0; k < bands; k++) {
		double same = part[k] * x[k], other = part[bands + k] * x[k];
		here[k] += same;
		there[k] += other;
		sent->kept[k] += same + other;
		sent->absorbed[k] += part[3 * bands + k] * x[k];
	}
	if (r->link == FF_NO_ROW) {
		for (int k = 0; k < bands; k++)
			sent->cut[k] += part[2 * bands + k] * x[k];
		return;
	}
	double *link = sol->unshot_link + (2 * (size_t)r->link + (size_t)to) * (size_t)bands;
	for (int k = 0; k < bands; k++) {
		double lobes = part[2 * bands + k] * x[k];
		link[k] += lobes;
		sent->kept[k] += lobes;
		sent->guessed[k] += r->guessed ? lobes : 0;
	}
}

/* How much of the flux in a block comes back to it, per band, through events whose
 * count has stopped: the ratio of a geometric series. */
static void loop_gain(const struct sender *s, const struct block *block, double *gain)
{
	const struct chains *c = &s->t->chains;
	const struct materials *mt = &s->m->material;
	const uint32_t *child = (const uint32_t *)c->child.data + (size_t)block->chain * c->events;

	memset(gain, 0, (size_t)s->bands * sizeof *gain);
	for (uint32_t event = 0; event < c->events; event++) {
		uint32_t id = c->event[event];
		size_t at = material_at(mt, id / 4, (int)(id / 2 % 2));
		double landed = 0;
		if (child[event] != block->chain)
			continue;
		for (uint64_t i = block->run; i < block[1].run; i++) {
			uint32_t target = s->t->run[i].target;
			if (2 * model_patch_material(s->m, target >> 1) + (target & 1) == id / 2)
				landed += s->t->run[i].sum;
		}
		for (int k = 0; k < s->bands; k++)
			gain[k] += (id & 1 ? mt->tau_s : mt->rho_s)[at + (size_t)k] * landed / block->sum;
	}
}

/* All flux that lands from a block when `in` comes into it: once, and again each
 * time round. What could go round for ever is left in `cut`, if that is asked for. */
static void go_round(struct sender *s, const struct block *block, double *in, double *cut)
{
	double gain[BANDS_MAX];

	if (block->chain == 0 || !(block->sum > 0))
		return;
	loop_gain(s, block, gain);
	for (int k = 0; k < s->bands; k++) {
		if (gain[k] < 1 - 1e-9) {
			in[k] /= 1 - gain[k];
		} else {
			if (cut)
				cut[k] += in[k];
			in[k] = 0;
		}
	}
}

void send_row(struct sender *s, struct solution *sol, uint32_t row, int freshness,
              const double *flux, struct sent *sent)
{
	const struct transport *t = s->t;
	int bands = s->bands;

	for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
		const struct block *block = &t->block[b];
		double in[BANDS_MAX], x[BANDS_MAX], any = 0;
		if (block->chain)
			take(s, block->chain, in);
		for (int k = 0; k < bands; k++) {
			in[k] = block->chain ? in[k] : flux[k];
			any += in[k];
		}
		if (!(any > 0))
			continue;
		go_round(s, block, in, sent->cut);
		for (int k = 0; k < bands; k++) {
			in[k] /= block->sum > 0 ? block->sum : 1;
			sent->escaped[k] += in[k] * block->escape;
			sent->absorbed[k] += in[k] * block->black;
			sent->lost[k] += in[k] * block->lost;
			sent->cut[k] += in[k] * block->cut;
		}
		for (uint64_t i = block->run; i < block[1].run; i++) {
			const struct run *r = &t->run[i];
			for (int k = 0; k < bands; k++)
				x[k] = in[k] * r->sum;
			deposit(s, sol, r, freshness, x, sent);
			if (s->is_ideal[r->target])
				go_on(s, block->chain, model_patch_material(s->m, r->target >> 1),
				      (int)(r->target & 1), x);
		}
	}
	finish(s, sent->cut);
}

void send_block_flux(struct sender *s, uint32_t row, const double *flux, double *block_flux)
{
	const struct transport *t = s->t;
	int bands = s->bands;

	for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
		const struct block *block = &t->block[b];
		double *in = block_flux + (b - t->row_block[row]) * (size_t)bands;
		double x[BANDS_MAX];
		if (block->chain)
			take(s, block->chain, in);
		else
			memcpy(in, flux, (size_t)bands * sizeof *in);
		go_round(s, block, in, NULL);
		for (uint64_t i = block->run; t->chains.events && i < block[1].run; i++) {
			const struct run *r = &t->run[i];
			if (!s->is_ideal[r->target])
				continue;
			for (int k = 0; k < bands; k++)
				x[k] = block->sum > 0 ? in[k] / block->sum * r->sum : 0;
			go_on(s, block->chain, model_patch_material(s->m, r->target >> 1),
			      (int)(r->target & 1), x);
		}
	}
	finish(s, NULL);
}
