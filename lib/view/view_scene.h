/* What all views of a scene share (private to lib/view). */
#ifndef TWOPASS_VIEW_SCENE_H
#define TWOPASS_VIEW_SCENE_H

#include "lib/interpolate/reconstruct.h"
#include "lib/occlusion/direct.h"
#include "lib/ray/light_visibility.h"
#include "lib/scatter/lobe_table.h"
#include "lib/aim/emitter_images.h"
#include "lib/view/view.h"

/* What one side of a material does with directional light that leaves it towards
 * the eye, by reflection or by transmission. */
struct view_lobe {
	const double *coefficient;  /* [bands], NULL where there is none */
	double k;
	struct lobe_table table;    /* of a finite lobe */
};

struct view_side {
	double here[BANDS_MAX];     /* rho_d / pi of this side */
	double across[BANDS_MAX];   /* tau_d / pi of the other side */
	int diffuse, translucent, emits, black;
	struct view_lobe reflected, transmitted;
};

struct view_scene {
	const struct model *m;
	const struct solution *s;
	const struct ray_scene *rays;
	enum view_method method;
	struct reconstruction all;  /* irradiance by all paths; empty where it is not needed */
	struct reconstruction part; /* what of it is not computed for each point */
	float *miss;                /* [2 elements][bands] standard error of the interpolated
	                               irradiance of the part (of all by VIEW_MESH) */
	struct direct *direct;
	struct view_side *side;     /* [2 materials] */
	int lobes;                  /* there are finite lobes */
	int tails;                  /* something reflects or transmits directionally */
	struct emitter_images images;  /* if there are such */
	int highlights;             /* there are punctual lights, and finite lobes */
	struct light_visibility ways;     /* of them, if so */
	double ceiling[BANDS_MAX];  /* no radiance along an unsampled tail exceeds it */
};

/* What channel `at`, of [2 elements][bands], adds to the variance of the irradiance seen by
 * way of something that blurs it, of which its element fills this part; with its direct light
 * computed or not. Elements err apart from one another; but an interpolated value errs with
 * the elements around, which pays only where the part is small. */
double view_blurred(const struct view_scene *v, size_t at, double part, int computed);

#endif
