#include "lib/occlusion/facet_set.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"

void occ_facet_centre(const struct model *m, double centre[3])
{
	for (int k = 0; k < 3; k++) {
		double lo = INFINITY, hi = -INFINITY;
		for (size_t i = 0; i < 3 * m->triangle.n; i++) {
			double x = m->vertex[3 * (size_t)m->triangle.corner[i] + (size_t)k];
			lo = fmin(lo, x);
			hi = fmax(hi, x);
		}
		centre[k] = m->triangle.n ? lo + (hi - lo) / 2 : 0;
	}
}

/* Counts. Points of all levels take 5 KB for a quadrilateral: of up to so many facets, 150 MB, all
 * are kept; of more only the cheap levels that far pairs need. Guesses. */
enum { KEEP_ALL = 1 << 15, KEEP_OF_MANY = 2 };

/* Sines up to this are no turn of an outline: rounding of float64 vertices far from the origin. */
static const double straight = 1e-9;

/* What is being built. */
struct maker {
	const struct model *m;
	double centre[3];
	struct array facet, corner;
	struct err *e;
};

/* Counts of corners. Of an outline: more are curved, and elements do as well. Of a facet made of
 * it: formulas cost the product of both facets' corners, so large ones are cut; at most
 * FACET_CORNERS. Guesses. */
enum { OUTLINE = 128, AT_ONCE = 8 };

/* Appends a facet of the corners in `loop`, backwards for a back. */
static int put_one(struct maker *k, const uint32_t *loop, int n, int back)
{
	struct facet f = { .n = n };
	double x[3];

	for (int i = 0; i < n; i++) {
		v3_sub(&k->m->vertex[3 * (size_t)loop[back ? n - 1 - i : i]], k->centre, x);
		if (mem_append(&k->corner, x, 3, sizeof *x, k->e))
			return -1;
	}
	return mem_append(&k->facet, &f, 1, sizeof f, k->e);
}

/* The same, cut from its first corner into facets of few corners. */
static int put(struct maker *k, const uint32_t *loop, int n, int back)
{
	for (int i = 1; i + 1 < n; i += AT_ONCE - 2) {
		uint32_t part[AT_ONCE] = { loop[0] };
		int corners = 1;
		for (int j = i; j < n && corners < AT_ONCE; j++)
			part[corners++] = loop[j];
		if (put_one(k, part, corners, back))
			return -1;
	}
	return 0;
}

/* The corners of a patch's outline that are not on a straight run. Their number, or 0 if
 * it is not one convex loop of few corners. */
static int convex_outline(const struct model *m, uint32_t patch, uint32_t *corner)
{
	uint64_t loop = m->patch.loop[patch];
	int n = 0;

	if (m->patch.loop[patch + 1] - loop != 1)
		return 0;
	uint64_t begin = m->patch.loop_start[loop], size = m->patch.loop_start[loop + 1] - begin;
	const double *front = &m->element.normal[3 * (size_t)m->patch.start[patch]];
	for (uint64_t i = 0; i < size; i++) {
		const double *a =
		    &m->vertex[3 * (size_t)m->patch.loop_index[begin + (i + size - 1) % size]];
		const double *b = &m->vertex[3 * (size_t)m->patch.loop_index[begin + i]];
		const double *c =
		    &m->vertex[3 * (size_t)m->patch.loop_index[begin + (i + 1) % size]];
		double u[3], v[3], turn[3];
		v3_sub(b, a, u);
		v3_sub(c, b, v);
		v3_cross(u, v, turn);
		double sine = v3_dot(turn, front) / (v3_length(u) * v3_length(v));
		if (sine < -straight || (sine < straight && v3_dot(u, v) < 0))
			return 0;
		if (sine < straight)
			continue;
		if (n == OUTLINE)
			return 0;
		corner[n++] = m->patch.loop_index[begin + i];
	}
	return n >= 3 ? n : 0;
}

