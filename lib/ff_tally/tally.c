#include "lib/ff_tally/tally.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/vec.h"

struct tally_arrival {
	uint32_t slot, target;
	double dir[3];     /* towards the source, weighted */
};

/* Slot of a chain in this row, made if new. */
static uint32_t slot_of(struct tally *t, uint32_t chain)
{
	struct tally_rest none = { 0 };

	if (chain >= t->chain_slot.n) {
		size_t more = t->chains.n - t->chain_slot.n;
		if (mem_reserve(&t->chain_slot, more, sizeof(uint32_t), &t->err))
			return 0;
		memset((uint32_t *)t->chain_slot.data + t->chain_slot.n, 0, more * sizeof(uint32_t));
		t->chain_slot.n += more;
	}
	uint32_t *slot = (uint32_t *)t->chain_slot.data + chain;
	if (*slot == 0) {
		if (mem_append(&t->slot_chain, &chain, 1, sizeof chain, &t->err) ||
		    mem_append(&t->rest, &none, 1, sizeof none, &t->err))
			return 0;
		*slot = (uint32_t)t->rest.n;
	}
	return *slot - 1;
}

int ff_tally_places_init(struct tally_places *p, const struct model *m, const uint8_t *apart,
                         struct err *e)
{
	uint32_t place = 0;

	*p = (struct tally_places){ 0 };
	if (m->element.n >= TALLY_APART / 2)
		return err_set(e, "more than %u elements", TALLY_APART / 2 - 1);
	p->place = mem_new(2 * m->element.n, sizeof *p->place, "order of elements", e);
	p->column = mem_new(2 * m->element.n, sizeof *p->column, "order of elements", e);
	if (!p->place || !p->column)
		return -1;
	for (uint32_t ps = 0; ps < 2 * m->patch.n; ps++)
		for (uint32_t el = m->patch.start[ps >> 1]; el < m->patch.start[(ps >> 1) + 1]; el++) {
			uint32_t column = 2 * el + (ps & 1);
			p->place[column] = place | (apart[ps] ? TALLY_APART : 0);
			p->column[place++] = column;
		}
	return 0;
}

void ff_tally_places_free(struct tally_places *p)
{
	free(p->place);
	free(p->column);
	*p = (struct tally_places){ 0 };
}

int ff_tally_init(struct tally *t, const struct model *m, const struct tally_places *places,
                  const uint8_t *has_lobe, uint32_t chain_most, struct err *e)
{
	size_t sides = 2 * m->element.n;

	*t = (struct tally){ .m = m, .places = places, .has_lobe = has_lobe,
	                     .words = (sides + 4095) / 4096 };
	if (bsdf_chains_init(&t->chains, m, chain_most, e))
		return -1;
	t->count = mem_new(sides, sizeof *t->count, "row tally", e);
	t->dense = mem_new(sides, sizeof *t->dense, "row tally", e);
	t->touched = mem_new(64 * t->words, sizeof *t->touched, "row tally", e);
	t->words_touched = mem_new(t->words, sizeof *t->words_touched, "row tally", e);
	t->replicate = mem_new(2 * m->patch.n, sizeof *t->replicate, "row tally", e);
	t->square = mem_new(2 * m->patch.n, sizeof *t->square, "row tally", e);
	t->variance = mem_new(2 * m->patch.n, sizeof *t->variance, "row tally", e);
	t->toward = mem_new(2 * m->patch.n, sizeof *t->toward, "row tally", e);
	if (!t->count || !t->dense || !t->touched || !t->words_touched || !t->replicate ||
	    !t->square || !t->variance || !t->toward)
		return -1;
	slot_of(t, 0); /* chain 0 is slot 0 of every row */
	return t->err.set ? err_set(e, "%s", t->err.text) : 0;
}

void ff_tally_free(struct tally *t)
{
	void *array[] = { t->count, t->dense, t->touched, t->words_touched, t->replicate,
		t->square, t->variance, t->toward, t->rest.data, t->slot_chain.data,
		t->chain_slot.data, t->arrival.data };

	for (size_t i = 0; i < sizeof array / sizeof *array; i++)
		free(array[i]);
	ff_tally_chains_free(&t->far);
	bsdf_chains_free(&t->chains);
	*t = (struct tally){ 0 };
}

/* ---- while a row is cast ---- */

struct tally_rest *ff_tally_rest(struct tally *t, uint32_t chain)
{
	uint32_t slot = slot_of(t, chain);

