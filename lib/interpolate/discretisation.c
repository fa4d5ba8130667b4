#include "lib/interpolate/discretisation.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/base/parallel.h"
#include "lib/base/vec.h"
#include "lib/data/solution.h"
#include "lib/interpolate/smooth_groups.h"

/* The error of linear interpolation (root mean square over an element) over the second
 * difference, where that is the same all around, as in a curved field, and over its
 * variation, as at steps. Measured for such fields on jittered grids: test_discretisation.c
 * prints and checks stated over true errors of both. */
static const double error_by_curvature = 1. / 3, error_by_roughness = 1.7;

/* Noise is not equal everywhere: so many times its variance is taken for no detail. A guess. */
static const double noise_guard = 2;

/* A fit is made where the determinant of the positions' covariance is above this part of its trace
 * squared (a quarter at most): elements in a line, thirty times as long as wide, fix no plane.
 * A guess. */
static const double plane_from = 1e-3;

/* Counts. NEAR_MAX: elements that touch one, a dozen as a rule; further ones are left out, a guess.
 * CHUNK: work for a thread at a time. */
enum { NEAR_MAX = 64, CHUNK = 256 };

enum { PARTS = 2 }; /* of irradiance: direct and other */

struct near {
	uint32_t element;
	int shared;           /* vertices */
	double x, y, w;       /* centroid in the tangent plane; weight */
};

struct job {
	const struct model *m;
	struct solution *s;
	struct smooth_groups g;
	/* [2E][parts][bands]: light straight from emitters, which has the edges, apart from
	 * other light, which has the noise. */
	double *h;            /* irradiance */
	double *variance;     /* of it, by the standard errors */
	double *difference;   /* second difference; NAN: not determined */
	double *noise;        /* its variance */
};

/* Elements of the same smooth surface that share `corners` vertices or more with e, by
 * place. */
static size_t list_near(const struct job *j, size_t e, int corners, struct near *near)
{
	size_t n = 0, kept = 0;

	for (size_t k = 0; k < 3; k++) {
		uint32_t group = j->g.group[3 * e + k];
		for (uint32_t q = j->g.start[group]; q < j->g.start[group + 1]; q++) {
			uint32_t other = j->g.corner[q] / 3;
			size_t i = 0;
			while (i < n && near[i].element != other)
				i++;
			if (other == e || (i == n && n == NEAR_MAX))
				continue;
			if (i == n)
				near[n++] = (struct near){ .element = other };
			near[i].shared++;
		}
	}
	for (size_t i = 0; i < n; i++)
		if (near[i].shared >= corners)
			near[kept++] = near[i];
	return kept;
}

static void centroid(const struct model *m, size_t e, double c[3])
{
	memset(c, 0, 3 * sizeof *c);
	for (size_t k = 0; k < 3; k++)
		v3_mad(c, 1. / 3, &m->vertex[3 * (size_t)m->element.corner[3 * e + k]], c);
}

static void place(const struct model *m, size_t e, struct near *near, size_t n)
{
	double at[3], t[3], b[3], sum = 0;

	centroid(m, e, at);
	v3_frame(&m->element.normal[3 * e], t, b);
	for (size_t i = 0; i < n; i++) {
		double c[3];
		centroid(m, near[i].element, c);
		v3_sub(c, at, c);
		near[i].x = v3_dot(c, t);
		near[i].y = v3_dot(c, b);
		near[i].w = m->element.area[near[i].element];
		sum += near[i].w;
	}
	for (size_t i = 0; i < n; i++)
		near[i].w = sum > 0 ? near[i].w / sum : 1. / (double)n;
}

/* Turns weights into those of the least-squares plane's value at the origin: their sum
 * is 1 and first moments 0. 0 if the elements do not span a plane. */
