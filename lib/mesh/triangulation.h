/* Pieces of triangles and the ways to change them, for constrain_edges.c. */
#ifndef TWOPASS_TRIANGULATION_H
#define TWOPASS_TRIANGULATION_H

#include <math.h>

#include "lib/base/vec.h"
#include "lib/mesh/imprint.h"

struct triangulation {
	const struct model *m;
	const struct half_edges *g;
	struct pieces *p;
	double apart;
	uint32_t triangle;    /* being cut, and its frame */
	const double *origin;
	double axis[2][3];
	struct array crossed; /* half-edges in the way of a line */
	struct err *e;
};

/* In the frame of the triangle that is being cut. */
struct point {
	double x, y;
};

/* A side of a piece: the members of struct piece of these names. */
struct half {
	uint32_t across, rim;
	uint8_t line;
};

static inline struct piece *piece_of(const struct triangulation *c, uint32_t h)
{
	return (struct piece *)c->p->piece.data + h / 3;
}

static inline const double *place(const struct triangulation *c, uint32_t vertex)
{
	return (const double *)c->p->vertex.data + 3 * (size_t)vertex;
}

static inline uint32_t from(const struct triangulation *c, uint32_t h)
{
	return piece_of(c, h)->v[h % 3];
}

static inline uint32_t following(uint32_t h)
{
	return h % 3 == 2 ? h - 2 : h + 1;
}

static inline uint32_t preceding(uint32_t h)
{
	return h % 3 == 0 ? h + 2 : h - 1;
}

static inline struct half get_half(const struct triangulation *c, uint32_t h)
{
	const struct piece *p = piece_of(c, h);

	return (struct half){ p->across[h % 3], p->rim[h % 3], p->line[h % 3] };
}

/* Makes a triangle of m the one that is being cut. */
void mesh_set_triangle(struct triangulation *c, uint32_t triangle);

static inline struct point flat(const struct triangulation *c, const double x[3])
{
	double d[3];

	v3_sub(x, c->origin, d);
	return (struct point){ v3_dot(d, c->axis[0]), v3_dot(d, c->axis[1]) };
}

static inline struct point flat_vertex(const struct triangulation *c, uint32_t vertex)
{
	return flat(c, place(c, vertex));
}

static inline double distance(struct point a, struct point b)
{
	return hypot(b.x - a.x, b.y - a.y);
}

/* Twice the area of a b x: positive if x is on the left of a b. */
static inline double turn(struct point a, struct point b, struct point x)
{
	return (b.x - a.x) * (x.y - a.y) - (b.y - a.y) * (x.x - a.x);
}

/* How far x is on the left of the line from a to b. */
static inline double left_of(struct point a, struct point b, struct point x)
{
	return turn(a, b, x) / distance(a, b);
}

/* The functions below return 0, or -1 and c->e. */

int mesh_add_vertex(struct triangulation *c, const double x[3], uint32_t *vertex);

/* Does what `change` says to every half-edge in the place of h, which lies on an edge of
 * the input mesh. */
int mesh_along_rim(struct triangulation *c, uint32_t h, uint32_t vertex,
                   int (*change)(struct triangulation *, uint32_t, uint32_t));

/* Puts a vertex on half-edge h, in every piece that has that edge. h keeps its begin. */
int mesh_halve_edge(struct triangulation *c, uint32_t h, uint32_t vertex);

/* Halves an edge in the middle. */
int mesh_halve_middle(struct triangulation *c, uint32_t h);

/* Divides piece i into three at a vertex inside. */
int mesh_halve_face(struct triangulation *c, uint32_t i, uint32_t vertex);

/* Are the pieces on either side of h a convex quadrilateral, and one that stays two
 * pieces of some height when it is cut along its other diagonal? */
int mesh_may_flip(const struct triangulation *c, uint32_t h);

/* The pieces a b c and b a d on either side of h, which leads from a to b, exchange
 * their common edge for the other diagonal of a d b c: h then leads from c to d. */
void mesh_flip_edge(struct triangulation *c, uint32_t h);

/* Flips edges of the triangle whose opposite angles exceed 180 degrees, by more than
 * rounding. */
void mesh_flip_edges(struct triangulation *c);

/* delaunay_refine.c: divides pieces of a triangle that are longer than `size`, and than 1/32 of the
 * triangle, until they have no angle below 20 degrees, where lines leave room for that. The
 * triangle's pieces must be as mesh_flip_edges leaves them. */
int mesh_delaunay_refine(struct triangulation *c, uint32_t triangle, double size);

#endif
