/* Materials: what the file says, in RGB or in the bands that its extras name;
 * gltf_bands.c brings it into the bands of the model. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"
#include "formats/gltf/gltf_material.h"
#include "lib/base/mem.h"
#include "lib/data/model_check.h"

enum { RGB = 3 };

struct reading {
	struct gltf_reader *g;
	const char *path;
	const json_t *material;
	struct gltf_material *to;
	int bands;              /* working bands: 3, or what the extras name */
	struct err *e;
};

static const json_t *extension(const struct reading *r, const char *name)
{
	return json_object_get(json_object_get(r->material, "extensions"), name);
}

static json_t *twopass(const json_t *material)
{
	return json_object_get(json_object_get(material, "extras"), "twopass");
}

/* ---- metallic-roughness ---- */

static void colour(const json_t *o, const char *key, double out[RGB])
{
	const json_t *v = json_object_get(o, key);

	for (size_t b = 0; v && b < RGB; b++)
		out[b] = json_number_value(json_array_get(v, b));
}

static int outside(const double *x, size_t n)
{
	for (size_t i = 0; i < n; i++)
		if (x[i] < 0 || x[i] > 1)
			return 1;
	return 0;
}

/* Constant alpha. A mask of constant alpha is all there or not at all. */
static double opacity(const struct reading *r)
{
	const json_t *pbr = json_object_get(r->material, "pbrMetallicRoughness");
	const json_t *base = json_object_get(pbr, "baseColorFactor");
	const char *mode = gltf_string(r->material, "alphaMode");
	double a = base ? json_number_value(json_array_get(base, RGB)) : 1;

	if (!mode || strcmp(mode, "OPAQUE") == 0)
		return 1;
	if (strcmp(mode, "BLEND") == 0)
		return a;
	return a >= gltf_number(r->material, "alphaCutoff", .5);
}

static int read_parameters(const struct reading *r, struct bsdf_gltf *p)
{
	const json_t *pbr = json_object_get(r->material, "pbrMetallicRoughness");
	const json_t *diffuse = extension(r, "KHR_materials_diffuse_transmission");
	const json_t *specular = extension(r, "KHR_materials_specular");

	*p = bsdf_gltf_default;
	colour(pbr, "baseColorFactor", p->base);
	p->opacity = opacity(r);
	p->metallic = gltf_number(pbr, "metallicFactor", p->metallic);
	p->roughness = gltf_number(pbr, "roughnessFactor", p->roughness);
	p->transmission = gltf_number(extension(r, "KHR_materials_transmission"),
	                              "transmissionFactor", 0);
	p->diffuse_transmission = gltf_number(diffuse, "diffuseTransmissionFactor", 0);
	colour(diffuse, "diffuseTransmissionColorFactor", p->diffuse_transmission_colour);
	p->ior = gltf_number(extension(r, "KHR_materials_ior"), "ior", p->ior);
	p->specular = gltf_number(specular, "specularFactor", p->specular);
	colour(specular, "specularColorFactor", p->specular_colour);
	if (p->ior != 0 && p->ior < 1)
		return err_set(r->e, "%s: material %s: KHR_materials_ior.ior: %.15g is neither 0 "
		               "nor at least 1; correct the file", r->path, r->to->name, p->ior);
	double unit[] = { p->opacity, p->metallic, p->roughness, p->transmission,
		p->diffuse_transmission, p->specular };
	if (outside(p->base, RGB) || outside(p->diffuse_transmission_colour, RGB) ||
	    outside(unit, sizeof unit / sizeof *unit))
		return gltf_note(r->g->report, r->e, "material %s: factors outside [0,1] are "
		                 "clamped", r->to->name);
	return 0;
}

