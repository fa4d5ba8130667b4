/* A tree over polygons that send light, by which a lobe chooses one of many.
 *
 * A node bounds what is below it: a sphere about it, a cone about its normals, its power. What
 * a lobe may see of it is bounded from these, and where two nodes part, one is chosen in
 * proportion. Conty Estevez & Kulla, Importance Sampling of Many Lights with Adaptive Tree
 * Splitting, HPG 2018. */
#ifndef TWOPASS_LIGHT_TREE_H
#define TWOPASS_LIGHT_TREE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/geometry/facet.h"

/* Two children, the first of which follows it, or a light. */
struct light_node {
	double centre[3], radius;   /* of a sphere that holds all below */
	double axis[3], cosine;     /* of a cone that holds all normals; its half angle's, -1: any */
	double power, area;         /* power: radiance along the normal times area */
	uint32_t second;            /* 0: a light */
	uint32_t light;
	uint32_t parent;            /* the root's is itself */
};

struct light_tree {
	size_t nodes;               /* 0: no lights */
	struct light_node *node;    /* the root first */
	uint32_t *leaf;             /* [lights] node, or UINT32_MAX */
};

/* A lobe as the tree sees it: cos^k about an axis, from a point. */
struct light_lobe {
	double x[3];                /* as the lights' corners */
	double axis[3], normal[3];  /* normal: of the side that light arrives on */
	double k;
};

/* Of the facets of n lights; those of no power are left out. facet and power are not kept.
 * O(n log n). 0, or -1 and e; to be freed in any case. */
int aim_tree_init(struct light_tree *t, const struct facet *facet, const double *power,
                         size_t n, struct err *e);
void aim_tree_free(struct light_tree *t);

/* 1 if the lights may bring a lobe of unit coefficient a radiance of `enough`, about. 0 if they
 * cannot bring any. O(log n) as a rule. */
int aim_tree_worth(const struct light_tree *t, const struct light_lobe *l, double enough);

/* Chooses a light by u in [0,1), which is made one again; its chance, or 0 for none.
 * O(log n). */
double aim_tree_choose(const struct light_tree *t, const struct light_lobe *l, double *u,
                              uint32_t *light);

/* The chance with which that is chosen. O(log n). */
double aim_tree_chance(const struct light_tree *t, const struct light_lobe *l,
                              uint32_t light);

/* Calls found(light, arg) for lights whose spheres hold x, until it returns 1; 1 if so. */
int aim_tree_at(const struct light_tree *t, const double x[3], double near,
                       int (*found)(uint32_t light, void *arg), void *arg);

#endif
