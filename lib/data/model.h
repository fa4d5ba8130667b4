/* The scene as every tool after `mesh` sees it: what a .mesh file holds. */
#ifndef TWOPASS_MODEL_H
#define TWOPASS_MODEL_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"

enum { FRONT = 0, BACK = 1 };
enum { BANDS_MAX = 32 };

/* Which Phong lobe finite exponents mean (see lobe.h). */
enum lobe_kind { LOBE_PAPER = 0, LOBE_RECIPROCAL = 1 };

/* Materials. Coefficients of a side belong to light ARRIVING on that side.
 * Arrays [n][2][bands] unless said otherwise, side front then back. */
struct materials {
	size_t n;
	int bands;
	char **name;              /* [n] */
	double *rho_d, *tau_d;    /* diffuse reflectance, transmittance */
	double *rho_s, *tau_s;    /* directional reflectance, transmittance */
	double *alpha, *beta;     /* [n][2] exponents of rho_s, tau_s; INFINITY = ideal */
	double *emission;         /* radiance along the side's normal */
	double *emission_exponent;/* [n][2] m of L cos^(m-1) */
	uint8_t *one_sided;       /* [n] 1: the back is black, not modelled, and
	                             camera rays pass it */
};

/* A surface is one primitive of one node. */
struct surfaces {
	size_t n;
	char **name;              /* unique */
	uint32_t *material;
	uint8_t *has_normals;     /* the file gave NORMALs */
};

enum light_kind { LIGHT_POINT, LIGHT_SPOT, LIGHT_DIRECTIONAL, LIGHT_KINDS };

/* Punctual lights: sources without area (see punctual.h). */
struct lights {
	size_t n;
	char **name;              /* unique */
	uint8_t *kind;            /* enum light_kind */
	double *position;         /* [n][3] world, metres; 0 for directional ones */
	double *direction;        /* [n][3] unit, the way that light travels along the
	                             axis; 0 for points */
	double *cone;             /* [n][2] half angles of a spot in radians: up to the inner
	                             its intensity is full, beyond the outer 0; else 0 */
	double *intensity;        /* [n][bands] cd along the axis; lx, of a plane across
	                             the light, for directional ones */
	double *unit_flux;        /* derived, [n] flux of intensity 1 */
	double *cosine;           /* derived, [n][2] of the cones */
	double box[2][3];         /* derived: the least and largest coordinates of triangles */
};

struct camera {
	char *name;
	int orthographic;
	double to_world[16];      /* column-major rigid matrix; the camera looks
	                             along -Z with +Y up, as glTF says */
	double yfov;              /* radians, perspective */
	double aspect;            /* width / height, 0 = not given */
	double xmag, ymag;        /* half extents, orthographic */
};

/* A node of the split trees that lead from an input triangle to its elements:
 * edge `edge` of the triangle (corners edge, edge+1 mod 3) is halved at m;
 * child[0] has m in place of corner edge+1, child[1] in place of corner edge.
 * A child >= 0 is another node, otherwise ~child is an element. */
struct split {
	int32_t child[2];
	int32_t edge;
};

struct model {
	int bands;
	enum lobe_kind lobe;
	struct materials material;
	struct surfaces surface;
	struct lights light;
	size_t cameras;
	struct camera *camera;

	size_t vertices;
	double *vertex;           /* [vertices][3] world, metres */

	size_t triangles;         /* input triangles, cleaned and cut where others touch */
	uint32_t *triangle;       /* [triangles][3] vertices, counter-clockwise
	                             seen from the front */
	uint32_t *triangle_surface;
	float *triangle_uv;       /* [triangles][3][2] TEXCOORD_0, 0 if none */
	float *triangle_normal;   /* [triangles][3][3] shading normals, 0 if none */
	int32_t *triangle_split;  /* root: >= 0 a split, else ~element */
	size_t splits;
	struct split *split;

	size_t elements;
	uint32_t *element;        /* [elements][3] vertices, winding kept */
	uint32_t *element_triangle;
	double *element_area;     /* derived, m^2 */
	double *element_normal;   /* derived, [elements][3] unit front normals */
	uint32_t *element_patch;  /* derived */

	size_t patches;
	uint32_t *patch_start;    /* [patches+1] first element: elements of a patch
	                             are contiguous */
	uint32_t *patch_surface;
	double *patch_area;       /* derived */
	/* Outline loops of planar patches (empty for curved ones), the outer loop
	 * first, wound like the elements. */
	uint64_t *patch_loop;     /* [patches+1] first loop */
	size_t loops;
	uint64_t *loop_start;     /* [loops+1] first index */
	size_t loop_indices;
	uint32_t *loop_index;     /* vertices */
};

/* Material of an element or patch. */
static inline uint32_t model_patch_material(const struct model *m, uint32_t patch)
{
	return m->surface.material[m->patch_surface[patch]];
}

/* The element of input triangle `tri` that holds the point with barycentric
 * weights w (of the triangle's three corners, summing to 1). On return w are
 * the weights of the element's own corners. O(depth of the split tree). */
uint32_t model_locate(const struct model *m, uint32_t tri, double w[3]);

/* Fills the derived arrays (areas, normals, element_patch, flux of lights) from the
 * others, allocating them. 0, or -1 and e. O(elements + triangles). */
int model_derive(struct model *m, struct err *e);

/* 1 if the side of a patch is modelled (front, or back of a two-sided material). */
static inline int model_side_modelled(const struct model *m, uint32_t patch_side)
{
	return !(patch_side & 1) ||
	       !m->material.one_sided[model_patch_material(m, patch_side >> 1)];
}

/* Allocates all arrays of n materials with `bands` bands (zero coefficients,
 * exponents infinite, emission exponents 1). 0, or -1 and e. */
int materials_new(struct materials *mt, size_t n, int bands, struct err *e);

/* Allocates all arrays of n lights with `bands` bands but the derived ones, zeroed.
 * 0, or -1 and e. */
int lights_new(struct lights *l, size_t n, int bands, struct err *e);

/* Index into rho_d and its like. */
static inline size_t material_at(const struct materials *mt, size_t m, int side)
{
	return (2 * m + (size_t)side) * (size_t)mt->bands;
}

/* A source of light is a patch-side, or, numbered behind these, a punctual light. */
static inline uint32_t model_sources(const struct model *m)
{
	return (uint32_t)(2 * m->patches + m->light.n);
}

/* The box of all vertices that triangles use. */
void model_box(const struct model *m, double lo[3], double hi[3]);

void materials_free(struct materials *mt);
void lights_free(struct lights *l);
void model_free(struct model *m);

#endif
