#include "solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "light.h"
#include "mem.h"

/* ---- the beginning and the end ---- */

double solver_emitted(const struct model *m, uint32_t source, int band)
{
	if (source >= 2 * m->patches)
		return light_flux(m, source - 2 * m->patches, band);
	if (!model_side_modelled(m, source))
		return 0;
	return m->patch_area[source >> 1] *
	       bsdf_exitance(&m->material, model_patch_material(m, source >> 1),
	                     (int)(source & 1), band);
}

static void weigh_components(struct solver *v)
{
	const struct solution *s = v->s;
	size_t bands = (size_t)s->bands, vectors = v->sender.vectors;

	for (uint32_t i = 0; i < s->sources; i++)
		for (int k = 0; k < s->bands; k++)
			v->emitted[v->parts.of[i] * s->groups + solution_group(s, v->t->m, i)] +=
				solver_emitted(v->t->m, i, k);
	for (size_t i = 0; i < v->parts.n; i++)
		for (size_t c = 0; c < v->sender.channels; c++) {
			double emitted = v->emitted[i * s->groups + c / bands];
			((double *)(v->weight + i * vectors))[c] = emitted > 0 ? 1 / emitted : 0;
		}
}

static double row_cost(const struct transport *t, uint32_t row)
{
	/* Runs that a block's head and an account of the shot are worth. */
	enum { HEAD = 16 };
	uint64_t b = t->row_block[row], end = t->row_block[row + 1];

	return (double)(t->block[end].run - t->block[b].run + HEAD * (1 + end - b));
}

static void set_costs(struct solver *v)
{
	const struct transport *t = v->t;

	for (uint32_t ps = 0; ps < v->s->patch_sides; ps++) {
		uint32_t row[2] = { t->diffuse_row[ps], t->emission_row[ps] };
		v->cost[ps] = row[0] == FF_NO_ROW && row[1] == FF_NO_ROW;
		for (int k = 0; k < 2; k++)
			v->cost[ps] = fmax(v->cost[ps], row[k] == FF_NO_ROW ? 0 : row_cost(t, row[k]));
	}
	for (size_t l = 0; l < t->links; l++)
		for (size_t way = 0; way < 2; way++)
			if (t->link_row[2 * l + way] != FF_NO_ROW)
				v->link_cost[l] += row_cost(t, t->link_row[2 * l + way]);
}

static int new_arrays(struct solver *v, struct err *e)
{
	size_t parts = v->parts.n, vectors = v->sender.vectors, sides = v->s->patch_sides;

	v->emitted = mem_new(parts * v->s->groups, sizeof *v->emitted, "priorities", e);
	v->cost = mem_new(sides, sizeof *v->cost, "priorities", e);
	v->link_cost = mem_new(v->t->links, sizeof *v->link_cost, "priorities", e);
	v->weight = lanes_new(parts * vectors, &v->room[0], "priorities", e);
	v->out = lanes_new(vectors, &v->room[1], "flux", e);
	v->emission = lanes_new(vectors, &v->room[2], "flux", e);
	v->diffuse = lanes_new(vectors, &v->room[3], "flux", e);
	v->unshot = lanes_new(vectors, &v->room[4], "flux", e);
	v->part = lanes_new(parts * vectors, &v->room[5], "priorities", e);
	return v->emitted && v->part && v->cost && v->link_cost && v->weight && v->out && v->emission && v->diffuse && v->unshot ? 0 : -1;
}

int solver_init(struct solver *v, struct solution *s, const struct transport *t,
                struct err *e)
{
	*v = (struct solver){ .s = s, .t = t };
	if (sender_init(&v->sender, t, s->groups, e) || sender_load(&v->sender, s, e) ||
	    sent_new(&v->sent, v->sender.vectors, e) || components_init(&v->parts, t, e) ||
	    new_arrays(v, e))
		return -1;
	weigh_components(v);
	set_costs(v);
	for (uint32_t ps = 0; ps < s->patch_sides; ps++)
		v->sides += t->diffuse_row[ps] != FF_NO_ROW || t->emission_row[ps] != FF_NO_ROW ||
		            t->target_link[ps] < t->target_link[ps + 1];
	return 0;
}

