/* Coplanar surfaces: where a surface lies in the plane of another, as a lamp in a ceiling, a
 * carpet on a floor or the bottom of a box, it is on top, and what it covers is dropped: light
 * would meet the one or the other by chance. The smaller surface is the one on top. Imprints
 * have cut the larger one along its outline by then, so that parts are covered as a whole. */
#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/geometry/box_tree.h"
#include "lib/mesh/imprint.h"
#include "lib/mesh/stages.h"
#include "lib/scatter/bsdf.h"

struct search {
	const struct model *m;
	const struct imprint_limits *limits;
	double *area;             /* [surfaces] */
	struct boxes boxes;
	struct array near;        /* uint32_t, triangles about the one looked at */
};

static const double *corner(const struct model *m, size_t triangle, int k)
{
	return &m->vertex[3 * (size_t)m->triangle.corner[3 * triangle + (size_t)k]];
}

static void normal_of(const struct model *m, size_t triangle, double n[3])
{
	v3_area(corner(m, triangle, 0), corner(m, triangle, 1), corner(m, triangle, 2), n);
	v3_normalise(n);
}

static int transmits(const struct materials *mt, size_t material)
{
	for (int side = 0; side < 2; side++)
		for (int b = 0; b < mt->bands; b++) {
			size_t at = model_material_at(mt, material, side) + (size_t)b;
			if (mt->tau_d[at] > 0 || mt->tau_s[at] > 0)
				return 1;
		}
	return 0;
}

/* Does surface a lie on top of surface b, where they share a plane, and let no light through? */
static int on_top(const struct search *s, uint32_t a, uint32_t b)
{
	if (a == b || transmits(&s->m->material, s->m->surface.material[a]))
		return 0;
	return s->area[a] < s->area[b] || (!(s->area[b] < s->area[a]) && a < b);
}

static int in_plane(const struct search *s, uint32_t t, uint32_t other)
{
	double n[3], d[3];

	normal_of(s->m, t, n);
	for (int k = 0; k < 3; k++) {
		v3_sub(corner(s->m, other, k), corner(s->m, t, 0), d);
		if (fabs(v3_dot(n, d)) > s->limits->thick)
			return 0;
	}
	return 1;
}

/* Does triangle t hold x, in its plane, as far as cuts are exact? */
static int holds(const struct search *s, uint32_t t, const double x[3])
{
	double n[3], edge[3], inward[3], d[3];

	normal_of(s->m, t, n);
	for (int k = 0; k < 3; k++) {
		v3_sub(corner(s->m, t, (k + 1) % 3), corner(s->m, t, k), edge);
		v3_cross(n, edge, inward);
		v3_normalise(inward);
		v3_sub(x, corner(s->m, t, k), d);
		if (v3_dot(inward, d) < -s->limits->apart || fabs(v3_dot(n, d)) > s->limits->thick)
			return 0;
	}
	return 1;
}

/* A triangle of this surface near t that holds x, or none (t itself). */
static uint32_t holder(const struct search *s, uint32_t t, uint32_t surface, const double x[3])
{
	const uint32_t *near = s->near.data;

	for (size_t i = 0; i < s->near.n; i++)
		if (s->m->triangle.surface[near[i]] == surface && holds(s, near[i], x) &&
		    in_plane(s, t, near[i]))
			return near[i];
	return t;
}

/* Is t so thin that its neighbours seem to cover it? Its height is less than four times what points
 * of a cut may be apart and still be one: a guess. */
static int thin(const struct search *s, uint32_t t)
{
	double n[3];

	v3_area(corner(s->m, t, 0), corner(s->m, t, 1), corner(s->m, t, 2), n);
	return 2 * v3_length(n) < 4 * s->limits->apart * mesh_longest_edge(s->m, t);
}

/* The triangle at the centre of t of a surface that covers it whole, or none (t itself):
 * points of t just within its corners are looked at. */
static uint32_t cover(const struct search *s, uint32_t t, uint32_t surface)
{
	double centre[3] = { 0 }, x[3];

	for (int k = 0; k < 3; k++)
		v3_mad(centre, 1. / 3, corner(s->m, t, k), centre);
	for (int k = 0; k < 3; k++) {
		v3_sub(centre, corner(s->m, t, k), x);
		/* 1 % of the way to the centre, a guess: past the surface's border. */
		v3_mad(corner(s->m, t, k), 1e-2, x, x);
		if (holder(s, t, surface, x) == t)
			return t;
	}
	return holder(s, t, surface, centre);
}

/* What lies on t and covers it; t itself if nothing does. */
static int find_cover(struct search *s, uint32_t t, uint32_t *found, struct err *e)
{
	uint32_t own = s->m->triangle.surface[t], last = own;

	*found = t;
	s->near.n = 0;
	if (thin(s, t))
		return 0;
	if (geo_boxes_find(&s->boxes, &s->boxes.box[t], s->limits->thick, &s->near, e))
		return -1;
	const uint32_t *near = s->near.data;
	for (size_t i = 0; i < s->near.n && *found == t; i++) {
		uint32_t surface = s->m->triangle.surface[near[i]];
		if (surface == last || !on_top(s, surface, own) || !in_plane(s, t, near[i]))
			continue;
		*found = cover(s, t, surface);
		last = surface;
	}
	return 0;
}

static int prepare(struct search *s, struct err *e)
{
	const struct model *m = s->m;

	s->area = mem_new(m->surface.n, sizeof *s->area, "surfaces", e);
	if (!s->area || geo_boxes_build(&s->boxes, m->vertex, m->triangle.corner, m->triangle.n, e))
		return -1;
	for (size_t t = 0; t < m->triangle.n; t++) {
		double n[3];
		v3_area(corner(m, t, 0), corner(m, t, 1), corner(m, t, 2), n);
		s->area[m->triangle.surface[t]] += v3_length(n);
	}
	return 0;
}

int mesh_drop_covered(struct model *m, const struct imprint_limits *limits,
                      struct mesh_report *r, struct err *e)
{
	struct search s = { .m = m, .limits = limits };
	uint8_t *keep = mem_new(m->triangle.n, 1, "covered triangles", e);
	uint64_t *twin = mem_new(m->triangle.n, sizeof *twin, "covered triangles", e);
	uint32_t *group = NULL, found, merged = r->merged;
	int status = keep && twin ? prepare(&s, e) : -1;

	for (uint32_t t = 0; !status && t < m->triangle.n; t++) {
		if ((status = find_cover(&s, t, &found, e)) != 0)
			break;
		keep[t] = found == t;
		r->covered += !keep[t];
		if (!keep[t])
			mesh_note_twin(m, t, found, twin);
	}
	if (!status && r->covered) {
		status = mesh_merge_coincident_sheets(m, twin, keep, r, e);
		if (!status)
			mesh_clean_compact(m, keep);
		if (!status && r->merged > merged)
			status = mesh_clean_separate(m, &group, e);
	}
	free(s.area);
	free(s.near.data);
	geo_boxes_free(&s.boxes);
	free(keep);
	free(twin);
	free(group);
	return status;
}
