/* Private to the hemicube: triangles onto one face of the item buffer. */
#ifndef TWOPASS_HEMICUBE_RASTER_H
#define TWOPASS_HEMICUBE_RASTER_H

#include <stdint.h>

/* Triangles are clipped by a pyramid this many times as wide as the face: wide
 * enough that few need it. A guess. */
#define HEMICUBE_GUARD 4.

/* A face of one hemicube being drawn. */
struct hemicube_target {
	uint32_t *item;
	float *depth;
	int columns, rows;
	double half, pixel;   /* pixels per unit of u/w, and its inverse */
	double centre_row;    /* row coordinate of v = 0 */
	float *far;           /* tiles */
	int tiles;            /* in a row of them */
};

/* A vertex on a face: pixel coordinates, 1/w, and the first column and row whose
 * pixel centres are not before it. */
struct hemicube_corner {
	double x, y, q;
	int32_t column, row;
};

/* Draws a triangle, corners v in face coordinates (u, v, w), of which c are the
 * projections; the pyramid must hold it. */
void ff_hemicube_draw(const struct hemicube_target *t, double v[3][3], const struct hemicube_corner c[3],
                      uint32_t element);

/* Draws any triangle. */
void ff_hemicube_draw_clipped(const struct hemicube_target *t, double v[3][3], uint32_t element);

static inline double min_d(double a, double b)
{
	return a < b ? a : b;
}

static inline double max_d(double a, double b)
{
	return a > b ? a : b;
}

static inline int min_i(int a, int b)
{
	return a < b ? a : b;
}

static inline int max_i(int a, int b)
{
	return a > b ? a : b;
}

#endif
