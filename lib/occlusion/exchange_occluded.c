#include "lib/occlusion/exchange_occluded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/vec3.h"
#include "lib/geometry/contour.h"
#include "lib/geometry/cubature.h"
#include "lib/occlusion/shadow_edges.h"

struct cell {
	struct facet_room shape;
	uint64_t blockers;            /* that may hide something from it */
	uint32_t edges, bends;        /* bits of those that may cross it */
	double most;                  /* about its exchange area if nothing were hidden */
	double value, error;
	int bright;                   /* no blocker hid anything from its points */
};

/* What may be wrong with a cell, as a fraction of `most`: before it is compared with its
 * quarters; where its points may all have missed the edge of a shadow; where its corners
 * have, too, and known edges end it. */
static const double unproved = .1, unseen = .1, unlikely = 1e-4;

/* What its centre says of a cell that is not compared yet: nothing better than this. */
static const double surmised = 1e-3;

/* How many times smaller a quarter's error may be than that of the whole, at most: where a
 * shadow's edge is not known, the sum over quarters may agree by accident. */
static const double fall = 256;

enum { HALVINGS = 5 };        /* of the facet seen, to prove that several blockers hide it */

/* An integral over facet f of what it sees of g. */
struct integral {
	struct occluded *o;
	struct unoccluded *clear;
	const struct facet *f, *g;
	double near;
	struct shadows shadows;
	double settled;               /* of cells that are exact */
	int cut;                      /* cells are to end at the edges of shadows */
	struct err *e;
};

void occ_occluded_free(struct occluded *o)
{
	free(o->cell.data);
	*o = (struct occluded){ 0 };
}

/* ---- cells ---- */

static void set_shape(struct cell *c, const struct facet *f)
{
	c->shape.f = *f;
	memcpy(c->shape.corner, f->v, 3 * (size_t)f->n * sizeof *f->v);
}

/* Cells move about: their corners go with them. */
static const struct facet *shape_of(struct cell *c)
{
	c->shape.f.v = c->shape.corner;
	return &c->shape.f;
}

/* Parts have no points kept. */
static const struct unoccluded_points none = { NULL, NULL };

/* Settles a cell whose view is clear or hidden: 1. Otherwise narrows its blockers down. */
static int combine_landed(struct integral *in, struct cell *c, const struct facet *f)
{
	int hidden;

	c->blockers = occ_shadow_on(in->o->visible.occluder, &in->shadows, c->blockers, f, in->g, in->near,
	                            &hidden);
	if (hidden)
		return 1;
	if (!c->blockers)
		in->settled += geo_unoccluded_exchange(in->clear, f, none, in->g, none);
	return !c->blockers;
}

static void measure(const struct integral *in, struct cell *c, const struct facet *f)
{
	double x[4][4 * FACET_CORNERS];
	struct cubature p = { 0, x[0], x[1], x[2], x[3] };

	geo_cubature_fill(f, 0, &p);
	c->value = 0;
	in->o->visible.hid = 0;
	for (int i = 0; i < p.n; i++) {
		double at[3] = { p.x[i], p.y[i], p.z[i] };
		if (p.w[i] > 0)
			c->value += p.w[i] * occ_visible_exchange(&in->o->visible, at, in->f->normal, in->g, c->blockers,
			                                          in->e);
	}
	c->bright = !in->o->visible.hid;
}

/* The cut that halves a cell best, of those with a blocker that matters to it; forgets
 * cuts that do not cross it. NULL if none is left. */
static const struct plane *best_cut(const struct integral *in, const struct shadow_cuts *s,
                                    uint32_t *bits, const struct cell *c, const struct facet *f)
{
	const struct plane *found = NULL;
	double best = 0;

	for (int i = 0; i < s->n; i++) {
		double lowest, highest;
		if (!(*bits >> i & 1))
			continue;
		geo_facet_heights(f, s->cut[i].normal, s->cut[i].offset, &lowest, &highest);
		if (lowest >= -in->near || highest <= in->near || !(s->of[i] & c->blockers)) {
			*bits &= ~((uint32_t)1 << i);
		} else if (fmin(-lowest, highest) > best * (highest - lowest)) {
			best = fmin(-lowest, highest) / (highest - lowest);
			found = &s->cut[i];
		}
	}
	return found;
}

/* The error of a cell's points where no edge is known to cross it: that of its centre
 * alone is of second order, theirs of fourth. */
static double surmise(const struct integral *in, const struct cell *c, const struct facet *f)
{
	double one = f->area * occ_visible_exchange(&in->o->visible, f->centre, in->f->normal, in->g, c->blockers, in->e);
	double off = c->value - one, guess = 4 * off * off / c->value;

	return fmin(unproved, fmax(surmised, guess / c->most)) * c->most;
}

/* What the least error is that a measured cell can claim: more where edges of shadows are
 * known to cross it, where a corner sees what its points did not, or where it has not been
 * compared with its quarters. */
static double doubt(const struct integral *in, struct cell *c, const struct facet *f, int compared)
{
	int dark = c->value == 0;
	double off = 0;

	if (!in->cut || best_cut(in, &in->shadows.edges, &c->edges, c, f))
		return unseen * c->most;
	if (!(dark || c->bright))
		return compared ? 0 : surmise(in, c, f);
	for (int k = 0; k < f->n; k++) {
		const double *v = &f->v[3 * k];
		double s = occ_visible_exchange(&in->o->visible, v, in->f->normal, in->g, c->blockers, in->e);
		double all = geo_contour_point(v, in->f->normal, in->g->n, in->g->v);
		if (all > 0)
			off = fmax(off, fmin(1, dark ? s / all : 1 - s / all));
	}
	return c->most * (unlikely + unproved * off);
}

