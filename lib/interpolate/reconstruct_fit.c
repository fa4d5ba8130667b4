#include "lib/interpolate/reconstruct_internal.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"

/* A fit is used if its variance at the vertex is at most this many times the variance of one
 * element: a sixth inside a regular grid, more where a function is drawn out beyond few
 * elements, as at corners of a surface. A guess. */
static const double accepted_variance = 1.5;

/* A fit needs positions whose covariance has a determinant above this part of its trace squared:
 * anything but a line, since accepted_variance rules out what is nearly one. */
static const double plane_from = 1e-12;

/* A group has a normal if those of its elements add up to this part of their area. A guess. */
static const double normal_from = .1;

/* 1 over the unexplained part of the elements' variation from which a fit may not leave their
 * range. A guess. */
static const double slack_by_unexplained = 4;

/* Chi-square per degree of freedom from which a fit does not count at all; at 1 less, which is
 * what noise alone makes of it, it counts in full. A guess. */
static const double inconsistent_from = 2;

/* A linear function over some elements near a vertex, in coordinates (x, y) of the
 * tangent plane about it: value = mean + gradient . (-mx, -my). */
struct fit {
	size_t n, ring1;          /* elements in the list; those at the vertex itself */
	double mx, my;            /* weighted mean position */
	double ixx, ixy, iyy;     /* inverse covariance of positions */
	double variance;          /* of the value at the vertex over that of an element */
};

/* What a vector of channels of a list of elements looks like to a fit. */
struct channels {
	lanes value;              /* of the fit at the vertex */
	lanes gx, gy, mean;
	lanes low, high;          /* range over the elements at the vertex */
	lanes slack;              /* how far beyond it the fit may go */
};

/* Area-weighted normal of the group; 0 when it has none to speak of. */
static int group_normal(const struct reconstruct_job *j, size_t group, double n[3])
{
	memset(n, 0, 3 * sizeof *n);
	double area = 0;
	for (uint32_t i = j->g.start[group]; i < j->g.start[group + 1]; i++) {
		const struct reconstruct_place *p = &j->place[j->g.corner[i] / 3];
		v3_mad(n, p->area, p->normal, n);
		area += p->area;
	}
	return v3_normalise(n) > normal_from * area && area > 0;
}

static void list_group(const struct reconstruct_job *j, struct reconstruct_scratch *s, size_t group,
                       size_t *n)
{
	s->met[group] = (uint32_t)group + 1;
	for (uint32_t i = j->g.start[group]; i < j->g.start[group + 1]; i++) {
		uint32_t e = j->g.corner[i] / 3;
		if (s->listed[e] == (uint32_t)group + 1)
			continue;
		s->listed[e] = (uint32_t)group + 1;
		s->near[(*n)++] = (struct reconstruct_near){ .element = e };
	}
}

/* Adds the elements of the same smooth surface that touch those listed from
 * `begin` on and face the same way as the group. Returns how many. */
static size_t add_ring(const struct reconstruct_job *j, struct reconstruct_scratch *s, size_t group,
                       const double normal[3], size_t begin, size_t end)
{
	size_t n = end, seen = 0;

	for (size_t i = begin; i < end; i++)
		for (size_t k = 0; k < 3; k++) {
			uint32_t c = j->g.group[3 * (size_t)s->near[i].element + k];
			if (s->met[c] == (uint32_t)group + 1)
				continue;
			s->met[c] = (uint32_t)group + 1;
			for (uint32_t q = j->g.start[c]; q < j->g.start[c + 1]; q++) {
				uint32_t e = j->g.corner[q] / 3;
				if (n - end >= NEAR_MAX || seen++ >= SEEN_MAX)
					return n - end;
				if (s->listed[e] == (uint32_t)group + 1 ||
				    v3_dot(normal, j->place[e].normal) < COS_CREASE)
					continue;
				s->listed[e] = (uint32_t)group + 1;
				s->near[n++] = (struct reconstruct_near){ .element = e };
			}
		}
	return n - end;
}

