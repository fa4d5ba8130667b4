#include "lib/view/final_gather_table.h"

#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/data/solution.h"

/* A side is rough where interpolation misses so much of its irradiance, by what the solution
 * states: about as much as gathering leaves of noise. A guess. */
static const double rough_from = .02;

/* Weights of corners 1 and 2 of an element's triangle at a vertex. */
static void weights(const struct model *m, uint32_t triangle, const double *x, double w[2])
{
	const uint32_t *c = &m->triangle.corner[3 * (size_t)triangle];
	const double *a = &m->vertex[3 * (size_t)c[0]], *b = &m->vertex[3 * (size_t)c[1]],
	             *d = &m->vertex[3 * (size_t)c[2]];
	double whole[3], part[3];

	v3_area(a, b, d, whole);
	double square = v3_dot(whole, whole);
	v3_area(a, x, d, part);
	w[0] = v3_dot(part, whole) / square;
	v3_area(a, b, x, part);
	w[1] = v3_dot(part, whole) / square;
}

/* The radiance M / pi of a side at one corner of its element. */
static double shown(const struct view_scene *v, const struct reconstruction *r, size_t corner,
                    int side, size_t b)
{
	size_t bands = (size_t)v->m->bands;
	const struct model *m = v->m;
	const struct view_side *s =
	    &v->side[2 * model_patch_material(m, m->element.patch[corner / 3]) + (uint32_t)side];
	const float *h = r->corner + 2 * bands * corner;

	return s->black ? 0 : s->here[b] * (double)h[(size_t)side * bands + b] +
	                      s->across[b] * (double)h[(size_t)!side * bands + b];
}

/* A linear function of the weights on a triangle, from its values at an element's corners. */
struct linear {
	double w[3][2], det;        /* of the corners */
};

static void find_linear(const struct model *m, size_t e, struct linear *l)
{
	for (size_t k = 0; k < 3; k++)
		weights(m, m->element.triangle[e],
		        &m->vertex[3 * (size_t)m->element.corner[3 * e + k]], l->w[k]);
	l->det = (l->w[1][0] - l->w[0][0]) * (l->w[2][1] - l->w[0][1]) -
	         (l->w[1][1] - l->w[0][1]) * (l->w[2][0] - l->w[0][0]);
}

/* Adds it to coefficients c[0], c[bands], c[2 bands]. */
static void add_linear(const struct linear *l, const double value[3], size_t bands, float *c)
{
	double p = value[1] - value[0], q = value[2] - value[0];
	double c1 = p * (l->w[2][1] - l->w[0][1]) - q * (l->w[1][1] - l->w[0][1]);
	double c2 = q * (l->w[1][0] - l->w[0][0]) - p * (l->w[2][0] - l->w[0][0]);

	c1 = l->det != 0 ? c1 / l->det : 0;
	c2 = l->det != 0 ? c2 / l->det : 0;

	c[0] += (float)(value[0] - c1 * l->w[0][0] - c2 * l->w[0][1]);
	c[bands] += (float)c1;
	c[2 * bands] += (float)c2;
}

static void fill_element(const struct view_scene *v, const struct reconstruction *r, size_t e,
                         float *radiance)
{
	size_t bands = (size_t)v->m->bands;
	struct linear l;

	find_linear(v->m, e, &l);
	for (int side = 0; side < 2; side++)
		for (size_t b = 0; b < bands; b++) {
			double value[3];
			for (size_t k = 0; k < 3; k++)
				value[k] = shown(v, r, 3 * e + k, side, b);
			add_linear(&l, value, bands,
			           radiance + (2 * e + (size_t)side) * 3 * bands + b);
		}
}

/* Is what interpolation misses of a side's light worth computing? */
static int rough(const struct solution *s, size_t element_side)
{
	for (int b = 0; b < s->bands && s->error.discretisation; b++)
		if (s->error.discretisation[element_side * (size_t)s->bands + (size_t)b] >
		    rough_from * solution_irradiance(s, element_side, b))
			return 1;
	return 0;
}

