#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/mesh/imprint.h"

/* The triangles to be, by the input triangle they are part of. */
struct parts {
	size_t n;
	uint32_t *piece;      /* [n] */
	uint32_t *triangle;   /* [n][3] vertices */
};

static int list_parts(const struct model *m, const struct pieces *p, struct parts *out,
                      struct err *e)
{
	const struct piece *piece = p->piece.data;

	out->piece = mem_new(p->piece.n, sizeof *out->piece, "triangles", e);
	out->triangle = mem_new(p->piece.n, 3 * sizeof *out->triangle, "triangles", e);
	if (!out->piece || !out->triangle)
		return -1;
	for (uint32_t t = 0; t < m->triangle.n; t++)
		for (uint32_t i = t; i != RIM; i = piece[i].next) {
			memcpy(&out->triangle[3 * out->n], piece[i].v, sizeof piece[i].v);
			out->piece[out->n++] = i;
		}
	return 0;
}

/* Joins the corners, at both ends of each edge without a line, of the triangles that
 * share it, and marks the vertices of lines. */
static size_t join_corners(const struct parts *parts, const struct half_edges *g,
                           const struct piece *piece, uint32_t *set, uint8_t *on_line)
{
	size_t lines = 0;

	for (size_t i = 0; i < g->n; i++) {
		const uint32_t *use = &g->use[g->start[i]];
		size_t n = g->start[i + 1] - g->start[i];
		uint32_t lo = geo_half_edge_from(parts->triangle, use[0]);
		if (piece[parts->piece[use[0] / 3]].line[use[0] % 3]) {
			on_line[lo] = on_line[geo_half_edge_to(parts->triangle, use[0])] = 1;
			lines++;
			continue;
		}
		for (size_t k = 1; k < n; k++) {
			uint32_t a[2] = { use[0], use[0] % 3 == 2 ? use[0] - 2 : use[0] + 1 };
			uint32_t b[2] = { use[k], use[k] % 3 == 2 ? use[k] - 2 : use[k] + 1 };
			int turned = geo_half_edge_from(parts->triangle, use[k]) != lo;
			geo_sets_join(set, a[0], b[turned]);
			geo_sets_join(set, a[1], b[!turned]);
		}
	}
	return lines;
}

/* The first set of corners at a vertex keeps it, each further one gets a copy. */
static int copy_vertices(struct parts *parts, struct array *vertex, uint32_t *set,
                         const uint8_t *on_line, size_t vertices, struct err *e)
{
	int status = -1;
	uint32_t *of_set = mem_new(3 * parts->n, sizeof *of_set, "vertices", e);
	uint8_t *taken = mem_new(vertices, 1, "vertices", e);

	if (!of_set || !taken)
		goto done;
	for (uint32_t i = 0; i < 3 * parts->n; i++) {
		uint32_t v = parts->triangle[i], root = geo_sets_find(set, i);
		if (!on_line[v])
			continue;
		if (root == i) {
			of_set[i] = v;
			if (taken[v]) {
				double at[3];
				memcpy(at, (double *)vertex->data + 3 * (size_t)v, sizeof at);
				of_set[i] = (uint32_t)vertex->n;
				if (mem_append(vertex, at, 1, sizeof at, e))
					goto done;
			}
			taken[v] = 1;
		}
		parts->triangle[i] = of_set[root];
	}
	status = 0;
done:
	free(of_set);
	free(taken);
	return status;
}

/* Weights of the corners of an input triangle at a point of its plane. */
static void weights(const struct model *m, size_t triangle, const double x[3], double w[3])
{
	const double *corner[3];
	double n[3], a[3];

	for (size_t k = 0; k < 3; k++)
		corner[k] = &m->vertex[3 * (size_t)m->triangle.corner[3 * triangle + k]];
	v3_area(corner[0], corner[1], corner[2], n);
	for (int k = 0; k < 3; k++) {
		v3_area(x, corner[(k + 1) % 3], corner[(k + 2) % 3], a);
		w[k] = v3_dot(a, n) / v3_dot(n, n);
	}
}

/* out[3][size] = the attribute in[3][size] of an input triangle at the corners of a part. */
static void interpolate(const float *in, size_t size, double w[3][3], float *out)
{
	for (size_t c = 0; c < 3; c++)
		for (size_t i = 0; i < size; i++)
			out[size * c + i] = (float)(w[c][0] * (double)in[i] +
			                            w[c][1] * (double)in[size + i] +
			                            w[c][2] * (double)in[2 * size + i]);
}

/* UVs and normals of the parts, surfaces, and the model's arrays replaced. */
static int replace(struct model *m, const struct pieces *p, struct parts *parts, struct err *e)
{
	const struct piece *piece = p->piece.data;
	uint32_t *surface = mem_new(parts->n, sizeof *surface, "triangles", e);
	float *uv = m->triangle.uv ? mem_new(parts->n, 6 * sizeof *uv, "UVs", e) : NULL;
	float *normal = m->triangle.normal ? mem_new(parts->n, 9 * sizeof *normal, "normals", e)
	                                   : NULL;

	if (!surface || (m->triangle.uv && !uv) || (m->triangle.normal && !normal)) {
		free(surface);
		free(uv);
		free(normal);
		return -1;
	}
	for (size_t i = 0; i < parts->n; i++) {
		const struct piece *part = &piece[parts->piece[i]];
		size_t t = part->triangle;
		double w[3][3];
		for (int k = 0; k < 3; k++)
			weights(m, t, (const double *)p->vertex.data + 3 * (size_t)part->v[k],
			        w[k]);
		surface[i] = m->triangle.surface[t];
		if (uv)
			interpolate(&m->triangle.uv[6 * t], 2, w, &uv[6 * i]);
		if (normal)
			interpolate(&m->triangle.normal[9 * t], 3, w, &normal[9 * i]);
	}
	free(m->triangle.corner);
	free(m->triangle.surface);
	free(m->triangle.uv);
	free(m->triangle.normal);
	m->triangle.corner = parts->triangle;
	m->triangle.surface = surface;
	m->triangle.uv = uv;
	m->triangle.normal = normal;
	m->triangle.n = parts->n;
	parts->triangle = NULL;
	return 0;
}

int mesh_imprint_replace(struct model *m, struct pieces *p, size_t *lines, struct err *e)
{
	int status = -1;
	size_t vertices = p->vertex.n;
	struct parts parts = { 0 };
	struct half_edges g = { 0 };
	uint32_t *set = geo_sets_new(3 * p->piece.n, e);
	uint8_t *on_line = mem_new(vertices, 1, "vertices", e);

	if (!set || !on_line || list_parts(m, p, &parts, e) ||
	    geo_half_edges_build(&g, parts.triangle, parts.n, vertices, e))
		goto done;
	*lines = join_corners(&parts, &g, p->piece.data, set, on_line);
	if (copy_vertices(&parts, &p->vertex, set, on_line, vertices, e) ||
	    replace(m, p, &parts, e))
		goto done;
	free(m->vertex);
	m->vertex = p->vertex.data;
	m->vertices = p->vertex.n;
	p->vertex = (struct array){ 0 };
	status = 0;
done:
	free(parts.piece);
	free(parts.triangle);
	free(set);
	free(on_line);
	geo_half_edges_free(&g);
	return status;
}