/* The parts that a cell is refined into: on both sides of the edge of a shadow, or
 * quarters. Returns their number. */
static int divide(const struct integral *in, struct cell *c, struct facet_room part[4])
{
	const struct facet *f = shape_of(c);
	const struct plane *cut = NULL;

	if (in->cut)
		cut = best_cut(in, &in->shadows.edges, &c->edges, c, f);
	if (in->cut && !cut)
		cut = best_cut(in, &in->shadows.bends, &c->bends, c, f);
	if (!cut)
		return geo_facet_quarter(f, part) ? 4 : 0;
	return geo_facet_split(f, cut->normal, cut->offset, part) ? 2 : 0;
}

/* Is it sure that the blockers together hide all from a cell that saw nothing? */
static int dark(const struct integral *in, const struct cell *c, const struct facet *f)
{
	return c->value == 0 &&
	       occ_occluders_hide(in->o->visible.occluder, c->blockers, f, in->g, in->near, HALVINGS);
}

/* Replaces a cell by its parts. */
static int refine(struct integral *in, size_t i)
{
	struct array *cells = &in->o->cell;
	struct cell c = ((struct cell *)cells->data)[i], part[4];
	struct facet_room room[4];
	double before = in->settled, area = c.shape.f.area, sum = 0;
	int n = divide(in, &c, room), left = 0;

	if (!n) { /* too small to divide */
		((struct cell *)cells->data)[i].error = 0;
		return 0;
	}
	((struct cell *)cells->data)[i] = ((struct cell *)cells->data)[--cells->n];
	for (int k = 0; k < n; k++) {
		const struct facet *f = &room[k].f;
		part[left] = (struct cell){ .blockers = c.blockers, .edges = c.edges, .bends = c.bends,
		                            .most = c.most * f->area / area };
		set_shape(&part[left], f);
		if (combine_landed(in, &part[left], f))
			continue;
		measure(in, &part[left], f);
		sum += part[left].value;
		left += !dark(in, &part[left], f);
	}
	/* A rule of fourth order leaves a fifteenth of the difference where what is seen is
	 * smooth, a third across the edge of a shadow; more where edges of several blockers
	 * cross one another before g, which no cut follows. */
	int several = (c.blockers & (c.blockers - 1)) != 0;
	double off = fabs(sum + in->settled - before - c.value) / ((several ? 1 : 3) * left);
	for (int k = 0; k < left; k++) {
		double least = n == 4 ? c.error / fall : 0;
		part[k].error = fmax(fmax(off, least), doubt(in, &part[k], shape_of(&part[k]), n == 4));
	}
	return mem_append(cells, part, (size_t)left, sizeof *part, in->e);
}

static int put_whole(struct integral *in, uint64_t blockers, double most)
{
	struct cell c = { .blockers = blockers, .most = most,
	                  .edges = UINT32_MAX, .bends = UINT32_MAX };

	set_shape(&c, in->f);
	if (combine_landed(in, &c, in->f))
		return 0;
	measure(in, &c, in->f);
	c.error = unproved * c.most;
	return mem_append(&in->o->cell, &c, 1, sizeof c, in->e);
}

/* ---- the integral ---- */

static double integrate(struct integral *in, double tolerance, int most, double *error)
{
	struct occluded *o = in->o;
	double stop = o->visible.evaluations + most;

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
		if (!(off > tolerance) || o->visible.evaluations >= stop)
			return sum;
		if (refine(in, worst))
			return NAN;
	}
}

static void make_blockers(struct occluded *o, const struct shaft *l, const struct facet *g)
{
	o->blockers = 0;
	for (int i = 0; i < l->bodies; i++)
		o->blockers += occ_occluder_make(l->set, l->body[i], g, &o->visible.occluder[o->blockers]);
}

/* How near the blockers come to a facet: its points' shadows then change quickly. */
static double clearance(const struct occluded *o, const struct facet *f)
{
	double least = INFINITY;

	for (int i = 0; i < o->blockers; i++)
		for (int k = 0; k < o->visible.occluder[i].corners; k++)
			least = fmin(least, fmax(0, v3_dot(f->normal, o->visible.occluder[i].corner[k]) -
			                            f->offset));
	return least;
}

double occ_occluded_exchange(struct occluded *o, struct unoccluded *clear, const struct shaft *l,
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
	occ_visible_begin(&o->visible, o->blockers, in.near);
	o->cell.n = 0;
	uint64_t all = o->blockers ? UINT64_MAX >> (64 - o->blockers) : 0;
	/* Cutting pays where more is asked for than cells across shadows' edges can tell. */
	double whole = geo_unoccluded_exchange(clear, in.f, none, in.g, none);
	in.cut = tolerance < 2 * unseen * whole;
	if (in.cut)
		occ_shadow_edges(o->visible.occluder, o->blockers, in.f, in.g, in.near, &in.shadows);
	if (put_whole(&in, all & ~in.shadows.idle, whole))
		return NAN;
	double seen = integrate(&in, tolerance, most, error);
	/* Rounding where blockers touch a facet's edges must not carry light through walls. */
	return seen < 1e-14 * whole ? 0 : seen;
}
