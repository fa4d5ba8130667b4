#include "lib/radiosity/transport.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/radiosity/transport_links.h"
#include "lib/radiosity/transport_runs.h"

/* ---- shards ---- */

static const char *receivers(const struct ff *f)
{
	return f->to_patches ? "patches" : "elements";
}

static int check_parts(const struct ff **f, const char *const *names, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++) {
		if (f[i]->shards != f[0]->shards)
			return err_set(e, "%s: part %u of %u, but %s is one of %u; give all parts of "
			               "one run of ffcalc", names[i], f[i]->shard, f[i]->shards,
			               names[0], f[0]->shards);
		if (f[i]->to_patches != f[0]->to_patches)
			return err_set(e, "%s: receivers are %s, but %s of %s; give all parts of "
			               "one run of ffcalc", names[i], receivers(f[i]),
			               receivers(f[0]), names[0]);
		for (size_t k = 0; k < i; k++)
			if (f[k]->shard == f[i]->shard)
				return err_set(e, "%s: overlaps %s, both are part %u of %u",
				               names[i], names[k], f[i]->shard, f[i]->shards);
	}
	for (uint32_t part = 1; part <= f[0]->shards; part++) {
		size_t i = 0;
		while (i < n && f[i]->shard != part)
			i++;
		if (i == n)
			return err_set(e, "%s: part %u of %u is missing; run ffcalc --part %u/%u",
			               names[0], part, f[0]->shards, part, f[0]->shards);
	}
	return 0;
}

static int by_part(const void *a, const void *b)
{
	const struct ff *x = *(const struct ff *const *)a, *y = *(const struct ff *const *)b;
	return (x->shard > y->shard) - (x->shard < y->shard);
}

/* ---- chains: shard numbers -> common numbers ---- */

