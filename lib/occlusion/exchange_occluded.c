#include "lib/occlusion/exchange_occluded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/geometry/contour.h"
#include "lib/geometry/cubature.h"
#include "lib/occlusion/shadow_edges.h"

struct cell {
	struct facet_room shape;
	uint64_t occluders;           /* that may hide something from it */
	uint32_t edges;               /* bits of those that may cross it */
	int dark;                     /* how many times in a row all its points saw nothing */
	const struct plane *limit;    /* of a shadow that ends in it: where to cut it first; or NULL */
	/* Exchange areas, m^2. */
	double whole;                 /* about that of the cell if nothing were hidden */
	double value;
	double uneven;                /* how far what its points see is from linear */
	double unseen;                /* what shadows that end in it may hide between its points */
	double error;
};

/* How errors of cells are estimated. Samples never prove an integral: these were chosen so that of
 * some thousand random pairs none is off by more than it states and was asked for, and most by a
 * hundredth (tests/bench/pairs.c, with other pairs). Errors that are parts of `uneven` or `whole`
 * shrink with the cell; none shrinks faster than the gains let it. */
static const double first_least = .1;    /* of the whole, for the first cell */
static const double cut_error = 1;       /* of `uneven`, for parts that a cut leaves */
static const double uneven_least = .004; /* of `uneven`, however well parts agree with the whole */
/* How many times a cut may lessen the error; and quartering: more by as much as parts agree better
 * than smooth ones do, up to a most: half of what a rule of fifth order gains. */
static const double cut_gain = 4, quarter_gain = 12, smooth_gain = 32;
/* What quartering changes, by `uneven`: of smooth integrands, and of such as have kinks, where the
 * change is the error; where the integrand is smooth the error is so much of it. */
static const double smooth = .003, rough = .03, smooth_error = .125;
/* Of what an occluder hides in a cell where its shadow ends; all if its shadow takes less than
 * such a part of the cell. */
static const double limit_error = .15, missed_part = .3;
/* Of the whole, where points see nothing without proof; within such a cell so many times less. */
static const double dark_error = .05, dark_gain = 4;
/* Of the total: errors of many cells partly cancel, those of like ones need not. */
static const double random_part = 2, common_part = .1;
/* How far quarters are from equal, of the length and width. */
static const double quarter_shift = .08;

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
	struct shadows *shadows;
	double value;                 /* of all cells, and what is exact */
	double error, squares;        /* sums over the cells in the heap */
	double stuck;                 /* errors of cells too small to divide */
	uint64_t quartered;           /* cells */
	struct err *e;
};

