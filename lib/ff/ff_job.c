/* What all rows share, and what each thread has for itself: made, and freed. */
#include "lib/ff/ff_job.h"

#include <stdlib.h>

#include "lib/ff/hemicube_pilot.h"
#include "lib/ff_rays/landings.h"
#include "lib/ff/row_reciprocal.h"
#include "lib/ff_rays/chain_limit.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/ff_rays/sobol_points.h"
#include "lib/scatter/bsdf.h"

/* Counts, for a pair of a patch-side and an element: evaluations of what is partly hidden, and
 * occluders between, beyond which rays do as well. Guesses. */
enum { FORMULA_EVALUATIONS = 1000, FORMULA_OCCLUDERS = 8 };

/* Of what nothing hides, by formula to elements, relative: finer than any picture shows. A guess. */
static const double FORMULA_ERROR = 1e-5;

/* ---- what leaves which side ---- */

static int any(const double *x, int n)
{
	for (int i = 0; i < n; i++)
		if (x[i] > 0)
			return 1;
	return 0;
}

static void side_flags(struct ff_job *j, uint32_t ps)
{
	const struct materials *mt = &j->m->material;
	uint32_t material = model_patch_material(j->m, ps >> 1);
	int side = (int)(ps & 1), bands = mt->bands;
	size_t here = model_material_at(mt, material, side), there = model_material_at(mt, material, !side);
	int emits = any(&mt->emission[here], bands);
	int plain = mt->emission_exponent[2 * material + (uint32_t)side] == 1;

	j->is_black[ps] = !model_side_modelled(j->m, ps);
	if (j->is_black[ps])
		return;
	j->emits[ps] = (uint8_t)emits;
	j->shoots_diffuse[ps] = (emits && plain) || any(&mt->rho_d[here], bands) ||
	                        any(&mt->tau_d[there], bands);
	j->shoots_lobe[ps] = emits && !plain;
	j->has_lobe[ps] = bsdf_has_lobe(mt, material, side, 0) ||
	                  bsdf_has_lobe(mt, material, side, 1);
	j->lobes += j->has_lobe[ps];
	j->is_ideal[ps] = bsdf_has_ideal(mt, material, side, 0) ||
	                  bsdf_has_ideal(mt, material, side, 1);
	j->lights.panes |= bsdf_has_ideal(mt, material, side, 1);
	j->has_ideal |= j->is_ideal[ps];
	j->is_source[ps] = j->shoots_diffuse[ps] || j->shoots_lobe[ps] ||
	                   bsdf_has_lobe(mt, material, side, 0) ||
	                   bsdf_has_lobe(mt, material, !side, 1);
}

static int job_arrays(struct ff_job *j, struct err *e)
{
	size_t sides = 2 * j->m->patch.n;
	j->element = mem_new(j->m->element.n, sizeof *j->element, "sampling tables", e);
	j->shoots_diffuse = mem_new(sides, 1, "patch flags", e);
	j->shoots_lobe = mem_new(sides, 1, "patch flags", e);
	j->has_lobe = mem_new(sides, 1, "patch flags", e);
	j->emits = mem_new(sides, 1, "patch flags", e);
	j->is_source = mem_new(sides, 1, "patch flags", e);
	j->is_black = mem_new(sides, 1, "patch flags", e);
	j->is_ideal = mem_new(sides, 1, "patch flags", e);
	return j->element && j->shoots_diffuse && j->shoots_lobe && j->has_lobe && j->emits &&
	       j->is_source && j->is_black && j->is_ideal ? 0 : -1;
}

/* A ray that lands on some sides has more to it than where it lands. */
static int make_places(struct ff_job *j, struct err *e)
{
	uint8_t *apart = mem_new(2 * j->m->patch.n, 1, "patch flags", e);
	int bad = !apart;

	for (size_t ps = 0; !bad && ps < 2 * j->m->patch.n; ps++)
		apart[ps] = j->is_black[ps] || j->is_ideal[ps] || j->has_lobe[ps];
	bad = bad || ff_tally_places_init(&j->places, j->m, apart, e);
	free(apart);
	return bad ? -1 : 0;
}

