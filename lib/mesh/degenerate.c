/* Cleaning: triangles without area go, vertices that are one become one. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/mesh/stages.h"

/* Height over the longest edge below which a triangle has no area: what float32
 * positions cannot tell from collinear ones (the sides of a real sliver, 1 x 1e-6
 * say, are well apart), or what is left of it by the rounding of the transform. */
static int degenerate(const struct model *m, const uint32_t *c)
{
	const double *p[3];
	double longest = 0, largest = 0, area[3], edge[3];

	for (int k = 0; k < 3; k++)
		p[k] = &m->vertex[3 * (size_t)c[k]];
	for (int k = 0; k < 3; k++) {
		v3_sub(p[(k + 1) % 3], p[k], edge);
		longest = fmax(longest, v3_length(edge));
		for (int j = 0; j < 3; j++)
			largest = fmax(largest, fabs(p[k][j]));
	}
	v3_area(p[0], p[1], p[2], area);
	double height = fmax(0x1p-23 * longest, 0x1p-49 * largest);
	return !(2 * v3_length(area) > height * longest);
}

/* Moves row t of an array of rows to row `to`. */
static void move_row(void *array, size_t row, size_t to, size_t t)
{
	if (array && to != t)
		memcpy((char *)array + to * row, (char *)array + t * row, row);
}

void mesh_clean_compact(struct model *m, const uint8_t *keep)
{
	size_t n = 0;

	for (size_t t = 0; t < m->triangle.n; t++) {
		if (!keep[t])
			continue;
		move_row(m->triangle.corner, 3 * sizeof *m->triangle.corner, n, t);
		move_row(m->triangle.surface, sizeof *m->triangle.surface, n, t);
		move_row(m->triangle.uv, 6 * sizeof *m->triangle.uv, n, t);
		move_row(m->triangle.normal, 9 * sizeof *m->triangle.normal, n, t);
		n++;
	}
	m->triangle.n = n;
}

static int drop_degenerate(struct model *m, struct mesh_report *r, struct err *e)
{
	uint8_t *keep = mem_new(m->triangle.n, 1, "triangles", e);

	if (!keep)
		return -1;
	for (size_t t = 0; t < m->triangle.n; t++) {
		keep[t] = !degenerate(m, &m->triangle.corner[3 * t]);
		if (keep[t])
			continue;
		r->surface[m->triangle.surface[t]].degenerate++;
		r->total.degenerate++;
	}
	mesh_clean_compact(m, keep);
	free(keep);
	return 0;
}

static int compare_keys(const void *pa, const void *pb)
{
	uint64_t a = *(const uint64_t *)pa, b = *(const uint64_t *)pb;

	return a < b ? -1 : a > b;
}

int mesh_clean_separate(struct model *m, uint32_t **group, struct err *e)
{
	int status = -1;
	size_t corners = 3 * m->triangle.n, n = 0;
	uint64_t *key = mem_new(corners, sizeof *key, "vertices", e);
	double *vertex = NULL;

	if (!key)
		return -1;
	for (size_t i = 0; i < corners; i++)
		key[i] = (uint64_t)m->triangle.corner[i] << 32 | m->triangle.surface[i / 3];
	qsort(key, corners, sizeof *key, compare_keys);
	for (size_t i = 0; i < corners; i++)
		if (i == 0 || key[i] != key[i - 1])
			key[n++] = key[i];
	vertex = mem_new(n, 3 * sizeof *vertex, "vertices", e);
	*group = mem_new(n, sizeof **group, "vertices", e);
	if (!vertex || !*group)
		goto done;
	for (size_t i = 0; i < n; i++) {
		memcpy(&vertex[3 * i], &m->vertex[3 * (key[i] >> 32)], 3 * sizeof *vertex);
		(*group)[i] = (uint32_t)key[i];
	}
	for (size_t i = 0; i < corners; i++) {
		uint64_t want = (uint64_t)m->triangle.corner[i] << 32 | m->triangle.surface[i / 3];
		uint64_t *at = bsearch(&want, key, n, sizeof *key, compare_keys);
		m->triangle.corner[i] = (uint32_t)(at - key);
	}
	free(m->vertex);
	m->vertex = vertex;
	m->vertices = n;
	vertex = NULL;
	status = 0;
done:
	free(key);
	free(vertex);
	return status;
}

