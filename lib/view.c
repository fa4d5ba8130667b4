#include "view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mem.h"
#include "rng.h"
#include "view_path.h"
#include "view_shade.h"

enum { TILE = 16 };

/* Planes of the picture by what they hold; -1 = not asked for. */
struct planes {
	int bands, diffuse, directional, emission, z, normal, element, patch;
};

/* What a tile adds to the statistics, kept apart so that sums have one order. */
struct tile_sum {
	uint64_t rays;
	double radiance, cut;
};

/* A thread's scratch space: pixels of one tile at a time. */
struct worker {
	struct view_branch *stack;
	struct view_shader shader;
	struct view_sums sums;
};

struct render {
	const struct view_scene *v;
	const struct view_frame *f;
	const struct view_options *o;
	struct image *picture;
	struct planes at;
	double (*spot)[2];          /* [samples] positions in the pixel */
	struct worker *worker;      /* [threads] */
	struct gather *gather;
	struct tile_sum *tile;
	size_t across;              /* tiles in a row */
};

/* ---- layers ---- */

int view_parse_layers(const char *list, unsigned *layers)
{
	static const char *const name[] = { "diffuse", "directional", "emission", "Z", "N",
		"element", "patch", "all" };
	unsigned mask = 0;

	for (const char *p = list;; p++) {
		size_t n = strcspn(p, ","), i = 0;
		while (i < 8 && (strlen(name[i]) != n || strncmp(p, name[i], n) != 0))
			i++;
		if (i == 8)
			return -1;
		mask |= i == 7 ? (unsigned)VIEW_ALL : 1u << i;
		p += n;
		if (!*p)
			break;
	}
	*layers = mask;
	return 0;
}

/* Names of the channels in the order of struct planes. */
struct names {
	char text[3 * 4 + 3 + 3 + BANDS_MAX][24];
	int n;
};

static int add_names(struct names *s, int asked, const char *prefix, const char *const *suffix,
                     int count)
{
	int first = s->n;

	if (!asked)
		return -1;
	for (int i = 0; i < count; i++)
		snprintf(s->text[s->n++], sizeof *s->text, "%s%s", prefix, suffix[i]);
	return first;
}

static int new_picture(struct render *r, struct image *picture, struct err *e)
{
	static const char *const rgb[] = { "R", "G", "B" }, *const xyz[] = { "X", "Y", "Z" };
	static const char *const none[] = { "" };
	unsigned l = r->o->layers;
	int bands = r->v->m->bands;
	struct names s = { .n = 0 };
	const char *list[sizeof s.text / sizeof *s.text];

	add_names(&s, 1, "", rgb, 3);
	r->at.bands = bands == 1 || bands == 3 ? -1 : s.n;
	for (int b = 0; b < bands && r->at.bands >= 0; b++)
		snprintf(s.text[s.n++], sizeof *s.text, "band.%d", b);
	r->at.diffuse = add_names(&s, l & VIEW_DIFFUSE, "diffuse.", rgb, 3);
	r->at.directional = add_names(&s, l & VIEW_DIRECTIONAL, "directional.", rgb, 3);
	r->at.emission = add_names(&s, l & VIEW_EMISSION, "emission.", rgb, 3);
	r->at.z = add_names(&s, l & VIEW_Z, "Z", none, 1);
	r->at.normal = add_names(&s, l & VIEW_N, "N.", xyz, 3);
	r->at.element = add_names(&s, l & VIEW_ELEMENT, "element", none, 1);
	r->at.patch = add_names(&s, l & VIEW_PATCH, "patch", none, 1);
	for (int i = 0; i < s.n; i++)
		list[i] = s.text[i];
	return image_new(picture, r->f->width, r->f->height, s.n, list, e);
}

/* ---- rendering ---- */

