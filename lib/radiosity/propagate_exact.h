/* Sending without loss to rounding (private to lib/radiosity).
 *
 * Where albedos are near 1, light goes round many thousand times before it is absorbed, and
 * a shot of all of it at once rounds what is large beside all that was emitted. So every
 * unshot flux gets a second number with what the first has lost to rounding, additions are
 * exact (Knuth's two-sum: The Art of Computer Programming vol. 2, sec. 4.2.2), and what of a
 * shot came out nowhere, since products are rounded, stays with its sender. */
#ifndef TWOPASS_PROPAGATE_EXACT_H
#define TWOPASS_PROPAGATE_EXACT_H

#include "lib/radiosity/propagate.h"

struct propagate_exact {
	lanes *diffuse, *link;   /* beside unshot_diffuse and unshot_link */
	lanes *due, *due_low;    /* [vectors] of the flux in work what has come out nowhere yet */
	size_t vectors;
	void *room[3];
};

/* Begins to send exactly; 0, or -1 and e. The end, to be called either way, adds the second
 * numbers to the first. */
int radiosity_exact_begin(struct propagator *s, struct propagate_exact *x, struct err *e);
void radiosity_exact_end(struct propagator *s);

/* Unshot flux that leaves a side diffusely, or by a link (2 link + origin): [vectors]. */
struct exact_item {
	lanes *flux, *low;
};

struct exact_item radiosity_exact_diffuse(const struct propagator *s, uint32_t ps);
struct exact_item radiosity_exact_link(const struct propagator *s, uint64_t l);

/* Takes flux out of an item, to be sent next; and puts back what came out nowhere, which
 * counts as kept. */
void radiosity_exact_take(struct propagator *s, struct exact_item from, const lanes *flux);
void radiosity_exact_return(struct propagator *s, struct exact_item to,
                            struct shot_ledger *ledger);

/* Enters where flux in work came out, of vector v. */
void radiosity_exact_book(struct propagate_exact *x, size_t v, lanes flux);

/* Lands flux from a block, `in` by unit of the values. O(runs). */
void radiosity_exact_land(struct propagator *s, const struct block *block, int origin,
                          const lanes *in, struct shot_ledger *ledger);

#endif
