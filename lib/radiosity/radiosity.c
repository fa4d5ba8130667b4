#include "lib/radiosity/radiosity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/radiosity/light_groups.h"
#include "lib/radiosity/shoot.h"
#include "lib/radiosity/truncation_bound.h"

/* ---- the beginning ---- */

static int solution_arrays(struct solution *s, const struct model *m,
                           const struct transport *t, struct err *e)
{
	size_t bands = (size_t)m->bands, es = 2 * m->element.n, ps = 2 * m->patch.n;
	size_t channels = solution_channels(s), sides = s->groups * es;

	s->element_sides = es;
	s->patch_sides = ps;
	s->sources = model_sources(m);
	s->links = t->links;
	s->rows = t->rows;
	const struct mem_array array[] = {
		MEM_ARRAY(s->irradiance.direct, sides, bands),
		MEM_ARRAY(s->irradiance.caustic, sides, bands),
		MEM_ARRAY(s->irradiance.indirect, sides, bands),
		MEM_ARRAY(s->error.sampling, es, bands),
		MEM_ARRAY(s->error.sampling_direct, es, bands),
		MEM_ARRAY(s->error.discretisation, es, bands),
		MEM_ARRAY(s->error.discretisation_direct, es, bands),
		MEM_ARRAY(s->error.uneven, es, bands),
		MEM_ARRAY(s->uneven, sides, bands),
		MEM_ARRAY(s->unshot.emission, s->sources, bands),
		MEM_ARRAY(s->unshot.diffuse, ps, channels),
		MEM_ARRAY(s->unshot.link, t->links, 2 * channels),
		MEM_ARRAY(s->shot, t->rows, 2 * channels),
		MEM_ARRAY(s->ledger, LEDGER_TERMS, channels)
	};
	return mem_new_arrays(array, sizeof array / sizeof *array, "solution", e);
}

/* Flux, in the scene's unit: what is larger cannot be squared for variances (DBL_MAX is
 * 1.8e308). */
static const double brightest = 1e150;

int radiosity_begin(struct solution *s, const struct model *m, const struct transport *t,
                    int light_groups, struct err *e)
{
	double all = 0;

	*s = (struct solution){ .bands = m->bands };
	if (radiosity_groups_set(s, m, light_groups, e) || solution_arrays(s, m, t, e))
		return -1;
	for (uint32_t i = 0; i < s->sources; i++)
		for (int k = 0; k < m->bands; k++) {
			uint32_t group = solution_group(s, m, i);
			double flux = radiosity_emitted(m, i, k);
			s->unshot.emission[i * (size_t)m->bands + (size_t)k] = flux;
			s->ledger[group * (size_t)m->bands + (size_t)k] += flux;
			all += flux;
		}
	if (!(all > 0))
		return err_set(e, "no emitter: nothing in this scene gives light; give a material "
		               "emission (glTF emissiveFactor, or emission_front in its extras) or "
		               "add a light (KHR_lights_punctual)");
	if (!(all < brightest))
		return err_set(e, "the emitted flux, %g, is too large to compute with; lower the "
		               "emission of the materials and lights", all);
	return 0;
}

/* ---- rounds ---- */

/* Lights come before the first round, whatever they are worth: they shoot once. 0 when the
 * last shot stopped it. */
static int shoot_lights(struct shooter *v, uint64_t last_shot)
{
	const struct solution *s = v->s;
	size_t bands = (size_t)s->bands;

	for (uint32_t i = (uint32_t)s->patch_sides; i < s->sources; i++) {
		double unshot = 0;
		for (size_t k = 0; k < bands; k++)
			unshot += s->unshot.emission[i * bands + k];
		if (!(unshot > 0))
			continue;
		if (s->shots >= last_shot)
			return 0;
		radiosity_shoot_light(v, i);
	}
	return 1;
}

/* Shoots the rest of the current round; 0 when the last shot stopped it. */
static int finish_round(struct shooter *v, uint64_t last_shot)
{
	struct solution *s = v->s;
	const double least = s->round[ROUND_LEAST];

	for (uint32_t ps = (uint32_t)s->round[ROUND_NEXT]; ps < s->patch_sides; ps++) {
		if (s->shots < last_shot) {
			radiosity_shoot_side(v, ps, least);
		} else if (radiosity_is_due(v, ps, least)) {
			s->round[ROUND_NEXT] = ps;
			return 0;
		}
	}
	s->round[ROUND_LEAST] = s->round[ROUND_NEXT] = 0;
	return 1;
}

/* ---- when to overshoot ---- */

/* Enters what has been read since the last time. */
static void count_work(struct shooter *v)
{
	v->s->round[ROUND_WORK] += (double)(v->propagator.runs - v->counted);
	v->counted = v->propagator.runs;
}