static void store(const struct render *r, int plane, size_t pixel, double value)
{
	image_plane(r->picture, plane)[pixel] = (float)value;
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

	camera_ray(r->f, x, y, org, dir);
	view_first_seen(r->v, org, dir, &first);
	int seen = first.element != RAY_MISS;
	if (r->at.z >= 0)
		store(r, r->at.z, pixel,
		      seen ? camera_depth(r->f, first.point) : (double)INFINITY);
	for (int k = 0; k < 3 && r->at.normal >= 0; k++)
		store(r, r->at.normal + k, pixel, seen ? first.normal[k] : 0);
	if (r->at.element >= 0)
		store(r, r->at.element, pixel, seen ? first.element : -1.);
	if (r->at.patch >= 0)
		store(r, r->at.patch, pixel,
		      seen ? r->v->m->element_patch[first.element] : -1.);
}

/* Follows the samples of a pixel; their light goes into sums [pixels][bands]. */
static void follow_pixel(const struct render *r, struct view_walker *w, int i, int j)
{
	uint64_t id = (uint64_t)j * (uint64_t)r->f->width + (uint64_t)i, seed = rng_mix(id);
	size_t bands = (size_t)r->v->m->bands;
	struct view_branch b;

	memset(w->diffuse, 0, bands * sizeof *w->diffuse);
	memset(w->directional, 0, bands * sizeof *w->directional);
	memset(w->emission, 0, bands * sizeof *w->emission);
	for (int s = 0; s < r->o->samples; s++) {
		camera_ray(r->f, i + r->spot[s][0], j + r->spot[s][1], b.org, b.dir);
		b.index = (uint32_t)s;
		b.seed = seed;
		view_follow(w, &b);
	}
}

static void keep_pixel(const struct view_walker *w, size_t bands, const struct view_sums *to)
{
	memcpy(to->diffuse + w->pixel * bands, w->diffuse, bands * sizeof *w->diffuse);
	memcpy(to->directional + w->pixel * bands, w->directional, bands * sizeof *w->diffuse);
	memcpy(to->emission + w->pixel * bands, w->emission, bands * sizeof *w->diffuse);
	memset(to->square + w->pixel * bands, 0, bands * sizeof *w->diffuse);
}

/* Stores pixel `at` of the sums as pixel (i, j). Returns its radiance, bands added up. */
static double store_pixel(const struct render *r, const struct view_sums *from, size_t at, int i,
                          int j)
{
	size_t id = (size_t)j * (size_t)r->f->width + (size_t)i;
	int bands = r->v->m->bands;
	double *diffuse = from->diffuse + at * (size_t)bands;
	double *directional = from->directional + at * (size_t)bands;
	double *emission = from->emission + at * (size_t)bands;
	double total[BANDS_MAX], share = 1. / r->o->samples, sum = 0;

	for (int k = 0; k < bands; k++) {
		diffuse[k] *= share;
		directional[k] *= share;
		emission[k] *= share;
		sum += total[k] = diffuse[k] + directional[k] + emission[k];
	}
	store_colour(r, 0, id, total);
	for (int k = 0; k < bands && r->at.bands >= 0; k++)
		store(r, r->at.bands + k, id, total[k]);
	store_colour(r, r->at.diffuse, id, diffuse);
	store_colour(r, r->at.directional, id, directional);
	store_colour(r, r->at.emission, id, emission);
	if (r->o->layers & (VIEW_Z | VIEW_N | VIEW_ELEMENT | VIEW_PATCH))
		store_first(r, id, i + .5, j + .5);
	return sum;
}

/* Tells what light is needed for a tile. */
static void ask_tiles(void *arg, size_t begin, size_t end, int thread)
{
	const struct render *r = arg;
	struct worker *k = &r->worker[thread];

	for (size_t tile = begin; tile < end; tile++) {
		struct view_walker w = { .v = r->v, .o = r->o, .stack = k->stack, .shader = &k->shader };
		int i0 = (int)(tile % r->across) * TILE, j0 = (int)(tile / r->across) * TILE;
		for (int j = j0; j < j0 + TILE && j < r->f->height; j++)
			for (int i = i0; i < i0 + TILE && i < r->f->width; i++)
				follow_pixel(r, &w, i, j);
	}
}

