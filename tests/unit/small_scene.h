/* A model of three elements with form factors and a solution that satisfy every
 * check, small enough to damage byte by byte.
 *
 * Unit square of two triangles. Patch 0 (surface 0, two-sided, glossy) holds the
 * elements 0 and 1 of triangle 0, which is split once; patch 1 (surface 1,
 * one-sided) holds element 2, triangle 1. A spot shines on them. */
#ifndef SMALL_SCENE_H
#define SMALL_SCENE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../../lib/ff.h"
#include "../../lib/mem.h"
#include "../../lib/model.h"
#include "../../lib/solution.h"

#define COPY(array) copy(array, sizeof(array))

static inline void *copy(const void *data, size_t bytes)
{
	void *p = malloc(bytes ? bytes : 1);

	return p ? memcpy(p, data, bytes) : NULL;
}

static inline void small_materials(struct model *m)
{
	struct err e = { 0 };

	materials_new(&m->material, 2, m->bands, &e);
	m->material.name[0] = strdup("glossy");
	m->material.name[1] = strdup("lamp \"B\"");
	for (int b = 0; b < m->bands; b++) {
		for (int side = FRONT; side <= BACK; side++) {
			size_t at = material_at(&m->material, 0, side) + (size_t)b;
			m->material.rho_d[at] = .5 - .1 * b;
			m->material.rho_s[at] = .25;
			m->material.tau_s[at] = .125;
			m->material.alpha[side] = 20.5;
		}
		m->material.emission[material_at(&m->material, 1, FRONT) + (size_t)b] = 100;
	}
	m->material.one_sided[1] = 1;
}

static inline void small_lights(struct model *m)
{
	struct err e = { 0 };
	struct lights *l = &m->light;

	lights_new(l, 1, m->bands, &e);
	l->name[0] = strdup("spot");
	l->kind[0] = LIGHT_SPOT;
	l->position[2] = 2;
	l->direction[2] = -1;
	l->cone[0] = .25;
	l->cone[1] = .5;
	for (int b = 0; b < m->bands; b++)
		l->intensity[b] = 10 * (b + 1);
}

static inline void small_cameras(struct model *m)
{
	const double unit[16] = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1 };

	m->cameras = 2;
	m->camera = calloc(2, sizeof *m->camera);
	m->camera[0] = (struct camera){ .name = strdup("near"), .yfov = .7, .aspect = 1.5 };
	m->camera[1] = (struct camera){ .name = strdup("far"), .orthographic = 1, .xmag = 2,
	                                .ymag = 1 };
	memcpy(m->camera[0].to_world, unit, sizeof unit);
	memcpy(m->camera[1].to_world, unit, sizeof unit);
}

static inline void small_model(struct model *m)
{
	const double vertex[] = { 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, .5, 0, 0 };
	const uint32_t triangle[] = { 0, 1, 2, 0, 2, 3 }, one_each[] = { 0, 1 };
	const uint32_t element[] = { 0, 4, 2, 4, 1, 2, 0, 2, 3 }, of[] = { 0, 0, 1 };
	const int32_t root[] = { 0, ~2 };
	const struct split split[] = { { { ~0, ~1 }, 0 } };
	const uint32_t patch_start[] = { 0, 2, 3 }, outline[] = { 0, 4, 1, 2 };
	const uint64_t patch_loop[] = { 0, 1, 1 }, loop_start[] = { 0, 4 };
	const uint8_t normals[] = { 0, 1 };
	struct err e = { 0 };

	*m = (struct model){ .bands = 3, .vertices = 5, .triangles = 2, .splits = 1,
		.elements = 3, .patches = 2, .loops = 1, .loop_indices = 4 };
	small_materials(m);
	small_lights(m);
	small_cameras(m);
	m->surface.n = 2;
	m->surface.name = calloc(2, sizeof *m->surface.name);
	m->surface.name[0] = strdup("floor");
	m->surface.name[1] = strdup("Lämpchen");
	m->surface.material = COPY(one_each);
	m->surface.has_normals = COPY(normals);
	m->vertex = COPY(vertex);
	m->triangle = COPY(triangle);
	m->triangle_surface = COPY(one_each);
	m->triangle_uv = calloc(12, sizeof *m->triangle_uv);
	m->triangle_normal = calloc(18, sizeof *m->triangle_normal);
	m->triangle_split = COPY(root);
	m->split = COPY(split);
	m->element = COPY(element);
	m->element_triangle = COPY(of);
	m->patch_start = COPY(patch_start);
	m->patch_surface = COPY(one_each);
	m->patch_loop = COPY(patch_loop);
	m->loop_start = COPY(loop_start);
	m->loop_index = COPY(outline);
	model_derive(m, &e);
}

