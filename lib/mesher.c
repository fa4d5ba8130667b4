#include "mesher.h"

#include <math.h>
#include <stdlib.h>

#include "bsdf.h"
#include "mem.h"
#include "mesher_parts.h"
#include "vec3.h"

static double metres(struct mesher_size s, double diagonal)
{
	return s.relative ? s.value * diagonal : s.value;
}

static int set_sizes(const struct model *m, const struct mesher_options *o,
                     struct mesher_report *r, struct err *e)
{
	double lo[3], hi[3], d[3];

	scene_box(m, lo, hi);
	v3_sub(hi, lo, d);
	r->diagonal = v3_length(d);
	r->patch_size = metres(o->patch, r->diagonal);
	r->element_size = metres(o->element, r->diagonal);
	if (o->element_within_patch)
		r->element_size = fmin(r->element_size, r->patch_size);
	if (!isfinite(r->diagonal))
		return err_set(e, "the scene is too large for double precision");
	return 0;
}

/* Surfaces that were divided by merging need vertices of their own again. */
static int separate_again(struct model *m, uint32_t **position, size_t *places,
                          struct err *e)
{
	uint32_t *group = NULL;
	int status = clean_separate(m, &group, e);

	free(group);
	free(*position);
	*position = status ? NULL : clean_positions(m, places, e);
	return *position ? 0 : -1;
}

static int clean(struct model *m, struct mesher_report *r, struct err *e)
{
	size_t places, given = m->triangles;
	uint32_t *position = NULL;

	r->surfaces = m->surface.n;
	r->surface = mem_new(r->surfaces, sizeof *r->surface, "surfaces", e);
	if (!r->surface || clean_model(m, r, e))
		return -1;
	if (m->triangles == 0)
		return given ? err_set(e, "there is no geometry: all %zu triangles are "
		                       "without area", given)
		             : err_set(e, "there is no geometry: no triangles in the scene");
	position = clean_positions(m, &places, e);
	int status = position && !drop_duplicates(m, position, r, e) &&
	             (!r->merged || !separate_again(m, &position, &places, e)) &&
	             !check_closed(m, position, places, r, e) ? 0 : -1;
	free(position);
	return status;
}

static int make_patches(struct model *m, const struct mesher_options *o,
                        const struct mesher_report *r, struct err *e)
{
	size_t patches;
	uint32_t *patch = mem_new(m->elements, sizeof *patch, "patches", e);
	double cos_cone = cos(o->normal_cone * acos(-1) / 180);
	int status = patch && !find_patches(m, r->patch_size, cos_cone, patch, &patches, e) &&
	             !order_model(m, patch, patches, e) ? 0 : -1;

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
		if (x[material_at(mt, i, FRONT) + (size_t)b] > 0)
			return 1;
	return 0;
}

static int report_materials(const struct model *m, struct mesher_report *r, struct err *e)
{
	const struct materials *mt = &m->material;
	uint8_t *used = mem_new(mt->n, 1, "materials", e);

	if (!used)
		return -1;
	for (uint32_t p = 0; p < m->patches; p++)
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

static void report_patches(const struct model *m, struct mesher_report *r)
{
	for (uint32_t p = 0; p < m->patches; p++) {
		uint32_t elements = m->patch_start[p + 1] - m->patch_start[p];
		if (elements > r->largest_patch)
			r->largest_patch = elements;
		r->area_front += m->patch_area[p];
		if (model_side_modelled(m, 2 * p + BACK))
			r->area_back += m->patch_area[p];
	}
}

/* Stages of about equal length. */
static void tell(const struct mesher_options *o, int stage)
{
	if (o->progress && o->progress->fn)
		o->progress->fn(o->progress->arg, stage, 4);
}

int mesher_run(struct model *m, const struct mesher_options *o, struct mesher_report *r,
               struct err *e)
{
	if (clean(m, r, e) || set_sizes(m, o, r, e) ||
	    check_element_size(m, r->element_size, e))
		return -1;
	tell(o, 1);
	if ((!o->no_imprint && imprint(m, r->element_size, r, e)) ||
	    subdivide(m, r->element_size, e))
		return -1;
	tell(o, 2);
	if (make_patches(m, o, r, e) || model_derive(m, e))
		return -1;
	tell(o, 3);
	if (outline_patches(m, &r->planar_patches, e) || report_materials(m, r, e))
		return -1;
	report_patches(m, r);
	return 0;
}

void mesher_report_free(struct mesher_report *r)
{
	free(r->surface);
	*r = (struct mesher_report){ 0 };
}
