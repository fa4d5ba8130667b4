/* Pictures: paths from the eye. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/data/punctual.h"
#include "lib/reference/pathtrace_internal.h"
#include "lib/scatter/bsdf.h"

/* Counts. They change noise and time, never the expectation; guesses. */
enum {
	FREE_BOUNCES = 4,   /* before Russian roulette begins: what is most of a picture's light */
	PASSES_MAX = 4096,  /* surfaces in a row that a straight ray may pass: more than any scene
	                       has, so that rounding cannot hold a path for ever */
	LIGHTS_ALL = 16,    /* lights and images that are all looked at */
	BATCHES = 8         /* of a pixel's samples, for its standard error, then known to 27 %;
	                       each is stratified by itself, so fewer are less noisy, less known */
};

/* Work for a thread at a time, pixels. */
enum { PIXELS_AT_ONCE = 16 };

struct eye_path {
	double org[3], dir[3];
	double throughput[BANDS_MAX];
	double pdf;         /* with which the last vertex that scatters found dir; 0 for
	                       the camera and mirrors, where no light could be chosen */
	double distance;    /* from that vertex, through panes */
	int straight;       /* a camera ray that has been through panes only */
	int sharp;          /* or also by mirrors */
};

/* The next surface. Backs of one-sided materials let camera rays pass. */
static int see(const struct pathtrace *p, struct eye_path *path, struct vertex *v)
{
	for (int i = 0; i < PASSES_MAX; i++) {
		if (!pathtrace_meet(p, path->org, path->dir, v))
			return 0;
		path->distance += v->t;
		if (v->side == FRONT || !p->m->material.one_sided[v->material])
			return 1;
		if (!path->straight)
			return 0;
		pathtrace_leave(p, v->n, v->x, path->dir, path->org);
	}
	return 0;
}

/* Veach's power heuristic. */
static double mis_weight(double mine, double other)
{
	return mine * mine / (mine * mine + other * other);
}

static void add_emission(const struct pathtrace *p, const struct eye_path *path,
                         const struct vertex *v, double *radiance)
{
	double density = p->density[2 * (size_t)v->triangle + (size_t)v->side];
	double back[3] = { -path->dir[0], -path->dir[1], -path->dir[2] };
	double l[BANDS_MAX], weight = 1;

	if (density == 0)
		return;
	if (path->pdf > 0) {
		double cosine = fabs(v3_dot(v->n, path->dir));
		double light = density * path->distance * path->distance / cosine;
		weight = cosine > 0 ? mis_weight(path->pdf, light) : 0;
	}
	bsdf_emission(p->m, v->material, v->n, back, l);
	for (int b = 0; b < p->m->bands; b++)
		radiance[b] += path->throughput[b] * weight * l[b];
}

/* Next-event estimation: light of a chosen point of an emitter. */
static void add_direct(const struct pathtrace *p, const struct eye_path *path,
                       const struct vertex *v, const double u[3], double *radiance)
{
	const struct model *m = p->m;
	double y[3], wi[3], from[3], to[3], f[BANDS_MAX], l[BANDS_MAX], any = 0;
	double wo[3] = { -path->dir[0], -path->dir[1], -path->dir[2] };
	const struct emitter *at = pathtrace_emitter(p, u, y);
	uint64_t rays = 0;
	const double *n = &p->normal[3 * (size_t)at->triangle];

	v3_sub(y, v->x, wi);
	double distance = v3_normalise(wi), cosine = v3_dot(n, wi);
	if (!(distance > 0) || (at->side == FRONT ? cosine >= 0 : cosine <= 0))
		return;
	bsdf_eval(m, v->material, v->n, wi, wo, f);
	double back[3] = { -wi[0], -wi[1], -wi[2] };
	bsdf_emission(m, m->surface.material[m->triangle.surface[at->triangle]], n, back, l);
	for (int b = 0; b < m->bands; b++) {
		f[b] *= l[b] * path->throughput[b];
		any = fmax(any, f[b]);
	}
	if (!(any > 0))
		return;
	pathtrace_leave(p, v->n, v->x, wi, from);
	pathtrace_leave(p, n, y, back, to);
	if (!ray_light_transmittance(&p->ways, from, to, f, &rays))
		return;
	double pdf = at->chance / p->area[at->triangle] * distance * distance / fabs(cosine);
	double other = bsdf_pdf(m, v->material, v->n, wo, BSDF_FROM_EYE, wi);
	double scale = fabs(v3_dot(v->n, wi)) * mis_weight(pdf, other) / pdf;
	for (int b = 0; b < m->bands; b++)
		radiance[b] += f[b] * scale;
}

/* How a vertex sees a light or image; returns its irradiance, mean of the bands, if nothing is
 * between. */
static double light_irradiance(const struct pathtrace *p, const struct vertex *v, size_t light,
                               struct light_sample *s)
{
	const struct lights *l = &p->ways.images.l;
	const double *intensity = &l->intensity[light * (size_t)p->m->bands];
	double sum = 0;

