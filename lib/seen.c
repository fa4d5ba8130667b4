#include "seen.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "body_polygons.h"
#include "contour.h"
#include "vec3.h"

/* A convex piece gains a corner at most from each plane that cuts it: those of a facet and
 * of a blocker's silhouette. */
enum { PIECE_CORNERS = 80 };

struct facet_piece {
	int n;
	double v[PIECE_CORNERS][3];
};

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

/* Planes through x and the silhouette of a blocker, with its inside positive. -1 if x is
 * inside it, 0 if the eye sees it edge-on. */
static int silhouette(const struct blocker *b, const double x[3], double near,
                      double plane[BLOCKER_EDGES][3])
{
	double centre[3], p[3], q[3];
	uint8_t front[BODY_FACES + 1] = { 0 };
	int n = 0, any = 0;

	for (int i = 0; i < b->faces; i++) {
		double h = plane_height(&b->face[i], x);
		front[i] = b->flat ? fabs(h) > 0 : h > near * 1e-6;
		any |= front[i];
	}
	if (!any)
		return b->flat ? 0 : -1;
	v3_sub(b->centre, x, centre);
	for (int i = 0; i < b->edges; i++) {
		if (!b->flat && front[b->edge[i].left] == front[b->edge[i].right])
			continue;
		v3_sub(b->edge[i].a, x, p);
		v3_sub(b->edge[i].b, x, q);
		v3_cross(p, q, plane[n]);
		double side = v3_dot(plane[n], centre);
		if (side == 0)
			continue;
		for (int k = 0; k < 3 && side < 0; k++)
			plane[n][k] = -plane[n][k];
		n++;
	}
	return n;
}

/* Room for one more piece behind those of a list; NULL and e when memory is short. */
static struct facet_piece *more(struct vec *list, struct err *e)
{
	if (vec_reserve(list, 1, sizeof(struct facet_piece), e))
		return NULL;
	return (struct facet_piece *)list->data + list->n;
}

/* Takes from the visible pieces what a blocker hides from x. */
static int hide(struct seer *o, const struct blocker *b, const double x[3], struct err *e)
{
	double plane[BLOCKER_EDGES][3];
	int n = silhouette(b, x, o->near, plane);

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
		}
		o->hid |= p->n >= 3;
	}
	struct vec swap = o->piece;
	o->piece = o->next;
	o->next = swap;
	return 0;
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
		if (hide(o, &o->blocker[__builtin_ctzll(left)], x, e))
			return NAN;
	for (size_t i = 0; i < o->piece.n; i++) {
		const struct facet_piece *p = (const struct facet_piece *)o->piece.data + i;
		sum += contour_point(x, normal, p->n, p->v[0]);
	}
	return sum;
}
