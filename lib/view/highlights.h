/* Punctual lights in finite lobes, which no sample of a lobe can meet (private to lib/view). */
#ifndef TWOPASS_HIGHLIGHTS_H
#define TWOPASS_HIGHLIGHTS_H

#include "lib/aim/lobe_weight.h"
#include "lib/view/view_scene.h"

/* Radiance by a lobe of unit coefficient, from lights and their images, into l[bands]. Adds the
 * rays that took to *rays. O(lights and images). */
void view_highlights(const struct view_scene *v, const struct aim_lobe *lobe, double *l,
                     uint64_t *rays);

#endif
