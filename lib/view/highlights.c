#include "lib/view/highlights.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/data/punctual.h"

void view_highlights(const struct view_scene *v, const struct aim_lobe *lobe, double *l,
                     uint64_t *rays)
{
	const struct lights *lights = &v->ways.images.l;
	const struct aim_lobe_weight weight = { lobe, v->m->lobe };
	size_t bands = (size_t)v->m->bands;
	double f[BANDS_MAX], from[3];

	memset(l, 0, bands * sizeof *l);
	for (size_t i = 0; i < lights->n; i++) {
		struct light_sample s;
		model_light_see(lights, i, lobe->x, ray_offset(v->rays), &s);
		double e = s.across * s.falloff;
		if (!(e > 0) || !((e *= aim_lobe_weight_at(s.toward, &weight)) > 0))
			continue;
		for (size_t b = 0; b < bands; b++)
			f[b] = e * lights->intensity[i * bands + b];
		memcpy(from, lobe->x, sizeof from);
		ray_leave(v->rays, lobe->normal, from);
		if (!ray_light_visibility(&v->ways, i, from, &s, f, rays))
			continue;
		for (size_t b = 0; b < bands; b++)
			l[b] += f[b];
	}
}
