/* Directional form factors (private to lib/ff): eq. (3) of the paper, for light that came to patch i
 * from one source, with a the angle to the lobe's axis (R or T) and theta that to the normal,
 *     G'(i->e) = cos^k a / cos theta F(i->e),    G(i->e) = G'(i->e) / sum of G' over all it sees. */
#ifndef TWOPASS_DIRECTIONAL_H
#define TWOPASS_DIRECTIONAL_H

#include "lib/ff_rays/ff_internal.h"

/* Casts one lobe direction from a capture's point off a side. */
typedef void ff_cast_fn(struct ff_thread *t, const struct ff_incident *c, int side,
                        const double dir[3], double w);

/* Turns the captures of a directional patch-side into links with their G rows. */
int ff_directional_rows(struct ff_thread *t, uint32_t patch_side, ff_cast_fn *cast, struct ff_batch *b,
                        struct err *e);

#endif
