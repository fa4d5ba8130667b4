#include "lib/mesh/triangulation.h"

#include <math.h>
#include <string.h>

/* Height of the flattest piece that flips make, a fraction of the least distance of points
 * (`apart`): flips stay clear of what rounding turns over. A guess. */
#define FLAT 1e-3

/* Sum of cotangents that an edge must exceed to be flipped: more than their rounding, lest flips
 * go back and forth. A guess. */
static const double flip_slack = 1e-6;

enum {
	/* Passes of flips over the pieces of a triangle, at most: they end by themselves, but for
	 * rounding. A guess, far above what is needed. */
	PASSES_MAX = 64,
	/* Half-edges, three a piece, are numbered by 32 bits: room for five times as many. */
	PIECES_MAX = 1 << 28
};

void mesh_set_triangle(struct triangulation *c, uint32_t triangle)
{
	const uint32_t *v = &c->m->triangle.corner[3 * (size_t)triangle];
	double n[3], d[3];

	c->triangle = triangle;
	c->origin = &c->m->vertex[3 * (size_t)v[0]];
	v3_sub(&c->m->vertex[3 * (size_t)v[1]], c->origin, c->axis[0]);
	v3_sub(&c->m->vertex[3 * (size_t)v[2]], c->origin, d);
	v3_cross(c->axis[0], d, n);
	v3_normalise(c->axis[0]);
	v3_normalise(n);
	v3_cross(n, c->axis[0], c->axis[1]);
}

/* Half-edge h becomes what `s` says, and the one across it knows. */
static void set_half(struct triangulation *c, uint32_t h, struct half s)
{
	struct piece *p = piece_of(c, h);

	p->across[h % 3] = s.across;
	p->rim[h % 3] = s.rim;
	p->line[h % 3] = s.line;
	if (s.across != RIM)
		piece_of(c, s.across)->across[s.across % 3] = h;
}

/* Half-edges h and g become the two sides of a new edge. */
static void join_halves(struct triangulation *c, uint32_t h, uint32_t g)
{
	set_half(c, h, (struct half){ g, RIM, 0 });
	set_half(c, g, (struct half){ h, RIM, 0 });
}

/* A copy of piece i as a further part of the same triangle: *j = its number. */
static int copy_piece(struct triangulation *c, uint32_t i, uint32_t *j)
{
	struct piece new = ((struct piece *)c->p->piece.data)[i];

	*j = (uint32_t)c->p->piece.n;
	if (*j >= PIECES_MAX)
		return err_set(c->e, "more than %d triangles after cutting them where others touch "
		               "them; use --no-imprint", PIECES_MAX);
	if (mem_append(&c->p->piece, &new, 1, sizeof new, c->e))
		return -1;
	((struct piece *)c->p->piece.data)[i].next = *j;
	return 0;
}

int mesh_add_vertex(struct triangulation *c, const double x[3], uint32_t *vertex)
{
	double at[3] = { x[0], x[1], x[2] }; /* x may lie in the array that grows */

	*vertex = (uint32_t)c->p->vertex.n;
	return mem_append(&c->p->vertex, at, 1, sizeof at, c->e);
}

/* Halves the piece of h at a vertex on h: h keeps the first half, *second becomes the
 * other. What is across them is left to the caller. */
static int halve_piece(struct triangulation *c, uint32_t h, uint32_t vertex, uint32_t *second)
{
	uint32_t i = h / 3, j, k = h % 3;

	if (copy_piece(c, i, &j))
		return -1;
	*second = 3 * j + k;
	piece_of(c, *second)->v[k] = vertex;
	piece_of(c, h)->v[(k + 1) % 3] = vertex;
	set_half(c, following(*second), get_half(c, following(h)));
	join_halves(c, following(h), preceding(*second));
	return 0;
}

/* The half-edge between two vertices, either way, of a part of an input triangle. */
static uint32_t find_half(const struct triangulation *c, uint32_t triangle, uint32_t a, uint32_t b)
{
	for (uint32_t i = triangle; i != RIM; i = piece_of(c, 3 * i)->next)
		for (uint32_t h = 3 * i; h < 3 * i + 3; h++) {
			uint32_t p = from(c, h), q = from(c, following(h));
			if ((p == a && q == b) || (p == b && q == a))
				return h;
		}
	return RIM;
}

int mesh_along_rim(struct triangulation *c, uint32_t h, uint32_t vertex,
                   int (*change)(struct triangulation *, uint32_t, uint32_t))
{
	uint32_t a = from(c, h), b = from(c, following(h)), edge = get_half(c, h).rim;

	for (uint32_t u = c->g->start[edge]; u < c->g->start[edge + 1]; u++) {
		uint32_t other = find_half(c, c->g->use[u] / 3, a, b);
		if (other != RIM && change(c, other, vertex))
			return -1;
	}
	return 0;
}

