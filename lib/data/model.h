/* The scene as every tool after `mesh` sees it: what a .mesh file holds. */
#ifndef TWOPASS_MODEL_H
#define TWOPASS_MODEL_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"

enum { FRONT = 0, BACK = 1 };

/* A count: a visible spectrum in steps of 10 nm is as many. It bounds arrays on stacks. A guess. */
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
	/* Derived: */
	double *unit_flux;        /* [n] flux of intensity 1 */
	double *cosine;           /* [n][2] of the cones */
	double box[2][3];         /* the least and largest coordinates of triangles */
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

/* Input triangles, cleaned and cut where others touch. */
struct triangles {
	size_t n;
	uint32_t *corner;         /* [n][3] vertices, counter-clockwise seen from the front */
	uint32_t *surface;        /* [n] */
	float *uv;                /* [n][3][2] TEXCOORD_0, 0 if none */
	float *normal;            /* [n][3][3] shading normals, 0 if none */
	int32_t *split;           /* [n] root: >= 0 a split, else ~element */
};

/* Elements receive light: parts of input triangles. */
struct elements {
	size_t n;
	uint32_t *corner;         /* [n][3] vertices, winding kept */
	uint32_t *triangle;       /* [n] the input triangle */
	/* Derived: */
	double *area;             /* [n] m^2 */
	double *normal;           /* [n][3] unit front normals */
	uint32_t *patch;          /* [n] */
};

/* Patches shoot light: connected elements of one surface, contiguous in `elements`. */
struct patches {
	size_t n;
	uint32_t *start;          /* [n+1] first element */
	uint32_t *surface;        /* [n] */
	/* Outline loops of planar patches (empty for curved ones), the outer loop
	 * first, wound like the elements. */
	uint64_t *loop;           /* [n+1] first loop */
	size_t loops;
	uint64_t *loop_start;     /* [loops+1] first index */
	size_t loop_indices;
	uint32_t *loop_index;     /* [loop_indices] vertices */
	/* Derived: */
	double *area;             /* [n] m^2 */
};

/* What is under "Derived" here is in no file: model_derive makes it from the rest. */
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

	struct triangles triangle;
	size_t splits;
	struct split *split;
	struct elements element;
	struct patches patch;
};

/* Material of an element or patch. */
static inline uint32_t model_patch_material(const struct model *m, uint32_t patch)
{
	return m->surface.material[m->patch.surface[patch]];
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

/* The same model, but that infinite exponents are PAPER_IDEAL: mirrors and panes are the narrowest
 * of lobes, as in the paper, which knows no others. All but the exponents stays m's, which must
 * outlive it. 0, or -1 and e; model_lobes_free either way, in place of model_free. */
#define PAPER_IDEAL 1e12
int model_ideal_as_lobes(const struct model *m, struct model *lobes, struct err *e);
void model_lobes_free(struct model *lobes);

/* Allocates all arrays of n materials with `bands` bands (zero coefficients,
 * exponents infinite, emission exponents 1). 0, or -1 and e. */
int model_materials_new(struct materials *mt, size_t n, int bands, struct err *e);

/* Allocates all arrays of n lights with `bands` bands but the derived ones, zeroed.
 * 0, or -1 and e. */
int model_lights_new(struct lights *l, size_t n, int bands, struct err *e);

/* Index into rho_d and its like. */
static inline size_t model_material_at(const struct materials *mt, size_t m, int side)
{
	return (2 * m + (size_t)side) * (size_t)mt->bands;
}

/* A source of light is a patch-side, or, numbered behind these, a punctual light. */
static inline uint32_t model_sources(const struct model *m)
{
	return (uint32_t)(2 * m->patch.n + m->light.n);
}

/* The box of all vertices that triangles use. */
void model_box(const struct model *m, double lo[3], double hi[3]);

void model_materials_free(struct materials *mt);
void model_lights_free(struct lights *l);
void model_free(struct model *m);

#endif
