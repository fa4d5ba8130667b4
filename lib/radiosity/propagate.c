#include "lib/radiosity/propagate.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/radiosity/propagate_exact.h"
#include "lib/scatter/bsdf.h"

/* How the sides of materials split the flux that arrives on them. */
static void fill_splits(struct propagator *s)
{
	const struct materials *mt = &s->m->material;
	size_t width = LANES * s->vectors;

	for (uint32_t i = 0; i < 2 * mt->n; i++) {
		uint32_t material = i >> 1;
		int side = (int)(i & 1);
		size_t at = model_material_at(mt, material, side);
		double *part = (double *)(s->split + i * SPLITS * s->vectors);
		double *share = (double *)(s->share + i * 2 * s->vectors);
		int lobe_r = bsdf_has_lobe(mt, material, side, 0);
		int lobe_t = bsdf_has_lobe(mt, material, side, 1);
		for (size_t c = 0; c < s->channels; c++) {
			size_t k = c % (size_t)s->bands;
			part[SPLIT_RHO * width + c] = mt->rho_d[at + k];
			part[SPLIT_TAU * width + c] = mt->tau_d[at + k];
			double r = lobe_r ? mt->rho_s[at + k] : 0;
			double t = lobe_t ? mt->tau_s[at + k] : 0;
			part[SPLIT_LOBES * width + c] = r + t;
			share[c] = r > 0 ? r / (r + t) : 0;
			share[width + c] = r + t > 0 ? 1 - share[c] : 0;
			part[SPLIT_ABSORBED * width + c] =
				1 - bsdf_albedo(mt, material, side, (int)k);
		}
	}
	for (uint32_t ps = 0; ps < 2 * s->m->patch.n; ps++)
		s->surface[ps] = 2 * model_patch_material(s->m, ps >> 1) + (ps & 1);
}

int radiosity_shot_ledger_new(struct shot_ledger *x, size_t vectors, struct err *e)
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

void radiosity_shot_ledger_clear(struct shot_ledger *x)
{
	memset(x->absorbed, 0, 6 * x->vectors * sizeof(lanes));
}

void radiosity_shot_ledger_free(struct shot_ledger *x)
{
	free(x->room);
	*x = (struct shot_ledger){ 0 };
}

int radiosity_propagator_init(struct propagator *s, const struct transport *t, size_t groups,
                              struct err *e)
{
	*s = (struct propagator){ .t = t, .m = t->m, .bands = t->m->bands };
	s->channels = groups * (size_t)s->bands;
	s->vectors = lanes_vectors(s->channels);
	s->chain_flux = mem_new(t->chains.n, s->channels * sizeof(double), "chain flux", e);
	s->touched = mem_new(t->chains.n, sizeof *s->touched, "chain flux", e);
	s->is_touched = mem_new(t->chains.n, 1, "chain flux", e);
	s->split = lanes_new(2 * t->m->material.n * SPLITS * s->vectors, &s->room[0], "albedos", e);
	s->share = lanes_new(2 * t->m->material.n * 2 * s->vectors, &s->room[3], "albedos", e);
	s->surface = mem_new(2 * t->m->patch.n, sizeof *s->surface, "albedos", e);
	if (!s->chain_flux || !s->touched || !s->is_touched || !s->split || !s->share ||
	    !s->surface)
		return -1;
	fill_splits(s);
	return 0;
}

void radiosity_propagator_free(struct propagator *s)
{
	for (size_t i = 0; i < sizeof s->room / sizeof *s->room; i++)
		free(s->room[i]);
	free(s->surface);
	free(s->chain_flux);
	free(s->touched);
	free(s->is_touched);
	*s = (struct propagator){ 0 };
}

int radiosity_propagator_load(struct propagator *s, const struct solution *sol, struct err *e)
{
	size_t sides = 2 * s->m->patch.n, links = 2 * s->t->links;

	s->unshot_diffuse = lanes_new(sides * s->vectors, &s->room[1], "unshot flux", e);
	s->unshot_link = lanes_new(links * s->vectors, &s->room[2], "unshot flux", e);
	if (!s->unshot_diffuse || !s->unshot_link)
		return -1;
	lanes_pack(s->unshot_diffuse, sol->unshot.diffuse, sides, s->channels);
	lanes_pack(s->unshot_link, sol->unshot.link, links, s->channels);
	return 0;
}