static int fit_weights(struct near *near, size_t n)
{
	double mx = 0, my = 0, xx = 0, xy = 0, yy = 0;

	for (size_t i = 0; i < n; i++) {
		mx += near[i].w * near[i].x;
		my += near[i].w * near[i].y;
	}
	for (size_t i = 0; i < n; i++) {
		double x = near[i].x - mx, y = near[i].y - my;
		xx += near[i].w * x * x;
		xy += near[i].w * x * y;
		yy += near[i].w * y * y;
	}
	double det = xx * yy - xy * xy, trace = xx + yy;
	if (n < 3 || !(det > plane_from * trace * trace))
		return 0;
	for (size_t i = 0; i < n; i++) {
		double x = near[i].x - mx, y = near[i].y - my;
		near[i].w *= 1 - (mx * (yy * x - xy * y) + my * (xx * y - xy * x)) / det;
	}
	return 1;
}

/* The elements that predict e, with their weights: those at its edges if they surround
 * it, else all that touch it. 0 if none do. */
static size_t stencil(const struct job *j, size_t e, struct near *near)
{
	for (int corners = 2; corners > 0; corners--) {
		size_t n = list_near(j, e, corners, near);
		if (corners == 2 && n < 3)
			continue;
		place(j->m, e, near, n);
		if (fit_weights(near, n))
			return n;
	}
	return 0;
}

/* Channels of an element that are anything but 0: of one side or of both. */
static size_t channels_of(const struct job *j, size_t e)
{
	int sides = model_side_modelled(j->m, 2 * j->m->element.patch[e] + BACK) ? 2 : 1;

	return (size_t)sides * PARTS * (size_t)j->s->bands;
}

static void differences(void *arg, size_t begin, size_t end, int thread)
{
	const struct job *j = arg;
	size_t channels = 2 * PARTS * (size_t)j->s->bands;
	struct near near[NEAR_MAX];

	(void)thread;
	for (size_t e = begin; e < end; e++) {
		size_t n = stencil(j, e, near), some = channels_of(j, e);
		for (size_t c = 0; c < some; c++) {
			double d = j->h[e * channels + c], noise = j->variance[e * channels + c];
			for (size_t i = 0; i < n; i++) {
				size_t at = near[i].element * channels + c;
				d -= near[i].w * j->h[at];
				noise += near[i].w * near[i].w * j->variance[at];
			}
			j->difference[e * channels + c] = n ? d : (double)NAN;
			j->noise[e * channels + c] = noise;
		}
	}
}

/* ---- noise ---- */

/* Stated errors take samples for independent; stratified ones do the better, the more there are. So
 * elements are looked at by classes of how many independent samples their light is worth, H^2 over its
 * variance, in steps of 4. A class of fewer than CLASS_LEAST is as good as the one below, the least
 * as all are: a guess, with which the quantile is known to a tenth. */
enum { CLASSES = 12, CLASS_LEAST = 256 };

struct scales {
	double of[CLASSES];
};

/* The light of a side, difference squared and variance of the parts begin to end together. */
struct light {
	double h, difference, noise, variance;
};

static struct light light_of(const struct job *j, size_t i, size_t begin, size_t end)
{
	size_t bands = (size_t)j->s->bands;
	struct light l = { 0 };

	for (size_t part = begin; part < end; part++) {
		size_t at = (i / bands * PARTS + part) * bands + i % bands;
		l.h += j->h[at];
		l.difference += j->difference[at];
		l.noise += j->noise[at];
		l.variance += j->variance[at];
	}
	return l;
}

/* Its class: the number below. */
static double class_of(const struct light *l)
{
	double samples = l->variance > 0 ? l->h * l->h / l->variance : 1;

	return fmax(0, fmin(CLASSES - 1, .5 * log2(samples)));
}

/* Between the middles of classes. */
static double scale_of(const struct scales *s, const struct light *l)
{
	double at = fmax(0, fmin(CLASSES - 1, class_of(l) - .5)), below = fmin(CLASSES - 2, floor(at));
	const double *of = &s->of[(size_t)below];

	return of[0] + (at - below) * (of[1] - of[0]);
}

/* Difference squared over stated variance, by class, in bins of its logarithm: 16 bins a factor of
 * 2 are 4 % each, and span 2^64. */
enum { BINS = 1024, A_FACTOR_2 = 16 };