static int note_fold(const struct reading *r, const char *lobe, enum bsdf_fate fate,
                     double share, double exponent)
{
	const struct gltf_options *o = r->g->options;
	struct gltf_report *report = r->g->report;

	switch (fate) {
	case BSDF_WIDE:
		return gltf_note(report, r->e, "material %s: its %s lobe is folded into the diffuse "
		                 "part: exponent %.3g is below %.3g", r->to->name, lobe, exponent,
		                 o->min_exponent);
	case BSDF_WEAK:
		return gltf_note(report, r->e, "material %s: its %s lobe is folded into the diffuse "
		                 "part: its share of the albedo, %.3g, is below %.3g", r->to->name,
		                 lobe, share, o->min_directional);
	case BSDF_PANE:
		return gltf_note(report, r->e, "material %s: its %s lobe is folded into the diffuse "
		                 "part: alphaMode BLEND adds a clear pane, and a material has one "
		                 "transmitted lobe", r->to->name, lobe);
	case BSDF_NONE:
	case BSDF_KEPT:
		break;
	}
	return 0;
}

/* RGB to working bands: as it is, or grey to any number of bands. */
static int spread(const struct reading *r, const double rgb[RGB], const char *what,
                  double *out)
{
	if (r->bands != RGB && (rgb[0] != rgb[1] || rgb[1] != rgb[2]))
		return err_set(r->e, "%s: material %s: its %s is an RGB colour but other materials "
		               "have %d bands; give its %d coefficients in extras.twopass",
		               r->path, r->to->name, what, r->bands, r->bands);
	for (int b = 0; b < r->bands; b++)
		out[b] = rgb[r->bands == RGB ? b : 0];
	return 0;
}

static int read_factors(const struct reading *r)
{
	const struct gltf_options *o = r->g->options;
	struct bsdf_gltf p;
	struct bsdf_folding f;
	struct bsdf_side rgb, *front = &r->to->side[FRONT];

	if (read_parameters(r, &p))
		return -1;
	bsdf_from_gltf(&p, o->min_directional, o->min_exponent, &rgb, &f);
	if (note_fold(r, "reflected", f.reflected, f.reflected_share, f.exponent) ||
	    note_fold(r, "transmitted", f.transmitted, f.transmitted_share, f.exponent) ||
	    spread(r, rgb.rho_d, "diffuse reflection", front->rho_d) ||
	    spread(r, rgb.tau_d, "diffuse transmission", front->tau_d) ||
	    spread(r, rgb.rho_s, "reflection", front->rho_s) ||
	    spread(r, rgb.tau_s, "transmission", front->tau_s))
		return -1;
	front->alpha = rgb.alpha;
	front->beta = rgb.beta;
	r->to->side[BACK] = *front;
	return 0;
}

static int read_emission(const struct reading *r)
{
	double strength = gltf_number(extension(r, "KHR_materials_emissive_strength"),
	                              "emissiveStrength", 1);
	double rgb[RGB] = { 0 };

	colour(r->material, "emissiveFactor", rgb);
	for (int b = 0; b < RGB; b++) {
		rgb[b] *= strength;
		if (!isfinite(rgb[b]))
			return err_set(r->e, "%s: material %s: its emission is not finite; correct "
			               "the file", r->path, r->to->name);
	}
	if (spread(r, rgb, "emission", r->to->emission[FRONT]))
		return -1;
	if (json_is_true(json_object_get(r->material, "doubleSided")))
		memcpy(r->to->emission[BACK], r->to->emission[FRONT], sizeof r->to->emission[BACK]);
	r->to->emission_exponent[FRONT] = r->to->emission_exponent[BACK] = 1;
	return 0;
}

/* ---- extras.twopass ---- */

static const char *const side_keys[] = { "rho_d", "tau_d", "rho_s", "tau_s", "alpha", "beta",
	"emission_exponent", NULL };
static const char *const all_keys[] = { "rho_d", "tau_d", "rho_s", "tau_s", "alpha", "beta",
	"emission_exponent", "emission_front", "emission_back", "back", NULL };

static int check_keys(const struct reading *r, const char *place, json_t *o,
                      const char *const *keys)
{
	char list[160] = "";
	const char *key;
	json_t *value;

	for (int i = 0; keys[i]; i++) {
		strcat(list, i ? ", " : "");
		strcat(list, keys[i]);
	}
	json_object_foreach(o, key, value) {
		int i = 0;
		while (keys[i] && strcmp(keys[i], key) != 0)
			i++;
		if (!keys[i])
			return err_set(r->e, "%s: material %s: %s: unknown key '%.60s'; a typo? "
			               "allowed are %s", r->path, r->to->name, place, key, list);
	}
	return 0;
}

