#include "lib/radiosity/shoot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/data/punctual.h"
#include "lib/scatter/bsdf.h"

/* ---- the beginning and the end ---- */

/* Flux, in the scene's unit. Less is no light: what becomes of it would not have all its digits
 * (DBL_MIN is 2e-308). */
static const double dimmest = 1e-200;

double radiosity_emitted(const struct model *m, uint32_t source, int band)
{
	double flux = 0;

	if (source >= 2 * m->patch.n)
		flux = model_light_flux(m, source - 2 * m->patch.n, band);
	else if (model_side_modelled(m, source))
		flux = m->patch.area[source >> 1] *
		       bsdf_exitance(&m->material, model_patch_material(m, source >> 1),
		                     (int)(source & 1), band);
	return flux > dimmest ? flux : 0;
}

static void weigh_components(struct shooter *v)
{
	const struct solution *s = v->s;
	size_t bands = (size_t)s->bands, vectors = v->propagator.vectors;

	for (uint32_t i = 0; i < s->sources; i++)
		for (int k = 0; k < s->bands; k++)
			v->emitted[v->components.of[i] * s->groups +
			           solution_group(s, v->t->m, i)] += radiosity_emitted(v->t->m, i, k);
	for (size_t i = 0; i < v->components.n; i++)
		for (size_t c = 0; c < v->propagator.channels; c++) {
			double emitted = v->emitted[i * s->groups + c / bands];
			((double *)(v->weight + i * vectors))[c] = emitted > 0 ? 1 / emitted : 0;
		}
}

static double row_cost(const struct transport *t, uint32_t row)
{
	/* Runs that a block's head and an account of the shot are worth in time: a guess. */
	enum { HEAD = 16 };
	uint64_t b = t->row_block[row], end = t->row_block[row + 1];

	return (double)(t->block[end].run - t->block[b].run + HEAD * (1 + end - b));
}

static void set_costs(struct shooter *v)
{
	const struct transport *t = v->t;

	for (uint32_t ps = 0; ps < v->s->patch_sides; ps++) {
		uint32_t row[2] = { t->diffuse_row[ps], t->emission_row[ps] };
		v->cost[ps] = 1;
		for (int k = 0; k < 2; k++)
			if (row[k] != FF_NO_ROW)
				v->cost[ps] += row_cost(t, row[k]);
	}
	for (size_t l = 0; l < t->links; l++) {
		v->link_cost[l] = 1;
		for (size_t way = 0; way < 2; way++)
			if (t->link_row[2 * l + way] != FF_NO_ROW)
				v->link_cost[l] += row_cost(t, t->link_row[2 * l + way]);
	}
}

static int new_arrays(struct shooter *v, struct err *e)
{
	size_t components = v->components.n, vectors = v->propagator.vectors;
	size_t sides = v->s->patch_sides;

	v->emitted = mem_new(components * v->s->groups, sizeof *v->emitted, "priorities", e);
	v->cost = mem_new(sides, sizeof *v->cost, "priorities", e);
	v->link_cost = mem_new(v->t->links, sizeof *v->link_cost, "priorities", e);
	v->weight = lanes_new(components * vectors, &v->room[0], "priorities", e);
	v->out = lanes_new(vectors, &v->room[1], "flux", e);
	v->emission = lanes_new(vectors, &v->room[2], "flux", e);
	v->diffuse = lanes_new(vectors, &v->room[3], "flux", e);
	v->unshot = lanes_new(vectors, &v->room[4], "flux", e);
	v->component_unshot = lanes_new(components * vectors, &v->room[5], "priorities", e);
	return v->emitted && v->component_unshot && v->cost && v->link_cost && v->weight &&
	       v->out && v->emission && v->diffuse && v->unshot ? 0 : -1;
}

int radiosity_shooter_init(struct shooter *v, struct solution *s, const struct transport *t,
                           struct err *e)
{
	*v = (struct shooter){ .s = s, .t = t };
	if (radiosity_propagator_init(&v->propagator, t, s->groups, e) ||
	    radiosity_propagator_load(&v->propagator, s, e) ||
	    radiosity_shot_ledger_new(&v->booked, v->propagator.vectors, e) ||
	    radiosity_components_init(&v->components, t, e) ||
	    new_arrays(v, e))
		return -1;
	weigh_components(v);
	set_costs(v);
	return 0;
}

void radiosity_shooter_free(struct shooter *v)
{
	for (size_t i = 0; i < sizeof v->room / sizeof *v->room; i++)
		free(v->room[i]);
	free(v->emitted);
	free(v->cost);
	free(v->link_cost);
	radiosity_shot_ledger_free(&v->booked);
	radiosity_propagator_free(&v->propagator);
	radiosity_components_free(&v->components);
}

