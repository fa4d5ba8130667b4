#include "lib/radiosity/exitance_slope.h"

#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"

/* Cosine of 20 degrees: a neighbour turned by more has other light. A guess. */
static const double same_face = .93969262078590838;

/* Neighbours that a fit takes, at least, to be sure of two slopes; a count. And how narrow, against
 * how wide, they may lie: a ratio of moments. Guesses. */
enum { NEIGHBOURS_LEAST = 3 };
static const double narrow = 1e-3;

/* Elements about a vertex, a count: one with more is the hub of a fan, which all would look at in
 * turn; the two others of an element tell of its neighbours. A guess; bisection leaves a dozen. */
enum { HUB = 256 };

int radiosity_neighbours_init(struct neighbours *n, const struct model *m, struct err *e)
{
	const struct mem_array array[] = {
		MEM_ARRAY(n->start, m->vertices + 2, 1),
		MEM_ARRAY(n->element, 3 * m->element.n, 1),
		MEM_ARRAY(n->centre, m->element.n, 1)
	};

	*n = (struct neighbours){ .m = m };
	if (mem_new_arrays(array, sizeof array / sizeof *array, "neighbours", e))
		return -1;
	for (size_t i = 0; i < 3 * m->element.n; i++)
		n->start[m->element.corner[i] + 2]++;
	for (size_t v = 0; v <= m->vertices; v++)
		n->start[v + 1] += n->start[v];
	for (size_t i = 0; i < 3 * m->element.n; i++) {
		n->element[n->start[m->element.corner[i] + 1]++] = (uint32_t)(i / 3);
		v3_mad(n->centre[i / 3], 1. / 3, &m->vertex[3 * (size_t)m->element.corner[i]],
		       n->centre[i / 3]);
	}
	return 0;
}

void radiosity_neighbours_free(struct neighbours *n)
{
	MEM_FREE(n->start, n->element, n->centre);
}

/* An element's edges, and what takes a vector to its parts along them. */
struct affine {
	double edge[2][3], inverse[2][2];
};

static struct affine affine_of(const struct model *m, uint32_t element)
{
	const uint32_t *corner = &m->element.corner[3 * (size_t)element];
	struct affine a;
	double g[3];

	for (int k = 0; k < 2; k++)
		v3_sub(&m->vertex[3 * (size_t)corner[k + 1]], &m->vertex[3 * (size_t)corner[0]], a.edge[k]);
	for (int k = 0; k < 3; k++)
		g[k] = v3_dot(a.edge[k / 2], a.edge[(k + 1) / 2]);
	double det = g[0] * g[2] - g[1] * g[1];
	a.inverse[0][0] = g[2] / det;
	a.inverse[1][1] = g[0] / det;
	a.inverse[0][1] = a.inverse[1][0] = -g[1] / det;
	return a;
}

static int is_neighbour(const struct model *m, uint32_t a, uint32_t b)
{
	return a != b && m->triangle.surface[m->element.triangle[a]] ==
	                 m->triangle.surface[m->element.triangle[b]] &&
	       v3_dot(&m->element.normal[3 * (size_t)a], &m->element.normal[3 * (size_t)b]) > same_face;
}

/* Counts a neighbour twice where it shares two vertices: it is as much nearer. */
void radiosity_exitance_slope(const struct neighbours *n, const lanes *value, uint32_t es,
                              lanes slope[2])
{
	const struct model *m = n->m;
	uint32_t element = es >> 1;
	struct affine a = affine_of(m, element);
	double xx = 0, xy = 0, yy = 0;
	lanes vx = { 0 }, vy = { 0 };
	int count = 0;

	slope[0] = slope[1] = (lanes){ 0 };
	for (int c = 0; c < 3; c++) {
		uint32_t v = m->element.corner[3 * (size_t)element + (size_t)c];
		if (n->start[v + 1] - n->start[v] > HUB)
			continue;
		for (uint64_t i = n->start[v]; i < n->start[v + 1]; i++) {
			uint32_t other = n->element[i];
			double d[3];
			if (!is_neighbour(m, element, other))
				continue;
			v3_sub(n->centre[other], n->centre[element], d);
			double p = v3_dot(d, a.edge[0]), q = v3_dot(d, a.edge[1]);
			double x = a.inverse[0][0] * p + a.inverse[0][1] * q;
			double y = a.inverse[1][0] * p + a.inverse[1][1] * q;
			lanes by = value[2 * other + (es & 1)] - value[es];
			xx += x * x;
			xy += x * y;
			yy += y * y;
			vx += x * by;
			vy += y * by;
			count++;
		}
	}
	double det = xx * yy - xy * xy;
	if (count < NEIGHBOURS_LEAST || !(det > narrow * (xx + yy) * (xx + yy)))
		return;
	slope[0] = (yy * vx - xy * vy) / det;
	slope[1] = (xx * vy - xy * vx) / det;
}