static uint32_t *common_chains(struct transport *t, const struct ff *f, struct err *e)
{
	uint32_t *map = mem_new(f->chain.n, sizeof *map, "chains", e);
	uint32_t *count = mem_new(t->chains.events, sizeof *count, "chains", e);
	int bad = !map || !count;

	for (size_t c = 0; !bad && c < f->chain.n; c++) {
		memset(count, 0, t->chains.events * sizeof *count);
		for (uint64_t i = f->chain.start[c]; !bad && i < f->chain.start[c + 1]; i++) {
			uint32_t id = f->chain.event[i];
			if (id >= 4 * t->m->material.n || t->chains.slot[id] == CHAIN_NONE)
				bad = err_set(e, "form factors pass an ideal surface that the model "
				              "does not have; run ffcalc again");
			else
				count[t->chains.slot[id]] = f->chain.count[i];
		}
		bad = bad || (map[c] = bsdf_chains_find(&t->chains, count, e)) == CHAIN_NONE;
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
	size_t sides = 2 * t->m->patch.n;

	for (size_t i = 0; i < t->shards; i++) {
		t->rows += t->shard[i]->row.n;
		t->blocks += t->shard[i]->block.n;
		t->links += t->shard[i]->link.n;
	}
	if (t->links >= RUN_GUESSED - 2)
		return err_set(e, "more than 2^31 links between directional patches; use larger "
		               "patches (mesh -p)");
	t->row_side = mem_new(t->rows, sizeof *t->row_side, "rows", e);
	t->row_kind = mem_new(t->rows, 1, "rows", e);
	t->row_samples = mem_new(t->rows, sizeof *t->row_samples, "rows", e);
	t->row_cast = mem_new(t->rows, sizeof *t->row_cast, "rows", e);
	t->row_block = mem_new(t->rows + 1, sizeof *t->row_block, "rows", e);
	t->diffuse_row = mem_new(sides, sizeof *t->diffuse_row, "rows", e);
	t->emission_row = mem_new(sides, sizeof *t->emission_row, "rows", e);
	t->light_row = mem_new(t->m->light.n, sizeof *t->light_row, "rows", e);
	t->block = mem_new(t->blocks + 1, sizeof *t->block, "blocks", e);
	t->link_target = mem_new(t->links, sizeof *t->link_target, "links", e);
	t->link_row = mem_new(t->links, 2 * sizeof *t->link_row, "links", e);
	t->target_link = mem_new(sides + 1, sizeof *t->target_link, "links", e);
	if (!t->row_side || !t->row_kind || !t->row_samples || !t->row_cast ||
	    !t->row_block ||
	    !t->diffuse_row || !t->emission_row || !t->light_row || !t->block || !t->link_target ||
	    !t->link_row || !t->target_link)
		return -1;
	memset(t->diffuse_row, 0xff, sides * sizeof *t->diffuse_row);
	memset(t->emission_row, 0xff, sides * sizeof *t->emission_row);
	memset(t->light_row, 0xff, t->m->light.n * sizeof *t->light_row);
	return 0;
}

/* The rays of a row whose weights add up to 1 / scale, if that is 1 each; what formulas and elements
 * tell of where light lands straight says nothing of longer chains. */
static uint32_t cast_by(uint32_t samples, double scale)
{
	double rays = fmin(UINT32_MAX, 1 / scale);

	return rays < 2 || (samples && samples < rays) ? samples : (uint32_t)rays;
}

/* Copies a shard's rows and block heads behind `row` rows and `block` blocks. */
static void put_rows(struct transport *t, uint32_t shard, const uint32_t *chain, size_t row,
                     size_t block)
{
	const struct ff *f = t->shard[shard];

	for (size_t r = 0; r < f->row.n; r++) {
		uint32_t ps = f->row.side[r];
		t->row_side[row + r] = ps;
		t->row_kind[row + r] = f->row.kind[r];
		t->row_samples[row + r] = f->row.samples[r];
		t->row_cast[row + r] = cast_by(f->row.samples[r], f->row.scale[r]);
		t->row_block[row + r + 1] = block + f->row.block[r + 1];
		if (f->row.kind[r] == FF_DIFFUSE)
			t->diffuse_row[ps] = (uint32_t)(row + r);
		else if (f->row.kind[r] == FF_EMISSION)
			t->emission_row[ps] = (uint32_t)(row + r);
		else if (f->row.kind[r] == FF_LIGHT)
			t->light_row[ps - 2 * t->m->patch.n] = (uint32_t)(row + r);
	}
	for (size_t b = 0; b < f->block.n; b++)
		t->block[block + b] = (struct block){ .chain = chain[f->block.chain[b]],
			.shard = shard, .local = b, .escape = f->block.escape[b],
			.black = f->block.black[b], .lost = f->block.lost[b], .cut = f->block.cut[b] };
}

static int join(struct transport *t, int threads, struct err *e)
{
	size_t row = 0, block = 0, link = 0;
	struct link_key *l = mem_new(t->links, sizeof *l, "links", e);
	int bad = !l || !(t->shard_chain = mem_new(t->shards, sizeof *t->shard_chain, "chains", e));

	for (uint32_t i = 0; !bad && i < t->shards; i++) {
		uint32_t *chain = t->shard_chain[i] = common_chains(t, t->shard[i], e);
		if ((bad = !chain))
			break;
		put_rows(t, i, chain, row, block);
		radiosity_transport_put_links(t->shard[i], chain, (uint32_t)row, (uint32_t)link,
		                              l + link);
		row += t->shard[i]->row.n;
		block += t->shard[i]->block.n;
		link += t->shard[i]->link.n;
	}
	for (size_t i = 0; !bad && i < t->m->light.n; i++)
		if (t->light_row[i] == FF_NO_ROW && t->m->light.unit_flux[i] > 0)
			bad = err_set(e, "form factors of light %s are missing; run ffcalc again",
			              t->m->light.name[i]);
	if (!bad) {
		bsdf_chains_tie(&t->chains);
		radiosity_transport_sort_links(t, l);
		bad = radiosity_transport_make_runs(t, l, threads, e);
	}
	free(l);
	return bad ? -1 : 0;
}

int radiosity_transport_init(struct transport *t, const struct model *m, const struct ff **f,
                             const char *const *names, size_t n, int threads, struct err *e)
{
	*t = (struct transport){ .m = m, .shard = f, .shards = n };
	if (check_parts(f, names, n, e))
		return -1;
	qsort(f, n, sizeof *f, by_part);
	if (bsdf_chains_init(&t->chains, m, f[0]->chain.most, e) || size_arrays(t, e))
		return -1;
	return join(t, threads, e);
}

void radiosity_transport_free(struct transport *t)
{
	void *array[] = { t->row_side, t->row_kind, t->row_samples, t->row_cast, t->row_block,
		t->diffuse_row, t->emission_row, t->light_row, t->block, t->run_target, t->run_sum,
		t->run_link, t->onward, t->link_target, t->link_row, t->target_link, t->shard_chain };

	for (size_t i = 0; t->shard_chain && i < t->shards; i++)
		free(t->shard_chain[i]);
	for (size_t i = 0; i < sizeof array / sizeof *array; i++)
		free(array[i]);
	bsdf_chains_free(&t->chains);
	*t = (struct transport){ 0 };
}
