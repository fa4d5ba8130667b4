/* Nodes with lights (KHR_lights_punctual) to lights. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"
#include "lib/base/constants.h"
#include "lib/base/vec.h"

enum { RGB = 3 };

/* Index of a node's light, or GLTF_NONE. */
static int light_of(const struct gltf_reader *g, size_t node)
{
	const json_t *o = json_array_get(json_object_get(g->source.root, "nodes"), node);
	const json_t *light = json_object_get(
		json_object_get(json_object_get(o, "extensions"), GLTF_LIGHTS), "light");

	return light ? (int)json_integer_value(light) : GLTF_NONE;
}

static char *name_of(const struct gltf_reader *g, size_t node, const json_t *light, int index,
                     json_t *taken, struct err *e)
{
	const json_t *o = json_array_get(json_object_get(g->source.root, "nodes"), node);
	const char *name = gltf_string(o, "name");
	char plain[40];

	if (!name || !*name)
		name = gltf_string(light, "name");
	snprintf(plain, sizeof plain, "light%d", index);
	return gltf_unique_name(taken, name && *name ? name : plain, e);
}

static enum light_kind kind_of(const json_t *light)
{
	const char *type = gltf_string(light, "type");

	return strcmp(type, "point") == 0 ? LIGHT_POINT
	     : strcmp(type, "spot") == 0 ? LIGHT_SPOT : LIGHT_DIRECTIONAL;
}

static int set_cones(const struct gltf_reader *g, const json_t *light, int index, double cone[2],
                     struct err *e)
{
	const json_t *spot = json_object_get(light, "spot");

	cone[0] = fmin(PI / 2, gltf_number(spot, "innerConeAngle", 0));
	cone[1] = fmin(PI / 2, gltf_number(spot, "outerConeAngle", PI / 4));
	if (!(cone[1] > 0) || cone[0] > cone[1])
		return err_set(e, "%s: extensions." GLTF_LIGHTS ".lights[%d].spot: outerConeAngle "
		               "%.15g is %s; correct the file", g->source.path, index, cone[1],
		               cone[1] > 0 ? "below innerConeAngle" : "not above 0");
	return 0;
}

static int set_intensity(const struct gltf_reader *g, const json_t *light, int index,
                         double rgb[RGB], struct err *e)
{
	const json_t *colour = json_object_get(light, "color");

	for (size_t k = 0; k < RGB; k++) {
		rgb[k] = gltf_number(light, "intensity", 1) *
		         (colour ? json_number_value(json_array_get(colour, k)) : 1);
		if (!isfinite(rgb[k]))
			return err_set(e, "%s: extensions." GLTF_LIGHTS ".lights[%d]: its intensity is "
			               "not finite; correct the file", g->source.path, index);
	}
	return 0;
}

/* A light shines along its node's -Z, whatever the scale. */
static int add(struct gltf_reader *g, struct lights *l, size_t i, size_t node,
               const double m[16], struct err *e)
{
	int index = light_of(g, node);
	const json_t *light = json_array_get(gltf_lights_json(g->source.root), (size_t)index);
	enum light_kind kind = kind_of(light);

	l->kind[i] = (uint8_t)kind;
	for (int k = 0; k < 3; k++) {
		l->position[3 * i + (size_t)k] = kind == LIGHT_DIRECTIONAL ? 0 : m[12 + k];
		l->direction[3 * i + (size_t)k] = kind == LIGHT_POINT ? 0 : -m[8 + k];
	}
	if (kind != LIGHT_POINT && !(v3_normalise(&l->direction[3 * i]) > 0))
		return err_set(e, "%s: nodes[%zu]: its matrix gives the light no direction; correct "
		               "it", g->source.path, node);
	if (json_object_get(light, "range") &&
	    gltf_note(g->report, e, "light %s: its range is not modelled: it shines as far as "
	              "nothing is in its way", l->name[i]))
		return -1;
	if (kind == LIGHT_SPOT && set_cones(g, light, index, &l->cone[2 * i], e))
		return -1;
	return set_intensity(g, light, index, &l->intensity[RGB * i], e);
}

int gltf_lights(struct gltf_reader *g, struct model *m, const double *world,
                const uint8_t *reached, struct err *e)
{
	size_t n = 0, i = 0;
	json_t *taken = json_object();

	for (size_t node = 0; node < g->doc.nodes; node++)
		n += reached[node] && light_of(g, node) != GLTF_NONE;
	int bad = model_lights_new(&m->light, n, RGB, e);
	for (size_t node = 0; !bad && node < g->doc.nodes; node++) {
		int index = light_of(g, node);
		if (!reached[node] || index == GLTF_NONE)
			continue;
		m->light.name[i] = name_of(g, node, json_array_get(gltf_lights_json(g->source.root),
		                                                   (size_t)index), index, taken, e);
		bad = !m->light.name[i] || add(g, &m->light, i, node, world + 16 * node, e);
		i++;
	}
	json_decref(taken);
	return bad ? -1 : 0;
}
