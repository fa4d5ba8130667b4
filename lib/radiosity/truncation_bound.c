/* A certified bound on what unshot flux can still do.
 *
 * N(side) = how many times unit flux arriving on a patch-side arrives again, all further
 * reflections together, for the worst way it can leave. With T the step from one shot to
 * the next, N = T(1 + N); T is monotone and subadditive (it takes the largest of a side's
 * lobes). From N_0 = 0, steps add D_k = N_k - N_(k-1), and D_(k+1) <= T D_k. Once
 * T D_k <= q D_k everywhere in a connected component with q < 1, all that is still to
 * come is at most q / (1 - q) D_k there. D_k tends to the dominant eigenvector of T, for
 * which this is sharp (the quotients of Collatz and Wielandt: Varga, Matrix Iterative
 * Analysis, sec. 2.1).
 *
 * Where a row itself follows what a side's lobes send on, its later blocks count that: the
 * side then counts with what its other reflections do. So N and D have two values a side. */
#include "lib/radiosity/truncation_bound.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/channels.h"
#include "lib/base/mem.h"
#include "lib/base/parallel.h"
#include "lib/radiosity/propagate.h"
#include "lib/scatter/bsdf.h"

/* Passes over all runs at most: where 64 do not make the bound tight, albedos are near 1 and it
 * is not worth more time than shooting took. A guess. */
enum { STEPS_MAX = 64 };

/* A part of the bound: a remainder of more than that, not summed but bounded, is worth a step
 * more. It is how far the bound may be above what it bounds, roughly; a guess. */
static const double loose = .15;

/* Rows that a thread takes at a time: they differ much in length. A guess. */
enum { ROWS_AT_A_TIME = 64 };

struct bound {
	const struct transport *t;
	size_t bands, vectors;
	const struct components *components;
	double *in;           /* [blocks][bands] flux by each block of unit flux, over its sum */
	double *row;          /* [rows][bands] what a row makes of D, or of 1 + N */
	lanes *d;             /* [2][2P][vectors] D: of all reflections, of all but lobes */
	lanes *n;             /* the same of N, later 1 + N */
	double *ratio;        /* [components][bands] q */
	uint8_t dark[BANDS_MAX]; /* bands without unshot flux: they need no bound */
	double bytes;         /* of runs read */
};

static void unit_rows(struct bound *x, struct propagator *propagator)
{
	const struct transport *t = x->t;
	double one[BANDS_MAX];

	for (size_t k = 0; k < BANDS_MAX; k++)
		one[k] = 1;
	for (uint32_t r = 0; r < t->rows; r++) {
		double *in = x->in + t->row_block[r] * x->bands;
		radiosity_propagate_block_flux(propagator, r, one, in);
		for (uint64_t b = t->row_block[r]; b < t->row_block[r + 1]; b++)
			for (size_t k = 0; k < x->bands; k++)
				*in++ /= t->block[b].sum > 0 ? t->block[b].sum : 1;
	}
}

/* What plain runs make of unit flux by unit of value, for a vector of bands of n. Sums by
 * turns, as one addition would wait for the last. */