static int halve_on_rim(struct triangulation *c, uint32_t h, uint32_t vertex)
{
	uint32_t second;

	return halve_piece(c, h, vertex, &second);
}

int mesh_halve_edge(struct triangulation *c, uint32_t h, uint32_t vertex)
{
	uint32_t across = get_half(c, h).across, second, other;

	if (across == RIM)
		return mesh_along_rim(c, h, vertex, halve_on_rim);
	if (halve_piece(c, h, vertex, &second) || halve_piece(c, across, vertex, &other))
		return -1;
	piece_of(c, h)->across[h % 3] = other;
	piece_of(c, other)->across[other % 3] = h;
	piece_of(c, second)->across[second % 3] = across;
	piece_of(c, across)->across[across % 3] = second;
	return 0;
}

int mesh_halve_middle(struct triangulation *c, uint32_t h)
{
	double middle[3], edge[3];
	uint32_t vertex;

	v3_sub(place(c, from(c, following(h))), place(c, from(c, h)), edge);
	v3_mad(place(c, from(c, h)), .5, edge, middle);
	return mesh_add_vertex(c, middle, &vertex) || mesh_halve_edge(c, h, vertex) ? -1 : 0;
}

int mesh_halve_face(struct triangulation *c, uint32_t i, uint32_t vertex)
{
	uint32_t j, l;

	if (copy_piece(c, i, &j) || copy_piece(c, i, &l))
		return -1;
	piece_of(c, 3 * i)->v[2] = vertex;
	piece_of(c, 3 * j)->v[0] = vertex;
	piece_of(c, 3 * l)->v[1] = vertex;
	set_half(c, 3 * j + 1, get_half(c, 3 * i + 1));
	set_half(c, 3 * l + 2, get_half(c, 3 * i + 2));
	join_halves(c, 3 * i + 1, 3 * j);
	join_halves(c, 3 * i + 2, 3 * l);
	join_halves(c, 3 * j + 2, 3 * l + 1);
	return 0;
}

void mesh_flip_edge(struct triangulation *c, uint32_t h)
{
	uint32_t g = get_half(c, h).across;
	uint32_t h1 = following(h), h2 = preceding(h), g1 = following(g), g2 = preceding(g);
	uint32_t corner[4] = { from(c, h), from(c, g), from(c, h2), from(c, g2) };
	struct half b_c = get_half(c, h1), c_a = get_half(c, h2);
	struct half a_d = get_half(c, g1), d_b = get_half(c, g2);

	piece_of(c, h)->v[h % 3] = piece_of(c, g)->v[g1 % 3] = corner[2];
	piece_of(c, g)->v[g % 3] = piece_of(c, h)->v[h1 % 3] = corner[3];
	piece_of(c, h)->v[h2 % 3] = corner[1];
	piece_of(c, g)->v[g2 % 3] = corner[0];
	set_half(c, h1, d_b);
	set_half(c, h2, b_c);
	set_half(c, g1, c_a);
	set_half(c, g2, a_d);
}

int mesh_may_flip(const struct triangulation *c, uint32_t h)
{
	struct half s = get_half(c, h);

	if (s.across == RIM || s.line)
		return 0;
	struct point a = flat_vertex(c, from(c, h)), b = flat_vertex(c, from(c, s.across));
	struct point p = flat_vertex(c, from(c, preceding(h)));
	struct point q = flat_vertex(c, from(c, preceding(s.across)));
	return left_of(p, q, b) > FLAT * c->apart && left_of(q, p, a) > FLAT * c->apart;
}

/* Cotangent of the angle opposite to h. */
static double cotangent(const struct triangulation *c, uint32_t h)
{
	struct point x = flat_vertex(c, from(c, preceding(h)));
	struct point a = flat_vertex(c, from(c, h)), b = flat_vertex(c, from(c, following(h)));

	return ((a.x - x.x) * (b.x - x.x) + (a.y - x.y) * (b.y - x.y)) / turn(x, a, b);
}

void mesh_flip_edges(struct triangulation *c)
{
	int changed = 1;

	for (int pass = 0; changed && pass < PASSES_MAX; pass++) {
		changed = 0;
		for (uint32_t i = c->triangle; i != RIM; i = piece_of(c, 3 * i)->next)
			for (uint32_t h = 3 * i; h < 3 * i + 3; h++)
				if (mesh_may_flip(c, h) &&
				    cotangent(c, h) + cotangent(c, get_half(c, h).across) <
				    -flip_slack) {
					mesh_flip_edge(c, h);
					changed = 1;
				}
	}
}
