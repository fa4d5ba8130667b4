#include "lib/view/view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/rng.h"
#include "lib/view/shade_tile.h"
#include "lib/view/specular_path.h"
#include "lib/view/view_layers.h"

/* Counts; guesses. */
enum {
	TILE = 16,  /* pixels squared that are shaded together: their points share what is between
	               surfaces and emitters, and their sums stay in the cache */
	ROUND = 4,  /* samples of a pixel that are followed before it is looked at again: as many
	               as pictures have by default */
	PROBE = 4   /* of so many pixels squared one has its lobes probed: a sixteenth of the cost
	               of sampling them, 16 probes a tile */
};

enum { SUMS = 7 };  /* arrays of view_sums */

/* That shadow rays aim at, relative to the direct light of a pixel, where no error is asked for:
 * noise that one may see, at five to ten times the cost of none (trace(1), README.md). A guess. */
static const double usual_error = .1;

/* The same of samples of a lobe. A guess. */
static const double usual_lobe_error = .05;

/* Variance of the mean of n samples that are stratified over a pixel over that of samples
 * which are not, divided by sqrt(n). Of straight edges at random it is .42, .59, .71 and .78 with
 * 2, 4, 8 and 16 samples, of those along rows and columns of pixels .24, .20, .16 and .13 (4000 edges
 * each, against 60 x 60 points a pixel; test_methods.c has such edges). */
static const double stratified = .5;

/* Where an error is asked for, the part of it that each sampled light of a pixel may have: some are
 * left for the pixel's samples among one another. A guess that trace(1) names. */
static const double part_of_error = .5;

/* What a tile adds to the statistics, kept apart so that sums have one order. */
struct tile_sum {
	uint64_t rays;
	double radiance, cut;
	double shown, square, values; /* of pixels that show neither an emitter nor nothing:
	                                 radiance, squared errors, number */
};

/* 1 if a round of samples tells how many a pixel takes. */
static int pilots(const struct view_options *o)
{
	return o->relative > 0 && o->samples > ROUND;
}

/* A thread's scratch space: pixels of one tile at a time. */
struct worker {
	struct view_branch *stack;
	struct view_shade_tile shader;
	double *unrest;             /* [4 materials] of the tile's lobes, for the walker */
	struct view_sums slots;     /* [pixels ROUND][bands] */
	struct view_sums sums;      /* [pixels][bands] */
	int samples[TILE * TILE];   /* that each pixel takes */
};

struct render {
	const struct view_scene *v;
	const struct view_frame *f;
	const struct view_options *o;
	struct image *picture;
	struct view_planes at;
	double (*spot)[2];          /* [samples, and of a pilot] positions in the pixel */
	struct worker *worker;      /* [threads] */
	struct gather *gather;
	struct tile_sum *tile;
	size_t across;              /* tiles in a row */
};

/* Pixels x <= i < x + wide from row y on. */
struct tile {
	int x, y, wide, pixels;
};

static struct tile tile_at(const struct render *r, size_t t)
{
	struct tile tile = { .x = (int)(t % r->across) * TILE, .y = (int)(t / r->across) * TILE };
	int right = r->f->width - tile.x, down = r->f->height - tile.y;

	tile.wide = right < TILE ? right : TILE;
	tile.pixels = tile.wide * (down < TILE ? down : TILE);
	return tile;
}

/* ---- rendering ---- */

static void store(const struct render *r, int plane, size_t pixel, double value)
{
	picture_image_plane(r->picture, plane)[pixel] = (float)value;
}

/* Bands as R, G, B. */
static void store_colour(const struct render *r, int plane, size_t pixel,
                         const double *value)
{
	int last = r->v->m->bands - 1;

	for (int c = 0; c < 3 && plane >= 0; c++)
		store(r, plane + c, pixel, value[c < last ? c : last]);
}