/* ---- unshot flux ---- */

static void check_ledger(struct shooter *v)
{
	const struct solution *s = v->s;
	size_t channels = v->propagator.channels;

	for (size_t c = 0; c < channels; c++) {
		double in = s->ledger[c], out = ((const double *)v->unshot)[c];
		for (size_t term = LEDGER_ABSORBED; term < LEDGER_TERMS; term++)
			out += s->ledger[term * channels + c];
		if (in > 0)
			v->residual = fmax(v->residual, fabs(in - out) / in);
	}
}

/* Vectors: as many sums stay in registers, beside what they are added up from. */
enum { FEW = 2 };

static inline void raise(double *top, double x)
{
	if (x > *top)
		*top = x;
}

/* Counts items of unshot flux of a source, each two at a cost; the largest magnitude by
 * weight and cost. Inlined with the number of vectors, n; few are summed in registers. */
static ALWAYS_INLINE double count_as(struct shooter *v, uint32_t source, const lanes *flux,
                                     size_t items, const double *cost, size_t n, int few)
{
	const lanes *weight = v->weight + v->components.of[source] * n;
	lanes here[2 * FEW] = { 0 }, below = { 0 };
	lanes *all = few ? here : v->unshot;
	lanes *part = few ? here + FEW : v->component_unshot + v->components.of[source] * n;
	double top = 0;

	for (size_t k = 0; k < items; k++, flux += n) {
		lanes sum = { 0 };
		for (size_t i = 0; i < n; i++) {
			lanes magnitude = four_abs(flux[i]), weighted = magnitude * weight[i];
			all[i] += flux[i];
			part[i] += weighted;
			sum += weighted;
			below += magnitude - flux[i];
		}
		raise(&top, lanes_total(&sum, 1) / cost[k >> 1]);
	}
	for (size_t i = 0; few && i < n; i++) {
		v->unshot[i] += all[i];
		v->component_unshot[v->components.of[source] * n + i] += part[i];
	}
	v->negative |= lanes_total(&below, 1) > 0;
	return top;
}

static double count(struct shooter *v, uint32_t source, const lanes *flux, size_t items,
                    const double *cost)
{
	switch (v->propagator.vectors) {
	case 1: return count_as(v, source, flux, items, cost, 1, 1);
	case FEW: return count_as(v, source, flux, items, cost, FEW, 1);
	default: return count_as(v, source, flux, items, cost, v->propagator.vectors, 0);
	}
}

/* The most that a component has unshot of a group, over what it emits of it. */
static double worst_part(const struct shooter *v)
{
	const size_t bands = (size_t)v->s->bands;
	double worst = 0;

	for (size_t i = 0; i < v->components.n; i++)
		for (size_t g = 0; g < v->s->groups; g++) {
			const double *part = (double *)(v->component_unshot +
			                                i * v->propagator.vectors) + g * bands;
			double sum = 0;
			for (size_t k = 0; k < bands; k++)
				sum += part[k];
			worst = fmax(worst, sum);
		}
	return worst;
}

static void load_emission(const struct shooter *v, uint32_t source, lanes *to)
{
	size_t bands = (size_t)v->s->bands;

	memset(to, 0, v->propagator.vectors * sizeof *to);
	memcpy((double *)to + solution_group(v->s, v->t->m, source) * bands,
	       v->s->unshot.emission + source * bands, bands * sizeof(double));
}

/* Magnitude of flux by weight. */
static inline double weigh(const lanes *weight, const lanes *flux, size_t n)
{
	lanes sum = { 0 };

	for (size_t i = 0; i < n; i++)
		sum += four_abs(flux[i]) * weight[i];
	return lanes_total(&sum, 1);
}

static const lanes *weight_of(const struct shooter *v, uint32_t source)
{
	return v->weight + v->components.of[source] * v->propagator.vectors;
}

/* What a side emits and has to send diffusely, by weight. */
static double weigh_own(const struct shooter *v, uint32_t ps)
{
	const size_t bands = (size_t)v->s->bands, n = v->propagator.vectors;
	const double *emission = v->s->unshot.emission + ps * bands;
	const double *weight = (const double *)weight_of(v, ps);
	double flux = 0;

	for (size_t k = 0; k < bands; k++)
		flux += emission[k];
	return flux * weight[solution_group(v->s, v->t->m, ps) * bands] +
	       weigh(weight_of(v, ps), v->propagator.unshot_diffuse + ps * n, n);
}

