#include "lib/occlusion/exchange_occluded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/geometry/contour.h"
#include "lib/geometry/cubature.h"
#include "lib/occlusion/shadow_edges.h"

struct cell {
	struct facet_room shape;
	uint64_t occluders;            /* that may hide something from it */
	uint32_t edges, bends;        /* bits of those that may cross it */
	double most;                  /* about its exchange area if nothing were hidden */
	double value, error;
	int bright;                   /* no occluder occluded anything from its points */
};

/* How little a cell is trusted, as fractions of `most`. Guesses; tests/bench/stress_exchange.c,
 * which compares exchange areas of random scenes at two tolerances and by brute force, tells
 * whether stated errors hold. */
static const double uncompared_error = .1;      /* before it is compared with its quarters */
static const double edge_error = .1;            /* where its points may all have missed the edge of
                                                   a shadow (.02 at first: too little) */
static const double missed_edge_error = 1e-4;   /* where its corners have, too, and known edges
                                                   end it */
static const double guessed_error_least = 1e-3; /* where only its centre has told: a difference of
                                                   two rules may be 0 by accident */

/* How many times smaller a quarter's error may be than that of the whole, at most: where a
 * shadow's edge is not known, the sum over quarters may agree by accident. A smooth one's is 64
 * times smaller: a rule of fourth order, a quarter of the area. A guess beyond that (4096 at
 * first: too much); see above. */
static const double quarters_gain_most = 256;

/* A count: of the facet seen, to prove that several occluders hide it. 32 parts; a guess. */
enum { HALVINGS = 5 };

/* What is left of light by rounding, relative to all of it if nothing were hidden: some fifty
 * roundings of 2e-16. */
static const double rounding = 1e-14;

