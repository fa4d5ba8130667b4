/* The state of shooting at work, and single shots (private to lib/radiosity). The loop that
 * calls them is stated in radiosity.h.
 *
 * Unshot flux may be negative after overshooting; shots take it as it comes. */
#ifndef TWOPASS_SHOOT_H
#define TWOPASS_SHOOT_H

#include "lib/radiosity/components.h"
#include "lib/radiosity/propagate.h"

struct shooter {
	struct solution *s;
	const struct transport *t;
	struct propagator propagator;
	struct components components;
	struct shot_ledger booked;      /* what became of the shot in work */
	lanes *out;              /* [vectors] what it took away */
	lanes *emission;         /* [vectors] of that, what was emission */
	lanes *diffuse;          /* [vectors] and what was to leave diffusely */
	double *emitted;         /* [components][groups] flux, all bands */
	lanes *weight;           /* [components][vectors] 1 / emitted, by group */
	double *cost;            /* [2P] of sending what leaves a side diffusely, in runs */
	double *link_cost;       /* [links] of sending what leaves by lobes */
	lanes *component_unshot; /* [components][vectors] unshot flux by weight */
	lanes *unshot;           /* [vectors] in all, then */
	int negative;            /* some of it is below 0 */
	uint64_t counted;        /* propagator.runs that round[ROUND_WORK] has */
	double guessed, residual;
	void *room[6];           /* memory of the vectors */
};

/* 0, or -1 and e; to be freed either way. */
int radiosity_shooter_init(struct shooter *v, struct solution *s, const struct transport *t,
                           struct err *e);
void radiosity_shooter_free(struct shooter *v);

/* Flux that a source emits; 0 if it is too dim to compute with. */
double radiosity_emitted(const struct model *m, uint32_t source, int band);

/* Looks at all unshot flux: unshot, negative. Returns the largest priority, which is flux
 * by weight and cost; the worst component's and group's unshot over emitted flux goes to
 * *worst. Checks the ledger. O(sides + links). */
double radiosity_survey(struct shooter *v, double *worst);

/* Whether a patch-side has anything of that priority: what it emits and what is to leave
 * diffusely, or what is to leave by the lobes of a link, of either origin. */
int radiosity_is_due(const struct shooter *v, uint32_t ps, double least);

/* A shot of what has that priority, if anything; one of all of a light. */
void radiosity_shoot_side(struct shooter *v, uint32_t ps, double least);
void radiosity_shoot_light(struct shooter *v, uint32_t source);

/* Sends flux to leave diffusely by a side, or by the lobes of link index l (2 link +
 * origin), without taking it from anywhere; adds to v->booked and to `shot`, which may
 * be NULL. */
void radiosity_shoot_diffuse(struct shooter *v, uint32_t ps, const lanes *flux, double *shot);
void radiosity_shoot_link(struct shooter *v, uint64_t l, const lanes *flux, double *shot);

/* Enters v->booked in the ledger, where `out` was taken from unshot flux; NULL if that is
 * accounted for (propagate_exact.h). */
void radiosity_book(struct shooter *v, const lanes *out);

/* Brings unshot / emitted of every component and group well below `stop`: GMRES for
 * what is still to be sent, and one shot of that by all sides. 1 if it made less of it,
 * 0 if it did not, -1 and e. O(passes x runs). */
int radiosity_gmres_finish(struct shooter *v, double worst, double stop, struct err *e);

#endif
