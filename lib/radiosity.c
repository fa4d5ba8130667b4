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
	s->unshot_emission = mem_new(ps, bands * sizeof(double), "unshot flux", e);
	s->unshot_diffuse = mem_new(ps, bands * sizeof(double), "unshot flux", e);
	s->unshot_link = mem_new(t->links, 2 * bands * sizeof(double), "unshot flux", e);
	s->shot = mem_new(t->rows, 2 * bands * sizeof(double), "shot flux", e);
	s->ledger = mem_new(LEDGER_TERMS, bands * sizeof(double), "ledger", e);
	return s->direct && s->caustic && s->indirect && s->error && s->unshot_emission &&
	       s->unshot_diffuse && s->unshot_link && s->shot && s->ledger ? 0 : -1;
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
	double guessed, residual;
};

static double total(const double *x, size_t n)
{
	double sum = 0;

	for (size_t i = 0; i < n; i++)
		sum += x[i];
	return sum;
}

/* Unshot flux of a patch-side over what its component emits. */
static double priority(const struct solver *v, uint32_t ps)
{
	const struct solution *s = v->s;
	size_t bands = (size_t)s->bands, at = ps * bands;
	const double *diffuse = sender_unshot(&v->sender, ps);
	uint64_t first = v->t->target_link[ps], n = v->t->target_link[ps + 1] - first;
	double sum = 0;

	for (size_t k = 0; k < bands; k++)
		sum += s->unshot_emission[at + k] + diffuse[k];
	if (n)
		sum += total(s->unshot_link + 2 * first * bands, 2 * n * bands);
	return sum * v->weight[ps];
}

/* Sends what `from` holds (and clears it) by a row, scaled per band. */
static void shoot_row(struct solver *v, uint32_t row, int freshness, const double *from,
                      const double *part, struct sent *sent)
{
	double flux[BANDS_MAX], any = 0;
	int bands = v->s->bands;
	double *shot = v->s->shot + (2 * (size_t)row + (size_t)freshness) * (size_t)bands;

	for (int k = 0; k < bands; k++) {
		flux[k] = from[k] * (part ? part[k] : 1);
		shot[k] += flux[k];
		any += flux[k];
	}
	if (any > 0)
		send_row(&v->sender, v->s, row, freshness, flux, sent);
}

/* The shares of a target's directional flux that leave by R and by T. */
static void lobe_shares(const struct model *m, uint32_t ps, double *r, double *t)
{
	const struct materials *mt = &m->material;
	uint32_t material = model_patch_material(m, ps >> 1);
	size_t at = material_at(mt, material, (int)(ps & 1));
	int lobe_r = bsdf_has_lobe(mt, material, (int)(ps & 1), 0);
	int lobe_t = bsdf_has_lobe(mt, material, (int)(ps & 1), 1);

	for (int k = 0; k < m->bands; k++) {
		double rho = lobe_r ? mt->rho_s[at + (size_t)k] : 0;
		double tau = lobe_t ? mt->tau_s[at + (size_t)k] : 0;
		r[k] = rho + tau > 0 ? rho / (rho + tau) : 0;
		t[k] = rho + tau > 0 ? 1 - r[k] : 0;
	}
}

static void shoot_links(struct solver *v, uint32_t ps, struct sent *sent, double *out)
{
	const struct transport *t = v->t;
	size_t bands = (size_t)v->s->bands;
	double share[2][BANDS_MAX], now[BANDS_MAX];

	lobe_shares(t->m, ps, share[0], share[1]);
	for (uint64_t l = t->target_link[ps]; l < t->target_link[ps + 1]; l++)
		for (int fresh = 0; fresh < 2; fresh++) {
			double *u = v->s->unshot_link + (2 * l + (size_t)fresh) * bands;
			if (!(total(u, bands) > 0))
				continue;
			for (size_t k = 0; k < bands; k++) {
				now[k] = u[k];
				out[k] += u[k];
				u[k] = 0;
			}
			for (int way = 0; way < 2; way++)
				if (t->link_row[2 * l + (size_t)way] != FF_NO_ROW)
					shoot_row(v, t->link_row[2 * l + (size_t)way], fresh, now,
					          share[way], sent);
		}
}

/* Moves a side's unshot flux out of its array before it is sent: what comes back
 * to the same side during the shot waits for the next. */
static void take(double *from, double *to, double *out, int bands)
{
	for (int k = 0; k < bands; k++) {
		to[k] = from[k];
		out[k] += from[k];
		from[k] = 0;
	}
}

static void book(struct solver *v, const struct sent *sent, const double *out)
{
	struct solution *s = v->s;
	int bands = s->bands;

	for (int k = 0; k < bands; k++) {
		double gone = sent->absorbed[k] + sent->escaped[k] + sent->lost[k] + sent->cut[k];
		s->ledger[LEDGER_ABSORBED * bands + k] += sent->absorbed[k];
		s->ledger[LEDGER_ESCAPED * bands + k] += sent->escaped[k];
		s->ledger[LEDGER_LOST * bands + k] += sent->lost[k];
		s->ledger[LEDGER_CUT * bands + k] += sent->cut[k];
		v->guessed += sent->guessed[k];
		if (s->ledger[k] > 0)
			v->residual = fmax(v->residual,
			                   fabs(out[k] - gone - sent->kept[k]) / s->ledger[k]);
	}
}

