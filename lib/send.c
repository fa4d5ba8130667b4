#include "send.h"

#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "mem.h"

/* How the sides of materials split the flux that arrives on them. */
static void fill_parts(struct sender *s)
{
	const struct materials *mt = &s->m->material;
	size_t width = LANES * s->vectors;

	for (uint32_t i = 0; i < 2 * mt->n; i++) {
		uint32_t material = i >> 1;
		int side = (int)(i & 1);
		size_t at = material_at(mt, material, side);
		double *part = (double *)(s->part + i * PARTS * s->vectors);
		int lobe_r = bsdf_has_lobe(mt, material, side, 0);
		int lobe_t = bsdf_has_lobe(mt, material, side, 1);
		for (size_t c = 0; c < s->channels; c++) {
			size_t k = c % (size_t)s->bands;
			part[PART_RHO * width + c] = mt->rho_d[at + k];
			part[PART_TAU * width + c] = mt->tau_d[at + k];
			part[PART_LOBES * width + c] = (lobe_r ? mt->rho_s[at + k] : 0) +
			                               (lobe_t ? mt->tau_s[at + k] : 0);
			part[PART_ABSORBED * width + c] =
				1 - bsdf_albedo(mt, material, side, (int)k);
		}
	}
	for (uint32_t ps = 0; ps < 2 * s->m->patches; ps++)
		s->surface[ps] = 2 * model_patch_material(s->m, ps >> 1) + (ps & 1);
}

int sent_new(struct sent *x, size_t vectors, struct err *e)
{
	lanes *at = lanes_new(6 * vectors, &x->room, "flux", e);

	x->vectors = vectors;
	x->absorbed = at;
	x->escaped = at + vectors;
	x->lost = at + 2 * vectors;
	x->cut = at + 3 * vectors;
	x->kept = at + 4 * vectors;
	x->guessed = at + 5 * vectors;
	return at ? 0 : -1;
}

void sent_clear(struct sent *x)
{
	memset(x->absorbed, 0, 6 * x->vectors * sizeof(lanes));
}

void sent_free(struct sent *x)
{
	free(x->room);
	*x = (struct sent){ 0 };
}

int sender_init(struct sender *s, const struct transport *t, size_t groups, struct err *e)
{
	*s = (struct sender){ .t = t, .m = t->m, .bands = t->m->bands };
	s->channels = groups * (size_t)s->bands;
	s->vectors = lanes_vectors(s->channels);
	s->chain_flux = mem_new(t->chains.n, s->channels * sizeof(double), "chain flux", e);
	s->touched = mem_new(t->chains.n, sizeof *s->touched, "chain flux", e);
	s->is_touched = mem_new(t->chains.n, 1, "chain flux", e);
	s->part = lanes_new(2 * t->m->material.n * PARTS * s->vectors, &s->room[0], "albedos", e);
	s->surface = mem_new(2 * t->m->patches, sizeof *s->surface, "albedos", e);
	if (!s->chain_flux || !s->touched || !s->is_touched || !s->part || !s->surface)
		return -1;
	fill_parts(s);
	return 0;
}

void sender_free(struct sender *s)
{
	for (size_t i = 0; i < sizeof s->room / sizeof *s->room; i++)
		free(s->room[i]);
	free(s->link_gain);
	free(s->surface);
	free(s->chain_flux);
	free(s->touched);
	free(s->is_touched);
	*s = (struct sender){ 0 };
}

int sender_load(struct sender *s, const struct solution *sol, struct err *e)
{
	size_t sides = 2 * s->m->patches, links = 2 * s->t->links;

	s->unshot_diffuse = lanes_new(sides * s->vectors, &s->room[1], "unshot flux", e);
	s->unshot_link = lanes_new(links * s->vectors, &s->room[2], "unshot flux", e);
	s->link_gain = mem_new(sides, sizeof *s->link_gain, "unshot flux", e);
	if (!s->unshot_diffuse || !s->unshot_link || !s->link_gain)
		return -1;
	lanes_pack(s->unshot_diffuse, sol->unshot_diffuse, sides, s->channels);
	lanes_pack(s->unshot_link, sol->unshot_link, links, s->channels);
	return 0;
}

void sender_store(const struct sender *s, struct solution *sol)
{
	lanes_unpack(sol->unshot_diffuse, s->unshot_diffuse, 2 * s->m->patches, s->channels);
	lanes_unpack(sol->unshot_link, s->unshot_link, 2 * s->t->links, s->channels);
}

