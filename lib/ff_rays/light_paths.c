/* The ways that rays of punctual lights and of their images in plane mirrors take. */
#include "lib/ff_rays/light_paths.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec3.h"
#include "lib/data/punctual.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/scatter/bsdf.h"

/* A ray's way through clear panes: where it is, and the events passed. */
struct way {
	double org[3];
	uint32_t chain, passed;
};

/* Through the surface of a hit, if it is a clear pane for light that comes against the
 * ray. 0 if not. */
static int pass(struct ff_thread *t, const struct ray_hit *hit, struct way *w)
{
	const struct ff_job *j = t->job;
	struct chains *chains = &t->tally.chains;
	uint32_t material = j->m->surface.material[j->m->triangle.surface[hit->triangle]];
	uint32_t arrival = (uint32_t)!hit->side;
	double n[3];

	if (!bsdf_has_ideal(&j->m->material, material, (int)arrival, 1) || w->passed++ >= j->o.depth)
		return 0;
	w->chain = bsdf_chains_child(chains, w->chain, chains->slot[4 * material + 2 * arrival + 1],
	                             &t->tally.err);
	ff_normal(j, ray_locate(&j->locator, hit->triangle, (float)hit->w[1], (float)hit->w[2]),
	          (int)arrival, n);
	ray_point(j->rays, j->m, hit->triangle, hit->w, w->org);
	ray_leave(j->rays, n, w->org);
	return w->chain != CHAIN_NONE;
}

/* On from w->org to a point: the chain, or CHAIN_NONE. */
static uint32_t way_to(struct ff_thread *t, const double to[3], struct way *w)
{
	const struct ff_job *j = t->job;
	struct ray_hit hit;
	double dir[3];

	t->rays++;
	if (!ray_blocked(j->rays, w->org, to))
		return w->chain;
	while (j->has_panes) {
		v3_sub(to, w->org, dir);
		double left = v3_normalise(dir);
		ray_nearest(j->rays, w->org, dir, &hit);
		t->rays++;
		if (hit.triangle == RAY_MISS || hit.t >= left)
			return w->chain;
		if (!pass(t, &hit, w))
			return CHAIN_NONE;
	}
	return CHAIN_NONE;
}

uint32_t ff_light_straight(struct ff_thread *t, const double from[3], const double to[3])
{
	struct way w = { { from[0], from[1], from[2] }, 0, 0 };

	return way_to(t, to, &w);
}

uint32_t ff_light_mirrored(struct ff_thread *t, const struct mirror_plane *mirror, size_t light,
                           const double from[3], const double toward[3])
{
	const struct ff_job *j = t->job;
	struct chains *chains = &t->tally.chains;
	struct way w = { { from[0], from[1], from[2] }, 0, 0 };
	struct light_sight s;
	struct ray_hit hit;
	double n[3], x[3];

	for (;;) {
		ray_nearest(j->rays, w.org, toward, &hit);
		t->rays++;
		if (hit.triangle == RAY_MISS)
			return CHAIN_NONE;
		uint32_t surface = j->m->triangle.surface[hit.triangle];
		ff_normal(j, ray_locate(&j->locator, hit.triangle, (float)hit.w[1], (float)hit.w[2]),
		          hit.side, n);
		ray_point(j->rays, j->m, hit.triangle, hit.w, x);
		if (ray_mirror_has(&j->images.mirrors, mirror, j->m->surface.material[surface], hit.side,
		                   n, x))
			break;
		if (!pass(t, &hit, &w))
			return CHAIN_NONE;
	}
	if (w.passed++ >= j->o.depth)
		return CHAIN_NONE;
	w.chain = bsdf_chains_child(chains, w.chain,
	                            chains->slot[4 * mirror->material + 2 * (uint32_t)mirror->side],
	                            &t->tally.err);
	if (w.chain == CHAIN_NONE)
		return CHAIN_NONE;
	model_light_see(&j->m->light, light, x, ray_offset(j->rays), &s);
	memcpy(w.org, x, sizeof x);
	ray_leave(j->rays, mirror->n, w.org);
	return way_to(t, s.to, &w);
}
