#include "radiosity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "components.h"
#include "mem.h"
#include "send.h"

/* ---- the beginning ---- */

static int solution_arrays(struct solution *s, const struct model *m,
                           const struct transport *t, struct err *e)
{
	size_t bands = (size_t)m->bands, es = 2 * m->elements, ps = 2 * m->patches;

	*s = (struct solution){ .groups = 1, .element_sides = es, .bands = m->bands,
	                        .patch_sides = ps, .links = t->links, .rows = t->rows };
	s->direct = mem_new(es, bands * sizeof(double), "irradiance", e);
	s->caustic = mem_new(es, bands * sizeof(double), "irradiance", e);
	s->indirect = mem_new(es, bands * sizeof(double), "irradiance", e);
	s->error = mem_new(es, bands * sizeof(double), "irradiance", e);
	s->error_direct = mem_new(es, bands * sizeof(double), "irradiance", e);
	s->discretisation = mem_new(es, bands * sizeof(double), "irradiance", e);
	s->unshot_emission = mem_new(ps, bands * sizeof(double), "unshot flux", e);
	s->unshot_diffuse = mem_new(ps, bands * sizeof(double), "unshot flux", e);
	s->unshot_link = mem_new(t->links, 2 * bands * sizeof(double), "unshot flux", e);
	s->shot = mem_new(t->rows, 2 * bands * sizeof(double), "shot flux", e);
	s->ledger = mem_new(LEDGER_TERMS, bands * sizeof(double), "ledger", e);
	return s->direct && s->caustic && s->indirect && s->error && s->error_direct && s->discretisation &&
	       s->unshot_emission && s->unshot_diffuse && s->unshot_link && s->shot && s->ledger ? 0 : -1;
}

int solution_begin(struct solution *s, const struct model *m, const struct transport *t,
                   struct err *e)
{
	double all = 0;

	if (solution_arrays(s, m, t, e))
		return -1;
	for (uint32_t i = 0; i < 2 * m->patches; i++) {
		if (!model_side_modelled(m, i))
			continue;
		for (int k = 0; k < m->bands; k++) {
			double flux = m->patch_area[i >> 1] *
			              bsdf_exitance(&m->material, model_patch_material(m, i >> 1),
			                            (int)(i & 1), k);
			s->unshot_emission[i * (size_t)m->bands + (size_t)k] = flux;
			s->ledger[LEDGER_EMITTED * m->bands + k] += flux;
			all += flux;
		}
	}
	if (!(all > 0))
		return err_set(e, "no emitter: nothing in this scene gives light; give a material "
		               "emission (glTF emissiveFactor, or emission_front in its extras)");
	if (!isfinite(all))
		return err_set(e, "the emitted flux is not a finite number");
	return 0;
}

/* ---- shots ---- */

struct solver {
	struct solution *s;
	const struct transport *t;
	struct sender sender;
	struct components parts;
	double *weight;          /* [2P] 1 / flux emitted in the side's component */
	double *priority;        /* [2P] unshot flux by weight when the round began */
	double *links;           /* [2P] unshot flux of a side's links then, all bands */
	lanes unshot[GROUPS_MAX];/* in all, then */
	double guessed, residual;
};

static double total(const double *x, size_t n)
{
	double sum = 0;

	for (size_t i = 0; i < n; i++)
		sum += x[i];
	return sum;
}

/* Unshot flux of the links of a patch-side. */
static lanes link_unshot(const struct solver *v, uint32_t ps, size_t group)
{
	const struct sender *s = &v->sender;
	const uint64_t *first = v->t->target_link + ps;
	lanes fresh = { 0 }, mixed = { 0 };

	for (uint64_t l = 2 * first[0]; l < 2 * first[1]; l += 2) {
		fresh += s->unshot_link[l * s->groups + group];
		mixed += s->unshot_link[(l + 1) * s->groups + group];
	}
	return fresh + mixed;
}

/* Unshot flux of a patch-side but for its links. */
static double plain_unshot(const struct solver *v, uint32_t ps)
{
	const struct sender *s = &v->sender;

	return total(v->s->unshot_emission + ps * (size_t)s->bands, (size_t)s->bands) +
	       lanes_total(s->unshot_diffuse + ps * s->groups, s->groups);
}