static void store_first(const struct render *r, size_t pixel, double x, double y)
{
	struct view_first first;
	double org[3], dir[3];

	picture_camera_ray(r->f, x, y, org, dir);
	view_first_seen(r->v, org, dir, &first);
	int seen = first.element != RAY_MISS;
	if (r->at.z >= 0)
		store(r, r->at.z, pixel,
		      seen ? picture_camera_depth(r->f, first.point) : (double)INFINITY);
	for (int k = 0; k < 3 && r->at.normal >= 0; k++)
		store(r, r->at.normal + k, pixel, seen ? first.normal[k] : 0);
	if (r->at.element >= 0)
		store(r, r->at.element, pixel, seen ? first.element : -1.);
	if (r->at.patch >= 0)
		store(r, r->at.patch, pixel,
		      seen ? r->v->m->element.patch[first.element] : -1.);
}

/* Follows sample s of a pixel; its light goes into the walker. */
static void follow_sample(const struct render *r, struct view_walker *w, int i, int j, int s)
{
	uint64_t id = (uint64_t)j * (uint64_t)r->f->width + (uint64_t)i;
	size_t bands = (size_t)r->v->m->bands;
	struct view_branch b = { .index = (uint32_t)s, .seed = rng_mix(id) };

	memset(w->diffuse, 0, bands * sizeof *w->diffuse);
	memset(w->directional, 0, bands * sizeof *w->directional);
	memset(w->emission, 0, bands * sizeof *w->emission);
	memset(w->error, 0, bands * sizeof *w->error);
	memset(w->axial, 0, bands * sizeof *w->axial);
	w->probing = s == 0 && !w->asking && i % PROBE == PROBE / 2 && j % PROBE == PROBE / 2;
	picture_camera_ray(r->f, i + r->spot[s][0], j + r->spot[s][1], b.org, b.dir);
	view_follow(w, &b);
}

static void keep_sample(const struct view_walker *w, size_t bands, const struct view_sums *to)
{
	size_t at = w->slot * bands, size = bands * sizeof *w->diffuse;

	memcpy(to->diffuse + at, w->diffuse, size);
	memcpy(to->directional + at, w->directional, size);
	memcpy(to->emission + at, w->emission, size);
	memcpy(to->error + at, w->error, size);
	memcpy(to->axial + at, w->axial, size);
	memset(to->square + at, 0, size);
}

/* Is there light that is computed, rather than interpolated? */
static int shades(const struct render *r)
{
	return r->v->method != VIEW_MESH || (r->v->lobes && r->o->lobe_samples);
}

/* Tells what light is needed for a tile. */
static void ask_tiles(void *arg, size_t begin, size_t end, int thread)
{
	const struct render *r = arg;
	struct worker *k = &r->worker[thread];

	for (size_t t = begin; t < end; t++) {
		struct view_walker w = {
			.v = r->v, .o = r->o, .stack = k->stack, .shader = &k->shader, .asking = 1
		};
		struct tile tile = tile_at(r, t);
		for (int p = 0; p < tile.pixels; p++)
			for (int s = 0; s < r->o->samples; s++)
				follow_sample(r, &w, tile.x + p % tile.wide, tile.y + p / tile.wide,
				              s);
	}
}

static double shown(const struct view_sums *s, size_t at)
{
	return s->diffuse[at] + s->directional[at] + s->emission[at];
}

/* Adds the samples of a round to a pixel's sums. */
static void add_round(const struct view_sums *from, size_t pixel, int samples, size_t bands,
                      const struct view_sums *to)
{
	for (size_t s = 0; s < (size_t)samples; s++)
		for (size_t b = 0; b < bands; b++) {
			size_t at = (pixel * ROUND + s) * bands + b, sum = pixel * bands + b;
			double total = shown(from, at);
			to->diffuse[sum] += from->diffuse[at];
			to->directional[sum] += from->directional[at];
			to->emission[sum] += from->emission[at];
			to->error[sum] += from->error[at];
			to->square[sum] += from->square[at];
			to->axial[sum] += from->axial[at];
			to->spread[sum] += total * total;
		}
}

/* Variance of the mean of n samples of a pixel in a band: of sampled light, and of the
 * samples among one another, which fall off faster than by n since they are stratified. */
static double sampling_variance(const struct view_sums *sums, size_t at, double n)
{
	double mean = shown(sums, at) / n;
	double spread = fmax(0, sums->spread[at] / n - mean * mean);

	return sums->square[at] / (n * n) + (n > 1 ? stratified * spread / ((n - 1) * sqrt(n)) : 0);
}

