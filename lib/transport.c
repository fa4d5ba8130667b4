#include "transport.h"

#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "lanes.h"
#include "par.h"
#include "transport_links.h"

static const char what[] = "form factors by patch";

/* ---- shards ---- */

static const char *receivers(const struct ff *f)
{
	return f->to_patches ? "patches" : "elements";
}

static int check_parts(const struct ff **f, const char *const *names, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		if (f[i]->parts != f[0]->parts)
			return err_set(e, "%s: part %u of %u, but %s is one of %u; give all parts of "
			               "one run of ffcalc", names[i], f[i]->part, f[i]->parts,
			               names[0], f[0]->parts);
		if (f[i]->to_patches != f[0]->to_patches)
			return err_set(e, "%s: receivers are %s, but %s of %s; give all parts of "
			               "one run of ffcalc", names[i], receivers(f[i]),
			               receivers(f[0]), names[0]);
		for (size_t k = 0; k < i; k++)
			if (f[k]->part == f[i]->part)
				return err_set(e, "%s: overlaps %s, both are part %u of %u",
				               names[i], names[k], f[i]->part, f[i]->parts);
	}
	for (uint32_t part = 1; part <= f[0]->parts; part++) {
		size_t i = 0;
		while (i < n && f[i]->part != part)
			i++;
		if (i == n)
			return err_set(e, "%s: part %u of %u is missing; run ffcalc --part %u/%u",
			               names[0], part, f[0]->parts, part, f[0]->parts);
	}
	return 0;
}

static int by_part(const void *a, const void *b)
{
	const struct ff *x = *(const struct ff *const *)a, *y = *(const struct ff *const *)b;
	return (x->part > y->part) - (x->part < y->part);
}

/* ---- chains: shard numbers -> common numbers ---- */

static uint32_t *common_chains(struct transport *t, const struct ff *f, struct err *e)
{
	uint32_t *map = mem_new(f->chains, sizeof *map, "chains", e);
	uint32_t *count = mem_new(t->chains.events, sizeof *count, "chains", e);
	int bad = !map || !count;

	for (size_t c = 0; !bad && c < f->chains; c++) {
		memset(count, 0, t->chains.events * sizeof *count);
		for (uint64_t i = f->chain_start[c]; !bad && i < f->chain_start[c + 1]; i++) {
			uint32_t id = f->chain_event[i];
			if (id >= 4 * t->m->material.n || t->chains.slot[id] == CHAIN_NONE)
				bad = err_set(e, "form factors pass an ideal surface that the model "
				              "does not have; run ffcalc again");
			else
				count[t->chains.slot[id]] = f->chain_count[i];
		}
		bad = bad || (map[c] = chains_find(&t->chains, count, e)) == CHAIN_NONE;
	}
	free(count);
	if (!bad)
		return map;
	free(map);
	return NULL;
}

/* ---- rows and blocks ---- */

static int size_arrays(struct transport *t, struct err *e)
{
	size_t sides = 2 * t->m->patches;

	for (size_t i = 0; i < t->shards; i++) {
		t->rows += t->shard[i]->rows;
		t->blocks += t->shard[i]->blocks;
		t->links += t->shard[i]->links;
	}
	if (t->links >= RUN_GUESSED - 2)
		return err_set(e, "more than 2^31 links between directional patches; use larger "
		               "patches (mesh -p)");
	t->row_side = mem_new(t->rows, sizeof *t->row_side, "rows", e);
	t->row_kind = mem_new(t->rows, 1, "rows", e);
	t->row_samples = mem_new(t->rows, sizeof *t->row_samples, "rows", e);
	t->row_block = mem_new(t->rows + 1, sizeof *t->row_block, "rows", e);
	t->diffuse_row = mem_new(sides, sizeof *t->diffuse_row, "rows", e);
	t->emission_row = mem_new(sides, sizeof *t->emission_row, "rows", e);
	t->light_row = mem_new(t->m->light.n, sizeof *t->light_row, "rows", e);
	t->block = mem_new(t->blocks + 1, sizeof *t->block, "blocks", e);
	t->link_target = mem_new(t->links, sizeof *t->link_target, "links", e);
	t->link_row = mem_new(t->links, 2 * sizeof *t->link_row, "links", e);
	t->target_link = mem_new(sides + 1, sizeof *t->target_link, "links", e);
	if (!t->row_side || !t->row_kind || !t->row_samples || !t->row_block ||
	    !t->diffuse_row || !t->emission_row || !t->light_row || !t->block || !t->link_target ||
	    !t->link_row || !t->target_link)
		return -1;
	memset(t->diffuse_row, 0xff, sides * sizeof *t->diffuse_row);
	memset(t->emission_row, 0xff, sides * sizeof *t->emission_row);
	memset(t->light_row, 0xff, t->m->light.n * sizeof *t->light_row);
	return 0;
}

