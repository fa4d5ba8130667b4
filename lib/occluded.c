#include "occluded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "body_polygons.h"
#include "contour.h"
#include "cubature.h"
#include "vec3.h"

/* A convex piece gains a corner at most from each plane that cuts it: those of a facet and
 * of a blocker's silhouette. */
enum { PIECE_CORNERS = 80, KINKS = 12 };

struct facet_piece {
	int n;
	double v[PIECE_CORNERS][3];
};

void occluded_free(struct occluded *o)
{
	free(o->piece.data);
	free(o->next.data);
	free(o->cell.data);
	*o = (struct occluded){ 0 };
}

/* ---- what a point sees ---- */

/* Cuts a convex piece by a plane through x: what is on the positive side stays in p, the
 * rest goes to `away`. Each gets n = 0 where nothing is left. */
static void cut_piece(struct facet_piece *p, const double x[3], const double normal[3],
                      struct facet_piece *away)
{
	double h[PIECE_CORNERS], reach = 0;
	struct facet_piece in;
	int above = 0, below = 0;

	away->n = in.n = 0;
	for (int i = 0; i < p->n; i++) {
		double d[3];
		v3_sub(p->v[i], x, d);
		h[i] = v3_dot(normal, d);
		reach = fmax(reach, fabs(h[i]));
	}
	for (int i = 0; i < p->n; i++) {
		h[i] = fabs(h[i]) <= 1e-13 * reach ? 0 : h[i];
		above += h[i] > 0;
		below += h[i] < 0;
	}
	if (!below)
		return;
	if (!above) {
		away->n = p->n;
		memcpy(away->v, p->v, (size_t)p->n * sizeof p->v[0]);
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
	p->n = in.n;
	memcpy(p->v, in.v, (size_t)in.n * sizeof in.v[0]);
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

/* Takes from the visible pieces what a blocker hides from x. */
static int hide(struct occluded *o, const struct blocker *b, const double x[3], double near,
                struct err *e)
{
	double plane[BLOCKER_EDGES][3];
	int n = silhouette(b, x, near, plane);
	struct facet_piece away;

	if (n < 0)
		o->piece.n = 0;
	if (n <= 0)
		return 0;
	o->next.n = 0;
	for (size_t i = 0; i < o->piece.n; i++) {
		struct facet_piece *p = (struct facet_piece *)o->piece.data + i;
		if (p->n + n > PIECE_CORNERS)
			return err_set(e, "a blocker's silhouette has too many edges");
		for (int k = 0; k < n && p->n; k++) {
			cut_piece(p, x, plane[k], &away);
			if (away.n >= 3 && vec_append(&o->next, &away, 1, sizeof away, e))
				return -1;
		}
	}
	struct vec swap = o->piece;
	o->piece = o->next;
	o->next = swap;
	return 0;
}

/* The form factor from a point with normal n to what it sees of facet g. */
static double seen(struct occluded *o, const double x[3], const double normal[3],
                   const struct facet *g, double near, struct err *e)
{
	struct facet_piece whole = { .n = g->n };
	double sum = 0;

	o->evaluations++;
	memcpy(whole.v, g->v, (size_t)g->n * sizeof whole.v[0]);
	o->piece.n = 0;
	if (vec_append(&o->piece, &whole, 1, sizeof whole, e))
		return NAN;
	for (int i = 0; i < o->blockers && o->piece.n; i++)
		if (hide(o, &o->blocker[i], x, near, e))
			return NAN;
	for (size_t i = 0; i < o->piece.n; i++) {
		const struct facet_piece *p = (const struct facet_piece *)o->piece.data + i;
		sum += contour_point(x, normal, p->n, p->v[0]);
	}
	return sum;
}

/* ---- cubature over the other facet ---- */

struct cell {
	double q[4][3];               /* convex, or a triangle with a corner twice */
	double value, error;
};

struct integral {
	struct occluded *o;
	const struct facet *f, *g;    /* over f, of what it sees of g */
	double near;
	struct err *e;
};

static void measure(const struct integral *in, struct cell *c)
{
	double x[4], y[4], z[4], w[4];
	struct cubature p = { 0, x, y, z, w };
	struct facet f = { .n = 4, .v = c->q[0] };

	cubature_fill(&f, 0, &p);
	c->value = 0;
	for (int i = 0; i < p.n; i++) {
		double at[3] = { x[i], y[i], z[i] };
		if (w[i] > 0)
			c->value += w[i] * seen(in->o, at, in->f->normal, in->g, in->near, in->e);
	}
}

static void middle(const double a[3], const double b[3], double out[3])
{
	for (int k = 0; k < 3; k++)
		out[k] = (a[k] + b[k]) / 2;
}

/* Replaces a cell by its four quarters. */
static int refine(const struct integral *in, size_t i)
{
	struct vec *cells = &in->o->cell;
	struct cell c = ((struct cell *)cells->data)[i], quarter[4];
	double mid[4][3], centre[3], sum = 0;

	for (int k = 0; k < 4; k++)
		middle(c.q[k], c.q[(k + 1) % 4], mid[k]);
	middle(mid[0], mid[2], centre);
	for (int k = 0; k < 4; k++) {
		memcpy(quarter[k].q[0], c.q[k], sizeof c.q[k]);
		memcpy(quarter[k].q[1], mid[k], sizeof c.q[k]);
		memcpy(quarter[k].q[2], centre, sizeof c.q[k]);
		memcpy(quarter[k].q[3], mid[(k + 3) % 4], sizeof c.q[k]);
		measure(in, &quarter[k]);
		sum += quarter[k].value;
	}
	/* A rule of fourth order leaves a fifteenth of the difference where what is seen is
	 * smooth, a third across a shadow's edge. */
	for (int k = 0; k < 4; k++)
		quarter[k].error = fabs(sum - c.value) / 12;
	((struct cell *)cells->data)[i] = quarter[0];
	return vec_append(cells, quarter + 1, 3, sizeof *quarter, in->e);
}

/* ---- kinks: where a shadow's edge meets an edge of g all along ---- */

/* The plane through two parallel edges, if it cuts f. */
static int kink(const double a[3], const double b[3], const double c[3], const double d[3],
                const struct facet *f, double near, struct plane *p)
{
	double u[3], v[3], w[3], s[3], lowest, highest;

	v3_sub(b, a, u);
	v3_sub(d, c, v);
	v3_cross(u, v, s);
	if (v3_dot(s, s) > 1e-12 * v3_dot(u, u) * v3_dot(v, v))
		return 0;
	v3_sub(c, a, w);
	v3_cross(u, w, p->normal);
	if (v3_dot(p->normal, p->normal) <= near * near * v3_dot(u, u))
		return 0;
	v3_normalise(p->normal);
	p->offset = v3_dot(p->normal, a);
	facet_heights(f, p->normal, p->offset, &lowest, &highest);
	return lowest < -near && highest > near;
}

static int find_kinks(const struct integral *in, struct plane kinks[KINKS])
{
	int n = 0;

	for (int i = 0; i < in->o->blockers; i++)
		for (int k = 0; k < in->o->blocker[i].edges; k++)
			for (int j = 0; j < in->g->n && n < KINKS; j++) {
				struct plane *p = &kinks[n];
				int old = 0;
				if (!kink(in->o->blocker[i].edge[k].a, in->o->blocker[i].edge[k].b,
				          &in->g->v[3 * j], &in->g->v[3 * ((j + 1) % in->g->n)], in->f,
				          in->near, p))
					continue;
				for (int m = 0; m < n && !old; m++)
					old = fabs(fabs(v3_dot(kinks[m].normal, p->normal)) - 1) < 1e-12 &&
					      fabs(fabs(kinks[m].offset) - fabs(p->offset)) < in->near;
				n += !old;
			}
	return n;
}

static int put_cells(const struct integral *in, const struct facet *f)
{
	for (int i = 0; 2 * i + 3 <= f->n; i++) {
		struct cell c = { .error = INFINITY };
		for (int k = 0; k < 4; k++) {
			int corner = k == 0 ? 0 : 2 * i + k < f->n ? 2 * i + k : f->n - 1;
			memcpy(c.q[k], &f->v[3 * corner], sizeof c.q[k]);
		}
		measure(in, &c);
		if (vec_append(&in->o->cell, &c, 1, sizeof c, in->e))
			return -1;
	}
	return 0;
}

/* Cells between the kinks, each convex. */
static int cut_cells(const struct integral *in, const struct facet *f, const struct plane *kinks,
                     int n)
{
	struct facet_room low, high;

	for (; n > 0; n--) {
		double lowest, highest, back[3];
		const struct plane *p = &kinks[n - 1];
		facet_heights(f, p->normal, p->offset, &lowest, &highest);
		if (lowest >= -in->near || highest <= in->near)
			continue;
		for (int k = 0; k < 3; k++)
			back[k] = -p->normal[k];
		return (facet_clip(f, p->normal, p->offset, &high) &&
		        cut_cells(in, &high.f, kinks, n - 1)) ||
		       (facet_clip(f, back, -p->offset, &low) &&
		        cut_cells(in, &low.f, kinks, n - 1));
	}
	return put_cells(in, f);
}

static double integrate(const struct integral *in, double tolerance, int most, double *error)
{
	struct occluded *o = in->o;
	double stop = o->evaluations + most;

	for (;;) {
		const struct cell *c = o->cell.data;
		double sum = 0, off = 0;
		size_t worst = 0;
		for (size_t i = 0; i < o->cell.n; i++) {
			sum += c[i].value;
			off += c[i].error;
			if (c[i].error > c[worst].error)
				worst = i;
		}
		*error = off;
		if (!(off > tolerance) || o->evaluations >= stop)
			return sum;
		if (refine(in, worst))
			return NAN;
	}
}

/* How near the blockers come to a facet: its points' shadows then change quickly. */
static double clearance(const struct occluded *o, const struct facet *f)
{
	double least = INFINITY;

	for (int i = 0; i < o->blockers; i++)
		for (int k = 0; k < o->blocker[i].edges; k++)
			least = fmin(least, fmax(0, v3_dot(f->normal, o->blocker[i].edge[k].a) - f->offset));
	return least;
}

double occluded_exchange(struct occluded *o, const struct sight_line *l, double tolerance,
                         int most, double *error, struct err *e)
{
	struct integral in = { o, l->a, l->b, l->set->near, e };
	struct plane kinks[KINKS];

	o->blockers = 0;
	for (int i = 0; i < l->bodies; i++)
		o->blockers += blocker_make(l->set, l->body[i], l->b, &o->blocker[o->blockers]);
	if (clearance(o, l->a) < clearance(o, l->b)) {
		in.f = l->b;
		in.g = l->a;
		o->blockers = 0;
		for (int i = 0; i < l->bodies; i++)
			o->blockers += blocker_make(l->set, l->body[i], l->a, &o->blocker[o->blockers]);
	}
	o->cell.n = 0;
	if (cut_cells(&in, in.f, kinks, find_kinks(&in, kinks)))
		return NAN;
	return integrate(&in, tolerance, most, error);
}
