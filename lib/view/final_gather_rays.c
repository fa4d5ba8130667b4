#include "lib/view/final_gather_rays.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/base/replicates.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"

/* Counts of rays, powers of two, which Sobol points fill evenly. Guesses but for AT_ONCE. */
enum {
	FIRST = 64, MOST = 1 << 14, /* of a part where an error is aimed at: a guess, and what takes
	                               a point 20 ms at 3 million rays a second */
	CELLS = 8,     /* squared, that rays are sorted into by direction, and */
	AT_ONCE = 512, /* sorted at a time: eight for each cell, exactly, when they are aligned, as
	                  many as a packet of rays has */
	ERRORS = 8     /* of so many one is asked for the error of the solution: an eighth of its
	                  cost, and it need not be known well */
};

/* Standard error of a stretch of the sequence over that of as many independent parts, no unit:
 * the parts fill one another's gaps. Measured when gathering was written, by which command is
 * not known; test_view_gather.c holds stated errors to a factor of 2. */
static const double together = .6;

/* The direct light of a rough side is computed, to such a relative error where it is sampled, up
 * to so many times its size away: beyond, gathering blurs what elements do not show. Guesses. */
static const double roughly = .1, near_sizes = 4;

int view_gather_worker_init(struct gather_worker *w, const struct gather_table *t,
                            const struct view_scene *v, int depth, struct err *e)
{
	*w = (struct gather_worker){ .t = t };
	w->tails = mem_new(1, sizeof *w->tails, "gathering", e);
	w->direct = occ_direct_worker_new(v->direct, e);
	if (w->tails)
		w->tails->depth = depth;
	return w->tails && w->direct ? 0 : -1;
}

void view_gather_worker_free(struct gather_worker *w)
{
	occ_direct_worker_free(w->direct);
	free(w->tails);
}

/* Cosine and sine of 2 PI u for a batch, u in [0, 1), to 1e-6: Taylor series of half the
 * angle, at most pi / 2. */
static void turns(const float *u, float *cosine, float *sine)
{
	for (int i = 0; i < RAY_BATCH; i++) {
		float a = (u[i] - .5f) * (float)PI, q = a * a;
		float s = a * (1 + q * (-1.f / 6 + q * (1.f / 120 + q * (-1.f / 5040 +
		          q * (1.f / 362880 - q * (1.f / 39916800))))));
		float c = 1 + q * (-.5f + q * (1.f / 24 + q * (-1.f / 720 + q * (1.f / 40320 +
		          q * (-1.f / 3628800 + q * (1.f / 479001600))))));
		/* u - 1/2 is half a turn off. */
		cosine[i] = -(c * c - s * s);
		sine[i] = -2 * s * c;
	}
}

/* Points [first, first + n) of a scramble, those of like directions together: packets of
 * rays then take one way through the scene. */
static void points(const struct gather_table *t, const uint32_t seed[2], uint32_t first, uint32_t n,
                   float sorted[2][AT_ONCE])
{
	float u[2][AT_ONCE];
	uint32_t begin[CELLS * CELLS + 1] = { 0 }, cell[AT_ONCE];

	for (uint32_t k = 0; k < 2; k++)
		for (uint32_t i = 0; i < n; i++) {
			uint32_t at = first + i;
			uint32_t bits = at < GATHER_BITS ? t->bits[k * GATHER_BITS + at]
			                                 : rng_sobol_bits(at, (int)k);
			u[k][i] = (float)(rng_scramble_bits(bits, seed[k]) >> 8) * 0x1p-24f;
		}
	for (uint32_t i = 0; i < n; i++) {
		cell[i] = (uint32_t)(CELLS * u[0][i]) * CELLS + (uint32_t)(CELLS * u[1][i]);
		begin[cell[i] + 1]++;
	}
	for (int i = 0; i < CELLS * CELLS; i++)
		begin[i + 1] += begin[i];
	for (uint32_t i = 0; i < n; i++) {
		uint32_t to = begin[cell[i]]++;
		sorted[0][to] = u[0][i];
		sorted[1][to] = u[1][i];
	}
}

/* Directions by the cosine about the last axis of a frame. */
static void aim(double frame[3][3], const float *u0, const float *u1, struct ray_batch *b)
{
	float c[RAY_BATCH], s[RAY_BATCH], f[3][3];

	for (int k = 0; k < 3; k++)
		for (int j = 0; j < 3; j++)
			f[k][j] = (float)frame[k][j];
	turns(u1, c, s);
	for (int i = 0; i < RAY_BATCH; i++) {
		float r = sqrtf(u0[i]), z = sqrtf(1 - u0[i]);
		for (int k = 0; k < 3; k++)
			b->dir[k][i] = r * c[i] * f[0][k] + r * s[i] * f[1][k] + z * f[2][k];
	}
}

