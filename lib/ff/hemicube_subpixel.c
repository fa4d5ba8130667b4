/* Elements below a pixel: hemicubes of an emitter tell how much of its light comes to a
 * patch-side; how it is shared among elements that a pixel or two show, or none, the sample
 * points themselves find out, each by a line to the element. */
#include "lib/ff/hemicube_subpixel.h"

#include "lib/base/constants.h"
#include "lib/base/vec.h"
#include "lib/ff_rays/ray_samples.h"

/* Pixels, of all hemicubes, that show an element as well as lines do: a count; a guess. */
enum { ENOUGH = 2048 };

/* Form factor per area of light from the points to the middle of an element-side. */
static double seen_of(struct ff_thread *t, uint32_t ps, uint32_t column)
{
	const struct ff_job *j = t->job;
	const struct ff_element *el = &j->element[column >> 1];
	double y[3], n[3], sum = 0;

	ff_normal(j, column >> 1, (int)(column & 1), n);
	for (int k = 0; k < 3; k++)
		y[k] = el->corner[k] + (el->edge[0][k] + el->edge[1][k]) / 3;
	ray_leave(j->rays, n, y);
	for (uint32_t i = 0; i < j->o.points; i++) {
		const struct view *v = &t->view[2 * i + (ps & 1)];
		double d[3];
		v3_sub(y, v->eye, d);
		double r2 = v3_dot(d, d), out = v3_dot(d, v->frame[2]), in = -v3_dot(d, n);
		if (!(out > 0 && in > 0))
			continue;
		t->rays++;
		if (!ray_blocked(j->rays, v->eye, y))
			sum += out * in / (PI * r2 * r2);
	}
	return sum;
}

/* Shares the light on a patch-side, whose places begin at `place`. */
static int share(struct ff_thread *t, uint32_t ps, uint32_t place, uint32_t end, double light)
{
	struct tally *y = &t->tally;
	double sum = 0;

	t->shares.n = 0;
	for (uint32_t at = place; at < end; at++) {
		struct ff_share s = { .column = y->places->column[at] };
		s.w = t->job->m->element.area[s.column >> 1] * seen_of(t, ps, s.column);
		sum += s.w;
		if (mem_append(&t->shares, &s, 1, sizeof s, &y->err))
			return -1;
	}
	const struct ff_share *s = t->shares.data;
	for (uint32_t at = place; sum > 0 && at < end; at++)
		if (s[at - place].w > 0 || y->dense[at] > 0)
			ff_tally_set(y, at, light * s[at - place].w / sum, 0);
	return 0;
}

void ff_hemicube_subpixel(struct ff_thread *t, uint32_t ps)
{
	const struct ff_job *j = t->job;
	double pixels = (double)j->grid.pixels * j->o.points;

	for (uint32_t at = ff_tally_next(&t->tally, 0), end; at != UINT32_MAX;
	     at = ff_tally_next(&t->tally, end)) {
		uint32_t target = ff_tally_side_at(&t->tally, at), p = target >> 1;
		uint32_t elements = j->m->patch.start[p + 1] - j->m->patch.start[p];
		double light = 0;
		end = ff_tally_side_end(&t->tally, target);
		for (uint32_t i = end - elements; i < end; i++)
			light += t->tally.dense[i];
		if (elements > 1 && light * pixels < ENOUGH * (double)elements &&
		    share(t, ps, end - elements, end, light))
			return;
	}
}