	return slot < t->rest.n ? (struct tally_rest *)t->rest.data + slot : &t->spill;
}

static void note_arrival(struct tally *t, uint32_t chain, uint32_t target, double w,
                         const double dir[3])
{
	struct tally_arrival a = { slot_of(t, chain), target,
	                           { -w * dir[0], -w * dir[1], -w * dir[2] } };

	mem_append(&t->arrival, &a, 1, sizeof a, &t->err);
}

static void hit_near(struct tally *t, uint32_t place, uint32_t ps, double w)
{
	if (w >= 1 && w <= UINT16_MAX && w == floor(w)) { /* whole: rays, or those that stand for several */
		ff_tally_count(t, place, (uint32_t)w);
		return;
	}
	t->weighed = 1;
	t->dense[place] += w;
	t->replicate[ps] += w;
	ff_tally_touch(t, place);
}

static void hit_far(struct tally *t, uint32_t chain, uint32_t place, uint32_t element_side,
                    double w)
{
	struct tally_landing l = { slot_of(t, chain) * 2 * (uint64_t)t->m->element.n + place,
	                           element_side, w };

	ff_tally_chains_add(&t->far, &l, &t->err);
}

void ff_tally_hit(struct tally *t, uint32_t chain, uint32_t element_side, double w,
                  const double dir[3])
{
	uint32_t ps = 2 * t->m->element.patch[element_side >> 1] + (element_side & 1);
	uint32_t place = t->places->place[element_side] & ~TALLY_APART;

	if (chain)
		hit_far(t, chain, place, element_side, w);
	else
		hit_near(t, place, ps, w);
	if (!t->has_lobe[ps])
		return;
	if (chain)
		note_arrival(t, chain, ps, w, dir);
	else
		v3_mad(t->toward[ps], -w, dir, t->toward[ps]);
}

uint32_t ff_tally_next(const struct tally *t, uint64_t place)
{
	if (place >> 12 >= t->words)
		return UINT32_MAX;
	uint64_t bits = t->touched[place >> 6] >> (place & 63);
	if (bits)
		return (uint32_t)(place + (uint64_t)__builtin_ctzll(bits));
	uint64_t word = (place >> 6) + 1;
	bits = word & 63 ? t->words_touched[word >> 6] >> (word & 63) : 0;
	if (!bits) {
		for (word = (word + 63) & ~(uint64_t)63; word >> 6 < t->words; word += 64)
			if ((bits = t->words_touched[word >> 6]))
				break;
		if (!bits)
			return UINT32_MAX;
	}
	word += (uint64_t)__builtin_ctzll(bits);
	return (uint32_t)(64 * word + (uint64_t)__builtin_ctzll(t->touched[word]));
}

double ff_tally_counted(const struct tally *t, uint32_t place)
{
	double n = 0;

	for (int r = 0; r < TALLY_REPLICATES; r++)
		n += t->count[place][r];
	return n;
}

void ff_tally_set(struct tally *t, uint32_t place, double w, double variance)
{
	memset(t->count[place], 0, sizeof t->count[place]);
	t->dense[place] = w;
	t->variance[ff_tally_side_at(t, place)] += variance;
	ff_tally_touch(t, place);
}

uint32_t ff_tally_side_at(const struct tally *t, uint32_t place)
{
	uint32_t column = t->places->column[place];

	return 2 * t->m->element.patch[column >> 1] + (column & 1);
}

uint32_t ff_tally_side_end(const struct tally *t, uint32_t ps)
{
	const uint32_t *start = &t->m->patch.start[ps >> 1];

	return ps & 1 ? 2 * start[1] : start[0] + start[1];
}

void ff_tally_replicate(struct tally *t)
{
	double escape = ff_tally_rest(t, 0)->escape, now = escape - t->escape_before;
	uint32_t place = ff_tally_next(t, 0);

	while (t->weighed && place != UINT32_MAX) {
		uint32_t ps = ff_tally_side_at(t, place);
		t->square[ps] += t->replicate[ps] * t->replicate[ps];
		t->replicate[ps] = 0;
		place = ff_tally_next(t, ff_tally_side_end(t, ps));
	}
	t->escape_square += now * now;
	t->escape_before = escape;
	t->replicates++;
}

/* ---- finishing a row ---- */

/* Variance of one receiver's share of the row from its replicates, or, where
 * there are none, of as many independent samples. */
