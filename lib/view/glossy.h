/* Finite lobes as the eye sees them: by samples (private to lib/view*.c). */
#ifndef TWOPASS_GLOSSY_H
#define TWOPASS_GLOSSY_H

#include "lib/view/specular_path.h"

/* A lobe that a ray meets. */
struct view_lobe_seen {
	double k, axis[3], normal[3];  /* normal: of the side that its light arrives on */
	const struct lobe_table *table;
	double cosine;                 /* of the axis to the normal */
	double x[3];                   /* the point, on its surface */
	uint32_t element;
	int side;                      /* that light arrives on */
	double other[BANDS_MAX];       /* radiance beside that the pixel shows, about */
};

/* Follows samples of a lobe, of which b->weight times coefficient reaches the pixel, and adds
 * what they bring; what emitters send straight to it, by formula where that can be done.
 * `next` is the branch that all of them begin as. */
void view_lobe_follow(struct view_walker *w, const struct view_branch *b,
                      const struct view_lobe_seen *l, const double *coefficient,
                      struct view_branch *next);

/* Compares what samples find, and one ray about the axis that carries `scale` times the
 * coefficient: adds to the walker's `probed` and `off`, without bias, and to nothing else. */
void view_lobe_probe(struct view_walker *w, const struct view_branch *b,
                     const struct view_lobe_seen *l, const double *coefficient, double scale,
                     const struct view_branch *axial);

/* The lobe as a weight of directions, for unit coefficient: f cos theta_i. l must outlive
 * it. */
struct view_lobe_weight {
	const struct view_lobe_seen *l;
	enum lobe_kind kind;
};

struct direct_weight view_lobe_weight(const struct view_lobe_weight *w);

#endif
