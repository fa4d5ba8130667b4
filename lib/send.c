#include "send.h"

#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "mem.h"

/* How the sides of a material split the flux that arrives on them. */
static void fill_parts(struct sender *s)
{
	const struct materials *mt = &s->m->material;

	for (uint32_t kind = 0; kind < 2 * mt->n; kind++) {
		uint32_t material = kind >> 1;
		int side = (int)(kind & 1);
		size_t at = material_at(mt, material, side);
		double *part = (double *)(s->part + kind * PARTS * s->groups);
		int lobe_r = bsdf_has_lobe(mt, material, side, 0);
		int lobe_t = bsdf_has_lobe(mt, material, side, 1);
		s->is_ideal[kind] = bsdf_has_ideal(mt, material, side, 0) ||
		                    bsdf_has_ideal(mt, material, side, 1);
		for (size_t k = 0; k < (size_t)s->bands; k++) {
			part[PART_RHO * LANES * s->groups + k] = mt->rho_d[at + k];
			part[PART_TAU * LANES * s->groups + k] = mt->tau_d[at + k];
			part[PART_LOBES * LANES * s->groups + k] = (lobe_r ? mt->rho_s[at + k] : 0) +
			                                           (lobe_t ? mt->tau_s[at + k] : 0);
			part[PART_ABSORBED * LANES * s->groups + k] =
				1 - bsdf_albedo(mt, material, side, (int)k);
		}
	}
	for (uint32_t ps = 0; ps < 2 * s->m->patches; ps++)
		s->kind[ps] = 2 * model_patch_material(s->m, ps >> 1) + (ps & 1);
}

int sender_init(struct sender *s, const struct transport *t, struct err *e)
{
	size_t kinds = 2 * t->m->material.n;

	*s = (struct sender){ .t = t, .m = t->m, .bands = t->m->bands };
	s->groups = lanes_groups(s->bands);
	s->chain_flux = mem_new(t->chains.n, (size_t)s->bands * sizeof(double), "chain flux", e);
	s->touched = mem_new(t->chains.n, sizeof *s->touched, "chain flux", e);
	s->is_touched = mem_new(t->chains.n, 1, "chain flux", e);
	s->part = lanes_new(kinds * PARTS * s->groups, &s->room[0], "albedos", e);
	s->is_ideal = mem_new(kinds, 1, "albedos", e);
	s->kind = mem_new(2 * t->m->patches, sizeof *s->kind, "albedos", e);
	if (!s->chain_flux || !s->touched || !s->is_touched || !s->part || !s->is_ideal ||
	    !s->kind)
		return -1;
	fill_parts(s);
	return 0;
}

void sender_free(struct sender *s)
{
	free(s->room[0]);
	free(s->room[1]);
	free(s->kind);
	free(s->is_ideal);
	free(s->chain_flux);
	free(s->touched);
	free(s->is_touched);
	*s = (struct sender){ 0 };
}

int sender_load(struct sender *s, const struct solution *sol, struct err *e)
{
	size_t bands = (size_t)s->bands;

	s->unshot = lanes_new(2 * s->m->patches * s->groups, &s->room[1], "unshot flux", e);
	if (!s->unshot)
		return -1;
	for (uint32_t ps = 0; ps < 2 * s->m->patches; ps++)
		memcpy(sender_unshot(s, ps), sol->unshot_diffuse + ps * bands, bands * sizeof(double));
	return 0;
}

