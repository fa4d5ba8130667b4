/* The node graph: a forest of affine transforms. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"
#include "lib/base/mem.h"
#include "lib/base/vec.h"

/* Columns of a matrix count as dependent when the volume that they span as unit
 * vectors is below this: far above the rounding of a product of matrices in float64, far below
 * any scale that is meant. A guess. */
static const double SINGULAR = 1e-12;

/* What a quaternion's squared length may be off 1: exporters round to few digits, and each is
 * normalised before use. A guess. */
static const double unit_tolerance = .02;

static int set_parents(struct gltf_reader *g, struct err *e)
{
	struct gltf_doc *d = &g->doc;

	for (size_t i = 0; i < d->nodes; i++) {
		const struct gltf_node *n = &d->node[i];
		for (size_t k = 0; k < n->children; k++) {
			int child = d->child[n->child + k];
			if (d->node[child].parent != GLTF_NONE)
				return err_set(e, "%s: nodes[%d]: has two parents, nodes[%d] and "
				               "nodes[%zu]; correct the file", g->source.path, child,
				               d->node[child].parent, i);
			d->node[child].parent = (int)i;
		}
	}
	return 0;
}

/* Nodes that no root leads to, every node having one parent, lie on or below a
 * cycle. `order` gets all nodes, parents before children. */
static int sort_nodes(const struct gltf_reader *g, int *order, uint8_t *seen, struct err *e)
{
	const struct gltf_doc *d = &g->doc;
	size_t n = 0;

	for (size_t i = 0; i < d->nodes; i++)
		if (d->node[i].parent == GLTF_NONE)
			order[n++] = (int)i;
	for (size_t at = 0; at < n; at++) {
		const struct gltf_node *node = &d->node[order[at]];
		seen[order[at]] = 1;
		for (size_t k = 0; k < node->children; k++)
			order[n++] = d->child[node->child + k];
	}
	for (size_t i = 0; i < d->nodes; i++)
		if (!seen[i])
			return err_set(e, "%s: nodes[%zu]: is on or below a cycle of nodes; correct "
			               "the file", g->source.path, i);
	return 0;
}

/* 1 if the linear part of an affine matrix can be inverted. */
static int invertible(const double m[16])
{
	double a[3], b[3], c[3], ab[3];

	memcpy(a, m, sizeof a);
	memcpy(b, m + 4, sizeof b);
	memcpy(c, m + 8, sizeof c);
	if (!(v3_normalise(a) > 0) || !(v3_normalise(b) > 0) || !(v3_normalise(c) > 0))
		return 0;
	v3_cross(a, b, ab);
	return fabs(v3_dot(ab, c)) > SINGULAR;
}

/* T R S, column-major; the quaternion x y z w is unit up to rounding. */
static void compose(const struct gltf_node *n, double m[16])
{
	const double *q = n->rotation;
	double s = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
	double x = q[0], y = q[1], z = q[2], w = q[3];
	double r[9] = {
		1 - s * (y * y + z * z), s * (x * y + z * w), s * (x * z - y * w),
		s * (x * y - z * w), 1 - s * (x * x + z * z), s * (y * z + x * w),
		s * (x * z + y * w), s * (y * z - x * w), 1 - s * (x * x + y * y)
	};

	memset(m, 0, 16 * sizeof *m);
	for (int k = 0; k < 3; k++) {
		for (int i = 0; i < 3; i++)
			m[4 * k + i] = n->scale[k] * r[3 * k + i];
		m[12 + k] = n->translation[k];
	}
	m[15] = 1;
}

static void local_matrix(const struct gltf_node *n, double m[16])
{
	if (n->has_matrix)
		memcpy(m, n->matrix, 16 * sizeof *m);
	else
		compose(n, m);
}

/* out = a b; out is neither. */
static void multiply(const double a[16], const double b[16], double out[16])
{
	for (int column = 0; column < 4; column++)
		for (int row = 0; row < 4; row++) {
			double x = 0;
			for (int k = 0; k < 4; k++)
				x += a[4 * k + row] * b[4 * column + k];
			out[4 * column + row] = x;
		}
}