void solver_free(struct solver *v)
{
	for (size_t i = 0; i < sizeof v->room / sizeof *v->room; i++)
		free(v->room[i]);
	free(v->emitted);
	free(v->cost);
	free(v->link_cost);
	sent_free(&v->sent);
	sender_free(&v->sender);
	components_free(&v->parts);
}

/* ---- unshot flux ---- */

static void check_ledger(struct solver *v)
{
	const struct solution *s = v->s;
	size_t channels = v->sender.channels;

	for (size_t c = 0; c < channels; c++) {
		double in = s->ledger[c], out = ((const double *)v->unshot)[c];
		for (size_t term = LEDGER_ABSORBED; term < LEDGER_TERMS; term++)
			out += s->ledger[term * channels + c];
		if (in > 0)
			v->residual = fmax(v->residual, fabs(in - out) / in);
	}
}

/* Counts unshot flux of a source; its magnitude by weight. */
static double count(struct solver *v, uint32_t source, const lanes *flux)
{
	const size_t vectors = v->sender.vectors;
	const lanes *weight = v->weight + v->parts.of[source] * vectors;
	lanes *part = v->part + v->parts.of[source] * vectors, sum = { 0 }, below = { 0 };

	for (size_t i = 0; i < vectors; i++) {
		lanes magnitude = lanes_abs(flux[i]), weighted = magnitude * weight[i];
		v->unshot[i] += flux[i];
		part[i] += weighted;
		sum += weighted;
		below += magnitude - flux[i];
	}
	v->negative |= lanes_total(&below, 1) > 0;
	return lanes_total(&sum, 1);
}

/* The most that a component has unshot of a group, over what it emits of it. */
static double worst_part(const struct solver *v)
{
	const size_t bands = (size_t)v->s->bands;
	double worst = 0;

	for (size_t i = 0; i < v->parts.n; i++)
		for (size_t g = 0; g < v->s->groups; g++) {
			const double *part = (double *)(v->part + i * v->sender.vectors) + g * bands;
			double sum = 0;
			for (size_t k = 0; k < bands; k++)
				sum += part[k];
			worst = fmax(worst, sum);
		}
	return worst;
}

static void load_emission(const struct solver *v, uint32_t source, lanes *to)
{
	size_t bands = (size_t)v->s->bands;

	memset(to, 0, v->sender.vectors * sizeof *to);
	memcpy((double *)to + solution_group(v->s, v->t->m, source) * bands,
	       v->s->unshot_emission + source * bands, bands * sizeof(double));
}

double solver_survey(struct solver *v, double *worst)
{
	struct sender *s = &v->sender;
	size_t vectors = s->vectors;
	double top = 0;

	memset(v->unshot, 0, vectors * sizeof *v->unshot);
	memset(v->part, 0, v->parts.n * vectors * sizeof *v->part);
	v->negative = 0;
	for (uint32_t ps = 0; ps < v->s->patch_sides; ps++) {
		load_emission(v, ps, v->emission);
		double own = count(v, ps, v->emission) +
		             count(v, ps, s->unshot_diffuse + ps * vectors);
		top = fmax(top, own / v->cost[ps]);
		for (uint64_t l = 2 * v->t->target_link[ps]; l < 2 * v->t->target_link[ps + 1]; l++)
			top = fmax(top, count(v, ps, s->unshot_link + l * vectors) / v->link_cost[l >> 1]);
	}
	for (uint32_t i = (uint32_t)v->s->patch_sides; i < v->s->sources; i++) {
		load_emission(v, i, v->emission);
		count(v, i, v->emission);
	}
	*worst = worst_part(v);
	check_ledger(v);
	return top;
}

/* ---- whose turn it is ---- */

/* Magnitude of flux of a source by weight. */
static double weigh(const struct solver *v, uint32_t source, const lanes *flux)
{
	const size_t vectors = v->sender.vectors;
	const lanes *weight = v->weight + v->parts.of[source] * vectors;
	lanes sum = { 0 };

	for (size_t i = 0; i < vectors; i++)
		sum += lanes_abs(flux[i]) * weight[i];
	return lanes_total(&sum, 1);
}