/* Samples that a pixel takes until what sampling leaves of its error is as small as is wanted, by
 * what ROUND others of it, whose sums these are, have told. */
static int wanted(const struct render *r, const struct view_sums *sums, size_t pixel)
{
	size_t bands = (size_t)r->v->m->bands;
	int n = ROUND;

	for (size_t at = pixel * bands; at < (pixel + 1) * bands; at++) {
		double mean = shown(sums, at) / ROUND, light = sums->square[at] / ROUND;
		double spread = fmax(0, sums->spread[at] / ROUND - mean * mean) * ROUND / (ROUND - 1);
		double aim = r->o->relative * mean;
		while (n < r->o->samples &&
		       light / n + stratified * spread / (n * sqrt(n)) > aim * aim)
			n += ROUND;
	}
	return n < r->o->samples ? n : r->o->samples;
}

/* Squared standard error of the mean of n samples in band k: of interpolated light, of sampling,
 * and of lobes seen by one ray. */
static double pixel_variance(const struct view_walker *w, const struct view_sums *sums, size_t at,
                             size_t k, double n)
{
	double linear = sums->error[at] / n;
	double variance = linear * linear + sampling_variance(sums, at, n);

	if (w->probed[k] > 0)
		variance += sums->axial[at] / n * fmax(0, w->off[k] / w->probed[k]);
	return variance;
}

/* Stores a pixel of the sums over n samples as pixel (i, j) and adds it to the tile's. w: what
 * the tile's probes of lobes have found. */
static void store_pixel(const struct render *r, const struct view_walker *w,
                        const struct view_sums *from, size_t pixel, double n, int i, int j,
                        struct tile_sum *sum)
{
	size_t id = (size_t)j * (size_t)r->f->width + (size_t)i, bands = (size_t)r->v->m->bands;
	double *diffuse = from->diffuse + pixel * bands;
	double *directional = from->directional + pixel * bands;
	double *emission = from->emission + pixel * bands;
	double total[BANDS_MAX], error[BANDS_MAX], all = 0, square = 0, emitted = 0;

	for (size_t k = 0; k < bands; k++) {
		double variance = pixel_variance(w, from, pixel * bands + k, k, n);
		diffuse[k] /= n;
		directional[k] /= n;
		emission[k] /= n;
		total[k] = diffuse[k] + directional[k] + emission[k];
		error[k] = sqrt(variance);
		all += total[k];
		square += variance;
		emitted += emission[k];
	}
	sum->radiance += all;
	if (emitted == 0 && all > 0) {
		sum->shown += all;
		sum->square += square;
		sum->values += (double)bands;
	}
	store_colour(r, 0, id, total);
	for (size_t k = 0; k < bands && r->at.bands >= 0; k++)
		store(r, r->at.bands + (int)k, id, total[k]);
	store_colour(r, r->at.diffuse, id, diffuse);
	store_colour(r, r->at.directional, id, directional);
	store_colour(r, r->at.emission, id, emission);
	store_colour(r, r->at.error, id, error);
	if (r->o->layers & (VIEW_Z | VIEW_N | VIEW_ELEMENT | VIEW_PATCH))
		store_first(r, id, i + .5, j + .5);
}

/* Traces samples [from, to) of the pixels of a tile that want more than `have` and adds them up. */
static void trace_round(const struct render *r, struct worker *k, const struct tile *tile,
                        struct view_walker *w, int have, int from, int to)
{
	size_t bands = (size_t)r->v->m->bands;

	for (int p = 0; p < tile->pixels; p++)
		for (int s = from; s < to && k->samples[p] > have; s++) {
			w->slot = (uint32_t)(p * ROUND + s - from);
			follow_sample(r, w, tile->x + p % tile->wide, tile->y + p / tile->wide, s);
			keep_sample(w, bands, &k->slots);
		}
	if (w->shader)
		view_shade_tile_run(w->shader, &k->slots);
	for (int p = 0; p < tile->pixels; p++)
		if (k->samples[p] > have)
			add_round(&k->slots, (size_t)p, to - from, bands, &k->sums);
}

static void clear_sums(const struct render *r, struct worker *k)
{
	memset(k->sums.diffuse, 0, TILE * TILE * SUMS * (size_t)r->v->m->bands * sizeof(double));
}