static double all_unshot(const struct solver *v, uint32_t ps)
{
	double links = 0;

	for (size_t g = 0; g < v->sender.groups; g++) {
		lanes x = link_unshot(v, ps, g);
		links += lanes_total(&x, 1);
	}
	return plain_unshot(v, ps) + links;
}

/* Sends what a side's unshot flux was by a row, scaled per band if `part` is given. */
static void shoot_row(struct solver *v, uint32_t row, int freshness, const lanes *from,
                      const lanes *part, struct sent *sent)
{
	lanes flux[GROUPS_MAX];
	size_t groups = v->sender.groups, bands = (size_t)v->s->bands;
	double *shot = v->s->shot + (2 * (size_t)row + (size_t)freshness) * bands;

	for (size_t g = 0; g < groups; g++)
		flux[g] = part ? from[g] * part[g] : from[g];
	if (!(lanes_total(flux, groups) > 0))
		return;
	for (size_t k = 0; k < bands; k++)
		shot[k] += ((const double *)flux)[k];
	send_row(&v->sender, row, freshness, flux, sent);
}

/* The shares of a target's directional flux that leave by R and by T. */
static void lobe_shares(const struct model *m, uint32_t ps, lanes share[2][GROUPS_MAX])
{
	const struct materials *mt = &m->material;
	uint32_t material = model_patch_material(m, ps >> 1);
	size_t at = material_at(mt, material, (int)(ps & 1));
	int lobe_r = bsdf_has_lobe(mt, material, (int)(ps & 1), 0);
	int lobe_t = bsdf_has_lobe(mt, material, (int)(ps & 1), 1);
	double *r = (double *)share[0], *t = (double *)share[1];

	memset(share, 0, 2 * sizeof *share);
	for (int k = 0; k < m->bands; k++) {
		double rho = lobe_r ? mt->rho_s[at + (size_t)k] : 0;
		double tau = lobe_t ? mt->tau_s[at + (size_t)k] : 0;
		r[k] = rho + tau > 0 ? rho / (rho + tau) : 0;
		t[k] = rho + tau > 0 ? 1 - r[k] : 0;
	}
}

/* Moves unshot flux out of its array before it is sent: what comes back to the same
 * side during the shot waits for the next. */
static void take(lanes *from, lanes *to, lanes *out, size_t groups)
{
	for (size_t g = 0; g < groups; g++) {
		to[g] = from[g];
		out[g] += from[g];
		from[g] = (lanes){ 0 };
	}
}

static void shoot_links(struct solver *v, uint32_t ps, struct sent *sent, lanes *out)
{
	const struct transport *t = v->t;
	size_t groups = v->sender.groups;
	lanes share[2][GROUPS_MAX], now[GROUPS_MAX];

	if (t->target_link[ps] == t->target_link[ps + 1])
		return;
	lobe_shares(t->m, ps, share);
	for (uint64_t l = 2 * t->target_link[ps]; l < 2 * t->target_link[ps + 1]; l++) {
		lanes *u = v->sender.unshot_link + l * groups;
		if (!(lanes_total(u, groups) > 0))
			continue;
		take(u, now, out, groups);
		for (uint64_t way = 0; way < 2; way++) {
			uint32_t row = t->link_row[(l & ~(uint64_t)1) + way];
			if (row != FF_NO_ROW)
				shoot_row(v, row, (int)(l & 1), now, share[way], sent);
		}
	}
}

static void book(struct solver *v, const struct sent *sent, const double *out)
{
	struct solution *s = v->s;
	const double *absorbed = (const double *)sent->absorbed, *lost = (const double *)sent->lost;
	const double *escaped = (const double *)sent->escaped, *cut = (const double *)sent->cut;
	const double *kept = (const double *)sent->kept;
	int bands = s->bands;

	for (int k = 0; k < bands; k++) {
		double gone = absorbed[k] + escaped[k] + lost[k] + cut[k];
		s->ledger[LEDGER_ABSORBED * bands + k] += absorbed[k];
		s->ledger[LEDGER_ESCAPED * bands + k] += escaped[k];
		s->ledger[LEDGER_LOST * bands + k] += lost[k];
		s->ledger[LEDGER_CUT * bands + k] += cut[k];
		v->guessed += ((const double *)sent->guessed)[k];
		if (s->ledger[k] > 0)
			v->residual = fmax(v->residual,
			                   fabs(out[k] - gone - kept[k]) / s->ledger[k]);
	}
}

