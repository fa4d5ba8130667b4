/* The branches of a camera ray that are still to be followed (private to lib/view). */
#ifndef TWOPASS_SPECULAR_STACK_H
#define TWOPASS_SPECULAR_STACK_H

#include <stdint.h>

#include "lib/view/view_scene.h"

/* A ray still to be followed. */
struct view_branch {
	double org[3], dir[3];
	double weight[BANDS_MAX];   /* what of its radiance reaches the pixel */
	int depth;                  /* directional events behind it */
	int passes;                 /* goes through backs of one-sided materials */
	uint32_t index;             /* low-discrepancy point and */
	uint64_t seed;              /* its order and scramble for the next event */
	int lobes;                  /* finite lobes behind it that were sampled; of the first: */
	int straight;               /* has met nothing since */
	double density;             /* of its direction, by solid angle */
	double reach;               /* way since */
	double worth;               /* what carries less goes on by so much less chance */
	double shown;               /* radiance that the pixel shows beside, about */
	struct aim aim;             /* of the last: how emitters were aimed at from it, */
	double chance, way;         /* density of its direction, way since, and */
	int32_t chain;              /* chain of mirrors it came by (emitter_images.h); -1: other */
};

struct view_shade_tile;

struct view_walker {
	const struct view_scene *v;
	const struct view_options *o;
	double *unrest;             /* [4 materials] of lobes that the tile has sampled (glossy.c) */
	struct view_shade_tile *shader; /* for points and lobes whose light is to be computed; NULL:
	                               there are none */
	uint32_t slot;              /* of the sample, that it is told with them */
	int asking;                 /* lobes are not sampled: light is only asked for */
	/* Follows a branch to the surface it meets and puts on the stack what goes on there. */
	void (*step)(struct view_walker *w, const struct view_branch *b);
	struct view_branch *stack;
	size_t waiting;
	double diffuse[BANDS_MAX], directional[BANDS_MAX], emission[BANDS_MAX];
	double lit[BANDS_MAX];      /* by emitters straight to the lobe that is sampled */
	double error[BANDS_MAX];    /* of interpolated light */
	double blurred[BANDS_MAX];  /* squares of it, that the samples of a lobe have summed up */
	double cut[BANDS_MAX];
	/* Lobes seen by one ray about their axis: squares of what it counts with, and of lobes
	 * that are probed that too, and squares of how far the ray is off. */
	double axial[BANDS_MAX], probed[BANDS_MAX], off[BANDS_MAX];
	int probing;                /* lobes are probed */
	uint64_t rays;
};

/* Room for the branches that may wait at once. */
size_t view_stack_size(const struct view_options *o);

/* Puts a branch that carries `scale` times `coefficient` of b's weight on the stack, or cuts it
 * and books its bound. Behind lobes that are sampled only the depth cuts. */
void view_push(struct view_walker *w, const struct view_branch *b, struct view_branch *next,
               const double *coefficient, double scale);

/* Follows the branches that wait but the first `below`. */
void view_run(struct view_walker *w, size_t below);

#endif
