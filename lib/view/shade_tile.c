#include "lib/view/shade_tile.h"

#include <stdlib.h>
#include <string.h>

int view_shade_tile_init(struct view_shade_tile *s, const struct view_scene *v,
                         struct gather *gather, double relative, double lobe_relative, int thread,
                         struct err *e)
{
	*s = (struct view_shade_tile){ .v = v, .relative = relative, .lobe_relative = lobe_relative,
	                           .gather = gather, .thread = thread };
	s->direct = occ_direct_worker_new(v->direct, e);
	s->sampled = mem_new(v->lobes ? v->m->element.n : 0, 2, "lobes", e);
	return s->direct && s->sampled ? 0 : -1;
}

void view_shade_tile_free(struct view_shade_tile *s)
{
	occ_direct_worker_free(s->direct);
	free(s->sampled);
	free(s->request.data);
	free(s->weight.data);
	free(s->order.data);
	free(s->lobe.data);
	free(s->lobe_order.data);
}

int view_shade_tile_sampled(struct view_shade_tile *s, uint32_t element_side)
{
	enum { SAMPLED = 1, BY_FORMULA };

	if (!s->sampled[element_side]) {
		occ_direct_begin(s->direct, element_side);
		s->sampled[element_side] = occ_direct_sampled(s->direct) ? SAMPLED : BY_FORMULA;
	}
	return s->sampled[element_side] == SAMPLED;
}

/* Puts the last request of `of` in the order of element-sides. */
static void put_order(struct view_shade_tile *s, struct array *order, const struct array *of,
                      uint32_t element, int side)
{
	uint64_t key = (2 * (uint64_t)element + (uint64_t)side) << 31 | (of->n - 1);

	mem_append(order, &key, 1, sizeof key, &s->e);
}

void view_shade_tile_put(struct view_shade_tile *s, const struct view_request *q,
                         const double *weight)
{
	const struct view_side *side = &s->v->side[2 * q->material + (uint32_t)q->side];

	for (int k = 0; k < 2 && s->asking; k++)
		if (k == q->side ? side->diffuse : side->translucent)
			view_gather_want(s->gather, 2 * q->element + (uint32_t)k);
	if (s->asking)
		return;
	if (mem_append(&s->request, q, 1, sizeof *q, &s->e) ||
	    mem_append(&s->weight, weight, (size_t)s->v->m->bands, sizeof *weight, &s->e))
		return;
	if (side->diffuse)
		put_order(s, &s->order, &s->request, q->element, q->side);
	if (side->translucent)
		put_order(s, &s->order, &s->request, q->element, !q->side);
}

void view_shade_tile_put_lobe(struct view_shade_tile *s, const struct view_lobe_request *q)
{
	if (!mem_append(&s->lobe, q, 1, sizeof *q, &s->e))
		put_order(s, &s->lobe_order, &s->lobe, q->l.element, q->l.side);
}

static int by_key(const void *x, const void *y)
{
	uint64_t a = *(const uint64_t *)x, b = *(const uint64_t *)y;

	return (a > b) - (a < b);
}

/* Adds the light that arrives on a side of a point. */
static void shade(struct view_shade_tile *s, size_t request, int side, const struct view_sums *to)
{
	size_t bands = (size_t)s->v->m->bands;
	const struct view_request *q = (const struct view_request *)s->request.data + request;
	const double *weight = (const double *)s->weight.data + request * bands;
	const struct view_side *seen = &s->v->side[2 * q->material + (uint32_t)q->side];
	const double *part = side == q->side ? seen->here : seen->across;
	double *light = (q->directional ? to->directional : to->diffuse) + q->slot * bands;
	double *square = to->square + q->slot * bands;
	double h[BANDS_MAX], error[BANDS_MAX], other[BANDS_MAX];

	interp_reconstruction_at(s->gather ? &s->v->all : &s->v->part, q->element, side, q->w,
	                         other);
	occ_direct_begin(s->direct, 2 * q->element + (uint32_t)side);
	if (occ_direct_at(s->direct, q->x, q->seed, s->relative, other, h, error, &s->e))
		return;
	for (size_t b = 0; b < bands; b++) {
		double off = weight[b] * part[b] * error[b];
		light[b] += weight[b] * part[b] * h[b];
		square[b] += off * off;
	}
	if (!s->gather)
		return;
	struct gathered found;
	view_gather_at(s->gather, 2 * q->element + (uint32_t)side, q->x, q->w, q->seed, s->thread,
	               &found);
	for (size_t b = 0; b < bands; b++) {
		double off = weight[b] * part[b] * found.error[b];
		light[b] += weight[b] * part[b] * found.h[b];
		square[b] += off * off;
		to->error[q->slot * bands + b] += weight[b] * part[b] * found.common[b];
	}
}

/* Adds the light of emitters in a lobe. */
static void shade_lobe(struct view_shade_tile *s, size_t request, const struct view_sums *to)
{
	const struct view_lobe_request *q =
	    (const struct view_lobe_request *)s->lobe.data + request;
	struct aim_lobe_weight lobe = { &q->l, s->v->m->lobe };
	struct direct_weight weight = aim_lobe_weight(&lobe);
	size_t at = q->slot * (size_t)s->v->m->bands;
	double h[BANDS_MAX];

	occ_direct_begin(s->direct, 2 * q->l.element + (uint32_t)q->l.side);
	int sampled = view_shade_tile_sampled(s, 2 * q->l.element + (uint32_t)q->l.side);
	if (!sampled && occ_direct_weighted(s->direct, q->l.x, &weight, h, &s->e))
		return;
	for (int b = 0; b < s->v->m->bands; b++, at++) {
		to->directional[at] += sampled ? q->found[b] : q->weight[b] * h[b];
		to->square[at] += sampled ? q->all[b] : q->rest[b];
	}
}

void view_shade_tile_run(struct view_shade_tile *s, const struct view_sums *to)
{
	const uint64_t *order = s->order.data, *lobe = s->lobe_order.data;

	if (s->order.n)
		qsort(s->order.data, s->order.n, sizeof *order, by_key);
	for (size_t i = 0; i < s->order.n && !s->e.set; i++)
		shade(s, order[i] & INT32_MAX, (int)(order[i] >> 31 & 1), to);
	if (s->lobe_order.n)
		qsort(s->lobe_order.data, s->lobe_order.n, sizeof *lobe, by_key);
	for (size_t i = 0; i < s->lobe_order.n && !s->e.set; i++)
		shade_lobe(s, lobe[i] & INT32_MAX, to);
	s->request.n = s->weight.n = s->order.n = s->lobe.n = s->lobe_order.n = 0;
}