double radiosity_survey(struct shooter *v, double *worst)
{
	const struct transport *t = v->t;
	struct propagator *s = &v->propagator;
	size_t vectors = s->vectors;
	double top = 0;

	memset(v->unshot, 0, vectors * sizeof *v->unshot);
	memset(v->component_unshot, 0, v->components.n * vectors * sizeof *v->component_unshot);
	v->negative = 0;
	for (uint32_t i = 0; i < v->s->sources; i++) {
		const int is_light = i >= v->s->patch_sides;
		double no_cost = 1;
		load_emission(v, i, v->emission);
		count(v, i, v->emission, 1, &no_cost);
		if (is_light)
			continue;
		uint64_t link = t->target_link[i], links = t->target_link[i + 1] - link;
		raise(&top, weigh_own(v, i) / v->cost[i]);
		count(v, i, s->unshot_diffuse + i * vectors, 1, v->cost + i);
		raise(&top, count(v, i, s->unshot_link + 2 * link * vectors, 2 * links,
		                  v->link_cost + link));
	}
	*worst = worst_part(v);
	check_ledger(v);
	return top;
}

/* ---- whose turn it is ---- */

/* Whether flux is unshot, and has a priority. */
static int reaches(double flux, double cost, double least)
{
	return flux > 0 && flux >= least * cost;
}

static int own_is_due(const struct shooter *v, uint32_t ps, double least)
{
	return reaches(weigh_own(v, ps), v->cost[ps], least);
}

/* The first link of a side from l on that is due, by link and origin; or where its
 * links end. */
static uint64_t next_link(const struct shooter *v, uint32_t ps, uint64_t l, double least)
{
	const size_t n = v->propagator.vectors;
	const uint64_t end = 2 * v->t->target_link[ps + 1];
	const lanes *weight = weight_of(v, ps), *flux = v->propagator.unshot_link + l * n;

	for (; l < end; l++, flux += n)
		if (reaches(n == 1 ? weigh(weight, flux, 1) : weigh(weight, flux, n),
		            v->link_cost[l >> 1], least))
			break;
	return l;
}

int radiosity_is_due(const struct shooter *v, uint32_t ps, double least)
{
	return own_is_due(v, ps, least) ||
	       next_link(v, ps, 2 * v->t->target_link[ps], least) < 2 * v->t->target_link[ps + 1];
}

/* ---- shots ---- */

/* Sends flux by a row, scaled by channel if `share` is given. */
static void shoot_row(struct shooter *v, uint32_t row, int origin, const lanes *from,
                      const lanes *share, double *shot)
{
	lanes flux[VECTORS_MAX];
	size_t vectors = v->propagator.vectors, channels = v->propagator.channels;

	for (size_t i = 0; i < vectors; i++)
		flux[i] = share ? from[i] * share[i] : from[i];
	if (!(lanes_magnitude(flux, vectors) > 0))
		return;
	if (shot)
		shot += (2 * (size_t)row + (size_t)origin) * channels;
	for (size_t c = 0; shot && c < channels; c++)
		shot[c] += ((const double *)flux)[c];
	radiosity_propagate_row(&v->propagator, row, origin, flux, &v->booked);
}

void radiosity_shoot_diffuse(struct shooter *v, uint32_t ps, const lanes *flux, double *shot)
{
	if (v->t->diffuse_row[ps] != FF_NO_ROW)
		shoot_row(v, v->t->diffuse_row[ps], FROM_DIFFUSE, flux, NULL, shot);
}

void radiosity_shoot_link(struct shooter *v, uint64_t l, const lanes *flux, double *shot)
{
	const struct transport *t = v->t;
	const lanes *share = radiosity_propagator_share(&v->propagator, t->link_target[l >> 1]);

	for (uint64_t way = 0; way < 2; way++) {
		uint32_t row = t->link_row[(l & ~(uint64_t)1) + way];
		if (row != FF_NO_ROW)
			shoot_row(v, row, (int)(l & 1), flux, share + way * v->propagator.vectors,
			          shot);
	}
}

/* Moves unshot flux out of its array before it is sent: what comes back to the same
 * side during the shot waits for the next. */
static void take(lanes *from, lanes *to, lanes *out, size_t vectors)
{
	for (size_t i = 0; i < vectors; i++) {
		to[i] = from[i];
		out[i] += from[i];
		from[i] = (lanes){ 0 };
	}
}

