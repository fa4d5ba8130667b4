#include "lib/occlusion/shadow_edges.h"

#include <math.h>

#include "lib/base/vec.h"
#include "lib/occlusion/occluder_polygons.h"

/* Up to how many occluders it pays to look for where the shadows of two meet, a count:
 * the cells between many are small anyway. A guess. */
enum { FEW = 3 };

/* Two planes are one if the cosine between them is as near to 1: 1e-6 radians. */
static const double same_plane = 1e-12;

/* The same of two edges that are parallel. */
static const double same_direction = 5e-13;

/* ---- cuts ---- */

struct cuts {
	const struct facet *f, *g;
	double near;
	struct shadows *s;
};

/* +1 if corners are all in front of a plane, -1 if behind, 0 if on both sides. */
static int side_of(const struct plane *p, const double *x, int n, double near)
{
	int above = 0, below = 0;

	for (int i = 0; i < n && !(above && below); i++) {
		double h = occ_plane_height(p, x + 3 * i);
		above |= h > near;
		below |= h < -near;
	}
	return above - below;
}

static int occluder_side(const struct occluder *b, const struct plane *p, double near)
{
	return side_of(p, b->corner[0], b->corners, near);
}

static void add(const struct cuts *c, struct shadow_cuts *s, const struct plane *p, uint64_t of)
{
	for (int i = 0; i < s->n; i++)
		if (fabs(fabs(v3_dot(s->cut[i].normal, p->normal)) - 1) < same_plane &&
		    fabs(fabs(s->cut[i].offset) - fabs(p->offset)) < c->near) {
			s->of[i] |= of;
			return;
		}
	if (s->n == SHADOW_CUTS)
		return;
	s->of[s->n] = of;
	s->cut[s->n++] = *p;
}

static void turn_round(struct plane *p)
{
	for (int k = 0; k < 3; k++)
		p->normal[k] = -p->normal[k];
	p->offset = -p->offset;
}

/* A plane through an edge of an occluder and a corner of f or g, or the reverse: where it
 * cuts f, it may end a shadow; where it has the occluder on one side and both facets on the
 * other, the occluder does nothing. `kink`: the edge has a parallel one. */
static void consider(struct cuts *c, const struct occluder *b, int number, struct plane *p,
                     int kink)
{
	struct shadows *s = c->s;
	int of_g = side_of(p, c->g->v, c->g->n, c->near);
	int of_f = of_g || kink ? side_of(p, c->f->v, c->f->n, c->near) : 1;

	if (of_f && of_f != of_g)
		return;
	int of_b = of_g ? occluder_side(b, p, c->near) : 0;
	if (of_f) {
		s->idle |= (uint64_t)(of_b == -of_f) << number;
		return;
	}
	if (kink || (of_g && of_b))
		add(c, &s->edges, p, (uint64_t)1 << number);
	if (!of_g || of_b != -of_g || s->limits == SHADOW_LIMITS)
		return;
	if (of_b < 0)
		turn_round(p);
	s->occluder[s->limits] = number;
	s->limit[s->limits++] = *p;
}

/* The plane through a and x along a unit vector; 0 if they are in line. */
static int plane_through(const double a[3], const double along[3], const double x[3], double near,
                         struct plane *p)
{
	double v[3];

	v3_sub(x, a, v);
	v3_cross(along, v, p->normal);
	double apart = v3_dot(p->normal, p->normal);
	if (!(apart > near * near))
		return 0;
	apart = 1 / sqrt(apart);
	for (int k = 0; k < 3; k++)
		p->normal[k] *= apart;
	p->offset = v3_dot(p->normal, a);
	return 1;
}

/* Of unit vectors. */
static int parallel(const double a[3], const double b[3])
{
	return fabs(v3_dot(a, b)) >= 1 - same_direction;
}

/* Bits of an occluder's faces that a point is surely in front of, and behind. */
struct faces {
	uint64_t front, behind;
};

static struct faces faces_from(const struct occluder *b, const double x[3], double near)
{
	struct faces f = { 0, 0 };