static int put_patch_side(struct maker *k, uint32_t ps)
{
	const struct model *m = k->m;
	uint32_t patch = ps >> 1, corner[OUTLINE];

	if (m->patch.loop[patch + 1] == m->patch.loop[patch] || !model_side_modelled(m, ps))
		return 0;
	int n = convex_outline(m, patch, corner);
	if (n)
		return put(k, corner, n, (int)(ps & 1));
	for (uint32_t i = m->patch.start[patch]; i < m->patch.start[patch + 1]; i++)
		if (put(k, &m->element.corner[3 * (size_t)i], 3, (int)(ps & 1)))
			return -1;
	return 0;
}

static int put_element_side(struct maker *k, uint32_t es)
{
	const struct model *m = k->m;

	if (!model_side_modelled(m, 2 * m->element.patch[es >> 1] + (es & 1)))
		return 0;
	return put(k, &m->element.corner[3 * (size_t)(es >> 1)], 3, (int)(es & 1));
}

/* Keeps the points of all levels, or of the cheap ones where facets are many. */
static int store_points(struct facet_set *s, struct err *e)
{
	int levels = s->facets <= KEEP_ALL ? CUBATURE_LEVELS : KEEP_OF_MANY;
	size_t total = 0;

	for (size_t i = 0; i < s->facets; i++)
		for (int l = 0; l < levels; l++)
			total += (size_t)geo_cubature_points(s->facet[i].n, l);
	s->stored = mem_new(s->facets, sizeof *s->stored, "cubature points", e);
	s->points = mem_new(total, 4 * sizeof *s->points, "cubature points", e);
	s->pair = mem_new(s->facets, sizeof *s->pair, "cubature points", e);
	if (!s->stored || !s->points || !s->pair)
		return -1;
	double *at = s->points;
	for (size_t i = 0; i < s->facets; i++) {
		geo_pair_fill(&s->facet[i], &s->pair[i]);
		for (int l = 0; l < levels; l++) {
			size_t n = (size_t)geo_cubature_points(s->facet[i].n, l);
			s->stored[i][l] =
			    (struct cubature){ 0, at, at + n, at + 2 * n, at + 3 * n };
			geo_cubature_fill(&s->facet[i], l, &s->stored[i][l]);
			at += 4 * n;
		}
	}
	return 0;
}

int occ_facet_set_init(struct facet_set *s, const struct model *m, enum facet_places of,
                       struct err *e)
{
	struct maker k = { .m = m, .e = e };
	size_t places = 2 * (of == FACETS_OF_PATCHES ? m->patch.n : m->element.n), at = 0;

	*s = (struct facet_set){ .places = places };
	occ_facet_centre(m, k.centre);
	s->start = mem_new(places + 1, sizeof *s->start, "facets", e);
	int bad = !s->start;
	for (uint32_t i = 0; !bad && i < places; i++) {
		bad = of == FACETS_OF_PATCHES ? put_patch_side(&k, i) : put_element_side(&k, i);
		s->start[i + 1] = (uint32_t)k.facet.n;
	}
	if (!bad && k.facet.n > UINT32_MAX)
		bad = err_set(e, "too many facets");
	s->facets = k.facet.n;
	s->facet = k.facet.data;
	s->corner = k.corner.data;
	for (size_t i = 0; !bad && i < s->facets; i++) {
		s->facet[i].v = s->corner + at;
		at += 3 * (size_t)s->facet[i].n;
		geo_facet_measure(&s->facet[i]);
	}
	return bad || store_points(s, e) ? -1 : 0;
}

const struct facet *occ_facet_front(const struct facet *f, const struct facet *of, double near,
                                    struct facet_room *room)
{
	double lowest, highest, h = v3_dot(of->normal, f->centre) - of->offset;

	if (h >= f->radius)
		return f;
	if (h <= -f->radius)
		return NULL;
	geo_facet_heights(f, of->normal, of->offset, &lowest, &highest);
	if (highest <= near)
		return NULL;
	if (lowest >= -near)
		return f;
	return geo_facet_clip(f, of->normal, of->offset, room) ? &room->f : NULL;
}

void occ_facet_set_free(struct facet_set *s)
{
	free(s->start);
	free(s->facet);
	free(s->corner);
	free(s->stored);
	free(s->points);
	free(s->pair);
	*s = (struct facet_set){ 0 };
}