/* An integral over facet f of what it sees of g. */
struct integral {
	struct occluded *o;
	struct unoccluded *unoccluded;
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

/* Settles a cell that sees all of g or nothing: 1. Otherwise narrows its occluders down. */
static int settle(struct integral *in, struct cell *c, const struct facet *f)
{
	int hidden;

	c->occluders = occ_shadow_on(in->o->visible.occluder, &in->shadows, c->occluders, f, in->g,
	                             in->near, &hidden);
	if (hidden)
		return 1;
	if (!c->occluders)
		in->settled += geo_unoccluded_exchange(in->unoccluded, f, none, in->g, none);
	return !c->occluders;
}

/* The form factor from a point of a cell to what it sees of g. */
static double visible_from(const struct integral *in, const struct cell *c, const double x[3])
{
	return occ_visible_exchange(&in->o->visible, x, in->f->normal, in->g, c->occluders, in->e);
}

static void measure(const struct integral *in, struct cell *c, const struct facet *f)
{
	double x[4][4 * FACET_CORNERS];
	struct cubature p = { 0, x[0], x[1], x[2], x[3] };

	geo_cubature_fill(f, 0, &p);
	c->value = 0;
	in->o->visible.occluded = 0;
	for (int i = 0; i < p.n; i++) {
		double at[3] = { p.x[i], p.y[i], p.z[i] };
		if (p.w[i] > 0)
			c->value += p.w[i] * visible_from(in, c, at);
	}
	c->bright = !in->o->visible.occluded;
}

/* The cut that halves a cell best, of those with an occluder that matters to it; forgets
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
		if (lowest >= -in->near || highest <= in->near || !(s->of[i] & c->occluders)) {
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
static double guess_error(const struct integral *in, const struct cell *c, const struct facet *f)
{
	double one = f->area * visible_from(in, c, f->centre);
	double off = c->value - one, guess = 4 * off * off / c->value;

	return fmin(uncompared_error, fmax(guessed_error_least, guess / c->most)) * c->most;
}

/* What the least error is that a measured cell can claim: more where edges of shadows are
 * known to cross it, where a corner sees what its points did not, or where it has not been
 * compared with its quarters. */
static double doubt(const struct integral *in, struct cell *c, const struct facet *f, int compared)
{
	int dark = c->value == 0;
	double off = 0;

	if (!in->cut || best_cut(in, &in->shadows.edges, &c->edges, c, f))
		return edge_error * c->most;
	if (!(dark || c->bright))
		return compared ? 0 : guess_error(in, c, f);
	for (int k = 0; k < f->n; k++) {
		const double *v = &f->v[3 * k];
		double s = visible_from(in, c, v);
		double all = geo_contour_point(v, in->f->normal, in->g->n, in->g->v);
		if (all > 0)
			off = fmax(off, fmin(1, dark ? s / all : 1 - s / all));
	}
	return c->most * (missed_edge_error + uncompared_error * off);
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

/* Is it sure that the occluders together hide all from a cell that saw nothing? */
static int dark(const struct integral *in, const struct cell *c, const struct facet *f)
{
	return c->value == 0 && occ_occluders_hide(in->o->visible.occluder, c->occluders, f, in->g,
	                                           in->near, HALVINGS);
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
		part[left] = (struct cell){ .occluders = c.occluders, .edges = c.edges,
		                            .bends = c.bends, .most = c.most * f->area / area };
		set_shape(&part[left], f);
		if (settle(in, &part[left], f))
			continue;
		measure(in, &part[left], f);
		sum += part[left].value;
		left += !dark(in, &part[left], f);
	}
	/* A rule of fourth order leaves a fifteenth of the difference where what is seen is
	 * smooth, a third across the edge of a shadow; more where edges of several occluders
	 * cross one another before g, which no cut follows. */
	int several = (c.occluders & (c.occluders - 1)) != 0;
	double off = fabs(sum + in->settled - before - c.value) / ((several ? 1 : 3) * left);
	for (int k = 0; k < left; k++) {
		double least = n == 4 ? c.error / quarters_gain_most : 0;
		part[k].error =
		    fmax(fmax(off, least), doubt(in, &part[k], shape_of(&part[k]), n == 4));
	}
	return mem_append(cells, part, (size_t)left, sizeof *part, in->e);
}

static int put_whole(struct integral *in, uint64_t occluders, double most)
{
	struct cell c = { .occluders = occluders, .most = most,
	                  .edges = UINT32_MAX, .bends = UINT32_MAX };

	set_shape(&c, in->f);
	if (settle(in, &c, in->f))
		return 0;
	measure(in, &c, in->f);
	c.error = uncompared_error * c.most;
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

static void make_occluders(struct occluded *o, const struct shaft *l, const struct facet *g)
{
	o->occluders = 0;
	for (int i = 0; i < l->occluders; i++)
		o->occluders += occ_occluder_make(l->set, l->occluder[i], g,
		                                  &o->visible.occluder[o->occluders]);
}

/* How near the occluders come to a facet: its points' shadows then change quickly. */
static double clearance(const struct occluded *o, const struct facet *f)
{
	double least = INFINITY;

	for (int i = 0; i < o->occluders; i++)
		for (int k = 0; k < o->visible.occluder[i].corners; k++)
			least = fmin(least,
			             fmax(0, v3_dot(f->normal, o->visible.occluder[i].corner[k]) -
			                         f->offset));
	return least;
}

double occ_occluded_exchange(struct occluded *o, struct unoccluded *unoccluded,
                             const struct shaft *l, double tolerance, int most, double *error,
                             struct err *e)
{
	struct integral in = {
		.o = o, .unoccluded = unoccluded, .f = l->a, .g = l->b, .near = l->set->near, .e = e
	};

	make_occluders(o, l, l->b);
	if (clearance(o, l->a) < clearance(o, l->b)) {
		in.f = l->b;
		in.g = l->a;
		make_occluders(o, l, l->a);
	}
	occ_visible_begin(&o->visible, o->occluders, in.near);
	o->cell.n = 0;
	uint64_t all = o->occluders ? UINT64_MAX >> (64 - o->occluders) : 0;
	/* Cutting pays where more is asked for than cells across shadows' edges can tell. */
	double whole = geo_unoccluded_exchange(unoccluded, in.f, none, in.g, none);
	in.cut = tolerance < 2 * edge_error * whole; /* 2: a guess */
	if (in.cut)
		occ_shadow_edges(o->visible.occluder, o->occluders, in.f, in.g, in.near,
		                 &in.shadows);
	if (put_whole(&in, all & ~in.shadows.idle, whole))
		return NAN;
	double visible = integrate(&in, tolerance, most, error);
	/* Rounding where occluders touch a facet's edges must not carry light through walls. */
	return visible < rounding * whole ? 0 : visible;
}