/* Has the direct light computed where ray i of a batch met something, at y. */
static void put_close(struct gather_worker *w, const struct ray_batch *b, uint32_t i, size_t place,
                      const double y[3], double *sum)
{
	struct gather_close *to = &w->close[w->closes];

	to->place = place;
	to->turn = w->closes++;
	to->sum = sum;
	to->w[0] = (double)b->w[0][i];
	to->w[1] = (double)b->w[1][i];
	memcpy(to->x, y, sizeof to->x);
}

/* Adds the radiance of a point with its direct light computed. */
static void add_close(struct gather_worker *w, const struct gather_close *p)
{
	static const double middle[3] = { 1. / 3, 1. / 3, 1. / 3 };
	const struct view_scene *v = w->t->v;
	size_t bands = (size_t)v->m->bands;
	const struct view_side *s =
	    &v->side[2 * model_patch_material(v->m, v->m->element.patch[p->place / 2]) +
	             p->place % 2];
	const float *rest = w->t->rest + 3 * bands * p->place;
	double h[BANDS_MAX], error[BANDS_MAX], usual[BANDS_MAX];

	for (size_t b = 0; b < bands; b++)
		p->sum[b] += fmax(0, (double)rest[b] + (double)rest[bands + b] * p->w[0] +
		                     (double)rest[2 * bands + b] * p->w[1]);
	for (int across = 0; across < 2; across++) {
		const double *part = across ? s->across : s->here;
		int side = (int)(p->place % 2) ^ across;
		if (!(across ? s->translucent : s->diffuse))
			continue;
		occ_direct_begin(w->direct, (uint32_t)(p->place / 2 * 2) + (uint32_t)side);
		interp_reconstruction_at(&v->all, p->place / 2, side, middle, usual);
		if (occ_direct_at(w->direct, p->x, p->place, roughly, usual, h, error, &w->e))
			return;
		for (size_t b = 0; b < bands; b++)
			p->sum[b] += part[b] * h[b];
	}
}

static int by_place(const void *x, const void *y)
{
	const struct gather_close *a = x, *b = y;

	return a->place != b->place ? (a->place > b->place) - (a->place < b->place)
	                            : (a->turn > b->turn) - (a->turn < b->turn);
}

/* Adds what is close, side by side: points of one share what is between it and emitters. */
static void add_closes(struct gather_worker *w)
{
	qsort(w->close, w->closes, sizeof *w->close, by_place);
	for (uint32_t i = 0; i < w->closes && !w->e.set; i++)
		add_close(w, &w->close[i]);
	w->closes = 0;
}

/* Adds what errs in the radiance of what ray i of a batch met, at a distance d of x. */
static void add_blur(struct gather_worker *w, const double d[3], uint32_t place, int computed)
{
	const struct view_scene *v = w->t->v;
	const struct model *m = v->m;
	size_t bands = (size_t)m->bands, e = place / 2, far = place ^ 1;
	const struct view_side *s =
	    &v->side[2 * model_patch_material(m, m->element.patch[e]) + place % 2];
	double square = v3_dot(d, d);
	double part = fabs(v3_dot(d, w->normal) * v3_dot(d, &m->element.normal[3 * e])) *
	              m->element.area[e] / (PI * square * square);

	for (size_t k = 0; k < bands; k++)
		w->blur[k] +=
		    s->here[k] * s->here[k] * view_blurred(v, place * bands + k, part, computed) +
		    s->across[k] * s->across[k] * view_blurred(v, far * bands + k, part, computed);
}

/* Follows ray i of a batch beyond what it met. */
static void go_on(struct gather_worker *w, const double x[3], const struct ray_batch *b, uint32_t i,
                  uint32_t place, const struct gather_going *begun, double *sum)
{
	const struct gather_table *t = w->t;
	int tail = t->kind[place] & GATHER_TAIL, close = t->kind[place] & GATHER_ROUGH && !tail;
	double y[3], d[3];

	if (close || i % ERRORS == 0) {
		view_gather_hit(t, b, i, y);
		v3_sub(y, x, d);
		close = close &&
		        v3_dot(d, d) < near_sizes * near_sizes * t->v->m->element.area[place / 2];
	}
	if (i % ERRORS == 0)
		add_blur(w, d, place, close);
	if (tail)
		view_gather_go_on(w->tails, t, b, i, place, begun);
	if (close)
		put_close(w, b, i, place, y, sum);
	else
		view_gather_add(t, b, i, place, begun->weight, sum);
}

