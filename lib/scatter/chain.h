/* Chains of directional events, as multisets with saturating counts.
 *
 * Colours multiply, so the order of the events does not matter to the light that
 * comes through: a chain is how often each directional event was passed. The events
 * of a model are few (one for each material, side and direction that mirrors or
 * passes light, ideally or by a lobe); so that the chains stay few too, the count of
 * an ideal one stops at a most, where it means "so often or more": one more such
 * event leads back to the same chain, and light that goes round there is summed as a
 * geometric series. Ideal events of coefficient 1 (perfect mirrors) change no colour
 * and count once. */
#ifndef TWOPASS_CHAIN_H
#define TWOPASS_CHAIN_H

#include <stdint.h>

#include "lib/base/err.h"
#include "lib/base/mem.h"
#include "lib/data/model.h"

#define CHAIN_NONE UINT32_MAX

struct chains {
	uint32_t events;        /* directional events of the model */
	uint32_t *event;        /* ids, ascending: ff.h */
	uint32_t *most;         /* [events] where the count stops */
	uint8_t *finite;        /* [events] a lobe of finite exponent */
	uint32_t *slot;         /* [4 materials] event id -> index, or CHAIN_NONE */
	struct array count;     /* uint32_t [n][events] */
	struct array child;     /* uint32_t [n][events], CHAIN_NONE = not made yet */
	struct array length;    /* uint32_t [n] total count */
	size_t n;
	uint32_t *hash;         /* open addressing, CHAIN_NONE = free */
	size_t hash_size;
};

/* Finds the model's directional events and makes the empty chain, number 0. most: where
 * counts of ideal events stop that change colours. 0, or -1 and e. */
int bsdf_chains_init(struct chains *c, const struct model *m, uint32_t most, struct err *e);
void bsdf_chains_free(struct chains *c);

/* The chain with these counts [events], made if new; CHAIN_NONE and e when out
 * of memory. O(events). */
uint32_t bsdf_chains_find(struct chains *c, const uint32_t *count, struct err *e);

/* The chain after one more event (by index). */
uint32_t bsdf_chains_child(struct chains *c, uint32_t chain, uint32_t event, struct err *e);

/* Ties every chain to the chains it comes from, where these exist: afterwards
 * `child` is complete and can be read without making chains. O(chains events^2). */
void bsdf_chains_tie(struct chains *c);

/* The chain as light sees it that travels the other way: straight-through events
 * are met from the other side. CHAIN_NONE where such light cannot pass (without
 * an error) or when out of memory. */
uint32_t bsdf_chains_reverse(struct chains *c, uint32_t chain, struct err *e);

static inline uint32_t bsdf_chains_length(const struct chains *c, uint32_t chain)
{
	return ((const uint32_t *)c->length.data)[chain];
}

static inline const uint32_t *bsdf_chains_count(const struct chains *c, uint32_t chain)
{
	return (const uint32_t *)c->count.data + (size_t)chain * c->events;
}

#endif
