#include "lib/occlusion/occluder_set.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/geometry/half_edge.h"
#include "lib/occlusion/occluder_inside.h"
#include "lib/occlusion/occluder_polygons.h"

/* Occluders in a leaf of the tree, a count: testing a box costs about as much as testing that of an
 * occluder. A guess. */
enum { LEAF = 2 };

struct maker {
	struct polygons p;
	struct side *side;            /* all edges of polygons, sorted by points */
	size_t sides;
	uint32_t *set;                /* [polygons] group, by its lowest member */
	uint32_t *order;              /* polygons by group */
	uint32_t *first_side;         /* [polygons+1] edges by group of their polygon */
	struct side *group_side;
	struct array occluder, corner, edge, face;
	struct err *e;
};

/* ---- occluders ---- */

static void bound(const struct maker *k, struct occluder_shape *b)
{
	const double *x = (const double *)k->corner.data + 3 * (size_t)b->corner;

	for (int d = 0; d < 3; d++) {
		b->lo[d] = INFINITY;
		b->hi[d] = -INFINITY;
		b->centre[d] = 0;
		for (uint32_t i = 0; i < b->corners; i++) {
			b->lo[d] = fmin(b->lo[d], x[3 * i + (uint32_t)d]);
			b->hi[d] = fmax(b->hi[d], x[3 * i + (uint32_t)d]);
			b->centre[d] += x[3 * i + (uint32_t)d] / b->corners;
		}
	}
}

static void begin_shape(const struct maker *k, struct occluder_shape *b)
{
	*b = (struct occluder_shape){ .corner = (uint32_t)k->corner.n / 3,
		                      .edge = (uint32_t)k->edge.n,
		                      .face = (uint32_t)k->face.n };
}

static int end_shape(struct maker *k, struct occluder_shape *b)
{
	const double *x = k->corner.data;

	b->corners = (uint32_t)k->corner.n / 3 - b->corner;
	b->edges = (uint32_t)k->edge.n - b->edge;
	b->faces = (uint32_t)k->face.n - b->face;
	for (size_t i = b->edge; i < k->edge.n; i++) {
		struct occluder_edge *e = (struct occluder_edge *)k->edge.data + i;
		v3_sub(&x[3 * (size_t)e->b], &x[3 * (size_t)e->a], e->along);
		v3_normalise(e->along);
	}
	bound(k, b);
	return mem_append(&k->occluder, b, 1, sizeof *b, k->e);
}

/* Does a plane have the whole scene on one side? Then it can only be touched. */
static int on_hull(const struct polygons *p, const struct plane *plane)
{
	int above = 0, below = 0;

	for (size_t i = 0; i < p->points && !(above && below); i++) {
		double h = occ_plane_height(plane, &p->point[3 * i]);
		above |= h > p->near;
		below |= h < -p->near;
	}
	return !(above && below);
}

static int all_on_hull(const struct polygons *p, const struct solid *s)
{
	for (size_t i = 0; i < s->polygons; i++)
		if (!on_hull(p, &((const struct polygon *)p->polygon.data)[s->polygon[i]].plane))
			return 0;
	return 1;
}

static int put_flat(struct maker *k, uint32_t polygon)
{
	const struct polygon *q = (const struct polygon *)k->p.polygon.data + polygon;
	struct occluder_shape b;

	if (on_hull(&k->p, &q->plane))
		return 0;
	begin_shape(k, &b);
	b.flat = 1;
	for (uint32_t i = 0; i < q->n; i++) {
		struct occluder_edge edge = { .a = b.corner + i, .b = b.corner + (i + 1) % q->n };
		if (mem_append(&k->corner, occ_polygon_point(&k->p, q->first + i), 3,
		               sizeof(double), k->e) ||
		    mem_append(&k->edge, &edge, 1, sizeof edge, k->e))
			return -1;
	}
	return mem_append(&k->face, &q->plane, 1, sizeof q->plane, k->e) || end_shape(k, &b);
}

