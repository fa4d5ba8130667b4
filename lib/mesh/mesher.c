#include "lib/mesh/mesher.h"

#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/geometry/enclosing_ball.h"
#include "lib/mesh/stages.h"
#include "lib/scatter/bsdf.h"

static double metres(struct mesh_size s, double diameter)
{
	return s.relative ? s.value * diameter : s.value;
}

static int set_sizes(const struct model *m, const struct mesh_options *o,
                     struct mesh_report *r, struct err *e)
{
	r->diameter = 2 * geo_enclosing_ball(m->vertex, m->vertices).radius;
	r->patch_size = metres(o->patch, r->diameter);
	r->element_size = metres(o->element, r->diameter);
	if (o->element_within_patch)
		r->element_size = fmin(r->element_size, r->patch_size);
	if (!isfinite(r->diameter))
		return err_set(e, "the scene is too large for double precision");
	return 0;
}

/* Surfaces that were divided by merging need vertices of their own again. */
static int separate_again(struct model *m, uint32_t **position, size_t *places,
                          struct err *e)
{
	uint32_t *group = NULL;
	int status = mesh_clean_separate(m, &group, e);

	free(group);
	free(*position);
	*position = status ? NULL : mesh_clean_positions(m, places, e);
	return *position ? 0 : -1;
}

static int clean(struct model *m, struct mesh_report *r, struct err *e)
{
	size_t places, given = m->triangle.n;
	uint32_t *position = NULL;

	r->surfaces = m->surface.n;
	r->surface = mem_new(r->surfaces, sizeof *r->surface, "surfaces", e);
	if (!r->surface || mesh_clean_degenerate(m, r, e))
		return -1;
	if (m->triangle.n == 0)
		return given ? err_set(e, "there is no geometry: all %zu triangles are "
		                       "without area", given)
		             : err_set(e, "there is no geometry: no triangles in the scene");
	position = mesh_clean_positions(m, &places, e);
	int status = position && !mesh_drop_coincident(m, position, r, e) &&
	             (!r->merged || !separate_again(m, &position, &places, e)) &&
	             !mesh_check_watertight(m, position, places, r, e) ? 0 : -1;
	free(position);
	return status;
}

static int make_patches(struct model *m, const struct mesh_options *o,
                        const struct mesh_report *r, struct err *e)
{
	size_t patches;
	uint32_t *patch = mem_new(m->element.n, sizeof *patch, "patches", e);
	double cos_cone = cos(o->normal_cone * acos(-1) / 180);
	int status = patch && !mesh_find_patches(m, r->patch_size, cos_cone, patch, &patches, e) &&
	             !mesh_order_model(m, patch, patches, e) ? 0 : -1;

	free(patch);
	return status;
}

/* Does any modelled side of the material do so, by reflection or transmission? */
static int any_side(const struct materials *mt, size_t i,
                    int (*has)(const struct materials *, size_t, int, int))
{
	int sides = mt->one_sided[i] ? 1 : 2;

	for (int s = 0; s < sides; s++)
		if (has(mt, i, s, 0) || has(mt, i, s, 1))
			return 1;
	return 0;
}

static int positive(const double *x, const struct materials *mt, size_t i)
{
	int values = (mt->one_sided[i] ? 1 : 2) * mt->bands;

	for (int b = 0; b < values; b++)
		if (x[model_material_at(mt, i, FRONT) + (size_t)b] > 0)
			return 1;
	return 0;
}

static int report_materials(const struct model *m, struct mesh_report *r, struct err *e)
{
	const struct materials *mt = &m->material;
	uint8_t *used = mem_new(mt->n, 1, "materials", e);

	if (!used)
		return -1;
	for (uint32_t p = 0; p < m->patch.n; p++)
		used[model_patch_material(m, p)] = 1;
	for (size_t i = 0; i < mt->n; i++) {
		if (!used[i])
			continue;
		r->materials++;
		r->two_sided += !mt->one_sided[i];
		r->emitters += (size_t)positive(mt->emission, mt, i);
		r->transmitting += (size_t)(positive(mt->tau_d, mt, i) ||
		                            positive(mt->tau_s, mt, i));
		r->lobes += (size_t)any_side(mt, i, bsdf_has_lobe);
		r->ideal += (size_t)any_side(mt, i, bsdf_has_ideal);
	}
	free(used);
	return 0;
}

static void report_patches(const struct model *m, struct mesh_report *r)
{
	for (uint32_t p = 0; p < m->patch.n; p++) {
		uint32_t elements = m->patch.start[p + 1] - m->patch.start[p];
		if (elements > r->largest_patch)
			r->largest_patch = elements;
		r->area_front += m->patch.area[p];
		if (model_side_modelled(m, 2 * p + BACK))
			r->area_back += m->patch.area[p];
	}
}

/* Stages of about equal length. */
static void tell(const struct mesh_options *o, int stage)
{
	if (o->progress && o->progress->fn)
		o->progress->fn(o->progress->arg, stage, 4);
}

