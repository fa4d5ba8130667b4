/* Emitters as lobes see them by way of plane mirrors and clear panes: what a lobe samples may
 * not meet for long, so samples are aimed at their images, too, and both are weighed by how
 * likely either finds a way (private to lib/view).
 * Veach & Guibas, Optimally Combining Sampling Techniques, SIGGRAPH 1995: balance heuristic. */
#ifndef TWOPASS_EMITTER_IMAGES_H
#define TWOPASS_EMITTER_IMAGES_H

#include <stddef.h>
#include <stdint.h>

#include "lib/occlusion/emitters.h"
#include "lib/ray/mirror.h"

struct view_lobe_seen;

/* Counts: what has more is sampled by its lobes alone. All images are looked at for each lobe seen
 * (816 at most). As many emitters as direct light takes by formula; mirrors: a guess. */
enum {
	VIEW_EMITTERS_MOST = 48, VIEW_MIRRORS_MOST = 16,
	VIEW_IMAGES_MOST = VIEW_EMITTERS_MOST * (VIEW_MIRRORS_MOST + 1)
};

/* Image t of emitter i in mirror k is number (k + 1) emitters + i; k = -1 are the emitters
 * themselves, behind panes. */
struct emitter_images {
	size_t n;                   /* 0: nothing to aim at, or too much */
	struct facet *image;        /* [n] corners relative to occ_facet_centre(); n = 0: none */
	double *corner;
	struct emitters emitters;
	struct mirrors mirrors;
	double centre[3];
	uint32_t *of;               /* [2 elements] emitter, or UINT32_MAX */
};

/* Needs derived lights. O(triangles + elements emitters + images). 0, or -1 and e; to be
 * freed in any case. */
int view_emitter_images_init(struct emitter_images *s, const struct model *m, struct err *e);
void view_emitter_images_free(struct emitter_images *s);

/* How samples of a lobe are aimed. */
struct view_aim {
	double x[3];                /* relative to the centre */
	double sum;                 /* 0: not at all */
	double guess[VIEW_IMAGES_MOST]; /* radiance that an image may bring, about */
};

/* O(images). `enough`: radiance that is worth aiming at. */
void view_emitter_images_choose(const struct emitter_images *s, const struct view_lobe_seen *l,
                                double enough, struct view_aim *a);

/* A direction towards a point of some image, from three numbers in [0,1): its density, and
 * the image. 0 if it is edge on. */
double view_emitter_images_aim(const struct emitter_images *s, const struct view_aim *a,
                               const double u[3], double dir[3], uint32_t *image);

/* The density with which view_emitter_images_aim finds a point of an image at a distance, which
 * is seen at an angle of this cosine. */
double view_emitter_images_density(const struct emitter_images *s, const struct view_aim *a,
                                   size_t image, double way, double cosine);

/* The mirror plane that a point of a side with front normal n is on, or -1. */
int view_emitter_images_plane(const struct emitter_images *s, uint32_t material, int side,
                              const double n[3], const double x[3]);

#endif
