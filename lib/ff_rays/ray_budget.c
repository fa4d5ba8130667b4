/* How many rays rows cast, by the light that they are likely to carry.
 *
 * The variance that rows of n rays with fluxes U bring to what they light is the sum of
 * U^2 / n, so that rays are best shared out as fluxes are. What is known of these before
 * anything is solved is where elements, as they gathered, met emitters. */
#include "lib/ff_rays/ray_budget.h"

#include <stdlib.h>

/* Flux on each patch-side from emitters that are alike: the parts of its elements' rays that
 * met one, times their areas. */
static void direct_light(const struct ff_job *j, double *flux)
{
	const struct ff_reciprocal *g = &j->reciprocal;

	for (uint32_t source = 0; source < 2 * j->m->patch.n; source++)
		for (uint64_t i = g->start[source]; j->emits[source] && i < g->start[source + 1]; i++) {
			const struct ff_receiver_hits *s = &g->hits[i];
			uint32_t el = s->column >> 1, ps = 2 * j->m->element.patch[el] + (s->column & 1);
			flux[ps] += j->m->element.area[el] * s->count / ff_reciprocal_rays(j, el);
		}
}

static int is_plain(const struct ff_job *j, uint32_t ps)
{
	return j->shoots_diffuse[ps] && !j->emits[ps] && !j->has_lobe[ps];
}

int ff_most_halvings(uint32_t rays)
{
	int most = 0;

	while (most < FF_HALVINGS && (rays / FF_REPLICATES >> most) % 2 == 0)
		most++;
	return most;
}

int ff_share_rays(struct ff_job *j, struct err *e)
{
	size_t sides = 2 * j->m->patch.n, rows = 0;
	double *flux, area = 0, all = 0, sum = 0;
	int most = ff_most_halvings(j->o.rays);

	if (j->m->light.n) /* no ray meets these, so nothing is known of what they light */
		return 0;
	flux = mem_new(sides, sizeof *flux, "direct light", e);
	j->halvings = mem_new(sides, 1, "direct light", e);
	if (!flux || !j->halvings) {
		free(flux);
		return -1;
	}
	direct_light(j, flux);
	for (uint32_t ps = 0; ps < sides; ps++) {
		area += j->is_black[ps] ? 0 : j->m->patch.area[ps >> 1];
		all += flux[ps];
	}
	/* Light that came by way of other surfaces is taken to be as much, and even. */
	for (uint32_t ps = 0; all > 0 && ps < sides; ps++) {
		flux[ps] += j->m->patch.area[ps >> 1] * all / area;
		sum += is_plain(j, ps) ? flux[ps] : 0;
		rows += (size_t)is_plain(j, ps);
	}
	for (uint32_t ps = 0; ps < sides; ps++)
		while (all > 0 && is_plain(j, ps) && j->halvings[ps] < most &&
		       flux[ps] * (double)rows < sum / (double)(1 << j->halvings[ps]))
			j->halvings[ps]++;
	free(flux);
	return 0;
}
