/* Cutting triangles along segments: end points are put in, then edges are made to lead
 * along the segments by flipping the edges in the way (Sloan 1993), or halving them where
 * they are lines themselves; in between, Lawson's flips (1977) towards Delaunay's
 * triangulation keep the pieces in shape. Points closer than `apart` are one, so no
 * piece is much thinner than that. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/mesh/triangulation.h"

/* Steps along a line or about a vertex, at most: they end by themselves, but for rounding. A guess,
 * far above what is needed. */
enum { STEPS_MAX = 100000 };

/* A triangle lower than so many times `apart` is not cut: points that are not one would have no
 * room in it. A guess. */
enum { LEAST_HEIGHT = 4 };

/* What rounding may leave between two points in line, a fraction of `apart`. A guess. */
static const double nearer = 1e-3;

/* ---- points ---- */

/* How deep a point lies in a piece: its distance from the nearest side. */
static double depth(const struct triangulation *c, uint32_t i, struct point x, uint32_t *side)
{
	double least = INFINITY;

	for (uint32_t h = 3 * i; h < 3 * i + 3; h++) {
		double d = left_of(flat_vertex(c, from(c, h)),
		                   flat_vertex(c, from(c, following(h))), x);
		if (d < least) {
			least = d;
			*side = h;
		}
	}
	return least;
}

/* The piece that holds a point of the triangle: a walk towards it, or, if that does
 * not arrive, the piece in which it lies deepest. */
