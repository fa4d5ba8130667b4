#include "occluded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "contour.h"
#include "cubature.h"
#include "shadow.h"
#include "vec3.h"

struct cell {
	double q[4][3];               /* convex, or a triangle with its last corner twice */
	uint64_t blockers;            /* that may hide something from it */
	double most;                  /* its exchange area if nothing were hidden */
	double value, error;
};

/* What may be wrong with a cell, as a fraction of `most`: before it is compared with its
 * quarters; where its points may all have missed the edge of a shadow; where its corners
 * have, too, and known edges end it. */
static const double unproved = .1, unseen = .02, unlikely = 1e-4;

enum { HALVINGS = 5 };        /* of the facet seen, to prove that several blockers hide it */

/* An integral over facet f of what it sees of g. */
struct integral {
	struct occluded *o;
	struct clear *clear;
	const struct facet *f, *g;
	double near;
	struct shadows shadows;
	double settled;               /* of cells that are exact */
	int cut;                      /* cells end at the edges of shadows */
	struct err *e;
};

void occluded_free(struct occluded *o)
{
	seer_free(&o->seer);
	free(o->cell.data);
	*o = (struct occluded){ 0 };
}

/* ---- cells ---- */

static struct facet cell_facet(const struct cell *c)
{
	struct facet f = { .n = memcmp(c->q[2], c->q[3], sizeof c->q[2]) ? 4 : 3, .v = c->q[0] };

	return f;
}

/* Settles a cell whose view is clear or hidden: 1. Otherwise narrows its blockers down. */
static int settle(struct integral *in, const struct facet *f, uint64_t *blockers, double *most)
{
	int hidden;

	*blockers = shadow_on(in->o->seer.blocker, &in->shadows, *blockers, f, in->g, in->near, &hidden);
	if (hidden)
		return 1;
	*most = clear_exchange(in->clear, f, NULL, in->g, NULL);
	in->settled += *blockers ? 0 : *most;
	return !*blockers;
}

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
			c->value += w[i] * seen(&in->o->seer, at, in->f->normal, in->g, c->blockers, in->e);
	}
}

/* A cell whose points see nothing, or all, though no one blocker hides it and some may: it
 * is settled if together they hide it surely. 1 then. */
static int settle_dark(const struct integral *in, const struct cell *c, const struct facet *f)
{
	return c->value == 0 &&
	       blockers_hide(in->o->seer.blocker, c->blockers, f, in->g, in->near, HALVINGS);
}

/* The least error that a measured cell can claim: more where a corner sees what the points
 * did not. */
static double doubt(const struct integral *in, const struct cell *c)
{
	int dark = c->value == 0, bright = c->value >= (1 - 1e-9) * c->most;
	double off = 0;

	if (!in->cut || !(dark || bright))
		return in->cut ? 0 : unseen * c->most;
	for (int k = 0; k < 4; k++) {
		double f = seen(&in->o->seer, c->q[k], in->f->normal, in->g, c->blockers, in->e);
		double all = contour_point(c->q[k], in->f->normal, in->g->n, in->g->v);
		off = fmax(off, dark ? f / all : 1 - f / all);
	}
	return c->most * (unlikely + unproved * off);
}

static void middle(const double a[3], const double b[3], double out[3])
{
	for (int k = 0; k < 3; k++)
		out[k] = (a[k] + b[k]) / 2;
}

static void quarters(const struct cell *c, struct cell quarter[4])
{
	double mid[4][3], centre[3];

	for (int k = 0; k < 4; k++)
		middle(c->q[k], c->q[(k + 1) % 4], mid[k]);
	middle(mid[0], mid[2], centre);
	for (int k = 0; k < 4; k++) {
		memcpy(quarter[k].q[0], c->q[k], sizeof c->q[k]);
		memcpy(quarter[k].q[1], mid[k], sizeof c->q[k]);
		memcpy(quarter[k].q[2], centre, sizeof c->q[k]);
		memcpy(quarter[k].q[3], mid[(k + 3) % 4], sizeof c->q[k]);
		quarter[k].blockers = c->blockers;
	}
}

/* Replaces a cell by its four quarters. */
static int refine(struct integral *in, size_t i)
{
	struct vec *cells = &in->o->cell;
	struct cell c = ((struct cell *)cells->data)[i], quarter[4];
	double before = in->settled, sum = 0;
	int left = 0;

	quarters(&c, quarter);
	((struct cell *)cells->data)[i] = ((struct cell *)cells->data)[--cells->n];
	for (int k = 0; k < 4; k++) {
		struct facet f = cell_facet(&quarter[k]);
		facet_measure(&f);
		if (f.area == 0 || settle(in, &f, &quarter[k].blockers, &quarter[k].most))
			continue;
		measure(in, &quarter[k]);
		sum += quarter[k].value;
		if (!settle_dark(in, &quarter[k], &f))
			quarter[left++] = quarter[k];
	}
	/* A rule of fourth order leaves a fifteenth of the difference where what is seen is
	 * smooth, a third across the edge of a shadow. */
	double off = fabs(sum + in->settled - before - c.value) / (3 * left);
	for (int k = 0; k < left; k++)
		quarter[k].error = fmax(off, doubt(in, &quarter[k]));
	return vec_append(cells, quarter, (size_t)left, sizeof *quarter, in->e);
}

