/* Form factors by rays: cosine-distributed directions jointly stratified with the
 * position on the patch (Owen-scrambled Sobol points in four dimensions). */
#include "lib/ff/row_rays.h"

#include "lib/base/vec.h"
#include "lib/ff/directional.h"
#include "lib/ff/row_reciprocal.h"
#include "lib/ff_rays/ray_budget.h"
#include "lib/ff_rays/ray_follow.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/scatter/lobe.h"

static void cast_lobe_ray(struct ff_thread *t, const struct ff_incident *c, int side,
                          const double dir[3], double w)
{
	struct ray_units units = ray_units(t->job->rays);
	double n[3], x[3] = { c->x[0], c->x[1], c->x[2] };

	ff_normal(t->job, c->element, side, n);
	ray_leave(t->job->rays, n, x);
	if (w != 1) {
		ff_follow(t, x, dir, w, 0);
		return;
	}
	for (int k = 0; k < 3; k++) {
		t->lobe.ray.org[k][t->lobes] = (float)((x[k] - units.centre[k]) * units.per_unit);
		t->lobe.ray.dir[k][t->lobes] = (float)dir[k];
	}
	if (++t->lobes == RAY_BATCH)
		ff_lobes_cast(t);
}

/* The diffuse row of a patch-side into the tally: its own rays, where it needs them, and
 * what was gathered of it, where that is better. */
static struct ff_weight diffuse(struct ff_thread *t, uint32_t ps)
{
	const struct ff_job *j = t->job;
	uint32_t rays = ff_row_rays(j, ps);
	struct ff_weight w = { rays, rays };
	int gathered = j->reciprocal.rays && j->shoots_diffuse[ps];
	int alone = gathered && ff_row_is_reciprocal(j, ps);

	if (alone && ff_combine_estimates(t, ps, 0, &w))
		return w;
	t->capturing = j->has_lobe[ps];
	t->capture_weight = 1;
	t->boost = 1;
	if (j->emits[ps] && j->has_ideal && !j->has_lobe[ps]) {
		struct ff_guide guide;
		ff_guide_learn(t, ps, rays, &guide);
		t->boost = guide.boost;
		w.total = ff_cast_guided(t, ps, rays, &guide);
	} else {
		ff_cast_side(t, ps, rays, -1, 0);
	}
	t->capturing = 0;
	if (gathered && !alone)
		ff_combine_estimates(t, ps, (uint32_t)w.total, &w);
	return w;
}

static int sees_emitter_by_mirror(const struct ff_thread *t)
{
	const struct ff_incident *c = t->incident.data;

	for (size_t i = 0; i < t->incident.n; i++)
		if (c[i].chain && t->job->emits[c[i].source])
			return 1;
	return 0;
}

/* More ways that light comes to a directional patch-side: as many as an emitter's rays
 * tell, where ideal mirrors and panes bring an emitter's light (ff_directional_rows finds out what
 * comes straight by itself). */
static int capture_more(struct ff_thread *t, uint32_t ps, struct err *e)
{
	const struct ff_job *j = t->job;
	uint32_t more = j->o.rays * (j->o.emitter_gain - 1);
	struct ff_batch unused = { 0 };

	if (j->emits[ps] || more == 0 || !sees_emitter_by_mirror(t))
		return 0;
	t->capturing = 1;
	ff_cast_side(t, ps, more, -1, FF_REPLICATES);
	t->capturing = 0;
	int bad = ff_tally_finish(&t->tally, &unused, ps, FF_DIFFUSE, more, more, e);
	ff_batch_free(&unused);
	return bad;
}

static int side_rows(struct ff_thread *t, uint32_t ps, struct ff_batch *b, struct err *e)
{
	const struct ff_job *j = t->job;
	uint32_t material = model_patch_material(j->m, ps >> 1);

	t->rng = rng_seed(j->o.seed, ps);
	t->incident.n = 0;
	if (j->shoots_diffuse[ps] || j->has_lobe[ps]) {
		struct ff_weight w = diffuse(t, ps);
		struct ff_batch unused = { 0 };
		if (ff_tally_finish(&t->tally, j->shoots_diffuse[ps] ? b : &unused, ps, FF_DIFFUSE,
		                    w.samples, w.total, e))
			return -1;
		ff_batch_free(&unused);
	}
	if (j->shoots_lobe[ps]) {
		uint32_t rays = ff_row_rays(j, ps);
		t->lobe_depth = j->o.lobe_depth;
		ff_cast_side(t, ps, rays, j->m->material.emission_exponent[2 * material + (ps & 1)], 0);
		t->lobe_depth = 0;
		if (ff_tally_finish(&t->tally, b, ps, FF_EMISSION, rays, rays, e))
			return -1;
	}
	if (!j->has_lobe[ps])
		return 0;
	return capture_more(t, ps, e) || ff_directional_rows(t, ps, cast_lobe_ray, b, e) ? -1 : 0;
}

int ff_patch_rays(struct ff_thread *t, uint32_t patch, struct ff_batch *b, struct err *e)
{
	for (uint32_t side = 0; side < 2; side++)
		if (side_rows(t, 2 * patch + side, b, e))
			return -1;
	return 0;
}