static double share_variance(const struct tally *t, double sum, double square, double total,
                             uint32_t samples)
{
	double r = t->replicates, f = sum / total;

	if (t->replicates >= 2)
		return fmax(0, square - sum * sum / r) / (r - 1) * r / (total * total);
	return samples ? f * (1 - f) / samples : 0;
}

static int put_arrival(struct ff_batch *b, uint32_t target, const double toward[3],
                       struct err *e)
{
	double l = v3_length(toward);
	float f[3] = { 0, 0, 1 };

	for (int k = 0; k < 3 && l > 0; k++)
		f[k] = (float)(toward[k] / l);
	return mem_append(&b->arrival_target, &target, 1, sizeof target, e) ||
	       mem_append(&b->arrival_direction, f, 3, sizeof *f, e) ? -1 : 0;
}

/* What a row adds up to. */
struct finish {
	uint32_t samples;
	double total, sum, variance;
	double even;              /* the variance if the row were one sample */
};

/* Chain 0 on one patch-side: entries for the elements that were hit, from `place` on.
 * Clears them. */
static int finish_side(struct tally *t, struct ff_batch *b, uint32_t ps, uint32_t place,
                       struct finish *f, struct err *e)
{
	uint32_t end = ff_tally_side_end(t, ps);
	double part[TALLY_REPLICATES] = { 0 }, side_sum = 0, square = t->square[ps];

	if (ff_batch_reserve(b, end - place, e))
		return -1;
	for (; place < end; place = ff_tally_next(t, (uint64_t)place + 1)) {
		double w = t->dense[place] + ff_tally_counted(t, place);
		for (int r = 0; r < TALLY_REPLICATES; r++)
			part[r] += t->count[place][r];
		if (w > 0)
			f->sum += ff_batch_put_value(b, t->places->column[place], w);
		side_sum += w;
		t->dense[place] = 0;
		memset(t->count[place], 0, sizeof t->count[place]);
	}
	for (int r = 0; r < TALLY_REPLICATES; r++)
		square += part[r] * part[r];
	f->even += side_sum / f->total * (1 - side_sum / f->total);
	f->variance += t->variance[ps] > 0 ? t->variance[ps] / (f->total * f->total)
	             : share_variance(t, side_sum, square, f->total, f->samples);
	t->square[ps] = t->replicate[ps] = t->variance[ps] = 0;
	if (!t->has_lobe[ps])
		return 0;
	int bad = side_sum > 0 && put_arrival(b, ps, t->toward[ps], e);
	memset(t->toward[ps], 0, sizeof t->toward[ps]);
	return bad;
}

static int finish_near(struct tally *t, struct ff_batch *b, struct finish *f, struct err *e)
{
	uint32_t place = ff_tally_next(t, 0);

	while (place != UINT32_MAX) {
		uint32_t ps = ff_tally_side_at(t, place);
		if (finish_side(t, b, ps, place, f, e))
			return -1;
		place = ff_tally_next(t, ff_tally_side_end(t, ps));
	}
	for (size_t word = 0; word < t->words; word++) {
		for (uint64_t left = t->words_touched[word]; left; left &= left - 1)
			t->touched[64 * word + (size_t)__builtin_ctzll(left)] = 0;
		t->words_touched[word] = 0;
	}
	return 0;
}

static int by_target(const void *a, const void *b)
{
	const struct tally_arrival *x = a, *y = b;
	if (x->slot != y->slot)
		return x->slot < y->slot ? -1 : 1;
	return (x->target > y->target) - (x->target < y->target);
}

/* Appends the mean directions of a longer chain's arrivals, which are sorted by slot
 * and target. */
static int put_arrivals(struct tally *t, struct ff_batch *b, uint32_t slot, struct err *e)
{
	const struct tally_arrival *a = t->arrival.data;
	size_t n = t->arrival.n, i = 0, hi = n;

	while (i < hi) {
		size_t mid = i + (hi - i) / 2;
		if (a[mid].slot < slot)
			i = mid + 1;
		else
			hi = mid;
	}
	while (i < n && a[i].slot == slot) {
		uint32_t target = a[i].target;
		double d[3] = { 0 };
		for (; i < n && a[i].slot == slot && a[i].target == target; i++)
			v3_mad(d, 1, a[i].dir, d);
		if (put_arrival(b, target, d, e))
			return -1;
	}
	return 0;
}