/* Copies a shard's rows and block heads behind `row` rows and `block` blocks. */
static void put_rows(struct transport *t, uint32_t shard, const uint32_t *chain, size_t row,
                     size_t block)
{
	const struct ff *f = t->shard[shard];

	for (size_t r = 0; r < f->rows; r++) {
		uint32_t ps = f->row_side[r];
		t->row_side[row + r] = ps;
		t->row_kind[row + r] = f->row_kind[r];
		t->row_samples[row + r] = f->row_samples[r];
		t->row_block[row + r + 1] = block + f->row_block[r + 1];
		if (f->row_kind[r] == FF_DIFFUSE)
			t->diffuse_row[ps] = (uint32_t)(row + r);
		else if (f->row_kind[r] == FF_EMISSION)
			t->emission_row[ps] = (uint32_t)(row + r);
		else if (f->row_kind[r] == FF_LIGHT)
			t->light_row[ps - 2 * t->m->patches] = (uint32_t)(row + r);
	}
	for (size_t b = 0; b < f->blocks; b++)
		t->block[block + b] = (struct block){ .chain = chain[f->block_chain[b]],
			.shard = shard, .local = b, .escape = f->block_escape[b], .black = f->block_black[b],
			.lost = f->block_lost[b], .cut = f->block_cut[b] };
}

/* ---- runs ---- */

struct pass {
	struct transport *t;
	const struct link_key *link;
	uint8_t *kind;                         /* [2P] enum side_kind */
	uint32_t *target;                      /* [threads][2P] scratch: a block's runs */
	double *sum;                           /* [threads][2P] */
	uint32_t *has;                         /* [threads][chains] the row it was last met in */
};

static void set_kinds(const struct transport *t, uint8_t *kind)
{
	const struct materials *mt = &t->m->material;

	for (uint32_t ps = 0; ps < 2 * t->m->patches; ps++) {
		uint32_t material = model_patch_material(t->m, ps >> 1);
		int side = (int)(ps & 1);
		size_t at = material_at(mt, material, side);
		int special = t->target_link[ps + 1] > t->target_link[ps], ideal = 0;
		for (int k = 0; k < t->m->bands; k++)
			special |= mt->tau_d[at + (size_t)k] > 0;
		for (int way = 0; way < 2; way++) {
			special |= bsdf_has_lobe(mt, material, side, way);
			ideal |= bsdf_has_ideal(mt, material, side, way);
		}
		kind[ps] = ideal ? SIDE_IDEAL : special ? SIDE_SPECIAL : SIDE_PLAIN;
	}
}