/* Whether flux is unshot, and has a priority. */
static int reaches(double flux, double cost, double least)
{
	return flux > 0 && flux >= least * cost;
}

static int own_is_due(const struct solver *v, uint32_t ps, double least)
{
	size_t bands = (size_t)v->s->bands;
	const double *emission = v->s->unshot_emission + ps * bands;
	const double *weight = (const double *)(v->weight + v->parts.of[ps] * v->sender.vectors);
	double flux = 0;

	for (size_t k = 0; k < bands; k++)
		flux += emission[k];
	flux *= weight[solution_group(v->s, v->t->m, ps) * bands];
	flux += weigh(v, ps, v->sender.unshot_diffuse + ps * v->sender.vectors);
	return reaches(flux, v->cost[ps], least);
}

static int link_is_due(const struct solver *v, uint32_t ps, uint64_t l, double least)
{
	return reaches(weigh(v, ps, v->sender.unshot_link + l * v->sender.vectors),
	               v->link_cost[l >> 1], least);
}

int solver_is_due(const struct solver *v, uint32_t ps, double least)
{
	if (own_is_due(v, ps, least))
		return 1;
	for (uint64_t l = 2 * v->t->target_link[ps]; l < 2 * v->t->target_link[ps + 1]; l++)
		if (link_is_due(v, ps, l, least))
			return 1;
	return 0;
}

/* ---- shots ---- */

/* Sends flux by a row, scaled by channel if `share` is given. */
static void shoot_row(struct solver *v, uint32_t row, int freshness, const lanes *from,
                      const lanes *share, double *shot)
{
	lanes flux[VECTORS_MAX];
	size_t vectors = v->sender.vectors, channels = v->sender.channels;

	for (size_t i = 0; i < vectors; i++)
		flux[i] = share ? from[i] * share[i] : from[i];
	if (!(lanes_magnitude(flux, vectors) > 0))
		return;
	if (shot)
		shot += (2 * (size_t)row + (size_t)freshness) * channels;
	for (size_t c = 0; shot && c < channels; c++)
		shot[c] += ((const double *)flux)[c];
	send_row(&v->sender, row, freshness, flux, &v->sent);
}

void solver_send_diffuse(struct solver *v, uint32_t ps, const lanes *flux, double *shot)
{
	if (v->t->diffuse_row[ps] != FF_NO_ROW)
		shoot_row(v, v->t->diffuse_row[ps], MIXED, flux, NULL, shot);
}

void solver_lobe_shares(const struct solver *v, uint32_t ps, lanes *share)
{
	const struct model *m = v->t->m;
	const struct materials *mt = &m->material;
	uint32_t material = model_patch_material(m, ps >> 1);
	size_t at = material_at(mt, material, (int)(ps & 1)), vectors = v->sender.vectors;
	int lobe_r = bsdf_has_lobe(mt, material, (int)(ps & 1), 0);
	int lobe_t = bsdf_has_lobe(mt, material, (int)(ps & 1), 1);
	double *r = (double *)share, *t = (double *)(share + vectors);

	memset(share, 0, 2 * vectors * sizeof *share);
	for (size_t c = 0; c < v->sender.channels; c++) {
		size_t k = c % (size_t)m->bands;
		double rho = lobe_r ? mt->rho_s[at + k] : 0;
		double tau = lobe_t ? mt->tau_s[at + k] : 0;
		r[c] = rho + tau > 0 ? rho / (rho + tau) : 0;
		t[c] = rho + tau > 0 ? 1 - r[c] : 0;
	}
}

