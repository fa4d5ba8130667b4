#include "lib/data/model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/data/punctual.h"

uint32_t model_locate(const struct model *m, uint32_t tri, double w[3])
{
	int32_t at = m->triangle.split[tri];

	while (at >= 0) {
		const struct split *s = &m->split[at];
		int a = s->edge, b = a == 2 ? 0 : a + 1;
		if (w[a] >= w[b]) {
			w[a] -= w[b];
			w[b] *= 2;
			at = s->child[0];
		} else {
			w[b] -= w[a];
			w[a] *= 2;
			at = s->child[1];
		}
	}
	return (uint32_t)~at;
}

int model_derive(struct model *m, struct err *e)
{
	m->element.area = mem_new(m->element.n, sizeof *m->element.area, "element areas", e);
	m->element.normal = mem_new(m->element.n, 3 * sizeof *m->element.normal,
	                            "element normals", e);
	m->element.patch = mem_new(m->element.n, sizeof *m->element.patch, "element patches", e);
	m->patch.area = mem_new(m->patch.n, sizeof *m->patch.area, "patch areas", e);
	if (!m->element.area || !m->element.normal || !m->element.patch || !m->patch.area)
		return -1;
	for (size_t p = 0; p < m->patch.n; p++)
		for (uint32_t i = m->patch.start[p]; i < m->patch.start[p + 1]; i++) {
			const uint32_t *c = &m->element.corner[3 * (size_t)i];
			double *n = &m->element.normal[3 * (size_t)i];
			v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
			        &m->vertex[3 * (size_t)c[2]], n);
			m->element.area[i] = v3_normalise(n);
			m->element.patch[i] = (uint32_t)p;
			m->patch.area[p] += m->element.area[i];
		}
	return model_lights_derive(m, e);
}

int model_ideal_as_lobes(const struct model *m, struct model *lobes, struct err *e)
{
	struct materials *mt = &lobes->material;

	*lobes = *m;
	mt->alpha = mem_new(2 * mt->n, sizeof *mt->alpha, "exponents", e);
	mt->beta = mem_new(2 * mt->n, sizeof *mt->beta, "exponents", e);
	if (!mt->alpha || !mt->beta)
		return -1;
	for (size_t i = 0; i < 2 * mt->n; i++) {
		mt->alpha[i] = fmin(m->material.alpha[i], PAPER_IDEAL);
		mt->beta[i] = fmin(m->material.beta[i], PAPER_IDEAL);
	}
	return 0;
}

void model_lobes_free(struct model *lobes)
{
	free(lobes->material.alpha);
	free(lobes->material.beta);
	*lobes = (struct model){ 0 };
}

int model_materials_new(struct materials *mt, size_t n, int bands, struct err *e)
{
	const size_t b = (size_t)bands;

	*mt = (struct materials){ .n = n, .bands = bands };
	const struct mem_array array[] = {
		MEM_ARRAY(mt->name, n, 1), MEM_ARRAY(mt->one_sided, n, 1),
		MEM_ARRAY(mt->rho_d, 2 * n, b), MEM_ARRAY(mt->tau_d, 2 * n, b),
		MEM_ARRAY(mt->rho_s, 2 * n, b), MEM_ARRAY(mt->tau_s, 2 * n, b),
		MEM_ARRAY(mt->emission, 2 * n, b), MEM_ARRAY(mt->alpha, 2 * n, 1),
		MEM_ARRAY(mt->beta, 2 * n, 1), MEM_ARRAY(mt->emission_exponent, 2 * n, 1)
	};
	if (mem_new_arrays(array, sizeof array / sizeof *array, "materials", e))
		return -1;
	for (size_t i = 0; i < 2 * n; i++) {
		mt->alpha[i] = mt->beta[i] = (double)INFINITY;
		mt->emission_exponent[i] = 1;
	}
	return 0;
}

static void free_names(char **name, size_t n)
{
	for (size_t i = 0; name && i < n; i++)
		free(name[i]);
	free(name);
}

void model_materials_free(struct materials *mt)
{
	free_names(mt->name, mt->n);
	MEM_FREE(mt->rho_d, mt->tau_d, mt->rho_s, mt->tau_s, mt->alpha, mt->beta, mt->emission,
	         mt->emission_exponent, mt->one_sided);
	*mt = (struct materials){ 0 };
}

int model_lights_new(struct lights *l, size_t n, int bands, struct err *e)
{
	*l = (struct lights){ .n = n };
	const struct mem_array array[] = {
		MEM_ARRAY(l->name, n, 1), MEM_ARRAY(l->kind, n, 1), MEM_ARRAY(l->position, n, 3),
		MEM_ARRAY(l->direction, n, 3), MEM_ARRAY(l->cone, n, 2),
		MEM_ARRAY(l->intensity, n, (size_t)bands)
	};
	return mem_new_arrays(array, sizeof array / sizeof *array, "lights", e);
}

void model_lights_free(struct lights *l)
{
	free_names(l->name, l->n);
	MEM_FREE(l->kind, l->position, l->direction, l->cone, l->intensity, l->unit_flux, l->cosine);
	*l = (struct lights){ 0 };
}

void model_free(struct model *m)
{
	model_materials_free(&m->material);
	model_lights_free(&m->light);
	free_names(m->surface.name, m->surface.n);
	for (size_t i = 0; m->camera && i < m->cameras; i++)
		free(m->camera[i].name);
	MEM_FREE(m->surface.material, m->surface.has_normals, m->camera, m->vertex,
	         m->triangle.corner, m->triangle.surface, m->triangle.uv, m->triangle.normal,
	         m->triangle.split, m->split, m->element.corner, m->element.triangle,
	         m->element.area, m->element.normal, m->element.patch, m->patch.start,
	         m->patch.surface, m->patch.area, m->patch.loop, m->patch.loop_start,
	         m->patch.loop_index);
	*m = (struct model){ 0 };
}

void model_box(const struct model *m, double lo[3], double hi[3])
{
	for (int k = 0; k < 3; k++)
		lo[k] = INFINITY, hi[k] = -INFINITY;
	for (size_t i = 0; i < 3 * m->triangle.n; i++)
		for (size_t k = 0; k < 3; k++) {
			double x = m->vertex[3 * (size_t)m->triangle.corner[i] + k];
			lo[k] = fmin(lo[k], x);
			hi[k] = fmax(hi[k], x);
		}
}