typedef uint32_t bins[CLASSES][BINS];

static void count_ratios(const struct job *j, size_t begin, size_t end, bins count)
{
	/* 2^-30, near the lower end of the bins at 2^-32. */
	static const double ratio_least = 1e-9;

	for (size_t i = 0; i < j->s->element_sides * (size_t)j->s->bands; i++) {
		struct light l = light_of(j, i, begin, end);
		if (isnan(l.difference) || !(l.noise > 0))
			continue;
		double ratio = fmax(l.difference * l.difference / l.noise, ratio_least);
		double bin = BINS / 2 + A_FACTOR_2 * log2(ratio);
		count[(size_t)class_of(&l)][(size_t)fmax(0, fmin(BINS - 1, bin))]++;
	}
}

/* A quantile of the ratios in bins, to 5 %. */
static double quantile(const uint32_t *count, size_t all, double q)
{
	size_t below = 0;
	int bin = 0;

	while (bin < BINS - 1 && (double)(below + count[bin]) < q * (double)all)
		below += count[bin++];
	return exp2((bin + .5 - BINS / 2) / A_FACTOR_2);
}

/* What variances of the parts begin to end are to be scaled by, by class. */
static int find_scales(const struct job *j, size_t begin, size_t end, struct scales *s,
                       struct err *e)
{
	/* The quantile that is compared: steps are in the other .3 of the elements, a guess that
	 * test_discretisation.c checks with a step. Of chi-square with one degree of freedom it is
	 * 1.0742. */
	static const double most = .7, chi_square = 1.0742;
	bins *count = mem_new(1, sizeof *count, "noise", e);
	uint32_t together[BINS] = { 0 };
	size_t n[CLASSES] = { 0 }, all = 0;

	if (!count)
		return -1;
	count_ratios(j, begin, end, *count);
	for (size_t i = 0; i < CLASSES * BINS; i++) {
		n[i / BINS] += (*count)[i / BINS][i % BINS];
		together[i % BINS] += (*count)[i / BINS][i % BINS];
		all += (*count)[i / BINS][i % BINS];
	}
	double last = all ? fmin(1, quantile(together, all, most) / chi_square) : 1;
	for (size_t c = 0; c < CLASSES; c++) {
		if (n[c] >= CLASS_LEAST)
			last = fmin(1, quantile((*count)[c], n[c], most) / chi_square);
		s->of[c] = last;
	}
	free(count);
	return 0;
}

/* Whether light arrives by patches, whose elements then say nothing of its noise. */
static int by_patches(const struct job *j)
{
	size_t bytes = 2 * PARTS * (size_t)j->s->bands * sizeof *j->h;
	int shared = 0;

	for (size_t e = 0; e < j->m->element.n; e++) {
		size_t first = j->m->patch.start[j->m->element.patch[e]];
		if (memcmp((char *)j->h + e * bytes, (char *)j->h + first * bytes, bytes))
			return 0;
		shared |= e != first;
	}
	return shared;
}

/* Where most elements of a class differ less from their neighbours than stated errors say, these are
 * scaled to what they do: those of the parts, and those of all light apart, since what a form
 * factor is off by is in both parts. */
static int correct_noise(struct job *j, struct err *e)
{
	size_t bands = (size_t)j->s->bands, n = j->s->element_sides * bands;
	struct scales part[PARTS], whole;

	for (size_t p = 0; p < PARTS; p++)
		if (find_scales(j, p, p + 1, &part[p], e))
			return -1;
	if (find_scales(j, 0, PARTS, &whole, e))
		return -1;
	for (size_t i = 0; i < n; i++) {
		struct light direct = light_of(j, i, 0, 1), other = light_of(j, i, 1, 2);
		struct light all = light_of(j, i, 0, PARTS);
		double *noise = &j->noise[i / bands * PARTS * bands + i % bands];
		double scale = scale_of(&part[0], &direct);
		j->s->error.sampling_direct[i] = sqrt(scale * direct.variance);
		j->s->error.sampling[i] = sqrt(fmax(scale * direct.variance,
		                                    scale_of(&whole, &all) * all.variance));
		noise[0] *= scale;
		noise[bands] *= scale_of(&part[1], &other);
	}
	return 0;
}