static void take_emission(struct solver *v, uint32_t ps, lanes *to, lanes *out)
{
	size_t bands = (size_t)v->s->bands;
	double *from = v->s->unshot_emission + ps * bands;

	memset(to, 0, v->sender.groups * sizeof *to);
	memcpy(to, from, bands * sizeof *from);
	memset(from, 0, bands * sizeof *from);
	for (size_t g = 0; g < v->sender.groups; g++)
		out[g] += to[g];
}

static void shoot_side(struct solver *v, uint32_t ps)
{
	const struct transport *t = v->t;
	size_t groups = v->sender.groups;
	struct sent sent = { 0 };
	lanes emission[GROUPS_MAX], diffuse[GROUPS_MAX], out[GROUPS_MAX] = { { 0 } };
	uint32_t row = t->diffuse_row[ps], lobe = t->emission_row[ps];

	take_emission(v, ps, emission, out);
	take(v->sender.unshot_diffuse + ps * groups, diffuse, out, groups);
	if (lobe != FF_NO_ROW)
		shoot_row(v, lobe, FRESH, emission, NULL, &sent);
	else if (row != FF_NO_ROW)
		shoot_row(v, row, FRESH, emission, NULL, &sent);
	if (row != FF_NO_ROW)
		shoot_row(v, row, MIXED, diffuse, NULL, &sent);
	shoot_links(v, ps, &sent, out);
	book(v, &sent, (const double *)out);
	v->s->shots++;
}

/* ---- rounds ---- */

static void check_ledger(struct solver *v)
{
	const struct solution *s = v->s;
	int bands = s->bands;

	for (int k = 0; k < bands; k++) {
		double in = s->ledger[k], out = ((const double *)v->unshot)[k];
		for (int term = LEDGER_ABSORBED; term < LEDGER_TERMS; term++)
			out += s->ledger[term * bands + k];
		if (in > 0)
			v->residual = fmax(v->residual, fabs(in - out) / in);
	}
}

/* Unshot flux of a side by band is added to v->unshot, that of its links kept. */
static void survey_side(struct solver *v, uint32_t ps)
{
	const struct sender *s = &v->sender;
	const double *emission = v->s->unshot_emission + ps * (size_t)s->bands;

	for (int k = 0; k < s->bands; k++)
		((double *)v->unshot)[k] += emission[k];
	v->links[ps] = s->link_gain[ps] = 0;
	for (size_t g = 0; g < s->groups; g++) {
		lanes x = link_unshot(v, ps, g);
		v->links[ps] += lanes_total(&x, 1);
		v->unshot[g] += x + s->unshot_diffuse[ps * s->groups + g];
	}
	v->priority[ps] = (plain_unshot(v, ps) + v->links[ps]) * v->weight[ps];
}

/* Sets v->priority, v->links and v->unshot. Returns the largest priority; unshot /
 * emitted of the worst component goes to *worst. */
static double survey(struct solver *v, double *worst)
{
	struct components *c = &v->parts;
	double top = 0;

	memset(v->unshot, 0, sizeof v->unshot);
	memset(c->sum, 0, c->n * sizeof *c->sum);
	for (uint32_t ps = 0; ps < v->s->patch_sides; ps++) {
		survey_side(v, ps);
		c->sum[c->of[ps]] += v->priority[ps];
		top = fmax(top, v->priority[ps]);
	}
	*worst = 0;
	for (uint32_t i = 0; i < c->n; i++)
		*worst = fmax(*worst, c->sum[i]);
	return top;
}

/* Whether a side's turn has come, by its unshot flux now. Flux has only grown since the
 * survey, and running sums tell all but the close cases: links are many. */
