/* Highlights of punctual lights (private to lib/view). */
#ifndef TWOPASS_HIGHLIGHTS_H
#define TWOPASS_HIGHLIGHTS_H

#include "lib/view/view_scene.h"

/* Radiance into l[bands] that the finite lobes at a point x, n its front normal, send
 * along `out` of what comes from punctual lights, also by plane mirrors and through clear
 * panes. Adds to *rays. O(lights and images). */
void view_highlights(const struct view_scene *v, uint32_t material, const double x[3],
                     const double n[3], const double out[3], double *l, uint64_t *rays);

#endif
