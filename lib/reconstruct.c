#include "reconstruct.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mem.h"
#include "par.h"
#include "smooth.h"
#include "vec3.h"

/* cos 30 degrees: flatter edges are smoothed over. */
#define COS_CREASE .86602540378443865

enum {
	RINGS = 3,    /* of neighbours that a fit may reach */
	NEAR_MAX = 96,/* elements that one of them may add */
	SEEN_MAX = 4096 /* corners that may be looked at for it */
};

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

struct near {
	uint32_t element;
	double x, y, w;           /* tangent coordinates; weights sum to 1 */
};

struct scratch {
	uint32_t *stamp;          /* [elements] group + 1 that last listed it */
	struct near *near;
};

struct job {
	const struct model *m;
	const struct solution *s;
	struct smooth_groups g;
	int columns;              /* bands, twice where light straight from emitters and other
	                             light are interpolated apart: one has edges and little
	                             noise, the other noise and few edges */
	double *h;                /* [2 elements][columns] */
	double *error;            /* of them, or NULL */
	double *value;            /* [groups][2 sides][columns] at the vertices */
	double *rest;             /* [2 elements][columns] what their means still miss */
	double *shift;            /* [groups][2 sides][columns] */
	struct reconstruction *out;
	struct scratch *scratch;  /* one a thread */
};

/* What one channel (side and column) of a list of elements looks like to a fit. */
struct channel {
	double value;             /* of the fit at the vertex */
	double gx, gy, mean;
	double low, high;         /* range over the elements at the vertex */
	double slack;             /* how far beyond it the fit may go */
};

static double at(const struct job *j, uint32_t element, size_t channel)
{
	return j->h[2 * (size_t)element * (size_t)j->columns + channel];
}

/* Area-weighted normal of the group; 0 when it has none to speak of. */
static int group_normal(const struct job *j, size_t group, double n[3])
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

static void list_group(const struct job *j, struct scratch *s, size_t group, size_t *n)
{
	for (uint32_t i = j->g.start[group]; i < j->g.start[group + 1]; i++) {
		uint32_t e = j->g.corner[i] / 3;
		if (s->stamp[e] == (uint32_t)group + 1)
			continue;
		s->stamp[e] = (uint32_t)group + 1;
		s->near[(*n)++] = (struct near){ .element = e };
	}
}

/* Adds the elements of the same smooth surface that touch those listed from
 * `begin` on and face the same way as the group. Returns how many. */
static size_t add_ring(const struct job *j, struct scratch *s, size_t group,
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
				s->near[n++] = (struct near){ .element = e };
			}
		}
	return n - end;
}

