#include "lib/scatter/gltf_to_bsdf.h"

#include <math.h>
#include <string.h>

enum { RGB = 3 };

const struct bsdf_gltf bsdf_gltf_default = {
	.base = { 1, 1, 1 },
	.opacity = 1,
	.metallic = 1,
	.roughness = 1,
	.diffuse_transmission_colour = { 1, 1, 1 },
	.ior = 1.5,
	.specular = 1,
	.specular_colour = { 1, 1, 1 },
};

static double unit(double x)
{
	return fmin(fmax(x, 0), 1);
}

/* Phong exponent about the mirror direction for a microfacet roughness r: the
 * half-vector exponent 2/r^4 - 2 of Beckmann width r^2 (Walter et al. 2007, with
 * glTF's alpha = r^2), a quarter of it about R, as the angle to R is about twice
 * the angle of the half vector to n (Phong against Blinn-Phong). 0 gives INFINITY. */
static double bsdf_lobe_exponent(double roughness)
{
	double r2 = unit(roughness) * unit(roughness);

	return (2 / (r2 * r2) - 2) / 4;
}

/* Reflectance at normal incidence: Fresnel against air, with the factor and
 * colour of KHR_materials_specular. */
static double dielectric_f0(const struct bsdf_gltf *g, int band)
{
	double q = (g->ior - 1) / (g->ior + 1);

	return unit(unit(q * q * g->specular_colour[band]) * unit(g->specular));
}

static void split(const struct bsdf_gltf *g, struct bsdf_side *s)
{
	double m = unit(g->metallic), t = unit(g->transmission);
	double d = unit(g->diffuse_transmission);

	for (int b = 0; b < RGB; b++) {
		double c = unit(g->base[b]), cd = unit(g->diffuse_transmission_colour[b]);
		double f0 = dielectric_f0(g, b);
		double inside = (1 - m) * (1 - f0), scattered = inside * (1 - t);
		s->rho_s[b] = unit(m * c + (1 - m) * f0);
		s->tau_s[b] = unit(inside * t * c);
		s->tau_d[b] = unit(scattered * d * cd);
		s->rho_d[b] = unit(scattered * (1 - d) * c);
	}
	s->alpha = s->beta = bsdf_lobe_exponent(g->roughness);
}

static double sum(const double *x, int bands)
{
	double total = 0;

	for (int b = 0; b < bands; b++)
		total += x[b];
	return total;
}

static enum bsdf_fate judge(double share, double exponent, double min_directional,
                            double min_exponent)
{
	if (!(share > 0))
		return BSDF_NONE;
	if (exponent < min_exponent)
		return BSDF_WIDE;
	return share < min_directional ? BSDF_WEAK : BSDF_KEPT;
}

static void fold(double *lobe, double *diffuse, enum bsdf_fate fate)
{
	if (fate == BSDF_KEPT || fate == BSDF_NONE)
		return;
	for (int b = 0; b < RGB; b++) {
		diffuse[b] += lobe[b];
		lobe[b] = 0;
	}
}

void bsdf_from_gltf(const struct bsdf_gltf *g, double min_directional,
                    double min_exponent, struct bsdf_side *s, struct bsdf_folding *f)
{
	double a = unit(g->opacity);
	double *part[] = { s->rho_d, s->tau_d, s->rho_s, s->tau_s };

	memset(s, 0, sizeof *s);
	split(g, s);
	for (int p = 0; p < 4; p++)
		for (int b = 0; b < RGB; b++)
			part[p][b] *= a;
	double total = RGB * (1 - a);
	for (int p = 0; p < 4; p++)
		total += sum(part[p], RGB);

	f->exponent = s->alpha;
	f->reflected_share = total > 0 ? sum(s->rho_s, RGB) / total : 0;
	f->transmitted_share = total > 0 ? sum(s->tau_s, RGB) / total : 0;
	f->reflected = judge(f->reflected_share, s->alpha, min_directional, min_exponent);
	f->transmitted = judge(f->transmitted_share, s->beta, min_directional, min_exponent);
	if (f->transmitted == BSDF_KEPT && a < 1 && !isinf(s->beta))
		f->transmitted = BSDF_PANE;
	fold(s->rho_s, s->rho_d, f->reflected);
	fold(s->tau_s, s->tau_d, f->transmitted);
	if (a < 1) {
		for (int b = 0; b < RGB; b++)
			s->tau_s[b] += 1 - a;
		s->beta = INFINITY;
	}
	bsdf_side_normalise(s, RGB);
}

double bsdf_side_albedo(const struct bsdf_side *s, int band)
{
	return s->rho_d[band] + s->tau_d[band] + s->rho_s[band] + s->tau_s[band];
}

void bsdf_side_rescale(struct bsdf_side *s, int band)
{
	double *part[] = { s->rho_d, s->tau_d, s->rho_s, s->tau_s };
	double scale = 1 / bsdf_side_albedo(s, band);

	for (int p = 0; p < 4; p++)
		part[p][band] *= scale;
}

void bsdf_side_normalise(struct bsdf_side *s, int bands)
{
	if (!(sum(s->rho_s, bands) > 0))
		s->alpha = INFINITY;
	if (!(sum(s->tau_s, bands) > 0))
		s->beta = INFINITY;
}

int bsdf_side_transmits(const struct bsdf_side *s, int bands)
{
	return sum(s->tau_d, bands) > 0 || sum(s->tau_s, bands) > 0;
}

double bsdf_luminance(const double rgb[3])
{
	return .2126 * rgb[0] + .7152 * rgb[1] + .0722 * rgb[2];
}
