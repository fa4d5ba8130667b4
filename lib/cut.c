/* Cutting triangles along segments: end points are put in, then edges are made to lead
 * along the segments by flipping or halving the edges in the way (Sloan 1993, but cut
 * where a line is in the way); in between, Lawson's flips (1977) towards Delaunay's
 * triangulation keep the pieces in shape. Points closer than `apart` are one, so no
 * piece is thinner than about that. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imprint.h"
#include "vec3.h"

enum { STEPS_MAX = 100000, PASSES_MAX = 64, PIECES_MAX = 1 << 28 };

struct cutter {
	const struct model *m;
	const struct edges *g;
	struct pieces *p;
	double apart;
	uint32_t triangle;    /* being cut, and its frame */
	const double *origin;
	double axis[2][3];
	struct err *e;
};

struct point {
	double x, y;
};

static struct piece *piece_of(const struct cutter *c, uint32_t h)
{
	return (struct piece *)c->p->piece.data + h / 3;
}

static const double *place(const struct cutter *c, uint32_t vertex)
{
	return (const double *)c->p->vertex.data + 3 * (size_t)vertex;
}

static uint32_t from(const struct cutter *c, uint32_t h)
{
	return piece_of(c, h)->v[h % 3];
}

static uint32_t following(uint32_t h)
{
	return h % 3 == 2 ? h - 2 : h + 1;
}

static uint32_t preceding(uint32_t h)
{
	return h % 3 == 0 ? h + 2 : h - 1;
}

/* ---- the plane of the triangle that is being cut ---- */

