/* Irradiance: particles from the emitters. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/data/punctual.h"
#include "lib/reference/pathtrace_internal.h"
#include "lib/scatter/bsdf.h"
#include "lib/scatter/lobe.h"

/* Equal, independent parts of the particles, a count, for the standard errors: enough to know
 * these to 1 / sqrt(2 (64 - 1)), 9 %. Merged in order, so sums do not depend on the threads. */
enum { BATCHES = 64 };

/* Flux per batch: [2 elements][bands] that arrived, then [bands] that escaped. */
struct shower {
	const struct pathtrace *p;
	const struct pathtrace_options *o;
	size_t first;       /* batch of the first tally */
	size_t values;
	double *tally;      /* [threads][values] */
};

static long batch_count(const struct pathtrace_options *o)
{
	return o->samples < BATCHES ? o->samples : BATCHES;
}

/* A ray of a light, chosen by u < the chance of them all. */
static void emit_light(const struct pathtrace *p, double u, struct rng *r, double org[3],
                       double dir[3], double *flux)
{
	const struct model *m = p->m;
	double ray[3] = { rng_uniform(r), rng_uniform(r), rng_uniform(r) };
	size_t i = 0;

	while (i + 1 < m->light.n && u >= p->light_below[i + 1])
		i++;
	model_light_ray(&m->light, i, ray, ray_offset(p->rays), org, dir);
	for (int b = 0; b < m->bands; b++)
		flux[b] = model_light_flux(m, i, b) / (p->light_below[i + 1] - p->light_below[i]);
}

/* A ray from a point of an emitter, with flux[bands] per particle. */
static void emit_patch(const struct pathtrace *p, struct rng *r, double org[3], double dir[3],
                       double *flux)
{
	const struct model *m = p->m;
	double u[5], x[3], normal[3];

	for (int i = 0; i < 5; i++)
		u[i] = rng_uniform(r);
	const struct emitter *at = pathtrace_emitter(p, u, x);
	size_t material = m->surface.material[m->triangle.surface[at->triangle]];
	for (int k = 0; k < 3; k++) {
		double n = p->normal[3 * (size_t)at->triangle + (size_t)k];
		normal[k] = at->side == FRONT ? n : -n;
	}
	/* radiance cos^(m-1), times the cosine of the projected area */
	bsdf_lobe_sample_whole(m->material.emission_exponent[2 * material + (size_t)at->side],
	                       normal, u + 3, dir);
	pathtrace_leave(p, normal, x, dir, org);
	for (int b = 0; b < m->bands; b++)
		flux[b] = bsdf_exitance(&m->material, material, at->side, b) *
		          p->area[at->triangle] / at->chance;
}

static void emit(const struct pathtrace *p, struct rng *r, double org[3], double dir[3],
                 double *flux)
{
	double lights = p->light_below[p->m->light.n], u = lights > 0 ? rng_uniform(r) : 1;

	if (u < lights) {
		emit_light(p, u, r, org, dir, flux);
		return;
	}
	emit_patch(p, r, org, dir, flux);
	for (int b = 0; b < p->m->bands; b++)
		flux[b] /= 1 - lights;
}

static void follow(const struct pathtrace *p, struct rng *r, double *tally, double *escaped)
{
	const struct model *m = p->m;
	double org[3], dir[3], flux[BANDS_MAX], throughput[BANDS_MAX];
	struct vertex v;

	emit(p, r, org, dir, flux);
	for (int b = 0; b < m->bands; b++)
		throughput[b] = 1;
	while (pathtrace_meet(p, org, dir, &v)) {
		double wi[3] = { -dir[0], -dir[1], -dir[2] };
		double u[3] = { rng_uniform(r), rng_uniform(r), rng_uniform(r) };
		size_t row = 2 * (size_t)model_locate(m, v.triangle, v.w) + (size_t)v.side;
		struct bsdf_sample s;
		for (int b = 0; b < m->bands; b++)
			tally[row * (size_t)m->bands + (size_t)b] += flux[b] * throughput[b];
		bsdf_sample(m, v.material, v.n, wi, BSDF_FROM_LIGHT, u, &s);
		if (s.event == BSDF_ABSORBED)
			return;
		for (int b = 0; b < m->bands; b++)
			throughput[b] *= s.weight[b];
		if (!pathtrace_roulette(throughput, m->bands, r))
			return;
		pathtrace_leave(p, v.n, v.x, s.w, org);
		memcpy(dir, s.w, sizeof dir);
	}
	for (int b = 0; b < m->bands; b++)
		escaped[b] += flux[b] * throughput[b];
}

