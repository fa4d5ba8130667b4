#include "lib/occlusion/occluder_inside.h"

#include <math.h>
#include <string.h>

#include "lib/geometry/facet.h"

/* What of the scene is inside a solid. */
struct inside {
	const struct polygons *p;
	const struct solid *s;
	struct plane face[OCCLUDER_SHAPE_FACES];
	int faces;
	double lo[3], hi[3];
	uint32_t found[INSIDERS];
	int n, crossing;
};

static void find_box(struct inside *in)
{
	const struct polygon *poly = in->p->polygon.data;

	for (int k = 0; k < 3; k++) {
		in->lo[k] = INFINITY;
		in->hi[k] = -INFINITY;
	}
	for (size_t i = 0; i < in->s->polygons; i++) {
		const struct polygon *q = &poly[in->s->polygon[i]];
		in->face[in->faces++] = q->plane;
		for (uint32_t c = 0; c < q->n; c++)
			for (int k = 0; k < 3; k++) {
				double x = occ_polygon_point(in->p, q->first + c)[k];
				in->lo[k] = fmin(in->lo[k], x);
				in->hi[k] = fmax(in->hi[k], x);
			}
	}
	if (!in->s->closed)
		in->face[in->faces++] = in->s->missing;
}

static int box_apart(const struct inside *in, const struct polygon *q)
{
	double near = in->p->near;

	for (int k = 0; k < 3; k++) {
		int below = 1, above = 1;
		for (uint32_t c = 0; c < q->n && (below || above); c++) {
			double x = occ_polygon_point(in->p, q->first + c)[k];
			below = below && x <= in->lo[k] + near;
			above = above && x >= in->hi[k] - near;
		}
		if (below || above)
			return 1;
	}
	return 0;
}

/* The corners of a polygon that are left behind a plane, in place. */
static int clip(double (*v)[3], int n, const struct plane *p, double near)
{
	double kept[FLAT_CORNERS + OCCLUDER_SHAPE_FACES][3];
	int m = 0;

	for (int i = 0; i < n; i++) {
		const double *a = v[i], *b = v[(i + 1) % n];
		double ha = occ_plane_height(p, a) + near, hb = occ_plane_height(p, b) + near;
		if (ha <= 0 && m < FLAT_CORNERS + OCCLUDER_SHAPE_FACES)
			memcpy(kept[m++], a, sizeof *kept);
		if (((ha < 0 && hb > 0) || (ha > 0 && hb < 0)) &&
		    m < FLAT_CORNERS + OCCLUDER_SHAPE_FACES)
			geo_edge_divide(a, ha, b, hb, kept[m++]);
	}
	memcpy(v, kept, (size_t)m * sizeof *kept);
	return m;
}

/* 0: a polygon has no part in the interior, 1: some, 2: all of it is in the solid. */
static int part_inside(const struct inside *in, const struct polygon *q)
{
	double v[FLAT_CORNERS + OCCLUDER_SHAPE_FACES][3], near = in->p->near;
	int n = (int)q->n, whole = 1;

	for (int i = 0; i < n; i++)
		memcpy(v[i], occ_polygon_point(in->p, q->first + (uint32_t)i), sizeof v[i]);
	for (int f = 0; f < in->faces; f++)
		for (int i = 0; i < n && whole; i++)
			whole = occ_plane_height(&in->face[f], v[i]) <= near;
	for (int f = 0; f < in->faces && n >= 3; f++)
		n = clip(v, n, &in->face[f], near);
	return n < 3 ? 0 : 1 + whole;
}

static int find_insiders(struct inside *in, const uint32_t *set)
{
	const struct polygon *poly = in->p->polygon.data;
	uint32_t own = set[in->s->polygon[0]];

	for (uint32_t i = 0; i < in->p->polygon.n; i++) {
		int part = set[i] == own || box_apart(in, &poly[i]) ? 0 : part_inside(in, &poly[i]);
		if (!part)
			continue;
		if (in->n == INSIDERS)
			return 0;
		in->found[in->n++] = i;
		in->crossing |= part == 1;
	}
	return 1;
}

/* Corners of b over the plane of a: bit 0: some above, bit 1: some below. */
static int sides(const struct polygons *p, const struct polygon *a, const struct polygon *b)
{
	int bits = 0;

	for (uint32_t i = 0; i < b->n; i++) {
		double h = occ_plane_height(&a->plane, occ_polygon_point(p, b->first + i));
		bits |= h > p->near ? 1 : h < -p->near ? 2 : 0;
	}
	return bits;
}

/* Does no modelled side of a see one of b? */
static int blind(const struct polygons *p, const struct polygon *a, const struct polygon *b)
{
	int ab = sides(p, a, b), ba = sides(p, b, a);

	return a->two_sided || b->two_sided ? !ab && !ba : !(ab & 1) || !(ba & 1);
}

static int all_blind(const struct inside *in)
{
	const struct polygon *poly = in->p->polygon.data;

	for (int i = 0; i < in->n; i++)
		for (int j = 0; j < i; j++)
			if (!blind(in->p, &poly[in->found[i]], &poly[in->found[j]]))
				return 0;
	return 1;
}

int occ_solid_is_opaque(const struct polygons *p, const struct solid *s, const uint32_t *set)
{
	const struct polygon *poly = p->polygon.data;
	struct inside in = { .p = p, .s = s };
	int two_sided = 0;

	for (size_t i = 0; i < s->polygons; i++)
		two_sided |= poly[s->polygon[i]].two_sided;
	if (two_sided && !s->closed)
		return 0;
	find_box(&in);
	if (!find_insiders(&in, set))
		return 0;
	if (!s->closed)
		return in.n == 0;
	return !in.crossing || (!two_sided && all_blind(&in));
}
