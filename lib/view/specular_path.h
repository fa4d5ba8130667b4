/* Following one camera ray and its specular tail. */
#ifndef TWOPASS_SPECULAR_PATH_H
#define TWOPASS_SPECULAR_PATH_H

#include <stdint.h>

#include "lib/interpolate/reconstruct.h"
#include "lib/occlusion/direct.h"
#include "lib/ray/light_visibility.h"
#include "lib/scatter/lobe_table.h"
#include "lib/view/emitter_images.h"
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

/* Up to how many directional events from the eye light is computed rather than
 * interpolated; behind a lobe that is sampled it is always interpolated. */
enum { VIEW_COMPUTED_DEPTH = 4 };

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

/* First surface seen. */
struct view_first {
	uint32_t element;           /* RAY_MISS where nothing */
	double point[3], normal[3];
};

struct view_shade_tile;

struct view_walker {
	const struct view_scene *v;
	const struct view_options *o;
	struct view_shade_tile *shader; /* for points and lobes whose light is to be computed; NULL:
	                               there are none */
	uint32_t slot;              /* of the sample, that it is told with them */
	int asking;                 /* lobes are not sampled: light is only asked for */
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

/* Follows the camera ray b, of which org, dir, index and seed are given, and adds
 * the radiance it brings to w's parts. b is overwritten. */
void view_follow(struct view_walker *w, struct view_branch *b);

/* For what lib/view_lobe does on the way. Puts a branch that carries `scale` times
 * `coefficient` of b's weight on the stack, or cuts it and books its bound. One of many
 * samples of a lobe is cut by what all of them carry. */
void view_push(struct view_walker *w, const struct view_branch *b, struct view_branch *next,
               const double *coefficient, double scale);

/* Follows the branches that wait but the first `below`. */
void view_run(struct view_walker *w, size_t below);

/* The surface the ray meets first. */
void view_first_seen(const struct view_scene *v, const double org[3], const double dir[3],
                     struct view_first *first);

#endif