	for (int i = 0; i <= b->faces; i++) {
		double h = occ_plane_height(&b->face[i], x);
		f.front |= (uint64_t)(h > near) << i;
		f.behind |= (uint64_t)(h < -near) << i;
	}
	return f;
}

/* Is an edge inside the occluder's silhouette as seen from a point? So it is, then, for
 * all that see it in line with that point. */
static int within(const struct occluder *b, int edge, struct faces f)
{
	uint64_t both = (uint64_t)1 << b->edge[edge].left | (uint64_t)1 << b->edge[edge].right;

	return !b->flat && ((f.front & both) == both || (f.behind & both) == both);
}

/* Does a face of the occluder have both facets in front of it, or an edge's plane through a
 * corner of f the occluder on one side and them on the other? */
static void find_idle(struct cuts *c, const struct occluder *b, int number)
{
	struct plane p;

	for (int i = 0; i < b->faces; i++) {
		int of_f = side_of(&b->face[i], c->f->v, c->f->n, c->near);
		int of_g = side_of(&b->face[i], c->g->v, c->g->n, c->near);
		if (of_f && of_g == of_f && (b->flat || of_f > 0))
			c->s->idle |= (uint64_t)1 << number;
		else if (!of_f && (b->flat || !of_g))
			add(c, &c->s->edges, &b->face[i], (uint64_t)1 << number);
	}
	for (int j = 0; j < c->f->n; j++) {
		struct faces of_x = faces_from(b, &c->f->v[3 * j], c->near);
		for (int i = 0; i < b->edges && !(c->s->idle >> number & 1); i++)
			if (!within(b, i, of_x) &&
			    plane_through(b->edge[i].a, b->edge[i].along, &c->f->v[3 * j], c->near,
			                  &p) &&
			    side_of(&p, c->f->v, c->f->n, c->near))
				consider(c, b, number, &p, 0);
	}
}

/* The corners of an occluder that are first and last as a plane turns about an edge of g, from
 * its outside to its inside. */
static void first_and_last(const struct cuts *c, const struct occluder *b, int edge,
                           const double along[3], int found[2])
{
	double outwards[3], d[3], first[2] = { -1, 0 }, last[2] = { 1, 0 };

	found[0] = found[1] = 0;
	v3_cross(along, c->g->normal, outwards);
	for (int i = 0; i < b->corners; i++) {
		v3_sub(b->corner[i], &c->g->v[3 * edge], d);
		double x = v3_dot(outwards, d), y = fmax(0, v3_dot(c->g->normal, d));
		if (x * first[1] - y * first[0] > 0 || i == 0) {
			first[0] = x, first[1] = y;
			found[0] = i;
		}
		if (x * last[1] - y * last[0] < 0 || i == 0) {
			last[0] = x, last[1] = y;
			found[1] = i;
		}
	}
}

/* Planes through an edge of g and corners of an occluder that have it on one side. */
static void corner_cuts(struct cuts *c, const struct occluder *b, int number, int edge,
                        const double along[3])
{
	const double *from = &c->g->v[3 * edge];
	int found[2];
	struct plane p;

	first_and_last(c, b, edge, along, found);
	for (int i = 0; i < 2 && !(c->s->idle >> number & 1); i++)
		if (plane_through(from, along, b->corner[found[i]], c->near, &p))
			consider(c, b, number, &p, 0);
}

static void occluder_cuts(struct cuts *c, const struct occluder *b, int number)
{
	const struct facet *g = c->g;
	double along[3];
	struct plane p;

	for (int j = 0; j < g->n && !(c->s->idle >> number & 1); j++) {
		const double *v = &g->v[3 * j], *next = &g->v[3 * ((j + 1) % g->n)];
		struct faces of_x = faces_from(b, v, c->near);
		v3_sub(next, v, along);
		v3_normalise(along);
		for (int i = 0; i < b->edges && !(c->s->idle >> number & 1); i++)
			if (!within(b, i, of_x) &&
			    plane_through(b->edge[i].a, b->edge[i].along, v, c->near, &p))
				consider(c, b, number, &p, parallel(b->edge[i].along, along));
		corner_cuts(c, b, number, j, along);
	}
}

