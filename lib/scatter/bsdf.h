/* The one scattering model (thin two-sided surfaces) that every pass uses.
 *
 * All directions are unit vectors that point AWAY from the surface; n is the
 * front normal. Coefficients are those of the side wi lies on: wi is where the
 * light comes from, wo where it goes, whichever of them a caller knows first.
 * The side of a direction w is FRONT where n.w > 0.
 *
 *   f(wi -> wo) = rho_d / pi + rho_s p(wi -> wo)    wo on the side of wi,
 *                 tau_d / pi + tau_s p(wi -> wo)    wo on the other side;
 * the lobe p of exponent k (alpha of rho_s, beta of tau_s), gamma the angle of wo to the axis,
 * R = 2 (n.wi) n - wi of rho_s, T = -wi of tau_s, theta the angles of wi and wo to the normal:
 *   LOBE_PAPER       p = cos^k gamma / (N_k(theta_i) cos theta_o), its flux per solid angle as in
 *                    eq. (3) of the paper, scaled to keep all energy (N_k: lobe.h)
 *   LOBE_RECIPROCAL  p = (k+1) / (2 pi) cos^k gamma / max(cos theta_i, cos theta_o)
 *                    (Neumann, Neumann & Szirmay-Kalos 1999)
 * and where k is infinite p is a delta at the axis. With this f, eq. (1) of the paper is
 *   L(wo) = L_e(wo) + integral over wi of f(wi -> wo) L(wi) cos theta_i dwi,
 * and eq. (2) its part by rho_d and tau_d. lib/README.md says where we differ from the paper. */
#ifndef TWOPASS_BSDF_H
#define TWOPASS_BSDF_H

#include "lib/data/model.h"

enum bsdf_event {
	BSDF_ABSORBED = 0,
	BSDF_DIFFUSE_R, BSDF_DIFFUSE_T, /* Lambertian, same side and other side */
	BSDF_LOBE_R, BSDF_LOBE_T,       /* finite exponent */
	BSDF_IDEAL_R, BSDF_IDEAL_T      /* infinite exponent: a delta */
};

/* Which end of the path is being extended. */
enum bsdf_transport {
	BSDF_FROM_LIGHT, /* wi known, wo sampled: particles */
	BSDF_FROM_EYE    /* wo known, wi sampled: camera paths */
};

struct bsdf_sample {
	enum bsdf_event event;
	double w[3];               /* the direction found */
	double weight[BANDS_MAX];  /* f |cos| / pdf: |cos theta_o| for BSDF_FROM_LIGHT,
	                              |cos theta_i| for BSDF_FROM_EYE; for a delta its
	                              coefficient over its probability */
	double pdf;                /* solid-angle density of w summed over all non-delta
	                              events that can produce it; 0 for a delta */
};

/* f(wi -> wo) per band [1/sr] of the diffuse part and the finite lobes (deltas
 * are 0), into f[bands]. */
void bsdf_eval(const struct model *m, size_t material, const double n[3],
               const double wi[3], const double wo[3], double *f);

/* The same of the finite lobes alone. */
void bsdf_eval_lobes(const struct model *m, size_t material, const double n[3],
                     const double wi[3], const double wo[3], double *f);

/* Samples the unknown direction given the known one. u: three uniforms in
 * [0,1), u[0] chooses the event. event BSDF_ABSORBED means the path ends (also
 * when nothing scatters, or a reciprocal lobe's sample fell below the horizon).
 * Energy: FROM_LIGHT the mean weight is the albedo of the side wi lies on. */
void bsdf_sample(const struct model *m, size_t material, const double n[3],
                 const double known[3], enum bsdf_transport transport,
                 const double u[3], struct bsdf_sample *out);

/* Density with which bsdf_sample finds w (non-delta events only). */
double bsdf_pdf(const struct model *m, size_t material, const double n[3],
                const double known[3], enum bsdf_transport transport, const double w[3]);

/* Radiance L cos^(m-1) emitted into w by the side w lies on, into l[bands]. */
void bsdf_emission(const struct model *m, size_t material, const double n[3],
                   const double w[3], double *l);

/* Exitance E = 2 pi L / (m+1) of a side [flux per area], band b. */
double bsdf_exitance(const struct materials *mt, size_t material, int side, int band);

/* rho_d + tau_d + rho_s + tau_s of a side, band b. */
double bsdf_albedo(const struct materials *mt, size_t material, int side, int band);

/* 1 if rho_s (or tau_s) of the side is non-zero in some band and its exponent is
 * finite / infinite. */
int bsdf_has_lobe(const struct materials *mt, size_t material, int side, int transmitted);
int bsdf_has_ideal(const struct materials *mt, size_t material, int side, int transmitted);

/* 1 if any material is a clear pane, for light that comes to either side. */
int bsdf_any_pane(const struct materials *mt);

/* 1 if the side emits in some band; black backs do not. */
int bsdf_emits(const struct materials *mt, size_t material, int side);

#endif
