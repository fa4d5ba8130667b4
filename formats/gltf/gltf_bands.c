/* The materials of the scene in as many bands as it needs. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"
#include "formats/gltf/gltf_material.h"
#include "lib/base/mem.h"

enum { RGB = 3 };

struct palette {
	struct gltf_reader *g;
	struct model *m;
	const json_t *file;         /* the file's materials */
	size_t n;
	size_t *index;              /* [n] in the file; its size = glTF's default */
	struct gltf_material *material;
	int working;                /* bands they are read in */
	struct err *e;
};

/* Collects the materials in use, in the order of the file, and renumbers those of
 * the surfaces. */
static int collect(struct palette *p)
{
	size_t all = json_array_size(p->file);
	struct surfaces *s = &p->m->surface;
	uint32_t *number = mem_new(all + 1, sizeof *number, "numbers of materials", p->e);

	p->index = mem_new(all + 1, sizeof *p->index, "materials", p->e);
	if (number && p->index) {
		for (size_t i = 0; i < s->n; i++)
			number[s->material[i] == UINT32_MAX ? all : s->material[i]] = 1;
		for (size_t i = 0; i <= all; i++)
			if (number[i]) {
				number[i] = (uint32_t)p->n;
				p->index[p->n++] = i;
			}
		for (size_t i = 0; i < s->n; i++)
			s->material[i] = number[s->material[i] == UINT32_MAX ? all
			                                                     : s->material[i]];
	}
	free(number);
	return p->e->set ? -1 : 0;
}

static int choose_working_bands(struct palette *p)
{
	size_t most = 1;

	for (size_t i = 0; i < p->n; i++) {
		size_t n = gltf_material_bands(json_array_get(p->file, p->index[i]));
		if (n > most)
			most = n;
	}
	if (most > BANDS_MAX)
		return err_set(p->e, "%s: extras.twopass with %zu bands; at most %d are supported",
		               p->g->source.path, most, (int)BANDS_MAX);
	p->working = most > 1 ? (int)most : RGB;
	return 0;
}

static int name_material(struct palette *p, size_t i, json_t *taken)
{
	const char *name = gltf_string(json_array_get(p->file, p->index[i]), "name");
	char plain[40];

	if (p->index[i] == json_array_size(p->file))
		name = "default";
	snprintf(plain, sizeof plain, "material%zu", p->index[i]);
	p->material[i].name = gltf_unique_name(taken, name && *name ? name : plain, p->e);
	return p->material[i].name ? 0 : -1;
}

static int read_all(struct palette *p)
{
	json_t *taken = json_object();

	p->material = mem_new(p->n, sizeof *p->material, "materials", p->e);
	for (size_t i = 0; i < p->n && !p->e->set; i++) {
		const json_t *o = json_array_get(p->file, p->index[i]);
		if (name_material(p, i, taken) ||
		    gltf_material_read(p->g, o, p->working, &p->material[i], p->e))
			break;
		if (!o)
			gltf_note(p->g->report, p->e, "primitives without a material have glTF's "
			          "default, white of albedo 1");
	}
	json_decref(taken);
	return p->e->set ? -1 : 0;
}

static int grey(const double *x, int bands)
{
	for (int b = 1; b < bands; b++)
		if (x[b] != x[0])
			return 0;
	return 1;
}

static int all_grey(const struct palette *p)
{
	int w = p->working;

	for (size_t i = 0; i < p->n; i++)
		for (int k = FRONT; k <= BACK; k++) {
			const struct bsdf_side *s = &p->material[i].side[k];
			if (!grey(s->rho_d, w) || !grey(s->tau_d, w) || !grey(s->rho_s, w) ||
			    !grey(s->tau_s, w) || !grey(p->material[i].emission[k], w))
				return 0;
		}
	for (size_t i = 0; i < p->m->light.n; i++)
		if (!grey(p->m->light.intensity + RGB * i, RGB))
			return 0;
	return 1;
}

/* How working bands become those of the model: grey RGB is one band, but bands that
 * the extras name are kept. */
enum conversion { SAME, REPLICATE, LUMINANCE };

static int choose_bands(const struct palette *p, int *bands, enum conversion *how)
{
	int isgrey = all_grey(p), asked = p->g->options->bands;

	*bands = asked ? asked : isgrey && p->working == RGB ? 1 : p->working;
	if (isgrey)
		*how = REPLICATE;
	else if (*bands == p->working)
		*how = SAME;
	else if (*bands == 1 && p->working == RGB)
		*how = LUMINANCE;
	else
		return err_set(p->e, "%s: its materials have %d bands, not %d; ask for that many",
		               p->g->source.path, p->working, *bands);
	if (*how == LUMINANCE)
		return gltf_note(p->g->report, p->e, "colours are reduced to their luminance");
	return 0;
}

static void convert(const double *from, enum conversion how, int bands, double *to)
{
	for (int b = 0; b < bands; b++)
		to[b] = how == SAME ? from[b] : how == REPLICATE ? from[0] : bsdf_luminance(from);
}

static void store(const struct palette *p, size_t i, enum conversion how)
{
	struct materials *mt = &p->m->material;
	struct gltf_material *from = &p->material[i];

	mt->name[i] = from->name;
	from->name = NULL;
	mt->one_sided[i] = (uint8_t)from->one_sided;
	for (int k = FRONT; k <= BACK; k++) {
		const struct bsdf_side *s = &from->side[k];
		size_t at = model_material_at(mt, i, k), plain = 2 * i + (size_t)k;
		convert(s->rho_d, how, mt->bands, mt->rho_d + at);
		convert(s->tau_d, how, mt->bands, mt->tau_d + at);
		convert(s->rho_s, how, mt->bands, mt->rho_s + at);
		convert(s->tau_s, how, mt->bands, mt->tau_s + at);
		convert(from->emission[k], how, mt->bands, mt->emission + at);
		mt->alpha[plain] = s->alpha;
		mt->beta[plain] = s->beta;
		mt->emission_exponent[plain] = from->emission_exponent[k];
	}
}

/* Lights have RGB intensities, whatever bands materials are read in. */
static int store_lights(const struct palette *p, enum conversion how)
{
	struct lights *l = &p->m->light;
	size_t bands = (size_t)p->m->bands;
	double *rgb = l->intensity, *out = mem_new(l->n, bands * sizeof *out, "lights", p->e);

	if (!out)
		return -1;
	for (size_t i = 0; i < l->n; i++) {
		if (p->working != RGB && !grey(rgb + RGB * i, RGB)) {
			free(out);
			return err_set(p->e, "%s: light %s: its color is RGB but materials have %d "
			               "bands; make it grey", p->g->source.path, l->name[i],
			               p->working);
		}
		convert(rgb + RGB * i, p->working == RGB ? how : REPLICATE, p->m->bands,
		        out + bands * i);
	}
	l->intensity = out;
	free(rgb);
	return 0;
}

int gltf_materials(struct gltf_reader *g, struct model *m, struct err *e)
{
	struct palette p = { .g = g, .m = m, .e = e,
		.file = json_object_get(g->source.root, "materials") };
	enum conversion how;
	int status = -1;

	if (collect(&p) || choose_working_bands(&p) || read_all(&p) ||
	    choose_bands(&p, &m->bands, &how) ||
	    model_materials_new(&m->material, p.n, m->bands, e))
		goto out;
	for (size_t i = 0; i < p.n; i++)
		store(&p, i, how);
	status = store_lights(&p, how);
out:
	for (size_t i = 0; p.material && i < p.n; i++)
		free(p.material[i].name);
	free(p.material);
	free(p.index);
	return status;
}