/* Sweeps, of as many runs as there are, over which the rate of convergence is taken: a guess;
 * one has to be over before there is any rate. */
enum { SWEEPS = 2 };

/* Sweeps still to go, by that rate, beyond which overshooting is worth it: half of the passes
 * that it may take (BASIS_MAX in gmres.c). A guess; `shoot --log` in a scene of albedos near 1
 * shows what it does. */
enum { WORTH = 20 };

/* Whether shots would go on for longer than overshooting takes. */
static int is_slow(struct shooter *v, double unshot, double stop)
{
	double *round = v->s->round, sweeps = round[ROUND_WORK] / (double)v->t->runs;

	if (v->negative)
		return 1;
	if (!(sweeps >= SWEEPS))
		return 0;
	double rate = round[ROUND_UNSHOT] > 0 ? log(round[ROUND_UNSHOT] / unshot) / sweeps
	                                      : INFINITY;
	round[ROUND_WORK] = 0;
	round[ROUND_UNSHOT] = unshot;
	return stop > 0 && log(unshot / stop) > WORTH * rate;
}

static void tell(const struct shooter *v, const struct radiosity_hooks *hooks,
                 const struct radiosity_report *r)
{
	size_t bands = (size_t)v->s->bands;
	double unshot[BANDS_MAX] = { 0 }, emitted[BANDS_MAX] = { 0 };

	if (!hooks || !hooks->step)
		return;
	for (size_t c = 0; c < v->propagator.channels; c++) {
		unshot[c % bands] += ((const double *)v->unshot)[c];
		emitted[c % bands] += v->s->ledger[c];
	}
	hooks->step(hooks->arg, &(struct radiosity_step){ r->rounds, v->s->shots, v->s->bands,
	            unshot, emitted, v->residual });
}

/* A round goes down to the largest priority over this. The more rounds, the better the order of
 * shots, but each looks at all links. A guess; the report's `passes` and seconds of `shoot` show
 * what it does. */
enum { ROUND_DEPTH = 32 };

/* Rounds, or overshooting where they are slow, until `stop` or the last shot. */
static int rounds(struct shooter *v, const struct radiosity_options *o,
                  const struct radiosity_hooks *hooks, struct radiosity_report *r,
                  struct err *e)
{
	struct solution *s = v->s;
	uint64_t last = o->max_shots > UINT64_MAX - s->shots ? UINT64_MAX : s->shots + o->max_shots;
	int go_on = shoot_lights(v, last);
	double top = radiosity_survey(v, &r->unshot);

	while (go_on > 0 && (r->unshot > o->stop || s->round[ROUND_LEAST] != 0)) {
		if (s->round[ROUND_LEAST] == 0 && s->shots >= last)
			break;
		if (s->round[ROUND_LEAST] == 0 && is_slow(v, r->unshot, o->stop)) {
			go_on = radiosity_gmres_finish(v, r->unshot, o->stop, e);
		} else {
			if (s->round[ROUND_LEAST] == 0)
				s->round[ROUND_LEAST] = top / ROUND_DEPTH;
			go_on = finish_round(v, last);
		}
		top = radiosity_survey(v, &r->unshot);
		count_work(v);
		r->rounds++;
		tell(v, hooks, r);
	}
	radiosity_propagator_store(&v->propagator, s);
	return go_on < 0 ? -1 : 0;
}

static void report(const struct shooter *v, int threads, struct radiosity_report *r)
{
	double emitted = 0;

	for (size_t i = 0; i < v->components.n; i++) {
		double flux = 0;
		for (size_t g = 0; g < v->s->groups; g++)
			flux += v->emitted[i * v->s->groups + g];
		r->components += flux > 0;
		emitted += flux;
	}
	r->residual = v->residual;
	r->guessed = v->guessed / emitted;
	r->passes = v->t->runs ? (double)v->propagator.runs / (double)v->t->runs : 0;
	r->solve_bytes = v->propagator.bytes;
	r->bound = radiosity_truncation_bound(v->t, &v->components, v->s, threads,
	                                      &r->solve_bytes) / emitted;
}

int radiosity_shoot(struct solution *s, const struct transport *t,
                    const struct radiosity_options *o, const struct radiosity_hooks *hooks,
                    struct radiosity_report *r, struct err *e)
{
	struct shooter v;

	*r = (struct radiosity_report){ 0 };
	int bad = radiosity_shooter_init(&v, s, t, e) || radiosity_components_need_sink(t, e) ||
	          rounds(&v, o, hooks, r, e);
	if (!bad)
		report(&v, o->threads, r);
	radiosity_shooter_free(&v);
	return bad ? -1 : 0;
}
