#include "lib/ff_rays/light_paths.h"

#include "lib/ff_rays/ff_internal.h"

struct path {
	struct ff_thread *t;
	uint32_t chain, passed;
};

static int pass(void *arg, uint32_t material, int arrival, int transmitted)
{
	struct path *p = arg;
	struct chains *c = &p->t->tally.chains;
	uint32_t slot = c->slot[4 * material + 2 * (uint32_t)arrival + (uint32_t)transmitted];

	if (p->passed++ >= p->t->job->o.depth)
		return 0;
	p->chain = bsdf_chains_child(c, p->chain, slot, &p->t->tally.err);
	return p->chain != CHAIN_NONE;
}

uint32_t ff_light_chain(struct ff_thread *t, size_t image, const double from[3],
                        const struct light_sample *s)
{
	struct path p = { t, 0, 0 };
	uint64_t cast = 0;
	int arrives = ray_light_walk(&t->job->lights, image, from, s, pass, &p, &cast);

	t->rays += (double)cast;
	return arrives ? p.chain : CHAIN_NONE;
}
