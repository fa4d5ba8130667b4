#include "lib/scatter/chain.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/rng.h"
#include "lib/scatter/bsdf.h"

/* A count of places, a power of two, which the hash table doubles from: a guess. */
enum { HASH_AT_FIRST = 64 };

static int rehash(struct chains *c, size_t size, struct err *e);

static int changes_no_colour(const struct materials *mt, uint32_t id)
{
	const double *coefficient = id & 1 ? mt->tau_s : mt->rho_s;
	size_t at = model_material_at(mt, id / 4, (int)(id / 2 % 2));

	for (int k = 0; k < mt->bands; k++)
		if (coefficient[at + (size_t)k] != 1)
			return 0;
	return 1;
}

static void find_events(struct chains *c, const struct materials *mt, uint32_t most)
{
	for (uint32_t id = 0; id < 4 * mt->n; id++) {
		int side = (int)(id / 2 % 2), transmitted = (int)(id % 2);
		int ideal = bsdf_has_ideal(mt, id / 4, side, transmitted);
		int lobe = bsdf_has_lobe(mt, id / 4, side, transmitted);
		c->slot[id] = CHAIN_NONE;
		if (!ideal && !lobe)
			continue;
		c->slot[id] = c->events;
		c->finite[c->events] = (uint8_t)lobe;
		c->most[c->events] = lobe ? UINT32_MAX : changes_no_colour(mt, id) ? 1 : most;
		c->event[c->events++] = id;
	}
}

int bsdf_chains_init(struct chains *c, const struct model *m, uint32_t most, struct err *e)
{
	size_t ids = 4 * m->material.n;

	*c = (struct chains){ 0 };
	c->event = mem_new(ids, sizeof *c->event, "directional events", e);
	c->slot = mem_new(ids, sizeof *c->slot, "directional events", e);
	c->most = mem_new(ids, sizeof *c->most, "directional events", e);
	c->finite = mem_new(ids, 1, "directional events", e);
	if (!c->event || !c->slot || !c->most || !c->finite)
		return -1;
	find_events(c, &m->material, most);
	uint32_t *none = mem_new(c->events, sizeof *none, "chains", e);
	/* Rows of no events must have an address too. */
	int bad = !none || mem_reserve(&c->count, 1, sizeof *none, e) ||
	          mem_reserve(&c->child, 1, sizeof *none, e) || rehash(c, HASH_AT_FIRST, e) ||
	          bsdf_chains_find(c, none, e) == CHAIN_NONE;
	free(none);
	return bad ? -1 : 0;
}

void bsdf_chains_free(struct chains *c)
{
	free(c->event);
	free(c->slot);
	free(c->most);
	free(c->finite);
	free(c->count.data);
	free(c->child.data);
	free(c->length.data);
	free(c->hash);
	*c = (struct chains){ 0 };
}

static uint64_t hash_counts(const uint32_t *count, uint32_t n)
{
	uint64_t h = n;

	for (uint32_t i = 0; i < n; i++)
		h = rng_mix(h ^ count[i]);
	return h;
}

/* The place of a chain in the hash table, or the free place where it belongs. */
static size_t place(const struct chains *c, const uint32_t *count)
{
	size_t at = hash_counts(count, c->events) & (c->hash_size - 1);

	while (c->hash[at] != CHAIN_NONE &&
	       memcmp(bsdf_chains_count(c, c->hash[at]), count, c->events * sizeof *count))
		at = (at + 1) & (c->hash_size - 1);
	return at;
}

static int rehash(struct chains *c, size_t size, struct err *e)
{
	uint32_t *hash = mem_new(size, sizeof *hash, "chains", e);

	if (!hash)
		return -1;
	memset(hash, 0xff, size * sizeof *hash);
	free(c->hash);
	c->hash = hash;
	c->hash_size = size;
	for (uint32_t i = 0; i < c->n; i++)
		c->hash[place(c, bsdf_chains_count(c, i))] = i;
	return 0;
}

uint32_t bsdf_chains_find(struct chains *c, const uint32_t *count, struct err *e)
{
	size_t at = place(c, count);
	uint32_t length = 0;

	if (c->hash[at] != CHAIN_NONE)
		return c->hash[at];
	if (c->n >= CHAIN_NONE - 1) {
		err_set(e, "more than 4e9 chains of mirrors; lower --depth");
		return CHAIN_NONE;
	}
	for (uint32_t i = 0; i < c->events; i++)
		length += count[i];
	if (mem_append(&c->count, count, c->events, sizeof *count, e) ||
	    mem_append(&c->length, &length, 1, sizeof length, e) ||
	    mem_reserve(&c->child, c->events, sizeof(uint32_t), e))
		return CHAIN_NONE;
	memset((uint32_t *)c->child.data + c->child.n, 0xff, c->events * sizeof(uint32_t));
	c->child.n += c->events;
	c->hash[at] = (uint32_t)c->n++;
	if (2 * c->n > c->hash_size && rehash(c, 2 * c->hash_size, e))
		return CHAIN_NONE;
	return (uint32_t)(c->n - 1);
}

uint32_t bsdf_chains_child(struct chains *c, uint32_t chain, uint32_t event, struct err *e)
{
	size_t at = (size_t)chain * c->events + event;
	uint32_t child = ((uint32_t *)c->child.data)[at];

	if (child != CHAIN_NONE)
		return child;
	if (bsdf_chains_count(c, chain)[event] >= c->most[event])
		return ((uint32_t *)c->child.data)[at] = chain;
	uint32_t *count = mem_new(c->events, sizeof *count, "chains", e);
	if (!count)
		return CHAIN_NONE;
	memcpy(count, bsdf_chains_count(c, chain), c->events * sizeof *count);
	count[event]++;
	child = bsdf_chains_find(c, count, e);
	free(count);
	((uint32_t *)c->child.data)[at] = child;
	return child;
}

void bsdf_chains_tie(struct chains *c)
{
	for (uint32_t i = 1; i < c->n; i++) {
		uint32_t *count = (uint32_t *)c->count.data + (size_t)i * c->events;
		for (uint32_t k = 0; k < c->events; k++) {
			if (count[k] >= c->most[k])
				((uint32_t *)c->child.data)[(size_t)i * c->events + k] = i;
			if (!count[k])
				continue;
			count[k]--; /* the parent's counts, looked up in place */
			uint32_t parent = c->hash[place(c, count)];
			count[k]++;
			if (parent != CHAIN_NONE)
				((uint32_t *)c->child.data)[(size_t)parent * c->events + k] = i;
		}
	}
}

uint32_t bsdf_chains_reverse(struct chains *c, uint32_t chain, struct err *e)
{
	uint32_t *count, found = CHAIN_NONE;
	int passes = 1;

	if (bsdf_chains_length(c, chain) == 0)
		return chain;
	if (!(count = mem_new(c->events, sizeof *count, "chains", e)))
		return CHAIN_NONE;
	for (uint32_t i = 0; i < c->events; i++) {
		uint32_t n = bsdf_chains_count(c, chain)[i], id = c->event[i];
		uint32_t to = c->slot[id & 1 ? id ^ 2 : id];
		if (n && to == CHAIN_NONE)
			passes = 0;
		else if (n)
			count[to] = n < c->most[to] ? n : c->most[to];
	}
	if (passes)
		found = bsdf_chains_find(c, count, e);
	free(count);
	return found;
}