/* Coordinates of the elements listed from `begin` on about a vertex, in the tangent plane
 * of t and b. */
static void place(const struct reconstruct_job *j, struct reconstruct_scratch *s, size_t begin,
                  size_t end, const double vertex[3], const double t[3], const double b[3])
{
	for (size_t i = begin; i < end; i++) {
		struct reconstruct_near *p = &s->near[i];
		double d[3];
		v3_sub(j->place[p->element].centre, vertex, d);
		p->x = v3_dot(d, t);
		p->y = v3_dot(d, b);
		p->area = j->place[p->element].area;
	}
}

/* Prepares the least-squares fit over the listed elements. The prediction at the
 * vertex has variance (1 + d' C^-1 d) sum w^2 with d the distance of the vertex
 * from the mean position and C the covariance of positions (Draper & Smith,
 * Applied Regression Analysis, sec. 1.4, with weights). */
static void prepare(const struct reconstruct_scratch *s, struct fit *f)
{
	double xx = 0, xy = 0, yy = 0, w2 = 0, sum = 0;

	f->mx = f->my = 0;
	for (size_t i = 0; i < f->n; i++)
		sum += s->near[i].area;
	for (size_t i = 0; i < f->n; i++) {
		struct reconstruct_near *p = &s->near[i];
		p->w = p->area * (1 / sum);
		f->mx += p->w * p->x;
		f->my += p->w * p->y;
	}
	for (size_t i = 0; i < f->n; i++) {
		double w = s->near[i].w, x = s->near[i].x - f->mx, y = s->near[i].y - f->my;
		xx += w * x * x;
		xy += w * x * y;
		yy += w * y * y;
		w2 += w * w;
	}
	double det = xx * yy - xy * xy, trace = xx + yy;
	f->variance = (double)INFINITY;
	if (f->n < 3 || !(det > plane_from * trace * trace))
		return;
	f->ixx = yy / det;
	f->ixy = -xy / det;
	f->iyy = xx / det;
	f->variance = w2 * (1 + f->ixx * f->mx * f->mx + 2 * f->ixy * f->mx * f->my +
	                    f->iyy * f->my * f->my);
}

static inline lanes clamp(lanes x, lanes low, lanes high)
{
	return lanes_min(lanes_max(x, low), high);
}

/* Vector v of the means of listed element i. */
static inline lanes mean_of(const struct reconstruct_job *j, const struct reconstruct_scratch *s,
                            size_t i, size_t v)
{
	return j->h[s->near[i].element * j->vectors + v];
}

/* Fits a vector of channels. Slack: the range of the fitted elements times how much of
 * their variation a linear function explains, 0 from a quarter unexplained. */
static inline struct channels fit_channels(const struct reconstruct_job *j,
                                           const struct reconstruct_scratch *s, const struct fit *f,
                                           size_t v)
{
	const lanes none = { 0 };
	lanes low = four_all((double)INFINITY), high = none, cx = none, cy = none, variance = none;
	struct channels c = { .mean = none, .slack = none };

	for (size_t i = 0; i < f->n; i++) {
		lanes h = mean_of(j, s, i, v);
		c.mean += s->near[i].w * h;
		low = lanes_min(low, h);
		high = lanes_max(high, h);
		if (i + 1 == f->ring1)
			c.low = low, c.high = high;
	}
	for (size_t i = 0; i < f->n; i++) {
		const struct reconstruct_near *p = &s->near[i];
		lanes d = mean_of(j, s, i, v) - c.mean, wd = p->w * d;
		cx += wd * (p->x - f->mx);
		cy += wd * (p->y - f->my);
		variance += wd * d;
	}
	c.gx = f->ixx * cx + f->ixy * cy;
	c.gy = f->ixy * cx + f->iyy * cy;
	c.value = c.mean - c.gx * f->mx - c.gy * f->my;
	if (f->n > 3) {
		double free = (double)(f->n - 1) / (double)(f->n - 3);
		lanes left = free * (1 - (c.gx * cx + c.gy * cy) / variance);
		lanes part = clamp(1 - slack_by_unexplained * left, none, four_all(1));
		c.slack = four_choose(variance > 0, part * (high - low), none);
	}
	return c;
}

