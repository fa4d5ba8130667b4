#include "lib/occlusion/exchange.h"

#include <math.h>

#include "lib/base/replicates.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"

void occ_exchanger_init(struct exchanger *x, const struct exchange_options *o,
                        const struct occluder_set *occluders, struct ray_scene *rays,
                        const double centre[3])
{
	*x = (struct exchanger){ .o = *o, .occluders = occluders, .rays = rays, .centre = centre };
	x->shaft.most = o->occluders < SHAFT_OCCLUDERS ? o->occluders : SHAFT_OCCLUDERS;
	geo_unoccluded_init(&x->unoccluded, o->relative);
}

void occ_exchanger_free(struct exchanger *x)
{
	occ_occluded_free(&x->occluded);
}

/* ---- too many occluders between: rays between points of both ---- */

static double crowded(struct exchanger *x, const struct facet *a, const struct facet *b,
                      double unoccluded, uint64_t seed, double *error)
{
	double part[REPLICATES];
	uint32_t rays = (uint32_t)x->o.crowd_rays;

	for (uint32_t p = 0; p < REPLICATES; p++) {
		double visible = 0, all = 0;
		for (uint32_t i = 0; i < rays / REPLICATES; i++) {
			double u[4], y[3], z[3], d[3];
			for (int k = 0; k < 4; k++)
				u[k] = rng_sobol(i, k, seed + p);
			geo_facet_point(a, u[0], u[1], y);
			geo_facet_point(b, u[2], u[3], z);
			v3_sub(z, y, d);
			double r2 = v3_dot(d, d);
			double w = fmax(0, v3_dot(d, a->normal)) * fmax(0, -v3_dot(d, b->normal)) /
			           (r2 * r2);
			v3_mad(y, 1, x->centre, y);
			v3_mad(z, 1, x->centre, z);
			ray_leave(x->rays, a->normal, y);
			ray_leave(x->rays, b->normal, z);
			all += w;
			visible += w > 0 && !ray_blocked(x->rays, y, z) ? w : 0;
		}
		part[p] = all > 0 ? visible / all : 0;
	}
	/* One ray more: parts that agree by chance are no proof. */
	struct replicates r = replicates_of(part, 1, REPLICATES);
	*error = unoccluded * (replicates_error(r, REPLICATES) + 1. / rays);
	return unoccluded * r.mean;
}

/* ---- a pair ---- */

/* The part of a facet in front of another's plane; *points are dropped where it is cut. */
static const struct facet *front_part(const struct facet *f, const struct facet *of, double near,
                                      struct facet_room *room, struct unoccluded_points *points)
{
	const struct facet *part = occ_facet_front(f, of, near, room);

	if (part == &room->f)
		*points = (struct unoccluded_points){ NULL, NULL };
	return part;
}

/* Can nothing be between, and is each wholly in front of the other? What most pairs of a
 * convex scene are. */
static int plainly_unoccluded(const struct exchanger *x, const struct facet *a,
                              const struct facet *b)
{
	return !x->occluders->nodes && v3_dot(b->normal, a->centre) - b->offset >= a->radius &&
	       v3_dot(a->normal, b->centre) - a->offset >= b->radius;
}

static double unoccluded_pair(struct exchanger *x, const struct facet *a,
                              struct unoccluded_points pa, const struct facet *b,
                              struct unoccluded_points pb, double *error)
{
	double unoccluded = geo_unoccluded_exchange(&x->unoccluded, a, pa, b, pb);

	*error = x->o.relative * unoccluded;
	x->counts.unoccluded++;
	return unoccluded;
}

static double any_pair(struct exchanger *x, const struct facet_set *sa, uint32_t i,
                       const struct facet_set *sb, uint32_t j, double *error, struct err *e)
{
	struct unoccluded_points pa = { sa->stored[i], &sa->pair[i] };
	struct unoccluded_points pb = { sb->stored[j], &sb->pair[j] };
	struct facet_room room[2];
	double near = x->occluders->near;
	const struct facet *fa = &sa->facet[i], *fb = &sb->facet[j];
	const struct facet *a = front_part(fa, fb, near, &room[0], &pa);
	const struct facet *b = a ? front_part(fb, fa, near, &room[1], &pb) : NULL;

	*error = 0;
	if (!b)
		return 0;
	x->counts.pairs++;
	enum shaft_state state = occ_shaft_cull(&x->shaft, x->occluders, a, b);
	if (state == SHAFT_HIDDEN) {
		x->counts.hidden++;
		return 0;
	}
	if (state == SHAFT_PARTLY) {
		double before = x->occluded.visible.evaluations;
		double tolerance = x->o.absolute * fmin(fa->area, fb->area);
		double sum = occ_occluded_exchange(&x->occluded, &x->unoccluded, &x->shaft,
		                                   tolerance, x->o.most, error, e);
		x->counts.partly++;
		x->counts.evaluations += x->occluded.visible.evaluations - before;
		return sum;
	}
	if (state == SHAFT_CROWDED && !x->o.crowd_rays) {
		x->counts.crowded++;
		return 0;
	}
	if (state == SHAFT_UNOCCLUDED)
		return unoccluded_pair(x, a, pa, b, pb, error);
	double unoccluded = geo_unoccluded_exchange(&x->unoccluded, a, pa, b, pb);
	x->counts.crowded++;
	return crowded(x, a, b, unoccluded, ((uint64_t)i << 32) ^ j, error);
}

double occ_exchange(struct exchanger *x, const struct facet_set *sa, uint32_t i,
                    const struct facet_set *sb, uint32_t j, double *error, struct err *e)
{
	const struct facet *a = &sa->facet[i], *b = &sb->facet[j];

	if (!plainly_unoccluded(x, a, b))
		return any_pair(x, sa, i, sb, j, error, e);
	x->counts.pairs++;
	return unoccluded_pair(x, a, (struct unoccluded_points){ sa->stored[i], &sa->pair[i] },
	                  b, (struct unoccluded_points){ sb->stored[j], &sb->pair[j] }, error);
}
