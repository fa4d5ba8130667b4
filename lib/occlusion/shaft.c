#include "lib/occlusion/shaft.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/occlusion/occluder_polygons.h"

/* A box is flat up to so many times the height that counts as none. A guess. */
static const double flat_box = 4;

/* ---- the shaft between two facets ---- */

static void grow_box(struct shaft *l, const struct facet *f)
{
	for (int i = 0; i < f->n; i++)
		for (int k = 0; k < 3; k++) {
			double x = f->v[3 * i + k];
			l->lo[k] = x < l->lo[k] ? x : l->lo[k];
			l->hi[k] = x > l->hi[k] ? x : l->hi[k];
		}
}

static int none_above(const struct facet *f, const struct plane *p, double near)
{
	for (int i = 0; i < f->n; i++)
		if (occ_plane_height(p, &f->v[3 * i]) > near)
			return 0;
	return 1;
}

/* Planes through an edge of f and a corner of g that have all of both behind them. */
static int edge_planes(const struct facet *f, const struct facet *g, double near,
                       struct plane *shaft)
{
	int n = 0;

	for (int i = 0; i < f->n; i++) {
		const double *a = &f->v[3 * i], *b = &f->v[3 * ((i + 1) % f->n)];
		double ab[3], ac[3];
		v3_sub(b, a, ab);
		for (int j = 0; j < g->n; j++) {
			struct plane *p = &shaft[n];
			v3_sub(&g->v[3 * j], a, ac);
			v3_cross(ab, ac, p->normal);
			if (!(v3_normalise(p->normal) > 0))
				continue;
			p->offset = v3_dot(p->normal, a);
			if (occ_plane_height(p, f->centre) > 0) {
				for (int k = 0; k < 3; k++)
					p->normal[k] = -p->normal[k];
				p->offset = -p->offset;
			}
			if (none_above(g, p, near) && none_above(f, p, near)) {
				n++;
				break;
			}
		}
	}
	return n;
}

int occ_shaft_planes(const struct facet *f, const struct facet *g, double near,
                     struct plane shaft[SHAFT_PLANES])
{
	int n = edge_planes(f, g, near, shaft);

	return n + edge_planes(g, f, near, shaft + n);
}

/* ---- occluders in it ---- */

/* Is all of an occluder on or behind a facet's plane, so that it hides nothing? */
static int behind_facet(const struct occluder_set *s, const struct occluder_shape *b,
                        const struct facet *f)
{
	const double *x = &s->corner[3 * (size_t)b->corner];

	for (uint32_t i = 0; i < b->corners; i++)
		if (v3_dot(f->normal, &x[3 * i]) - f->offset > s->near)
			return 0;
	return 1;
}

/* Is a facet in a solid, or a part of its faces, as a whole? */
static int holds(const struct occluder_set *s, const struct occluder_shape *b,
                 const struct facet *f)
{
	for (uint32_t i = 0; i < b->faces && !b->flat; i++)
		for (int c = 0; c < f->n; c++)
			if (occ_plane_height(&s->face[b->face + i], &f->v[3 * c]) > s->near)
				return 0;
	return !b->flat;
}

static int outside_shaft(const struct shaft *l, const struct occluder_shape *b)
{
	const double *x = &l->set->corner[3 * (size_t)b->corner];

	for (int p = 0; p < l->planes; p++) {
		uint32_t i = 0;
		while (i < b->corners && occ_plane_height(&l->shaft[p], &x[3 * i]) >= -l->set->near)
			i++;
		if (i == b->corners)
			return 1;
	}
	return 0;
}

static int apart(const struct shaft *l, const double lo[3], const double hi[3])
{
	double near = l->set->near;

	for (int k = 0; k < 3; k++)
		if (lo[k] > l->hi[k] - near || hi[k] < l->lo[k] + near) {
			/* A flat box may lie in the shaft's flat box. */
			if (lo[k] > l->hi[k] + near || hi[k] < l->lo[k] - near)
				return 1;
			if (l->hi[k] - l->lo[k] > flat_box * near)
				return 1;
		}
	return 0;
}

/* The highest that a box reaches above a facet's plane. */
static double box_above(const double lo[3], const double hi[3], const struct facet *f)
{
	double h = -f->offset;

	for (int k = 0; k < 3; k++)
		h += f->normal[k] * (f->normal[k] > 0 ? hi[k] : lo[k]);
	return h;
}

/* Is a box beyond one of the shaft's planes? */
static int box_outside(const struct shaft *l, const double lo[3], const double hi[3])
{
	for (int p = 0; p < l->planes; p++) {
		const struct plane *s = &l->shaft[p];
		double h = -s->offset;
		for (int k = 0; k < 3; k++)
			h += s->normal[k] * (s->normal[k] > 0 ? lo[k] : hi[k]);
		if (h >= -l->set->near)
			return 1;
	}
	return 0;
}

/* Occluders that the box and the planes of both facets do not rule out. 0 if there are too
 * many. */
static int collect(struct shaft *l)
{
	const struct occluder_set *s = l->set;
	uint32_t stack[64], depth = 0; /* the tree halves: 33 wait at most */

	if (s->nodes)
		stack[depth++] = 0;
	while (depth) {
		const struct occluder_node *n = &s->node[stack[--depth]];
		if (apart(l, n->lo, n->hi) || box_above(n->lo, n->hi, l->a) <= s->near ||
		    box_above(n->lo, n->hi, l->b) <= s->near || box_outside(l, n->lo, n->hi))
			continue;
		if (n->right) {
			stack[depth++] = n->right;
			stack[depth++] = (uint32_t)(n - s->node) + 1;
			continue;
		}
		for (uint32_t i = n->first; i < n->first + n->count; i++) {
			const struct occluder_shape *b = &s->occluder[i];
			if (apart(l, b->lo, b->hi))
				continue;
			if (!l->planes)
				l->planes = occ_shaft_planes(l->a, l->b, s->near, l->shaft);
			if (box_outside(l, b->lo, b->hi) || behind_facet(s, b, l->a) ||
			    behind_facet(s, b, l->b) || (holds(s, b, l->a) && holds(s, b, l->b)) ||
			    outside_shaft(l, b))
				continue;
			if (l->occluders == l->most)
				return 0;
			l->occluder[l->occluders++] = i;
		}
	}
	return 1;
}

/* Does one of the occluders hide everything? */
static int one_hides(const struct shaft *l)
{
	struct occluder b;

	for (int i = 0; i < l->occluders; i++)
		if (occ_occluder_make(l->set, l->occluder[i], l->b, &b) &&
		    occ_occluder_hides(&b, l->a, l->b, l->set->near))
			return 1;
	return 0;
}

enum shaft_state occ_shaft_cull(struct shaft *l, const struct occluder_set *set,
                                const struct facet *a, const struct facet *b)
{
	l->set = set;
	l->a = a;
	l->b = b;
	l->planes = l->occluders = 0;
	if (!set->nodes)
		return SHAFT_UNOCCLUDED;
	for (int k = 0; k < 3; k++) {
		l->lo[k] = INFINITY;
		l->hi[k] = -INFINITY;
	}
	grow_box(l, a);
	grow_box(l, b);
	int all = collect(l);
	if (one_hides(l))
		return SHAFT_HIDDEN;
	return !all ? SHAFT_CROWDED : l->occluders ? SHAFT_PARTLY : SHAFT_UNOCCLUDED;
}
