/* The whole of pass 1: shooting, irradiance of elements, and what uneven patches do to it. */
#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/data/solution.h"
#include "lib/radiosity/radiosity.h"
#include "lib/radiosity/transport.h"
#include "lib/radiosity/uneven.h"

/* Steps, a count, at most; a guess: each leaves a fifth to a twenty-fifth. */
enum { STEPS = 16 };

/* Of the standard error of irradiance, and of the irradiance, what it does not pay to put right.
 * Guesses. */
static const double beside_noise = .05, beside_all = 1e-3;

static double mean_irradiance(const struct model *m, const struct solution *s)
{
	double sum = 0, area = 0;

	for (size_t es = 0; es < s->element_sides; es++) {
		double part = m->element.area[es >> 1];
		if (!model_side_modelled(m, 2 * m->element.patch[es >> 1] + (uint32_t)(es & 1)))
			continue;
		for (int k = 0; k < s->bands; k++)
			sum += part * solution_irradiance(s, es, k);
		area += part * s->bands;
	}
	return area > 0 ? sum / area : 0;
}

/* Shoots on, into the same report. */
static int shoot_on(struct uneven *u, const struct radiosity_options *o,
                    const struct radiosity_hooks *hooks, struct radiosity_report *r, struct err *e)
{
	struct radiosity_report before = *r;

	if (radiosity_shoot(u->s, u->t, o, hooks, r, e) ||
	    radiosity_element_irradiance(u->s, u->t, o->threads, r, e))
		return -1;
	r->rounds += before.rounds;
	r->passes += before.passes;
	r->guessed += before.guessed;
	r->residual = fmax(r->residual, before.residual);
	r->solve_bytes += before.solve_bytes;
	r->element_bytes += before.element_bytes;
	return 0;
}

/* Steps until what is still to come is small: as the last two say, else as much again. *left: that, of
 * the last. Steps fall by this factor at worst, or are over. */
static int correct(struct uneven *u, const struct radiosity_options *o,
                   const struct radiosity_hooks *hooks, struct radiosity_report *r, double *left,
                   struct err *e)
{
	static const double most = .9;
	struct radiosity_options again = *o;
	uint64_t before = u->s->shots;
	double noise = solution_relative_rms(u->t->m, u->s, u->s->error.sampling), last = 0;
	double small = fmax(o->stop, fmin(beside_all, beside_noise * noise));

	for (int i = 0; i < STEPS; i++) {
		double step = radiosity_uneven_step(u), mean = mean_irradiance(u->t->m, u->s);
		again.max_shots = o->max_shots - (u->s->shots - before);
		if (shoot_on(u, &again, hooks, r, e))
			return -1;
		double rate = last > 0 ? fmin(most, step / last) : .5;
		*left = rate / (1 - rate);
		last = step;
		if (*left * step <= small * mean)
			break;
	}
	return 0;
}

/* What was put right, all groups together. */
static int tell_uneven(const struct model *m, const struct solution *s, struct radiosity_report *r,
                       struct err *e)
{
	size_t n = s->element_sides * (size_t)s->bands;
	double *sum = mem_new(n, sizeof *sum, "irradiance", e);

	if (!sum)
		return -1;
	for (size_t i = 0; i < s->groups * n; i++)
		sum[i % n] += (double)s->uneven[i];
	r->uneven = solution_relative_rms(m, s, sum);
	free(sum);
	return 0;
}

int radiosity_solve(struct solution *s, const struct transport *t, const struct radiosity_options *o,
                    const struct radiosity_hooks *hooks, struct radiosity_report *r, struct err *e)
{
	struct uneven u;
	double left;

	if (radiosity_shoot(s, t, o, hooks, r, e) ||
	    radiosity_element_irradiance(s, t, o->threads, r, e))
		return -1;
	if (!radiosity_uneven_known(t)) {
		r->uneven = (double)NAN;
		return 0;
	}
	if (r->unshot > o->stop)
		return tell_uneven(t->m, s, r, e);
	int bad = radiosity_uneven_init(&u, t, s, o->threads, e) ||
	          correct(&u, o, hooks, r, &left, e);
	if (!bad)
		radiosity_uneven_errors(&u, left);
	radiosity_uneven_free(&u);
	return bad || tell_uneven(t->m, s, r, e) ? -1 : 0;
}
