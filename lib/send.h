/* Sending a row's flux to the patch-sides it lands on (private to the solver). */
#ifndef TWOPASS_SEND_H
#define TWOPASS_SEND_H

#include "lanes.h"
#include "solution.h"
#include "transport.h"

/* Which irradiance a row's flux becomes: index 0 of solution.shot is light that has
 * met only emitters, directional and ideal events, 1 the rest. */
enum { FRESH = 0, MIXED = 1 };

struct sender {
	const struct transport *t;
	const struct model *m;
	int bands;
	size_t groups;           /* vectors for the bands */
	uint32_t *kind;          /* [2P] material and side, an index of part and is_ideal */
	lanes *part;             /* [kinds][PARTS][groups] of flux arriving */
	uint8_t *is_ideal;       /* [kinds] some goes on by R or T */
	lanes *unshot;           /* [2P][groups] flux to leave diffusely, sender_load */
	void *room[2];           /* memory of part and unshot */
	double *chain_flux;      /* [chains][bands], 0 between rows */
	uint32_t *touched;       /* chains with flux */
	uint8_t *is_touched;
	size_t touches;
	double bytes;            /* of runs read by send_row */
};

/* What becomes of flux arriving: reflected and transmitted diffusely, by all finite
 * lobes, absorbed. */
enum { PART_RHO, PART_TAU, PART_LOBES, PART_ABSORBED, PARTS };

/* What became of a row's flux, per band. */
struct sent {
	double absorbed[BANDS_MAX], escaped[BANDS_MAX], lost[BANDS_MAX], cut[BANDS_MAX];
	double kept[BANDS_MAX];  /* became unshot flux again */
	double guessed[BANDS_MAX];
};

int sender_init(struct sender *s, const struct transport *t, struct err *e);
void sender_free(struct sender *s);

/* The unshot diffuse flux of a solution into s->unshot, which send_row adds to, and
 * back. 0, or -1 and e. */
int sender_load(struct sender *s, const struct solution *sol, struct err *e);
void sender_store(const struct sender *s, struct solution *sol);

/* Unshot diffuse flux of a patch-side, [bands]. */
static inline double *sender_unshot(const struct sender *s, uint32_t ps)
{
	return (double *)(s->unshot + ps * s->groups);
}

/* Sends flux[bands] by a row into s->unshot and sol's unshot_link; adds to `sent`. */
void send_row(struct sender *s, struct solution *sol, uint32_t row, int freshness,
              const double *flux, struct sent *sent);

/* The flux that comes in by each block of a row, [blocks of the row][bands], when
 * the row sends flux[bands]. */
void send_block_flux(struct sender *s, uint32_t row, const double *flux, double *block_flux);

#endif