static void find_kinds(struct gather_table *t, const struct solution *s)
{
	const struct model *m = t->v->m;

	for (size_t i = 0; i < 2 * m->element.n; i++) {
		const struct view_side *side =
			&t->v->side[2 * model_patch_material(m, m->element.patch[i / 2]) + i % 2];
		if (side->black)
			continue;
		if (side->reflected.coefficient || side->transmitted.coefficient)
			t->kind[i] |= GATHER_TAIL;
		if (occ_direct_exact(t->v->direct) &&
		    ((side->diffuse && rough(s, i)) || (side->translucent && rough(s, i ^ 1))))
			t->kind[i] |= GATHER_ROUGH;
	}
}

int view_gather_table_init(struct gather_table *t, const struct view_scene *v,
                           const struct solution *s, int threads, struct err *e)
{
	const struct model *m = v->m;
	struct reconstruction rest = { 0 };

	*t = (struct gather_table){ .v = v };
	t->radiance =
	    mem_new(6 * m->element.n, (size_t)m->bands * sizeof *t->radiance, "gathering", e);
	t->rest = mem_new(6 * m->element.n, (size_t)m->bands * sizeof *t->rest, "gathering", e);
	t->kind = mem_new(m->element.n, 2, "gathering", e);
	t->bits = mem_new(2 * GATHER_BITS, sizeof *t->bits, "gathering", e);
	if (!t->radiance || !t->rest || !t->kind || !t->bits ||
	    ray_locator_init(&t->locator, m, e) ||
	    interp_reconstruct(m, s, PART_CAUSTIC | PART_INDIRECT, threads, &rest, e) ||
	    interp_reconstruct(m, s, PART_INDIRECT, threads, &t->indirect, e))
		return -1;
	for (size_t i = 0; i < m->element.n; i++) {
		fill_element(v, &v->all, i, t->radiance);
		fill_element(v, &rest, i, t->rest);
	}
	interp_reconstruction_free(&rest);
	find_kinds(t, s);
	for (uint32_t i = 0; i < GATHER_BITS; i++)
		for (int k = 0; k < 2; k++)
			t->bits[k * GATHER_BITS + (int)i] = rng_sobol_bits(i, k);
	return 0;
}

void view_gather_table_free(struct gather_table *t)
{
	free(t->radiance);
	free(t->rest);
	free(t->kind);
	interp_reconstruction_free(&t->indirect);
	free(t->bits);
	if (t->v)
		ray_locator_free(&t->locator);
}

void view_gather_places(const struct gather_table *t, const struct ray_batch *b, uint32_t n,
                        uint32_t place[RAY_BATCH])
{
	/* Many loads from all over the tables at a time take little longer than one. */
	for (uint32_t i = 0; i < n; i++)
		if (b->triangle[i] != RAY_MISS) {
			place[i] =
			    2 * ray_locate(&t->locator, b->triangle[i], b->w[0][i], b->w[1][i]) +
			    b->side[i];
			__builtin_prefetch(&t->radiance[3 * (size_t)t->v->m->bands * place[i]]);
			__builtin_prefetch(&t->kind[place[i]]);
		}
}

void view_gather_hit(const struct gather_table *t, const struct ray_batch *b, uint32_t i,
                     double x[3])
{
	const struct model *m = t->v->m;
	const uint32_t *c = &m->triangle.corner[3 * (size_t)b->triangle[i]];
	double p = (double)b->w[0][i], q = (double)b->w[1][i];

	for (size_t k = 0; k < 3; k++)
		x[k] = (1 - p - q) * m->vertex[3 * (size_t)c[0] + k] +
		       p * m->vertex[3 * (size_t)c[1] + k] + q * m->vertex[3 * (size_t)c[2] + k];
}

void view_gather_add(const struct gather_table *t, const struct ray_batch *b, uint32_t i,
                     uint32_t place, const double *weight, double *sum)
{
	size_t bands = (size_t)t->v->m->bands;
	const float *c = t->radiance + 3 * bands * place;
	float w1 = b->w[0][i], w2 = b->w[1][i];

	for (size_t k = 0; k < bands; k++) {
		float l = c[k] + c[bands + k] * w1 + c[2 * bands + k] * w2;
		sum[k] += l > 0 ? weight[k] * (double)l : 0;
	}
}