static void run_batches(void *arg, size_t begin, size_t end, int thread)
{
	const struct shower *s = arg;
	long batches = batch_count(s->o);

	(void)thread;
	for (size_t i = begin; i < end; i++) {
		double *tally = s->tally + i * s->values;
		double *escaped = tally + s->values - (size_t)s->p->m->bands;
		long batch = (long)(s->first + i);
		struct rng r = rng_seed(s->o->seed, (uint64_t)batch);
		long n = (s->o->samples - batch + batches - 1) / batches;
		memset(tally, 0, s->values * sizeof *tally);
		for (long k = 0; k < n; k++)
			follow(s->p, &r, tally, escaped);
		for (size_t k = 0; k < s->values; k++)
			tally[k] /= (double)n;
	}
}

/* Running mean and sum of squared deviations (Welford 1962). */
static void merge(const double *x, size_t n, double count, double *mean, double *squares)
{
	for (size_t i = 0; i < n; i++) {
		double off = x[i] - mean[i];
		mean[i] += off / count;
		squares[i] += off * (x[i] - mean[i]);
	}
}

static void run_all(struct shower *s, const struct progress *progress, double *mean,
                    double *squares)
{
	size_t batches = (size_t)batch_count(s->o), together = (size_t)s->o->threads;

	for (s->first = 0; s->first < batches; s->first += together) {
		size_t n = batches - s->first < together ? batches - s->first : together;
		par_for(n, 1, s->o->threads, run_batches, s, NULL);
		for (size_t i = 0; i < n; i++)
			merge(s->tally + i * s->values, s->values, (double)(s->first + i + 1), mean,
			      squares);
		if (progress && progress->fn)
			progress->fn(progress->arg, (double)(s->first + n), (double)batches);
	}
}

/* From flux to irradiance and standard errors. Where nothing arrived, the spread
 * says nothing: the error is that of one particle, for none is no proof of 0. */
static void finish(const struct pathtrace *p, const struct pathtrace_options *o,
                   const double *mean, const double *squares,
                   struct pathtrace_irradiance *out)
{
	const struct model *m = p->m;
	size_t bands = (size_t)m->bands, rows = 2 * m->element.n;
	double batches = (double)batch_count(o), scale = 1 / (batches * (batches - 1));

	for (size_t i = 0; i < rows * bands; i++) {
		double area = m->element.area[i / bands / 2];
		out->h[i] = mean[i] / area;
		out->error[i] = (mean[i] > 0 ? sqrt(squares[i] * scale)
		                             : p->emitted[i % bands] / (double)o->samples) / area;
	}
	for (size_t b = 0; b < bands; b++) {
		out->emitted[b] = p->emitted[b];
		out->escaped[b] = mean[rows * bands + b];
		out->escaped_error[b] = sqrt(squares[rows * bands + b] * scale);
	}
}

int pathtrace_particles(const struct pathtrace *p, const struct pathtrace_options *o,
                        const struct progress *progress, struct pathtrace_irradiance *out,
                        struct err *e)
{
	size_t bands = (size_t)p->m->bands, rows = 2 * p->m->element.n;
	struct shower s = { .p = p, .o = o, .values = (rows + 1) * bands };
	double *mean, *squares;
	int bad = -1;

	*out = (struct pathtrace_irradiance){ 0 };
	if (o->samples < 2)
		return err_set(e, "a standard error needs at least 2 particles");
	mean = mem_new(s.values, sizeof *mean, "irradiance", e);
	squares = mem_new(s.values, sizeof *squares, "irradiance", e);
	s.tally = mem_new((size_t)o->threads, s.values * sizeof *s.tally, "irradiance", e);
	out->h = mem_new(rows, bands * sizeof *out->h, "irradiance", e);
	out->error = mem_new(rows, bands * sizeof *out->error, "irradiance", e);
	if (mean && squares && s.tally && out->h && out->error) {
		run_all(&s, progress, mean, squares);
		finish(p, o, mean, squares, out);
		bad = 0;
	} else {
		pathtrace_irradiance_free(out);
	}
	free(mean);
	free(squares);
	free(s.tally);
	return bad;
}

void pathtrace_irradiance_free(struct pathtrace_irradiance *i)
{
	free(i->h);
	free(i->error);
	*i = (struct pathtrace_irradiance){ 0 };
}
