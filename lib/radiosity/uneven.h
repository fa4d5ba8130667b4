/* What patches do to the solution that are not evenly lit.
 *
 * Rows send the flux of a patch-side j as if all of it had its mean exitance B_j. Elements know
 * better where their gathering rays landed (struct ff_gathered): with M_f the exitance of element-side
 * f that a ray met, g_f its slope, x where on it, c what mirrors, panes and lobes on the way do, the
 * irradiance of element-side e lacks
 *
 *     u_e = 1 / rays  sum over landings of c (M_f + g_f (x - c_f) - B_j(f))
 *
 * Light is neither made nor lost by that: over all e, landings of chain 0 are to bring what the uneven
 * part of f's exitance does not lose, - sum over f of A_f (M_f - B_j) lost_f / rays_f. What they fail to
 * is shared out in each connected component, as 1 / rays is what sums are uncertain by; else rooms of albedos near 1 would make much of it.
 *
 * u is kept in solution.uneven and is part of irradiance.indirect. What e reflects of it is shot
 * in turn; as it changes M, u is found again, a few times: the steps fall by a factor of 5 to 25.
 *
 * What is left to state, solution_error.uneven: slopes are as good as elements are small, so a part
 * of what they bring; and what the next steps would. Rays are samples of M_f - B_j, whose variance
 * belongs to error.sampling. */
#ifndef TWOPASS_UNEVEN_H
#define TWOPASS_UNEVEN_H

#include "lib/radiosity/components.h"
#include "lib/radiosity/exitance_slope.h"

struct uneven {
	const struct transport *t;
	struct solution *s;
	int threads;
	struct neighbours neighbours;
	uint64_t **start;         /* [shards][sides+1] first landing of a side */
	lanes *colour;            /* [chains] of the channels in work */
	lanes *exitance;          /* [2E] of the channels in work */
	lanes_f32 *deviation;     /* [2E][3] from the patch's mean; slopes */
	float *before;            /* [groups][2E][bands] solution.uneven before the last step */
	void *room[5];
	size_t first;             /* of the channels in work */
	int total;                /* channels are bands, groups together */
	lanes *straight;          /* [2E] what landings of chain 0 bring, of the channels in work */
	struct components components;
	lanes *missing;           /* [components] flux that these should bring besides */
	double *uncertain;        /* [components] sum of area times `doubt` */
	float *loss, *doubt;      /* [2E] part of the rays that is lost; part that lands, over rays */
	double left;              /* see radiosity_uneven_errors */
};

/* 1 if the form factors say where rays landed. */
int radiosity_uneven_known(const struct transport *t);

/* 0, or -1 and e; to be freed either way. */
int radiosity_uneven_init(struct uneven *u, const struct transport *t, struct solution *s,
                          int threads, struct err *e);
void radiosity_uneven_free(struct uneven *u);

/* Finds u anew, by the irradiance that there is, and makes what changed unshot flux and entries of
 * the ledger. Returns the root mean square of the change over area and bands. O(landings + elements). */
double radiosity_uneven_step(struct uneven *u);

/* Adds to error.sampling what landings vary by, and fills error.uneven; `left`: the part of the last
 * step that is still to come. O(landings + elements). */
void radiosity_uneven_errors(struct uneven *u, double left);

#endif