/* Coordinates and weights of the listed elements about vertex v. */
static double place(const struct job *j, struct scratch *s, size_t n, uint32_t v,
                    const double normal[3])
{
	const struct model *m = j->m;
	double t[3], b[3], sum = 0;

	v3_frame(normal, t, b);
	for (size_t i = 0; i < n; i++) {
		struct near *p = &s->near[i];
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
static void prepare(const struct scratch *s, struct fit *f)
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
static struct channel fit_channel(const struct job *j, const struct scratch *s,
                                  const struct fit *f, size_t channel)
{
	struct channel c = { .low = (double)INFINITY };
	double cx = 0, cy = 0, variance = 0, low = (double)INFINITY, high = 0;

	for (size_t i = 0; i < f->n; i++) {
		double h = at(j, s->near[i].element, channel);
		c.mean += s->near[i].w * h;
		low = fmin(low, h);
		high = fmax(high, h);
		if (i + 1 == f->ring1)
			c.low = low, c.high = high;
	}
	for (size_t i = 0; i < f->n; i++) {
		double d = at(j, s->near[i].element, channel) - c.mean;
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
static double consistency(const struct job *j, const struct scratch *s,
                          const struct fit *f, const struct channel *c, size_t channel)
{
	size_t channels = 2 * (size_t)j->columns;
	double chi2 = 0;

	if (f->n <= 3)
		return 0;
	for (size_t i = 0; i < f->n; i++) {
		const struct near *p = &s->near[i];
		double error = j->error[p->element * channels + channel];
		double d = at(j, p->element, channel) - c->mean - c->gx * (p->x - f->mx) -
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
static void average(const struct job *j, const struct scratch *s, size_t n, double sum,
                    size_t channels, double *value)
{
	for (size_t c = 0; c < channels; c++) {
		value[c] = 0;
		for (size_t i = 0; i < n; i++)
			value[c] += (sum > 0 ? s->near[i].w : 1. / (double)n) *
			            at(j, s->near[i].element, c);
	}
}

/* Values at the vertex of a group. */
static void solve_group(const struct job *j, struct scratch *s, size_t group)
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

static void solve_groups(void *arg, size_t begin, size_t end, int thread)
{
	const struct job *j = arg;

	for (size_t g = begin; g < end; g++)
		solve_group(j, &j->scratch[thread], g);
}

/* ---- keeping means ----
 *
 * Fits flatten what is curved, and wide ones do so within the noise, but always to
 * the same side. What the means of elements miss is spread by area-weighted averages,
 * which keep its sum over a surface, and added: noise cancels in it, bias does not. */

/* Mean over an element of what its corners have. */
static double corner_mean(const struct job *j, const double *at_groups, size_t element,
                          size_t channel)
{
	size_t channels = 2 * (size_t)j->columns;
	const uint32_t *g = &j->g.group[3 * element];

	return (at_groups[g[0] * channels + channel] + at_groups[g[1] * channels + channel] +
	        at_groups[g[2] * channels + channel]) / 3;
}

static void find_rest(void *arg, size_t begin, size_t end, int thread)
{
	const struct job *j = arg;
	size_t channels = 2 * (size_t)j->columns;

	(void)thread;
	for (size_t e = begin; e < end; e++)
		for (size_t c = 0; c < channels; c++)
			j->rest[e * channels + c] = j->h[e * channels + c] -
			                            corner_mean(j, j->value, e, c);
}

static void spread_to_elements(void *arg, size_t begin, size_t end, int thread)
{
	const struct job *j = arg;
	size_t channels = 2 * (size_t)j->columns;

	(void)thread;
	for (size_t e = begin; e < end; e++)
		for (size_t c = 0; c < channels; c++)
			j->rest[e * channels + c] = corner_mean(j, j->shift, e, c);
}

static void spread_to_groups(void *arg, size_t begin, size_t end, int thread)
{
	const struct job *j = arg;
	size_t channels = 2 * (size_t)j->columns;

	(void)thread;
	for (size_t g = begin; g < end; g++) {
		double *shift = j->shift + g * channels, area = 0;
		memset(shift, 0, channels * sizeof *shift);
		for (uint32_t i = j->g.start[g]; i < j->g.start[g + 1]; i++) {
			size_t e = j->g.corner[i] / 3;
			double a = j->m->element_area[e];
			area += a;
			for (size_t c = 0; c < channels; c++)
				shift[c] += a * j->rest[e * channels + c];
		}
		for (size_t c = 0; c < channels && area > 0; c++)
			shift[c] /= area;
	}
}

/* Adds the shift, without leaving the range of the elements at the vertex further
 * than the fit did, and stores. */
static void store_groups(void *arg, size_t begin, size_t end, int thread)
{
	const struct job *j = arg;
	size_t channels = 2 * (size_t)j->columns, bands = (size_t)j->s->bands;

	(void)thread;
	for (size_t g = begin; g < end; g++)
		for (size_t c = 0; c < channels; c++) {
			size_t to = c / (size_t)j->columns * bands + c % bands;
			double value = j->value[g * channels + c], low = value, high = value;
			for (uint32_t i = j->g.start[g]; i < j->g.start[g + 1]; i++) {
				low = fmin(low, at(j, j->g.corner[i] / 3, c));
				high = fmax(high, at(j, j->g.corner[i] / 3, c));
			}
			value = fmin(fmax(value + j->shift[g * channels + c], low), high);
			for (uint32_t i = j->g.start[g]; i < j->g.start[g + 1]; i++)
				j->out->corner[j->g.corner[i] * 2 * bands + to] += (float)value;
		}
}

static void run(struct job *j, int threads)
{
	enum { CHUNK = 1024, SPREADS = 3 };

	par_for(j->g.groups, CHUNK, threads, solve_groups, j, NULL);
	par_for(j->m->elements, CHUNK, threads, find_rest, j, NULL);
	for (int i = 0; i < SPREADS; i++) {
		if (i > 0)
			par_for(j->m->elements, CHUNK, threads, spread_to_elements, j, NULL);
		par_for(j->g.groups, CHUNK, threads, spread_to_groups, j, NULL);
	}
	par_for(j->g.groups, CHUNK, threads, store_groups, j, NULL);
}

/* Adds a part of the irradiance to a column of the bands. */
static void add_part(struct job *j, const double *part, size_t column)
{
	const struct solution *s = j->s;
	size_t bands = (size_t)s->bands, n = s->element_sides * bands;

	for (size_t i = 0; i < s->groups * n; i++)
		j->h[i % n / bands * (size_t)j->columns + column * bands + i % bands] += part[i];
}

/* Standard errors of the columns: of all, if that is all that is known. */
static void set_errors(struct job *j, unsigned parts)
{
	const struct solution *s = j->s;
	size_t bands = (size_t)s->bands;

	for (size_t i = 0; i < s->element_sides * bands; i++) {
		double *to = &j->error[i / bands * (size_t)j->columns + i % bands];
		double all = s->error[i], direct = s->error_direct ? s->error_direct[i] : all;
		double other = s->error_direct ? sqrt(fmax(0, all * all - direct * direct)) : all;
		if ((size_t)j->columns > bands)
			to[bands] = other;
		*to = parts & PART_DIRECT ? direct : other;
	}
}

static int set_columns(struct job *j, unsigned parts, struct err *e)
{
	const struct solution *s = j->s;
	int apart = parts & PART_DIRECT && parts != PART_DIRECT && s->error && s->error_direct;

	j->columns = s->bands * (1 + apart);
	j->h = mem_new(s->element_sides, (size_t)j->columns * sizeof *j->h, "irradiance", e);
	if (!j->h || (s->error && !(j->error = mem_new(s->element_sides, (size_t)j->columns *
	                                               sizeof *j->error, "irradiance", e))))
		return -1;
	if (parts & PART_DIRECT)
		add_part(j, s->direct, 0);
	if (parts & PART_CAUSTIC)
		add_part(j, s->caustic, (size_t)apart);
	if (parts & PART_INDIRECT)
		add_part(j, s->indirect, (size_t)apart);
	if (s->error)
		set_errors(j, parts);
	return 0;
}

static int new_values(struct job *j, struct err *e)
{
	size_t bytes = 2 * (size_t)j->columns * sizeof(double);

	j->value = mem_new(j->g.groups, bytes, "irradiance at vertices", e);
	j->shift = mem_new(j->g.groups, bytes, "irradiance at vertices", e);
	j->rest = mem_new(j->m->elements, bytes, "irradiance", e);
	return j->value && j->shift && j->rest ? 0 : -1;
}

static int new_scratch(struct job *j, int threads, struct err *e)
{
	size_t most = 0;

	for (size_t g = 0; g < j->g.groups; g++)
		if (j->g.start[g + 1] - j->g.start[g] > most)
			most = j->g.start[g + 1] - j->g.start[g];
	j->scratch = mem_new((size_t)threads, sizeof *j->scratch, "scratch", e);
	for (int t = 0; t < threads && j->scratch; t++) {
		struct scratch *s = &j->scratch[t];
		s->stamp = mem_new(j->m->elements, sizeof *s->stamp, "scratch", e);
		s->near = mem_new(most + RINGS * NEAR_MAX, sizeof *s->near, "scratch", e);
		if (!s->stamp || !s->near)
			return -1;
	}
	return j->scratch ? 0 : -1;
}

static void free_job(struct job *j, int threads)
{
	for (int t = 0; t < threads && j->scratch; t++) {
		free(j->scratch[t].stamp);
		free(j->scratch[t].near);
	}
	free(j->scratch);
	free(j->h);
	free(j->error);
	free(j->value);
	free(j->rest);
	free(j->shift);
	smooth_groups_free(&j->g);
}

int reconstruct(const struct model *m, const struct solution *s, unsigned parts, int threads,
                struct reconstruction *r, struct err *e)
{
	struct job j = { .m = m, .s = s, .out = r };
	int bad = -1;

	*r = (struct reconstruction){ .elements = m->elements, .bands = s->bands };
	if (s->element_sides != 2 * m->elements)
		return err_set(e, "the solution has %zu element-sides, its model %zu",
		               s->element_sides, 2 * m->elements);
	if (m->elements <= SIZE_MAX / (6 * BANDS_MAX))
		r->corner = mem_new(m->elements * 6 * (size_t)s->bands, sizeof *r->corner,
		                    "irradiance at corners", e);
	if (r->corner && !set_columns(&j, parts, e) && !smooth_groups_new(m, COS_CREASE, &j.g, e) &&
	    !new_values(&j, e) && !new_scratch(&j, threads, e)) {
		run(&j, threads);
		bad = 0;
	}
	free_job(&j, threads);
	if (bad)
		reconstruction_free(r);
	return bad;
}

void reconstruction_free(struct reconstruction *r)
{
	free(r->corner);
	*r = (struct reconstruction){ 0 };
}
