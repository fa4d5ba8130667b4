#include "seen.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "body_polygons.h"
#include "contour.h"
#include "vec3.h"

void seer_free(struct seer *s)
{
	free(s->piece.data);
	free(s->next.data);
	*s = (struct seer){ 0 };
}

/* Copies of pieces copy no more than there is. */
static void copy_piece(struct facet_piece *to, const struct facet_piece *from)
{
	to->n = from->n;
	memcpy(to->v, from->v, (size_t)from->n * sizeof from->v[0]);
}

/* Heights of a piece's corners over a plane through x; what rounding makes of 0 is 0.
 * Returns bit 0: some are above, bit 1: some below. */
static int heights(const struct facet_piece *p, const double x[3], const double normal[3],
                   double *h)
{
	double reach = 0, offset = v3_dot(normal, x);
	int sides = 0;

	for (int i = 0; i < p->n; i++) {
		h[i] = v3_dot(normal, p->v[i]) - offset;
		double size = fabs(h[i]);
		reach = size > reach ? size : reach;
	}
	for (int i = 0; i < p->n; i++) {
		h[i] = fabs(h[i]) <= 1e-12 * reach ? 0 : h[i];
		sides |= h[i] > 0 ? 1 : h[i] < 0 ? 2 : 0;
	}
	return sides;
}

/* Cuts a convex piece by a plane through x: what is on the positive side stays in p, the
 * rest goes to `away`. Each gets n = 0 where nothing is left. */
static void cut_piece(struct facet_piece *p, const double x[3], const double normal[3],
                      struct facet_piece *away)
{
	double h[PIECE_CORNERS];
	struct facet_piece in;
	int sides = heights(p, x, normal, h);

	away->n = in.n = 0;
	if (!(sides & 2))
		return;
	if (!(sides & 1)) {
		copy_piece(away, p);
		p->n = 0;
		return;
	}
	for (int i = 0; i < p->n; i++) {
		int j = i + 1 < p->n ? i + 1 : 0;
		if (h[i] >= 0)
			memcpy(in.v[in.n++], p->v[i], sizeof p->v[i]);
		if (h[i] <= 0)
			memcpy(away->v[away->n++], p->v[i], sizeof p->v[i]);
		if ((h[i] > 0 && h[j] < 0) || (h[i] < 0 && h[j] > 0)) {
			edge_divide(p->v[i], h[i], p->v[j], h[j], in.v[in.n]);
			memcpy(away->v[away->n++], in.v[in.n], sizeof p->v[i]);
			in.n++;
		}
	}
	copy_piece(p, &in);
}

/* Is the eye in front of a face? For a flat blocker: off its plane. */
static int in_front(const struct blocker *b, int face, const double x[3], double near)
{
	if (face == b->faces)
		return 0;
	double h = plane_height(&b->face[face], x);
	return b->flat ? h != 0 : h > near * 1e-6;
}

/* The plane through x and an edge, with the blocker's inside positive; 0 if x is in line. */
static int edge_plane(const struct blocker *b, int edge, const double x[3], double plane[3])
{
	double centre[3], p[3], q[3];

	v3_sub(b->centre, x, centre);
	v3_sub(b->edge[edge].a, x, p);
	v3_sub(b->edge[edge].b, x, q);
	v3_cross(p, q, plane);
	double side = v3_dot(plane, centre);
	for (int k = 0; k < 3 && side < 0; k++)
		plane[k] = -plane[k];
	return side != 0;
}

/* Planes through x and the silhouette of a blocker, with its inside positive; edge[i] is
 * the edge of plane i. -1 if x is inside it, 0 if the eye sees it edge-on. */
static int silhouette(const struct blocker *b, const double x[3], double near,
                      double plane[BLOCKER_EDGES][3], int edge[BLOCKER_EDGES])
{
	uint8_t front[BODY_FACES + 1] = { 0 };
	int n = 0, any = 0;

	for (int i = 0; i < b->faces; i++)
		any |= front[i] = (uint8_t)in_front(b, i, x, near);
	if (!any)
		return b->flat ? 0 : -1;
	for (int i = 0; i < b->edges; i++)
		if (b->flat || front[b->edge[i].left] != front[b->edge[i].right]) {
			edge[n] = i;
			n += edge_plane(b, i, x, plane[n]);
		}
	return n;
}

/* Is all that is visible on the far side of an edge that was so for the last eye? */
static int still_apart(const struct seer *o, int blocker, const double x[3])
{
	const struct blocker *b = &o->blocker[blocker];
	int edge = b->apart;
	double plane[3], h[PIECE_CORNERS];

	if (edge < 0 || (!b->flat && in_front(b, b->edge[edge].left, x, o->near) ==
	                             in_front(b, b->edge[edge].right, x, o->near)) ||
	    !edge_plane(b, edge, x, plane))
		return 0;
	for (size_t i = 0; i < o->piece.n; i++)
		if (heights((const struct facet_piece *)o->piece.data + i, x, plane, h) & 1)
			return 0;
	return 1;
}

/* Room for one more piece behind those of a list; NULL and e when memory is short. */
static struct facet_piece *more(struct vec *list, struct err *e)
{
	if (vec_reserve(list, 1, sizeof(struct facet_piece), e))
		return NULL;
	return (struct facet_piece *)list->data + list->n;
}

/* Takes from the visible pieces what a blocker hides from x. */
static int hide(struct seer *o, int blocker, const double x[3], struct err *e)
{
	double plane[BLOCKER_EDGES][3];
	int edge[BLOCKER_EDGES], n, hid = 0;

	if (still_apart(o, blocker, x))
		return 0;
	n = silhouette(&o->blocker[blocker], x, o->near, plane, edge);
	if (n < 0) {
		o->piece.n = 0;
		o->hid = 1;
	}
	if (n <= 0)
		return 0;
	o->next.n = 0;
	for (size_t i = 0; i < o->piece.n; i++) {
		struct facet_piece *p = (struct facet_piece *)o->piece.data + i;
		if (p->n + n > PIECE_CORNERS)
			return err_set(e, "a blocker's silhouette has too many edges");
		for (int k = 0; k < n && p->n; k++) {
			struct facet_piece *away = more(&o->next, e);
			if (!away)
				return -1;
			cut_piece(p, x, plane[k], away);
			o->next.n += away->n >= 3;
			if (!p->n)
				o->blocker[blocker].apart = edge[k];
		}
		hid |= p->n >= 3;
	}
	o->hid |= hid;
	struct vec swap = o->piece;
	o->piece = o->next;
	o->next = swap;
	return 0;
}

const struct facet_piece *seen_pieces(const struct seer *o, size_t *n)
{
	*n = o->piece.n;
	return o->piece.data;
}

double seen(struct seer *o, const double x[3], const double normal[3], const struct facet *g,
            uint64_t blockers, struct err *e)
{
	struct facet_piece *whole;
	double sum = 0;

	o->evaluations++;
	o->piece.n = 0;
	if (!(whole = more(&o->piece, e)))
		return NAN;
	whole->n = g->n;
	memcpy(whole->v, g->v, (size_t)g->n * sizeof whole->v[0]);
	o->piece.n = 1;
	for (uint64_t left = blockers; left && o->piece.n; left &= left - 1)
		if (hide(o, __builtin_ctzll(left), x, e))
			return NAN;
	for (size_t i = 0; i < o->piece.n; i++) {
		const struct facet_piece *p = (const struct facet_piece *)o->piece.data + i;
		sum += contour_point(x, normal, p->n, p->v[0]);
	}
	return sum;
}
