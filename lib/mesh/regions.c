/* Regions: pieces of one surface that may share patches. Plane pieces of some size
 * stay by themselves, so that their patches are exactly plane; small facets are
 * joined with neighbours that turn away by less than the normal cone. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/geometry/half_edge.h"
#include "lib/geometry/enclosing_ball.h"
#include "lib/mesh/stages.h"

/* Uses of an edge that are compared with one another, each with so many after it: all would be
 * quadratic. A count; a guess. */
enum { CROWD = 8 };

/* Coplanar neighbours: the cosine of their normals is above the first, 26 degrees, which slivers'
 * normals may be off by, and the height of the smaller one's apex, over its distance, up to the
 * second (and what float32 positions are off by). Guesses. */
static const double coplanar_cosine = .9, coplanar_height = 1e-6;

/* Length of a sum of area vectors over the area, above which it has a direction. A guess. */
static const double has_direction = .1;

/* A plane piece stays by itself if it is wider than the first of these times the patch size, or
 * times that fraction (the second) of the scene's diameter where it is smaller. Guesses. */
static const double large_width = .25, large_in_scene = .1;

struct finder {
	const struct model *m;
	struct half_edges g;
	double *area;         /* [triangles][3] area vectors */
	uint32_t *plane;      /* sets of coplanar neighbours */
	uint32_t *region;     /* sets of neighbours that bend little */
	uint8_t *large;       /* [triangles] of the lowest: the plane piece is large */
	double origin[3];     /* a corner of the scene */
	double noise;         /* what float32 positions may deviate from a plane, m */
	double cos_cone;
};

/* Calls join for the pairs of triangles that share an edge and run along it in
 * opposite ways. */
static void for_neighbours(struct finder *f, void (*join)(struct finder *, uint32_t, uint32_t))
{
	const uint32_t *tri = f->m->triangle.corner;

	for (size_t i = 0; i < f->g.n; i++)
		for (uint32_t u = f->g.start[i]; u < f->g.start[i + 1]; u++)
			for (uint32_t v = u + 1; v < f->g.start[i + 1] && v <= u + CROWD; v++)
				if (geo_half_edge_from(tri, f->g.use[u]) ==
				    geo_half_edge_to(tri, f->g.use[v]))
					join(f, f->g.use[u], f->g.use[v]);
}

static double cosine(const double a[3], const double b[3])
{
	return v3_dot(a, b) / (v3_length(a) * v3_length(b));
}

/* The smaller triangle must lie in the plane of the larger one, whose normal is
 * the surer. */
static void join_coplanar(struct finder *f, uint32_t g, uint32_t h)
{
	const struct model *m = f->m;
	const double *a = &f->area[3 * (size_t)(g / 3)], *b = &f->area[3 * (size_t)(h / 3)];
	double n[3], d[3];

	int swap = v3_dot(a, a) < v3_dot(b, b);
	memcpy(n, swap ? b : a, sizeof n);
	v3_sub(&m->vertex[3 * (size_t)geo_half_edge_apex(m->triangle.corner, swap ? g : h)],
	       &m->vertex[3 * (size_t)geo_half_edge_from(m->triangle.corner, g)], d);
	v3_normalise(n);
	if (cosine(a, b) > coplanar_cosine &&
	    fabs(v3_dot(n, d)) <= coplanar_height * v3_length(d) + f->noise)
		geo_sets_join(f->plane, g / 3, h / 3);
}

static void join_smooth(struct finder *f, uint32_t g, uint32_t h)
{
	if (f->large[geo_sets_find(f->plane, g / 3)] || f->large[geo_sets_find(f->plane, h / 3)])
		return;
	if (cosine(&f->area[3 * (size_t)(g / 3)], &f->area[3 * (size_t)(h / 3)]) >= f->cos_cone)
		geo_sets_join(f->region, g / 3, h / 3);
}

static void triangle_areas(struct finder *f)
{
	const struct model *m = f->m;

	for (size_t t = 0; t < m->triangle.n; t++) {
		const uint32_t *c = &m->triangle.corner[3 * t];
		v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
		        &m->vertex[3 * (size_t)c[2]], &f->area[3 * t]);
	}
}

/* Marks the plane pieces wider than `width`: their area over twice their reach
 * from the centroid. sum: zeroed scratch space [triangles][5]: weighted centroid,
 * area, reach. */