/* Planes through parallel edges of two occluders with one on each side: the gap between them
 * opens there. */
static void gap_cuts(struct cuts *c, const struct occluder *a, const struct occluder *b,
                     uint64_t of)
{
	struct plane p;

	for (int j = 0; j < b->edges; j++) {
		struct faces of_x = faces_from(a, b->edge[j].a, c->near);
		for (int i = 0; i < a->edges; i++)
			if (parallel(a->edge[i].along, b->edge[j].along) && !within(a, i, of_x) &&
			    plane_through(a->edge[i].a, a->edge[i].along, b->edge[j].a, c->near,
			                  &p) &&
			    !side_of(&p, c->f->v, c->f->n, c->near) &&
			    occluder_side(a, &p, c->near) * occluder_side(b, &p, c->near) < 0)
				add(c, &c->s->edges, &p, of);
	}
}

/* Planes through an edge of one occluder and a corner of another with one on each side:
 * their shadows meet there. */
static void meeting_cuts(struct cuts *c, const struct occluder *a, const struct occluder *b,
                         uint64_t of)
{
	struct plane p;

	for (int j = 0; j < b->corners; j++) {
		struct faces of_x = faces_from(a, b->corner[j], c->near);
		for (int i = 0; i < a->edges; i++) {
			if (within(a, i, of_x) ||
			    !plane_through(a->edge[i].a, a->edge[i].along, b->corner[j], c->near,
			                   &p) ||
			    side_of(&p, c->f->v, c->f->n, c->near))
				continue;
			int side = occluder_side(a, &p, c->near);
			side *= side ? occluder_side(b, &p, c->near) : 0;
			if (side < 0)
				add(c, &c->s->edges, &p, of);
		}
	}
}

void occ_shadow_edges(const struct occluder *b, int occluders, const struct facet *f,
                      const struct facet *g, double near, struct shadows *s)
{
	struct cuts c = { f, g, near, s };

	s->edges.n = s->limits = 0;
	s->idle = 0;
	for (int i = 0; i < occluders; i++) {
		find_idle(&c, &b[i], i);
		occluder_cuts(&c, &b[i], i);
	}
	for (int i = 0; i < occluders && s->edges.n < SHADOW_CUTS; i++)
		for (int j = 0; j < i; j++)
			gap_cuts(&c, &b[i], &b[j], (uint64_t)1 << i | (uint64_t)1 << j);
	for (int i = 0; occluders <= FEW && i < occluders; i++)
		for (int j = 0; j < occluders; j++)
			if (j != i)
				meeting_cuts(&c, &b[i], &b[j], (uint64_t)1 << i | (uint64_t)1 << j);
}

/* ---- cells ---- */

uint64_t occ_shadow_on(const struct shadows *s, uint64_t from, const struct facet *cell,
                       double near, uint64_t *crossed)
{
	uint64_t left = from;

	*crossed = 0;
	for (int i = 0; i < s->limits; i++) {
		uint64_t bit = (uint64_t)1 << s->occluder[i];
		if (!(left & bit))
			continue;
		double lowest, highest;
		geo_facet_heights(cell, s->limit[i].normal, s->limit[i].offset, &lowest, &highest);
		if (highest <= near)
			left &= ~bit;
		else if (lowest < -near)
			*crossed |= bit;
	}
	*crossed &= left;
	return left;
}

int occ_shadow_part(const struct shadows *s, int occluder, const struct facet *cell, double near,
                    struct facet_room *part, const struct plane **limit)
{
	double best = 0;

	*limit = NULL;
	part->f = *cell;
	for (int i = 0; i < s->limits; i++) {
		const struct plane *p = &s->limit[i];
		double lowest, highest;
		if (s->occluder[i] != occluder)
			continue;
		geo_facet_heights(cell, p->normal, p->offset, &lowest, &highest);
		if (lowest >= -near)
			continue;
		if (fmin(-lowest, highest) > best * (highest - lowest)) {
			best = fmin(-lowest, highest) / (highest - lowest);
			*limit = p;
		}
		if (!geo_facet_clip(&part->f, p->normal, p->offset, part))
			return 0;
	}
	return 1;
}
