/* Phong lobes: flux per solid angle proportional to cos^k gamma about an axis.
 *
 * Conventions: k >= 0 is the exponent, gamma the angle to the lobe's axis,
 * theta the angle of the axis to the normal of the side the lobe leaves,
 * directions below that side's horizon and gamma >= 90 degrees carry nothing. */
#ifndef TWOPASS_LOBE_H
#define TWOPASS_LOBE_H

#include "lib/data/model.h"

/* cos^k gamma; 0 for cos_gamma <= 0, any k >= 0. */
double bsdf_lobe_power(double k, double cos_gamma);

/* N_k(theta) = integral over the hemisphere of max(0, cos gamma)^k dw
 *            = 2 pi / (k+1) (1 - I(sin^2 theta; (k+1)/2, 1/2) / 2)
 * with I the regularised incomplete beta function. It follows from
 * dN/dtheta = -sin^k theta integral cos^(k+1), the rate at which the horizon
 * sweeps the lobe. Relative error below 1e-12, 0 <= cos_theta <= 1. */
double bsdf_lobe_normaliser(double k, double cos_theta);

/* a_k(theta): the part of rho_s that the reciprocal lobe (Neumann, Neumann &
 * Szirmay-Kalos 1999) returns for light incident at angle theta; 1 - a_k is
 * lost. Relative error below 1e-6. */
double bsdf_lobe_albedo(double k, double cos_theta);

/* A direction distributed as cos^k gamma / N_k over the side's hemisphere
 * (clipped at the horizon of unit normal n, by rejection). u[0], u[1] uniform
 * in [0,1) give the first try; further tries take numbers derived from them by
 * hashing, so the same u gives the same direction. */
void bsdf_lobe_sample(double k, const double axis[3], const double n[3], const double u[2],
                      double out[3]);

/* As bsdf_lobe_sample but not clipped: density (k+1)/(2 pi) cos^k gamma over the
 * hemisphere about the axis; out may lie below the horizon. */
void bsdf_lobe_sample_whole(double k, const double axis[3], const double u[2], double out[3]);

/* A direction in which a model's lobe sends light on that arrives along an axis at the
 * same angle to n as the axis has, and what part of it: the rest is lost (reciprocal
 * lobes; 0 below the horizon). */
double bsdf_lobe_scatter(enum lobe_kind kind, double k, const double axis[3], const double n[3],
                         const double u[2], double out[3]);

/* Cosine-weighted direction about the unit normal n (density cos/pi). */
void bsdf_sample_cosine(const double n[3], const double u[2], double out[3]);

/* R = 2 (n.l) n - l */
void bsdf_lobe_mirror(const double l[3], const double n[3], double out[3]);

#endif
