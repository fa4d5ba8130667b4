/* Punctual lights as KHR_lights_punctual defines them: points and spots of some luminous
 * intensity, and directional lights, infinitely far away.
 *
 * A light of intensity 1 gives the irradiance falloff / distance^2 across its rays: 1 on
 * the axis of a spot at the distance 1, and anywhere for a directional light. Surfaces
 * that face it get that times the cosine. The extension's `range` is not modelled: a light
 * that ends at some distance would lose flux on the way. */
#ifndef TWOPASS_PUNCTUAL_H
#define TWOPASS_PUNCTUAL_H

#include "lib/base/err.h"
#include "lib/data/model.h"

/* A light as a point sees it. */
struct light_sample {
	double toward[3];    /* unit vector to the light */
	double to[3];        /* a shadow ray's end: just before the light, or beyond the scene */
	double across;       /* irradiance across the rays on the axis, of intensity 1 */
	double falloff;      /* of the direction: 0 outside a spot's cone, else up to 1 */
};

/* Fills unit_flux and box: the flux of a point is 4 pi, that of a spot
 * 2 pi (1 - cos inner + (cos inner - cos outer) / 3), that of a directional light goes
 * through the shadow of the scene's bounding box across the light, m^2.
 * O(triangles + lights). 0, or -1 and e. */
int model_lights_derive(struct model *m, struct err *e);

/* How a point sees a light, if nothing is between; the falloff between a spot's cones is
 * the extension's ((cos - cos outer) / (cos inner - cos outer))^2; `clear` is how far before
 * the light a ray ends (ray_offset). */
void model_light_see(const struct lights *l, size_t light, const double x[3], double clear,
                     struct light_sample *s);

/* A ray of the light from three numbers in [0,1): all carry the same flux. */
void model_light_ray(const struct lights *l, size_t light, const double u[3], double clear,
                     double org[3], double dir[3]);

/* Flux of a light in a band. */
static inline double model_light_flux(const struct model *m, size_t light, int band)
{
	return m->light.unit_flux[light] *
	       m->light.intensity[light * (size_t)m->bands + (size_t)band];
}

#endif
