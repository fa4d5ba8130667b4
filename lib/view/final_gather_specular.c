#include "lib/view/final_gather_specular.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/scatter/lobe.h"

/* Rays of less weight, relative to one that has met nothing directional, are followed by as much
 * less chance. A guess: glass at 4 % then costs a sixth of a ray. */
static const double worth_following = .25;

/* Cosines are no less: at grazing angles a weight is large but finite. */
static const double cosine_least = 1e-14;

/* A way on from a surface. */
struct way {
	const struct view_lobe *lobe;
	int side;                   /* that it goes off to */
	double axis[3];
};

static double carries(const struct view_lobe *lobe, const struct gather_going *g, int bands)
{
	double sum = 0;

	for (int b = 0; b < bands && lobe->coefficient; b++)
		sum += g->weight[b] * lobe->coefficient[b];
	return sum;
}

/* Chooses a way by what it carries. 0 if the ray ends. */
static int choose(const struct view_side *s, int bands, int side, struct gather_going *g,
                  struct way *way)
{
	double reflected = carries(&s->reflected, g, bands);
	double all = reflected + carries(&s->transmitted, g, bands), most = 0;

	if (!(all > 0))
		return 0;
	int through = rng_uniform(&g->random) * all >= reflected;
	double chance = (through ? all - reflected : reflected) / all;
	way->lobe = through ? &s->transmitted : &s->reflected;
	way->side = through ? !side : side;
	for (int b = 0; b < bands; b++) {
		g->weight[b] *= way->lobe->coefficient[b] / chance;
		most = fmax(most, g->weight[b]);
	}
	double follow = fmin(1, most / worth_following);
	for (int b = 0; b < bands; b++)
		g->weight[b] /= follow;
	return rng_uniform(&g->random) < follow;
}

/* A direction of a lobe in place of its axis; 0 if it is below the horizon. */
static int scatter(const struct view_lobe *lobe, enum lobe_kind kind, int bands,
                   const double normal[3], double cos_o, struct gather_going *g, double dir[3])
{
	double axis[3] = { dir[0], dir[1], dir[2] };
	double u[2] = { rng_uniform(&g->random), rng_uniform(&g->random) };
	double weight = bsdf_lobe_table_sample(&lobe->table, kind, axis, normal, cos_o, u, dir);

	for (int b = 0; b < bands; b++)
		g->weight[b] *= weight;
	return weight > 0;
}

/* The point that a ray of a batch met, off its surface along the normal. */
static void leave(const struct gather_table *t, const struct ray_batch *b, uint32_t i,
                  const double normal[3], float org[3])
{
	struct ray_units units = ray_units(t->v->rays);
	double x[3];

	view_gather_hit(t, b, i, x);
	ray_leave(t->v->rays, normal, x);
	for (int k = 0; k < 3; k++)
		org[k] = (float)((x[k] - units.centre[k]) * units.per_unit);
}

void view_gather_go_on(struct gather_tails *s, const struct gather_table *t,
                       const struct ray_batch *b, uint32_t i, size_t place,
                       const struct gather_going *g)
{
	const struct model *m = t->v->m;
	const struct view_side *seen =
		&t->v->side[2 * model_patch_material(m, m->element.patch[place / 2]) + place % 2];
	const double *front = &m->element.normal[3 * (place / 2)];
	struct gather_going *to = &s->going[s->waiting];
	double dir[3], normal[3];
	struct way way;

	*to = *g;
	if (++to->depth > s->depth || !choose(seen, m->bands, (int)(place % 2), to, &way))
		return;
	for (int k = 0; k < 3; k++) {
		dir[k] = (double)b->dir[k][i];
		normal[k] = way.side == FRONT ? front[k] : -front[k];
	}
	v3_normalise(dir);
	double cosine = v3_dot(dir, front);
	if (way.lobe == &seen->reflected)
		v3_mad(dir, -2 * cosine, front, dir);
	if (!isinf(way.lobe->k) && !scatter(way.lobe, m->lobe, m->bands, normal,
	                                    fmax(fabs(cosine), cosine_least), to, dir))
		return;
	leave(t, b, i, normal, to->org);
	for (int k = 0; k < 3; k++)
		to->dir[k] = (float)dir[k];
	s->waiting++;
}

/* Takes the last rays that wait into the batch. */
static uint32_t take(struct gather_tails *s)
{
	uint32_t n = s->waiting < RAY_BATCH ? s->waiting : RAY_BATCH;

	s->waiting -= n;
	memcpy(s->now, &s->going[s->waiting], n * sizeof *s->now);
	for (uint32_t i = 0; i < n; i++)
		for (int k = 0; k < 3; k++) {
			s->batch.org[k][i] = s->now[i].org[k];
			s->batch.dir[k][i] = s->now[i].dir[k];
		}
	return n;
}

void view_gather_follow(struct gather_tails *s, const struct gather_table *t, uint32_t left,
                        double *sum)
{
	uint32_t place[RAY_BATCH];

	while (s->waiting > left) {
		uint32_t n = take(s);
		ray_nearest_batch(t->v->rays, &s->batch, n);
		view_gather_places(t, &s->batch, n, place);
		s->rays += n;
		for (uint32_t i = 0; i < n; i++) {
			if (s->batch.triangle[i] == RAY_MISS)
				continue;
			view_gather_add(t, &s->batch, i, place[i], s->now[i].weight, sum);
			if (t->kind[place[i]] & GATHER_TAIL)
				view_gather_go_on(s, t, &s->batch, i, place[i], &s->now[i]);
		}
	}
}
