/* Light that is computed for each point: points are collected over a tile of the picture,
 * then shaded in the order of the surfaces they are on, which share what is between them
 * and the emitters. */
#ifndef TWOPASS_SHADE_TILE_H
#define TWOPASS_SHADE_TILE_H

#include "lib/base/mem.h"
#include "lib/view/final_gather.h"
#include "lib/aim/lobe_weight.h"
#include "lib/view/view_scene.h"

/* A point whose diffuse light goes, by `weight`, into a sample's diffuse or directional
 * part. */
struct view_request {
	uint32_t element, material, slot;
	int side, directional;
	double x[3], w[3];          /* world; weights of the element's corners */
	uint64_t seed;
};

/* A lobe that was sampled: what its samples found of emitters is to be added, or better what
 * these send by formula. */
struct view_lobe_request {
	struct aim_lobe l;
	uint32_t slot;
	double weight[BANDS_MAX];   /* that its light goes into the directional part by */
	double found[BANDS_MAX];
	double all[BANDS_MAX];      /* variance of what samples found, and of */
	double rest[BANDS_MAX];     /* that without emitters */
};

/* One thread's. */
struct view_shade_tile {
	const struct view_scene *v;
	double relative;            /* error of sampled light to aim at, and of */
	double lobe_relative;       /* samples of lobes */
	struct direct_worker *direct;
	unsigned char *sampled;     /* [2 elements] emitters are, 1, sampled, 2 by formula */
	struct gather *gather;      /* NULL: indirect light is interpolated */
	int thread, asking;         /* asking: points are told to gather, not shaded */
	struct array request;       /* struct view_request */
	struct array weight;        /* double [bands] for each */
	struct array order;         /* uint64_t: element-side that light arrives on, request */
	struct array lobe;          /* struct view_lobe_request */
	struct array lobe_order;    /* as order */
	struct err e;               /* the first failure */
};

/* 0, or -1 and e. To be freed in any case. */
int view_shade_tile_init(struct view_shade_tile *s, const struct view_scene *v,
                         struct gather *gather, double relative, double lobe_relative, int thread,
                         struct err *e);
void view_shade_tile_free(struct view_shade_tile *s);

/* 1 if what emitters send straight to points of a side is sampled, not by formula. Found once. */
int view_shade_tile_sampled(struct view_shade_tile *s, uint32_t element_side);

void view_shade_tile_put(struct view_shade_tile *s, const struct view_request *q,
                         const double *weight);
void view_shade_tile_put_lobe(struct view_shade_tile *s, const struct view_lobe_request *q);

/* Of samples, or sums over those of a pixel, [samples or pixels][bands]. */
struct view_sums {
	double *diffuse, *directional, *emission;
	double *error;              /* of interpolated light: alike in all samples of a pixel */
	double *square;             /* of standard errors of sampled light, independent */
	double *spread;             /* sum of squared radiances */
	double *axial;              /* sum of squared weights of lobes seen by one ray */
};

/* Shades the points collected since the last call and forgets them. */
void view_shade_tile_run(struct view_shade_tile *s, const struct view_sums *to);

#endif