void sender_store(const struct sender *s, struct solution *sol)
{
	size_t bands = (size_t)s->bands;

	for (uint32_t ps = 0; ps < 2 * s->m->patches; ps++)
		memcpy(sol->unshot_diffuse + ps * bands, sender_unshot(s, ps), bands * sizeof(double));
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

/* Flux x per unit of the values lands on the sides of a block that do no more than
 * absorb and reflect diffusely. */
struct plain {
	const struct sender *s;
	size_t group;
	lanes x, kept[2], absorbed[2];
};

static inline void land_plain(struct plain *p, uint64_t run, int half)
{
	const struct sender *s = p->s;
	uint32_t target = s->t->run_target[run];
	const lanes *part = s->part + s->kind[target] * PARTS * s->groups + p->group;
	lanes x = p->x * s->t->run_sum[run], same = part[PART_RHO * s->groups] * x;

	s->unshot[target * s->groups + p->group] += same;
	p->kept[half] += same;
	p->absorbed[half] += part[PART_ABSORBED * s->groups] * x;
}

/* Two sums at a time: one addition would wait for the last. */
static void send_plain(struct sender *s, const struct block *block, const double *in,
                       struct sent *sent)
{
	int first = 0;

	for (size_t g = 0; g < s->groups; g++, first += LANES) {
		struct plain p = { .s = s, .group = g };
		int n = s->bands - first < LANES ? s->bands - first : LANES;
		uint64_t i = block->run;
		for (int k = 0; k < n; k++)
			p.x[k] = in[first + k];
		for (; i + 1 < block->special; i += 2) {
			land_plain(&p, i, 0);
			land_plain(&p, i + 1, 1);
		}
		if (i < block->special)
			land_plain(&p, i, 0);
		for (int k = 0; k < n; k++) {
			sent->kept[first + k] += p.kept[0][k] + p.kept[1][k];
			sent->absorbed[first + k] += p.absorbed[0][k] + p.absorbed[1][k];
		}
	}
	s->bytes += (double)((block->special - block->run) * s->groups) *
	            (sizeof *s->t->run_target + sizeof *s->t->run_sum);
}

static void to_link(const struct sender *s, struct solution *sol, uint32_t link, int to,
                    const double *lobes, struct sent *sent)
{
	int guessed = link & RUN_GUESSED ? 1 : 0;

	if (link == FF_NO_ROW) {
		for (int k = 0; k < s->bands; k++)
			sent->cut[k] += lobes[k];
		return;
	}
	double *flux = sol->unshot_link +
	               (2 * (size_t)(link & ~RUN_GUESSED) + (size_t)to) * (size_t)s->bands;
	for (int k = 0; k < s->bands; k++) {
		flux[k] += lobes[k];
		sent->kept[k] += lobes[k];
		sent->guessed[k] += guessed ? lobes[k] : 0;
	}
}

/* Flux x lands on a patch-side of any kind. */
static void land_special(struct sender *s, struct solution *sol, uint32_t target,
                         uint32_t link, int to, const double *x, struct sent *sent)
{
	size_t width = LANES * s->groups;
	const double *part = (const double *)(s->part + s->kind[target] * PARTS * s->groups);
	double *here = sender_unshot(s, target), *there = sender_unshot(s, target ^ 1);
	double lobes[BANDS_MAX];

	for (int k = 0; k < s->bands; k++) {
		const double *of = part + k;
		double same = of[PART_RHO * width] * x[k], other = of[PART_TAU * width] * x[k];
		here[k] += same;
		there[k] += other;
		lobes[k] = of[PART_LOBES * width] * x[k];
		sent->kept[k] += same + other;
		sent->absorbed[k] += of[PART_ABSORBED * width] * x[k];
	}
	to_link(s, sol, link, to, lobes, sent);
}

static void send_special(struct sender *s, struct solution *sol, const struct block *block,
                         int freshness, const double *in, struct sent *sent)
{
	const struct transport *t = s->t;
	const uint32_t *link = t->run_link + block->link;
	double x[BANDS_MAX];

	for (uint64_t i = block->special; i < block[1].run; i++) {
		uint32_t target = t->run_target[i];
		for (int k = 0; k < s->bands; k++)
			x[k] = in[k] * t->run_sum[i];
		land_special(s, sol, target, *link++, freshness, x, sent);
		if (s->is_ideal[s->kind[target]])
			go_on(s, block->chain, s->kind[target] >> 1, (int)(target & 1), x);
	}
	s->bytes += (double)(block[1].run - block->special) *
	            (2 * sizeof *t->run_target + sizeof *t->run_sum);
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
		/* What reflects or transmits ideally is special. */
		for (uint64_t i = block->special; i < block[1].run; i++)
			if (s->kind[s->t->run_target[i]] == id / 2)
				landed += s->t->run_sum[i];
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
		double in[BANDS_MAX], any = 0;
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
		send_plain(s, block, in, sent);
		send_special(s, sol, block, freshness, in, sent);
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
		for (uint64_t i = block->special; t->chains.events && i < block[1].run; i++) {
			uint32_t kind = s->kind[t->run_target[i]];
			if (!s->is_ideal[kind])
				continue;
			for (int k = 0; k < bands; k++)
				x[k] = block->sum > 0 ? in[k] / block->sum * t->run_sum[i] : 0;
			go_on(s, block->chain, kind >> 1, (int)(kind & 1), x);
		}
	}
	finish(s, NULL);
}
