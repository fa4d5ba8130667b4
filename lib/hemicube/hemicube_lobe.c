#include "lib/hemicube/hemicube_lobe.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"

/* Lobes are left out where they are below this part of their largest: with all pixels of the
 * largest grid there, they would add up to less than the rounding of the sum. */
static const double negligible = -60; /* the logarithm */

int ff_hemicube_lobe(const struct hemicube_grid *g, const uint32_t *item, const double axis[3],
                     double k, int escape, double *weight)
{
	double most = 0, sum = 0;

	for (size_t i = 0; i < g->pixels; i++) {
		double cosine = v3_dot(axis, &g->direction[3 * i]);
		weight[i] = item[i] == HEMICUBE_VOID && !escape ? 0 : cosine;
		most = weight[i] > most ? weight[i] : most;
	}
	if (!(most > 0)) {
		memset(weight, 0, g->pixels * sizeof *weight);
		return -1;
	}
	for (size_t i = 0; i < g->pixels; i++) {
		double power = weight[i] > 0 ? k * log(weight[i] / most) : negligible;
		weight[i] = power > negligible ? exp(power) * g->solid_angle[i] : 0;
		sum += weight[i];
	}
	for (size_t i = 0; i < g->pixels; i++)
		weight[i] /= sum;
	return 0;
}
