/* What patches cost by shooting evenly to lobes. The rays of a lobe start from pairs of points,
 * so neither the size of the patch with the lobe nor that of an even source is an error; but
 * light of a source that is brighter at one end leaves the lobe as if it were even, off by
 * the angle s/d under which the lobe sees it. To first order the squared error is the squared
 * deviations times (k/d^2) (s^2/12): the relative slope of a lobe of exponent k is sqrt(k)
 * at its width, and s^2/12 the variance of a source of size s. */
#include <math.h>
#include <stdlib.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/mesh/stages.h"

/* Of the squared deviations in a patch, what arrives where all of its light is smeared by a
 * lobe, a ratio: as in adapt_patches.c, and a guess as there. */
static const double arriving = .1;

/* Of the mean over patch-sides, the least deviation that is worth a look at all lobes. A ratio;
 * a guess: what is left out is .1 % of the sum at most. */
static const double notable = 1e-3;

/* A patch-side with a lobe for light that arrives there. */
struct shiny {
	uint32_t patch;
	double sign;         /* of the side's normal */
	double share[2];     /* of squared error that goes on about R and T: the mean over bands
	                        of the square of the coefficient */
	double exponent[2];
};

static double mean_square(const double *x, int bands)
{
	double sum = 0;

	for (int k = 0; k < bands; k++)
		sum += x[k] * x[k];
	return sum / bands;
}

/* Appends the patch-side if it has a lobe of finite exponent. */
static int add_shiny(const struct model *m, uint32_t ps, struct array *list, struct err *e)
{
	const struct materials *mt = &m->material;
	uint32_t material = model_patch_material(m, ps >> 1);
	size_t at = model_material_at(mt, material, (int)(ps & 1));
	struct shiny x = { .patch = ps >> 1, .sign = ps & 1 ? -1 : 1 };
	const double *coefficient[2] = { &mt->rho_s[at], &mt->tau_s[at] };

	x.exponent[0] = mt->alpha[2 * material + (ps & 1)];
	x.exponent[1] = mt->beta[2 * material + (ps & 1)];
	for (int k = 0; k < 2; k++)
		x.share[k] = isfinite(x.exponent[k]) ? mean_square(coefficient[k], m->bands) : 0;
	return x.share[0] + x.share[1] > 0 ? mem_append(list, &x, 1, sizeof x, e) : 0;
}

/* The part of the squared deviations of patch-side q that the lobes of x make an error, as if
 * nothing stood between: the form factor, of a disc as large as x, times k s^2/(12 d^2). */
static double smeared(const struct model *m, const struct patch_frame *frame, uint32_t q,
                      const struct shiny *x)
{
	const struct patch_frame *here = &frame[q >> 1], *there = &frame[x->patch];
	double d[3], sum = 0;

	v3_sub(there->centre, here->centre, d);
	double d2 = v3_dot(d, d), leaving = v3_dot(here->normal, d) * (q & 1 ? -1 : 1);
	double arrives = -v3_dot(there->normal, d) * x->sign;
	if (!(leaving > 0 && arrives > 0))
		return 0;
	double factor = leaving * arrives / d2 * m->patch.area[x->patch] /
	                (PI * d2 + m->patch.area[x->patch]);
	for (int k = 0; k < 2; k++)
		if (x->share[k] > 0)
			sum += x->share[k] *
			       fmin(1, x->exponent[k] * m->patch.area[q >> 1] / (12 * d2));
	return factor * sum;
}

/* deviation[patch-side], of modelled ones; returns their sum. */
static double find_deviations(const struct model *m, const struct solution *s,
                              double *deviation)
{
	double sum = 0;

	for (uint32_t q = 0; q < 2 * m->patch.n; q++)
		if (model_side_modelled(m, q))
			sum += deviation[q] = mesh_patch_deviations(m, s, q >> 1, (int)(q & 1));
	return sum;
}

int mesh_lobe_energies(const struct model *m, const struct solution *s,
                       const struct patch_frame *frame, double *energy, struct err *e)
{
	struct array list = { 0 };
	double *deviation = mem_new(2 * m->patch.n, sizeof *deviation, "patches", e);
	int status = deviation ? 0 : -1;

	for (uint32_t ps = 0; !status && ps < 2 * m->patch.n; ps++)
		if (model_side_modelled(m, ps))
			status = add_shiny(m, ps, &list, e);
	const struct shiny *shiny = list.data;
	if (!status && list.n) {
		double least = notable * find_deviations(m, s, deviation) /
		               (2 * (double)m->patch.n);
		for (uint32_t q = 0; q < 2 * m->patch.n; q++) {
			double sum = 0;
			if (!(deviation[q] > least))
				continue;
			for (size_t i = 0; i < list.n; i++)
				sum += smeared(m, frame, q, &shiny[i]);
			energy[q >> 1] += arriving * fmin(1, sum) * deviation[q];
		}
	}
	free(deviation);
	free(list.data);
	return status;
}
