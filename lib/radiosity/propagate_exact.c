#include "lib/radiosity/propagate_exact.h"

#include <stdlib.h>
#include <string.h>

/* A sum and what rounding has left out of it. */
struct sum {
	lanes high, low;
};

static inline void add(lanes *high, lanes *low, lanes x)
{
	lanes sum = *high + x, part = sum - *high;

	*low += (*high - (sum - part)) + (x - part);
	*high = sum;
}

int radiosity_exact_begin(struct propagator *s, struct propagate_exact *x, struct err *e)
{
	size_t n = s->vectors;

	*x = (struct propagate_exact){ .vectors = n };
	x->diffuse = lanes_new(2 * s->m->patch.n * n, &x->room[0], "unshot flux", e);
	x->link = lanes_new(2 * s->t->links * n, &x->room[1], "unshot flux", e);
	x->due = lanes_new(2 * n, &x->room[2], "flux", e);
	x->due_low = x->due + n;
	s->exact = x;
	return x->diffuse && x->link && x->due ? 0 : -1;
}

void radiosity_exact_end(struct propagator *s)
{
	struct propagate_exact *x = s->exact;

	for (size_t i = 0; x->diffuse && i < 2 * s->m->patch.n * x->vectors; i++)
		s->unshot_diffuse[i] += x->diffuse[i];
	for (size_t i = 0; x->link && i < 2 * s->t->links * x->vectors; i++)
		s->unshot_link[i] += x->link[i];
	for (size_t i = 0; i < sizeof x->room / sizeof *x->room; i++)
		free(x->room[i]);
	s->exact = NULL;
}

struct exact_item radiosity_exact_diffuse(const struct propagator *s, uint32_t ps)
{
	return (struct exact_item){ s->unshot_diffuse + ps * s->vectors,
	                            s->exact->diffuse + ps * s->vectors };
}

struct exact_item radiosity_exact_link(const struct propagator *s, uint64_t l)
{
	return (struct exact_item){ s->unshot_link + l * s->vectors,
	                            s->exact->link + l * s->vectors };
}

void radiosity_exact_take(struct propagator *s, struct exact_item from, const lanes *flux)
{
	for (size_t v = 0; v < s->vectors; v++) {
		add(&from.flux[v], &from.low[v], -flux[v]);
		s->exact->due[v] = flux[v];
		s->exact->due_low[v] = (lanes){ 0 };
	}
}

void radiosity_exact_return(struct propagator *s, struct exact_item to, struct shot_ledger *ledger)
{
	for (size_t v = 0; v < s->vectors; v++) {
		lanes left = s->exact->due[v] + s->exact->due_low[v];
		add(&to.flux[v], &to.low[v], left);
		ledger->kept[v] += left;
	}
}

void radiosity_exact_book(struct propagate_exact *x, size_t v, lanes flux)
{
	add(&x->due[v], &x->due_low[v], -flux);
}

/* ---- landing ---- */

/* What became of a vector of flux. */
struct landed {
	struct sum arrived, kept, absorbed, cut, guessed;
};

static inline void add_to(struct sum *s, lanes x)
{
	add(&s->high, &s->low, x);
}

static void keep(struct exact_item to, size_t v, lanes x, struct landed *l)
{
	add(&to.flux[v], &to.low[v], x);
	add_to(&l->kept, x);
}

static void land(struct propagator *s, const struct block *block, uint64_t run, int origin,
                 lanes in, size_t v, struct landed *l)
{
	const size_t n = s->vectors;
	const uint32_t target = s->t->run_target[run];
	const lanes *part = s->split + s->surface[target] * SPLITS * n + v;
	const lanes x = in * s->t->run_sum[run], lobes = part[SPLIT_LOBES * n] * x;

	add_to(&l->arrived, x);
	add_to(&l->absorbed, part[SPLIT_ABSORBED * n] * x);
	keep(radiosity_exact_diffuse(s, target), v, part[SPLIT_RHO * n] * x, l);
	if (run < block->special)
		return;
	uint32_t link = s->t->run_link[block->link + (run - block->special)];
	keep(radiosity_exact_diffuse(s, target ^ 1), v, part[SPLIT_TAU * n] * x, l);
	if (link == FF_NO_ROW)
		add_to(&l->cut, lobes);
	else if (link != RUN_FOLLOWED)
		keep(radiosity_exact_link(s, 2 * (uint64_t)(link & ~RUN_GUESSED) + (uint64_t)origin),
		     v, lobes, l);
	if (link != FF_NO_ROW && link != RUN_FOLLOWED && (link & RUN_GUESSED))
		add_to(&l->guessed, lobes);
}

static void book_sum(struct propagate_exact *x, size_t v, const struct sum *s, lanes *to)
{
	radiosity_exact_book(x, v, s->high);
	radiosity_exact_book(x, v, s->low);
	*to += s->high + s->low;
}

void radiosity_exact_land(struct propagator *s, const struct block *block, int origin,
                          const lanes *in, struct shot_ledger *ledger)
{
	for (size_t v = 0; v < s->vectors; v++) {
		struct landed l = { 0 };
		for (uint64_t i = block->run; i < block->ideal; i++)
			land(s, block, i, origin, in[v], v, &l);
		/* What is not kept: a product of the absorptance, which is small, would be off by
		 * what that itself was rounded by. */
		l.absorbed.high = (l.arrived.high - l.kept.high) - l.cut.high;
		l.absorbed.low = (l.arrived.low - l.kept.low) - l.cut.low;
		for (uint64_t i = block->ideal; i < block[1].run; i++)
			land(s, block, i, origin, in[v], v, &l);
		book_sum(s->exact, v, &l.kept, &ledger->kept[v]);
		book_sum(s->exact, v, &l.absorbed, &ledger->absorbed[v]);
		book_sum(s->exact, v, &l.cut, &ledger->cut[v]);
		ledger->guessed[v] += l.guessed.high;
	}
}
