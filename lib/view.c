#include "view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "mem.h"
#include "rng.h"
#include "view_path.h"

static const double pi = 3.14159265358979323846;

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

struct render {
	const struct view_scene *v;
	const struct view_frame *f;
	const struct view_options *o;
	struct image *picture;
	struct planes at;
	double (*spot)[2];          /* [samples] positions in the pixel */
	struct view_branch **stack; /* [threads] */
	struct tile_sum *tile;
	size_t across;              /* tiles in a row */
};

/* ---- what all views share ---- */

static struct view_lobe lobe_of(const double *coefficient, int bands, double k)
{
	for (int b = 0; b < bands; b++)
		if (coefficient[b] > 0)
			return (struct view_lobe){ coefficient, k };
	return (struct view_lobe){ NULL, 0 };
}

static void tabulate_side(const struct materials *mt, size_t material, int side,
                          struct view_side *s)
{
	size_t here = material_at(mt, material, side), across = material_at(mt, material, !side);

	s->black = side == BACK && mt->one_sided[material];
	for (int b = 0; b < mt->bands; b++) {
		s->here[b] = mt->rho_d[here + (size_t)b] / pi;
		s->across[b] = mt->tau_d[across + (size_t)b] / pi;
		s->translucent |= s->across[b] > 0;
		s->emits |= mt->emission[here + (size_t)b] > 0;
	}
	s->reflected = lobe_of(&mt->rho_s[here], mt->bands,
	                       mt->alpha[2 * material + (size_t)side]);
	s->transmitted = lobe_of(&mt->tau_s[across], mt->bands,
	                         mt->beta[2 * material + (size_t)!side]);
}

/* U with L_e + M/pi + s U <= U for what one corner of an element-side shows, s its
 * directional weight: then no tail brings more than the largest U of the scene. */
static double corner_ceiling(const struct view_scene *v, size_t material, int side,
                             const float *h, int band)
{
	const struct materials *mt = &v->m->material;
	const struct view_side *s = &v->side[2 * material + (size_t)side];
	double m = mt->emission_exponent[2 * material + (size_t)side];
	double own = mt->emission[material_at(mt, material, side) + (size_t)band];
	double kept = 1;

	if (own > 0 && m < 1)
		return (double)INFINITY;
	own += s->here[band] * (double)h[side * mt->bands + band] +
	       s->across[band] * (double)h[!side * mt->bands + band];
	if (s->reflected.coefficient)
		kept -= s->reflected.coefficient[band];
	if (s->transmitted.coefficient)
		kept -= s->transmitted.coefficient[band];
	if (kept < -1e-6)
		return (double)INFINITY;
	return own > 0 ? own / fmax(kept, 0) : 0;
}

static void find_ceiling(struct view_scene *v)
{
	const struct model *m = v->m;
	size_t bands = (size_t)m->bands;

	for (size_t c = 0; c < 3 * m->elements; c++) {
		size_t material = model_patch_material(m, m->element_patch[c / 3]);
		for (int side = 0; side < 2; side++)
			for (int b = 0; b < m->bands && !v->side[2 * material + (size_t)side].black; b++)
				v->ceiling[b] = fmax(v->ceiling[b],
				                     corner_ceiling(v, material, side,
				                                    v->h->corner + 2 * bands * c, b));
	}
}

struct view_scene *view_scene_new(const struct model *m, const struct ray_scene *rays,
                                  const struct reconstruction *h, struct err *e)
{
	struct view_scene *v = mem_new(1, sizeof *v, "view", e);

	if (!v)
		return NULL;
	v->m = m;
	v->rays = rays;
	v->h = h;
	v->side = mem_new(2 * m->material.n, sizeof *v->side, "materials of the view", e);
	if (!v->side) {
		free(v);
		return NULL;
	}
	for (size_t i = 0; i < 2 * m->material.n; i++)
		tabulate_side(&m->material, i / 2, (int)(i % 2), &v->side[i]);
	find_ceiling(v);
	return v;
}

void view_scene_free(struct view_scene *v)
{
	if (!v)
		return;
	free(v->side);
	free(v);
}

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

