/* Which lobe of a directional patch sends light on (private to transport*.c). */
#ifndef TWOPASS_TRANSPORT_LINKS_H
#define TWOPASS_TRANSPORT_LINKS_H

#include "lib/data/link_key.h"
#include "lib/radiosity/transport.h"

/* The links of a shard into to[f->links]: its chains are numbered in common by `chain`, its
 * rows begin at `row`, and `first` links of other shards stand before. */
void radiosity_transport_put_links(const struct ff *f, const uint32_t *chain, uint32_t row,
                                   uint32_t first, struct link_key *to);

/* Sorts all links and fills t's arrays of them. O(links log links). */
void radiosity_transport_sort_links(struct transport *t, struct link_key *l);

/* The last answer for a target, zeroed at first: rows of one source follow each other. */
struct known_link {
	uint32_t source, chain;
	uint32_t link;           /* + 1; 0: not known */
};

/* The link of a target for light of a source that a block brings: the source's own, else
 * the nearest in direction with RUN_GUESSED; FF_NO_ROW where there is none.
 * O(1) where known, O(log links), or O(links of the target). */
uint32_t radiosity_transport_find_link(const struct transport *t, const struct link_key *l,
                                       const struct block *block, uint32_t target, uint32_t source,
                                       struct known_link *known);

#endif