void radiosity_propagator_store(const struct propagator *s, struct solution *sol)
{
	lanes_unpack(sol->unshot.diffuse, s->unshot_diffuse, 2 * s->m->patch.n, s->channels);
	lanes_unpack(sol->unshot.link, s->unshot_link, 2 * s->t->links, s->channels);
}

/* The coefficients of an event, [bands]. */
static const double *coefficient(const struct propagator *s, uint32_t event)
{
	const struct materials *mt = &s->m->material;
	size_t at = model_material_at(mt, event / 4, (int)(event / 2 % 2));

	return (event & 1 ? mt->tau_s : mt->rho_s) + at;
}

/* Flux x by unit of the values that an event sends on. What no sample of the row followed
 * stays in chain_flux of chain 0, which cannot be a child, and ends up as cut. */
static void into_chain(struct propagator *s, const struct onward *o, const double *x)
{
	const uint32_t chain = o->chain == CHAIN_NONE ? 0 : o->chain;
	const double *part = coefficient(s, o->event);
	double *flux = s->chain_flux + chain * s->channels;

	if (!s->is_touched[chain]) {
		s->is_touched[chain] = 1;
		s->touched[s->touches++] = chain;
	}
	for (size_t c = 0; c < s->channels; c++)
		flux[c] += x[c] * (part[c % (size_t)s->bands] * o->sum);
}

/* Takes the flux that waits for a chain. */
static void take(struct propagator *s, uint32_t chain, double *x)
{
	double *flux = s->chain_flux + chain * s->channels;

	memcpy(x, flux, s->channels * sizeof *x);
	memset(flux, 0, s->channels * sizeof *flux);
}

/* Enters what became of flux in vector v. */
static inline void book(const struct propagator *s, lanes *to, size_t v, lanes flux)
{
	to[v] += flux;
	if (s->exact)
		radiosity_exact_book(s->exact, v, flux);
}

static void finish(struct propagator *s, lanes *cut)
{
	lanes x[VECTORS_MAX];

	for (size_t i = 0; i < s->touches; i++) {
		x[s->vectors - 1] = (lanes){ 0 };
		take(s, s->touched[i], (double *)x);
		for (size_t v = 0; cut && v < s->vectors; v++)
			book(s, cut, v, x[v]);
		s->is_touched[s->touched[i]] = 0;
	}
	s->touches = 0;
}

/* ---- landing ---- */

/* Vectors that land together: their sums, coefficients and flux have to fit AVX2's 16
 * registers. */
enum { LANDING_MAX = 4 };

/* Runs whose links are fetched together, ahead of adding to them; bytes of a line of the cache.
 * FETCHED is a guess; `make bench` (shoot, GB/s) shows what it does. */
enum { FETCHED = 16, LINE = 64 };

/* Runs that stay in the first cache for all vectors of many channels, and runs of a row that are
 * fetched before it is sent. Guesses, as above. */
enum { TILE = 64, ROW_FETCHED = 64 };

/* The part of a block's flux that comes back to it: with more, it would go round for ever, but for
 * rounding. A guess, as `white` in components.c. */
static const double endless = 1 - 1e-9;

/* Flux landing from a block: N vectors of channels from v on of n, x by unit of the
 * values. The loops over runs are inlined with a constant N. */
struct landing {
	const struct propagator *s;
	const struct block *block;
	size_t v, n;
	int origin;
	lanes x[LANDING_MAX];
};

/* What became of it. */
struct landed {
	lanes arrived, kept, absorbed, cut, guessed;
};

static ALWAYS_INLINE void land_diffuse(const struct landing *l, uint64_t run, size_t N, size_t n,
                                       struct landed *sum)
{
	const uint32_t target = l->s->t->run_target[run];
	const double value = l->s->t->run_sum[run];
	const lanes *rho = l->s->split + l->s->surface[target] * SPLITS * n + l->v;
	lanes *unshot = l->s->unshot_diffuse + target * n + l->v;

	for (size_t i = 0; i < N; i++) {
		lanes x = l->x[i] * value, same = rho[i] * x;
		unshot[i] += same;
		sum[i].kept += same;
		sum[i].arrived += x;
	}
}

static ALWAYS_INLINE void land_general(const struct landing *l, uint64_t run, size_t N, size_t n,
                                       struct landed *sum)
{
	const struct propagator *s = l->s;
	const uint32_t target = s->t->run_target[run];
	const uint32_t link = s->t->run_link[l->block->link + (run - l->block->special)];
	const double value = s->t->run_sum[run];
	const lanes *part = s->split + s->surface[target] * SPLITS * n + l->v;
	lanes *here = s->unshot_diffuse + target * n + l->v;
	lanes *there = s->unshot_diffuse + (target ^ 1) * n + l->v, *to = NULL;

