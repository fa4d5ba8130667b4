#include "lib/radiosity/transport_runs.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/channels.h"
#include "lib/base/parallel.h"
#include "lib/radiosity/transport_links.h"
#include "lib/scatter/bsdf.h"

/* Rows that a thread takes at a time: they differ much in length. A guess. */
enum { ROWS_AT_A_TIME = 64 };

static const char what[] = "form factors by patch";

struct pass {
	struct transport *t;
	const struct link_key *link;
	uint8_t *kind;                         /* [2P] enum side_kind */
	uint32_t *surface;                     /* [2P] material and side */
	uint32_t *lobed;                       /* [lobes] those with a finite lobe */
	size_t lobes;
	uint32_t *target;                      /* [threads][2P] scratch: a block's runs */
	double *sum;                           /* [threads][2P] */
	uint32_t *has;                         /* [threads][chains] the row it was last met in */
	uint8_t *follows;                      /* [threads][2 materials] by the block in work */
	struct known_link *known;              /* [threads][2P] */
};

static void set_kinds(struct pass *p)
{
	const struct transport *t = p->t;
	const struct materials *mt = &t->m->material;

	for (uint32_t ps = 0; ps < 2 * t->m->patch.n; ps++) {
		uint32_t material = model_patch_material(t->m, ps >> 1);
		int side = (int)(ps & 1);
		size_t at = model_material_at(mt, material, side);
		int special = t->target_link[ps + 1] > t->target_link[ps], ideal = 0;
		for (int k = 0; k < t->m->bands; k++)
			special |= mt->tau_d[at + (size_t)k] > 0;
		for (int way = 0; way < 2; way++) {
			special |= bsdf_has_lobe(mt, material, side, way);
			ideal |= bsdf_has_ideal(mt, material, side, way);
		}
		p->kind[ps] = ideal ? SIDE_IDEAL : special ? SIDE_SPECIAL : SIDE_PLAIN;
		p->surface[ps] = 2 * material + (ps & 1);
	}
	for (uint32_t i = 0; i < 2 * mt->n; i++)
		if (bsdf_has_lobe(mt, i >> 1, (int)(i & 1), 0) ||
		    bsdf_has_lobe(mt, i >> 1, (int)(i & 1), 1))
			p->lobed[p->lobes++] = i;
}

static inline uint32_t target_of(const struct transport *t, const struct ff *f, uint32_t column)
{
	return f->to_patches ? column : 2 * t->m->element.patch[column >> 1] + (column & 1);
}

/* Entries come patch-side by patch-side. */
struct runs {
	uint32_t *target;
	double *sum;
	size_t n;
	uint32_t last;
	double so_far;
};

/* No branch depends on where a run ends, which cannot be foreseen. Inlined with
 * constant `sums`: whether they are wanted. */
static ALWAYS_INLINE void add_entry(struct runs *r, uint32_t target, double value, int sums)
{
	int is_new = target != r->last;

	r->n += (size_t)is_new;
	r->last = target;
	r->target[r->n - 1] = target;
	if (sums) {
		r->so_far = r->so_far * (1 - is_new) + value;
		r->sum[r->n - 1] = r->so_far;
	}
}

static ALWAYS_INLINE void add_list(const struct transport *t, const struct ff *f, uint64_t b,
                                   struct runs *to, int sums)
{
	uint64_t word = ff_first_word(f, b), first = f->block.start[b];
	uint64_t n = f->block.start[b + 1] - first;
	struct runs r = *to;

	for (uint64_t i = 0; i < n; i++)
		add_entry(&r, target_of(t, f, ff_word(f, word + i)),
		          sums ? ff_value(f, first + i) : 0, sums);
	*to = r;
}

static ALWAYS_INLINE void add_spans(const struct transport *t, const struct ff *f, uint64_t b,
                                    struct runs *to, int sums)
{
	struct ff_span s;
	struct runs r = *to;

	for (struct ff_cursor c = ff_begin(f, b); ff_next(&c, &s);)
		for (uint32_t k = 0; k < s.count; k++)
			add_entry(&r, target_of(t, f, s.column + 2 * k),
			          sums ? ff_value(f, s.entry + k) : 0, sums);
	*to = r;
}

