/* Private to the hemicube: triangles in clusters of neighbours, each with vertices
 * of its own, so that a cluster is transformed once and culled as a whole; a tree
 * gives an order from near to far. */
#ifndef TWOPASS_HEMICUBE_SCENE_H
#define TWOPASS_HEMICUBE_SCENE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"
#include "lib/ray/locate.h"

/* Counts: a cluster of 32 is drawn with its vertices in registers and cache. A guess;
 * tests/bench/hemicube.c measures drawing. */
enum { CLUSTER_TRIANGLES = 32, CLUSTER_VERTICES = 3 * CLUSTER_TRIANGLES };

struct hemicube_cluster {
	double centre[3], radius;  /* bounding sphere */
	size_t vertex;             /* first, a multiple of 4 */
	size_t triangle;           /* first */
	int vertices;              /* multiple of 4: the last is repeated */
	int triangles;
};

/* A plane between two sets of clusters, by their triangles' centroids. */
struct hemicube_split {
	double at;
	int axis;
	int32_t child[2];          /* below and above: a split, or ~cluster */
};

struct hemicube_mesh {
	size_t triangles;
	size_t clusters;
	struct hemicube_cluster *cluster;
	size_t splits;
	struct hemicube_split *split;
	int32_t root;              /* as child[]; none where clusters is 0 */
	double *x, *y, *z;         /* vertices, world */
	uint8_t (*corner)[4];      /* [triangles] vertices within the cluster, and 0 */
	uint32_t *number;          /* [triangles] the model's */
	double horizon;            /* heights up to this are rounding of coordinates */
};

/* A model to be drawn by its elements or, where these are many more, by the input
 * triangles, with the elements found pixel by pixel afterwards. */
struct hemicube_scene {
	const struct model *m;
	const struct locator *locator;
	struct hemicube_mesh elements, triangles; /* triangles may be empty */
};

/* Triangles whose weights a hemicube keeps at a time: a count; tests/bench/hemicube.c measures
 * finding elements. */
enum { HEMICUBE_FOUND = 256 };

/* Weights of a triangle: that of a corner along direction d is proportional to d.(q x r), q
 * and r the other corners as seen from the eye. */
struct hemicube_found {
	uint32_t triangle;         /* HEMICUBE_VOID: none */
	double side[3][3];         /* q x r of corners 1 and 2, and the sum of all, cube's frame */
};

/* Floats of an AVX2 register. */
enum { HEMICUBE_LANES = 8 };

/* A thread's scratch: vertices of one cluster, in the cube's frame and projected
 * onto one face (in pixels). */
struct hemicube_work {
	double v[3][CLUSTER_VERTICES];
	double px[CLUSTER_VERTICES], py[CLUSTER_VERTICES], pq[CLUSTER_VERTICES];
	int32_t column[CLUSTER_VERTICES], row[CLUSTER_VERTICES];
	int32_t code[CLUSTER_VERTICES];
	float *far;                /* least depth in each tile of HEMICUBE_LANES^2 pixels,
	                              some time ago */
	size_t drawn;              /* triangles since */
	struct hemicube_found found[HEMICUBE_FOUND]; /* by the number's last bits */
};

/* Tiles of the top face, and then of each side. */
static inline size_t ff_hemicube_tiles(int n)
{
	return (size_t)((n + HEMICUBE_LANES - 1) / HEMICUBE_LANES);
}

#endif