int ff_job_init(struct ff_job *j, const struct model *m, const struct ff_options *o,
                struct err *e)
{
	*j = (struct ff_job){ .m = m, .o = *o };
	if (job_arrays(j, e) || ray_locator_init(&j->locator, m, e) ||
	    !(j->rays = ray_scene_new(m, e)))
		return -1;
	for (uint32_t ps = 0; ps < 2 * m->patch.n; ps++)
		side_flags(j, ps);
	ff_element_table(j);
	j->lights.m = m;
	j->lights.rays = j->rays;
	return ray_light_images_new(m, ray_offset(j->rays), 1, SIZE_MAX, 0, &j->lights.images, e);
}

int ff_job_prepare(struct ff_job *j, int patches, struct err *e)
{
	int formula = patches && ff_by_formula(&j->o), cubes = patches && j->o.method == FF_HEMICUBE;

	if (cubes && (ff_hemicube_grid_init(&j->grid, (int)j->o.rays, e) ||
	              !(j->cubes = ff_hemicube_scene_new(j->m, &j->locator, e))))
		return -1;
	if (formula && ff_formula_init(&j->formula, j->m, j->o.method == FF_ANALYTIC, e))
		return -1;
	return ff_sobol_points(j, e) || make_places(j, e) || ff_find_chain_limit(j, e) ? -1 : 0;
}

void ff_job_free(struct ff_job *j)
{
	void *array[] = { j->element, j->shoots_diffuse, j->shoots_lobe, j->has_lobe,
		j->is_source, j->emits, j->is_ideal, j->is_black, j->of_rows.bits,
		j->of_reciprocal.bits, j->of_small.bits, j->halvings };

	for (size_t i = 0; i < sizeof array / sizeof *array; i++)
		free(array[i]);
	ray_light_visibility_free(&j->lights);
	ray_locator_free(&j->locator);
	ff_tally_places_free(&j->places);
	ff_reciprocal_free(&j->reciprocal);
	ff_landings_free(&j->landings);
	ff_formula_free(&j->formula);
	ray_scene_free(j->rays);
	ff_hemicube_scene_free(j->cubes);
	ff_hemicube_grid_free(&j->grid);
}

int ff_thread_init(struct ff_thread *t, const struct ff_job *j, struct err *e)
{
	const struct exchange_options o = { FORMULA_ERROR, j->o.target, FORMULA_EVALUATIONS,
	                                    FORMULA_OCCLUDERS, 0 };

	*t = (struct ff_thread){ .job = j };
	if (ff_tally_init(&t->tally, j->m, &j->places, j->has_lobe, j->chain_most, e))
		return -1;
	t->tally.dependent = j->o.method == FF_HEMICUBE; /* pixels of a cube share its place */
	if (j->formula.on) {
		t->formula = mem_new(1, sizeof *t->formula, "formulas", e);
		if (!t->formula)
			return -1;
		occ_exchanger_init(t->formula, &o, &j->formula.occluders, j->rays, j->formula.centre);
	}
	if (j->o.method != FF_HEMICUBE)
		return 0;
	t->item = mem_new(2 * (size_t)j->o.points, j->grid.pixels * sizeof *t->item,
	                  "hemicube items", e);
	t->view = mem_new(2 * (size_t)j->o.points, sizeof *t->view, "hemicube views", e);
	t->weight = mem_new(j->grid.pixels, sizeof *t->weight, "hemicube lobes", e);
	if (!t->item || !t->view || !t->weight || ff_hemicube_init(&t->cube, &j->grid, e))
		return -1;
	return j->o.points == 1 ? ff_hemicube_pilot_init(t, e) : 0;
}

void ff_thread_free(struct ff_thread *t)
{
	ff_tally_free(&t->tally);
	ff_hemicube_free(&t->cube);
	free(t->pilot_sum);
	free(t->pilot_item);
	if (t->formula)
		occ_exchanger_free(t->formula);
	free(t->formula);
	free(t->incident.data);
	free(t->pairs.data);
	free(t->shares.data);
	free(t->arrivals.data);
	free(t->item);
	free(t->view);
	free(t->weight);
	free(t->chain_map.data);
}