static inline lanes clamped(const struct channels *c)
{
	const lanes none = { 0 };
	lanes value = clamp(c->value, lanes_max(none, c->low - c->slack), c->high + c->slack);

	return four_choose(c->high > 0, value, none);
}

/* How far a fit is consistent with the elements' standard errors: 1 where its
 * chi-square per degree of freedom is at most 1, falling to 0 at 2. */
static inline lanes consistency(const struct reconstruct_job *j,
                                const struct reconstruct_scratch *s, const struct fit *f,
                                const struct channels *c, size_t v)
{
	const lanes none = { 0 };
	lanes chi2 = none;

	if (f->n <= 3)
		return none;
	for (size_t i = 0; i < f->n; i++) {
		const struct reconstruct_near *p = &s->near[i];
		lanes d = mean_of(j, s, i, v) - c->mean - c->gx * (p->x - f->mx) -
		          c->gy * (p->y - f->my);
		chi2 += d * d * j->precision[p->element * j->vectors + v];
	}
	return clamp(inconsistent_from - chi2 / (double)(f->n - 3), none, four_all(1));
}

/* Area-weighted mean of the n elements at the vertex: what is left without a fit. */
static void average(const struct reconstruct_job *j, const struct reconstruct_scratch *s, size_t n,
                    size_t vectors, lanes *value)
{
	double sum = 0;

	for (size_t i = 0; i < n; i++)
		sum += s->near[i].area;
	memset(value, 0, vectors * sizeof *value);
	for (size_t i = 0; i < n; i++) {
		double w = sum > 0 ? s->near[i].area / sum : 1. / (double)n;
		for (size_t v = 0; v < vectors; v++)
			value[v] += w * mean_of(j, s, i, v);
	}
}

/* Vectors that the sides modelled of a group's elements fill. */
static size_t group_vectors(const struct reconstruct_job *j, uint32_t element)
{
	int two =
	    j->sides == 2 && model_side_modelled(j->m, 2 * j->m->element.patch[element] + BACK);

	return lanes_vectors((size_t)j->columns << two);
}

/* Values at the vertex of a group. */
static void solve_group(const struct reconstruct_job *j, struct reconstruct_scratch *s,
                        size_t group)
{
	uint32_t corner = j->g.corner[j->g.start[group]];
	const double *vertex = &j->m->vertex[3 * (size_t)j->m->element.corner[corner]];
	size_t vectors = group_vectors(j, corner / 3), begin = 0;
	lanes *value = j->value + group * j->vectors;
	struct fit f = { 0 };
	double normal[3], t[3], b[3];
	int facing = group_normal(j, group, normal);

	v3_frame(normal, t, b);
	list_group(j, s, group, &f.n);
	f.ring1 = f.n;
	place(j, s, 0, f.n, vertex, t, b);
	for (int ring = 1; ring <= RINGS && facing; ring++) {
		prepare(s, &f);
		int good = f.variance <= accepted_variance;
		for (size_t v = 0; v < vectors && good; v++) {
			struct channels c = fit_channels(j, s, &f, v);
			value[v] = clamped(&c);
		}
		if (good && !j->precision)
			return;
		size_t more = add_ring(j, s, group, normal, begin, f.n);
		begin = f.n;
		f.n += more;
		place(j, s, begin, f.n, vertex, t, b);
		if (!good)
			continue;
		prepare(s, &f);
		for (size_t v = 0; v < vectors && f.variance <= accepted_variance; v++) {
			struct channels c = fit_channels(j, s, &f, v);
			value[v] += consistency(j, s, &f, &c, v) * (clamped(&c) - value[v]);
		}
		return;
	}
	average(j, s, f.ring1, vectors, value);
}

void interp_reconstruct_fit(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;

	for (size_t g = begin; g < end; g++)
		solve_group(j, &j->scratch[thread], g);
}
