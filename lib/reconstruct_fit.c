#include "reconstruct_parts.h"

#include <math.h>
#include <string.h>

#include "vec3.h"

/* A fit is used if its variance at the vertex is at most this many times the
 * variance of one element. */
static const double accepted_variance = 1.5;

/* A linear function over some elements near a vertex, in coordinates (x, y) of the
 * tangent plane about it: value = mean + gradient . (-mx, -my). */
struct fit {
	size_t n, ring1;          /* elements in the list; those at the vertex itself */
	double mx, my;            /* weighted mean position */
	double ixx, ixy, iyy;     /* inverse covariance of positions */
	double variance;          /* of the value at the vertex over that of an element */
};

/* What one channel (side and column) of a list of elements looks like to a fit. */
struct channel {
	double value;             /* of the fit at the vertex */
	double gx, gy, mean;
	double low, high;         /* range over the elements at the vertex */
	double slack;             /* how far beyond it the fit may go */
};

/* Area-weighted normal of the group; 0 when it has none to speak of. */
static int group_normal(const struct reconstruct_job *j, size_t group, double n[3])
{
	memset(n, 0, 3 * sizeof *n);
	double area = 0;
	for (uint32_t i = j->g.start[group]; i < j->g.start[group + 1]; i++) {
		uint32_t e = j->g.corner[i] / 3;
		v3_mad(n, j->m->element_area[e], &j->m->element_normal[3 * (size_t)e], n);
		area += j->m->element_area[e];
	}
	return v3_normalise(n) > .1 * area && area > 0;
}

static void list_group(const struct reconstruct_job *j, struct reconstruct_scratch *s, size_t group,
                       size_t *n)
{
	for (uint32_t i = j->g.start[group]; i < j->g.start[group + 1]; i++) {
		uint32_t e = j->g.corner[i] / 3;
		if (s->stamp[e] == (uint32_t)group + 1)
			continue;
		s->stamp[e] = (uint32_t)group + 1;
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
			for (uint32_t q = j->g.start[c]; q < j->g.start[c + 1]; q++) {
				uint32_t e = j->g.corner[q] / 3;
				if (n - end >= NEAR_MAX || seen++ >= SEEN_MAX)
					return n - end;
				if (s->stamp[e] == (uint32_t)group + 1 ||
				    v3_dot(normal, &j->m->element_normal[3 * (size_t)e]) <
				        COS_CREASE)
					continue;
				s->stamp[e] = (uint32_t)group + 1;
				s->near[n++] = (struct reconstruct_near){ .element = e };
			}
		}
	return n - end;
}

/* Coordinates and weights of the listed elements about vertex v. */
static double place(const struct reconstruct_job *j, struct reconstruct_scratch *s, size_t n,
                    uint32_t v, const double normal[3])
{
	const struct model *m = j->m;
	double t[3], b[3], sum = 0;

	v3_frame(normal, t, b);
	for (size_t i = 0; i < n; i++) {
		struct reconstruct_near *p = &s->near[i];
		double c[3] = { 0, 0, 0 };
		for (size_t k = 0; k < 3; k++)
			v3_mad(c, 1. / 3, &m->vertex[3 * (size_t)m->element[3 * (size_t)p->element + k]], c);
		v3_sub(c, &m->vertex[3 * (size_t)v], c);
		p->x = v3_dot(c, t);
		p->y = v3_dot(c, b);
		p->w = m->element_area[p->element];
		sum += p->w;
	}
	for (size_t i = 0; i < n && sum > 0; i++)
		s->near[i].w /= sum;
	return sum;
}

/* Prepares the least-squares fit over the listed elements. The prediction at the
 * vertex has variance (1 + d' C^-1 d) sum w^2 with d the distance of the vertex
 * from the mean position and C the covariance of positions (Draper & Smith,
 * Applied Regression Analysis, sec. 1.4, with weights). */