static void trace_pixel(const struct render *r, struct view_walker *w,
                        struct view_branch *b, int i, int j)
{
	uint64_t id = (uint64_t)j * (uint64_t)r->f->width + (uint64_t)i, seed = rng_mix(id);
	int bands = r->v->m->bands, n = r->o->samples;

	memset(w->diffuse, 0, (size_t)bands * sizeof *w->diffuse);
	memset(w->directional, 0, (size_t)bands * sizeof *w->directional);
	memset(w->emission, 0, (size_t)bands * sizeof *w->emission);
	for (int s = 0; s < n; s++) {
		camera_ray(r->f, i + r->spot[s][0], j + r->spot[s][1], b->org, b->dir);
		b->index = (uint32_t)s;
		b->seed = seed;
		view_follow(w, b);
	}
	double total[BANDS_MAX], share = 1. / n;
	for (int k = 0; k < bands; k++) {
		w->diffuse[k] *= share;
		w->directional[k] *= share;
		w->emission[k] *= share;
		total[k] = w->diffuse[k] + w->directional[k] + w->emission[k];
	}
	store_colour(r, 0, id, total);
	for (int k = 0; k < bands && r->at.bands >= 0; k++)
		store(r, r->at.bands + k, id, total[k]);
	store_colour(r, r->at.diffuse, id, w->diffuse);
	store_colour(r, r->at.directional, id, w->directional);
	store_colour(r, r->at.emission, id, w->emission);
	if (r->o->layers & (VIEW_Z | VIEW_N | VIEW_ELEMENT | VIEW_PATCH))
		store_first(r, id, i + .5, j + .5);
}

static double pixel_radiance(const struct view_walker *w, int bands)
{
	double sum = 0;

	for (int b = 0; b < bands; b++)
		sum += w->diffuse[b] + w->directional[b] + w->emission[b];
	return sum;
}

static void trace_tiles(void *arg, size_t begin, size_t end, int thread)
{
	const struct render *r = arg;
	int bands = r->v->m->bands;
	struct view_branch primary;

	for (size_t t = begin; t < end; t++) {
		struct view_walker w = { .v = r->v, .o = r->o, .stack = r->stack[thread] };
		int i0 = (int)(t % r->across) * TILE, j0 = (int)(t / r->across) * TILE;
		struct tile_sum sum = { 0 };
		for (int j = j0; j < j0 + TILE && j < r->f->height; j++)
			for (int i = i0; i < i0 + TILE && i < r->f->width; i++) {
				trace_pixel(r, &w, &primary, i, j);
				sum.radiance += pixel_radiance(&w, bands);
			}
		for (int b = 0; b < bands; b++)
			sum.cut += w.cut[b] / r->o->samples;
		sum.rays = w.rays;
		r->tile[t] = sum;
	}
}

/* The bits of i mirrored at the point: .0, .1, .01, .11, .001, ... (van der Corput). */
static double radical_inverse(uint32_t i)
{
	double x = 0;

	for (double bit = .5; i; i >>= 1, bit /= 2)
		x += bit * (i & 1);
	return x;
}

static int new_buffers(struct render *r, size_t tiles, struct err *e)
{
	int n = r->o->samples;

	r->tile = mem_new(tiles, sizeof *r->tile, "tiles", e);
	r->spot = mem_new((size_t)n, sizeof *r->spot, "pixel samples", e);
	r->stack = mem_new((size_t)r->o->threads, sizeof *r->stack, "ray stacks", e);
	if (!r->tile || !r->spot || !r->stack)
		return -1;
	for (int t = 0; t < r->o->threads; t++)
		if (!(r->stack[t] = mem_new(view_stack_size(r->o), sizeof **r->stack,
		                            "ray stacks", e)))
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
	if (!new_buffers(&r, tiles, e) && !new_picture(&r, picture, e)) {
		par_for(tiles, 1, o->threads, trace_tiles, &r, progress);
		sum_tiles(&r, tiles, stats);
		bad = 0;
	}
	for (int t = 0; t < o->threads && r.stack; t++)
		free(r.stack[t]);
	free(r.stack);
	free(r.spot);
	free(r.tile);
	return bad;
}