/* The number of a point in an occluder under way, added if it is new. */
static int shape_corner(struct maker *k, const struct occluder_shape *b, uint32_t *known,
                        uint32_t *n, uint32_t point, uint32_t *corner)
{
	uint32_t i = 0;

	while (i < *n && known[i] != point)
		i++;
	*corner = b->corner + i;
	if (i < *n)
		return 0;
	known[(*n)++] = point;
	return mem_append(&k->corner, &k->p.point[3 * (size_t)point], 3, sizeof(double), k->e);
}

static uint16_t face_number(const struct solid *s, uint32_t polygon)
{
	uint16_t i = 0;

	while (s->polygon[i] != polygon)
		i++;
	return i;
}

static int put_solid(struct maker *k, const struct solid *s)
{
	const struct polygon *poly = k->p.polygon.data;
	uint32_t known[2 * OCCLUDER_SHAPE_EDGES * 2], n = 0;
	struct occluder_shape b;

	begin_shape(k, &b);
	for (size_t i = 0; i < s->polygons; i++)
		if (mem_append(&k->face, &poly[s->polygon[i]].plane, 1, sizeof(struct plane), k->e))
			return -1;
	if (!s->closed && mem_append(&k->face, &s->missing, 1, sizeof s->missing, k->e))
		return -1;
	for (size_t i = 0; i < s->sides; i++) {
		const struct side *x = &s->side[i];
		int pair = i + 1 < s->sides && x[1].low == x->low && x[1].high == x->high;
		struct occluder_edge edge = { .left = face_number(s, x->polygon),
		                          .right = (uint16_t)s->polygons };
		if (pair)
			edge.right = face_number(s, x[1].polygon);
		if (shape_corner(k, &b, known, &n, x->low, &edge.a) ||
		    shape_corner(k, &b, known, &n, x->high, &edge.b) ||
		    mem_append(&k->edge, &edge, 1, sizeof edge, k->e))
			return -1;
		i += (size_t)pair;
	}
	return end_shape(k, &b);
}

static int put_group(struct maker *k, const uint32_t *polygon, size_t n)
{
	struct solid s = { .polygon = polygon, .polygons = n,
	                   .side = k->group_side + k->first_side[k->set[polygon[0]]],
	                   .sides = k->first_side[k->set[polygon[0]] + 1] -
	                            k->first_side[k->set[polygon[0]]] };

	if (n > 2 && occ_solid_check(&k->p, &s) && !all_on_hull(&k->p, &s) &&
	    occ_solid_is_opaque(&k->p, &s, k->set))
		return put_solid(k, &s);
	for (size_t i = 0; i < n; i++)
		if (put_flat(k, polygon[i]))
			return -1;
	return 0;
}

/* Edges by group, in the order of their points: a counting sort. */
static void sort_sides(struct maker *k, size_t polygons)
{
	for (size_t i = 0; i < k->sides; i++)
		k->first_side[k->set[k->side[i].polygon] + 1]++;
	for (size_t i = 0; i < polygons; i++)
		k->first_side[i + 1] += k->first_side[i];
	for (size_t i = 0; i < k->sides; i++)
		k->group_side[k->first_side[k->set[k->side[i].polygon]]++] = k->side[i];
	for (size_t i = polygons; i > 0; i--)
		k->first_side[i] = k->first_side[i - 1];
	k->first_side[0] = 0;
}

static int put_occluders(struct maker *k)
{
	size_t n = k->p.polygon.n, at = 0;
	uint32_t *next = mem_new(n + 1, sizeof *next, "occluders", k->e);

	if (!next)
		return -1;
	for (uint32_t i = 0; i < n; i++)
		k->set[i] = geo_sets_find(k->set, i);
	sort_sides(k, n);
	for (uint32_t i = 0; i < n; i++)
		next[k->set[i] + 1]++;
	for (size_t i = 0; i < n; i++)
		next[i + 1] += next[i];
	for (uint32_t i = 0; i < n; i++)
		k->order[next[k->set[i]]++] = i;
	free(next);
	for (size_t end; at < n; at = end) {
		for (end = at; end < n && k->set[k->order[end]] == k->set[k->order[at]];)
			end++;
		if (put_group(k, k->order + at, end - at))
			return -1;
	}
	return 0;
}

