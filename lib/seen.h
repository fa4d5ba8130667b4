/* What a point sees of a facet past blockers. */
#ifndef TWOPASS_SEEN_H
#define TWOPASS_SEEN_H

#include "mem.h"
#include "sight.h"

/* A convex piece gains a corner at most from each plane that cuts it: those of a facet and
 * of a blocker's silhouette. */
enum { PIECE_CORNERS = 80 };

struct facet_piece {
	int n;
	double v[PIECE_CORNERS][3];
};

/* One thread's scratch space and the blockers; begin with {0}, release with seer_free. */
struct seer {
	struct blocker blocker[SIGHT_BLOCKERS];
	double near;                  /* of the body set */
	struct vec piece, next;       /* what is still visible, convex */
	int hid;                      /* set when a blocker hides something */
	double evaluations;           /* so far */
};

void seer_free(struct seer *s);

/* The form factor from a point x with a unit normal to what it sees of facet g, which is
 * in front of it; exact. blockers: a bit for each that may hide something. NaN and e when
 * memory is short. */
double seen(struct seer *s, const double x[3], const double normal[3], const struct facet *g,
            uint64_t blockers, struct err *e);

/* The n convex pieces that the last call found visible; valid until the next. */
const struct facet_piece *seen_pieces(const struct seer *s, size_t *n);

#endif
