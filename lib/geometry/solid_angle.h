/* Directions within a triangle as a point sees it. */
#ifndef TWOPASS_SOLID_ANGLE_H
#define TWOPASS_SOLID_ANGLE_H

/* The solid angle of a triangle v[3][3] from x, sr; 0 to 2 pi, either way round (van Oosterom and
 * Strackee 1983). */
double geo_solid_angle(const double *v, const double x[3]);

/* A unit direction from x to the triangle, uniform by solid angle `angle` (> 0), from two
 * numbers in [0,1) (Arvo 1995, Stratified sampling of spherical triangles). */
void geo_solid_angle_sample(const double *v, const double x[3], double angle,
                            const double u[2], double dir[3]);

#endif
