#include "lib/hemicube/hemicube_scene.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/hemicube/hemicube.h"

/* What is needed while clusters are formed. */
struct builder {
	const struct model *m;
	struct hemicube_mesh *s;
	const uint32_t *corner; /* [triangles][3] the model's vertices */
	double *centroid;      /* [triangles][3] */
	uint32_t *order;       /* triangles, permuted */
	uint32_t *local;       /* [vertices] number within the cluster it was last in */
	uint32_t *stamp;       /* [vertices] 1 + that cluster */
	size_t vertices;       /* emitted so far */
};

static void swap(uint32_t *a, uint32_t *b)
{
	uint32_t t = *a;

	*a = *b;
	*b = t;
}

/* 1 if triangle e comes before f along the axis. */
static int before(const struct builder *b, int axis, uint32_t e, uint32_t f)
{
	double x = b->centroid[3 * (size_t)e + (size_t)axis];
	double y = b->centroid[3 * (size_t)f + (size_t)axis];

	return x != y ? x < y : e < f;
}

/* Partitions order[begin, end) so that its element k is in its sorted place
 * (Hoare's quickselect, pivot from the middle). */
static void select_nth(struct builder *b, int axis, size_t begin, size_t end, size_t k)
{
	uint32_t *o = b->order;

	while (end - begin > 1) {
		uint32_t pivot = o[begin + (end - begin) / 2];
		size_t i = begin, j = end - 1;
		for (;; i++, j--) {
			while (before(b, axis, o[i], pivot))
				i++;
			while (before(b, axis, pivot, o[j]))
				j--;
			if (i >= j)
				break;
			swap(&o[i], &o[j]);
		}
		/* [begin, i) < pivot <= [i, end), and i == j means o[i] is the pivot. */
		if (k < i)
			end = i;
		else if (i != j)
			begin = i;
		else if (k == i)
			return;
		else
			begin = i + 1;
	}
}

static void bounds(const struct builder *b, size_t begin, size_t end, double lo[3],
                   double hi[3])
{
	for (int k = 0; k < 3; k++)
		lo[k] = INFINITY, hi[k] = -INFINITY;
	for (size_t i = begin; i < end; i++)
		for (int k = 0; k < 3; k++) {
			double x = b->centroid[3 * (size_t)b->order[i] + (size_t)k];
			lo[k] = fmin(lo[k], x);
			hi[k] = fmax(hi[k], x);
		}
}

/* Number of a model's vertex within cluster c, adding it if it is new. */
static uint32_t local_vertex(struct builder *b, struct hemicube_cluster *c, uint32_t v)
{
	struct hemicube_mesh *s = b->s;
	uint32_t mark = (uint32_t)(s->clusters + 1);

	if (b->stamp[v] == mark)
		return b->local[v];
	const double *p = &b->m->vertex[3 * (size_t)v];
	s->x[b->vertices] = p[0];
	s->y[b->vertices] = p[1];
	s->z[b->vertices++] = p[2];
	b->stamp[v] = mark;
	return b->local[v] = (uint32_t)c->vertices++;
}

static void bounding_sphere(const struct hemicube_mesh *s, struct hemicube_cluster *c)
{
	const double *x[3] = { s->x + c->vertex, s->y + c->vertex, s->z + c->vertex };
	double far = 0;

	for (int k = 0; k < 3; k++) {
		double lo = INFINITY, hi = -INFINITY;
		for (int i = 0; i < c->vertices; i++) {
			lo = fmin(lo, x[k][i]);
			hi = fmax(hi, x[k][i]);
		}
		c->centre[k] = lo + (hi - lo) / 2;
	}
	for (int i = 0; i < c->vertices; i++) {
		double p[3] = { x[0][i], x[1][i], x[2][i] }, d[3];
		v3_sub(p, c->centre, d);
		far = fmax(far, v3_dot(d, d));
	}
	/* Rounded up, with the rounding of coordinates far from the origin. */
	c->radius = sqrt(far) * (1 + 4 * DBL_EPSILON) + s->horizon;
}

static int32_t emit_cluster(struct builder *b, size_t begin, size_t end)
{
	struct hemicube_mesh *s = b->s;
	struct hemicube_cluster *c = &s->cluster[s->clusters];

	*c = (struct hemicube_cluster){ .vertex = b->vertices, .triangle = begin };
	for (size_t i = begin; i < end; i++) {
		const uint32_t *v = &b->corner[3 * (size_t)b->order[i]];
		for (int k = 0; k < 3; k++)
			s->corner[i][k] = (uint8_t)local_vertex(b, c, v[k]);
		s->number[i] = b->order[i];
	}
	c->triangles = (int)(end - begin);
	bounding_sphere(s, c);
	for (; c->vertices % 4; c->vertices++, b->vertices++) {
		s->x[b->vertices] = s->x[b->vertices - 1];
		s->y[b->vertices] = s->y[b->vertices - 1];
		s->z[b->vertices] = s->z[b->vertices - 1];
	}
	return ~(int32_t)s->clusters++;
}