/* A block's entries summed by patch-side into scratch. */
static ALWAYS_INLINE struct runs sum_block(const struct pass *p, const struct block *block,
                                           int thread, int sums)
{
	const struct transport *t = p->t;
	const struct ff *f = t->shard[block->shard];
	size_t at = (size_t)thread * 2 * t->m->patch.n;
	struct runs r = { p->target + at, p->sum + at, 0, UINT32_MAX, 0 };

	if (ff_has_spans(f, block->local))
		add_spans(t, f, block->local, &r, sums);
	else
		add_list(t, f, block->local, &r, sums);
	return r;
}

/* A row in work: which chains it has blocks of. */
struct row_chains {
	const uint32_t *has;
	uint32_t mark;
};

static struct row_chains mark_row(const struct pass *p, size_t row, int thread)
{
	const struct transport *t = p->t;
	uint32_t *has = p->has + (size_t)thread * t->chains.n;

	for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++)
		has[t->block[b].chain] = (uint32_t)row + 1;
	return (struct row_chains){ has, (uint32_t)row + 1 };
}

/* Whether a row follows what the lobes of a surface make of a block's light. */
static int follows_lobe(const struct transport *t, const struct row_chains *c,
                        const struct block *block, uint32_t surface)
{
	const struct chains *all = &t->chains;

	for (uint32_t way = 0; way < 2; way++) {
		uint32_t slot = all->slot[2 * surface + way];
		if (slot == CHAIN_NONE || !all->finite[slot])
			continue;
		uint32_t child = ((const uint32_t *)all->child.data)
			[(size_t)block->chain * all->events + slot];
		if (child != CHAIN_NONE && c->has[child] == c->mark)
			return 1;
	}
	return 0;
}

/* The same for all surfaces. */
static const uint8_t *followed_by(const struct pass *p, const struct row_chains *c,
                                  const struct block *block, int thread)
{
	uint8_t *follows = p->follows + (size_t)thread * 2 * p->t->m->material.n;

	for (size_t i = 0; i < p->lobes; i++)
		follows[p->lobed[i]] = (uint8_t)follows_lobe(p->t, c, block, p->lobed[i]);
	return follows;
}

static inline uint8_t run_kind(const struct pass *p, const uint8_t *follows, uint32_t target)
{
	uint8_t kind = p->kind[target];

	return kind == SIDE_SPECIAL && follows[p->surface[target]] ? SIDE_IDEAL : kind;
}

static void count_rows(void *arg, size_t begin, size_t end, int thread)
{
	const struct pass *p = arg;
	struct transport *t = p->t;

	for (size_t row = begin; row < end; row++) {
		struct row_chains c = mark_row(p, row, thread);
		for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
			struct runs r = sum_block(p, &t->block[b], thread, 0);
			const uint8_t *follows = followed_by(p, &c, &t->block[b], thread);
			uint64_t n[SIDE_KINDS] = { 0 };
			for (size_t i = 0; i < r.n; i++)
				n[run_kind(p, follows, r.target[i])]++;
			t->block[b].run = r.n;
			t->block[b].special = n[SIDE_SPECIAL];
			t->block[b].ideal = n[SIDE_IDEAL];
		}
	}
}

/* Counts become firsts. */
static void number_runs(struct transport *t)
{
	for (size_t b = 0; b <= t->blocks; b++) {
		struct block *block = &t->block[b];
		uint64_t n = block->run, special = block->special, ideal = block->ideal;
		block->run = t->runs;
		block->link = t->special_runs;
		t->runs += n;
		t->special_runs += special + ideal;
		block->special = t->runs - special - ideal;
		block->ideal = t->runs - ideal;
	}
}

static void fill_block(const struct pass *p, const struct row_chains *c, struct block *block,
                       uint32_t source, int thread)
{
	struct transport *t = p->t;
	struct runs r = sum_block(p, block, thread, 1);
	const uint8_t *follows = followed_by(p, c, block, thread);
	struct known_link *known = p->known + (size_t)thread * 2 * t->m->patch.n;
	uint64_t to[SIDE_KINDS] = { block->run, block->special, block->ideal };

	block->sum = block->escape + block->black + block->lost + block->cut;
	for (size_t i = 0; i < r.n; i++) {
		uint32_t target = r.target[i];
		uint8_t kind = run_kind(p, follows, target);
		uint64_t at = to[kind]++;
		t->run_target[at] = target;
		t->run_sum[at] = r.sum[i];
		block->sum += r.sum[i];
		if (kind != SIDE_PLAIN)
			t->run_link[block->link + (at - block->special)] =
				follows[p->surface[target]]
					? RUN_FOLLOWED
					: radiosity_transport_find_link(t, p->link, block, target,
					                                source, &known[target]);
	}
}

