/* Hemicubes: what a point of a surface sees, by an item buffer drawn on the CPU
 * (Cohen & Greenberg, SIGGRAPH 1985).
 *
 * The cube's frame is (t, b, n), n the normal of the side that looks out: face 0
 * is the top (towards n), faces 1 to 4 the upper halves towards +t, -t, +b, -b.
 * Face 0 has n rows of n pixels, the others n/2 rows, the lowest on the horizon;
 * pixels are numbered face by face, row by row, 3 n^2 in all.
 *
 * hemicube_grid and hemicube_scene are read-only and shared by all threads; a struct
 * hemicube belongs to one thread. */
#ifndef TWOPASS_HEMICUBE_H
#define TWOPASS_HEMICUBE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/err.h"
#include "lib/data/model.h"
#include "lib/ray/locate.h"

#define HEMICUBE_VOID 0xffffffffu  /* a pixel that sees nothing; no element */
/* Pixels along an edge, at most: so that numbers of pixels fit 32 bits and an item buffer memory. */
enum { HEMICUBE_N_MAX = 8192 };

/* What depends on the resolution alone. */
struct hemicube_grid {
	int n;                /* resolution of the top face, even */
	size_t pixels;        /* 3 n^2 */
	double *delta;        /* [pixels] form factor of a pixel, the exact integral of
	                         cos(theta) dw / pi over it; they sum to 1 */
	double *solid_angle;  /* [pixels] exact; they sum to 2 pi */
	double *direction;    /* [pixels][3] unit, through the pixel's centre */
};

/* Tables for an even resolution 2 <= n <= HEMICUBE_N_MAX. 0, or -1 and e. O(n^2). */
int ff_hemicube_grid_init(struct hemicube_grid *g, int n, struct err *e);
void ff_hemicube_grid_free(struct hemicube_grid *g);

/* The pixel that a direction of the upper hemisphere (any length but 0, cube's
 * frame) falls into. Directions below the horizon give its lowest row. O(1). */
size_t ff_hemicube_lookup(const struct hemicube_grid *g, const double direction[3]);

/* All elements of a model, arranged for drawing. */
struct hemicube_scene;

/* O(elements log elements). m and its locator must outlive it; without a locator (NULL)
 * elements are drawn, never input triangles. NULL and e on failure. */
struct hemicube_scene *ff_hemicube_scene_new(const struct model *m, const struct locator *locator,
                                             struct err *e);
void ff_hemicube_scene_free(struct hemicube_scene *s);

struct hemicube_work;

struct hemicube {
	const struct hemicube_grid *grid;
	uint32_t *item;          /* [pixels] element-side seen, or HEMICUBE_VOID */
	float *depth;            /* [pixels] 1 / distance along the face's axis, 0 where
	                            nothing is seen */
	struct hemicube_work *work;
};

/* Buffers for one thread; g must outlive them. 0, or -1 and e. */
int ff_hemicube_init(struct hemicube *h, const struct hemicube_grid *g, struct err *e);
void ff_hemicube_free(struct hemicube *h);

/* Draws all elements but `own` (HEMICUBE_VOID: all) as seen from eye into item and
 * depth. frame = { t, b, n }, orthonormal. Elements are seen from both sides;
 * the side recorded is the one that faces the eye. A pixel shows what its centre
 * sees; of equal depths the lowest number wins. Nothing in the horizon plane is
 * seen, and there is no near plane: whatever stands above the horizon plane by more
 * than the rounding of world coordinates blocks.
 * Where elements are many more than input triangles, and more than the pixels are
 * worth, the triangles are drawn (without own's) and each pixel's element is found
 * in them. O(elements + pixels), or O(triangles + pixels); what is
 * below the horizon or behind nearer things is passed over. No allocation. */
void ff_hemicube_render(struct hemicube *h, const struct hemicube_scene *s, const double eye[3],
                        const double frame[3][3], uint32_t own);

#endif
