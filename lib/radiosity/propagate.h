/* How flux that a row sends lands on patch-sides (private to lib/radiosity). */
#ifndef TWOPASS_PROPAGATE_H
#define TWOPASS_PROPAGATE_H

#include "lib/base/channels.h"
#include "lib/data/solution.h"
#include "lib/radiosity/transport.h"

/* Where a row's flux comes from, and so which irradiance it becomes: an index of
 * solution.shot and unshot.link. From emitters by directional and ideal events only it is
 * direct or caustic; what some surface has scattered diffusely is indirect. */
enum { FROM_EMITTER, FROM_DIFFUSE, ORIGINS };

struct propagator {
	const struct transport *t;
	const struct model *m;
	int bands;
	size_t channels;         /* light groups x bands */
	size_t vectors;          /* that hold them */
	uint64_t runs;           /* read by radiosity_propagate_row */
	uint32_t *surface;       /* [2P] material and side, an index of split */
	lanes *split;            /* [2 materials][SPLITS][vectors] of flux arriving */
	lanes *share;            /* [2 materials][2][vectors] of what leaves by lobes, by R and T */
	lanes *unshot_diffuse;   /* [2P][vectors] as in solution.h, see radiosity_propagator_load */
	lanes *unshot_link;      /* [links][2][vectors] */
	void *room[4];           /* memory of these */
	double *chain_flux;      /* [chains][channels], 0 between rows */
	uint32_t *touched;       /* chains with flux */
	uint8_t *is_touched;
	size_t touches;
	double bytes;            /* of runs read by it */
	struct propagate_exact *exact;     /* NULL, or flux is sent without loss to rounding */
};

/* What becomes of flux arriving: reflected and transmitted diffusely, by all finite
 * lobes, absorbed. */
enum { SPLIT_RHO, SPLIT_TAU, SPLIT_LOBES, SPLIT_ABSORBED, SPLITS };

/* What became of the flux of rows: [vectors] each, one behind the other. Kept is what
 * became unshot flux again. */
struct shot_ledger {
	lanes *absorbed, *escaped, *lost, *cut, *kept, *guessed;
	size_t vectors;
	void *room;
};

int radiosity_shot_ledger_new(struct shot_ledger *x, size_t vectors, struct err *e);
void radiosity_shot_ledger_clear(struct shot_ledger *x);
void radiosity_shot_ledger_free(struct shot_ledger *x);

/* For flux of all bands of so many light groups. 0, or -1 and e. */
int radiosity_propagator_init(struct propagator *s, const struct transport *t, size_t groups,
                              struct err *e);
void radiosity_propagator_free(struct propagator *s);

/* The unshot flux of a solution into the propagator's own, which radiosity_propagate_row adds
 * to, and back. 0, or -1 and e. */
int radiosity_propagator_load(struct propagator *s, const struct solution *sol, struct err *e);
void radiosity_propagator_store(const struct propagator *s, struct solution *sol);

/* The shares of what leaves a side by its lobes that go by R and by T, [2][vectors]. */
static inline const lanes *radiosity_propagator_share(const struct propagator *s, uint32_t ps)
{
	return s->share + s->surface[ps] * 2 * s->vectors;
}

/* Sends flux, which may be negative, by a row into the propagator's unshot flux; adds to the
 * ledger. */
void radiosity_propagate_row(struct propagator *s, uint32_t row, int origin, const lanes *flux,
                             struct shot_ledger *ledger);

/* Fetches a row that is sent soon: what says where it is (ahead 3), its runs (2), and what
 * they add to (1), each by what the one before fetched. */
void radiosity_propagate_fetch(const struct propagator *s, uint32_t row, int origin,
                               int ahead);

/* The flux that comes in by each block of a row, [blocks of the row][channels],
 * when the row sends flux[channels]. */
void radiosity_propagate_block_flux(struct propagator *s, uint32_t row, const double *flux,
                                    double *block_flux);

#endif