static int take_number(const struct reading *r, const char *place, const char *key,
                       const json_t *v, double *out)
{
	if (!json_is_number(v))
		return err_set(r->e, "%s: material %s: %s.%s: must be a number or an array of "
		               "numbers; correct it", r->path, r->to->name, place, key);
	*out = json_number_value(v);
	if (!(*out >= 0) || isinf(*out))
		return err_set(r->e, "%s: material %s: %s.%s: %.15g must not be negative; correct "
		               "it", r->path, r->to->name, place, key, *out);
	return 0;
}

/* A number for all bands or one each. Leaves `out` alone if there is none. */
static int take_bands(const struct reading *r, const char *place, const json_t *o,
                      const char *key, double *out)
{
	const json_t *v = json_object_get(o, key);
	size_t n = json_array_size(v);

	if (!v)
		return 0;
	if (json_is_array(v) && n != 1 && n != (size_t)r->bands)
		return err_set(r->e, "%s: material %s: %s.%s: has %zu numbers; give 1 or %d",
		               r->path, r->to->name, place, key, n, r->bands);
	for (int b = 0; b < r->bands; b++) {
		const json_t *x = json_is_array(v) ? json_array_get(v, n == 1 ? 0 : (size_t)b) : v;
		if (take_number(r, place, key, x, &out[b]))
			return -1;
	}
	return 0;
}

static int take_exponent(const struct reading *r, const char *place, const json_t *o,
                         const char *key, double *out)
{
	const json_t *v = json_object_get(o, key);
	const char *s = json_string_value(v);

	if (!v)
		return 0;
	if (s && strcmp(s, "inf") == 0) {
		*out = INFINITY;
		return 0;
	}
	if (!json_is_number(v))
		return err_set(r->e, "%s: material %s: %s.%s: must be a number or \"inf\"; correct "
		               "it", r->path, r->to->name, place, key);
	return take_number(r, place, key, v, out);
}

static int take_side(const struct reading *r, const char *place, const json_t *o, int side)
{
	struct bsdf_side *s = &r->to->side[side];
	double *exponent = &r->to->emission_exponent[side];

	if (take_bands(r, place, o, "rho_d", s->rho_d) ||
	    take_bands(r, place, o, "tau_d", s->tau_d) ||
	    take_bands(r, place, o, "rho_s", s->rho_s) ||
	    take_bands(r, place, o, "tau_s", s->tau_s) ||
	    take_exponent(r, place, o, "alpha", &s->alpha) ||
	    take_exponent(r, place, o, "beta", &s->beta) ||
	    take_exponent(r, place, o, "emission_exponent", exponent))
		return -1;
	if (isinf(*exponent))
		return err_set(r->e, "%s: material %s: %s.emission_exponent: must be finite; correct "
		               "it", r->path, r->to->name, place);
	return 0;
}

static int read_extras(const struct reading *r, json_t *o)
{
	static const char at[] = "extras.twopass", at_back[] = "extras.twopass.back";
	json_t *back = json_object_get(o, "back");

	if (!json_is_object(o) || (back && !json_is_object(back)))
		return err_set(r->e, "%s: material %s: %s: must be an object; correct it", r->path,
		               r->to->name, json_is_object(o) ? at_back : at);
	if (check_keys(r, at, o, all_keys) || check_keys(r, at_back, back, side_keys))
		return -1;
	for (int side = FRONT; side <= BACK; side++) {
		r->to->side[side] = (struct bsdf_side){ .alpha = INFINITY, .beta = INFINITY };
		if (take_side(r, at, o, side))
			return -1;
	}
	if ((back && take_side(r, at_back, back, BACK)) ||
	    take_bands(r, at, o, "emission_front", r->to->emission[FRONT]) ||
	    take_bands(r, at, o, "emission_back", r->to->emission[BACK]))
		return -1;
	return 0;
}

/* ---- both ---- */

