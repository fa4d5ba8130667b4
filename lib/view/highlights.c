#include "lib/view/highlights.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/data/punctual.h"
#include "lib/scatter/bsdf.h"

void view_highlights(const struct view_scene *v, uint32_t material, const double x[3],
                     const double n[3], const double out[3], double *l, uint64_t *rays)
{
	const struct model *m = v->m;
	const struct lights *lights = &v->ways.images.l;
	size_t bands = (size_t)m->bands;
	double f[BANDS_MAX], any, from[3], normal[3];

	memset(l, 0, bands * sizeof *l);
	for (size_t i = 0; i < lights->n; i++) {
		struct light_sample s;
		model_light_see(lights, i, x, ray_offset(v->rays), &s);
		double cosine = v3_dot(n, s.toward), e = fabs(cosine) * s.across * s.falloff;
		bsdf_eval_lobes(m, material, n, s.toward, out, f);
		any = 0;
		for (size_t b = 0; b < bands; b++) {
			f[b] *= e * lights->intensity[i * bands + b];
			any = fmax(any, f[b]);
		}
		if (!(any > 0))
			continue;
		for (int k = 0; k < 3; k++) {
			from[k] = x[k];
			normal[k] = cosine < 0 ? -n[k] : n[k];
		}
		ray_leave(v->rays, normal, from);
		if (!ray_light_visibility(&v->ways, i, from, &s, f, rays))
			continue;
		for (size_t b = 0; b < bands; b++)
			l[b] += f[b];
	}
}