/* Settles how many samples each pixel of a tile takes: where an error is asked for, by a round of
 * samples that are not kept. Those that are must not decide it: where all have missed what is
 * seldom met they would be thought enough. */
static void plan_samples(const struct render *r, struct worker *k, const struct tile *tile,
                         struct view_walker *w)
{
	for (int p = 0; p < tile->pixels; p++)
		k->samples[p] = r->o->samples;
	if (!pilots(r->o))
		return;
	trace_round(r, k, tile, w, 0, r->o->samples, r->o->samples + ROUND);
	for (int p = 0; p < tile->pixels; p++)
		k->samples[p] = wanted(r, &k->sums, (size_t)p);
	clear_sums(r, k);
}

static void trace_tile(const struct render *r, struct worker *k, size_t t)
{
	struct view_walker w = { .v = r->v, .o = r->o, .stack = k->stack, .unrest = k->unrest,
		                 .shader = shades(r) ? &k->shader : NULL };
	struct tile tile = tile_at(r, t);
	struct tile_sum *sum = &r->tile[t];

	memset(k->unrest, 0, 4 * r->v->m->material.n * sizeof *k->unrest);
	clear_sums(r, k);
	plan_samples(r, k, &tile, &w);
	for (int from = 0, to; from < r->o->samples; from = to) {
		to = from + ROUND < r->o->samples ? from + ROUND : r->o->samples;
		trace_round(r, k, &tile, &w, from, from, to);
	}
	for (int p = 0; p < tile.pixels; p++)
		store_pixel(r, &w, &k->sums, (size_t)p, k->samples[p], tile.x + p % tile.wide,
		            tile.y + p / tile.wide, sum);
	for (int b = 0; b < r->v->m->bands; b++)
		sum->cut += w.cut[b] / r->o->samples;
	sum->rays = w.rays;
}

static void trace_tiles(void *arg, size_t begin, size_t end, int thread)
{
	const struct render *r = arg;

	for (size_t t = begin; t < end; t++)
		trace_tile(r, &r->worker[thread], t);
}

/* The bits of i mirrored at the point: .0, .1, .01, .11, .001, ... (van der Corput). */
static double radical_inverse(uint32_t i)
{
	double x = 0;

	for (double bit = .5; i; i >>= 1, bit /= 2)
		x += bit * (i & 1);
	return x;
}

static int new_sums(struct view_sums *s, size_t values, struct err *e)
{
	double **array[SUMS] = { &s->diffuse, &s->directional, &s->emission, &s->error, &s->square,
		                 &s->spread, &s->axial };
	double *room = mem_new(SUMS * values, sizeof *room, "pixels", e);

	for (int i = 0; i < SUMS; i++)
		*array[i] = room ? room + (size_t)i * values : NULL;
	return room ? 0 : -1;
}

static int new_worker(const struct render *r, struct worker *k, int thread, struct err *e)
{
	size_t values = TILE * TILE * (size_t)r->v->m->bands;

	k->stack = mem_new(view_stack_size(r->o), sizeof *k->stack, "ray stacks", e);
	k->unrest = mem_new(r->v->m->material.n, 4 * sizeof *k->unrest, "lobes", e);
	if (!k->stack || !k->unrest || new_sums(&k->slots, ROUND * values, e) ||
	    new_sums(&k->sums, values, e))
		return -1;
	if (!shades(r))
		return 0;
	double relative = r->o->relative * part_of_error, usual = sqrt(r->o->samples);
	double direct = relative > 0 ? relative : fmin(1, usual_error * usual);
	double lobes = relative > 0 ? relative : fmin(1, usual_lobe_error * usual);
	return view_shade_tile_init(&k->shader, r->v, r->gather, direct, lobes, thread, e);
}

static void free_workers(struct render *r)
{
	for (int t = 0; t < r->o->threads && r->worker; t++) {
		free(r->worker[t].stack);
		free(r->worker[t].unrest);
		free(r->worker[t].slots.diffuse);
		free(r->worker[t].sums.diffuse);
		view_shade_tile_free(&r->worker[t].shader);
	}
	free(r->worker);
}

