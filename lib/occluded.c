#include "occluded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature.h"
#include "shadow.h"
#include "vec3.h"

struct cell {
	double q[4][3];               /* convex, or a triangle with its last corner twice */
	uint64_t blockers;            /* that may hide something from it */
	double value, error;
};

/* An integral over facet f of what it sees of g. */
struct integral {
	struct occluded *o;
	struct clear *clear;
	const struct facet *f, *g;
	double near;
	double settled;               /* of cells that are exact */
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
static int settle(struct integral *in, struct facet *f, uint64_t *blockers)
{
	int hidden;

	*blockers = shadow_on(in->o->seer.blocker, *blockers, f, in->g, in->near, &hidden);
	if (!hidden && !*blockers)
		in->settled += clear_exchange(in->clear, f, NULL, in->g, NULL);
	return hidden || !*blockers;
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
		if (f.area == 0 || settle(in, &f, &quarter[k].blockers))
			continue;
		measure(in, &quarter[k]);
		sum += quarter[k].value;
		quarter[left++] = quarter[k];
	}
	/* A rule of fourth order leaves a fifteenth of the difference where what is seen is
	 * smooth, a third across the edge of a shadow. */
	for (int k = 0; k < left; k++)
		quarter[k].error = fabs(sum + in->settled - before - c.value) / (3 * left);
	return vec_append(cells, quarter, (size_t)left, sizeof *quarter, in->e);
}

static int put_cells(struct integral *in, struct facet *f, uint64_t blockers)
{
	if (settle(in, f, &blockers))
		return 0;
	for (int i = 0; 2 * i + 3 <= f->n; i++) {
		struct cell c = { .blockers = blockers, .error = INFINITY };
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

/* Cells between the cuts, each convex. */
static int cut_cells(struct integral *in, struct facet *f, uint64_t blockers,
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
		if (settle(in, f, &blockers))
			return 0;
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
		if (!(off > tolerance) || (o->seer.evaluations >= stop && isfinite(off)))
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
	struct plane cuts[SHADOW_CUTS];

	make_blockers(o, l, l->b);
	if (clearance(o, l->a) < clearance(o, l->b)) {
		in.f = l->b;
		in.g = l->a;
		make_blockers(o, l, l->a);
	}
	o->seer.near = in.near;
	o->cell.n = 0;
	int n = shadow_cuts(o->seer.blocker, o->blockers, in.f, in.g, in.near, cuts);
	uint64_t all = o->blockers ? UINT64_MAX >> (64 - o->blockers) : 0;
	struct facet whole = *in.f;
	if (cut_cells(&in, &whole, all, cuts, n))
		return NAN;
	return integrate(&in, tolerance, most, error);
}
