/* Finite lobes as the eye sees them: by samples (private to lib/view). */
#ifndef TWOPASS_GLOSSY_H
#define TWOPASS_GLOSSY_H

#include "lib/aim/lobe_weight.h"
#include "lib/view/specular_stack.h"

/* Follows samples of a lobe, of which b->weight times coefficient reaches the pixel, and adds
 * what they bring; what emitters send straight to it, by formula where that can be done.
 * `next` is the branch that all of them begin as. */
void view_lobe_follow(struct view_walker *w, const struct view_branch *b,
                      const struct aim_lobe *l, const double *coefficient,
                      struct view_branch *next);

/* One sample of a lobe that a sample of another has met. */
void view_lobe_go_on(struct view_walker *w, const struct view_branch *b, const struct aim_lobe *l,
                     const double *coefficient, struct view_branch *next);

/* Compares what samples find, and one ray about the axis that carries `scale` times the
 * coefficient: adds to the walker's `probed` and `off`, without bias, and to nothing else. */
void view_lobe_probe(struct view_walker *w, const struct view_branch *b,
                     const struct aim_lobe *l, const double *coefficient, double scale,
                     const struct view_branch *axial);

#endif