/* ---- the tree ---- */

static int by_centre(const void *a, const void *b, int axis)
{
	const struct occluder_shape *x = a, *y = b;

	if (x->centre[axis] != y->centre[axis])
		return x->centre[axis] < y->centre[axis] ? -1 : 1;
	return (x->corner > y->corner) - (x->corner < y->corner);
}

static int by_centre_x(const void *a, const void *b) { return by_centre(a, b, 0); }
static int by_centre_y(const void *a, const void *b) { return by_centre(a, b, 1); }
static int by_centre_z(const void *a, const void *b) { return by_centre(a, b, 2); }

/* Halves the occluders along the longest side of their box until few are left. */
static void grow(struct occluder_set *s, uint32_t first, uint32_t count)
{
	static int (*const by_axis[3])(const void *, const void *) = { by_centre_x, by_centre_y,
	                                                               by_centre_z };
	struct occluder_node *n = &s->node[s->nodes++];
	int axis = 0;

	*n = (struct occluder_node){ .first = first, .count = count };
	for (int d = 0; d < 3; d++) {
		n->lo[d] = INFINITY;
		n->hi[d] = -INFINITY;
		for (uint32_t i = first; i < first + count; i++) {
			n->lo[d] = fmin(n->lo[d], s->occluder[i].lo[d]);
			n->hi[d] = fmax(n->hi[d], s->occluder[i].hi[d]);
		}
		if (n->hi[d] - n->lo[d] > n->hi[axis] - n->lo[axis])
			axis = d;
	}
	if (count <= LEAF)
		return;
	qsort(s->occluder + first, count, sizeof *s->occluder, by_axis[axis]);
	grow(s, first, count / 2);
	n->right = (uint32_t)s->nodes;
	grow(s, first + count / 2, count - count / 2);
}

static int make_tree(struct occluder_set *s, struct err *e)
{
	s->node = mem_new(2 * s->occluders + 1, sizeof *s->node, "tree of occluders", e);
	if (!s->node)
		return -1;
	if (s->occluders)
		grow(s, 0, (uint32_t)s->occluders);
	return 0;
}

int occ_occluder_set_init(struct occluder_set *s, const struct model *m, struct err *e)
{
	struct maker k = { .e = e };
	int bad = occ_polygons_init(&k.p, m, e);
	size_t n = k.p.polygon.n;

	*s = (struct occluder_set){ .near = k.p.near };
	k.set = bad ? NULL : geo_sets_new(n, e);
	k.order = mem_new(n, sizeof *k.order, "occluders", e);
	k.first_side = mem_new(n + 1, sizeof *k.first_side, "occluders", e);
	k.group_side = mem_new(k.p.corner.n, sizeof *k.group_side, "occluders", e);
	bad = bad || !k.set || !k.order || !k.first_side || !k.group_side ||
	      occ_solids_group(&k.p, k.set, &k.side, &k.sides, e) || put_occluders(&k);
	s->occluder = k.occluder.data;
	s->occluders = k.occluder.n;
	s->corner = k.corner.data;
	s->corners = k.corner.n / 3;
	s->edge = k.edge.data;
	s->edges = k.edge.n;
	s->face = k.face.data;
	s->faces = k.face.n;
	free(k.set);
	free(k.order);
	free(k.first_side);
	free(k.group_side);
	free(k.side);
	occ_polygons_free(&k.p);
	return bad || make_tree(s, e) ? -1 : 0;
}

void occ_occluder_set_free(struct occluder_set *s)
{
	free(s->occluder);
	free(s->corner);
	free(s->edge);
	free(s->face);
	free(s->node);
	*s = (struct occluder_set){ 0 };
}
