#include "lib/view/emitter_images.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/occlusion/facet_set.h"
#include "lib/scatter/bsdf.h"
#include "lib/scatter/lobe.h"
#include "lib/view/lobe_weight.h"

/* Tolerances that float32 positions need, relative to the radius of the emitter: of what is not
 * behind a mirror, and of an element in the plane of an emitter; and the cosine of 1.4e-3
 * radians, up to which two planes face the same way. Guesses. */
static const double behind = 1e-6, in_plane = 1e-5, same_way = 1 - 1e-6;

/* Cosines are no less: a density at grazing angles is large but finite. */
static const double cosine_least = 1e-9;

/* ---- images ---- */

/* What a mirror makes of a facet; none if that is behind it. */
static void turn(const struct facet *f, const struct mirror_plane *k, const double centre[3],
                 double *corner, struct facet *to)
{
	double offset = k->offset - v3_dot(k->n, centre), lowest, highest;

	geo_facet_heights(f, k->n, offset, &lowest, &highest);
	if (highest <= behind * f->radius)
		return;
	for (int i = 0; i < f->n; i++) { /* the other way round, so that its front sends */
		const double *x = &f->v[3 * (f->n - 1 - i)];
		v3_mad(x, 2 * (offset - v3_dot(k->n, x)), k->n, &corner[3 * i]);
	}
	to->n = f->n;
	to->v = corner;
	geo_facet_measure(to);
}

static int make_images(struct emitter_images *s, const struct model *m, struct err *e)
{
	size_t emitters = s->emitters.n, used = 0;

	s->n = emitters * (s->mirrors.n + 1);
	s->image = mem_new(s->n, sizeof *s->image, "images of emitters", e);
	s->corner = mem_new(s->n, 3 * FACET_CORNERS * sizeof *s->corner, "images of emitters", e);
	if (!s->image || !s->corner)
		return -1;
	for (size_t i = 0; i < emitters; i++) {
		if (bsdf_any_pane(&m->material))
			s->image[i] = s->emitters.emitter[i].f;
		for (size_t k = 0; k < s->mirrors.n; k++, used += 3 * FACET_CORNERS)
			turn(&s->emitters.emitter[i].f, &s->mirrors.plane[k], s->centre,
			     s->corner + used, &s->image[(k + 1) * emitters + i]);
	}
	return 0;
}

/* 1 if a point in the plane of a facet is in it. */
static int inside(const struct facet *f, const double x[3])
{
	for (int i = 0; i < f->n; i++) {
		const double *a = &f->v[3 * i], *b = &f->v[3 * ((i + 1) % f->n)];
		double along[3], to[3], c[3];
		v3_sub(b, a, along);
		v3_sub(x, a, to);
		v3_cross(along, to, c);
		if (v3_dot(c, f->normal) < 0)
			return 0;
	}
	return 1;
}

/* The emitter that an element-side is part of. */
static uint32_t emitter_of(const struct emitter_images *s, const struct model *m, size_t element,
                           int side)
{
	const double *n = &m->element.normal[3 * element];
	double x[3] = { -s->centre[0], -s->centre[1], -s->centre[2] };

	for (size_t k = 0; k < 3; k++)
		v3_mad(x, 1. / 3, &m->vertex[3 * (size_t)m->element.corner[3 * element + k]], x);
	for (size_t i = 0; i < s->emitters.n; i++) {
		const struct facet *f = &s->emitters.emitter[i].f;
		if ((side == FRONT ? 1 : -1) * v3_dot(n, f->normal) > same_way &&
		    fabs(v3_dot(x, f->normal) - f->offset) < in_plane * f->radius && inside(f, x))
			return (uint32_t)i;
	}
	return UINT32_MAX;
}

