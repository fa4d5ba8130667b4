/* What the scene is made of, side by side. */
#include <string.h>

#include "formats/api/api_scene.h"
#include "lib/audit/side_table.h"

_Static_assert((int)TWOPASS_BANDS_MAX == (int)BANDS_MAX, "bands of the public header");

int twopass_bands(const struct twopass_scene *s)
{
	return s->m.bands;
}

size_t twopass_patches(const struct twopass_scene *s)
{
	return s->patches;
}

size_t twopass_elements(const struct twopass_scene *s)
{
	return s->elements;
}

int twopass_get_patch(const struct twopass_scene *s, size_t i, struct twopass_patch *out)
{
	const struct model *m = &s->m;

	*out = (struct twopass_patch){ 0 };
	if (i >= s->patches)
		return -1;
	out->patch = s->patch[i] >> 1;
	out->back = s->patch[i] & 1;
	out->name = s->name[s->patch[i]];
	out->surface = m->surface.name[m->patch.surface[out->patch]];
	out->material = m->material.name[model_patch_material(m, out->patch)];
	out->area = m->patch.area[out->patch];
	return 0;
}

int twopass_get_element(const struct twopass_scene *s, size_t i, struct twopass_element *out)
{
	const size_t bands = (size_t)s->m.bands;
	struct side_row row;

	*out = (struct twopass_element){ 0 };
	if (i >= s->elements)
		return -1;
	solution_side_row(&s->m, s->s.irradiance.direct ? &s->s : NULL, s->element[i], &row);
	out->patch = s->place[2 * row.patch + (uint32_t)row.side];
	out->element = row.element;
	out->back = row.side;
	out->area = row.area;
	memcpy(out->centroid, row.centre, sizeof row.centre);
	memcpy(out->normal, row.normal, sizeof row.normal);
	memcpy(out->irradiance, row.h, sizeof row.h);
	memcpy(out->exitance, row.m, sizeof row.m);
	memcpy(out->emission, row.e, sizeof row.e);
	if (s->s.irradiance.direct) {
		const size_t at = s->element[i] * bands;
		memcpy(out->sampling_error, &s->s.error.sampling[at], bands * sizeof(double));
		memcpy(out->element_error, &s->s.error.discretisation[at], bands * sizeof(double));
	}
	return 0;
}