/* What follows when elements and patches are in order. */
static int finish(struct model *m, struct mesh_report *r, struct err *e)
{
	if (model_derive(m, e) || mesh_outline_patches(m, &r->planar_patches, e) ||
	    report_materials(m, r, e))
		return -1;
	report_patches(m, r);
	return 0;
}

int mesh_run(struct model *m, const struct mesh_options *o, struct mesh_report *r,
             struct err *e)
{
	if (clean(m, r, e) || set_sizes(m, o, r, e) ||
	    mesh_check_element_size(m, r->element_size, e))
		return -1;
	tell(o, 1);
	if ((!o->no_imprint && mesh_imprint(m, r->element_size, r, e)) ||
	    mesh_bisect(m, r->element_size, e) || mesh_divide_near_lights(m, r->element_size, e))
		return -1;
	tell(o, 2);
	if (make_patches(m, o, r, e))
		return -1;
	tell(o, 3);
	return finish(m, r, e);
}

/* ---- refinement ---- */

static int same_triangles(const struct model *a, const struct model *b)
{
	if (a->triangle.n != b->triangle.n || a->surface.n != b->surface.n)
		return 0;
	for (size_t t = 0; t < a->triangle.n; t++)
		if (a->triangle.surface[t] != b->triangle.surface[t])
			return 0;
	for (size_t c = 0; c < 3 * a->triangle.n; c++)
		for (size_t k = 0; k < 3; k++)
			if (a->vertex[3 * (size_t)a->triangle.corner[c] + k] !=
			    b->vertex[3 * (size_t)b->triangle.corner[c] + k])
				return 0;
	return 1;
}

/* Halvings. */
struct plan {
	uint8_t *element, *patch;
};

/* Gives m the vertices, elements and split trees of old. */
static void take_division(struct model *m, struct model *old)
{
	free(m->vertex);
	free(m->triangle.corner);
	m->vertices = old->vertices;
	m->vertex = old->vertex;
	m->triangle.corner = old->triangle.corner;
	m->triangle.split = old->triangle.split;
	m->splits = old->splits;
	m->split = old->split;
	m->element.n = old->element.n;
	m->element.corner = old->element.corner;
	m->element.triangle = old->element.triangle;
	old->vertex = NULL;
	old->triangle.corner = old->element.corner = old->element.triangle = NULL;
	old->triangle.split = NULL;
	old->split = NULL;
}

/* Divides m, which is as `old` was, by the plan. */
static int divide_further(struct model *m, const struct mesh_options *o,
                          const struct mesh_report *r, const struct model *old,
                          const struct plan *plan, uint32_t **origin, struct err *e)
{
	double cos_cone = cos(o->normal_cone * acos(-1) / 180);
	size_t patches;

	if (mesh_bisect_further(m, plan->element, origin, e))
		return -1;
	uint32_t *before = mem_new(m->element.n, sizeof *before, "patches", e);
	uint32_t *patch = mem_new(m->element.n, sizeof *patch, "patches", e);
	for (size_t i = 0; before && i < m->element.n; i++)
		before[i] = old->element.patch[(*origin)[i]];
	int status = before && patch &&
	             !mesh_split_patches(m, r->patch_size, cos_cone, before, old->patch.n,
	                                 plan->patch, patch, &patches, e) &&
	             !mesh_order_elements(m, patch, patches, *origin, e) ? 0 : -1;
	free(before);
	free(patch);
	return status;
}

int mesh_refine(struct model *m, const struct mesh_options *o, struct model *old,
                const struct solution *s, const struct mesh_refinement *how,
                uint32_t **origin, struct mesh_report *r, struct err *e)
{
	*origin = NULL;
	if (clean(m, r, e) || set_sizes(m, o, r, e) ||
	    (!o->no_imprint && mesh_imprint(m, r->element_size, r, e)))
		return -1;
	if (!same_triangles(m, old))
		return err_set(e, "the solution to refine has other triangles: the geometry, or an "
		               "option of mesh, has changed since; make a mesh without --refine");
	tell(o, 1);
	r->elements_before = old->element.n;
	r->patches_before = old->patch.n;
	struct plan plan = { mem_new(old->element.n, 1, "elements", e),
		             mem_new(old->patch.n, 1, "patches", e) };
	int status = plan.element && plan.patch &&
	             !mesh_adapt_plan(old, s, how, metres(how->smallest, r->diameter), plan.element,
	                              plan.patch, r, e) ? 0 : -1;
	tell(o, 2);
	if (!status) {
		take_division(m, old);
		status = divide_further(m, o, r, old, &plan, origin, e);
	}
	free(plan.element);
	free(plan.patch);
	tell(o, 3);
	return status ? -1 : finish(m, r, e);
}

void mesh_report_free(struct mesh_report *r)
{
	free(r->surface);
	*r = (struct mesh_report){ 0 };
}