	if (link < RUN_FOLLOWED)
		to = s->unshot_link + (2 * (size_t)(link & ~RUN_GUESSED) + (size_t)l->origin) * n +
		     l->v;
	for (size_t i = 0; i < N; i++) {
		lanes x = l->x[i] * value, same = part[SPLIT_RHO * n + i] * x;
		lanes other = part[SPLIT_TAU * n + i] * x, lobes = part[SPLIT_LOBES * n + i] * x;
		here[i] += same;
		there[i] += other;
		sum[i].kept += same + other;
		sum[i].absorbed += part[SPLIT_ABSORBED * n + i] * x;
		if (to) {
			to[i] += lobes;
			sum[i].kept += lobes;
			sum[i].guessed += lanes_if(lobes, (link & RUN_GUESSED) != 0);
		} else if (link == FF_NO_ROW) {
			sum[i].cut += lobes;
		}
	}
}

/* Links are all over memory: fetches what will be added to by up to FETCHED runs. */
static void fetch_links(const struct propagator *s, const struct block *block, uint64_t run,
                        uint64_t end, int origin)
{
	const uint32_t *link = s->t->run_link + block->link + (run - block->special);
	const uint64_t n = end - run < FETCHED ? end - run : FETCHED;

	for (uint64_t i = 0; i < n; i++) {
		const lanes *to = s->unshot_link + s->vectors *
		                  (2 * (size_t)(link[i] & ~RUN_GUESSED) + (size_t)origin);
		for (size_t v = 0; link[i] < RUN_FOLLOWED && v < s->vectors; v += LINE / sizeof *to)
			__builtin_prefetch(to + v, 1);
	}
}

static ALWAYS_INLINE void land_all(const struct landing *l, uint64_t i, uint64_t end, size_t N,
                                   size_t n, struct shot_ledger *ledger)
{
	const uint64_t special = l->block->special < end ? l->block->special : end;
	struct landed sum[2 * LANDING_MAX] = { 0 };

	/* By turns, as one addition would wait for the last. */
	for (; N == 1 && i + 1 < special; i += 2) {
		land_diffuse(l, i, N, n, sum);
		land_diffuse(l, i + 1, N, n, sum + 1);
	}
	for (; i < special; i++)
		land_diffuse(l, i, N, n, sum);
	if (N == 1) {
		sum[0].arrived += sum[1].arrived;
		sum[0].kept += sum[1].kept;
	}
	for (size_t k = 0; k < N; k++)
		sum[k].absorbed = sum[k].arrived - sum[k].kept;
	for (; i < end; i++) {
		if ((i - l->block->special) % FETCHED == 0 && l->v == 0 &&
		    i + FETCHED < l->block[1].run)
			fetch_links(l->s, l->block, i + FETCHED, l->block[1].run, l->origin);
		land_general(l, i, N, n, sum);
	}
	for (size_t k = 0; k < N; k++) {
		ledger->kept[l->v + k] += sum[k].kept;
		ledger->absorbed[l->v + k] += sum[k].absorbed;
		ledger->cut[l->v + k] += sum[k].cut;
		ledger->guessed[l->v + k] += sum[k].guessed;
	}
}

/* N of the n vectors; where these are all, the compiler knows n too. */
static void land(const struct landing *l, size_t N, uint64_t begin, uint64_t end,
                 struct shot_ledger *ledger)
{
	const int all = N == l->n;

	switch (N) {
	case 1:
		all ? land_all(l, begin, end, 1, 1, ledger)
		    : land_all(l, begin, end, 1, l->n, ledger);
		break;
	case 2:
		all ? land_all(l, begin, end, 2, 2, ledger)
		    : land_all(l, begin, end, 2, l->n, ledger);
		break;
	case 3:
		land_all(l, begin, end, 3, l->n, ledger);
		break;
	case LANDING_MAX:
		land_all(l, begin, end, LANDING_MAX, l->n, ledger);
		break;
	}
}

