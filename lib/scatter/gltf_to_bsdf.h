/* From glTF's metallic-roughness materials to the coefficients of the light model
 * (bsdf.h). Colours are linear RGB. */
#ifndef TWOPASS_GLTF_TO_BSDF_H
#define TWOPASS_GLTF_TO_BSDF_H

#include "lib/data/model.h"

/* Coefficients of one side. */
struct bsdf_side {
	double rho_d[BANDS_MAX], tau_d[BANDS_MAX], rho_s[BANDS_MAX], tau_s[BANDS_MAX];
	double alpha, beta; /* INFINITY = ideal */
};

/* glTF's parameters. Inputs outside [0,1] are clamped, but for ior and
 * specular_colour (any value >= 0). */
struct bsdf_gltf {
	double base[3];
	double opacity;              /* constant alpha of alphaMode BLEND, else 1 */
	double metallic, roughness;
	double transmission;
	double diffuse_transmission, diffuse_transmission_colour[3];
	double ior, specular, specular_colour[3];
};

/* The default material of glTF 2.0: white, metallic 1, roughness 1, ior 1.5. */
extern const struct bsdf_gltf bsdf_gltf_default;

/* What became of a directional part. */
enum bsdf_fate {
	BSDF_NONE,  /* there was none */
	BSDF_KEPT,
	BSDF_WEAK,  /* folded into the diffuse part: its share is too small */
	BSDF_WIDE,  /* folded: its exponent is too small */
	BSDF_PANE   /* folded: the exponent belongs to the pane of alphaMode BLEND */
};

struct bsdf_folding {
	enum bsdf_fate reflected, transmitted;
	double reflected_share, transmitted_share; /* of the summed albedo */
	double exponent;                           /* of both lobes before folding */
};

/* Three bands of one side (both sides are alike):
 *   rho_s = m c + (1-m) F0, tau_s = (1-m)(1-F0) t c,
 *   (1-m)(1-F0)(1-t) split into tau_d = d c_d and rho_d = (1-d) c,
 * all times the opacity a, plus an ideal tau_s of 1 - a. A lobe whose share of the
 * albedo, summed over the bands, is below min_directional, or whose exponent is
 * below min_exponent, becomes diffuse; the sum of the coefficients does not change. */
void bsdf_from_gltf(const struct bsdf_gltf *g, double min_directional,
                    double min_exponent, struct bsdf_side *out,
                    struct bsdf_folding *f);

/* rho_d + tau_d + rho_s + tau_s */
double bsdf_side_albedo(const struct bsdf_side *s, int band);

/* Scales a band's four coefficients to the albedo 1. */
void bsdf_side_rescale(struct bsdf_side *s, int band);

/* Exponents of coefficients that are 0 in all bands become INFINITY, so that
 * equal materials are equal numbers. */
void bsdf_side_normalise(struct bsdf_side *s, int bands);

/* 1 if any of the bands is transmitted. */
int bsdf_side_transmits(const struct bsdf_side *s, int bands);

/* Luminance of linear RGB with the primaries of sRGB (ITU-R BT.709). */
double bsdf_luminance(const double rgb[3]);

#endif