static uint32_t find_piece(const struct triangulation *c, struct point x)
{
	uint32_t i = c->triangle, side = 0, best = i;
	double deepest = -INFINITY;

	for (int step = 0; step < STEPS_MAX; step++) {
		double d = depth(c, i, x, &side);
		uint32_t across = get_half(c, side).across;
		if (d >= 0 || (across == RIM && d >= -c->apart))
			return i;
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
static int put_point(struct triangulation *c, const double at[3], uint32_t *vertex)
{
	struct point x = flat(c, at);
	uint32_t i = find_piece(c, x), side = 0;
	double d = depth(c, i, x, &side), foot[3], edge[3];

	if (d > c->apart)
		return mesh_add_vertex(c, at, vertex) || mesh_halve_face(c, i, *vertex) ? -1 : 0;
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
	return mesh_add_vertex(c, foot, vertex) || mesh_halve_edge(c, side, *vertex) ? -1 : 0;
}

/* ---- lines ---- */

static int mark(struct triangulation *c, uint32_t h, uint32_t unused)
{
	(void)unused;
	piece_of(c, h)->line[h % 3] = 1;
	return 0;
}

static void mark_line(struct triangulation *c, uint32_t h)
{
	uint32_t across = get_half(c, h).across;

	if (across == RIM) {
		mesh_along_rim(c, h, 0, mark);
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
static void look(const struct triangulation *c, uint32_t h, uint32_t u, uint32_t v, struct way *w)
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
		/* Nearer to the end by more than rounding, lest two vertices on either side
		 * of the line lead to each other. */
		int on = vertex == v || (fabs(left[k]) <= c->apart && along > 0 &&
		                         distance(x, end) < length - nearer * c->apart);
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
static struct way look_around(const struct triangulation *c, uint32_t h, uint32_t u, uint32_t v)
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
static uint32_t find_corner(const struct triangulation *c, uint32_t vertex)
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
static int cross_edge(struct triangulation *c, uint32_t h, uint32_t u, uint32_t v)
{
	uint32_t a = from(c, h), b = from(c, following(h)), vertex;
	struct point begin = flat_vertex(c, u), end = flat_vertex(c, v);
	double p = left_of(begin, end, flat_vertex(c, a));
	double q = left_of(begin, end, flat_vertex(c, b)), edge[3], x[3];

	v3_sub(place(c, b), place(c, a), edge);
	v3_mad(place(c, a), p / (p - q), edge, x);
	return mesh_add_vertex(c, x, &vertex) || mesh_halve_edge(c, h, vertex) ? -1 : 0;
}

/* Collects in c->crossed the half-edges that the line from u to v crosses, from the
 * first one on, up to a vertex on the line. *blocked = the one among them that must not
 * be flipped away, a line or a side of the triangle, or RIM. */
static int walk_line(struct triangulation *c, uint32_t h, uint32_t u, uint32_t v, uint32_t *blocked)
{
	struct point begin = flat_vertex(c, u), end = flat_vertex(c, v);

	c->crossed.n = 0;
	*blocked = RIM;
	for (int step = 0; step < STEPS_MAX; step++) {
		struct half s = get_half(c, h);
		if (s.line || s.across == RIM) {
			*blocked = h;
			return 0;
		}
		if (mem_append(&c->crossed, &h, 1, sizeof h, c->e))
			return -1;
		uint32_t apex = from(c, preceding(s.across));
		double left = left_of(begin, end, flat_vertex(c, apex));
		if (apex == v || fabs(left) <= c->apart)
			return 0;
		h = left > 0 ? following(s.across) : preceding(s.across);
	}
	return 0;
}

/* The crossed half-edge to flip next: one at the vertex that is furthest from the line.
 * That takes all of them out of the way in the end (Osherovich and Bruckstein 2008). */
static uint32_t choose_flip(const struct triangulation *c, uint32_t u, uint32_t v)
{
	struct point begin = flat_vertex(c, u), end = flat_vertex(c, v);
	const uint32_t *h = c->crossed.data;
	uint32_t best = RIM;
	double furthest = 0;

	for (size_t i = 0; i < c->crossed.n; i++) {
		double a = fabs(left_of(begin, end, flat_vertex(c, from(c, h[i]))));
		double b = fabs(left_of(begin, end, flat_vertex(c, from(c, following(h[i])))));
		if (fmax(a, b) > furthest && mesh_may_flip(c, h[i])) {
			furthest = fmax(a, b);
			best = h[i];
		}
	}
	return best;
}

/* Makes edges lead from vertex u to vertex v and marks them. */
static int draw_line(struct triangulation *c, uint32_t u, uint32_t v)
{
	for (int step = 0; u != v && step < STEPS_MAX; step++) {
		uint32_t h = find_corner(c, u), blocked;
		if (h == RIM)
			return 0;
		struct way w = look_around(c, h, u, v);
		if (w.edge != RIM) {
			mark_line(c, w.edge);
			u = w.vertex;
			continue;
		}
		if (w.crossed == RIM)
			return 0;
		if (walk_line(c, w.crossed, u, v, &blocked))
			return -1;
		if (blocked != RIM && get_half(c, blocked).across == RIM)
			return 0; /* rounding leads out of the triangle, along its side */
		h = blocked == RIM ? choose_flip(c, u, v) : RIM;
		if (h != RIM)
			mesh_flip_edge(c, h);
		else if (cross_edge(c, blocked != RIM ? blocked : w.crossed, u, v))
			return -1;
	}
	return 0;
}

/* ---- all of it ---- */

static int cut_triangle(struct triangulation *c, const struct contact *contact, size_t n,
                        struct array *ends)
{
	uint32_t vertex;

	mesh_set_triangle(c, contact->triangle);
	ends->n = 0;
	for (size_t i = 0; i < 2 * n; i++)
		if (put_point(c, contact[i / 2].end[i % 2], &vertex) ||
		    mem_append(ends, &vertex, 1, sizeof vertex, c->e))
			return -1;
	mesh_flip_edges(c);
	const uint32_t *end = ends->data;
	for (size_t i = 0; i < n; i++)
		if (draw_line(c, end[2 * i], end[2 * i + 1]))
			return -1;
	mesh_flip_edges(c);
	return 0;
}

/* The triangles of m as pieces. */
static int begin(struct triangulation *c)
{
	const struct model *m = c->m;
	int status = mem_append(&c->p->vertex, m->vertex, m->vertices, 3 * sizeof(double), c->e);

	for (size_t t = 0; !status && t < m->triangle.n; t++) {
		struct piece p = { .across = { RIM, RIM, RIM }, .triangle = (uint32_t)t,
			           .next = RIM };
		memcpy(p.v, &m->triangle.corner[3 * t], sizeof p.v);
		memcpy(p.rim, &c->g->of[3 * t], sizeof p.rim);
		status = mem_append(&c->p->piece, &p, 1, sizeof p, c->e);
	}
	return status;
}

/* How many half-edges lie in the place of h. */
static uint32_t halves_at(const struct triangulation *c, uint32_t h)
{
	uint32_t edge = get_half(c, h).rim;

	return get_half(c, h).across != RIM ? 2 : c->g->start[edge + 1] - c->g->start[edge];
}

/* Halves lines of a single edge, whose ends are no place to part the surface at. */
static int halve_short_lines(struct triangulation *c)
{
	size_t halves = 3 * c->p->piece.n, vertices = c->p->vertex.n;
	uint32_t *at = mem_new(vertices, sizeof *at, "lines", c->e);
	int status = at ? 0 : -1;

	for (uint32_t h = 0; at && h < halves; h++)
		if (get_half(c, h).line) {
			at[from(c, h)]++;
			at[from(c, following(h))]++;
		}
	for (uint32_t h = 0; !status && h < halves; h++) {
		uint32_t n = halves_at(c, h), a = from(c, h), b = from(c, following(h));
		if (get_half(c, h).line && b < vertices && at[a] == n && at[b] == n) {
			at[a] = at[b] = 0; /* so that the halves across h are passed over */
			status = mesh_halve_middle(c, h);
		}
	}
	free(at);
	return status;
}

/* Is the triangle so thin that its own corners are near its sides? */
static int too_thin(const struct model *m, uint32_t triangle, double height)
{
	const uint32_t *v = &m->triangle.corner[3 * (size_t)triangle];
	double area[3];

	v3_area(&m->vertex[3 * (size_t)v[0]], &m->vertex[3 * (size_t)v[1]],
	        &m->vertex[3 * (size_t)v[2]], area);
	return 2 * v3_length(area) <= height * mesh_longest_edge(m, triangle);
}

int mesh_constrain_edges(const struct model *m, const struct half_edges *g,
                         const struct contacts *contacts,
                         const struct imprint_limits *limits, struct pieces *p, struct err *e)
{
	struct triangulation c = { .m = m, .g = g, .p = p, .apart = limits->apart, .e = e };
	const struct contact *list = contacts->list.data;
	struct array ends = { 0 };
	size_t n = contacts->list.n;
	int status = begin(&c);

	for (size_t i = 0, next; !status && i < n; i = next) {
		for (next = i + 1; next < n && list[next].triangle == list[i].triangle; next++)
			;
		if (too_thin(m, list[i].triangle, LEAST_HEIGHT * limits->apart))
			continue;
		status = cut_triangle(&c, &list[i], next - i, &ends);
		p->cut++;
	}
	if (!status)
		status = halve_short_lines(&c);
	for (size_t i = 0; !status && i < n; i++)
		if (i == 0 || list[i].triangle != list[i - 1].triangle)
			status = mesh_delaunay_refine(&c, list[i].triangle, limits->size);
	free(ends.data);
	free(c.crossed.data);
	return status ? -1 : 0;
}
