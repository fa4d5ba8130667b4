/* Scenes of convex polygons in memory, each a plane patch of its own. */
#ifndef TEST_POLYGON_SCENE_H
#define TEST_POLYGON_SCENE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../../lib/model.h"
#include "../../lib/rng.h"
#include "../../lib/vec3.h"

enum { SCENE_POLYGONS = 512, SCENE_CORNERS = 4096, SCENE_LOOP = 64 };

static inline void *scene_array(size_t n, size_t size)
{
	return calloc(n ? n : 1, size);
}

/* An empty scene of one grey material; one_sided: backs are black. */
static inline void scene_begin(struct model *m, int one_sided)
{
	struct err e = { 0 };
	const size_t n = SCENE_POLYGONS, c = SCENE_CORNERS;

	*m = (struct model){ .bands = 1 };
	materials_new(&m->material, 1, 1, &e);
	m->material.name[0] = strdup("grey");
	m->material.one_sided[0] = (uint8_t)one_sided;
	m->material.rho_d[0] = .5;
	m->material.rho_d[1] = one_sided ? 0 : .5;
	m->surface.name = scene_array(n, sizeof *m->surface.name);
	m->surface.material = scene_array(n, sizeof *m->surface.material);
	m->surface.has_normals = scene_array(n, 1);
	m->vertex = scene_array(c, 3 * sizeof *m->vertex);
	m->triangle = scene_array(c, 3 * sizeof *m->triangle);
	m->triangle_surface = scene_array(c, sizeof *m->triangle_surface);
	m->triangle_split = scene_array(c, sizeof *m->triangle_split);
	m->triangle_uv = scene_array(c, 6 * sizeof *m->triangle_uv);
	m->triangle_normal = scene_array(c, 9 * sizeof *m->triangle_normal);
	m->element = scene_array(c, 3 * sizeof *m->element);
	m->element_triangle = scene_array(c, sizeof *m->element_triangle);
	m->patch_start = scene_array(n + 1, sizeof *m->patch_start);
	m->patch_surface = scene_array(n, sizeof *m->patch_surface);
	m->patch_loop = scene_array(n + 1, sizeof *m->patch_loop);
	m->loop_start = scene_array(n + 1, sizeof *m->loop_start);
	m->loop_index = scene_array(c, sizeof *m->loop_index);
}

/* Adds a patch: n corners, counter-clockwise seen from its front. */
static inline void scene_polygon(struct model *m, int n, const double (*v)[3])
{
	uint32_t first = (uint32_t)m->vertices;

	for (int i = 0; i < n; i++) {
		memcpy(&m->vertex[3 * m->vertices++], v[i], sizeof v[i]);
		m->loop_index[m->loop_indices++] = first + (uint32_t)i;
	}
	for (uint32_t i = 1; i + 1 < (uint32_t)n; i++) {
		size_t t = m->triangles++;
		uint32_t corner[3] = { first, first + i, first + i + 1 };
		memcpy(&m->triangle[3 * t], corner, sizeof corner);
		memcpy(&m->element[3 * t], corner, sizeof corner);
		m->triangle_surface[t] = (uint32_t)m->surface.n;
		m->triangle_split[t] = ~(int32_t)t;
		m->element_triangle[t] = (uint32_t)t;
		m->elements++;
	}
	m->surface.name[m->surface.n] = strdup("polygon");
	m->patch_surface[m->patches++] = (uint32_t)m->surface.n++;
	m->patch_start[m->patches] = (uint32_t)m->elements;
	m->loop_start[++m->loops] = m->loop_indices;
	m->patch_loop[m->patches] = m->loops;
}

/* A parallelogram corner, corner + u, corner + u + v, corner + v, as k x k patches. */
static inline void scene_grid(struct model *m, const double corner[3], const double u[3],
                              const double v[3], int k)
{
	for (int i = 0; i < k; i++)
		for (int j = 0; j < k; j++) {
			double x[4][3];
			for (int c = 0; c < 4; c++)
				for (int d = 0; d < 3; d++)
					x[c][d] = corner[d] + u[d] * (i + (c == 1 || c == 2)) / k +
					          v[d] * (j + (c > 1)) / k;
			scene_polygon(m, 4, (const double (*)[3])x);
		}
}

/* A box from its corner and three sides of a right-handed frame, fronts outwards, or
 * inwards; faces: bits u = 0, u = 1, v = 0, v = 1, w = 0, w = 1; k x k patches each. */
static inline void scene_cuboid(struct model *m, const double corner[3], const double side[3][3],
                             int faces, int k, int inwards)
{
	for (int face = 0; face < 6; face++) {
		const double *u = side[(face / 2 + 1) % 3], *v = side[(face / 2 + 2) % 3];
		double at[3];
		if (!(faces >> face & 1))
			continue;
		v3_mad(corner, face & 1, side[face / 2], at);
		int swap = (face & 1) == inwards;
		scene_grid(m, at, swap ? v : u, swap ? u : v, k);
	}
}

/* The box between two points along the axes. */
static inline void scene_block(struct model *m, double x0, double y0, double z0, double x1,
                               double y1, double z1, int faces, int k, int inwards)
{
	const double corner[3] = { x0, y0, z0 };
	const double side[3][3] = { { x1 - x0, 0, 0 }, { 0, y1 - y0, 0 }, { 0, 0, z1 - z0 } };

	scene_cuboid(m, corner, side, faces, k, inwards);
}

static inline void scene_quad(struct model *m, const double a[3], const double b[3],
                              const double c[3], const double d[3])
{
	double v[4][3];

	memcpy(v[0], a, sizeof v[0]);
	memcpy(v[1], b, sizeof v[0]);
	memcpy(v[2], c, sizeof v[0]);
	memcpy(v[3], d, sizeof v[0]);
	scene_polygon(m, 4, (const double (*)[3])v);
}

static inline int scene_end(struct model *m)
{
	struct err e = { 0 };

	return model_derive(m, &e);
}

/* ---- dice ---- */

struct dice {
	uint64_t seed, rolls;
};

/* Uniform in [low, high). */
static inline double roll(struct dice *d, double low, double high)
{
	uint64_t bits = rng_mix(rng_mix(d->seed) + d->rolls++);

	return low + (high - low) * (double)(bits >> 11) * 0x1p-53;
}

static inline int roll_int(struct dice *d, int low, int high)
{
	return (int)floor(roll(d, low, high + 1));
}

/* A random right-handed orthonormal frame, or one about the z axis. */
static inline void roll_frame(struct dice *d, int upright, double frame[3][3])
{
	const double z[3] = { 0, 0, 1 };
	double a = roll(d, 0, 6.283185307179586), t[3], b[3], w[3];
	double c = roll(d, -1, 1), p = roll(d, 0, 6.283185307179586), s = sqrt(1 - c * c);

	w[0] = s * cos(p), w[1] = s * sin(p), w[2] = c;
	v3_frame(upright ? z : w, t, b);
	for (int k = 0; k < 3; k++) {
		frame[0][k] = cos(a) * t[k] + sin(a) * b[k];
		frame[1][k] = cos(a) * b[k] - sin(a) * t[k];
		frame[2][k] = upright ? z[k] : w[k];
	}
}

#endif