static int put_block(struct tally *t, struct ff_batch *b, uint32_t slot, struct err *e)
{
	const struct tally_rest *r = (const struct tally_rest *)t->rest.data + slot;

	return put_arrivals(t, b, slot, e) ||
	       ff_batch_put_block(b, ((const uint32_t *)t->slot_chain.data)[slot], r, e) ? -1 : 0;
}

int ff_chains_compare(const struct chains *c, uint32_t a, uint32_t b)
{
	uint32_t la = bsdf_chains_length(c, a), lb = bsdf_chains_length(c, b);

	if (la != lb)
		return la < lb ? -1 : 1;
	for (uint32_t i = 0; i < c->events; i++) {
		uint32_t x = bsdf_chains_count(c, a)[i], y = bsdf_chains_count(c, b)[i];
		if (x != y)
			return x < y ? -1 : 1;
	}
	return 0;
}

struct slot_order {
	const struct chains *chains;
	uint32_t chain, slot;
};

static int by_chain(const void *a, const void *b)
{
	const struct slot_order *x = a, *y = b;
	return ff_chains_compare(x->chains, x->chain, y->chain);
}

/* Blocks of chains beyond 0, in an order that does not depend on their numbers. */
static int finish_far(struct tally *t, struct ff_batch *b, struct err *e)
{
	size_t slots = t->rest.n, total = 2 * t->m->element.n;
	struct slot_order *order = mem_new(slots, sizeof *order, "row blocks", e);
	int bad = !order || ff_tally_chains_merge(&t->far, e);
	const struct tally_landing *l = t->far.list.data;

	for (uint32_t s = 1; !bad && s < slots; s++)
		order[s] = (struct slot_order){ &t->chains,
			((const uint32_t *)t->slot_chain.data)[s], s };
	if (!bad && slots > 2)
		qsort(order + 1, slots - 1, sizeof *order, by_chain);
	for (size_t k = 1; !bad && k < slots; k++) {
		uint64_t begin = order[k].slot * (uint64_t)total, end = begin + total;
		size_t i = ff_tally_chains_find(&t->far, begin);
		for (; !bad && i < t->far.list.n && l[i].key < end; i++)
			if (!(bad = ff_batch_reserve(b, 1, e)))
				ff_batch_put_value(b, l[i].column, l[i].w);
		bad = bad || put_block(t, b, order[k].slot, e);
	}
	free(order);
	return bad ? -1 : 0;
}

static void clear(struct tally *t)
{
	const uint32_t *chain = t->slot_chain.data;

	for (size_t s = 0; s < t->slot_chain.n; s++)
		((uint32_t *)t->chain_slot.data)[chain[s]] = 0;
	t->slot_chain.n = t->rest.n = t->far.list.n = t->arrival.n = 0;
	t->escape_before = t->escape_square = 0;
	t->replicates = t->weighed = 0;
	slot_of(t, 0);
}

int ff_tally_finish(struct tally *t, struct ff_batch *b, uint32_t row_side,
                    enum ff_row_kind kind, uint32_t samples, double total, struct err *e)
{
	struct tally_rest *r = ff_tally_rest(t, 0);
	struct finish f = { .samples = samples, .total = total };

	if (t->err.set)
		return err_set(e, "%s", t->err.text);
	if (ff_batch_begin(b, e) || finish_near(t, b, &f, e))
		return -1;
	f.even += r->escape / total * (1 - r->escape / total);
	f.variance += share_variance(t, r->escape, t->escape_square, total, samples);
	f.sum += r->escape + r->black + r->lost + r->cut;
	if (t->arrival.n)
		qsort(t->arrival.data, t->arrival.n, sizeof(struct tally_arrival), by_target);
	if (put_block(t, b, 0, e) || finish_far(t, b, e))
		return -1;
	/* All samples in one place tell no more than a sample's weight. */
	double error = samples ? fmax(sqrt(f.variance), 1. / samples) : 0;
	if (t->dependent && f.variance > 0 && !(t->worth > 0))
		t->worth = f.even / f.variance;
	if (t->worth > 0)
		samples = (uint32_t)fmax(1, fmin(samples, t->worth));
	t->worth = 0;
	clear(t);
	struct ff_batch_row row = { row_side, kind, samples, f.sum > 0 ? 1 / f.sum : 0,
	                         1 - f.sum / total, error };
	return ff_batch_put_row(b, &row, e);
}
