#include "lib/view/view_scene.h"

#include <math.h>
#include <stdlib.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/data/model_check.h"
#include "lib/data/solution.h"
#include "lib/interpolate/discretisation.h"

static void make_lobe(struct view_lobe *lobe, const double *coefficient, int bands, double k)
{
	lobe->k = k;
	for (int b = 0; b < bands; b++)
		if (coefficient[b] > 0)
			lobe->coefficient = coefficient;
	if (lobe->coefficient && !isinf(k))
		bsdf_lobe_table_make(&lobe->table, k);
}

static void tabulate_side(const struct materials *mt, size_t material, int side,
                          struct view_side *s)
{
	size_t here = model_material_at(mt, material, side);
	size_t across = model_material_at(mt, material, !side);

	s->black = side == BACK && mt->one_sided[material];
	for (int b = 0; b < mt->bands; b++) {
		s->here[b] = mt->rho_d[here + (size_t)b] / PI;
		s->across[b] = mt->tau_d[across + (size_t)b] / PI;
		s->diffuse |= s->here[b] > 0;
		s->translucent |= s->across[b] > 0;
		s->emits |= mt->emission[here + (size_t)b] > 0;
	}
	make_lobe(&s->reflected, &mt->rho_s[here], mt->bands,
	          mt->alpha[2 * material + (size_t)side]);
	make_lobe(&s->transmitted, &mt->tau_s[across], mt->bands,
	          mt->beta[2 * material + (size_t)!side]);
}

/* U with L_e + M/PI + s U <= U for what one corner of an element-side shows, s its
 * directional weight: then no tail brings more than the largest U of the scene. */
static double corner_ceiling(const struct view_scene *v, size_t material, int side,
                             const float *h, int band)
{
	const struct materials *mt = &v->m->material;
	const struct view_side *s = &v->side[2 * material + (size_t)side];
	double m = mt->emission_exponent[2 * material + (size_t)side];
	double own = mt->emission[model_material_at(mt, material, side) + (size_t)band];
	double kept = 1;

	if (own > 0 && m < 1)
		return (double)INFINITY;
	own += s->here[band] * (double)h[side * mt->bands + band] +
	       s->across[band] * (double)h[!side * mt->bands + band];
	if (s->reflected.coefficient)
		kept -= s->reflected.coefficient[band];
	if (s->transmitted.coefficient)
		kept -= s->transmitted.coefficient[band];
	if (kept < -MODEL_ALBEDO_SLACK)
		return (double)INFINITY;
	return own > 0 ? own / fmax(kept, 0) : 0;
}

static void find_ceiling(struct view_scene *v)
{
	const struct model *m = v->m;
	size_t bands = (size_t)m->bands;

	for (size_t b = 0; b < bands && v->highlights; b++)
		v->ceiling[b] = INFINITY;
	for (size_t c = 0; c < 3 * m->element.n; c++) {
		size_t material = model_patch_material(m, m->element.patch[c / 3]);
		for (int side = 0; side < 2; side++)
			for (int b = 0; b < m->bands; b++) {
				const float *h = v->all.corner + 2 * bands * c;
				if (v->side[2 * material + (size_t)side].black)
					break;
				v->ceiling[b] = fmax(v->ceiling[b],
				                     corner_ceiling(v, material, side, h, b));
			}
	}
}

static int is_finite(const struct view_lobe *lobe)
{
	return lobe->coefficient && !isinf(lobe->k);
}

static int tabulate(struct view_scene *v, struct err *e)
{
	size_t sides = 2 * v->m->material.n;

	v->side = mem_new(sides, sizeof *v->side, "materials of the view", e);
	for (size_t i = 0; v->side && i < sides; i++) {
		tabulate_side(&v->m->material, i / 2, (int)(i % 2), &v->side[i]);
		v->tails |= v->side[i].reflected.coefficient || v->side[i].transmitted.coefficient;
		v->lobes |= is_finite(&v->side[i].reflected) || is_finite(&v->side[i].transmitted);
	}
	v->highlights = v->lobes && v->m->light.n;
	return v->side ? 0 : -1;
}

/* The parts of irradiance that are interpolated. */
static const unsigned interpolated[] = { PART_ALL, PART_CAUSTIC | PART_INDIRECT, PART_CAUSTIC };

/* Errors of interpolated irradiance over those that the solution states of elements, of
 * noise and of discretisation, no unit: fits to several elements take part of both out.
 * Measured when pictures first stated errors, by which command is not known; the report's
 * stated errors (tests/bench/report/stated.py) and test_view_gather.c tell when they are wrong. */
static const double noise_left = .22, discretisation_left = .6;

/* Variance of a linear fit at an edge over that in the middle. */
static const double variance_at_edge = 4;

/* What is left of an error without that of a part. */
static double without(const double *all, const double *part, size_t at)
{
	double taken = all && part ? fmin(part[at], all[at]) : 0;

	return all ? all[at] * all[at] - taken * taken : 0;
}

double view_blurred(const struct view_scene *v, size_t at, double part, int computed)
{
	const struct solution *s = v->s;
	double noise = without(s->error.sampling, computed ? s->error.sampling_direct : NULL, at);
	double missed =
	    without(s->error.discretisation, computed ? s->error.discretisation_direct : NULL, at);

	/* What is so near stands at an edge. */
	return fmin(variance_at_edge * noise_left * noise_left, part) * noise +
	       fmin(1, part) * discretisation_left * discretisation_left * missed;
}