static int is_due(const struct solver *v, uint32_t ps)
{
	const double least = v->s->round[0], close = 1e-9;

	if (v->priority[ps] > 0 && v->priority[ps] >= least)
		return 1;
	double about = (plain_unshot(v, ps) + v->links[ps] + v->sender.link_gain[ps]) *
	               v->weight[ps];
	if (about < least * (1 - close))
		return 0;
	double p = all_unshot(v, ps) * v->weight[ps];
	return p > 0 && p >= least;
}

/* Shoots the rest of the current round; 0 when max_shots stopped it. */
static int finish_round(struct solver *v, uint64_t last_shot)
{
	struct solution *s = v->s;

	for (uint32_t ps = (uint32_t)s->round[1]; ps < s->patch_sides; ps++) {
		if (!is_due(v, ps))
			continue;
		if (s->shots >= last_shot) {
			s->round[1] = ps;
			return 0;
		}
		shoot_side(v, ps);
	}
	s->round[0] = s->round[1] = 0;
	return 1;
}

static void rounds(struct solver *v, const struct radiosity_options *o,
                   const struct radiosity_hooks *hooks, struct radiosity_report *r)
{
	struct solution *s = v->s;
	uint64_t last = o->max_shots > UINT64_MAX - s->shots ? UINT64_MAX : s->shots + o->max_shots;
	double top = survey(v, &r->unshot);
	int whole = 1;

	while (whole && (r->unshot > o->stop || s->round[0] != 0)) {
		if (s->round[0] == 0)
			s->round[0] = top / 2;
		whole = finish_round(v, last);
		top = survey(v, &r->unshot);
		check_ledger(v);
		r->rounds++;
		if (hooks && hooks->step)
			hooks->step(hooks->arg, &(struct radiosity_step){ r->rounds, s->shots,
			            s->bands, (const double *)v->unshot, s->ledger, v->residual });
	}
	sender_store(&v->sender, s);
}

static int solver_init(struct solver *v, struct solution *s, const struct transport *t,
                       struct err *e)
{
	*v = (struct solver){ .s = s, .t = t };
	v->weight = mem_new(s->patch_sides, sizeof *v->weight, "priorities", e);
	v->priority = mem_new(s->patch_sides, sizeof *v->priority, "priorities", e);
	v->links = mem_new(s->patch_sides, sizeof *v->links, "priorities", e);
	if (!v->weight || !v->priority || !v->links || sender_init(&v->sender, t, e) || sender_load(&v->sender, s, e) ||
	    components_init(&v->parts, t, e))
		return -1;
	for (uint32_t ps = 0; ps < s->patch_sides; ps++)
		for (int k = 0; k < s->bands; k++)
			v->parts.emitted[v->parts.of[ps]] += t->m->patch_area[ps >> 1] *
				(model_side_modelled(t->m, ps)
				 ? bsdf_exitance(&t->m->material, model_patch_material(t->m, ps >> 1),
				                 (int)(ps & 1), k) : 0);
	for (uint32_t ps = 0; ps < s->patch_sides; ps++) {
		double emitted = v->parts.emitted[v->parts.of[ps]];
		v->weight[ps] = emitted > 0 ? 1 / emitted : 0;
	}
	return 0;
}

int radiosity_shoot(struct solution *s, const struct transport *t,
                    const struct radiosity_options *o, const struct radiosity_hooks *hooks,
                    struct radiosity_report *r, struct err *e)
{
	struct solver v;
	double emitted = 0;
	int bad = solver_init(&v, s, t, e) || components_need_sink(t, e);

	*r = (struct radiosity_report){ 0 };
	if (!bad) {
		rounds(&v, o, hooks, r);
		for (uint32_t i = 0; i < v.parts.n; i++)
			r->components += v.parts.emitted[i] > 0;
		for (int k = 0; k < s->bands; k++)
			emitted += s->ledger[k];
		r->residual = v.residual;
		r->guessed = v.guessed / emitted;
		r->solve_bytes = v.sender.bytes;
		r->bound = lanes_total(v.unshot, v.sender.groups) / emitted *
		           radiosity_tail_bound(t, o->threads, &r->solve_bytes);
	}
	free(v.weight);
	free(v.priority);
	free(v.links);
	sender_free(&v.sender);
	components_free(&v.parts);
	return bad ? -1 : 0;
}