static void set_triangle(struct cutter *c, uint32_t triangle)
{
	const uint32_t *v = &c->m->triangle[3 * (size_t)triangle];
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

static struct point flat(const struct cutter *c, const double x[3])
{
	double d[3];

	v3_sub(x, c->origin, d);
	return (struct point){ v3_dot(d, c->axis[0]), v3_dot(d, c->axis[1]) };
}

static struct point flat_vertex(const struct cutter *c, uint32_t vertex)
{
	return flat(c, place(c, vertex));
}

static double distance(struct point a, struct point b)
{
	return hypot(b.x - a.x, b.y - a.y);
}

/* Twice the area of a b x: positive if x is on the left of a b. */
static double turn(struct point a, struct point b, struct point x)
{
	return (b.x - a.x) * (x.y - a.y) - (b.y - a.y) * (x.x - a.x);
}

/* How far x is on the left of the line from a to b. */
static double left_of(struct point a, struct point b, struct point x)
{
	return turn(a, b, x) / distance(a, b);
}

/* ---- changes of the pieces ---- */

struct half {
	uint32_t across, rim;
	uint8_t line;
};

static struct half get_half(const struct cutter *c, uint32_t h)
{
	const struct piece *p = piece_of(c, h);

	return (struct half){ p->across[h % 3], p->rim[h % 3], p->line[h % 3] };
}

/* Half-edge h becomes what `s` says, and the one across it knows. */
static void set_half(struct cutter *c, uint32_t h, struct half s)
{
	struct piece *p = piece_of(c, h);

	p->across[h % 3] = s.across;
	p->rim[h % 3] = s.rim;
	p->line[h % 3] = s.line;
	if (s.across != RIM)
		piece_of(c, s.across)->across[s.across % 3] = h;
}

/* Half-edges h and g become the two sides of a new edge. */
static void join_halves(struct cutter *c, uint32_t h, uint32_t g)
{
	set_half(c, h, (struct half){ g, RIM, 0 });
	set_half(c, g, (struct half){ h, RIM, 0 });
}

/* A copy of piece i as a further part of the same triangle: *j = its number. */
static int copy_piece(struct cutter *c, uint32_t i, uint32_t *j)
{
	struct piece new = ((struct piece *)c->p->piece.data)[i];

	*j = (uint32_t)c->p->piece.n;
	if (*j >= PIECES_MAX)
		return err_set(c->e, "more than %d triangles after cutting them where others touch "
		               "them; use --no-imprint", PIECES_MAX);
	if (vec_append(&c->p->piece, &new, 1, sizeof new, c->e))
		return -1;
	((struct piece *)c->p->piece.data)[i].next = *j;
	return 0;
}

static int add_vertex(struct cutter *c, const double x[3], uint32_t *vertex)
{
	double at[3] = { x[0], x[1], x[2] }; /* x may lie in the array that grows */

	*vertex = (uint32_t)c->p->vertex.n;
	return vec_append(&c->p->vertex, at, 1, sizeof at, c->e);
}

/* Halves the piece of h at a vertex on h: h keeps the first half, *second becomes the
 * other. What is across them is left to the caller. */
static int halve_piece(struct cutter *c, uint32_t h, uint32_t vertex, uint32_t *second)
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
static uint32_t find_half(const struct cutter *c, uint32_t triangle, uint32_t a, uint32_t b)
{
	for (uint32_t i = triangle; i != RIM; i = piece_of(c, 3 * i)->next)
		for (uint32_t h = 3 * i; h < 3 * i + 3; h++) {
			uint32_t p = from(c, h), q = from(c, following(h));
			if ((p == a && q == b) || (p == b && q == a))
				return h;
		}
	return RIM;
}

/* Does what `change` says to every half-edge in the place of h, which lies on an edge of
 * the input mesh. */
static int along_rim(struct cutter *c, uint32_t h, uint32_t vertex,
                     int (*change)(struct cutter *, uint32_t, uint32_t))
{
	uint32_t a = from(c, h), b = from(c, following(h)), edge = get_half(c, h).rim;

	for (uint32_t u = c->g->start[edge]; u < c->g->start[edge + 1]; u++) {
		uint32_t other = find_half(c, c->g->use[u] / 3, a, b);
		if (other != RIM && change(c, other, vertex))
			return -1;
	}
	return 0;
}

static int halve_on_rim(struct cutter *c, uint32_t h, uint32_t vertex)
{
	uint32_t second;

	return halve_piece(c, h, vertex, &second);
}

/* Puts a vertex on half-edge h, in every piece that has that edge. */
static int halve_edge(struct cutter *c, uint32_t h, uint32_t vertex)
{
	uint32_t across = get_half(c, h).across, second, other;

	if (across == RIM)
		return along_rim(c, h, vertex, halve_on_rim);
	if (halve_piece(c, h, vertex, &second) || halve_piece(c, across, vertex, &other))
		return -1;
	piece_of(c, h)->across[h % 3] = other;
	piece_of(c, other)->across[other % 3] = h;
	piece_of(c, second)->across[second % 3] = across;
	piece_of(c, across)->across[across % 3] = second;
	return 0;
}

/* Divides piece i at a vertex inside. */
static int halve_face(struct cutter *c, uint32_t i, uint32_t vertex)
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

/* The pieces a b c and b a d on either side of h, which leads from a to b, exchange
 * their common edge for the other diagonal of a d b c: h then leads from c to d. */
static void flip(struct cutter *c, uint32_t h)
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

/* Are the pieces on either side of h a convex quadrilateral, and one that stays two
 * pieces of some height when it is cut along its other diagonal? */
static int may_flip(const struct cutter *c, uint32_t h)
{
	struct half s = get_half(c, h);

	if (s.across == RIM || s.line)
		return 0;
	struct point a = flat_vertex(c, from(c, h)), b = flat_vertex(c, from(c, s.across));
	struct point p = flat_vertex(c, from(c, preceding(h)));
	struct point q = flat_vertex(c, from(c, preceding(s.across)));
	return left_of(p, q, b) > .5 * c->apart && left_of(q, p, a) > .5 * c->apart;
}

/* Cotangent of the angle opposite to h. */
static double cotangent(const struct cutter *c, uint32_t h)
{
	struct point x = flat_vertex(c, from(c, preceding(h)));
	struct point a = flat_vertex(c, from(c, h)), b = flat_vertex(c, from(c, following(h)));

	return ((a.x - x.x) * (b.x - x.x) + (a.y - x.y) * (b.y - x.y)) / turn(x, a, b);
}

/* Flips edges whose opposite angles exceed 180 degrees, by more than rounding. */
static void flip_edges(struct cutter *c)
{
	int changed = 1;

	for (int pass = 0; changed && pass < PASSES_MAX; pass++) {
		changed = 0;
		for (uint32_t i = c->triangle; i != RIM; i = piece_of(c, 3 * i)->next)
			for (uint32_t h = 3 * i; h < 3 * i + 3; h++)
				if (may_flip(c, h) &&
				    cotangent(c, h) + cotangent(c, get_half(c, h).across) < -1e-6) {
					flip(c, h);
					changed = 1;
				}
	}
}

/* ---- points ---- */

/* How deep a point lies in a piece: its distance from the nearest side. */
static double depth(const struct cutter *c, uint32_t i, struct point x, uint32_t *side)
{
	double least = INFINITY;

	for (uint32_t h = 3 * i; h < 3 * i + 3; h++) {
		double d = left_of(flat_vertex(c, from(c, h)), flat_vertex(c, from(c, following(h))), x);
		if (d < least) {
			least = d;
			*side = h;
		}
	}
	return least;
}

/* The piece that holds a point of the triangle: a walk towards it, or, if that does
 * not arrive, the piece in which it lies deepest. */
static uint32_t find_piece(const struct cutter *c, struct point x)
{
	uint32_t i = c->triangle, side = 0, best = i;
	double deepest = -INFINITY;

	for (int step = 0; step < STEPS_MAX; step++) {
		if (depth(c, i, x, &side) >= 0)
			return i;
		uint32_t across = get_half(c, side).across;
		if (across == RIM)
			break;
		i = across / 3;
	}
	for (i = c->triangle; i != RIM; i = piece_of(c, 3 * i)->next) {
		double d = depth(c, i, x, &side);
		if (d > deepest) {
			deepest = d;
			best = i;
		}
	}
	return best;
}

/* The vertex at a point of the triangle: a new one, unless there is one near enough. */
static int put_point(struct cutter *c, const double at[3], uint32_t *vertex)
{
	struct point x = flat(c, at);
	uint32_t i = find_piece(c, x), side = 0;
	double d = depth(c, i, x, &side), foot[3], edge[3];

	if (d > c->apart)
		return add_vertex(c, at, vertex) || halve_face(c, i, *vertex) ? -1 : 0;
	uint32_t ends[2] = { from(c, side), from(c, following(side)) };
	struct point a = flat_vertex(c, ends[0]), b = flat_vertex(c, ends[1]);
	double length = distance(a, b);
	double t = ((x.x - a.x) * (b.x - a.x) + (x.y - a.y) * (b.y - a.y)) / (length * length);
	if (t * length <= c->apart || (1 - t) * length <= c->apart) {
		*vertex = ends[t * 2 > 1];
		return 0;
	}
	v3_sub(place(c, ends[1]), place(c, ends[0]), edge);
	v3_mad(place(c, ends[0]), t, edge, foot);
	return add_vertex(c, foot, vertex) || halve_edge(c, side, *vertex) ? -1 : 0;
}

/* ---- lines ---- */

static int mark(struct cutter *c, uint32_t h, uint32_t unused)
{
	(void)unused;
	piece_of(c, h)->line[h % 3] = 1;
	return 0;
}

static void mark_line(struct cutter *c, uint32_t h)
{
	uint32_t across = get_half(c, h).across;

	if (across == RIM) {
		along_rim(c, h, 0, mark);
	} else {
		mark(c, h, 0);
		mark(c, across, 0);
	}
}

/* Where a line from one vertex to another goes next. */
struct way {
	uint32_t edge;        /* half-edge at the vertex that lies on the line, or RIM */
	uint32_t vertex;      /* its other end */
	double along;         /* how far that is */
	uint32_t crossed;     /* half-edge opposite to the vertex that it crosses, or RIM */
};

/* Looks at the piece in which half-edge h begins at the vertex u. */
static void look(const struct cutter *c, uint32_t h, uint32_t u, uint32_t v, struct way *w)
{
	struct point begin = flat_vertex(c, u), end = flat_vertex(c, v);
	double length = distance(begin, end);
	uint32_t edge[2] = { h, preceding(h) };
	double left[2];

	for (int k = 0; k < 2; k++) {
		uint32_t vertex = k ? from(c, edge[1]) : from(c, following(h));
		struct point x = flat_vertex(c, vertex);
		left[k] = left_of(begin, end, x);
		double along = ((x.x - begin.x) * (end.x - begin.x) +
		                (x.y - begin.y) * (end.y - begin.y)) / length;
		int on = vertex == v || (fabs(left[k]) <= c->apart && along > 0 && along < length);
		if (on && (w->edge == RIM || along < w->along)) {
			w->edge = edge[k];
			w->vertex = vertex;
			w->along = along;
		}
	}
	if (left[0] < 0 && left[1] > 0)
		w->crossed = following(h);
}

/* Looks at all pieces of the triangle about vertex u; h begins there. */
static struct way look_around(const struct cutter *c, uint32_t h, uint32_t u, uint32_t v)
{
	struct way w = { .edge = RIM, .crossed = RIM };
	uint32_t at = h;

	do {
		look(c, at, u, v, &w);
		at = get_half(c, preceding(at)).across;
	} while (at != RIM && at != h);
	while (at != h) {
		uint32_t across = get_half(c, h).across;
		if (across == RIM)
			break;
		h = following(across);
		look(c, h, u, v, &w);
	}
	return w;
}

/* A half-edge of the triangle that begins at a vertex, or RIM. */
static uint32_t find_corner(const struct cutter *c, uint32_t vertex)
{
	uint32_t i = find_piece(c, flat_vertex(c, vertex));

	for (int all = 0; all < 2; all++) {
		for (; i != RIM; i = all ? piece_of(c, 3 * i)->next : RIM)
			for (uint32_t h = 3 * i; h < 3 * i + 3; h++)
				if (from(c, h) == vertex)
					return h;
		i = c->triangle;
	}
	return RIM;
}

/* Halves half-edge h where the line from u to v crosses it. */
static int cross_edge(struct cutter *c, uint32_t h, uint32_t u, uint32_t v)
{
	uint32_t a = from(c, h), b = from(c, following(h)), vertex;
	struct point begin = flat_vertex(c, u), end = flat_vertex(c, v);
	double p = left_of(begin, end, flat_vertex(c, a));
	double q = left_of(begin, end, flat_vertex(c, b)), edge[3], x[3];

	v3_sub(place(c, b), place(c, a), edge);
	v3_mad(place(c, a), p / (p - q), edge, x);
	return add_vertex(c, x, &vertex) || halve_edge(c, h, vertex) ? -1 : 0;
}

/* Makes edges lead from vertex u to vertex v and marks them. */
static int draw_line(struct cutter *c, uint32_t u, uint32_t v)
{
	for (int step = 0; u != v && step < STEPS_MAX; step++) {
		uint32_t h = find_corner(c, u);
		if (h == RIM)
			return 0;
		struct way w = look_around(c, h, u, v);
		if (w.edge != RIM) {
			mark_line(c, w.edge);
			u = w.vertex;
		} else if (w.crossed == RIM || get_half(c, w.crossed).across == RIM) {
			return 0; /* rounding leads out of the triangle, along its rim */
		} else if (may_flip(c, w.crossed)) {
			flip(c, w.crossed);
		} else if (cross_edge(c, w.crossed, u, v)) {
			return -1;
		}
	}
	return 0;
}

/* ---- all of it ---- */

static int cut_triangle(struct cutter *c, const struct contact *contact, size_t n,
                        struct vec *ends)
{
	uint32_t vertex;

	set_triangle(c, contact->triangle);
	ends->n = 0;
	for (size_t i = 0; i < 2 * n; i++)
		if (put_point(c, contact[i / 2].end[i % 2], &vertex) ||
		    vec_append(ends, &vertex, 1, sizeof vertex, c->e))
			return -1;
	flip_edges(c);
	const uint32_t *end = ends->data;
	for (size_t i = 0; i < n; i++)
		if (draw_line(c, end[2 * i], end[2 * i + 1]))
			return -1;
	flip_edges(c);
	return 0;
}

/* The triangles of m as pieces. */
static int begin(struct cutter *c)
{
	const struct model *m = c->m;
	int status = vec_append(&c->p->vertex, m->vertex, m->vertices, 3 * sizeof(double), c->e);

	for (size_t t = 0; !status && t < m->triangles; t++) {
		struct piece p = { .across = { RIM, RIM, RIM }, .triangle = (uint32_t)t,
			           .next = RIM };
		memcpy(p.v, &m->triangle[3 * t], sizeof p.v);
		memcpy(p.rim, &c->g->of[3 * t], sizeof p.rim);
		status = vec_append(&c->p->piece, &p, 1, sizeof p, c->e);
	}
	return status;
}

/* Is the triangle so thin that its own corners are near its sides? */
static int too_thin(const struct model *m, uint32_t triangle, double height)
{
	const uint32_t *v = &m->triangle[3 * (size_t)triangle];
	double area[3];

	v3_area(&m->vertex[3 * (size_t)v[0]], &m->vertex[3 * (size_t)v[1]],
	        &m->vertex[3 * (size_t)v[2]], area);
	return 2 * v3_length(area) <= height * longest_edge(m, triangle);
}

int cut_triangles(const struct model *m, const struct edges *g, const struct contacts *contacts,
                  const struct imprint_limits *limits, struct pieces *p, struct err *e)
{
	struct cutter c = { .m = m, .g = g, .p = p, .apart = limits->apart, .e = e };
	const struct contact *list = contacts->list.data;
	struct vec ends = { 0 };
	size_t n = contacts->list.n;
	int status = begin(&c);

	for (size_t i = 0, next; !status && i < n; i = next) {
		for (next = i + 1; next < n && list[next].triangle == list[i].triangle; next++)
			;
		if (too_thin(m, list[i].triangle, 4 * limits->apart))
			continue;
		status = cut_triangle(&c, &list[i], next - i, &ends);
		p->cut++;
	}
	free(ends.data);
	return status ? -1 : 0;
}