/* Group 0 of a solution with the parts that are interpolated alone, in arrays of its own. */
static int part_solution(const struct solution *s, unsigned parts, struct solution *out,
                         struct err *e)
{
	size_t n = s->element_sides * (size_t)s->bands;
	double **to[] = { &out->irradiance.direct, &out->irradiance.caustic,
		          &out->irradiance.indirect };
	const double *from[] = { s->irradiance.direct, s->irradiance.caustic,
		                 s->irradiance.indirect };

	*out =
	    (struct solution){ .groups = 1, .element_sides = s->element_sides, .bands = s->bands };
	for (int p = 0; p < 3; p++) {
		if (!(*to[p] = mem_new(n, sizeof **to[p], "errors", e)))
			return -1;
		for (size_t g = 0; g < s->groups; g++)
			for (size_t i = 0; i < n && (parts >> p & 1); i++)
				(*to[p])[i] += from[p][g * n + i];
	}
	out->error.sampling = mem_new(n, sizeof *out->error.sampling, "errors", e);
	out->error.sampling_direct = mem_new(n, sizeof *out->error.sampling_direct, "errors", e);
	out->error.discretisation = mem_new(n, sizeof *out->error.discretisation, "errors", e);
	out->error.discretisation_direct =
	    mem_new(n, sizeof *out->error.discretisation, "errors", e);
	return out->error.sampling && out->error.sampling_direct && out->error.discretisation &&
	       out->error.discretisation_direct ? 0 : -1;
}

/* The errors of the parts that are interpolated: noise, which light straight from emitters
 * by formula has no part in, by their share; discretisation estimated anew. */
static int part_errors(const struct view_scene *v, const struct solution *s, int threads,
                       struct solution *some, struct err *e)
{
	unsigned parts = interpolated[v->method];
	size_t n = s->element_sides * (size_t)s->bands;

	if (part_solution(s, parts, some, e))
		return -1;
	for (size_t i = 0; i < n && s->error.sampling; i++) {
		double h = some->irradiance.direct[i] + some->irradiance.caustic[i] +
		           some->irradiance.indirect[i];
		double all = h;
		for (size_t g = 0; g < s->groups && parts == PART_CAUSTIC; g++)
			all += s->irradiance.direct[g * n + i] + s->irradiance.indirect[g * n + i];
		some->error.sampling[i] = all > 0 ? s->error.sampling[i] * h / all : 0;
		if (s->error.sampling_direct && parts & PART_DIRECT)
			some->error.sampling_direct[i] = s->error.sampling_direct[i];
	}
	return interp_discretisation(v->m, some, 1, threads, e);
}

/* The standard error of what is interpolated. */
static int find_misses(struct view_scene *v, const struct solution *s, int threads, struct err *e)
{
	size_t n = s->element_sides * (size_t)s->bands;
	struct solution some = { 0 };
	int whole = v->method == VIEW_MESH;
	int bad = whole ? 0 : part_errors(v, s, threads, &some, e);
	const double *noise = whole ? s->error.sampling : some.error.sampling;
	const double *uneven = interpolated[v->method] & PART_INDIRECT ? s->error.uneven : NULL;
	const double *missed = whole ? s->error.discretisation : some.error.discretisation;

	v->miss = mem_new(n, sizeof *v->miss, "errors", e);
	for (size_t i = 0; i < n && v->miss && !bad; i++)
		v->miss[i] = (float)hypot(hypot(noise ? noise_left * noise[i] : 0, uneven ? uneven[i] : 0),
		                          missed ? discretisation_left * missed[i] : 0);
	solution_free(&some);
	return bad || !v->miss ? -1 : 0;
}

/* All light is interpolated where it is not recomputed, and behind what blurs it. */
static int interpolate(struct view_scene *v, const struct solution *s, int threads, struct err *e)
{
	if ((v->method != VIEW_DIRECT || v->tails) &&
	    interp_reconstruct(v->m, s, PART_ALL, threads, &v->all, e))
		return -1;
	return v->method != VIEW_MESH &&
	       interp_reconstruct(v->m, s, interpolated[v->method], threads, &v->part, e) ? -1 : 0;
}

struct view_scene *view_scene_new(const struct model *m, const struct solution *s,
                                  const struct ray_scene *rays, enum view_method method,
                                  int threads, struct err *e)
{
	struct view_scene *v = mem_new(1, sizeof *v, "view", e);

	if (!v)
		return NULL;
	v->m = m;
	v->s = s;
	v->rays = rays;
	v->method = method;
	if (!tabulate(v, e) && !interpolate(v, s, threads, e) && !find_misses(v, s, threads, e) &&
	    ((method == VIEW_MESH && !v->lobes) || (v->direct = occ_direct_new(m, rays, e))) &&
	    (!v->lobes || !aim_images_init(&v->images, m, e)) &&
	    (!v->highlights || !ray_light_visibility_new(m, rays, &v->ways, e))) {
		if (v->tails)
			find_ceiling(v);
		return v;
	}
	view_scene_free(v);
	return NULL;
}

int view_misses(const struct view_scene *v)
{
	return v->highlights && !v->ways.images.complete;
}

void view_scene_free(struct view_scene *v)
{
	if (!v)
		return;
	occ_direct_free(v->direct);
	aim_images_free(&v->images);
	ray_light_visibility_free(&v->ways);
	interp_reconstruction_free(&v->all);
	interp_reconstruction_free(&v->part);
	free(v->miss);
	free(v->side);
	free(v);
}