static void prepare(const struct reconstruct_scratch *s, struct fit *f)
{
	double xx = 0, xy = 0, yy = 0, w2 = 0;

	f->mx = f->my = 0;
	for (size_t i = 0; i < f->n; i++) {
		f->mx += s->near[i].w * s->near[i].x;
		f->my += s->near[i].w * s->near[i].y;
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
	if (f->n < 3 || !(det > 1e-12 * trace * trace))
		return;
	f->ixx = yy / det;
	f->ixy = -xy / det;
	f->iyy = xx / det;
	f->variance = w2 * (1 + f->ixx * f->mx * f->mx + 2 * f->ixy * f->mx * f->my +
	                    f->iyy * f->my * f->my);
}

/* Fits one channel. Slack: the range of the fitted elements times how much of
 * their variation a linear function explains, 0 from a quarter unexplained. */
static struct channel fit_channel(const struct reconstruct_job *j, const struct reconstruct_scratch *s,
                                  const struct fit *f, size_t channel)
{
	struct channel c = { .low = (double)INFINITY };
	double cx = 0, cy = 0, variance = 0, low = (double)INFINITY, high = 0;

	for (size_t i = 0; i < f->n; i++) {
		double h = reconstruct_mean(j, s->near[i].element, channel);
		c.mean += s->near[i].w * h;
		low = fmin(low, h);
		high = fmax(high, h);
		if (i + 1 == f->ring1)
			c.low = low, c.high = high;
	}
	for (size_t i = 0; i < f->n; i++) {
		double d = reconstruct_mean(j, s->near[i].element, channel) - c.mean;
		cx += s->near[i].w * d * (s->near[i].x - f->mx);
		cy += s->near[i].w * d * (s->near[i].y - f->my);
		variance += s->near[i].w * d * d;
	}
	c.gx = f->ixx * cx + f->ixy * cy;
	c.gy = f->ixy * cx + f->iyy * cy;
	c.value = c.mean - c.gx * f->mx - c.gy * f->my;
	if (f->n > 3 && variance > 0) {
		double left = 1 - (c.gx * cx + c.gy * cy) / variance;
		left *= (double)(f->n - 1) / (double)(f->n - 3);
		c.slack = fmax(0, fmin(1, 1 - 4 * left)) * (high - low);
	}
	return c;
}

static double clamped(const struct channel *c)
{
	if (c->high <= 0)
		return 0;
	return fmin(fmax(c->value, fmax(0, c->low - c->slack)), c->high + c->slack);
}

/* How far a fit is consistent with the elements' standard errors: 1 where its
 * chi-square per degree of freedom is at most 1, falling to 0 at 2. */
static double consistency(const struct reconstruct_job *j, const struct reconstruct_scratch *s,
                          const struct fit *f, const struct channel *c, size_t channel)
{
	size_t channels = 2 * (size_t)j->columns;
	double chi2 = 0;

	if (f->n <= 3)
		return 0;
	for (size_t i = 0; i < f->n; i++) {
		const struct reconstruct_near *p = &s->near[i];
		double error = j->error[p->element * channels + channel];
		double d = reconstruct_mean(j, p->element, channel) - c->mean - c->gx * (p->x - f->mx) -
		           c->gy * (p->y - f->my);
		if (d == 0)
			continue;
		if (!(error > 0))
			return 0;
		chi2 += d * d / (error * error);
	}
	return fmax(0, fmin(1, 2 - chi2 / (double)(f->n - 3)));
}

/* Area-weighted mean of the elements at the vertex: what is left without a fit. */
static void average(const struct reconstruct_job *j, const struct reconstruct_scratch *s, size_t n,
                    double sum, size_t channels, double *value)
{
	for (size_t c = 0; c < channels; c++) {
		value[c] = 0;
		for (size_t i = 0; i < n; i++)
			value[c] += (sum > 0 ? s->near[i].w : 1. / (double)n) *
			            reconstruct_mean(j, s->near[i].element, c);
	}
}

/* Values at the vertex of a group. */
static void solve_group(const struct reconstruct_job *j, struct reconstruct_scratch *s, size_t group)
{
	uint32_t corner = j->g.corner[j->g.start[group]], vertex = j->m->element[corner];
	uint32_t side = 2 * j->m->element_patch[corner / 3];
	size_t sides = model_side_modelled(j->m, side + BACK) ? 2 : 1, begin = 0;
	size_t channels = sides * (size_t)j->columns;
	double *value = j->value + 2 * group * (size_t)j->columns;
	struct fit f = { 0 };
	double normal[3];
	int facing = group_normal(j, group, normal);

	list_group(j, s, group, &f.n);
	f.ring1 = f.n;
	double sum = place(j, s, f.n, vertex, normal);
	average(j, s, f.n, sum, channels, value);
	if (!facing)
		return;
	prepare(s, &f);
	for (int ring = 1; ring <= RINGS; ring++) {
		int good = f.variance <= accepted_variance;
		for (size_t c = 0; c < channels && good; c++) {
			struct channel t = fit_channel(j, s, &f, c);
			value[c] = clamped(&t);
		}
		if (good && !j->error)
			return;
		size_t more = add_ring(j, s, group, normal, begin, f.n);
		begin = f.n;
		f.n += more;
		place(j, s, f.n, vertex, normal);
		prepare(s, &f);
		if (!good)
			continue;
		for (size_t c = 0; c < channels && f.variance <= accepted_variance; c++) {
			struct channel t = fit_channel(j, s, &f, c);
			double b = consistency(j, s, &f, &t, c);
			value[c] += b * (clamped(&t) - value[c]);
		}
		return;
	}
}

void reconstruct_fit(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;

	for (size_t g = begin; g < end; g++)
		solve_group(j, &j->scratch[thread], g);
}
