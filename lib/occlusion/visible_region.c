#include "lib/occlusion/visible_region.h"

#include <math.h>

#include "lib/base/vec.h"
#include "lib/occlusion/occluder_polygons.h"

/* Up to how many occluders that hide parts of a polygon what they hide is taken off, and what they
 * hide together added again (2^n - 1 measures); else it is cut up. A count, a guess. Only
 * where the measure is exact. */
enum { OVERLAPS = 3 };

/* Heights are rounded to this, by the size of what is multiplied; what is visible, too. Some
 * fifty roundings of 2e-16. */
static const double rounding = 1e-14;

/* An eye is in front of a face from this part of `near` on: behind it by rounding is not in the
 * solid. A guess. */
static const double in_front_from = 1e-6;

void occ_visible_begin(struct visible_point *s, int occluders, double near)
{
	s->near = near;
	for (int i = 0; i < occluders; i++)
		s->outline[i].front = 0;
}

/* ---- silhouettes ---- */

/* Bits of the faces that the eye is in front of; bit 1 for a flat occluder seen from behind. */
static uint64_t faces_in_front(const struct occluder *b, const double x[3], double near)
{
	uint64_t front = 0;

	if (b->flat) {
		double h = occ_plane_height(&b->face[0], x);
		return h > 0 ? 1 : h < 0 ? 2 : 0;
	}
	for (int i = 0; i < b->faces; i++)
		front |= (uint64_t)(occ_plane_height(&b->face[i], x) > near * in_front_from) << i;
	return front;
}

/* A direction from an edge in which an eye has one of its faces in front of it and the
 * other not. */
static void towards_eye(const struct occluder *b, int edge, uint64_t front, double to[3])
{
	int left = b->edge[edge].left, right = b->edge[edge].right;
	const double *in_front = b->face[front >> left & 1 ? left : right].normal;
	const double *other = b->face[front >> left & 1 ? right : left].normal;

	for (int k = 0; k < 3; k++)
		to[k] = !b->flat ? in_front[k] - other[k] : front & 1 ? in_front[k] : -in_front[k];
}

/* Appends an edge, so that the occluder is inside. */
static void put_edge(struct outline *o, const struct occluder *b, int edge)
{
	double to[3], d[3], across[3], inwards[3];

	towards_eye(b, edge, o->front, to);
	v3_sub(b->edge[edge].b, b->edge[edge].a, d);
	v3_cross(d, to, across);
	v3_sub(b->centre, b->edge[edge].a, inwards);
	double side = v3_dot(across, inwards) < 0 ? -1 : 1;
	for (int k = 0; k < 3; k++) {
		o->a[k][o->edges] = b->edge[edge].a[k];
		o->d[k][o->edges] = side * d[k];
	}
	o->edges++;
}

/* 0 if it has too many edges. */
static int find_outline(struct outline *o, const struct occluder *b, uint64_t front)
{
	o->front = front;
	o->edges = 0;
	for (int i = 0; i < b->edges; i++) {
		int left = b->edge[i].left, right = b->edge[i].right;
		if (!b->flat && (front >> left & 1) == (front >> right & 1))
			continue;
		if (o->edges == OUTLINE_EDGES)
			return 0;
		put_edge(o, b, i);
	}
	/* To the end of the last vector. */
	for (int i = o->edges; i % 4; i++)
		for (int k = 0; k < 3; k++) {
			o->a[k][i] = o->a[k][0];
			o->d[k][i] = o->d[k][0];
		}
	return 1;
}

static void find_planes(const struct outline *o, const double x[3], struct outline_planes *p)
{
	for (int i = 0; i < o->edges; i += 4) {
		four ax = four_load(o->a[0] + i) - x[0], dx = four_load(o->d[0] + i);
		four ay = four_load(o->a[1] + i) - x[1], dy = four_load(o->d[1] + i);
		four az = four_load(o->a[2] + i) - x[2], dz = four_load(o->d[2] + i);
		four_store(p->x + i, ay * dz - az * dy);
		four_store(p->y + i, az * dx - ax * dz);
		four_store(p->z + i, ax * dy - ay * dx);
		four_store(p->size + i, (four_abs(ax) + four_abs(ay) + four_abs(az)) *
		                        (four_abs(dx) + four_abs(dy) + four_abs(dz)));
	}
}

/* The planes of an occluder for the eye in work. -1 if the eye is in it, 0 if it is seen
 * edge-on. */
static int update_planes(struct visible_point *s, int number, const double x[3])
{
	const struct occluder *b = &s->occluder[number];
	struct outline *o = &s->outline[number];
	uint64_t front = faces_in_front(b, x, s->near);

	if (!front)
		return b->flat ? 0 : -1;
	if (front != o->front && !find_outline(o, b, front)) {
		s->full = 1;
		return 0;
	}
	find_planes(o, x, &s->planes[number]);
	return 1;
}

/* ---- what occluders hide ---- */

/* What of a polygon is in front of planes through the eye: bit 0 of a height of one of its
 * corners above `zero`, bit 1 below. */
static int sides_of(const struct point_polygon *p, const double n[3], double zero)
{
	int above = 0, below = 0;

	for (int i = 0; i < p->n; i += 4) {
		four h = n[0] * four_load(p->x + i) + n[1] * four_load(p->y + i) +
		         n[2] * four_load(p->z + i);
		above |= four_bits(h > zero);
		below |= four_bits(h < -zero);
	}
	return (above != 0) | (below != 0) << 1;
}