/* Chains 0 and 1 (through material 0, front, by T). Rows: diffuse of patch-sides
 * 0, 1, 2 and one reflected lobe of patch-side 0; the first has a second block.
 * The block of patch-side 2 is shorter as a span. */
static inline void small_ff(struct ff *f)
{
	const uint64_t chain_start[] = { 0, 0, 1 }, row_block[] = { 0, 2, 3, 4, 5 };
	const uint64_t block_start[] = { 0, 2, 3, 3, 6, 7 }, block_arrival[] = { 0, 1, 1, 1, 1, 1 };
	const uint32_t chain_event[] = { 1 }, chain_count[] = { 1 }, row_side[] = { 0, 1, 2, 0 };
	const uint32_t samples[] = { 64, 64, 64, 16 }, block_chain[] = { 0, 1, 0, 0, 0 };
	const uint32_t column[] = { 1, 4, 4, 0, 2, 4, 4 };
	const uint8_t kind[] = { FF_DIFFUSE, FF_DIFFUSE, FF_DIFFUSE, FF_REFLECTED };
	const float value[] = { .25f, .25f, .125f, .125f, .125f, .125f, .5f }, up[] = { 0, 0, 1 };
	const double scale[] = { 1, 1, 1, 2 }, none[] = { 0, 0, 0, 0, 0 };
	const float error[] = { .01f, 0, .02f, 0 }, residual[] = { 1e-7f, 0, 0, 0 };
	const double escape[] = { .375, 0, 1, .5, 0 }, black[] = { .125, .125, 0, .125, 0 };
	const uint32_t target[] = { 0 }, source[] = { 2 }, chain[] = { 0 }, rows[] = { 3, FF_NO_ROW };

	*f = (struct ff){ .chains = 2, .chain_most = 64, .chain_events = 1, .rows = 4, .blocks = 5, .entries = 7,
		.arrivals = 1, .links = 1, .patch_end = 2, .part = 1, .parts = 1,
		.chain_start = COPY(chain_start), .chain_event = COPY(chain_event),
		.chain_count = COPY(chain_count), .row_side = COPY(row_side),
		.row_kind = COPY(kind), .row_samples = COPY(samples), .row_scale = COPY(scale),
		.row_residual = COPY(residual), .row_error = COPY(error),
		.row_block = COPY(row_block), .block_chain = COPY(block_chain),
		.block_start = COPY(block_start), .block_escape = COPY(escape),
		.block_black = COPY(black), .block_lost = COPY(none), .block_cut = COPY(none),
		.block_arrival = COPY(block_arrival), .column = COPY(column),
		.value = COPY(value), .arrival_target = COPY(target),
		.arrival_direction = COPY(up), .link_target = COPY(target),
		.link_source = COPY(source), .link_last = COPY(source), .link_chain = COPY(chain),
		.link_direction = COPY(up), .link_row = COPY(rows) };
}

static inline double *ramp(size_t n, double step)
{
	double *v = calloc(n, sizeof *v);

	for (size_t i = 0; v && i < n; i++)
		v[i] = step * (double)i;
	return v;
}

static inline void small_solution(struct solution *s, const struct model *m)
{
	const size_t bands = (size_t)m->bands, sides = 2 * m->elements, patch_sides = 2 * m->patches;

	*s = (struct solution){ .groups = 1, .emitters = m->material.n + m->light.n,
		.emitter_group = calloc(m->material.n + m->light.n, sizeof *s->emitter_group),
		.group_name = calloc(1, sizeof *s->group_name),
		.element_sides = sides, .bands = m->bands,
		.patch_sides = patch_sides, .sources = patch_sides + m->light.n, .links = 1, .shots = 42,
		.direct = ramp(sides * bands, .5), .caustic = ramp(sides * bands, .25),
		.indirect = ramp(sides * bands, .125), .error = ramp(sides * bands, .01),
		.error_direct = ramp(sides * bands, .01),
		.discretisation_direct = ramp(sides * bands, .01),
		.discretisation = ramp(sides * bands, .02),
		.unshot_emission = ramp((patch_sides + m->light.n) * bands, 0),
		.unshot_diffuse = ramp(patch_sides * bands, 1e-3),
		.unshot_link = ramp(2 * bands, 1e-3),
		.ledger = ramp(LEDGER_TERMS * bands, 0) };
	s->group_name[0] = strdup("all");
	for (size_t b = 0; b < bands; b++) {
		double unshot = 0;
		for (size_t i = 0; i < patch_sides; i++)
			unshot += s->unshot_diffuse[i * bands + b];
		for (size_t i = 0; i < 2; i++)
			unshot += s->unshot_link[i * bands + b];
		s->ledger[LEDGER_ABSORBED * bands + b] = 3;
		s->ledger[LEDGER_ESCAPED * bands + b] = 1;
		s->ledger[LEDGER_EMITTED * bands + b] = 4 + unshot;
	}
}

#endif