/* Adds the radiance that the rays of a batch find. */
static void add_batch(struct gather_worker *w, const double x[3], struct ray_batch *b, uint32_t n,
                      uint64_t seed, double *sum)
{
	const struct gather_table *t = w->t;
	size_t bands = (size_t)t->v->m->bands;
	struct gather_going begun = { .depth = 0 };
	uint32_t place[RAY_BATCH];

	for (size_t k = 0; k < bands; k++)
		begun.weight[k] = 1;
	if (w->closes + n > GATHER_CLOSES)
		add_closes(w);
	ray_nearest_batch(t->v->rays, b, n);
	view_gather_places(t, b, n, place);
	w->rays += n;
	for (uint32_t i = 0; i < n; i++) {
		w->blurs += i % ERRORS == 0;
		if (b->triangle[i] == RAY_MISS)
			continue;
		begun.random = rng_seed(seed, i);
		go_on(w, x, b, i, place[i], &begun, sum);
	}
	view_gather_follow(w->tails, t, RAY_BATCH - 1, sum);
}

/* Adds the radiance that points [first, first + n) of a scramble find. */
static void add_rays(struct gather_worker *w, const double x[3], double frame[3][3],
                     uint64_t seed, uint32_t first, uint32_t n, double *sum)
{
	struct ray_units units = ray_units(w->t->v->rays);
	uint32_t scramble[2] = { rng_sobol_seed(seed, 0), rng_sobol_seed(seed, 1) };
	float u[2][AT_ONCE] = { { 0 } };
	struct ray_batch b;

	for (int k = 0; k < 3; k++)
		for (int i = 0; i < RAY_BATCH; i++)
			b.org[k][i] = (float)((x[k] - units.centre[k]) * units.per_unit);
	for (uint32_t at = 0; at < n; at += AT_ONCE) {
		uint32_t some = n - at < AT_ONCE ? n - at : AT_ONCE;
		points(w->t, scramble, first + at, some, u);
		for (uint32_t i = 0; i < some; i += RAY_BATCH) {
			aim(frame, &u[0][i], &u[1][i], &b);
			add_batch(w, x, &b, some - i < RAY_BATCH ? some - i : RAY_BATCH,
			          rng_mix(seed + first + at + i), sum);
		}
	}
	view_gather_follow(w->tails, w->t, 0, sum);
}

/* Irradiance from the sums of parts of `rays` rays each, and its standard error. */
static void measure(double part[REPLICATES][BANDS_MAX], int bands, double rays, double *h,
                    double *error)
{
	for (int b = 0; b < bands; b++) {
		struct replicates r = replicates_of(&part[0][b], BANDS_MAX, REPLICATES);
		h[b] = PI * r.mean / rays;
		error[b] = PI * together * replicates_error(r, REPLICATES) / rays;
	}
}

/* Rays of a part for an error of `relative` times scale[bands], by a pilot: rays that are kept must
 * not decide it, for where all have missed what is small they would be thought enough. */
static uint32_t enough(struct gather_worker *w, const double x[3], double frame[3][3],
                       uint64_t seed, double relative, const double *scale)
{
	double part[REPLICATES][BANDS_MAX] = { { 0 } }, h[BANDS_MAX], error[BANDS_MAX], most = 0;
	uint32_t each = FIRST;

	for (uint32_t p = 0; p < REPLICATES; p++)
		add_rays(w, x, frame, rng_mix(~seed), p * FIRST, FIRST, part[p]);
	add_closes(w);
	measure(part, w->t->v->m->bands, FIRST, h, error);
	for (int b = 0; b < w->t->v->m->bands; b++)
		if (error[b] > 0)
			most = fmax(most, error[b] / (relative * scale[b]));
	while (each < MOST && each < FIRST * most * most)
		each *= 2;
	return each;
}

void view_gather_point(struct gather_worker *w, const double x[3], const double n[3], uint64_t seed,
                       int rays, double relative, const double *scale, struct gathered *to)
{
	double part[REPLICATES][BANDS_MAX] = { { 0 } }, frame[3][3];
	int bands = w->t->v->m->bands;

	memcpy(w->normal, n, sizeof w->normal);
	v3_frame(n, frame[0], frame[1]);
	memcpy(frame[2], n, sizeof frame[2]);
	uint32_t each = relative > 0 ? enough(w, x, frame, seed, relative, scale)
	                             : (uint32_t)(rays + REPLICATES - 1) / REPLICATES;
	memset(w->blur, 0, sizeof w->blur);
	w->blurs = 0;
	for (uint32_t p = 0; p < REPLICATES; p++)
		add_rays(w, x, frame, seed, p * each, each, part[p]);
	add_closes(w);
	measure(part, bands, each, to->h, to->error);
	for (int b = 0; b < bands; b++)
		to->common[b] = PI * sqrt(w->blur[b] / w->blurs);
}