static void trace_tile(const struct render *r, struct worker *k, size_t tile)
{
	struct view_walker w = { .v = r->v, .o = r->o, .stack = k->stack,
		                 .shader = r->v->method == VIEW_MESH ? NULL : &k->shader };
	int i0 = (int)(tile % r->across) * TILE, j0 = (int)(tile / r->across) * TILE;
	int i1 = i0 + TILE < r->f->width ? i0 + TILE : r->f->width;
	int j1 = j0 + TILE < r->f->height ? j0 + TILE : r->f->height;
	struct tile_sum *sum = &r->tile[tile];

	for (int j = j0; j < j1; j++)
		for (int i = i0; i < i1; i++, w.pixel++) {
			follow_pixel(r, &w, i, j);
			keep_pixel(&w, (size_t)r->v->m->bands, &k->sums);
		}
	if (w.shader)
		view_shader_run(w.shader, &k->sums);
	for (int j = j0, at = 0; j < j1; j++)
		for (int i = i0; i < i1; i++, at++)
			sum->radiance += store_pixel(r, &k->sums, (size_t)at, i, j);
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

static int new_worker(const struct render *r, struct worker *k, int thread, struct err *e)
{
	size_t values = TILE * TILE * (size_t)r->v->m->bands;
	struct view_sums *s = &k->sums;

	k->stack = mem_new(view_stack_size(r->o), sizeof *k->stack, "ray stacks", e);
	s->diffuse = mem_new(4 * values, sizeof *s->diffuse, "pixels", e);
	if (!k->stack || !s->diffuse)
		return -1;
	s->directional = s->diffuse + values;
	s->emission = s->directional + values;
	s->square = s->emission + values;
	return r->v->method == VIEW_MESH ? 0 : view_shader_init(&k->shader, r->v, r->gather, thread, e);
}

static void free_workers(struct render *r)
{
	for (int t = 0; t < r->o->threads && r->worker; t++) {
		free(r->worker[t].stack);
		free(r->worker[t].sums.diffuse);
		view_shader_free(&r->worker[t].shader);
	}
	free(r->worker);
}

static int new_gather(struct render *r, struct err *e)
{
	struct gather_options o = { .rays = r->o->gather_rays, .depth = r->o->depth,
		                    .threads = r->o->threads };

	r->gather = r->v->method == VIEW_GATHER ? gather_new(r->v, &o, e) : NULL;
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
	gather_corners(r->gather, progress);
}

static int new_buffers(struct render *r, size_t tiles, struct err *e)
{
	int n = r->o->samples;

	r->tile = mem_new(tiles, sizeof *r->tile, "tiles", e);
	r->spot = mem_new((size_t)n, sizeof *r->spot, "pixel samples", e);
	r->worker = mem_new((size_t)r->o->threads, sizeof *r->worker, "threads", e);
	if (!r->tile || !r->spot || !r->worker)
		return -1;
	for (int t = 0; t < r->o->threads; t++)
		if (new_worker(r, &r->worker[t], t, e))
			return -1;
	/* Hammersley points, the same in every pixel: edges come out regular. */
	for (int i = 0; i < n; i++) {
		r->spot[i][0] = (i + .5) / n;
		r->spot[i][1] = radical_inverse((uint32_t)i) + .5 / n;
	}
	return 0;
}

static void sum_tiles(const struct render *r, size_t tiles, struct view_stats *stats)
{
	double pixels = (double)r->f->width * r->f->height;

	*stats = (struct view_stats){ 0 };
	for (size_t t = 0; t < tiles; t++) {
		stats->rays += r->tile[t].rays;
		stats->radiance += r->tile[t].radiance / pixels;
		stats->cut += r->tile[t].cut / pixels;
	}
}

static int failed(const struct render *r, struct err *e)
{
	for (int t = 0; t < r->o->threads; t++)
		if (r->worker[t].shader.e.set)
			return err_set(e, "%s", r->worker[t].shader.e.text);
	return 0;
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
	if (!new_gather(&r, e) && !new_buffers(&r, tiles, e) && !new_picture(&r, picture, e)) {
		if (r.gather)
			gather(&r, tiles, progress);
		par_for(tiles, 1, o->threads, trace_tiles, &r, progress);
		sum_tiles(&r, tiles, stats);
		bad = failed(&r, e);
	}
	if (r.gather && !bad)
		stats->rays += gather_rays(r.gather);
	free_workers(&r);
	gather_free(r.gather);
	free(r.spot);
	free(r.tile);
	return bad;
}
