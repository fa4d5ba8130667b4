/* Private to the hemicube: elements in clusters of neighbours, each with vertices
 * of its own, so that a cluster is transformed once and culled as a whole. */
#ifndef TWOPASS_HEMICUBE_SCENE_H
#define TWOPASS_HEMICUBE_SCENE_H

#include <stddef.h>
#include <stdint.h>

enum { CLUSTER_TRIANGLES = 64, CLUSTER_VERTICES = 3 * CLUSTER_TRIANGLES };

struct hemi_cluster {
	double centre[3], radius;  /* bounding sphere */
	size_t vertex;             /* first, a multiple of 4 */
	size_t triangle;           /* first */
	int vertices;              /* multiple of 4: the last is repeated */
	int triangles;
};

struct hemi_scene {
	size_t clusters;
	struct hemi_cluster *cluster;
	double *x, *y, *z;         /* vertices, world */
	uint8_t (*corner)[4];      /* [elements] vertices within the cluster, and 0 */
	uint32_t *element;         /* [elements] */
	double horizon;            /* heights up to this are rounding of coordinates */
};

/* A thread's scratch: vertices of one cluster, in the cube's frame and projected
 * onto one face (in pixels). */
enum { HEMI_LANES = 8 };

struct hemi_work {
	double v[3][CLUSTER_VERTICES];
	double px[CLUSTER_VERTICES], py[CLUSTER_VERTICES], pq[CLUSTER_VERTICES];
	int32_t column[CLUSTER_VERTICES], row[CLUSTER_VERTICES];
	int32_t code[CLUSTER_VERTICES];
};

#endif
