/* The state of the solver at work, and shots (private to the solver).
 *
 * Unshot flux may be negative after overshooting; shots take it as it comes. */
#ifndef TWOPASS_SHOOT_H
#define TWOPASS_SHOOT_H

#include "lib/radiosity/components.h"
#include "lib/radiosity/propagate.h"
#include "lib/radiosity/radiosity.h"

struct solver {
	struct solution *s;
	const struct transport *t;
	struct sender sender;
	struct components parts;
	struct sent sent;        /* what became of the shot in work */
	lanes *out;              /* [vectors] what it took away */
	lanes *emission;         /* [vectors] of that, what was emission */
	lanes *diffuse;          /* [vectors] and what was to leave diffusely */
	double *emitted;         /* [components][groups] flux, all bands */
	lanes *weight;           /* [components][vectors] 1 / emitted, by group */
	double *cost;            /* [2P] of sending what leaves a side diffusely, in runs */
	double *link_cost;       /* [links] of sending what leaves by lobes */
	lanes *part;             /* [components][vectors] unshot flux by weight */
	lanes *unshot;           /* [vectors] in all, then */
	int negative;            /* some of it is below 0 */
	uint64_t counted;        /* sender.runs that round[ROUND_WORK] has */
	double guessed, residual;
	void *room[6];           /* memory of the vectors */
};

/* 0, or -1 and e; to be freed either way. */
int solver_init(struct solver *v, struct solution *s, const struct transport *t,
                struct err *e);
void solver_free(struct solver *v);

/* Flux that a source emits; 0 if it is too dim to compute with. */
double solver_emitted(const struct model *m, uint32_t source, int band);

/* Looks at all unshot flux: unshot, negative. Returns the largest priority, which is flux
 * by weight and cost; the worst component's and group's unshot over emitted flux goes to
 * *worst. Checks the ledger. O(sides + links). */
double solver_survey(struct solver *v, double *worst);

/* Whether a patch-side has anything of that priority: what it emits and what is to leave
 * diffusely, or what is to leave by the lobes of a link, fresh or mixed. */
int solver_is_due(const struct solver *v, uint32_t ps, double least);

/* A shot of what has that priority, if anything; one of all of a light. */
void solver_shoot(struct solver *v, uint32_t ps, double least);
void solver_shoot_light(struct solver *v, uint32_t source);

/* Sends flux to leave diffusely by a side, or by the lobes of link index l (2 link +
 * freshness), without taking it from anywhere; adds to v->sent and to `shot`, which may
 * be NULL. */
void solver_send_diffuse(struct solver *v, uint32_t ps, const lanes *flux, double *shot);
void solver_send_link(struct solver *v, uint64_t l, const lanes *flux, double *shot);

/* Books v->sent in the ledger, where `out` was taken from unshot flux; NULL if that is
 * accounted for (propagate_exact.h). */
void solver_book(struct solver *v, const lanes *out);

/* Brings unshot / emitted of every component and group well below `stop`: GMRES for
 * what is still to be sent, and one shot of that by all sides. 1 if it made less of it,
 * 0 if it did not, -1 and e. O(passes x runs). */
int solver_overshoot(struct solver *v, double worst, double stop, struct err *e);

#endif
