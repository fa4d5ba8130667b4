/* Scenes in memory, built from subdivided quadrilaterals. */
#ifndef TWOPASS_TEST_GRID_H
#define TWOPASS_TEST_GRID_H

#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../../lib/model.h"
#include "../../lib/solution.h"

/* Room for `surfaces` surfaces of n x n cells (2 triangles each); every surface
 * is one patch. Vertices are shared within a surface only. */
static inline void grid_new(struct model *m, size_t surfaces, size_t n, size_t materials,
                            int bands)
{
	struct err e = { 0 };
	size_t elements = surfaces * 2 * n * n;

	*m = (struct model){ .bands = bands };
	assert_int_equal(materials_new(&m->material, materials, bands, &e), 0);
	m->surface.name = calloc(surfaces, sizeof *m->surface.name);
	m->surface.material = calloc(surfaces, sizeof *m->surface.material);
	m->surface.has_normals = calloc(surfaces, 1);
	m->vertex = calloc(surfaces * (n + 1) * (n + 1), 3 * sizeof *m->vertex);
	m->triangle = calloc(elements, 3 * sizeof *m->triangle);
	m->triangle_surface = calloc(elements, sizeof *m->triangle_surface);
	m->triangle_split = calloc(elements, sizeof *m->triangle_split);
	m->element = calloc(elements, 3 * sizeof *m->element);
	m->element_triangle = calloc(elements, sizeof *m->element_triangle);
	m->patch_start = calloc(surfaces + 1, sizeof *m->patch_start);
	m->patch_surface = calloc(surfaces, sizeof *m->patch_surface);
}

static inline void grid_triangle(struct model *m, uint32_t a, uint32_t b, uint32_t c)
{
	size_t i = m->triangles++;
	uint32_t corner[3] = { a, b, c };

	memcpy(&m->triangle[3 * i], corner, sizeof corner);
	memcpy(&m->element[3 * i], corner, sizeof corner);
	m->triangle_surface[i] = (uint32_t)m->surface.n;
	m->triangle_split[i] = ~(int32_t)i;
	m->element_triangle[i] = (uint32_t)i;
	m->elements++;
}

/* A parallelogram o + x [0,1] + y [0,1], front normal along x cross y. */
static inline void grid_quad(struct model *m, size_t n, uint32_t material,
                             const double o[3], const double x[3], const double y[3])
{
	uint32_t first = (uint32_t)m->vertices, row = (uint32_t)n + 1;

	for (size_t j = 0; j <= n; j++)
		for (size_t i = 0; i <= n; i++, m->vertices++)
			for (int k = 0; k < 3; k++)
				m->vertex[3 * m->vertices + (size_t)k] =
					o[k] + x[k] * (double)i / (double)n +
					y[k] * (double)j / (double)n;
	for (uint32_t j = 0; j < n; j++)
		for (uint32_t i = 0; i < n; i++) {
			uint32_t a = first + j * row + i;
			grid_triangle(m, a, a + 1, a + row + 1);
			grid_triangle(m, a, a + row + 1, a + row);
		}
	m->surface.material[m->surface.n] = material;
	m->patch_surface[m->patches++] = (uint32_t)m->surface.n++;
	m->patch_start[m->patches] = (uint32_t)m->elements;
}

/* The six walls of the box [lo, hi], fronts inward, in the order
 * x = lo, x = hi, y = lo, y = hi, z = lo, z = hi. */
static inline void grid_box(struct model *m, size_t n, const uint32_t material[6],
                            const double lo[3], const double hi[3])
{
	for (int axis = 0; axis < 3; axis++)
		for (int end = 0; end < 2; end++) {
			double o[3] = { lo[0], lo[1], lo[2] }, edge[2][3] = { { 0 } };
			int u = (axis + 1) % 3, v = (axis + 2) % 3;
			o[axis] = end ? hi[axis] : lo[axis];
			edge[0][u] = hi[u] - lo[u];
			edge[1][v] = hi[v] - lo[v];
			grid_quad(m, n, material[2 * axis + end], o, edge[end], edge[!end]);
		}
}

static inline void grid_end(struct model *m)
{
	struct err e = { 0 };
	assert_int_equal(model_derive(m, &e), 0);
}

/* A solution with `h` as indirect irradiance everywhere, without errors. */
static inline void grid_solution(const struct model *m, double h, struct solution *s)
{
	size_t n = 2 * m->elements * (size_t)m->bands;

	*s = (struct solution){ .groups = 1, .element_sides = 2 * m->elements,
	                        .bands = m->bands };
	s->direct = calloc(n, sizeof *s->direct);
	s->caustic = calloc(n, sizeof *s->caustic);
	s->indirect = calloc(n, sizeof *s->indirect);
	s->error = calloc(n, sizeof *s->error);
	s->error_direct = calloc(n, sizeof *s->error_direct);
	s->discretisation = calloc(n, sizeof *s->discretisation);
	s->discretisation_direct = calloc(n, sizeof *s->discretisation_direct);
	for (size_t i = 0; i < n; i++)
		s->indirect[i] = h;
}

static inline void grid_solution_free(struct solution *s)
{
	free(s->direct);
	free(s->caustic);
	free(s->indirect);
	free(s->error);
	free(s->error_direct);
	free(s->discretisation_direct);
	free(s->discretisation);
}

#endif