/* ---- errors ---- */

/* Moments of the differences in an element and around. */
struct moments {
	double area, mean, square, noise;
};

static void add(const struct job *j, size_t e, size_t at, struct moments *m)
{
	double a = j->m->element.area[e], d = j->difference[at];

	if (isnan(d))
		return;
	m->area += a;
	m->mean += a * d;
	m->square += a * d * d;
	m->noise += a * j->noise[at];
}

static double square_error(const struct moments *m)
{
	if (!(m->area > 0))
		return 0;
	double mean = m->mean / m->area, all = (m->square - noise_guard * m->noise) / m->area;
	double square = error_by_roughness * error_by_roughness * (all - mean * mean) +
	                error_by_curvature * error_by_curvature * mean * mean;
	return square > 0 ? square : 0;
}

static void errors(void *arg, size_t begin, size_t end, int thread)
{
	const struct job *j = arg;
	size_t bands = (size_t)j->s->bands, channels = 2 * PARTS * bands;
	struct near near[NEAR_MAX];

	(void)thread;
	for (size_t e = begin; e < end; e++) {
		size_t n = list_near(j, e, 1, near);
		double *to = &j->s->error.discretisation[2 * e * bands];
		double *direct = &j->s->error.discretisation_direct[2 * e * bands];
		size_t some = channels_of(j, e);
		memset(to, 0, 2 * bands * sizeof *to);
		for (size_t c = 0; c < some; c++) {
			struct moments m = { 0 };
			add(j, e, e * channels + c, &m);
			for (size_t i = 0; i < n; i++)
				add(j, near[i].element, near[i].element * channels + c, &m);
			size_t at = c / (PARTS * bands) * bands + c % bands;
			double square = square_error(&m);
			to[at] += square;
			if (c / bands % PARTS == 0)
				direct[at] = sqrt(square);
		}
		for (size_t c = 0; c < 2 * bands; c++)
			to[c] = sqrt(to[c]);
	}
}

static void take_parts(const struct job *j)
{
	const struct solution *s = j->s;
	size_t bands = (size_t)s->bands, n = s->element_sides * bands;

	for (size_t i = 0; i < s->groups * n; i++) {
		double *h = &j->h[i % n / bands * PARTS * bands + i % bands];
		h[0] += s->irradiance.direct[i];
		h[bands] += s->irradiance.caustic[i] + s->irradiance.indirect[i];
	}
	for (size_t i = 0; i < n; i++) {
		double *v = &j->variance[i / bands * PARTS * bands + i % bands];
		v[0] = s->error.sampling_direct[i] * s->error.sampling_direct[i];
		v[bands] = fmax(0, s->error.sampling[i] * s->error.sampling[i] - v[0]);
	}
}

int interp_discretisation(const struct model *m, struct solution *s, int independent, int threads,
                          struct err *e)
{
	size_t n = s->element_sides * PARTS * (size_t)s->bands;
	struct job j = { .m = m, .s = s };
	int bad = 1;

	j.h = mem_new(n, sizeof *j.h, "irradiance", e);
	j.difference = mem_new(n, sizeof *j.difference, "irradiance", e);
	j.noise = mem_new(n, sizeof *j.noise, "irradiance", e);
	j.variance = mem_new(n, sizeof *j.variance, "irradiance", e);
	if (j.h && j.variance && j.difference && j.noise &&
	    !interp_smooth_groups_new(m, COS_CREASE, &j.g, e)) {
		take_parts(&j);
		par_for(m->element.n, CHUNK, threads, differences, &j, NULL);
		bad = independent && !by_patches(&j) && correct_noise(&j, e);
		if (!bad)
			par_for(m->element.n, CHUNK, threads, errors, &j, NULL);
	}
	free(j.h);
	free(j.variance);
	free(j.difference);
	free(j.noise);
	interp_smooth_groups_free(&j.g);
	return bad ? -1 : 0;
}