static void mark_large(struct finder *f, double width, double *sum)
{
	const struct model *m = f->m;

	for (uint32_t t = 0; t < m->triangle.n; t++) {
		double *s = &sum[5 * (size_t)geo_sets_find(f->plane, t)];
		double weight = v3_length(&f->area[3 * (size_t)t]) / 3;
		for (size_t k = 0; k < 3; k++)
			v3_mad(s, weight,
			       &m->vertex[3 * (size_t)m->triangle.corner[3 * (size_t)t + k]], s);
		s[3] += 3 * weight;
	}
	for (uint32_t t = 0; t < m->triangle.n; t++) {
		double *s = &sum[5 * (size_t)geo_sets_find(f->plane, t)], d[3];
		for (size_t k = 0; k < 3; k++) {
			v3_mad(&m->vertex[3 * (size_t)m->triangle.corner[3 * (size_t)t + k]],
			       -1 / s[3], s, d);
			s[4] = fmax(s[4], v3_length(d));
		}
	}
	for (size_t t = 0; t < m->triangle.n; t++)
		f->large[t] = sum[5 * t + 3] > 2 * width * sum[5 * t + 4];
}

/* Numbers the sets in order of their lowest triangle. */
static int number_regions(struct finder *f, uint32_t *region, struct region **out,
                          size_t *count, struct err *e)
{
	size_t n = 0;

	for (uint32_t t = 0; t < f->m->triangle.n; t++) {
		uint32_t root = geo_sets_find(f->region, t);
		region[t] = root == t ? (uint32_t)n++ : region[root];
	}
	*out = mem_new(n, sizeof **out, "regions", e);
	*count = n;
	return *out ? 0 : -1;
}

/* The edge a region's frame follows. */
struct guide {
	double length;      /* squared, coarse; 0: none yet */
	uint32_t half;
	uint8_t boundary;
};

/* Does no other use of the edge belong to the region of use u? */
static int on_boundary(const struct finder *f, const uint32_t *region, size_t edge,
                       uint32_t u)
{
	uint32_t begin = f->g.start[edge], end = f->g.start[edge + 1];

	if (end - begin > 2 * CROWD)
		return 0;
	for (uint32_t v = begin; v < end; v++)
		if (v != u && region[f->g.use[v] / 3] == region[f->g.use[u] / 3])
			return 0;
	return 1;
}

/* Longest boundary edge of each region, or longest edge of a closed one; the
 * lowest vertices among equals. */
static void find_guides(const struct finder *f, const uint32_t *region, struct guide *guide)
{
	const struct model *m = f->m;

	for (size_t i = 0; i < f->g.n; i++)
		for (uint32_t u = f->g.start[i]; u < f->g.start[i + 1]; u++) {
			uint32_t h = f->g.use[u];
			struct guide *best = &guide[region[h / 3]], new = { .half = h };
			double d[3];
			v3_sub(&m->vertex[3 * (size_t)geo_half_edge_to(m->triangle.corner, h)],
			       &m->vertex[3 * (size_t)geo_half_edge_from(m->triangle.corner, h)],
			       d);
			new.length = coarse(v3_dot(d, d));
			new.boundary = (uint8_t)on_boundary(f, region, i, u);
			if (new.boundary > best->boundary ||
			    (new.boundary == best->boundary && new.length > best->length))
				*best = new;
		}
}

/* Frame: axis 0 along a half-edge, axis 2 the given unit normal. */
static void frame_along(const struct model *m, uint32_t half, const double normal[3],
                        double axis[3][3])
{
	double *u = axis[0], *n = axis[2];

	memcpy(n, normal, 3 * sizeof *n);
	v3_sub(&m->vertex[3 * (size_t)geo_half_edge_to(m->triangle.corner, half)],
	       &m->vertex[3 * (size_t)geo_half_edge_from(m->triangle.corner, half)], u);
	v3_normalise(u);
	v3_mad(u, -v3_dot(u, n), n, u);
	/* The edge is as good as parallel to the normal: any frame will do. */
	if (v3_normalise(u) < 1e-3)
		v3_frame(n, u, axis[1]);
	v3_cross(n, u, axis[1]);
}

/* A frame to choose from and the box of the region in it. */
struct candidate {
	double axis[3][3], lo[2], hi[2];
};

static void widen(struct candidate *c, const double x[3])
{
	for (int k = 0; k < 2; k++) {
		c->lo[k] = fmin(c->lo[k], v3_dot(x, c->axis[k]));
		c->hi[k] = fmax(c->hi[k], v3_dot(x, c->axis[k]));
	}
}