static int put_cells(struct integral *in, const struct facet *f, uint64_t blockers)
{
	double most;

	if (settle(in, f, &blockers, &most))
		return 0;
	for (int i = 0; 2 * i + 3 <= f->n; i++) {
		struct cell c = { .blockers = blockers, .most = most };
		for (int k = 0; k < 4; k++) {
			int corner = k == 0 ? 0 : 2 * i + k < f->n ? 2 * i + k : f->n - 1;
			memcpy(c.q[k], &f->v[3 * corner], sizeof c.q[k]);
		}
		struct facet part = cell_facet(&c);
		facet_measure(&part);
		c.most *= part.area / f->area;
		c.error = unproved * c.most;
		measure(in, &c);
		if (!settle_dark(in, &c, &part) && vec_append(&in->o->cell, &c, 1, sizeof c, in->e))
			return -1;
	}
	return 0;
}

/* Cells between the cuts, each convex. */
static int cut_cells(struct integral *in, const struct facet *f, uint64_t blockers,
                     const struct plane *cuts, int n)
{
	struct facet_room low, high;

	for (; n > 0; n--) {
		double lowest, highest, back[3];
		const struct plane *p = &cuts[n - 1];
		facet_heights(f, p->normal, p->offset, &lowest, &highest);
		if (lowest >= -in->near || highest <= in->near || f->n + 1 >= FACET_CORNERS)
			continue;
		for (int k = 0; k < 3; k++)
			back[k] = -p->normal[k];
		return (facet_clip(f, p->normal, p->offset, &high) &&
		        cut_cells(in, &high.f, blockers, cuts, n - 1)) ||
		       (facet_clip(f, back, -p->offset, &low) &&
		        cut_cells(in, &low.f, blockers, cuts, n - 1));
	}
	return put_cells(in, f, blockers);
}

/* ---- the integral ---- */

static double integrate(struct integral *in, double tolerance, int most, double *error)
{
	struct occluded *o = in->o;
	double stop = o->seer.evaluations + most;

	for (;;) {
		const struct cell *c = o->cell.data;
		double sum = in->settled, off = 0;
		size_t worst = 0;
		for (size_t i = 0; i < o->cell.n; i++) {
			sum += c[i].value;
			off += c[i].error;
			if (c[i].error > c[worst].error)
				worst = i;
		}
		*error = off;
		if (!(off > tolerance) || o->seer.evaluations >= stop)
			return sum;
		if (refine(in, worst))
			return NAN;
	}
}

static void make_blockers(struct occluded *o, const struct sight_line *l, const struct facet *g)
{
	o->blockers = 0;
	for (int i = 0; i < l->bodies; i++)
		o->blockers += blocker_make(l->set, l->body[i], g, &o->seer.blocker[o->blockers]);
}

/* How near the blockers come to a facet: its points' shadows then change quickly. */
static double clearance(const struct occluded *o, const struct facet *f)
{
	double least = INFINITY;

	for (int i = 0; i < o->blockers; i++)
		for (int k = 0; k < o->seer.blocker[i].edges; k++)
			least = fmin(least, fmax(0, v3_dot(f->normal, o->seer.blocker[i].edge[k].a) -
			                            f->offset));
	return least;
}

double occluded_exchange(struct occluded *o, struct clear *clear, const struct sight_line *l,
                         double tolerance, int most, double *error, struct err *e)
{
	struct integral in = { .o = o, .clear = clear, .f = l->a, .g = l->b, .near = l->set->near,
	                       .e = e };

	make_blockers(o, l, l->b);
	if (clearance(o, l->a) < clearance(o, l->b)) {
		in.f = l->b;
		in.g = l->a;
		make_blockers(o, l, l->a);
	}
	o->seer.near = in.near;
	o->cell.n = 0;
	uint64_t all = o->blockers ? UINT64_MAX >> (64 - o->blockers) : 0;
	/* Cutting pays where more is asked for than cells across shadows' edges can tell. */
	in.cut = tolerance < 2 * unseen * clear_exchange(clear, in.f, NULL, in.g, NULL);
	if (in.cut)
		shadow_edges(o->seer.blocker, o->blockers, in.f, in.g, in.near, &in.shadows);
	if (cut_cells(&in, in.f, all & ~in.shadows.idle, in.shadows.cut, in.shadows.cuts))
		return NAN;
	return integrate(&in, tolerance, most, error);
}