void occ_occluded_free(struct occluded *o)
{
	free(o->cell.data);
	free(o->heap.data);
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

static double visible_from(const struct integral *in, uint64_t occluders, const double x[3])
{
	return occ_visible_exchange(&in->o->visible, x, in->f->normal, in->g, occluders, in->e);
}

/* How far what Radon's seven points of a triangle see is from linear. */
static double uneven_triangle(const double v[7])
{
	/* Rings stand at these parts of the way from the centre to the corners (or beyond). */
	const double at[2] = { (1 + sqrt(15)) / 7, (1 - sqrt(15)) / 7 };
	double mean[2] = { (v[0] + v[1] + v[2]) / 3, (v[3] + v[4] + v[5]) / 3 };
	double off = fmax(fabs(mean[0] - v[6]), fabs(mean[1] - v[6]));

	for (int i = 0; i < 3; i++)
		off = fmax(off, fabs(at[1] / at[0] * (v[i] - mean[0]) - (v[3 + i] - mean[1])));
	return off;
}

/* The same of a quadrilateral. */
static double uneven_square(const double v[7])
{
	const double steeper = sqrt(1. / 3) / sqrt(14. / 15);
	double off = fmax(fabs((v[1] + v[2]) / 2 - v[0]),
	                  fabs((v[3] + v[4] + v[5] + v[6]) / 4 - v[0]));

	off = fmax(off, fabs((v[3] - v[4] - v[5] + v[6]) / 4));
	return fmax(off, fabs((v[3] - v[4] + v[5] - v[6]) / 4 - (v[1] - v[2]) / 2 * steeper));
}

static void measure(const struct integral *in, struct cell *c, const struct facet *f)
{
	double x[4][4 * FACET_CORNERS], v[7];
	struct cubature p = { 0, x[0], x[1], x[2], x[3] };

	geo_cubature_fill(f, 1, &p);
	c->value = c->uneven = 0;
	for (int i = 0; i < p.n; i += 8) {
		double area = 0, sum = 0;
		for (int k = 0; k < 7; k++) {
			double at[3] = { p.x[i + k], p.y[i + k], p.z[i + k] };
			v[k] = visible_from(in, c->occluders, at);
			sum += p.w[i + k] * v[k];
			area += p.w[i + k];
		}
		int triangle = f->n % 2 && i + 8 == p.n;
		c->value += sum;
		c->uneven += area * (triangle ? uneven_triangle(v) : uneven_square(v));
	}
}

/* What one occluder hides of g from a point. */
static double hidden_by(const struct integral *in, int occluder, const double x[3])
{
	return geo_contour_point(x, in->f->normal, in->g->n, in->g->v) -
	       visible_from(in, (uint64_t)1 << occluder, x);
}

/* What occluders whose shadows end in a cell may hide there that its points do not see. */
static void look_at_limits(const struct integral *in, struct cell *c, const struct facet *f,
                           uint64_t crossed)
{
	double worst = 0;

	c->unseen = 0;
	c->limit = NULL;
	for (; crossed; crossed &= crossed - 1) {
		int k = __builtin_ctzll(crossed);
		struct facet_room part;
		const struct plane *limit;
		if (!occ_shadow_part(in->shadows, k, f, in->near, &part, &limit)) {
			c->occluders &= ~((uint64_t)1 << k);
			continue;
		}
		double share = part.f.area < missed_part * f->area ? 1 : limit_error;
		double doubt = share * part.f.area * hidden_by(in, k, part.f.centre);
		c->unseen += doubt;
		if (doubt > worst) {
			worst = doubt;
			c->limit = limit;
		}
	}
}

/* Is it sure that occluders, one or together, hide all from a cell? */
static int dark(const struct integral *in, const struct cell *c, const struct facet *f)
{
	return occ_occluders_hide(in->o->visible.occluder, c->occluders, f, in->g, in->near, HALVINGS);
}

/* Measures a cell: 1, or 0 if it is exact and so settled. */
static int take(struct integral *in, struct cell *c, const struct facet *f)
{
	uint64_t crossed;

	c->occluders = occ_shadow_on(in->shadows, c->occluders, f, in->near, &crossed);
	if (crossed)
		look_at_limits(in, c, f, crossed);
	if (!c->occluders) {
		in->value += geo_unoccluded_exchange(in->unoccluded, f, none, in->g, none);
		return 0;
	}
	if (visible_from(in, c->occluders, f->centre) <= 0 && dark(in, c, f))
		return 0;
	measure(in, c, f);
	c->dark = c->value <= 0 ? c->dark + 1 : 0;
	return 1;
}

/* ---- the worst cell: a heap ---- */

struct rank {
	double error;
	size_t cell;
};

static int before(const struct rank *a, const struct rank *b)
{
	return a->error > b->error || (a->error == b->error && a->cell < b->cell);
}

static int put_cell(struct integral *in, const struct cell *c, size_t at)
{
	struct array *cells = &in->o->cell, *heap = &in->o->heap;

	if (at == cells->n) {
		if (mem_append(cells, c, 1, sizeof *c, in->e))
			return -1;
	} else {
		((struct cell *)cells->data)[at] = *c;
	}
	if (mem_reserve(heap, 1, sizeof(struct rank), in->e))
		return -1;
	struct rank *h = heap->data, new = { c->error, at };
	size_t i = heap->n++;
	for (; i && before(&new, &h[(i - 1) / 2]); i = (i - 1) / 2)
		h[i] = h[(i - 1) / 2];
	h[i] = new;
	in->value += c->value;
	in->error += c->error;
	in->squares += c->error * c->error;
	return 0;
}

static size_t take_worst(struct integral *in)
{
	struct array *heap = &in->o->heap;
	struct rank *h = heap->data, first = h[0], last = h[--heap->n];
	size_t i = 0, k;

	for (; (k = 2 * i + 1) < heap->n; i = k) {
		k += k + 1 < heap->n && before(&h[k + 1], &h[k]);
		if (!before(&h[k], &last))
			break;
		h[i] = h[k];
	}
	h[i] = last;
	return first.cell;
}

/* ---- refinement ---- */

/* The cut that halves a cell best, of those with an occluder that matters to it; forgets
 * cuts that do not cross it. NULL if none is left. */
static const struct plane *best_cut(const struct integral *in, const struct shadow_cuts *s,
                                    struct cell *c, const struct facet *f)
{
	const struct plane *found = NULL;
	double best = 0;

	for (int i = 0; i < s->n; i++) {
		double lowest, highest;
		if (!(c->edges >> i & 1))
			continue;
		geo_facet_heights(f, s->cut[i].normal, s->cut[i].offset, &lowest, &highest);
		if (lowest >= -in->near || highest <= in->near || !(s->of[i] & c->occluders)) {
			c->edges &= ~((uint32_t)1 << i);
		} else if (fmin(-lowest, highest) > best * (highest - lowest)) {
			best = fmin(-lowest, highest) / (highest - lowest);
			found = &s->cut[i];
		}
	}
	return found;
}

/* The parts that a cell is refined into: on both sides of the edge of a shadow, or
 * quarters. Returns their number. */
static int divide(struct integral *in, struct cell *c, struct facet_room part[4])
{
	const struct facet *f = shape_of(c);
	const struct plane *cut = c->limit && c->unseen >= c->error / 2 ?
	                                  c->limit :
	                                  best_cut(in, &in->shadows->edges, c, f);

	if (cut && geo_facet_split(f, cut->normal, cut->offset, part))
		return 2;
	/* Not in halves: else the points of all levels may miss lines along its edges alike. */
	uint64_t dice = rng_mix(++in->quartered);
	const double shift[2] = { quarter_shift * ((double)(dice & 0xffff) / 0x8000 - 1),
	                          quarter_shift * ((double)(dice >> 16 & 0xffff) / 0x8000 - 1) };
	return geo_facet_quarter_off(f, shift, part) ? 4 : 0;
}

/* The error of all parts of a cell. off: by how much its value changed; quarters: or cut. */
static double error_of_parts(const struct cell *c, double uneven, double off, int quarters)
{
	double change = uneven > 0 ? off / uneven : off > 0 ? 1 : 0;
	double gain = cut_gain, error = cut_error * uneven;

	if (quarters) {
		gain = fmin(smooth_gain, quarter_gain * fmax(1, smooth / fmax(change, 1e-9)));
		error = off * fmin(1, fmax(smooth_error, change / rough));
	}
	return fmax(error, fmax(uneven_least * uneven, c->error / gain));
}

/* Gives parts their errors: by how uneven each is, a bit by its area. */
static void judge(const struct cell *c, struct cell *part, int n, int quarters, double off)
{
	double uneven = 0, area = 0;

	for (int k = 0; k < n; k++) {
		uneven += part[k].uneven;
		area += part[k].shape.f.area;
	}
	double all = error_of_parts(c, uneven, off, quarters);
	for (int k = 0; k < n; k++) {
		double share = part[k].shape.f.area / area;
		if (uneven > 0)
			share = (part[k].uneven / uneven + share / 10) / 1.1;
		part[k].error = fmax(all * share, part[k].unseen);
		if (part[k].dark)
			part[k].error = fmax(part[k].error, dark_error * part[k].whole *
			                                            pow(dark_gain, 1 - part[k].dark));
	}
}

/* Replaces the worst cell by its parts. */
static int refine(struct integral *in)
{
	size_t at = take_worst(in);
	struct cell c = ((struct cell *)in->o->cell.data)[at], part[4];
	struct facet_room room[4];
	int n = divide(in, &c, room), left = 0;

	in->error -= c.error;
	in->squares -= c.error * c.error;
	if (!n) { /* too small to divide */
		in->stuck += c.error;
		return 0;
	}
	double before = in->value, area = c.shape.f.area, sum = 0;
	for (int k = 0; k < n; k++) {
		part[left] = (struct cell){ .occluders = c.occluders, .edges = c.edges,
		                            .whole = c.whole * room[k].f.area / area,
		                            .dark = c.dark };
		set_shape(&part[left], &room[k].f);
		if (!take(in, &part[left], shape_of(&part[left])))
			continue;
		sum += part[left].value;
		left++;
	}
	double off = fabs(sum + in->value - before - c.value);
	in->value -= c.value;
	judge(&c, part, left, n == 4, off);
	for (int k = 0; k < left; k++)
		if (put_cell(in, &part[k], k ? in->o->cell.n : at))
			return -1;
	return 0;
}

static int put_whole(struct integral *in, uint64_t occluders, double whole)
{
	struct cell c = { .occluders = occluders, .whole = whole, .edges = UINT32_MAX };

	set_shape(&c, in->f);
	if (!take(in, &c, shape_of(&c)))
		return 0;
	/* It is between nothing and the whole for certain. */
	c.error = fmin(fmax(fmax(c.uneven, c.unseen), first_least * whole),
	               fmax(c.value, whole - c.value));
	return put_cell(in, &c, 0);
}

/* ---- the integral ---- */

/* The error of the sum of all cells. */
static double stated(const struct integral *in)
{
	double likely = common_part * in->error + random_part * sqrt(fmax(0, in->squares));

	return in->stuck + fmin(in->error, likely);
}

static int integrate(struct integral *in, double tolerance, int most)
{
	struct occluded *o = in->o;
	double stop = o->visible.evaluations + most;

	while (stated(in) > tolerance && o->heap.n && o->visible.evaluations < stop)
		if (refine(in))
			return -1;
	/* Sums that were added to and taken from: once more, without their rounding. */
	const struct rank *h = o->heap.data;
	in->error = in->squares = 0;
	for (size_t i = 0; i < o->heap.n; i++) {
		in->error += h[i].error;
		in->squares += h[i].error * h[i].error;
	}
	in->error = stated(in);
	return 0;
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
		.o = o, .unoccluded = unoccluded, .f = l->a, .g = l->b, .near = l->set->near,
		.shadows = &o->shadows, .e = e
	};

	make_occluders(o, l, l->b);
	if (clearance(o, l->a) < clearance(o, l->b)) {
		in.f = l->b;
		in.g = l->a;
		make_occluders(o, l, l->a);
	}
	occ_visible_begin(&o->visible, o->occluders, in.near);
	o->cell.n = o->heap.n = 0;
	uint64_t all = o->occluders ? UINT64_MAX >> (64 - o->occluders) : 0;
	double whole = geo_unoccluded_exchange(unoccluded, in.f, none, in.g, none);
	/* Where all of it would not matter, neither does where shadows end: as of no occluders. */
	occ_shadow_edges(o->visible.occluder, whole > tolerance ? o->occluders : 0, in.f, in.g,
	                 in.near, in.shadows);
	if (put_whole(&in, all & ~in.shadows->idle, whole) || integrate(&in, tolerance, most))
		return NAN;
	*error = in.error;
	/* Rounding where occluders touch a facet's edges must not carry light through walls. */
	return in.value < rounding * whole ? 0 : in.value;
}
