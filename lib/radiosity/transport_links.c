#include "lib/radiosity/transport_links.h"

#include <stdlib.h>
#include <string.h>

void radiosity_transport_put_links(const struct ff *f, const uint32_t *chain, uint32_t row,
                                   uint32_t first, struct link_key *to)
{
	for (size_t i = 0; i < f->link.n; i++) {
		to[i] = (struct link_key){ f->link.target[i], f->link.source[i], f->link.last[i],
		                           chain[f->link.chain[i]], { FF_NO_ROW, FF_NO_ROW },
		                           first + (uint32_t)i, { 0 } };
		for (int k = 0; k < 2; k++)
			if (f->link.row[2 * i + (size_t)k] != FF_NO_ROW)
				to[i].row[k] = row + f->link.row[2 * i + (size_t)k];
		memcpy(to[i].direction, &f->link.direction[3 * i], sizeof to[i].direction);
	}
}

void radiosity_transport_sort_links(struct transport *t, struct link_key *l)
{
	size_t i = 0;

	if (t->links)
		qsort(l, t->links, sizeof *l, link_key_order);
	for (uint32_t ps = 0; ps < 2 * t->m->patch.n; ps++) {
		t->target_link[ps] = i;
		while (i < t->links && l[i].target == ps)
			i++;
	}
	t->target_link[2 * t->m->patch.n] = i;
	for (i = 0; i < t->links; i++) {
		t->link_target[i] = l[i].target;
		memcpy(&t->link_row[2 * i], l[i].row, sizeof l[i].row);
	}
}

static const float *arrival(const struct ff *f, size_t block, uint32_t target)
{
	for (uint64_t i = f->block.arrival[block]; i < f->block.arrival[block + 1]; i++)
		if (f->arrival.target[i] == target)
			return &f->arrival.direction[3 * i];
	return NULL;
}

/* The link that looks nearest to where the light of a block comes from. */
static uint32_t nearest_link(const struct transport *t, const struct link_key *l,
                             const struct block *block, uint32_t target)
{
	const float *from = arrival(t->shard[block->shard], block->local, target);
	size_t begin = t->target_link[target], end = t->target_link[target + 1], found = begin;
	float best = -2;

	for (size_t i = begin; i < end; i++) {
		const float *d = l[i].direction;
		float c = from ? d[0] * from[0] + d[1] * from[1] + d[2] * from[2] : 0;
		if (c > best) {
			best = c;
			found = i;
		}
	}
	return found < end ? (uint32_t)found | RUN_GUESSED : FF_NO_ROW;
}

/* The link for light of a source and chain, or the nearest. */
uint32_t radiosity_transport_find_link(const struct transport *t, const struct link_key *l,
                                       const struct block *block, uint32_t target, uint32_t source,
                                       struct known_link *known)
{
	if (known->link && known->source == source && known->chain == block->chain)
		return known->link - 1;
	size_t lo = t->target_link[target], hi = t->target_link[target + 1];
	uint32_t chain = block->chain;
	struct link_key want = { .target = target, .source = source, .chain = chain,
	                         .order = UINT32_MAX };

	/* The last link that does not begin beyond the source. */
	for (size_t n = lo; n < hi;) {
		size_t mid = n + (hi - n) / 2;
		if (link_key_order(&l[mid], &want) <= 0)
			n = mid + 1;
		else
			hi = mid;
	}
	if (hi > lo && l[hi - 1].chain == chain && l[hi - 1].source <= source &&
	    l[hi - 1].last >= source) {
		*known = (struct known_link){ source, chain, (uint32_t)hi };
		return (uint32_t)(hi - 1);
	}
	return nearest_link(t, l, block, target);
}