static void fill_rows(void *arg, size_t begin, size_t end, int thread)
{
	const struct pass *p = arg;
	struct transport *t = p->t;

	for (size_t r = begin; r < end; r++) {
		struct row_chains c = mark_row(p, r, thread);
		for (uint64_t b = t->row_block[r]; b < t->row_block[r + 1]; b++)
			fill_block(p, &c, &t->block[b], t->row_side[r], thread);
	}
}

/* ---- what is followed on ---- */

/* Adds what a run sends on by one event to the block's list from `first` on. */
static int add_onward(struct array *list, size_t first, struct onward x, struct err *e)
{
	struct onward *o = list->data;

	for (size_t i = first; i < list->n; i++)
		if (o[i].event == x.event) {
			o[i].sum += x.sum;
			return 0;
		}
	return mem_append(list, &x, 1, sizeof x, e);
}

/* O(runs that are followed). */
static int list_onward(struct transport *t, struct err *e)
{
	const struct chains *c = &t->chains;
	const uint32_t *all = c->child.data;
	struct array list = { 0 };
	int bad = 0;

	for (size_t b = 0; b < t->blocks; b++) {
		struct block *block = &t->block[b];
		const uint32_t *child = all + (size_t)block->chain * c->events;
		block->onward = list.n;
		for (uint64_t i = block->ideal; i < block[1].run && !bad; i++) {
			uint32_t ps = t->run_target[i], way[2];
			uint32_t first = 4 * model_patch_material(t->m, ps >> 1) + 2 * (ps & 1);
			int lobes = t->run_link[block->link + (i - block->special)] == RUN_FOLLOWED;
			memcpy(way, c->slot + first, sizeof way);
			for (uint32_t k = 0; k < 2 && !bad; k++)
				if (way[k] != CHAIN_NONE && (lobes || !c->finite[way[k]]))
					bad = add_onward(&list, block->onward,
					                 (struct onward){ child[way[k]], first + k,
					                                  t->run_sum[i] }, e);
		}
	}
	t->block[t->blocks].onward = list.n;
	t->onward = list.data;
	return bad ? -1 : 0;
}

static int runs_of(struct pass *p, int threads, struct err *e)
{
	struct transport *t = p->t;
	const size_t each = threads > 1 ? (size_t)threads : 1;

	set_kinds(p);
	par_for(t->rows, ROWS_AT_A_TIME, threads, count_rows, p, NULL);
	number_runs(t);
	t->run_target = mem_new(t->runs, sizeof *t->run_target, what, e);
	t->run_sum = mem_new(t->runs, sizeof *t->run_sum, what, e);
	t->run_link = mem_new(t->special_runs, sizeof *t->run_link, what, e);
	if (!t->run_target || !t->run_sum || !t->run_link)
		return -1;
	memset(p->has, 0, each * t->chains.n * sizeof *p->has);
	par_for(t->rows, ROWS_AT_A_TIME, threads, fill_rows, p, NULL);
	return list_onward(t, e);
}

int radiosity_transport_make_runs(struct transport *t, const struct link_key *link, int threads,
                                  struct err *e)
{
	size_t sides = 2 * t->m->patch.n, surfaces = 2 * t->m->material.n;
	size_t each = threads > 1 ? (size_t)threads : 1;
	struct pass p = { .t = t, .link = link };

	p.kind = mem_new(sides, 1, what, e);
	p.surface = mem_new(sides, sizeof *p.surface, what, e);
	p.lobed = mem_new(surfaces, sizeof *p.lobed, what, e);
	p.target = mem_new(each * sides, sizeof *p.target, what, e);
	p.sum = mem_new(each * sides, sizeof *p.sum, what, e);
	p.has = mem_new(each * t->chains.n, sizeof *p.has, what, e);
	p.follows = mem_new(each * surfaces, 1, what, e);
	p.known = mem_new(each * sides, sizeof *p.known, what, e);
	int bad = !p.kind || !p.surface || !p.lobed || !p.target || !p.sum || !p.has ||
	          !p.follows || !p.known || runs_of(&p, threads, e);
	free(p.kind);
	free(p.surface);
	free(p.lobed);
	free(p.target);
	free(p.sum);
	free(p.has);
	free(p.follows);
	free(p.known);
	return bad ? -1 : 0;
}
