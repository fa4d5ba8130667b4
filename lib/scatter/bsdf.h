/* The one scattering model (thin two-sided surfaces) that every pass uses.
 *
 * All directions are unit vectors that point AWAY from the surface; n is the
 * front normal. Coefficients are those of the side wi lies on: wi is where the
 * light comes from, wo where it goes, whichever of them a caller knows first.
 * The side of a direction w is FRONT where n.w > 0. */
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