	model_light_see(l, light, v->x, ray_offset(p->rays), s);
	for (int b = 0; b < p->m->bands; b++)
		sum += intensity[b] / p->m->bands;
	return sum * s->across * s->falloff * fabs(v3_dot(v->n, s->toward));
}

/* Adds `times` what a vertex gets of a light or image. */
static void add_light(const struct pathtrace *p, const struct eye_path *path,
                      const struct vertex *v, size_t light, double times, double *radiance)
{
	const struct model *m = p->m;
	const double *intensity = &p->ways.images.l.intensity[light * (size_t)m->bands];
	double wo[3] = { -path->dir[0], -path->dir[1], -path->dir[2] };
	double f[BANDS_MAX], from[3], any = 0;
	struct light_sample s;
	uint64_t rays = 0;

	light_irradiance(p, v, light, &s);
	bsdf_eval(m, v->material, v->n, s.toward, wo, f);
	double scale = times * s.across * s.falloff * fabs(v3_dot(v->n, s.toward));
	for (int b = 0; b < m->bands; b++) {
		f[b] *= path->throughput[b] * scale * intensity[b];
		any = fmax(any, f[b]);
	}
	if (!(any > 0))
		return;
	pathtrace_leave(p, v->n, v->x, s.toward, from);
	if (!ray_light_visibility(&p->ways, light, from, &s, f, &rays))
		return;
	for (int b = 0; b < m->bands; b++)
		radiance[b] += f[b];
}

/* Next-event estimation of punctual lights and their images: all for points that the camera
 * sees, also in mirrors, if they are few, else one, chosen by its irradiance. */
static void add_lights(const struct pathtrace *p, const struct eye_path *path,
                       const struct vertex *v, double u, double *radiance)
{
	double sum = 0, left, here;
	size_t n = p->ways.images.l.n, all = path->sharp && n <= LIGHTS_ALL;
	struct light_sample s;

	for (size_t i = 0; i < n; i++) {
		if (all)
			add_light(p, path, v, i, 1, radiance);
		else
			sum += light_irradiance(p, v, i, &s);
	}
	left = u * sum;
	for (size_t i = 0; sum > 0 && i < n; i++, left -= here) {
		here = light_irradiance(p, v, i, &s);
		if (here > 0 && left < here) {
			add_light(p, path, v, i, sum / here, radiance);
			return;
		}
	}
}

/* Extends the path. 0 = it ends. */
static int scatter(const struct pathtrace *p, struct eye_path *path, const struct vertex *v,
                   struct rng *r)
{
	double wo[3] = { -path->dir[0], -path->dir[1], -path->dir[2] };
	double u[3] = { rng_uniform(r), rng_uniform(r), rng_uniform(r) }, any = 0;
	struct bsdf_sample s;

	bsdf_sample(p->m, v->material, v->n, wo, BSDF_FROM_EYE, u, &s);
	if (s.event == BSDF_ABSORBED)
		return 0;
	for (int b = 0; b < p->m->bands; b++) {
		path->throughput[b] *= s.weight[b];
		any = fmax(any, path->throughput[b]);
	}
	path->sharp &= s.pdf == 0;
	if (s.event != BSDF_IDEAL_T) {
		path->straight = 0;
		path->pdf = s.pdf;
		path->distance = 0;
	}
	memcpy(path->dir, s.w, sizeof path->dir);
	pathtrace_leave(p, v->n, v->x, s.w, path->org);
	return any > 0;
}

/* Radiance arriving along a camera ray, added to radiance[bands]. light: numbers
 * for the choice of light at the first vertex. */
static void follow(const struct pathtrace *p, struct eye_path *path, const double light[3],
                   struct rng *r, double *radiance)
{
	struct vertex v;

	for (int bounce = 0; see(p, path, &v); bounce++) {
		double u[3] = { rng_uniform(r), rng_uniform(r), rng_uniform(r) };
		add_emission(p, path, &v, radiance);
		if (p->emitters)
			add_direct(p, path, &v, bounce ? u : light, radiance);
		if (p->m->light.n)
			add_lights(p, path, &v, u[0], radiance);
		if (!scatter(p, path, &v, r))
			return;
		if (bounce >= FREE_BOUNCES && !pathtrace_roulette(path->throughput, p->m->bands, r))
			return;
	}
}

struct render {
	const struct pathtrace *p;
	const struct view_frame *f;
	const struct pathtrace_options *o;
	struct image *picture;
};

/* One sample. Its place in the pixel and its choice of light are jointly
 * stratified within the batch. */
