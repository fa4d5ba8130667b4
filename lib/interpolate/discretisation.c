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

/* A quantile of difference squared over its stated variance in the sum of the parts begin
 * to end, to 5 %, by a histogram of logarithms; INFINITY where there is no noise. */
static double quantile_of_ratios(const struct job *j, size_t begin, size_t end, double q)
{
	/* 16 bins a factor of 2 are 4 % each; 2048 of them span 2^128, and 1e-18 is 2^-60, near
	 * their lower end at 2^-64. */
	enum { BINS = 2048, A_FACTOR_2 = 16 };
	static const double ratio_least = 1e-18;
	size_t bands = (size_t)j->s->bands, n = j->s->element_sides * bands;
	size_t count[BINS] = { 0 }, all = 0, below = 0;
	int bin = 0;

	for (size_t i = 0; i < n; i++) {
		double d = 0, noise = 0;
		for (size_t part = begin; part < end; part++) {
			size_t at = (i / bands * PARTS + part) * bands + i % bands;
			d += j->difference[at];
			noise += j->noise[at];
		}
		if (isnan(d) || !(noise > 0))
			continue;
		double at = BINS / 2 + A_FACTOR_2 * log2(fmax(d * d / noise, ratio_least));
		count[(size_t)fmax(0, fmin(BINS - 1, at))]++;
		all++;
	}
	while (bin < BINS - 1 && (double)(below + count[bin]) < q * (double)all)
		below += count[bin++];
	return all ? exp2((bin + .5 - BINS / 2) / A_FACTOR_2) : INFINITY;
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

/* Stated errors take samples for independent. Where most elements differ less from their
 * neighbours than that says, errors are scaled to what they do: those of the parts, and
 * those of all light apart, since what a form factor is off by is in both parts. */
static void correct_noise(struct job *j)
{
	/* The quantile that is compared: steps are in the other .3 of the elements, a guess that
	 * test_discretisation.c checks with a step. Of chi-square with one degree of freedom it is
	 * 1.0742. */
	static const double most = .7, chi_square = 1.0742;
	size_t bands = (size_t)j->s->bands, n = j->s->element_sides * bands;
	double scale[PARTS], whole = fmin(1, quantile_of_ratios(j, 0, PARTS, most) / chi_square);

	for (size_t part = 0; part < PARTS; part++)
		scale[part] = fmin(1, quantile_of_ratios(j, part, part + 1, most) / chi_square);
	for (size_t i = 0; i < n * PARTS; i++)
		j->noise[i] *= scale[i / bands % PARTS];
	for (size_t i = 0; i < n; i++) {
		const double *v = &j->variance[i / bands * PARTS * bands + i % bands];
		j->s->error.sampling_direct[i] = sqrt(scale[0] * v[0]);
		j->s->error.sampling[i] = sqrt(fmax(scale[0] * v[0], whole * (v[0] + v[bands])));
	}
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

int interp_discretisation(const struct model *m, struct solution *s, int threads,
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
		if (!by_patches(&j))
			correct_noise(&j);
		par_for(m->element.n, CHUNK, threads, errors, &j, NULL);
		bad = 0;
	}
	free(j.h);
	free(j.variance);
	free(j.difference);
	free(j.noise);
	interp_smooth_groups_free(&j.g);
	return bad ? -1 : 0;
}