static double girth(const struct candidate *c)
{
	return coarse(c->hi[0] - c->lo[0] + c->hi[1] - c->lo[1]);
}

/* The frames along the guiding edge and the other two edges of its triangle. The
 * normal is the mean one where the region has one, else that at the edge. */
static void propose(const struct finder *f, uint32_t half, const double sum[4],
                    struct candidate c[3])
{
	const double *own = &f->area[3 * (size_t)(half / 3)];
	double n[3];

	memcpy(n, v3_length(sum) > has_direction * sum[3] ? sum : own, sizeof n);
	v3_normalise(n);
	for (uint32_t k = 0; k < 3; k++) {
		c[k] = (struct candidate){ .lo = { INFINITY, INFINITY },
			                   .hi = { -INFINITY, -INFINITY } };
		frame_along(f->m, half / 3 * 3 + (half + k) % 3, n, c[k].axis);
	}
}

/* Every region gets the proposed frame with the smallest box around it: a
 * rectangle's own, and for its half cut off along the diagonal the same. It turns
 * with the scene. */
static void choose_frames(const struct finder *f, const uint32_t *region,
                          struct candidate *c, struct region *r, size_t count)
{
	const struct model *m = f->m;
	double x[3];

	for (size_t i = 0; i < 3 * m->triangle.n; i++)
		for (size_t k = 0; k < 3; k++) {
			v3_sub(&m->vertex[3 * (size_t)m->triangle.corner[i]], f->origin, x);
			widen(&c[3 * (size_t)region[i / 3] + k], x);
		}
	for (size_t i = 0; i < count; i++) {
		const struct candidate *best = &c[3 * i];
		for (size_t k = 1; k < 3; k++)
			if (girth(&c[3 * i + k]) < girth(best))
				best = &c[3 * i + k];
		memcpy(r[i].axis, best->axis, sizeof r[i].axis);
	}
}

static int set_frames(const struct finder *f, const uint32_t *region, struct region *r,
                      size_t count, struct err *e)
{
	struct guide *guide = mem_new(count, sizeof *guide, "regions", e);
	struct candidate *c = mem_new(count, 3 * sizeof *c, "regions", e);
	double *sum = mem_new(count, 4 * sizeof *sum, "regions", e);
	int status = guide && c && sum ? 0 : -1;

	if (!status) {
		find_guides(f, region, guide);
		for (size_t t = 0; t < f->m->triangle.n; t++) {
			double *s = &sum[4 * (size_t)region[t]];
			v3_mad(s, 1, &f->area[3 * t], s);
			s[3] += v3_length(&f->area[3 * t]);
		}
		for (size_t i = 0; i < count; i++)
			propose(f, guide[i].half, &sum[4 * i], &c[3 * i]);
		choose_frames(f, region, c, r, count);
	}
	free(guide);
	free(c);
	free(sum);
	return status;
}

int mesh_find_regions(const struct model *m, double size, double cos_cone, uint32_t *region,
                      struct region **regions, size_t *count, struct err *e)
{
	int status = -1;
	size_t n = m->triangle.n;
	double lo[3], hi[3], diagonal[3];
	struct finder f = { .m = m, .cos_cone = cos_cone };
	double *sum = mem_new(n, 5 * sizeof *sum, "regions", e);

	f.area = mem_new(n, 3 * sizeof *f.area, "regions", e);
	f.plane = geo_sets_new(n, e);
	f.region = geo_sets_new(n, e);
	f.large = mem_new(n, 1, "regions", e);
	if (!sum || !f.area || !f.plane || !f.region || !f.large ||
	    geo_half_edges_build(&f.g, m->triangle.corner, n, m->vertices, e))
		goto done;
	model_box(m, lo, hi);
	v3_sub(hi, lo, diagonal);
	memcpy(f.origin, lo, sizeof f.origin);
	f.noise = 0x1p-23 * v3_length(diagonal);
	triangle_areas(&f);
	for_neighbours(&f, join_coplanar);
	mark_large(&f, large_width * fmin(size, large_in_scene *
	                                  2 * geo_enclosing_ball(m->vertex, m->vertices).radius), sum);
	memcpy(f.region, f.plane, n * sizeof *f.region);
	for_neighbours(&f, join_smooth);
	if (number_regions(&f, region, regions, count, e))
		goto done;
	status = set_frames(&f, region, *regions, *count, e);
done:
	geo_half_edges_free(&f.g);
	free(sum);
	free(f.area);
	free(f.plane);
	free(f.region);
	free(f.large);
	return status;
}
