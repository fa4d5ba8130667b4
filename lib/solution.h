/* The radiosity solution: what a .rad file holds beside the model. */
#ifndef TWOPASS_SOLUTION_H
#define TWOPASS_SOLUTION_H

#include <stddef.h>
#include <stdint.h>

#include "model.h"

/* Index i of element-side s, band b, group g: ((g 2E + s) bands + b). */
struct solution {
	size_t groups;             /* light groups, 1 */
	size_t element_sides;      /* 2 E */
	int bands;
	double *direct;            /* irradiance straight from emitters */
	double *caustic;           /* from emitters by directional or ideal events only */
	double *indirect;          /* the rest */
	double *error;             /* [2E][bands] standard error of their sum from
	                              the form factors' sampling */
	double *error_direct;      /* [2E][bands] what emitters' rows have in it */
	double *discretisation;    /* [2E][bands] estimated root mean square, over the
	                              element, of what interpolation misses of their sum */

	/* The solver's state, for shoot --resume: what is still to be shot, what each
	 * row has sent so far, where the rest went. */
	size_t patch_sides;        /* 2 P */
	size_t links;              /* of all shards, in the solver's order */
	size_t rows;               /* of all shards, in order */
	double *unshot_emission;   /* [2P][bands] flux not yet sent by emitters */
	double *unshot_diffuse;    /* [2P][bands] flux to leave diffusely */
	double *unshot_link;       /* [links][2][bands] flux to leave by the lobes of a
	                              link's target: first what has met only emitters,
	                              directional and ideal events so far, then the rest */
	double *shot;              /* [rows][2][bands] flux sent, split likewise */
	double *ledger;            /* [LEDGER_TERMS][bands] flux */
	uint64_t shots;
	double round[2];           /* the priority that the current round of shots asks
	                              for, and the next patch-side in it */
};

enum { LEDGER_EMITTED, LEDGER_ABSORBED, LEDGER_ESCAPED, LEDGER_LOST, LEDGER_CUT,
       LEDGER_TERMS };

/* Sum of the three parts, group 0. */
static inline double solution_irradiance(const struct solution *s, size_t element_side,
                                         int band)
{
	size_t i = element_side * (size_t)s->bands + (size_t)band;
	return s->direct[i] + s->caustic[i] + s->indirect[i];
}

/* Diffuse exitance without emission of an element-side,
 * M = rho_d H(this side) + tau_d(other side) H(other side). */
double solution_exitance(const struct model *m, const struct solution *s,
                         size_t element_side, int band);

/* Sizes that fit the model, finite values, irradiances and errors >= 0. 0, or -1
 * and e with "array NAME: what is wrong". O(element sides x bands). */
int solution_check(const struct model *m, const struct solution *s, struct err *e);

/* Area-weighted mean standard error of irradiance over the mean irradiance of the
 * modelled sides; 0 in the dark. */
double solution_mean_error(const struct model *m, const struct solution *s);

/* Root mean square over the area of the modelled sides, and over bands, of x[2E][bands],
 * over their mean irradiance; 0 in the dark. */
double solution_relative_rms(const struct model *m, const struct solution *s,
                             const double *x);

void solution_free(struct solution *s);

#endif