static ALWAYS_INLINE lanes plain_step(const struct transport *t, const lanes *of, uint64_t i,
                                      uint64_t end, size_t n)
{
	lanes sum[4] = { 0 };

	for (; i + 3 < end; i += 4)
		for (size_t k = 0; k < 4; k++)
			sum[k] += t->run_sum[i + k] * of[t->run_target[i + k] * n];
	for (; i < end; i++)
		sum[0] += t->run_sum[i] * of[t->run_target[i] * n];
	return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* What a block's runs make of it. */
static lanes block_step(const struct bound *x, const lanes *of, uint64_t b, size_t v)
{
	const struct transport *t = x->t;
	const struct block *block = &t->block[b];
	const size_t n = x->vectors;
	const lanes *without = of + 2 * t->m->patch.n * n;
	lanes sum = n == 1 ? plain_step(t, of, block->run, block->ideal, 1)
	                   : plain_step(t, of + v, block->run, block->ideal, n);

	for (uint64_t i = block->ideal; i < block[1].run; i++) {
		int followed = t->run_link[block->link + (i - block->special)] == RUN_FOLLOWED;
		sum += t->run_sum[i] * (followed ? without : of)[t->run_target[i] * n + v];
	}
	return sum;
}

struct rows_job {
	const struct bound *x;
	const lanes *of;
};

static void rows_step(void *arg, size_t begin, size_t end, int thread)
{
	const struct rows_job *j = arg;
	const struct bound *x = j->x;
	const struct transport *t = x->t;

	(void)thread;
	for (size_t r = begin; r < end; r++) {
		double *row = x->row + r * x->bands;
		memset(row, 0, x->bands * sizeof *row);
		for (uint64_t b = t->row_block[r]; b < t->row_block[r + 1]; b++)
			for (size_t v = 0; v < x->vectors; v++) {
				lanes sum = block_step(x, j->of, b, v);
				for (size_t k = v * LANES; k < x->bands && k < (v + 1) * LANES; k++)
					row[k] += x->in[b * x->bands + k] * sum[k % LANES];
			}
	}
}

static void all_rows(struct bound *x, const lanes *of, int threads)
{
	struct rows_job j = { x, of };

	par_for(x->t->rows, ROWS_AT_A_TIME, threads, rows_step, &j, NULL);
	x->bytes += (double)(x->t->runs * x->vectors) *
	            (sizeof *x->t->run_target + sizeof *x->t->run_sum);
}

/* What x->row has of the rows that flux arriving on a side leaves by, with lobes or
 * without. */
static double side_step(const struct bound *x, uint32_t ps, int lobes, size_t k)
{
	const struct transport *t = x->t;
	const struct materials *mt = &t->m->material;
	uint32_t material = model_patch_material(t->m, ps >> 1);
	size_t at = model_material_at(mt, material, (int)(ps & 1)) + k;
	double sum = 0, lobe[2] = { 0, 0 };

	if (t->diffuse_row[ps] != FF_NO_ROW)
		sum += mt->rho_d[at] * x->row[t->diffuse_row[ps] * x->bands + k];
	if (t->diffuse_row[ps ^ 1] != FF_NO_ROW)
		sum += mt->tau_d[at] * x->row[t->diffuse_row[ps ^ 1] * x->bands + k];
	for (uint64_t l = 2 * t->target_link[ps]; lobes && l < 2 * t->target_link[ps + 1]; l++)
		if (t->link_row[l] != FF_NO_ROW)
			lobe[l & 1] = fmax(lobe[l & 1], x->row[t->link_row[l] * x->bands + k]);
	return sum + mt->rho_s[at] * lobe[0] + mt->tau_s[at] * lobe[1];
}

/* D becomes T D, and is added to N; the ratios. */
static void sides_step(struct bound *x)
{
	const struct model *m = x->t->m;

	memset(x->ratio, 0, x->components->n * x->bands * sizeof *x->ratio);
	for (size_t i = 0; i < 4 * m->patch.n; i++) {
		uint32_t ps = (uint32_t)(i % (2 * m->patch.n));
		double *d = (double *)(x->d + i * x->vectors);
		double *n = (double *)(x->n + i * x->vectors);
		double *ratio = x->ratio + x->components->of[ps] * x->bands;
		for (size_t k = 0; k < x->bands; k++) {
			double next = model_side_modelled(m, ps)
			            ? side_step(x, ps, i < 2 * m->patch.n, k) : 0;
			if (next > 0)
				ratio[k] = fmax(ratio[k], next / d[k]);
			d[k] = next;
			n[k] += next;
		}
	}
}

/* The largest part of 1 + N anywhere that is not summed but bounded; infinite without
 * a bound. With `add` it is added to N. */
static double remainder_of(struct bound *x, int add)
{
	double worst = 0;

	for (size_t i = 0; i < 4 * x->t->m->patch.n; i++)
		for (size_t k = 0; k < x->bands; k++) {
			double d = ((double *)(x->d + i * x->vectors))[k];
			double *n = (double *)(x->n + i * x->vectors) + k;
			uint32_t component = x->components->of[i % (2 * x->t->m->patch.n)];
			double q = x->ratio[component * x->bands + k];
			if (x->dark[k])
				continue;
			double rest = !(d > 0) ? 0 : q < 1 ? d * q / (1 - q) : INFINITY;
			worst = fmax(worst, isfinite(rest) ? rest / (1 + *n + rest) : INFINITY);
			if (add)
				*n += rest;
		}
	return worst;
}

/* 1 + N. 0 if it has no bound. */
static int arrivals(struct bound *x, int threads)
{
	const size_t all = 4 * x->t->m->patch.n * x->vectors;
	/* A remainder that a step brings down by less than 2 percent, after some for the start, is
	 * a geometric series: the bound is as sharp as it will get. Guesses. */
	enum { FIRST_STEPS = 8 };
	const double stuck = .98;
	double rest = INFINITY, before;

	for (size_t i = 0; i < all; i++)
		x->d[i] = (lanes){ 1, 1, 1, 1 };
	for (int k = 0; k < STEPS_MAX && rest > loose; k++) {
		all_rows(x, x->d, threads);
		sides_step(x);
		before = rest;
		rest = remainder_of(x, 0);
		if (isfinite(rest) && rest > stuck * before && k > FIRST_STEPS)
			break;
	}
	if (!isfinite(remainder_of(x, 1)))
		return 0;
	for (size_t i = 0; i < all; i++)
		x->n[i] += 1;
	return 1;
}

/* What x->row makes of a row's unshot flux in all groups. */
static double row_bound(const struct bound *x, uint32_t row, const double *unshot, size_t groups)
{
	double sum = 0;

	for (size_t c = 0; row != FF_NO_ROW && c < groups * x->bands; c++)
		sum += fabs(unshot[c]) * x->row[row * x->bands + c % x->bands];
	return sum;
}

static double all_bounds(const struct bound *x, const struct solution *s)
{
	const struct transport *t = x->t;
	size_t channels = solution_channels(s);
	double sum = 0;

	for (uint32_t ps = 0; ps < s->patch_sides; ps++) {
		uint32_t row = t->diffuse_row[ps], lobe = t->emission_row[ps];
		sum += row_bound(x, lobe != FF_NO_ROW ? lobe : row,
		                 s->unshot.emission + ps * x->bands, 1);
		sum += row_bound(x, row, s->unshot.diffuse + ps * channels, s->groups);
	}
	for (size_t i = s->patch_sides; i < s->sources; i++)
		sum += row_bound(x, t->light_row[i - s->patch_sides],
		                 s->unshot.emission + i * x->bands, 1);
	for (size_t l = 0; l < 2 * s->links; l++) {
		const double *unshot = s->unshot.link + l * channels;
		const uint32_t *row = t->link_row + (l & ~(size_t)1);
		sum += fmax(row_bound(x, row[0], unshot, s->groups),
		            row_bound(x, row[1], unshot, s->groups));
	}
	return sum;
}

static void find_dark(struct bound *x, const struct solution *s)
{
	const struct {
		const double *flux;
		size_t n;
	} list[] = { { s->unshot.emission, s->sources * x->bands },
	             { s->unshot.diffuse, s->patch_sides * solution_channels(s) },
	             { s->unshot.link, 2 * s->links * solution_channels(s) } };

	memset(x->dark, 1, sizeof x->dark);
	for (size_t l = 0; l < sizeof list / sizeof *list; l++)
		for (size_t i = 0; i < list[l].n; i++)
			if (list[l].flux[i] != 0)
				x->dark[i % x->bands] = 0;
}

double radiosity_truncation_bound(const struct transport *t, const struct components *components,
                                  const struct solution *s, int threads, double *bytes)
{
	struct err e = { 0 };
	struct propagator propagator;
	size_t bands = (size_t)t->m->bands;
	struct bound x = { .t = t, .bands = bands, .vectors = lanes_vectors(bands),
	                  .components = components };
	void *room[2];
	double bound = INFINITY;

	x.in = mem_new(t->blocks, bands * sizeof(double), "bound", &e);
	x.row = mem_new(t->rows, bands * sizeof(double), "bound", &e);
	x.ratio = mem_new(components->n, bands * sizeof *x.ratio, "bound", &e);
	x.d = lanes_new(4 * t->m->patch.n * x.vectors, &room[0], "bound", &e);
	x.n = lanes_new(4 * t->m->patch.n * x.vectors, &room[1], "bound", &e);
	if (radiosity_propagator_init(&propagator, t, 1, &e) == 0 && x.in && x.row && x.ratio &&
	    x.d && x.n) {
		unit_rows(&x, &propagator);
		find_dark(&x, s);
		if (arrivals(&x, threads)) {
			all_rows(&x, x.n, threads);
			bound = all_bounds(&x, s);
		}
		*bytes += x.bytes;
	}
	radiosity_propagator_free(&propagator);
	free(x.in);
	free(x.row);
	free(x.ratio);
	free(room[0]);
	free(room[1]);
	return bound;
}