static inline uint32_t target_of(const struct transport *t, const struct ff *f, uint32_t column)
{
	return f->to_patches ? column : 2 * t->m->element_patch[column >> 1] + (column & 1);
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
	uint64_t word = ff_first_word(f, b), first = f->block_start[b], n = f->block_start[b + 1] - first;
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
	size_t at = (size_t)thread * 2 * t->m->patches;
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

/* Whether a row follows what the lobes of a side make of a block's light. */
static int follows_lobe(const struct transport *t, const struct row_chains *c,
                        const struct block *block, uint32_t target)
{
	const struct chains *all = &t->chains;
	const uint32_t *slot = all->slot + 4 * model_patch_material(t->m, target >> 1) + 2 * (target & 1);

	for (int way = 0; way < 2; way++) {
		if (slot[way] == CHAIN_NONE || !all->finite[slot[way]])
			continue;
		uint32_t child = ((const uint32_t *)all->child.data)
			[(size_t)block->chain * all->events + slot[way]];
		if (child != CHAIN_NONE && c->has[child] == c->mark)
			return 1;
	}
	return 0;
}

static inline uint8_t run_kind(const struct pass *p, const struct row_chains *c,
                               const struct block *block, uint32_t target)
{
	uint8_t kind = p->kind[target];

	return kind == SIDE_SPECIAL && follows_lobe(p->t, c, block, target) ? SIDE_IDEAL : kind;
}

static void count_rows(void *arg, size_t begin, size_t end, int thread)
{
	const struct pass *p = arg;
	struct transport *t = p->t;

	for (size_t row = begin; row < end; row++) {
		struct row_chains c = mark_row(p, row, thread);
		for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
			struct runs r = sum_block(p, &t->block[b], thread, 0);
			uint64_t n[SIDE_KINDS] = { 0 };
			for (size_t i = 0; i < r.n; i++)
				n[run_kind(p, &c, &t->block[b], r.target[i])]++;
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
	uint64_t to[SIDE_KINDS] = { block->run, block->special, block->ideal };

	block->sum = block->escape + block->black + block->lost + block->cut;
	for (size_t i = 0; i < r.n; i++) {
		uint8_t kind = run_kind(p, c, block, r.target[i]);
		uint64_t at = to[kind]++;
		t->run_target[at] = r.target[i];
		t->run_sum[at] = r.sum[i];
		block->sum += r.sum[i];
		if (kind != SIDE_PLAIN)
			t->run_link[block->link + (at - block->special)] =
				follows_lobe(t, c, block, r.target[i])
					? RUN_FOLLOWED
					: transport_find_link(t, p->link, block, r.target[i], source);
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
static int add_onward(struct vec *list, size_t first, struct onward x, struct err *e)
{
	struct onward *o = list->data;

	for (size_t i = first; i < list->n; i++)
		if (o[i].event == x.event) {
			o[i].sum += x.sum;
			return 0;
		}
	return vec_append(list, &x, 1, sizeof x, e);
}

/* O(runs that are followed). */
static int list_onward(struct transport *t, struct err *e)
{
	const struct chains *c = &t->chains;
	const uint32_t *all = c->child.data;
	struct vec list = { 0 };
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
					bad = add_onward(&list, block->onward, (struct onward){ child[way[k]],
					                 first + k, t->run_sum[i] }, e);
		}
	}
	t->block[t->blocks].onward = list.n;
	t->onward = list.data;
	return bad ? -1 : 0;
}

static int make_runs(struct transport *t, const struct link_key *link, int threads,
                     struct err *e)
{
	size_t sides = 2 * t->m->patches, scratch = sides * (size_t)(threads > 1 ? threads : 1);
	struct pass p = { t, link, mem_new(sides, 1, what, e),
	                  mem_new(scratch, sizeof *p.target, what, e),
	                  mem_new(scratch, sizeof *p.sum, what, e),
	                  mem_new(t->chains.n * (size_t)(threads > 1 ? threads : 1), sizeof *p.has,
	                          what, e) };

	if (p.kind && p.target && p.sum && p.has) {
		set_kinds(t, p.kind);
		par_for(t->rows, 64, threads, count_rows, &p, NULL);
		number_runs(t);
		t->run_target = mem_new(t->runs, sizeof *t->run_target, what, e);
		t->run_sum = mem_new(t->runs, sizeof *t->run_sum, what, e);
		t->run_link = mem_new(t->special_runs, sizeof *t->run_link, what, e);
	}
	int bad = !t->run_target || !t->run_sum || !t->run_link;
	if (p.has)
		memset(p.has, 0, t->chains.n * (size_t)(threads > 1 ? threads : 1) * sizeof *p.has);
	if (!bad)
		par_for(t->rows, 64, threads, fill_rows, &p, NULL);
	bad = bad || list_onward(t, e);
	free(p.kind);
	free(p.target);
	free(p.sum);
	free(p.has);
	return bad ? -1 : 0;
}

static int join(struct transport *t, int threads, struct err *e)
{
	size_t row = 0, block = 0, link = 0;
	struct link_key *l = mem_new(t->links, sizeof *l, "links", e);
	int bad = !l;

	for (uint32_t i = 0; !bad && i < t->shards; i++) {
		uint32_t *chain = common_chains(t, t->shard[i], e);
		if ((bad = !chain))
			break;
		put_rows(t, i, chain, row, block);
		transport_put_links(t->shard[i], chain, (uint32_t)row, (uint32_t)link, l + link);
		row += t->shard[i]->rows;
		block += t->shard[i]->blocks;
		link += t->shard[i]->links;
		free(chain);
	}
	for (size_t i = 0; !bad && i < t->m->light.n; i++)
		if (t->light_row[i] == FF_NO_ROW && t->m->light.unit_flux[i] > 0)
			bad = err_set(e, "form factors of light %s are missing; run ffcalc again",
			              t->m->light.name[i]);
	if (!bad) {
		chains_tie(&t->chains);
		transport_sort_links(t, l);
		bad = make_runs(t, l, threads, e);
	}
	free(l);
	return bad ? -1 : 0;
}

int transport_init(struct transport *t, const struct model *m, const struct ff **f,
                   const char *const *names, size_t n, int threads, struct err *e)
{
	*t = (struct transport){ .m = m, .shard = f, .shards = n };
	if (check_parts(f, names, n, e))
		return -1;
	qsort(f, n, sizeof *f, by_part);
	if (chains_init(&t->chains, m, f[0]->chain_most, e) || size_arrays(t, e))
		return -1;
	return join(t, threads, e);
}

void transport_free(struct transport *t)
{
	void *array[] = { t->row_side, t->row_kind, t->row_samples, t->row_block,
		t->diffuse_row, t->emission_row, t->light_row, t->block, t->run_target, t->run_sum,
		t->run_link, t->onward, t->link_target, t->link_row, t->target_link };

	for (size_t i = 0; i < sizeof array / sizeof *array; i++)
		free(array[i]);
	chains_free(&t->chains);
	*t = (struct transport){ 0 };
}
