/* The branches of a camera ray that are still to be followed (private to lib/view). */
#ifndef TWOPASS_SPECULAR_STACK_H
#define TWOPASS_SPECULAR_STACK_H

#include <stdint.h>

#include "lib/view/view_scene.h"

/* A ray still to be followed. */
struct view_branch {
	double org[3], dir[3];
	double weight[BANDS_MAX];   /* what of its radiance reaches the pixel */
	double share;               /* one over the samples it stands among */
	int depth;                  /* directional events behind it */
	int passes;                 /* goes through backs of one-sided materials */
	int lobes;                  /* finite lobes behind it that were sampled; of the first: */
	int straight;               /* has met nothing since */
	double density;             /* of its direction, by solid angle */
	double reach;               /* way since */
	int turns;                  /* it has come by ideal events alone: 0 through panes, 1 + k by
	                               mirror plane k once; -1 any other way */
	uint32_t aimed;             /* 1 + the image that it goes to, for nothing else; or 0 */
	uint32_t index;             /* low-discrepancy point and */
	uint64_t seed;              /* scramble of its next lobe sample */
};

struct view_shade_tile;

struct view_walker {
	const struct view_scene *v;
	const struct view_options *o;
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
	struct view_aim aim;        /* of that lobe's samples */
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
 * and books its bound. One of many samples of a lobe is cut by what all of them carry. */
void view_push(struct view_walker *w, const struct view_branch *b, struct view_branch *next,
               const double *coefficient, double scale);

/* Follows the branches that wait but the first `below`. */
void view_run(struct view_walker *w, size_t below);

#endif