static int is_texture(const char *key)
{
	static const char ending[] = "Texture";
	size_t n = strlen(key), tail = sizeof ending - 1;

	return n > tail && strcmp(key + n - tail, ending) == 0;
}

/* Textures that would change what is modelled. */
static int has_textures(const json_t *material)
{
	const char *key, *inner;
	json_t *value, *ignored;

	if (json_object_get(material, "emissiveTexture"))
		return 1;
	if (twopass(material))
		return 0;
	json_object_foreach(json_object_get(material, "pbrMetallicRoughness"), key, value)
		if (is_texture(key))
			return 1;
	json_object_foreach(json_object_get(material, "extensions"), key, value)
		json_object_foreach(value, inner, ignored)
			if (gltf_schema_knows(key) && is_texture(inner))
				return 1;
	return 0;
}

/* The back of an opaque surface whose file says nothing of it is black. */
static void set_sidedness(const struct reading *r, const json_t *extras)
{
	struct gltf_material *to = r->to;

	to->one_sided = !json_is_true(json_object_get(r->material, "doubleSided")) &&
	                !bsdf_side_transmits(&to->side[FRONT], r->bands) &&
	                !json_object_get(extras, "back") &&
	                !json_object_get(extras, "emission_back");
	if (to->one_sided) {
		to->side[BACK] = (struct bsdf_side){ .alpha = INFINITY, .beta = INFINITY };
		memset(to->emission[BACK], 0, sizeof to->emission[BACK]);
	}
}

static int check_albedo(const struct reading *r, int side, int band)
{
	double a = bsdf_side_albedo(&r->to->side[side], band);
	const char *name = side == FRONT ? "front" : "back";

	if (a <= 1 + MODEL_ALBEDO_SLACK)
		return 0;
	if (!r->g->options->clamp)
		return err_set(r->e, "%s: material %s: %s side, band %d: rho_d + tau_d + rho_s + "
		               "tau_s = %.9g exceeds 1; lower them", r->path, r->to->name, name,
		               band, a);
	bsdf_side_rescale(&r->to->side[side], band);
	return gltf_note(r->g->report, r->e, "material %s: %s side, band %d: albedo %.9g is "
	                 "rescaled to 1", r->to->name, name, band, a);
}

static int finish(const struct reading *r)
{
	struct gltf_material *to = r->to;
	int reciprocal = 1;

	for (int side = FRONT; side <= BACK; side++) {
		int dark = 1;
		for (int b = 0; b < r->bands; b++) {
			if (check_albedo(r, side, b))
				return -1;
			dark = dark && !(to->emission[side][b] > 0);
		}
		if (dark)
			to->emission_exponent[side] = 1;
		bsdf_side_normalise(&to->side[side], r->bands);
	}
	for (int b = 0; b < r->bands; b++)
		reciprocal = reciprocal && to->side[FRONT].tau_d[b] == to->side[BACK].tau_d[b] &&
		             to->side[FRONT].tau_s[b] == to->side[BACK].tau_s[b];
	if (!reciprocal)
		return gltf_note(r->g->report, r->e, "material %s: transmits differently from its "
		                 "two sides, which is not reciprocal", to->name);
	return 0;
}

int gltf_material_read(struct gltf_reader *g, const json_t *material, int bands,
                       struct gltf_material *to, struct err *e)
{
	struct reading r = { g, g->source.path, material, to, bands, e };
	json_t *extras = twopass(material);

	if (has_textures(material) &&
	    gltf_note(g->report, e, "material %s: textures are not yet modelled, their factors "
	              "are used", to->name))
		return -1;
	if (read_emission(&r) || (extras ? read_extras(&r, extras) : read_factors(&r)))
		return -1;
	set_sidedness(&r, extras);
	return finish(&r);
}

size_t gltf_material_bands(const json_t *material)
{
	json_t *extras = twopass(material), *value;
	const char *key;
	size_t most = 1;

	json_object_foreach(extras, key, value)
		if (json_array_size(value) > most)
			most = json_array_size(value);
	json_object_foreach(json_object_get(extras, "back"), key, value)
		if (json_array_size(value) > most)
			most = json_array_size(value);
	return most;
}