static void shoot_side(struct solver *v, uint32_t ps)
{
	struct solution *s = v->s;
	const struct transport *t = v->t;
	struct sent sent = { 0 };
	double emission[BANDS_MAX], diffuse[BANDS_MAX], out[BANDS_MAX] = { 0 };
	size_t at = ps * (size_t)s->bands;
	uint32_t row = t->diffuse_row[ps], lobe = t->emission_row[ps];

	take(s->unshot_emission + at, emission, out, s->bands);
	take(sender_unshot(&v->sender, ps), diffuse, out, s->bands);
	if (lobe != FF_NO_ROW)
		shoot_row(v, lobe, FRESH, emission, NULL, &sent);
	else if (row != FF_NO_ROW)
		shoot_row(v, row, FRESH, emission, NULL, &sent);
	if (row != FF_NO_ROW)
		shoot_row(v, row, MIXED, diffuse, NULL, &sent);
	shoot_links(v, ps, &sent, out);
	book(v, &sent, out);
	s->shots++;
}

/* ---- rounds ---- */

static void unshot_by_band(const struct solution *s, double *sum)
{
	size_t bands = (size_t)s->bands;

	memset(sum, 0, bands * sizeof *sum);
	for (size_t i = 0; i < s->patch_sides; i++)
		for (size_t k = 0; k < bands; k++)
			sum[k] += s->unshot_emission[i * bands + k] + s->unshot_diffuse[i * bands + k];
	for (size_t i = 0; i < 2 * s->links; i++)
		for (size_t k = 0; k < bands; k++)
			sum[k] += s->unshot_link[i * bands + k];
}

static void check_ledger(struct solver *v, const double *unshot)
{
	const struct solution *s = v->s;
	int bands = s->bands;

	for (int k = 0; k < bands; k++) {
		double in = s->ledger[k], out = unshot[k];
		for (int term = LEDGER_ABSORBED; term < LEDGER_TERMS; term++)
			out += s->ledger[term * bands + k];
		if (in > 0)
			v->residual = fmax(v->residual, fabs(in - out) / in);
	}
}

/* Largest priority; unshot / emitted of the worst component goes to *worst. */
static double survey(struct solver *v, double *worst)
{
	struct components *c = &v->parts;
	double top = 0;

	memset(c->sum, 0, c->n * sizeof *c->sum);
	for (uint32_t ps = 0; ps < v->s->patch_sides; ps++) {
		double p = priority(v, ps);
		c->sum[c->of[ps]] += p;
		top = fmax(top, p);
	}
	*worst = 0;
	for (uint32_t i = 0; i < c->n; i++)
		*worst = fmax(*worst, c->sum[i]);
	return top;
}

/* Shoots the rest of the current round; 0 when max_shots stopped it. */
static int finish_round(struct solver *v, uint64_t last_shot)
{
	struct solution *s = v->s;

	for (uint32_t ps = (uint32_t)s->round[1]; ps < s->patch_sides; ps++) {
		double p = priority(v, ps);
		if (!(p > 0) || p < s->round[0])
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
	double unshot[BANDS_MAX];

	for (;;) {
		double top = survey(v, &r->unshot);
		if (r->unshot <= o->stop && s->round[0] == 0)
			break;
		if (s->round[0] == 0)
			s->round[0] = top / 2;
		int whole = finish_round(v, last);
		sender_store(&v->sender, s);
		unshot_by_band(s, unshot);
		check_ledger(v, unshot);
		r->rounds++;
		if (hooks && hooks->step)
			hooks->step(hooks->arg, &(struct radiosity_step){ r->rounds, s->shots,
			            s->bands, unshot, s->ledger, v->residual });
		if (!whole)
			break;
	}
	survey(v, &r->unshot);
}

static int solver_init(struct solver *v, struct solution *s, const struct transport *t,
                       struct err *e)
{
	*v = (struct solver){ .s = s, .t = t };
	v->weight = mem_new(s->patch_sides, sizeof *v->weight, "priorities", e);
	if (!v->weight || sender_init(&v->sender, t, e) || sender_load(&v->sender, s, e) ||
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
	double emitted = 0, unshot[BANDS_MAX];
	int bad = solver_init(&v, s, t, e) || components_need_sink(t, e);

	*r = (struct radiosity_report){ 0 };
	if (!bad) {
		rounds(&v, o, hooks, r);
		for (uint32_t i = 0; i < v.parts.n; i++)
			r->components += v.parts.emitted[i] > 0;
		for (int k = 0; k < s->bands; k++)
			emitted += s->ledger[k];
		unshot_by_band(s, unshot);
		r->residual = v.residual;
		r->guessed = v.guessed / emitted;
		r->solve_bytes = v.sender.bytes;
		r->bound = total(unshot, (size_t)s->bands) / emitted * radiosity_tail_bound(t, o->threads);
	}
	free(v.weight);
	sender_free(&v.sender);
	components_free(&v.parts);
	return bad ? -1 : 0;
}