static void into_chain(struct sender *s, uint32_t chain, const double *x, const double *part)
{
	double *flux = s->chain_flux + chain * s->channels;

	if (!s->is_touched[chain]) {
		s->is_touched[chain] = 1;
		s->touched[s->touches++] = chain;
	}
	for (size_t c = 0; c < s->channels; c++)
		flux[c] += x[c] * part[c % (size_t)s->bands];
}

/* Flux x of a chain on a patch-side: what goes on by R and by T, by lobes too if these are
 * followed. Chains that no sample of the row followed stay in chain_flux and end up as
 * cut. */
static void go_on(struct sender *s, uint32_t chain, uint32_t surface, int lobes,
                  const double *x)
{
	const struct materials *mt = &s->m->material;
	const struct chains *c = &s->t->chains;
	size_t at = material_at(mt, surface >> 1, (int)(surface & 1));

	for (int transmitted = 0; transmitted < 2; transmitted++) {
		uint32_t slot = c->slot[2 * surface + (uint32_t)transmitted];
		if (slot == CHAIN_NONE || (c->finite[slot] && !lobes))
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
	double *flux = s->chain_flux + chain * s->channels;

	memcpy(x, flux, s->channels * sizeof *x);
	memset(flux, 0, s->channels * sizeof *flux);
}

static void finish(struct sender *s, lanes *cut)
{
	double x[CHANNELS_MAX];

	for (size_t i = 0; i < s->touches; i++) {
		take(s, s->touched[i], x);
		for (size_t c = 0; cut && c < s->channels; c++)
			((double *)cut)[c] += x[c];
		s->is_touched[s->touched[i]] = 0;
	}
	s->touches = 0;
}

/* Flux landing from a block: four channels of it, x by unit of the values. The loops over
 * runs are made twice, inlined with n known to be 1 and not. */
struct landing {
	const struct sender *s;
	const struct block *block;
	size_t v, n;                 /* vector of how many */
	int freshness;
	lanes x;
};

/* Sums of two kinds by turns, as one addition would wait for the last. */
struct landed {
	lanes kept[2], absorbed[2], cut, guessed;
};

static ALWAYS_INLINE void land_plain(const struct landing l, uint64_t run, lanes *kept,
                                     lanes *absorbed)
{
	uint32_t target = l.s->t->run_target[run];
	const lanes *part = l.s->part + l.s->surface[target] * PARTS * l.n + l.v;
	lanes x = l.x * l.s->t->run_sum[run], same = part[PART_RHO * l.n] * x;

	l.s->unshot_diffuse[target * l.n + l.v] += same;
	*kept += same;
	*absorbed += part[PART_ABSORBED * l.n] * x;
}

static ALWAYS_INLINE void land_special(const struct landing l, uint64_t run,
                                       struct landed *sum)
{
	uint32_t target = l.s->t->run_target[run];
	uint32_t link = l.s->t->run_link[l.block->link + (run - l.block->special)];
	const lanes *part = l.s->part + l.s->surface[target] * PARTS * l.n + l.v;
	lanes x = l.x * l.s->t->run_sum[run], same = part[PART_RHO * l.n] * x;
	lanes other = part[PART_TAU * l.n] * x, lobes = part[PART_LOBES * l.n] * x;

	l.s->unshot_diffuse[target * l.n + l.v] += same;
	l.s->unshot_diffuse[(target ^ 1) * l.n + l.v] += other;
	sum->kept[0] += same + other;
	sum->absorbed[0] += part[PART_ABSORBED * l.n] * x;
	if (link == RUN_FOLLOWED)
		return;
	if (link == FF_NO_ROW) {
		sum->cut += lobes;
		return;
	}
	size_t at = 2 * (size_t)(link & ~RUN_GUESSED) + (size_t)l.freshness;
	l.s->unshot_link[at * l.n + l.v] += lobes;
	l.s->link_gain[target] += lanes_total(&lobes, 1);
	sum->kept[1] += lobes;
	if (link & RUN_GUESSED)
		sum->guessed += lobes;
}

static ALWAYS_INLINE void land(const struct landing l, uint64_t i, uint64_t end,
                               struct sent *sent)
{
	uint64_t special = l.block->special < end ? l.block->special : end;
	struct landed sum = { 0 };

	for (; i + 1 < special; i += 2) {
		land_plain(l, i, &sum.kept[0], &sum.absorbed[0]);
		land_plain(l, i + 1, &sum.kept[1], &sum.absorbed[1]);
	}
	if (i < special)
		land_plain(l, i++, &sum.kept[0], &sum.absorbed[0]);
	for (; i < end; i++)
		land_special(l, i, &sum);
	sent->kept[l.v] += sum.kept[0] + sum.kept[1];
	sent->absorbed[l.v] += sum.absorbed[0] + sum.absorbed[1];
	sent->cut[l.v] += sum.cut;
	sent->guessed[l.v] += sum.guessed;
}

static void send_block(struct sender *s, const struct block *block, int freshness,
                       const lanes *in, struct sent *sent)
{
	enum { TILE = 64 };          /* runs that stay in cache for all vectors */
	const struct transport *t = s->t;
	const uint64_t end = block[1].run;
	const size_t n = s->vectors;

	if (n == 1)
		land((struct landing){ s, block, 0, 1, freshness, in[0] }, block->run, end, sent);
	else
		for (uint64_t i = block->run; i < end; i += TILE)
			for (size_t v = 0; v < n; v++)
				land((struct landing){ s, block, v, n, freshness, in[v] }, i,
				     i + TILE < end ? i + TILE : end, sent);
	s->runs += end - block->run;
	s->bytes += (double)(end - block->run) * (sizeof *t->run_target + sizeof *t->run_sum) +
	            (double)(end - block->special) * sizeof *t->run_link;
}

/* What goes on from the runs of a block that are followed, x its flux by unit of the
 * values. */
static void send_on(struct sender *s, const struct block *block, const double *x)
{
	const struct transport *t = s->t;
	double landed[CHANNELS_MAX];

	for (uint64_t i = block->ideal; i < block[1].run; i++) {
		uint32_t surface = s->surface[t->run_target[i]];
		uint32_t link = t->run_link[block->link + (i - block->special)];
		for (size_t c = 0; c < s->channels; c++)
			landed[c] = x[c] * t->run_sum[i];
		go_on(s, block->chain, surface, link == RUN_FOLLOWED, landed);
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
		for (uint64_t i = block->ideal; i < block[1].run; i++)
			if (s->surface[s->t->run_target[i]] == id / 2)
				landed += s->t->run_sum[i];
		for (int k = 0; k < s->bands; k++)
			gain[k] += (id & 1 ? mt->tau_s : mt->rho_s)[at + (size_t)k] * landed / block->sum;
	}
}

/* All flux that lands from a block when `in` comes into it: once, and again each
 * time round. What could go round for ever is left in `cut`, if that is asked for. */
static void go_round(struct sender *s, const struct block *block, double *in, lanes *cut)
{
	double gain[BANDS_MAX];

	if (block->chain == 0 || !(block->sum > 0))
		return;
	loop_gain(s, block, gain);
	for (size_t c = 0; c < s->channels; c++) {
		double g = gain[c % (size_t)s->bands];
		if (g < 1 - 1e-9) {
			in[c] /= 1 - g;
		} else {
			if (cut)
				((double *)cut)[c] += in[c];
			in[c] = 0;
		}
	}
}

void send_row(struct sender *s, uint32_t row, int freshness, const lanes *flux,
              struct sent *sent)
{
	const struct transport *t = s->t;
	const size_t n = s->vectors;
	lanes in[VECTORS_MAX];

	for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
		const struct block *block = &t->block[b];
		if (block->chain) {
			in[n - 1] = (lanes){ 0 };
			take(s, block->chain, (double *)in);
		} else {
			memcpy(in, flux, n * sizeof *in);
		}
		if (!(lanes_magnitude(in, n) > 0))
			continue;
		go_round(s, block, (double *)in, sent->cut);
		for (size_t v = 0; v < n; v++) {
			in[v] /= block->sum > 0 ? block->sum : 1;
			sent->escaped[v] += in[v] * block->escape;
			sent->absorbed[v] += in[v] * block->black;
			sent->lost[v] += in[v] * block->lost;
			sent->cut[v] += in[v] * block->cut;
		}
		send_block(s, block, freshness, in, sent);
		send_on(s, block, (double *)in);
	}
	finish(s, sent->cut);
}

void send_block_flux(struct sender *s, uint32_t row, const double *flux, double *block_flux)
{
	const struct transport *t = s->t;
	double x[CHANNELS_MAX];

	for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
		const struct block *block = &t->block[b];
		double *in = block_flux + (b - t->row_block[row]) * s->channels;
		if (block->chain)
			take(s, block->chain, in);
		else
			memcpy(in, flux, s->channels * sizeof *in);
		go_round(s, block, in, NULL);
		for (size_t c = 0; c < s->channels; c++)
			x[c] = block->sum > 0 ? in[c] / block->sum : 0;
		send_on(s, block, x);
	}
	finish(s, NULL);
}
