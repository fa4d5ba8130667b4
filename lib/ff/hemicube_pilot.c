/* One hemicube knows neither what the other points of its patch see nor what its pixels miss.
 * A few others, elsewhere on the patch and turned at random, tell what the row is off by. */
#include "lib/ff/hemicube_pilot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/vec.h"
#include "lib/ff_rays/ray_samples.h"

/* Of the squared difference of a row from its pilots: what is left at least when their own
 * variance is taken away. A guess that keeps luck from looking like exactness;
 * tests/independent/hemicube_errors.py measures the errors that are stated with it. */
static const double left_at_least = .05;

int ff_hemicube_pilot_init(struct ff_thread *t, struct err *e)
{
	const struct ff_job *j = t->job;

	t->pilot_sum = mem_new(2 * j->m->element.n, sizeof *t->pilot_sum, "hemicube errors", e);
	t->pilot_item = mem_new(j->grid.pixels, FF_PILOTS * sizeof *t->pilot_item,
	                        "hemicube errors", e);
	return t->pilot_sum && t->pilot_item ? 0 : -1;
}

/* One more hemicube, at a point of its own. */
static void look(struct ff_thread *t, uint32_t ps, uint32_t i)
{
	const struct ff_job *j = t->job;
	uint64_t seed = rng_mix(j->o.seed ^ ~rng_mix(ps));
	double turn = 2 * PI * rng_sobol(i, 2, seed), eye[3], n[3], tt[3], bb[3], frame[3][3];
	uint32_t element = ff_point(j, ps >> 1, rng_sobol(i, 0, seed), rng_sobol(i, 1, seed), eye);

	ff_normal(j, element, (int)(ps & 1), n);
	v3_frame(n, tt, bb);
	for (int k = 0; k < 3; k++) {
		frame[0][k] = cos(turn) * tt[k] + sin(turn) * bb[k];
		frame[1][k] = cos(turn) * bb[k] - sin(turn) * tt[k];
		frame[2][k] = n[k];
	}
	ray_leave(j->rays, n, eye);
	ff_hemicube_render(&t->cube, j->cubes, eye, (const double (*)[3])frame, HEMICUBE_VOID);
	memcpy(t->pilot_item + i * j->grid.pixels, t->cube.item,
	       j->grid.pixels * sizeof *t->pilot_item);
	for (size_t k = 0; k < j->grid.pixels; k++)
		if (t->cube.item[k] != HEMICUBE_VOID)
			t->pilot_sum[t->cube.item[k]][i] += j->grid.delta[k];
}

/* Weight w of a row beside the pilots' p: the squared difference from their mean, and that less the
 * variance of the mean. */
struct difference {
	double square, off;
};

static struct difference differ(double w, const double p[FF_PILOTS])
{
	double mean = 0, spread = 0;

	for (int i = 0; i < FF_PILOTS; i++)
		mean += p[i] / FF_PILOTS;
	for (int i = 0; i < FF_PILOTS; i++)
		spread += (p[i] - mean) * (p[i] - mean);
	double square = (w - mean) * (w - mean);
	return (struct difference){ square, square - spread / (FF_PILOTS * (FF_PILOTS - 1)) };
}

/* Sums over elements: the two above over the area, and the variance over the area if the row were
 * one sample. */
struct row_error {
	double off, square, one;
};

static void side_error(struct ff_thread *t, uint32_t target, struct row_error *r)
{
	const struct model *m = t->job->m;
	struct tally *y = &t->tally;
	uint32_t end = ff_tally_side_end(y, target), patch = target >> 1;
	uint32_t first = end - (m->patch.start[patch + 1] - m->patch.start[patch]);
	double all[FF_PILOTS] = { 0 }, sum = 0;

	for (uint32_t at = first; at < end; at++) {
		uint32_t column = y->places->column[at];
		double *p = t->pilot_sum[column], w = y->dense[at], area = m->element.area[column >> 1];
		struct difference d = differ(w, p);
		r->off += d.off / area;
		r->square += d.square / area;
		r->one += w / area;
		sum += w;
		for (int i = 0; i < FF_PILOTS; i++)
			all[i] += p[i];
		memset(p, 0, FF_PILOTS * sizeof *p);
	}
	struct difference d = differ(sum, all);
	y->variance[target] = fmax(d.off, left_at_least * d.square);
}

void ff_hemicube_pilot(struct ff_thread *t, uint32_t ps)
{
	const struct ff_job *j = t->job;
	struct tally *y = &t->tally;
	struct row_error r = { 0 };

	for (uint32_t i = 0; i < FF_PILOTS; i++)
		look(t, ps, i);
	for (uint32_t at = ff_tally_next(y, 0); at != UINT32_MAX;) {
		uint32_t target = ff_tally_side_at(y, at);
		side_error(t, target, &r);
		at = ff_tally_next(y, ff_tally_side_end(y, target));
	}
	/* Where the row has nothing and the pilots have something. */
	for (size_t k = 0; k < FF_PILOTS * j->grid.pixels; k++) {
		uint32_t item = t->pilot_item[k];
		if (item == HEMICUBE_VOID)
			continue;
		double *p = t->pilot_sum[item], area = j->m->element.area[item >> 1];
		struct difference d = differ(0, p);
		r.off += d.off / area;
		r.square += d.square / area;
		memset(p, 0, FF_PILOTS * sizeof *p);
	}
	double off = fmax(r.off, left_at_least * r.square);
	y->worth = off > 0 ? r.one / off : 0;
}