static void sample_pixel(const struct render *j, size_t pixel, long sample, double *radiance)
{
	uint64_t stream = (uint64_t)pixel * (uint64_t)j->o->samples + (uint64_t)sample;
	uint64_t batch = rng_mix(rng_mix(j->o->seed) + (uint64_t)pixel * BATCHES +
	                         (uint64_t)(sample % BATCHES));
	uint32_t index = (uint32_t)(sample / BATCHES);
	struct rng r = rng_seed(j->o->seed, stream);
	size_t width = (size_t)j->f->width;
	double light[3];
	struct eye_path path = { .straight = 1, .sharp = 1 };

	for (int b = 0; b < j->p->m->bands; b++)
		path.throughput[b] = 1;
	for (int d = 0; d < 3; d++)
		light[d] = rng_sobol(index, 2 + d, batch);
	double x = j->o->centre ? .5 : rng_sobol(index, 0, batch);
	double y = j->o->centre ? .5 : rng_sobol(index, 1, batch);
	picture_camera_ray(j->f, (double)(pixel % width) + x, (double)(pixel / width) + y, path.org,
	                   path.dir);
	follow(j->p, &path, light, &r, radiance);
}

static int band_channels(const struct model *m)
{
	return m->bands == 1 || m->bands == 3 ? 0 : m->bands;
}

/* Puts a value per band into its channels from `first` on. */
static void put(const struct render *j, size_t pixel, int first, const double *value)
{
	int bands = j->p->m->bands, extra = band_channels(j->p->m);

	for (int c = 0; c < 3 + extra; c++) {
		int b = c < 3 ? (c < bands ? c : bands - 1) : c - 3;
		picture_image_plane(j->picture, first + c)[pixel] = (float)value[b];
	}
}

/* Mean of the samples and its standard error, from the batches' means weighted by
 * their sizes. */
static void render_pixel(const struct render *j, size_t pixel)
{
	int bands = j->p->m->bands;
	long batches = j->o->samples < BATCHES ? j->o->samples : BATCHES;
	double sum[BATCHES][BANDS_MAX], mean[BANDS_MAX], error[BANDS_MAX];
	double samples = (double)j->o->samples;

	memset(sum, 0, sizeof sum);
	for (long i = 0; i < j->o->samples; i++)
		sample_pixel(j, pixel, i, sum[i % BATCHES]);
	for (int b = 0; b < bands; b++) {
		double squares = 0;
		mean[b] = 0;
		for (long i = 0; i < batches; i++)
			mean[b] += sum[i][b] / samples;
		for (long i = 0; i < batches; i++) {
			double size = (double)((j->o->samples - i + BATCHES - 1) / BATCHES);
			double off = (sum[i][b] - size * mean[b]) / samples;
			squares += off * off;
		}
		error[b] = sqrt(squares * (double)batches / (double)(batches - 1));
	}
	put(j, pixel, 0, mean);
	if (batches > 1)
		put(j, pixel, 3 + band_channels(j->p->m), error);
}

static void render_pixels(void *arg, size_t begin, size_t end, int thread)
{
	const struct render *j = arg;

	(void)thread;
	for (size_t i = begin; i < end; i++)
		render_pixel(j, i);
}

static int new_picture(const struct render *j, struct err *e)
{
	enum { MOST = 2 * (3 + BANDS_MAX), LENGTH = 24 };
	static const char *const colour[] = { "R", "G", "B" };
	char text[MOST][LENGTH];
	const char *name[MOST];
	int n = 3 + band_channels(j->p->m), channels = j->o->samples > 1 ? 2 * n : n;

	for (int c = 0; c < channels; c++) {
		const char *prefix = c < n ? "" : "stderr.";
		if (c % n < 3)
			snprintf(text[c], LENGTH, "%s%s", prefix, colour[c % n]);
		else
			snprintf(text[c], LENGTH, "%sband.%d", prefix, c % n - 3);
		name[c] = text[c];
	}
	return picture_image_new(j->picture, j->f->width, j->f->height, channels, name, e);
}

static double relative_rms(const struct image *picture, int first_error)
{
	size_t pixels = (size_t)picture->width * (size_t)picture->height;
	double squares = 0, sum = 0;

	for (int c = 0; c < 3; c++)
		for (size_t i = 0; i < pixels; i++) {
			double error = picture_image_plane(picture, first_error + c)[i];
			squares += error * error;
			sum += picture_image_plane(picture, c)[i];
		}
	double n = 3 * (double)pixels;
	return sum > 0 ? sqrt(squares / n) / (sum / n) : 0;
}

int pathtrace_picture(const struct pathtrace *p, const struct view_frame *f,
                      const struct pathtrace_options *o, const struct progress *progress,
                      struct image *picture, double *relative_error, struct err *e)
{
	struct render j = { p, f, o, picture };

	if (new_picture(&j, e))
		return -1;
	par_for((size_t)f->width * (size_t)f->height, PIXELS_AT_ONCE, o->threads, render_pixels, &j,
	        progress);
	if (relative_error)
		*relative_error = o->samples < 2 ? (double)INFINITY
		                                 : relative_rms(picture, 3 + band_channels(p->m));
	return 0;
}
