#include "lib/view/aimed_ray.h"

#include <math.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/scatter/bsdf.h"
#include "lib/view/surface_point.h"

int view_aimed(struct view_walker *w, const struct view_branch *from, const double dir[3],
               uint32_t image, double *value)
{
	const struct emitter_images *s = &w->v->images;
	int32_t chain = 0, wanted = (int32_t)(image / s->emitters.n);
	double at[3], to[3], l[BANDS_MAX];
	struct view_point p;

	memcpy(at, from->org, sizeof at);
	memcpy(to, dir, sizeof to);
	for (int events = 0; from->depth + events <= w->o->depth; events++) {
		if (!view_see(w->v, at, to, 0, &p, &w->rays))
			return 0;
		const struct view_side *side = view_side_at(w->v, &p);
		double out[3] = { -to[0], -to[1], -to[2] };
		if (chain == wanted &&
		    s->of[2 * p.element + (uint32_t)p.side] == image % s->emitters.n) {
			bsdf_emission(w->v->m, p.material, p.n, out, l);
			for (int i = 0; i < w->v->m->bands; i++)
				value[i] *= l[i];
			return events ? VIEW_AIMED_ROUND : VIEW_AIMED_STRAIGHT;
		}
		view_locate(w->v, &p);
		int plane = chain == wanted ? -1 : aim_images_plane(s, p.material, p.side, p.n, p.x);
		int32_t next = chain == wanted ? -1 : aim_images_next(s, chain, wanted);
		int turns = plane >= 0 && s->turn[(size_t)chain * s->mirrors.n + (size_t)plane] == next;
		const struct view_lobe *way = turns ? &side->reflected : &side->transmitted;
		if (!way->coefficient || !isinf(way->k))
			return 0;
		if (turns) {
			chain = next;
			v3_mad(to, -2 * v3_dot(to, p.n), p.n, to);
		}
		for (int i = 0; i < w->v->m->bands; i++)
			value[i] *= way->coefficient[i];
		view_leave(w->v, &p, turns ? p.side : !p.side, at);
	}
	return 0;
}