static int check_matrix(const struct gltf_reader *g, size_t i, struct err *e)
{
	const struct gltf_node *n = &g->doc.node[i];
	const json_t *o = json_array_get(json_object_get(g->source.root, "nodes"), i);
	const double *q = n->rotation;
	double length = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], m[16];

	if (n->has_matrix && (json_object_get(o, "translation") ||
	                      json_object_get(o, "rotation") || json_object_get(o, "scale")))
		return err_set(e, "%s: nodes[%zu]: has both matrix and translation, rotation or "
		               "scale; keep one", g->source.path, i);
	if (n->has_matrix && (n->matrix[3] != 0 || n->matrix[7] != 0 || n->matrix[11] != 0 ||
	                      n->matrix[15] != 1))
		return err_set(e, "%s: nodes[%zu].matrix: is not affine, its last row must be "
		               "0 0 0 1; correct the file", g->source.path, i);
	if (!(fabs(length - 1) < unit_tolerance))
		return err_set(e, "%s: nodes[%zu].rotation: is no unit quaternion; correct the "
		               "file", g->source.path, i);
	local_matrix(n, m);
	if (!invertible(m))
		return err_set(e, "%s: nodes[%zu]: its matrix is singular (a scale of 0?); correct "
		               "it or remove the node", g->source.path, i);
	return 0;
}

/* Without a scene, all roots are one. */
static int set_roots(struct gltf_reader *g, struct err *e)
{
	struct gltf_doc *d = &g->doc;

	if (d->scene != GLTF_NONE)
		return 0;
	d->root = mem_new(d->nodes, sizeof *d->root, "scene nodes", e);
	if (!d->root)
		return -1;
	for (size_t i = 0; i < d->nodes; i++)
		if (d->node[i].parent == GLTF_NONE)
			d->root[d->roots++] = (int)i;
	return 0;
}

static int check_roots(const struct gltf_reader *g, uint8_t *seen, struct err *e)
{
	const struct gltf_doc *d = &g->doc;

	memset(seen, 0, d->nodes);
	for (size_t i = 0; i < d->roots; i++) {
		int n = d->root[i];
		if (d->node[n].parent != GLTF_NONE)
			return err_set(e, "%s: scenes[%d]: nodes[%d] is no root, it is a child of "
			               "nodes[%d]; correct the file", g->source.path, d->scene, n,
			               d->node[n].parent);
		if (seen[n])
			return err_set(e, "%s: scenes[%d]: lists nodes[%d] twice; correct the file",
			               g->source.path, d->scene, n);
		seen[n] = 1;
	}
	return 0;
}

int gltf_check_nodes(struct gltf_reader *g, struct err *e)
{
	size_t n = g->doc.nodes;
	int *order = mem_new(n, sizeof *order, "the order of nodes", e), status = -1;
	uint8_t *seen = mem_new(n, 1, "marks of nodes", e);

	if (!order || !seen || set_parents(g, e) || sort_nodes(g, order, seen, e) ||
	    set_roots(g, e) || check_roots(g, seen, e))
		goto out;
	for (size_t i = 0; i < n; i++)
		if (check_matrix(g, i, e))
			goto out;
	status = 0;
out:
	free(order);
	free(seen);
	return status;
}

static int place_node(const struct gltf_reader *g, int i, double *world, struct err *e)
{
	const struct gltf_node *n = &g->doc.node[i];
	double *out = world + 16 * (size_t)i, local[16];

	if (n->parent == GLTF_NONE) {
		local_matrix(n, out);
	} else {
		local_matrix(n, local);
		multiply(world + 16 * (size_t)n->parent, local, out);
	}
	for (int k = 0; k < 16; k++)
		if (!isfinite(out[k]))
			return err_set(e, "%s: nodes[%d]: its world matrix is not finite; correct the "
			               "file", g->source.path, i);
	if (!invertible(out))
		return err_set(e, "%s: nodes[%d]: its world matrix is singular; correct it or "
		               "remove the node", g->source.path, i);
	return 0;
}

int gltf_world_matrices(const struct gltf_reader *g, double *world, uint8_t *reached,
                        struct err *e)
{
	const struct gltf_doc *d = &g->doc;
	int *queue = mem_new(d->nodes, sizeof *queue, "the order of nodes", e), status = -1;
	size_t n = 0;

	if (!queue)
		return -1;
	for (size_t i = 0; i < d->roots; i++)
		queue[n++] = d->root[i];
	for (size_t at = 0; at < n; at++) {
		const struct gltf_node *node = &d->node[queue[at]];
		reached[queue[at]] = 1;
		if (place_node(g, queue[at], world, e))
			goto out;
		for (size_t k = 0; k < node->children; k++)
			queue[n++] = d->child[node->child + k];
	}
	status = 0;
out:
	free(queue);
	return status;
}
