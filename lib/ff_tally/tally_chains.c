#include "lib/ff_tally/tally_chains.h"

#include <stdlib.h>

/* Landings kept before equal ones are added up, a count; a guess. */
enum { FAR_MOST = 1 << 20 };

void ff_tally_chains_free(struct tally_chains *f)
{
	free(f->list.data);
	free(f->sort.data);
	*f = (struct tally_chains){ 0 };
}

/* Least-significant-digit radix sort by key, 11 bits a pass; stable. */
static int sort_far(struct tally_chains *f, struct err *e)
{
	size_t n = f->list.n;
	uint64_t all = 0;

	f->sort.n = 0;
	if (mem_reserve(&f->sort, n, sizeof(struct tally_landing), e))
		return -1;
	struct tally_landing *from = f->list.data, *to = f->sort.data;
	for (size_t i = 0; i < n; i++)
		all |= from[i].key;
	for (int shift = 0; shift < 64 && all >> shift; shift += 11) {
		size_t at[2048] = { 0 }, sum = 0;
		for (size_t i = 0; i < n; i++)
			at[from[i].key >> shift & 2047]++;
		for (int k = 0; k < 2048; k++) {
			size_t c = at[k];
			at[k] = sum;
			sum += c;
		}
		for (size_t i = 0; i < n; i++)
			to[at[from[i].key >> shift & 2047]++] = from[i];
		struct tally_landing *swap = from;
		from = to;
		to = swap;
	}
	if (from != f->list.data) {
		struct array swap = f->list;
		f->list = f->sort;
		f->list.n = n;
		f->sort = swap;
	}
	return 0;
}

int ff_tally_chains_merge(struct tally_chains *f, struct err *e)
{
	size_t n = 0;

	if (sort_far(f, e))
		return -1;
	struct tally_landing *l = f->list.data;
	for (size_t i = 0; i < f->list.n; i++) {
		if (n && l[n - 1].key == l[i].key)
			l[n - 1].w += l[i].w;
		else
			l[n++] = l[i];
	}
	f->list.n = n;
	return 0;
}

int ff_tally_chains_add(struct tally_chains *f, const struct tally_landing *l, struct err *e)
{
	if (mem_append(&f->list, l, 1, sizeof *l, e))
		return -1;
	if (f->list.n < (f->most ? f->most : FAR_MOST))
		return 0;
	if (ff_tally_chains_merge(f, e))
		return -1;
	f->most = f->list.n > FAR_MOST / 2 ? 2 * f->list.n : FAR_MOST;
	return 0;
}

size_t ff_tally_chains_find(const struct tally_chains *f, uint64_t key)
{
	const struct tally_landing *l = f->list.data;
	size_t i = 0, hi = f->list.n;

	while (i < hi) {
		size_t mid = i + (hi - i) / 2;
		if (l[mid].key < key)
			i = mid + 1;
		else
			hi = mid;
	}
	return i;
}