static int new_gather(struct render *r, struct err *e)
{
	int samples = r->o->samples < ROUND ? r->o->samples : ROUND;
	struct gather_options o = { .rays = r->o->gather_rays, .samples = samples,
		                    .relative = r->o->relative * part_of_error,
		                    .depth = r->o->depth, .threads = r->o->threads };

	r->gather = r->v->method == VIEW_GATHER ? view_gather_new(r->v, &o, e) : NULL;
	return r->gather || r->v->method != VIEW_GATHER ? 0 : -1;
}

/* Gathers light at the corners of elements that are seen. */
static void gather(struct render *r, size_t tiles, const struct progress *progress)
{
	for (int t = 0; t < r->o->threads; t++)
		r->worker[t].shader.asking = 1;
	par_for(tiles, 1, r->o->threads, ask_tiles, r, NULL);
	for (int t = 0; t < r->o->threads; t++)
		r->worker[t].shader.asking = 0;
	view_gather_corners(r->gather, progress);
}

static int new_buffers(struct render *r, size_t tiles, struct err *e)
{
	int n = r->o->samples + (pilots(r->o) ? ROUND : 0);

	r->tile = mem_new(tiles, sizeof *r->tile, "tiles", e);
	r->spot = mem_new((size_t)n, sizeof *r->spot, "pixel samples", e);
	r->worker = mem_new((size_t)r->o->threads, sizeof *r->worker, "threads", e);
	if (!r->tile || !r->spot || !r->worker)
		return -1;
	for (int t = 0; t < r->o->threads; t++)
		if (new_worker(r, &r->worker[t], t, e))
			return -1;
	/* Hammersley points, the same in every pixel: edges come out regular. Where sampling
	 * may stop early, points of which any number is spread evenly. */
	for (int i = 0; i < n; i++) {
		r->spot[i][0] =
		    r->o->relative > 0 && n > 1 ? rng_sobol((uint32_t)i, 1, 1) : (i + .5) / n;
		r->spot[i][1] = r->o->relative > 0 && n > 1 ? rng_sobol((uint32_t)i, 0, 1)
		                                   : radical_inverse((uint32_t)i) + .5 / n;
	}
	return 0;
}

static void sum_tiles(const struct render *r, size_t tiles, struct view_stats *stats)
{
	double pixels = (double)r->f->width * r->f->height, shown = 0, square = 0, values = 0;

	*stats = (struct view_stats){ 0 };
	for (size_t t = 0; t < tiles; t++) {
		stats->rays += r->tile[t].rays;
		stats->radiance += r->tile[t].radiance / pixels;
		stats->cut += r->tile[t].cut / pixels;
		shown += r->tile[t].shown;
		square += r->tile[t].square;
		values += r->tile[t].values;
	}
	stats->error = shown > 0 ? sqrt(square * values) / shown : 0;
}

static int failed(const struct render *r, struct err *e)
{
	for (int t = 0; t < r->o->threads; t++)
		if (r->worker[t].shader.e.set)
			return err_set(e, "%s", r->worker[t].shader.e.text);
	return r->gather ? view_gather_check(r->gather, e) : 0;
}

int view_render(const struct view_scene *v, const struct view_frame *f,
                const struct view_options *o, const struct progress *progress,
                struct image *picture, struct view_stats *stats, struct err *e)
{
	struct render r = { .v = v, .f = f, .o = o, .picture = picture };
	size_t down = ((size_t)f->height + TILE - 1) / TILE, tiles;
	int bad = -1;

	r.across = ((size_t)f->width + TILE - 1) / TILE;
	tiles = r.across * down;
	*picture = (struct image){ 0 };
	if (!new_gather(&r, e) && !new_buffers(&r, tiles, e) &&
	    !view_picture_new(f, o->layers, v->m->bands, &r.at, picture, e)) {
		if (r.gather)
			gather(&r, tiles, progress);
		par_for(tiles, 1, o->threads, trace_tiles, &r, progress);
		sum_tiles(&r, tiles, stats);
		bad = failed(&r, e);
	}
	if (r.gather && !bad)
		stats->rays += view_gather_rays(r.gather);
	free_workers(&r);
	view_gather_free(r.gather);
	free(r.spot);
	free(r.tile);
	return bad;
}
