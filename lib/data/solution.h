/* The radiosity solution: what a .rad file holds beside the model. */
#ifndef TWOPASS_SOLUTION_H
#define TWOPASS_SOLUTION_H

#include <stddef.h>
#include <stdint.h>

#include "lib/data/model.h"

/* The priority that the current round of shots asks for, and the next patch-side in it;
 * how many sums by patch have been read since the rate of convergence was last looked at,
 * and what was unshot then. */
enum { ROUND_LEAST, ROUND_NEXT, ROUND_WORK, ROUND_UNSHOT, ROUND_TERMS };

/* Irradiance by the paths that light came. */
struct irradiance {
	double *direct;            /* straight from emitters */
	double *caustic;           /* from emitters by directional or ideal events only */
	double *indirect;          /* the rest; below 0 where noise is more than there is */
};

/* What the sum of the three may be off by. [2E][bands] */
struct irradiance_error {
	double *sampling;          /* standard error from the form factors' sampling */
	double *sampling_direct;   /* what emitters' rows have in it */
	double *discretisation;    /* estimated root mean square, over the element, of what
	                              interpolation misses */
	double *discretisation_direct; /* the same of light straight from emitters */
	double *uneven;            /* estimate of what is left of patches not being evenly lit */
};

/* Flux still to be shot. */
struct unshot {
	double *emission;          /* [2P+L][bands] not yet sent by emitters */
	double *diffuse;           /* [2P][channels] to leave diffusely */
	double *link;              /* [links][2][channels] to leave by the lobes of a link's
	                              target: first what has met only emitters, directional
	                              and ideal events so far, then the rest */
};

/* Index of element-side s, band b, group g: ((g 2E + s) bands + b). Shooting keeps
 * groups and bands together, as channels: g bands + b. */
struct solution {
	size_t groups;             /* light groups */
	char **group_name;         /* [groups] */
	size_t emitters;           /* materials, then punctual lights */
	uint32_t *emitter_group;   /* [emitters] group of what it emits, 0 if nothing */
	size_t element_sides;      /* 2 E */
	int bands;
	struct irradiance irradiance; /* [groups][2E][bands] */
	float *uneven;             /* [groups][2E][bands] what of irradiance.indirect makes up for
	                              patches that are not evenly lit */
	struct irradiance_error error;

	/* The state of shooting, for shoot --resume: what is still to be shot, what each
	 * row has sent so far, where the rest went. */
	size_t patch_sides;        /* 2 P */
	size_t sources;            /* 2 P + L, punctual lights behind patch-sides */
	size_t links;              /* of all shards, in the order in which shooting puts them */
	size_t rows;               /* of all shards, in order */
	struct unshot unshot;
	double *shot;              /* [rows][2][channels] flux sent, split as unshot.link */
	double *ledger;            /* [LEDGER_TERMS][channels] flux */
	uint64_t shots;
	double round[ROUND_TERMS];
};

enum { LEDGER_EMITTED, LEDGER_ABSORBED, LEDGER_ESCAPED, LEDGER_LOST, LEDGER_CUT,
       LEDGER_UNEVEN, LEDGER_TERMS };

/* Group of what a source emits. */
static inline uint32_t solution_group(const struct solution *s, const struct model *m,
                                      uint32_t source)
{
	return s->emitter_group[source < 2 * m->patch.n ? model_patch_material(m, source >> 1)
	                                                : m->material.n + source - 2 * m->patch.n];
}

static inline size_t solution_channels(const struct solution *s)
{
	return s->groups * (size_t)s->bands;
}

/* Sum of the three parts and all groups. */
static inline double solution_irradiance(const struct solution *s, size_t element_side,
                                         int band)
{
	size_t i = element_side * (size_t)s->bands + (size_t)band;
	double h = 0;

	for (size_t g = 0; g < s->groups; g++, i += s->element_sides * (size_t)s->bands)
		h += s->irradiance.direct[i] + s->irradiance.caustic[i] + s->irradiance.indirect[i];
	return h;
}

/* Diffuse exitance without emission of an element-side,
 * M = rho_d H(this side) + tau_d(other side) H(other side); of two given irradiances, and of those of
 * a solution. */
double solution_scattered(const struct model *m, size_t element_side, int band, double here_h,
                          double there_h);
double solution_exitance(const struct model *m, const struct solution *s,
                         size_t element_side, int band);

/* Sizes that fit the model, finite values, errors >= 0. 0, or -1
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