int view_emitter_images_init(struct emitter_images *s, const struct model *m, struct err *e)
{
	*s = (struct emitter_images){ .n = 0 };
	occ_facet_centre(m, s->centre);
	if (occ_emitters_init(&s->emitters, m, e) || ray_mirrors_find(m, &s->mirrors, e))
		return -1;
	if (s->emitters.n > VIEW_EMITTERS_MOST || s->mirrors.n > VIEW_MIRRORS_MOST ||
	    (s->mirrors.n == 0 && !bsdf_any_pane(&m->material)))
		return 0;
	s->of = mem_new(m->element.n, 2 * sizeof *s->of, "images of emitters", e);
	if (!s->of || make_images(s, m, e))
		return -1;
	for (size_t i = 0; i < 2 * m->element.n; i++) {
		uint32_t material = model_patch_material(m, m->element.patch[i / 2]);
		int side = (int)(i % 2);
		s->of[i] = bsdf_emits(&m->material, material, side) ? emitter_of(s, m, i / 2, side)
		                                                    : UINT32_MAX;
	}
	return 0;
}

void view_emitter_images_free(struct emitter_images *s)
{
	occ_emitters_free(&s->emitters);
	ray_mirrors_free(&s->mirrors);
	free(s->image);
	free(s->corner);
	free(s->of);
}

int view_emitter_images_plane(const struct emitter_images *s, uint32_t material, int side,
                              const double n[3], const double x[3])
{
	double out[3];

	for (int k = 0; k < 3; k++)
		out[k] = side == FRONT ? n[k] : -n[k];
	for (size_t i = 0; i < s->mirrors.n; i++)
		if (ray_mirror_has(&s->mirrors, &s->mirrors.plane[i], material, side, out, x))
			return (int)i;
	return -1;
}

/* ---- aiming ---- */

/* About the radiance that a lobe makes of an image, if nothing is in the way: that of where
 * the image is closest to the axis. Never 0 where the lobe has anything to speak of. */
static double guess(const struct emitter_images *s, size_t i, const struct view_lobe_seen *l,
                    const double x[3])
{
	const struct facet *f = &s->image[i];
	const struct emitter *t = &s->emitters.emitter[i % s->emitters.n];
	double d[3];

	if (f->n == 0)
		return 0;
	double there = v3_dot(f->normal, x) - f->offset;
	if (there <= 0)
		return 0;
	v3_sub(f->centre, x, d);
	double r2 = v3_dot(d, d), near = fmax(r2, f->radius * f->radius), r = sqrt(near);
	if (v3_dot(l->normal, d) + f->radius <= 0)
		return 0;
	double off =
	    acos(fmax(-1, fmin(1, v3_dot(l->axis, d) / sqrt(r2)))) - asin(fmin(1, f->radius / r));
	double power = bsdf_lobe_power(l->k, cos(fmax(0, off)));
	double part = (l->k + 1) * fmin(t->f.area / near, 1);
	return t->power / t->f.area * fmin(1, there / r) * fmin(part, 1) * power;
}

void view_emitter_images_choose(const struct emitter_images *s, const struct view_lobe_seen *l,
                                double enough, struct view_aim *a)
{
	a->sum = 0;
	v3_sub(l->x, s->centre, a->x);
	for (size_t i = 0; i < s->n; i++) {
		a->guess[i] = 0;
		if (i >= s->emitters.n) {
			const struct mirror_plane *k = &s->mirrors.plane[i / s->emitters.n - 1];
			if (v3_dot(k->n, l->x) <= k->offset)
				continue;
		}
		a->guess[i] = guess(s, i, l, a->x);
		a->sum += a->guess[i];
	}
	if (a->sum < enough)
		a->sum = 0;
}

double view_emitter_images_density(const struct emitter_images *s, const struct view_aim *a,
                                   size_t image, double way, double cosine)
{
	return a->guess[image] / a->sum * way * way /
	       (fmax(cosine, cosine_least) * s->image[image].area);
}

double view_emitter_images_aim(const struct emitter_images *s, const struct view_aim *a,
                               const double u[3], double dir[3], uint32_t *image)
{
	double at = u[0] * a->sum, y[3];
	size_t i = 0, last = 0;

	for (; i < s->n; i++) {
		if (!(a->guess[i] > 0))
			continue;
		last = i;
		if (at < a->guess[i])
			break;
		at -= a->guess[i];
	}
	*image = (uint32_t)last;
	geo_facet_point(&s->image[last], u[1], u[2], y);
	v3_sub(y, a->x, dir);
	double way = v3_normalise(dir), cosine = -v3_dot(dir, s->image[last].normal);
	return cosine > 0 ? view_emitter_images_density(s, a, last, way, cosine) : 0;
}
