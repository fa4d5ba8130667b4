/* From the triangles of a scene to elements and patches.
 *
 * In: a model with materials, surfaces, vertices, triangles, triangle_surface,
 * triangle_uv and triangle_normal (the last two may be NULL) filled.
 * Out: the same model cleaned and with every array of lib/data/model.h filled.
 * O(n log n) in the elements made. */
#ifndef TWOPASS_MESHER_H
#define TWOPASS_MESHER_H

#include "lib/base/parallel.h"
#include "lib/data/model.h"

struct solution;

/* A length in metres or, if relative, as a fraction of the diameter of the
 * smallest ball about the scene; INFINITY = no bound. */
struct mesh_size {
	double value;
	int relative;
};

struct mesh_options {
	struct mesh_size patch;    /* longest side of a patch */
	struct mesh_size element;  /* longest edge of an element */
	int element_within_patch;    /* 1: no longer than the patch size either */
	double normal_cone;          /* degrees: how far the elements of a grouped
	                                patch may turn away from its mean normal */
	int no_imprint;              /* 1: triangles are not cut where others touch them */
	const struct progress *progress; /* or NULL */
};

/* Patches of 5 % of the diameter, elements of 4 %, a cone of 20 degrees: guesses, which
 * tests/bench/RESULTS.md compares with others for elements and refinement. */
#define MESH_OPTIONS_DEFAULT \
	((struct mesh_options){ .patch = { .05, 1 }, .element = { .04, 1 }, \
	                          .element_within_patch = 1, .normal_cone = 20 })

/* Refinement goes on until the expected error is small enough, or the elements are so many
 * or so small; in one step to a quarter of an element's edge at most. */
struct mesh_refinement {
	double error;                /* root mean square over all modelled sides of the error of
	                                exitance, over the mean exitance */
	struct mesh_size smallest; /* elements are not divided to shorter longest edges */
	size_t elements;
};

/* What cleaning did to one surface. */
struct mesh_surface {
	uint32_t degenerate;  /* triangles without area, dropped */
	uint32_t duplicate;   /* triangles that coincide with a kept one, dropped */
	uint32_t welded;      /* vertices that became one with another */
	uint32_t opposite;    /* edges whose two triangles have opposite winding */
};

struct mesh_report {
	size_t surfaces;                 /* of the model that came in */
	struct mesh_surface *surface;
	struct mesh_surface total;
	uint32_t merged;                 /* kept triangles whose black back became the
	                                    side of the duplicate that faced that way */

	size_t cut;                      /* triangles cut where others touch them, */
	size_t lines;                    /* along how many new edges */
	size_t fine_contacts;            /* contacts too short to be worth a cut */
	size_t covered;                  /* triangles and parts dropped under coplanar surfaces */

	double diameter;                 /* of the smallest ball about the scene, m */
	double patch_size, element_size; /* m, or INFINITY */
	size_t planar_patches;
	uint32_t largest_patch;          /* elements in it */
	double area_front, area_back;    /* of the modelled sides, m^2 */

	/* Of mesh_refine. Errors as in struct mesh_refinement. */
	size_t elements_before, patches_before;
	size_t marked, patches_marked;   /* to be divided for their own sake */
	size_t patches_for_lobes;        /* of these, for what lobes light */
	double error_before, error_expected;
	double patch_error_before;       /* the part of patches in error_before */

	/* Pieces connected by edges, coincident edges of different surfaces taken
	 * together. A piece is closed if each of its edges has two triangles. */
	size_t components, closed_components;
	size_t open_edges;               /* with one triangle */
	size_t crowded_edges;            /* with more than two */

	/* Materials that some triangle wears, and how many of them ... */
	size_t materials;
	size_t two_sided, emitters, lobes, ideal, transmitting;
};

/* 0, or -1 and e (m then is to be freed as it is). r must be zeroed. */
int mesh_run(struct model *m, const struct mesh_options *o, struct mesh_report *r,
             struct err *e);

/* The same from an earlier mesh and its solution: `old` becomes the division of m, with
 * those elements halved that contribute most to the error that s states (s->discretisation),
 * and those patches whose exitance differs too much from place to place for what is next to
 * them, or for lobes that mirror them. Other patches stay as they were. m may have other
 * materials and cameras than old, but its triangles, cleaned and cut as o says, must be the
 * same. (*origin)[e] = element of old that element e is part of, to be freed in any case. old
 * is used up. */
int mesh_refine(struct model *m, const struct mesh_options *o, struct model *old,
                const struct solution *s, const struct mesh_refinement *how,
                uint32_t **origin, struct mesh_report *r, struct err *e);

void mesh_report_free(struct mesh_report *r);

#endif
