/* Emitters as lobes see them, straight, through clear panes and by way of plane mirrors, turned as
 * often as it takes: what a lobe samples may not meet for long, so samples are aimed at them, too,
 * and both are weighed by how likely either finds a way.
 * Veach & Guibas, Optimally Combining Sampling Techniques, SIGGRAPH 1995: balance heuristic. */
#ifndef TWOPASS_EMITTER_IMAGES_H
#define TWOPASS_EMITTER_IMAGES_H

#include <stddef.h>
#include <stdint.h>

#include "lib/occlusion/emitters.h"
#include "lib/ray/mirror.h"
#include "lib/aim/light_tree.h"

struct aim_lobe;

/* A chain is a sequence of mirror planes as light meets them on its way from the lobe; 0 is the
 * empty one, panes do not count. Image i of chain c is number c emitters + i. */
struct emitter_images {
	size_t n;                   /* 0: nothing to aim at */
	struct facet *image;        /* [n] corners relative to occ_facet_centre(); n = 0: none */
	double *corner;
	struct emitters emitters;
	struct mirrors mirrors;
	size_t chains;
	int32_t *turn;              /* [chains][mirrors] the chain by one mirror more; -1: none */
	uint32_t *before;           /* [chains] that without the last mirror */
	double centre[3];
	uint32_t *of;               /* [2 elements] emitter, or UINT32_MAX */
	struct light_tree all;      /* of all images, and of those but the emitters themselves */
	struct light_tree turned;
	int panes;                  /* there are clear panes */
};

/* Needs derived lights. O(triangles + elements log emitters + images log images). 0, or -1 and
 * e; to be freed in any case. */
int aim_images_init(struct emitter_images *s, const struct model *m, struct err *e);
void aim_images_free(struct emitter_images *s);

/* How samples of a lobe are aimed. */
struct aim {
	const struct light_tree *tree;  /* NULL: not at all */
	struct light_lobe lobe;
};

/* `enough`: radiance that is worth aiming at. straight: also at what is known to be straight in
 * sight. O(log images) as a rule. */
void aim_images_choose(const struct emitter_images *s, const struct aim_lobe *l,
                                int straight, double enough, struct aim *a);

/* A direction towards a point of some image, from three numbers in [0,1): its density, and
 * the image. 0 if it is edge on. */
double aim_images_aim(const struct emitter_images *s, const struct aim *a,
                               const double u[3], double dir[3], uint32_t *image);

/* The density with which aim_images_aim finds a point of an image at a distance, which
 * is seen at an angle of this cosine. */
double aim_images_density(const struct emitter_images *s, const struct aim *a,
                                   size_t image, double way, double cosine);

/* The chain by one mirror more that leads from a chain to a longer one. */
int32_t aim_images_next(const struct emitter_images *s, int32_t chain, int32_t longer);

/* The mirror plane that a point of a side with front normal n is on, or -1. */
int aim_images_plane(const struct emitter_images *s, uint32_t material, int side,
                              const double n[3], const double x[3]);

#endif
