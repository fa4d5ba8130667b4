/* Sending a row's flux to the patch-sides it lands on (private to the solver). */
#ifndef TWOPASS_SEND_H
#define TWOPASS_SEND_H

#include "solution.h"
#include "transport.h"

/* Which irradiance a row's flux becomes: index 0 of solution.shot is light that has
 * met only emitters, directional and ideal events, 1 the rest. */
enum { FRESH = 0, MIXED = 1 };

struct sender {
	const struct transport *t;
	const struct model *m;
	int bands;
	double *part;            /* [2P][4][bands] of flux arriving: rho_d, tau_d, the sum
	                            of finite lobes, absorbed */
	uint8_t *is_ideal;       /* [2P] some goes on by R or T */
	double *chain_flux;      /* [chains][bands], 0 between rows */
	uint32_t *touched;       /* chains with flux */
	uint8_t *is_touched;
	size_t touches;
};

/* What became of a row's flux, per band. */
struct sent {
	double absorbed[BANDS_MAX], escaped[BANDS_MAX], lost[BANDS_MAX], cut[BANDS_MAX];
	double kept[BANDS_MAX];  /* became unshot flux again */
	double guessed[BANDS_MAX];
};

int sender_init(struct sender *s, const struct transport *t, struct err *e);
void sender_free(struct sender *s);

/* Sends flux[bands] by a row into the unshot arrays of sol; adds to `sent`. */
void send_row(struct sender *s, struct solution *sol, uint32_t row, int freshness,
              const double *flux, struct sent *sent);

/* The flux that comes in by each block of a row, [blocks of the row][bands], when
 * the row sends flux[bands]. */
void send_block_flux(struct sender *s, uint32_t row, const double *flux, double *block_flux);

#endif