static void plane_of(const struct visible_point *s, int number, int edge, double n[3], double *zero)
{
	const struct outline_planes *p = &s->planes[number];

	n[0] = p->x[edge], n[1] = p->y[edge], n[2] = p->z[edge];
	*zero = rounding * s->reach * p->size[edge];
}

/* Does an occluder hide nothing of a polygon, as it is all beyond an edge? Else a bit in
 * *across for each edge that cuts it. */
static int apart(const struct visible_point *s, int number, const struct point_polygon *p,
                 uint64_t *across)
{
	*across = 0;
	for (int i = 0; i < s->outline[number].edges; i++) {
		double n[3], zero;
		plane_of(s, number, i, n, &zero);
		int sides = sides_of(p, n, zero);
		if (sides == 2)
			return 1;
		*across |= (uint64_t)(sides == 3) << i;
	}
	return 0;
}

static int cut(struct visible_point *s, int number, uint64_t edges, const struct point_polygon *p,
               struct point_polygon *in, struct point_polygon *away)
{
	double n[3], zero;

	plane_of(s, number, __builtin_ctzll(edges), n, &zero);
	s->full |= p->n >= POINT_POLYGON_CORNERS;
	if (s->full)
		in->n = away->n = 0;
	else
		geo_point_polygon_cut(p, n, zero, in, away);
	return in->n;
}

/* What an occluder hides of a polygon that the edges of set bits cut: of `part`, or NULL. */
static const struct point_polygon *hidden_part(struct visible_point *s, int number, uint64_t edges,
                                               const struct point_polygon *p,
                                               struct point_polygon part[2])
{
	struct point_polygon away;
	int k = 0;

	for (; edges; edges &= edges - 1, p = &part[k], k = !k)
		if (!cut(s, number, edges, p, &part[k], &away))
			return NULL;
	return p;
}

static double visible(struct visible_point *s, const struct point_polygon *p,
                      const uint8_t *occluders, int n);

/* What is visible of a polygon that many occluders hide parts of: what the last one leaves,
 * piece by piece. */
static double piecewise(struct visible_point *s, const struct point_polygon *p, uint64_t edges,
                        const uint8_t *occluders, int n)
{
	struct point_polygon part[2], away;
	double sum = 0;

	for (int k = 0; edges && p->n; edges &= edges - 1, p = &part[k], k = !k) {
		cut(s, occluders[n - 1], edges, p, &part[k], &away);
		if (away.n)
			sum += visible(s, &away, occluders, n - 1);
	}
	return sum;
}

/* The form factor of what the occluders leave of a polygon. */
static double visible(struct visible_point *s, const struct point_polygon *p,
                      const uint8_t *occluders, int n)
{
	uint8_t left[SHAFT_OCCLUDERS];
	uint64_t across[SHAFT_OCCLUDERS];
	struct point_polygon part[2];
	const struct point_polygon *hidden;
	int m = 0;

	for (int i = 0; i < n; i++) {
		if (apart(s, occluders[i], p, &across[m]))
			continue;
		if (!across[m]) {
			s->occluded = 1;
			return 0;
		}
		left[m++] = occluders[i];
	}
	while (m > s->overlaps) {
		if (hidden_part(s, left[m - 1], across[m - 1], p, part)) {
			s->occluded = 1;
			return piecewise(s, p, across[m - 1], left, m);
		}
		m--;
	}
	double whole = s->measure(p, s->arg), sum = whole;
	for (int i = 0; i < m; i++)
		if ((hidden = hidden_part(s, left[i], across[i], p, part))) {
			s->occluded = 1;
			sum -= visible(s, hidden, left, i);
		}
	return sum > rounding * whole ? sum : 0;
}

static double measure_visible(struct visible_point *s, const double x[3], const struct facet *g,
                              uint64_t occluders, struct err *e)
{
	struct point_polygon whole;
	uint8_t list[SHAFT_OCCLUDERS];
	int n = 0;

	s->evaluations++;
	s->full = 0;
	geo_point_polygon_make(&whole, x, g->n, g->v);
	s->reach = 0;
	for (int i = 0; i < whole.n; i++)
		s->reach = fmax(s->reach, fabs(whole.x[i]) + fabs(whole.y[i]) + fabs(whole.z[i]));
	for (uint64_t left = occluders; left; left &= left - 1) {
		int i = __builtin_ctzll(left), known = update_planes(s, i, x);
		if (known < 0) {
			s->occluded = 1;
			return 0;
		}
		if (known)
			list[n++] = (uint8_t)i;
	}
	double sum = visible(s, &whole, list, n);
	if (!s->full)
		return sum;
	err_set(e, "occluders cut a polygon into one of too many corners");
	return NAN;
}

static double factor(const struct point_polygon *p, void *normal)
{
	return geo_point_polygon_factor(p, normal);
}

double occ_visible_exchange(struct visible_point *s, const double x[3], const double normal[3],
                            const struct facet *g, uint64_t occluders, struct err *e)
{
	double n[3] = { normal[0], normal[1], normal[2] };

	s->measure = factor;
	s->arg = n;
	s->overlaps = OVERLAPS;
	return measure_visible(s, x, g, occluders, e);
}

double occ_visible_integrate(struct visible_point *s, const double x[3], const struct facet *g,
                             uint64_t occluders, visible_measure measure, void *arg, struct err *e)
{
	s->measure = measure;
	s->arg = arg;
	s->overlaps = 0;
	return measure_visible(s, x, g, occluders, e);
}