void solver_send_link(struct solver *v, uint64_t l, const lanes *flux, double *shot)
{
	const struct transport *t = v->t;
	lanes share[2 * VECTORS_MAX];

	solver_lobe_shares(v, t->link_target[l >> 1], share);
	for (uint64_t way = 0; way < 2; way++) {
		uint32_t row = t->link_row[(l & ~(uint64_t)1) + way];
		if (row != FF_NO_ROW)
			shoot_row(v, row, (int)(l & 1), flux, share + way * v->sender.vectors, shot);
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

/* The next link due from l on. */
static uint64_t next_link(const struct solver *v, uint32_t ps, uint64_t l, double least)
{
	const uint64_t end = 2 * v->t->target_link[ps + 1];

	while (l < end && !link_is_due(v, ps, l, least))
		l++;
	return l;
}

/* Fetches what sending a link reads; its heads alone, or its runs by them. */
static void fetch_link(const struct solver *v, uint32_t ps, uint64_t l, int runs)
{
	const uint32_t *row = v->t->link_row + (l & ~(uint64_t)1);

	for (int way = 0; l < 2 * v->t->target_link[ps + 1] && way < 2; way++)
		if (row[way] != FF_NO_ROW)
			send_fetch(v->t, row[way], runs);
}

/* Links are short, so that reading them is waiting for memory: each is looked for two
 * ahead. */
static void shoot_links(struct solver *v, uint32_t ps, double least)
{
	const struct transport *t = v->t;
	size_t vectors = v->sender.vectors;
	lanes now[VECTORS_MAX];
	uint64_t l = next_link(v, ps, 2 * t->target_link[ps], least), later, next;

	next = next_link(v, ps, l + 1, least);
	for (; l < 2 * t->target_link[ps + 1]; l = next, next = later) {
		lanes *u = v->sender.unshot_link + l * vectors;
		later = next_link(v, ps, next + 1, least);
		fetch_link(v, ps, later, 0);
		fetch_link(v, ps, next, 1);
		take(u, now, v->out, vectors);
		solver_send_link(v, l, now, v->s->shot);
	}
}

void solver_book(struct solver *v, const lanes *out)
{
	struct solution *s = v->s;
	size_t channels = v->sender.channels;
	const double *absorbed = (const double *)v->sent.absorbed;
	const double *escaped = (const double *)v->sent.escaped;
	const double *lost = (const double *)v->sent.lost, *cut = (const double *)v->sent.cut;
	const double *kept = (const double *)v->sent.kept, *taken = (const double *)out;

	for (size_t c = 0; c < channels; c++) {
		double gone = absorbed[c] + escaped[c] + lost[c] + cut[c];
		s->ledger[LEDGER_ABSORBED * channels + c] += absorbed[c];
		s->ledger[LEDGER_ESCAPED * channels + c] += escaped[c];
		s->ledger[LEDGER_LOST * channels + c] += lost[c];
		s->ledger[LEDGER_CUT * channels + c] += cut[c];
		v->guessed += ((const double *)v->sent.guessed)[c];
		if (s->ledger[c] > 0)
			v->residual = fmax(v->residual,
			                   fabs(taken[c] - gone - kept[c]) / s->ledger[c]);
	}
	sent_clear(&v->sent);
}

static void take_emission(struct solver *v, uint32_t source)
{
	size_t bands = (size_t)v->s->bands;

	load_emission(v, source, v->emission);
	memset(v->s->unshot_emission + source * bands, 0, bands * sizeof(double));
	for (size_t i = 0; i < v->sender.vectors; i++)
		v->out[i] += v->emission[i];
}

static void shoot_own(struct solver *v, uint32_t ps)
{
	const struct transport *t = v->t;
	size_t vectors = v->sender.vectors;
	uint32_t row = t->emission_row[ps] != FF_NO_ROW ? t->emission_row[ps] : t->diffuse_row[ps];

	take_emission(v, ps);
	take(v->sender.unshot_diffuse + ps * vectors, v->diffuse, v->out, vectors);
	if (row != FF_NO_ROW)
		shoot_row(v, row, FRESH, v->emission, NULL, v->s->shot);
	solver_send_diffuse(v, ps, v->diffuse, v->s->shot);
}

void solver_shoot(struct solver *v, uint32_t ps, double least)
{
	memset(v->out, 0, v->sender.vectors * sizeof *v->out);
	if (own_is_due(v, ps, least))
		shoot_own(v, ps);
	shoot_links(v, ps, least);
	solver_book(v, v->out);
	v->s->shots++;
}

void solver_shoot_light(struct solver *v, uint32_t source)
{
	memset(v->out, 0, v->sender.vectors * sizeof *v->out);
	take_emission(v, source);
	shoot_row(v, v->t->light_row[source - v->s->patch_sides], FRESH, v->emission, NULL,
	          v->s->shot);
	solver_book(v, v->out);
	v->s->shots++;
}
