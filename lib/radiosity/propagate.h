/* Sending a row's flux to the patch-sides it lands on (private to the solver). */
#ifndef TWOPASS_PROPAGATE_H
#define TWOPASS_PROPAGATE_H

#include "lib/base/channels.h"
#include "lib/data/solution.h"
#include "lib/radiosity/transport.h"

/* Which irradiance a row's flux becomes: index 0 of solution.shot is light that has
 * met only emitters, directional and ideal events, 1 the rest. */
enum { FRESH = 0, MIXED = 1 };

struct sender {
	const struct transport *t;
	const struct model *m;
	int bands;
	size_t channels;         /* light groups x bands */
	size_t vectors;          /* that hold them */
	uint64_t runs;           /* read by send_row */
	uint32_t *surface;       /* [2P] material and side, an index of part */
	lanes *part;             /* [2 materials][PARTS][vectors] of flux arriving */
	lanes *share;            /* [2 materials][2][vectors] of what leaves by lobes, by R and T */
	lanes *unshot_diffuse;   /* [2P][vectors] as in solution.h, see sender_load */
	lanes *unshot_link;      /* [links][2][vectors] */
	void *room[4];           /* memory of these */
	double *chain_flux;      /* [chains][channels], 0 between rows */
	uint32_t *touched;       /* chains with flux */
	uint8_t *is_touched;
	size_t touches;
	double bytes;            /* of runs read by it */
	struct exact *exact;     /* NULL, or flux is sent without loss to rounding */
};

/* What becomes of flux arriving: reflected and transmitted diffusely, by all finite
 * lobes, absorbed. */
enum { PART_RHO, PART_TAU, PART_LOBES, PART_ABSORBED, PARTS };

/* What became of the flux of rows: [vectors] each, one behind the other. Kept is what
 * became unshot flux again. */
struct sent {
	lanes *absorbed, *escaped, *lost, *cut, *kept, *guessed;
	size_t vectors;
	void *room;
};

int sent_new(struct sent *x, size_t vectors, struct err *e);
void sent_clear(struct sent *x);
void sent_free(struct sent *x);

/* For flux of all bands of so many light groups. 0, or -1 and e. */
int sender_init(struct sender *s, const struct transport *t, size_t groups, struct err *e);
void sender_free(struct sender *s);

/* The unshot flux of a solution into the sender, whose own send_row adds to, and back.
 * 0, or -1 and e. */
int sender_load(struct sender *s, const struct solution *sol, struct err *e);
void sender_store(const struct sender *s, struct solution *sol);

/* The shares of what leaves a side by its lobes that go by R and by T, [2][vectors]. */
static inline const lanes *sender_share(const struct sender *s, uint32_t ps)
{
	return s->share + s->surface[ps] * 2 * s->vectors;
}

/* Sends flux, which may be negative, by a row into the sender's unshot flux; adds to
 * `sent`. */
void send_row(struct sender *s, uint32_t row, int freshness, const lanes *flux,
              struct sent *sent);

/* Fetches a row that is sent soon: what says where it is (ahead 3), its runs (2), and what
 * they add to (1), each by what the one before fetched. */
void send_fetch(const struct sender *s, uint32_t row, int freshness, int ahead);

/* The flux that comes in by each block of a row, [blocks of the row][channels],
 * when the row sends flux[channels]. */
void send_block_flux(struct sender *s, uint32_t row, const double *flux, double *block_flux);

#endif