/* Halves [begin, end) at the median of the longest axis until it fits. */
static int32_t divide(struct builder *b, size_t begin, size_t end)
{
	double lo[3], hi[3];
	int axis = 0;

	if (end - begin <= CLUSTER_TRIANGLES)
		return emit_cluster(b, begin, end);
	bounds(b, begin, end, lo, hi);
	for (int k = 1; k < 3; k++)
		if (hi[k] - lo[k] > hi[axis] - lo[axis])
			axis = k;
	size_t middle = begin + (end - begin) / 2;
	select_nth(b, axis, begin, end, middle);
	int32_t n = (int32_t)b->s->splits++;
	struct hemicube_split *p = &b->s->split[n];
	p->axis = axis;
	p->at = b->centroid[3 * (size_t)b->order[middle] + (size_t)axis];
	p->child[0] = divide(b, begin, middle);
	p->child[1] = divide(b, middle, end);
	return n;
}

static void prepare(struct builder *b)
{
	const struct model *m = b->m;
	double largest = 0;

	for (size_t i = 0; i < 3 * m->vertices; i++)
		largest = fmax(largest, fabs(m->vertex[i]));
	b->s->horizon = 64 * DBL_EPSILON * largest;
	for (size_t i = 0; i < b->s->triangles; i++) {
		const uint32_t *c = &b->corner[3 * i];
		b->order[i] = (uint32_t)i;
		for (size_t k = 0; k < 3; k++)
			b->centroid[3 * i + k] = (m->vertex[3 * (size_t)c[0] + k] +
			                          m->vertex[3 * (size_t)c[1] + k] +
			                          m->vertex[3 * (size_t)c[2] + k]) / 3;
	}
}

static int allocate(struct builder *b, struct err *e)
{
	const struct model *m = b->m;
	struct hemicube_mesh *s = b->s;
	size_t n = s->triangles;
	/* Halving leaves more than CLUSTER_TRIANGLES / 2 in each. */
	size_t clusters = n / (CLUSTER_TRIANGLES / 2) + 1;

	if (n > HEMICUBE_VOID / 2)
		return err_set(e, "too many elements for a hemicube: %zu", n);
	size_t vertices = 3 * (n + clusters);
	s->cluster = mem_new(clusters, sizeof *s->cluster, "hemicube clusters", e);
	s->split = mem_new(clusters, sizeof *s->split, "hemicube clusters", e);
	s->x = mem_new(vertices, sizeof *s->x, "hemicube vertices", e);
	s->y = mem_new(vertices, sizeof *s->y, "hemicube vertices", e);
	s->z = mem_new(vertices, sizeof *s->z, "hemicube vertices", e);
	s->corner = mem_new(n, sizeof *s->corner, "hemicube triangles", e);
	s->number = mem_new(n, sizeof *s->number, "hemicube triangles", e);
	b->centroid = mem_new(n, 3 * sizeof *b->centroid, "centroids", e);
	b->order = mem_new(n, sizeof *b->order, "triangle order", e);
	b->local = mem_new(m->vertices, sizeof *b->local, "vertex numbers", e);
	b->stamp = mem_new(m->vertices, sizeof *b->stamp, "vertex stamps", e);
	return s->cluster && s->split && s->x && s->y && s->z && s->corner && s->number &&
	       b->centroid && b->order && b->local && b->stamp ? 0 : -1;
}

/* Gives back what shared vertices did not need. */
static void shrink(double **a, size_t n)
{
	double *p = realloc(*a, (n ? n : 1) * sizeof **a);

	if (p)
		*a = p;
}

/* Triangles corner[n][3] of m's vertices. 0, or -1 and e; free either way. */
static int ff_hemicube_mesh_init(struct hemicube_mesh *s, const struct model *m, const uint32_t *corner,
                                 size_t n, struct err *e)
{
	struct builder b = { .m = m, .s = s, .corner = corner };
	int bad;

	*s = (struct hemicube_mesh){ .triangles = n };
	bad = allocate(&b, e);
	if (!bad) {
		prepare(&b);
		if (n)
			s->root = divide(&b, 0, n);
		shrink(&s->x, b.vertices);
		shrink(&s->y, b.vertices);
		shrink(&s->z, b.vertices);
	}
	free(b.centroid);
	free(b.order);
	free(b.local);
	free(b.stamp);
	return bad;
}

static void ff_hemicube_mesh_free(struct hemicube_mesh *s)
{
	free(s->cluster);
	free(s->split);
	free(s->x);
	free(s->y);
	free(s->z);
	free(s->corner);
	free(s->number);
	*s = (struct hemicube_mesh){ 0 };
}

struct hemicube_scene *ff_hemicube_scene_new(const struct model *m, const struct locator *locator,
                                             struct err *e)
{
	struct hemicube_scene *s = mem_new(1, sizeof *s, "hemicube scene", e);

	if (!s)
		return NULL;
	s->m = m;
	s->locator = locator;
	/* Hardly subdivided: the elements are as good as the triangles. */
	size_t n = !locator || m->triangle.n > m->element.n / 2 ? 0 : m->triangle.n;
	if (ff_hemicube_mesh_init(&s->elements, m, m->element.corner, m->element.n, e) ||
	    ff_hemicube_mesh_init(&s->triangles, m, m->triangle.corner, n, e)) {
		ff_hemicube_scene_free(s);
		return NULL;
	}
	return s;
}

void ff_hemicube_scene_free(struct hemicube_scene *s)
{
	if (!s)
		return;
	ff_hemicube_mesh_free(&s->elements);
	ff_hemicube_mesh_free(&s->triangles);
	free(s);
}
