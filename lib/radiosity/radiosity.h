/* The radiosity solution by progressive shooting with memory of direction: the loop.
 *
 * State (struct solution), in flux, for each channel (band and light group):
 *   unshot.diffuse[i]   what patch-side i still has to send diffusely: one number, as diffuse
 *                       light forgets where it came from
 *   unshot.link[l][o]   what is still to leave directional patch-side j by its lobes about R
 *                       and T. A link l is a source (a patch-side or light, and the chain of
 *                       mirrors and panes between) and a side j that it lights: the paper's
 *                       arrays of unshot radiosity, kept only for sources that j really sees.
 *                       o: whether the light has met a diffuse surface (FROM_EMITTER or not)
 *   unshot.emission[i]  what emitter i has not sent yet
 *   shot[r][o]          what row r of the form factors has sent so far
 *
 * Order (radiosity.c). Each punctual light sends all it emits. Then rounds:
 *   priority = sum over channels of |unshot| / emitted(component, group) / cost, where cost is
 *              how many sums by patch its rows have: the work of sending it
 *   least    = the largest priority / ROUND_DEPTH
 *   for each patch-side in index order, if something of it has a priority of at least `least`,
 *      one shot (radiosity_shoot_side): its emission and diffuse flux if they have it together,
 *      by the rows F[i -> j]; the flux of each link that has it, rho_s / (rho_s + tau_s) of it
 *      by the row of the lobe about R and the rest by that about T, eq. (3)
 *   until unshot / emitted <= stop in each component and group.
 * Where that is slow, GMRES solves for all that is to be sent, and it is shot at once (gmres.c).
 *
 * Flux X that a row lands on side s of a patch, the other side being s' (propagate.c):
 *   unshot.diffuse[s] += rho_d X    unshot.link[source -> s] += (rho_s + tau_s) X, lobes
 *   unshot.diffuse[s'] += tau_d X   absorbed += (1 - rho_d - tau_d - rho_s - tau_s) X
 * Ideal shares go on within the row, by its blocks for longer chains.
 *
 * Ledger: these add up to X, and those to what was sent, so after every shot and round
 *   emitted = absorbed + escaped + lost + cut + sum of all that is unshot
 * in each channel. radiosity_report.residual is the largest difference, over emitted: rounding
 * alone. (lost: what lobes of the reciprocal kind do not reflect. cut: chains beyond the bound.)
 *
 * Truncation bound (truncation_bound.c): with N(s) how often unit flux arriving on s arrives
 * again, in the worst way it can leave, what is unshot will still bring at most
 *   sum over elements of area |H - H*| <= sum over rows of |unshot| sum_j row[j] (1 + N(j))
 * Where rows have no longer chains this is at most |unshot| / (1 - a), a the largest albedo.
 *
 * Shots work on flux summed by patch. Elements get their irradiance at the end, in one pass over
 * the form factors (element_irradiance.c): H[e] = sum over rows of shot[r] row[r][e] / area[e]. */
#ifndef TWOPASS_RADIOSITY_H
#define TWOPASS_RADIOSITY_H

#include <stdint.h>

#include "lib/base/err.h"

struct model;
struct solution;
struct transport;

struct radiosity_options {
	double stop;           /* unshot / emitted of each connected component */
	uint64_t max_shots;    /* in this run; UINT64_MAX = no limit */
	int threads;
};

#define RADIOSITY_OPTIONS_DEFAULT \
	((struct radiosity_options){ .stop = 1e-4, .max_shots = UINT64_MAX })

struct radiosity_step {    /* after each round */
	uint64_t round, shots;
	int bands;
	const double *unshot;  /* [bands] */
	const double *emitted; /* [bands] */
	double residual;       /* of the ledger, relative to what was emitted */
};

struct radiosity_hooks {
	void (*step)(void *arg, const struct radiosity_step *s); /* may be NULL */
	void *arg;
};

struct radiosity_report {
	uint64_t rounds;
	double passes;         /* how many times all form factors would be read by what was */
	int components;        /* connected parts that have an emitter */
	double unshot;         /* unshot / emitted, the worst component and band */
	double residual;       /* largest ledger residual of any shot or round */
	double bound;          /* certified: sum over elements of area |H - H*| from
	                          unshot flux, over emitted flux; INFINITY = no finite bound */
	double guessed;        /* flux that used a link of another source, over emitted */
	double uneven;         /* what uneven patches added to irradiance, root mean square over its
	                          mean; NAN: not known (uneven.h). Of radiosity_solve */
	double solve_bytes;    /* of form factors read by shots and bound: runs */
	double element_bytes;   /* and by the pass over elements: columns and values */
};

/* Zeroed state for a model and its transport with all emission unshot; light_groups: see
 * radiosity_groups_set. 0, or -1 and e ("no emitter" if nothing emits, or if that is too much
 * to compute with). */
int radiosity_begin(struct solution *s, const struct model *m, const struct transport *t,
                    int light_groups, struct err *e);

/* Shoots until `stop` or max_shots. Where the rest would take many more sweeps over all
 * sides, it is solved for and shot at once (gmres.c), which may leave unshot flux of
 * both signs. "no steady state" if light reaches a closed part that absorbs nothing.
 * O(shots x runs of a row). 0, or -1 and e. */
int radiosity_shoot(struct solution *s, const struct transport *t,
                    const struct radiosity_options *o, const struct radiosity_hooks *hooks,
                    struct radiosity_report *r, struct err *e);

/* All of it: radiosity_shoot and radiosity_element_irradiance, and then, where form factors say how
 * and if light came to rest, what patches that are not evenly lit change (uneven.h).
 * O(shots x runs of a row + entries + landings). 0, or -1 and e. */
int radiosity_solve(struct solution *s, const struct transport *t, const struct radiosity_options *o,
                    const struct radiosity_hooks *hooks, struct radiosity_report *r, struct err *e);

/* Irradiance of all element-sides and its standard error from what the rows have
 * sent. O(entries). 0, or -1 and e. */
int radiosity_element_irradiance(struct solution *s, const struct transport *t, int threads,
                                 struct radiosity_report *r, struct err *e);

#endif
