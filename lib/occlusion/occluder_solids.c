#include "lib/occlusion/occluder_solids.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/geometry/half_edge.h"

/* Corners of a solid may be above its faces by so many times the height that counts as none: a face
 * is off by one, a corner by another. */
static const double solid_near = 2;

static int by_points(const void *a, const void *b)
{
	const struct side *x = a, *y = b;

	if (x->low != y->low)
		return x->low < y->low ? -1 : 1;
	if (x->high != y->high)
		return x->high < y->high ? -1 : 1;
	return (x->polygon > y->polygon) - (x->polygon < y->polygon);
}

/* Is the polygon nowhere above a plane, and somewhere well below it? */
static int behind(const struct polygons *p, const struct polygon *q, const struct plane *plane)
{
	double lowest = 0;

	for (uint32_t i = 0; i < q->n; i++) {
		double h = occ_plane_height(plane, occ_polygon_point(p, q->first + i));
		if (h > p->near)
			return 0;
		lowest = fmin(lowest, h);
	}
	return lowest < -p->near;
}

int occ_solids_group(const struct polygons *p, uint32_t *set, struct side **sides, size_t *count,
                     struct err *e)
{
	const struct polygon *poly = p->polygon.data;
	const uint32_t *corner = p->corner.data;
	struct side *side = mem_new(p->corner.n, sizeof *side, "edges of polygons", e);
	size_t n = 0;

	*sides = side;
	*count = p->corner.n;
	if (!side)
		return -1;
	for (uint32_t i = 0; i < p->polygon.n; i++)
		for (uint32_t k = 0; k < poly[i].n; k++) {
			uint32_t a = corner[poly[i].first + k];
			uint32_t b = corner[poly[i].first + (k + 1) % poly[i].n];
			side[n++] = (struct side){ a < b ? a : b, a < b ? b : a, i, a < b };
		}
	qsort(side, n, sizeof *side, by_points);
	for (size_t i = 0, end; i < n; i = end) {
		for (end = i + 1;
		     end < n && side[end].low == side[i].low && side[end].high == side[i].high;)
			end++;
		const struct polygon *a = &poly[side[i].polygon], *b = &poly[side[end - 1].polygon];
		if (end - i == 2 && side[i].up != side[i + 1].up && behind(p, a, &b->plane) &&
		    behind(p, b, &a->plane))
			geo_sets_join(set, side[i].polygon, side[i + 1].polygon);
	}
	return 0;
}

/* Is edge i of a sorted list the only one between its points? */
static int lone(const struct solid *s, size_t i)
{
	const struct side *x = &s->side[i];

	return !(i > 0 && x[-1].low == x->low && x[-1].high == x->high) &&
	       !(i + 1 < s->sides && x[1].low == x->low && x[1].high == x->high);
}

/* The plane through the edges that only one polygon has, facing outwards, and their
 * number. The missing face runs along each of them the other way (Newell's sum). */
static size_t missing_plane(const struct polygons *p, const struct solid *s, struct plane *plane)
{
	const double *origin = NULL;
	size_t n = 0;

	*plane = (struct plane){ 0 };
	for (size_t i = 0; i < s->sides; i++) {
		const struct side *x = &s->side[i];
		const double *a = &p->point[3 * (size_t)(x->up ? x->high : x->low)];
		const double *b = &p->point[3 * (size_t)(x->up ? x->low : x->high)];
		double u[3], v[3], c[3];
		if (!lone(s, i))
			continue;
		origin = origin ? origin : a;
		v3_sub(a, origin, u);
		v3_sub(b, origin, v);
		v3_cross(u, v, c);
		v3_mad(plane->normal, 1, c, plane->normal);
		n++;
	}
	v3_normalise(plane->normal);
	plane->offset = origin ? v3_dot(plane->normal, origin) : 0;
	return n;
}

static int all_behind(const struct polygons *p, const struct solid *s, const struct plane *plane)
{
	const struct polygon *poly = p->polygon.data;

	for (size_t i = 0; i < s->polygons; i++)
		for (uint32_t k = 0; k < poly[s->polygon[i]].n; k++) {
			const double *x = occ_polygon_point(p, poly[s->polygon[i]].first + k);
			if (occ_plane_height(plane, x) > solid_near * p->near)
				return 0;
		}
	return 1;
}

int occ_solid_check(const struct polygons *p, struct solid *s)
{
	const struct polygon *poly = p->polygon.data;
	size_t open = missing_plane(p, s, &s->missing);

	s->closed = open == 0;
	if (s->polygons < 3 || s->polygons + 1 > OCCLUDER_SHAPE_FACES ||
	    s->sides + open > 2 * OCCLUDER_SHAPE_EDGES)
		return 0;
	for (size_t i = 0; i < s->polygons; i++)
		if (!all_behind(p, s, &poly[s->polygon[i]].plane))
			return 0;
	for (size_t i = 0; i < s->sides; i++)
		if (lone(s, i) &&
		    fabs(occ_plane_height(&s->missing, &p->point[3 * (size_t)s->side[i].low])) >
		        solid_near * p->near)
			return 0;
	/* The ends of a tube cancel in the sum. */
	return s->closed || (open >= 3 && v3_dot(s->missing.normal, s->missing.normal) > 0 &&
	                     all_behind(p, s, &s->missing));
}
