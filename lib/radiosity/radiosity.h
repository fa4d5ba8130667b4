/* The radiosity solution by progressive shooting with memory of direction.
 *
 * A shot sends unshot flux of one patch-side: its own emission with what leaves it
 * diffusely, and, source by source, what leaves by the lobes about R and T of the light
 * that arrived on it (the paper's arrays of unshot radiosity, kept only for sources that a
 * directional patch really sees: the links of a .ff file). Shots go in rounds: a round goes
 * through the patch-sides in index order and shoots, of each, what has a priority of at
 * least a part of the largest at its beginning: unshot flux over what is emitted and over
 * the work of sending it. Flux of all bands and light groups goes in one shot.
 *
 * Shots work on flux summed by patch; elements get their irradiance at the end, in
 * one pass over the form factors with the total that each row has sent. */
#ifndef TWOPASS_RADIOSITY_H
#define TWOPASS_RADIOSITY_H

#include "lib/base/parallel.h"
#include "lib/data/solution.h"
#include "lib/radiosity/components.h"
#include "lib/radiosity/transport.h"

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
	double solve_bytes;    /* of form factors read by shots and bound: runs */
	double gather_bytes;   /* and by the pass over elements: columns and values */
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

/* Irradiance of all element-sides and its standard error from what the rows have
 * sent. O(entries). 0, or -1 and e. */
int radiosity_element_irradiance(struct solution *s, const struct transport *t, int threads,
                                 struct radiosity_report *r, struct err *e);

/* An upper bound of the flux that will still arrive anywhere because of what is unshot;
 * INFINITY if it cannot be bounded. Adds to *bytes what it reads of runs.
 * O(runs x steps), at most 64 steps. */
double radiosity_truncation_bound(const struct transport *t, const struct components *parts,
                                  const struct solution *s, int threads, double *bytes);

#endif