/* Fetches what sending a link reads and writes. */
static void fetch_link(const struct shooter *v, uint32_t ps, uint64_t l, int ahead)
{
	const uint32_t *row = v->t->link_row + (l & ~(uint64_t)1);

	for (int way = 0; l < 2 * v->t->target_link[ps + 1] && way < 2; way++)
		if (row[way] != FF_NO_ROW)
			radiosity_propagate_fetch(&v->propagator, row[way], (int)(l & 1), ahead);
}

/* Links are short, so that reading them is waiting for memory: each is looked for AHEAD before,
 * one for each step of radiosity_propagate_fetch. Whether there were any. */
static int shoot_links(struct shooter *v, uint32_t ps, double least)
{
	enum { AHEAD = 3 };
	const struct transport *t = v->t;
	const uint64_t end = 2 * t->target_link[ps + 1];
	size_t vectors = v->propagator.vectors;
	lanes now[VECTORS_MAX];
	uint64_t l[AHEAD + 1] = { next_link(v, ps, 2 * t->target_link[ps], least) };

	if (l[0] == end)
		return 0;
	for (int k = 0; k < AHEAD; k++)
		l[k + 1] = l[k] < end ? next_link(v, ps, l[k] + 1, least) : end;
	while (l[0] < end) {
		for (int k = AHEAD; k > 0; k--)
			fetch_link(v, ps, l[k], k);
		take(v->propagator.unshot_link + l[0] * vectors, now, v->out, vectors);
		radiosity_shoot_link(v, l[0], now, v->s->shot);
		memmove(l, l + 1, AHEAD * sizeof *l);
		if (l[AHEAD] < end)
			l[AHEAD] = next_link(v, ps, l[AHEAD] + 1, least);
	}
	return 1;
}

void radiosity_book(struct shooter *v, const lanes *out)
{
	struct solution *s = v->s;
	size_t channels = v->propagator.channels;
	const double *absorbed = (const double *)v->booked.absorbed;
	const double *escaped = (const double *)v->booked.escaped;
	const double *lost = (const double *)v->booked.lost, *cut = (const double *)v->booked.cut;
	const double *kept = (const double *)v->booked.kept, *taken = (const double *)out;

	for (size_t c = 0; c < channels; c++) {
		double gone = absorbed[c] + escaped[c] + lost[c] + cut[c];
		s->ledger[LEDGER_ABSORBED * channels + c] += absorbed[c];
		s->ledger[LEDGER_ESCAPED * channels + c] += escaped[c];
		s->ledger[LEDGER_LOST * channels + c] += lost[c];
		s->ledger[LEDGER_CUT * channels + c] += cut[c];
		v->guessed += ((const double *)v->booked.guessed)[c];
		if (taken && s->ledger[c] > 0)
			v->residual = fmax(v->residual,
			                   fabs(taken[c] - gone - kept[c]) / s->ledger[c]);
	}
	radiosity_shot_ledger_clear(&v->booked);
}

static void take_emission(struct shooter *v, uint32_t source)
{
	size_t bands = (size_t)v->s->bands;

	load_emission(v, source, v->emission);
	memset(v->s->unshot.emission + source * bands, 0, bands * sizeof(double));
	for (size_t i = 0; i < v->propagator.vectors; i++)
		v->out[i] += v->emission[i];
}

static void shoot_own(struct shooter *v, uint32_t ps)
{
	const struct transport *t = v->t;
	size_t vectors = v->propagator.vectors;
	uint32_t row = t->emission_row[ps] != FF_NO_ROW ? t->emission_row[ps] : t->diffuse_row[ps];

	take_emission(v, ps);
	take(v->propagator.unshot_diffuse + ps * vectors, v->diffuse, v->out, vectors);
	if (row != FF_NO_ROW)
		shoot_row(v, row, FROM_EMITTER, v->emission, NULL, v->s->shot);
	radiosity_shoot_diffuse(v, ps, v->diffuse, v->s->shot);
}

void radiosity_shoot_side(struct shooter *v, uint32_t ps, double least)
{
	const int own = own_is_due(v, ps, least);

	memset(v->out, 0, v->propagator.vectors * sizeof *v->out);
	if (own)
		shoot_own(v, ps);
	if (!shoot_links(v, ps, least) && !own)
		return;
	radiosity_book(v, v->out);
	v->s->shots++;
}

void radiosity_shoot_light(struct shooter *v, uint32_t source)
{
	memset(v->out, 0, v->propagator.vectors * sizeof *v->out);
	take_emission(v, source);
	shoot_row(v, v->t->light_row[source - v->s->patch_sides], FROM_EMITTER, v->emission, NULL,
	          v->s->shot);
	radiosity_book(v, v->out);
	v->s->shots++;
}