/* Welding tolerance of each surface. */
static double *surface_tolerances(const struct model *m, const uint32_t *group,
                                  struct err *e)
{
	double *box = mem_new(m->surface.n, 6 * sizeof *box, "surfaces", e);

	if (!box)
		return NULL;
	for (size_t i = 0; i < 6 * m->surface.n; i++)
		box[i] = i % 6 < 3 ? (double)INFINITY : -(double)INFINITY;
	for (size_t v = 0; v < m->vertices; v++)
		for (size_t k = 0; k < 3; k++) {
			double *b = &box[6 * (size_t)group[v] + k];
			b[0] = fmin(b[0], m->vertex[3 * v + k]);
			b[3] = fmax(b[3], m->vertex[3 * v + k]);
		}
	/* The boxes are read before their place is written: s <= 6 s. */
	for (size_t s = 0; s < m->surface.n; s++)
		box[s] = box[6 * s] <= box[6 * s + 3]
		             ? geo_weld_tolerance(&box[6 * s], &box[6 * s + 3])
		             : 0;
	return box;
}

/* Vertex id[v] takes the place of v; the first member's position stays. */
static void merge_vertices(struct model *m, const uint32_t *group, const uint32_t *id,
                           size_t count, struct mesh_report *r)
{
	size_t seen = 0;

	for (size_t v = 0; v < m->vertices; v++) {
		if (id[v] == seen) {
			memmove(&m->vertex[3 * seen], &m->vertex[3 * v], 3 * sizeof *m->vertex);
			seen++;
		} else {
			r->surface[group[v]].welded++;
			r->total.welded++;
		}
	}
	m->vertices = count;
	for (size_t i = 0; i < 3 * m->triangle.n; i++)
		m->triangle.corner[i] = id[m->triangle.corner[i]];
}

int mesh_clean_degenerate(struct model *m, struct mesh_report *r, struct err *e)
{
	int status = -1;
	uint32_t *group = NULL, *id = NULL;
	double *tolerance = NULL;
	size_t count;

	if (drop_degenerate(m, r, e) || mesh_clean_separate(m, &group, e))
		goto done;
	tolerance = surface_tolerances(m, group, e);
	id = mem_new(m->vertices, sizeof *id, "vertices", e);
	if (!tolerance || !id)
		goto done;
	struct weld w = { m->vertices, m->vertex, group, m->surface.n, tolerance,
		          m->triangle.n, m->triangle.corner };
	if (geo_weld_points(&w, id, &count, e))
		goto done;
	merge_vertices(m, group, id, count, r);
	status = 0;
done:
	free(group);
	free(id);
	free(tolerance);
	return status;
}

uint32_t *mesh_clean_positions(const struct model *m, size_t *places, struct err *e)
{
	uint32_t *group = mem_new(m->vertices, sizeof *group, "positions", e);
	uint32_t *position = mem_new(m->vertices, sizeof *position, "positions", e);
	double lo[3], hi[3], d[3], tolerance;

	model_box(m, lo, hi);
	v3_sub(hi, lo, d);
	tolerance = fmax(0x1p-22 * v3_length(d), geo_weld_tolerance(lo, hi));
	struct weld w = { m->vertices, m->vertex, group, 1, &tolerance, m->triangle.n,
		          m->triangle.corner };
	if (!group || !position || geo_weld_points(&w, position, places, e)) {
		free(position);
		position = NULL;
	}
	free(group);
	return position;
}
