#include "lib/view/specular_stack.h"

#include <math.h>

size_t view_stack_size(const struct view_options *o)
{
	/* Every level leaves at most one branch waiting for each one it goes on with:
	 * depth + 1. Twice that leaves room to spare. */
	return 2 * (size_t)o->depth + 4;
}

void view_push(struct view_walker *w, const struct view_branch *b, struct view_branch *next,
               const double *coefficient, double scale)
{
	int bands = w->v->m->bands;
	double most = 0;

	next->depth = b->depth + 1;
	for (int i = 0; i < bands; i++) {
		next->weight[i] = b->weight[i] * coefficient[i] * scale;
		most = fmax(most, next->weight[i]);
	}
	if (next->depth <= w->o->depth && most > 0 && (next->lobes || most >= w->o->cutoff)) {
		w->stack[w->waiting++] = *next;
		return;
	}
	for (int i = 0; i < bands; i++)
		if (next->weight[i] > 0)
			w->cut[i] += next->weight[i] * w->v->ceiling[i];
}

void view_run(struct view_walker *w, size_t below)
{
	while (w->waiting > below) {
		struct view_branch b = w->stack[--w->waiting];
		w->step(w, &b);
	}
}
