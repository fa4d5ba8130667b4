/* Delaunay refinement (Ruppert 1995) of triangles that were cut: pieces that are both
 * longer than an element and too slender get a vertex at the centre of their
 * circumcircle, or, where a line or a side is in the way, that is halved. Nothing shorter
 * than an element, or than a small part of the triangle, is divided, which bounds the
 * number of pieces. */
#include <math.h>

#include "lib/mesh/triangulation.h"

/* Sine of the least angle that is left alone: 20 degrees, below which Ruppert's refinement is sure
 * to end (he proves it to 20.7 degrees). Taken from there, not measured. */
#define LEAST_SINE .342

enum {
	/* Passes over the pieces of a triangle, at most, and pieces that a walk leads through: both
	 * end by themselves, but for rounding. Guesses, far above what is needed. */
	ROUNDS_MAX = 64,
	STEPS_MAX = 10000,
	/* Pieces shorter than the triangle's longest edge over this are left alone: where lines
	 * meet at small angles the refinement goes on to the least size all around. A guess. */
	FINEST = 32
};

static double length(const struct triangulation *c, uint32_t h)
{
	return distance(flat_vertex(c, from(c, h)), flat_vertex(c, from(c, following(h))));
}

/* Is piece i too slender, and worth changing? */
static int is_slender(const struct triangulation *c, uint32_t i, double size)
{
	double edge[3], least, longest;

	for (uint32_t k = 0; k < 3; k++)
		edge[k] = length(c, 3 * i + k);
	least = fmin(edge[0], fmin(edge[1], edge[2]));
	longest = fmax(edge[0], fmax(edge[1], edge[2]));
	double middle = edge[0] + edge[1] + edge[2] - least - longest;
	double area = turn(flat_vertex(c, from(c, 3 * i)), flat_vertex(c, from(c, 3 * i + 1)),
	                   flat_vertex(c, from(c, 3 * i + 2)));
	return longest > size && area < LEAST_SINE * middle * longest;
}

static struct point circumcentre(const struct triangulation *c, uint32_t i)
{
	struct point o = flat_vertex(c, from(c, 3 * i));
	struct point p = flat_vertex(c, from(c, 3 * i + 1));
	struct point q = flat_vertex(c, from(c, 3 * i + 2));
	double d = 2 * turn(o, p, q);

	p = (struct point){ p.x - o.x, p.y - o.y };
	q = (struct point){ q.x - o.x, q.y - o.y };
	double pp = p.x * p.x + p.y * p.y, qq = q.x * q.x + q.y * q.y;
	return (struct point){ o.x + (pp * q.y - qq * p.y) / d, o.y + (qq * p.x - pp * q.x) / d };
}

/* A line, or a side of the triangle that is being cut. */
static int is_border(const struct triangulation *c, uint32_t h)
{
	struct half s = get_half(c, h);

	return s.line || s.across == RIM;
}

/* Goes from piece i towards x. The border in the way, or RIM: then *i holds x. */
static uint32_t walk(const struct triangulation *c, uint32_t *i, struct point x)
{
	for (int step = 0; step < STEPS_MAX; step++) {
		uint32_t beyond = RIM;
		double least = 0;
		for (uint32_t h = 3 * *i; h < 3 * *i + 3; h++) {
			double left = left_of(flat_vertex(c, from(c, h)),
			                      flat_vertex(c, from(c, following(h))), x);
			if (left < least) {
				least = left;
				beyond = h;
			}
		}
		if (beyond == RIM || is_border(c, beyond))
			return beyond;
		*i = get_half(c, beyond).across / 3;
	}
	return RIM;
}

/* The border of piece i in whose diametral circle x lies, or RIM. */
static uint32_t encroached(const struct triangulation *c, uint32_t i, struct point x)
{
	for (uint32_t h = 3 * i; h < 3 * i + 3; h++) {
		struct point a = flat_vertex(c, from(c, h));
		struct point b = flat_vertex(c, from(c, following(h)));
		if (is_border(c, h) && (a.x - x.x) * (b.x - x.x) + (a.y - x.y) * (b.y - x.y) < 0)
			return h;
	}
	return RIM;
}

/* Is x far enough from the sides of piece i? */
static int has_room(const struct triangulation *c, uint32_t i, struct point x)
{
	for (uint32_t h = 3 * i; h < 3 * i + 3; h++)
		if (!(left_of(flat_vertex(c, from(c, h)), flat_vertex(c, from(c, following(h))),
		              x) > c->apart))
			return 0;
	return 1;
}

/* Improves the place of slender piece i: 1 if something was done, 0 if nothing can be, or
 * -1 and c->e. */
static int refine_piece(struct triangulation *c, uint32_t i, double size)
{
	struct point x = circumcentre(c, i);
	uint32_t border = walk(c, &i, x), vertex;
	double at[3];

	if (border == RIM)
		border = encroached(c, i, x);
	if (border != RIM)
		return length(c, border) <= size ? 0 : mesh_halve_middle(c, border) ? -1 : 1;
	if (!has_room(c, i, x))
		return 0;
	v3_mad(c->origin, x.x, c->axis[0], at);
	v3_mad(at, x.y, c->axis[1], at);
	return mesh_add_vertex(c, at, &vertex) || mesh_halve_face(c, i, vertex) ? -1 : 1;
}

int mesh_delaunay_refine(struct triangulation *c, uint32_t triangle, double size)
{
	int changed = 1;

	size = fmax(size, mesh_longest_edge(c->m, triangle) / FINEST);
	mesh_set_triangle(c, triangle);
	for (int round = 0; changed && round < ROUNDS_MAX; round++) {
		changed = 0;
		for (uint32_t i = triangle; i != RIM; i = piece_of(c, 3 * i)->next) {
			int did = is_slender(c, i, size) ? refine_piece(c, i, size) : 0;
			if (did < 0)
				return -1;
			changed |= did;
		}
		mesh_flip_edges(c);
	}
	return 0;
}