static void send_block(struct propagator *s, const struct block *block, int origin,
                       const lanes *in, struct shot_ledger *ledger)
{
	const struct transport *t = s->t;
	const uint64_t end = block[1].run;
	const uint64_t tile = s->vectors > LANDING_MAX ? TILE : end - block->run;
	struct landing l = { s, block, 0, s->vectors, origin, { { 0 } } };

	s->runs += end - block->run;
	s->bytes += (double)(end - block->run) * (sizeof *t->run_target + sizeof *t->run_sum) +
	            (double)(end - block->special) * sizeof *t->run_link;
	if (s->exact) {
		radiosity_exact_land(s, block, origin, in, ledger);
		return;
	}
	fetch_links(s, block, block->special, end, origin);
	for (uint64_t i = block->run; i < end; i += tile)
		for (l.v = 0; l.v < l.n; l.v += LANDING_MAX) {
			size_t N = l.n - l.v < LANDING_MAX ? l.n - l.v : LANDING_MAX;
			memcpy(l.x, in + l.v, N * sizeof *in);
			land(&l, N, i, i + tile < end ? i + tile : end, ledger);
		}
}

/* What goes on from a block, x its flux by unit of the values; go_round has what comes
 * back to it. */
static void send_on(struct propagator *s, const struct block *block, const double *x)
{
	for (uint64_t i = block->onward; i < block[1].onward; i++)
		if (s->t->onward[i].chain != block->chain)
			into_chain(s, &s->t->onward[i], x);
}

/* How much of the flux in a block comes back to it, per band, through events whose
 * count has stopped: the ratio of a geometric series. */
static void loop_gain(const struct propagator *s, const struct block *block, double *gain)
{
	memset(gain, 0, (size_t)s->bands * sizeof *gain);
	for (uint64_t i = block->onward; i < block[1].onward; i++) {
		const struct onward *o = &s->t->onward[i];
		for (int k = 0; o->chain == block->chain && k < s->bands; k++)
			gain[k] += coefficient(s, o->event)[k] * o->sum / block->sum;
	}
}

/* All flux that lands from a block when `in` comes into it: once, and again each
 * time round. What could go round for ever is left in `cut`, if that is asked for. */
static void go_round(struct propagator *s, const struct block *block, double *in, lanes *cut)
{
	double gain[BANDS_MAX];
	lanes ever[VECTORS_MAX];

	if (block->chain == 0 || !(block->sum > 0) || block->onward == block[1].onward)
		return;
	loop_gain(s, block, gain);
	memset(ever, 0, s->vectors * sizeof *ever);
	for (size_t c = 0; c < s->channels; c++) {
		double g = gain[c % (size_t)s->bands];
		((double *)ever)[c] = g < endless ? 0 : in[c];
		in[c] = g < endless ? in[c] / (1 - g) : 0;
	}
	for (size_t v = 0; cut && v < s->vectors; v++)
		book(s, cut, v, ever[v]);
}

void radiosity_propagate_fetch(const struct propagator *s, uint32_t row, int origin, int ahead)
{
	const struct transport *t = s->t;
	const struct block *block = &t->block[t->row_block[row]];

	if (ahead > 2) {
		__builtin_prefetch(block);
		__builtin_prefetch(block + 1);
		return;
	}
	const uint64_t first = block->run, n = block[1].run - first;
	const uint64_t fetched = first + (n < ROW_FETCHED ? n : ROW_FETCHED);
	if (ahead == 1) {
		fetch_links(s, block, block->special, first + n, origin);
		return;
	}
	for (uint64_t i = first; i < fetched; i += LINE / sizeof *t->run_sum) {
		__builtin_prefetch(t->run_target + i);
		__builtin_prefetch(t->run_sum + i);
	}
	__builtin_prefetch(t->run_link + block->link);
}

void radiosity_propagate_row(struct propagator *s, uint32_t row, int origin, const lanes *flux,
                             struct shot_ledger *ledger)
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
		go_round(s, block, (double *)in, ledger->cut);
		for (size_t v = 0; v < n; v++) {
			in[v] /= block->sum > 0 ? block->sum : 1;
			book(s, ledger->escaped, v, in[v] * block->escape);
			book(s, ledger->absorbed, v, in[v] * block->black);
			book(s, ledger->lost, v, in[v] * block->lost);
			book(s, ledger->cut, v, in[v] * block->cut);
		}
		send_block(s, block, origin, in, ledger);
		send_on(s, block, (double *)in);
	}
	finish(s, ledger->cut);
}

void radiosity_propagate_block_flux(struct propagator *s, uint32_t row, const double *flux,
                                    double *block_flux)
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
