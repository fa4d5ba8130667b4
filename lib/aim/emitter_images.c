#include "lib/aim/emitter_images.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/occlusion/facet_set.h"
#include "lib/scatter/bsdf.h"
#include "lib/aim/lobe_weight.h"

/* Counts; guesses. Images take 0.2 kB each. */
enum { IMAGES_MOST = 1 << 15, ORDERS_MOST = 4 };

/* Chains that leave less than such a part of an emitter's light in all bands are left to the lobes'
 * samples: by one mirror, and by several, of which most look past one another, so that aiming
 * at all that they might show costs more than it finds. A window pane reflects .08. Guesses; on
 * scenes/two-pass.gltf chains of .07 by two made views noisier by 15 %. */
static const double least_part = .05, least_part_longer = .25;

/* Tolerances that float32 positions need, relative to the radius of the emitter: of what is not
 * behind a mirror, and of an element in the plane of an emitter; and the cosine of 1.4e-3
 * radians, up to which two planes face the same way. Guesses. */
static const double behind = 1e-6, in_plane = 1e-5, same_way = 1 - 1e-6;

/* Cosines are no less: a density at grazing angles is large but finite. */
static const double cosine_least = 1e-9;

/* ---- chains ---- */

/* A chain while they are listed. */
struct chain {
	uint32_t parent, plane;     /* its last mirror */
	int order;
	double part[BANDS_MAX];     /* of an emitter's light that is left */
};

/* 1 if some of a mirror's box is in front of another. */
static int in_front(const struct mirror_plane *p, const struct mirror_plane *of, double same)
{
	double most = -of->offset;

	for (int c = 0; c < 3; c++)
		most += fmax(of->n[c] * p->box[0][c], of->n[c] * p->box[1][c]);
	return most > same;
}

/* Chain c with one mirror more; 0 if light does not come that way, or little. */
static int longer(const struct emitter_images *s, const struct model *m, const struct chain *c,
                  uint32_t parent, uint32_t plane, struct chain *to)
{
	const struct mirror_plane *k = &s->mirrors.plane[plane];
	const struct mirror_plane *last = &s->mirrors.plane[c->plane];
	const double *rho = &m->material.rho_s[model_material_at(&m->material, k->material, k->side)];
	double most = 0;

	if (c->order == ORDERS_MOST ||
	    (c->order && (c->plane == plane || !in_front(k, last, s->mirrors.same) ||
	                  !in_front(last, k, s->mirrors.same))))
		return 0;
	*to = (struct chain){ .parent = parent, .plane = plane, .order = c->order + 1 };
	for (int b = 0; b < m->bands; b++)
		most = fmax(most, to->part[b] = c->part[b] * rho[b]);
	return most >= (c->order ? least_part_longer : least_part);
}

/* Chains, shortest first, as far as there is room for their images. */
static int list_chains(struct emitter_images *s, const struct model *m, struct array *list,
                       struct err *e)
{
	struct chain new = { .order = 0 };
	size_t most = s->emitters.n < IMAGES_MOST ? IMAGES_MOST / s->emitters.n : 1;

	for (int b = 0; b < m->bands; b++)
		new.part[b] = 1;
	if (mem_append(list, &new, 1, sizeof new, e))
		return -1;
	for (uint32_t c = 0; c < list->n; c++)
		for (uint32_t k = 0; k < s->mirrors.n && list->n < most; k++) {
			struct chain from = ((const struct chain *)list->data)[c];
			if (longer(s, m, &from, c, k, &new) &&
			    mem_append(list, &new, 1, sizeof new, e))
				return -1;
		}
	s->chains = list->n;
	return 0;
}

/* ---- images ---- */

/* What a mirror makes of a facet, in place; none if that is behind it. */
static void turn(struct facet *f, const struct mirror_plane *k, const double centre[3],
                 double *corner)
{
	double offset = k->offset - v3_dot(k->n, centre), lowest, highest;

	geo_facet_heights(f, k->n, offset, &lowest, &highest);
	if (highest <= behind * f->radius) {
		f->n = 0;
		return;
	}
	for (int i = 0; i < f->n; i++)
		v3_mad(&corner[3 * i], 2 * (offset - v3_dot(k->n, &corner[3 * i])), k->n,
		       &corner[3 * i]);
	for (int i = 0, j = f->n - 1; i < j; i++, j--) { /* so that its front sends */
		double x[3];
		memcpy(x, &corner[3 * i], sizeof x);
		memcpy(&corner[3 * i], &corner[3 * j], sizeof x);
		memcpy(&corner[3 * j], x, sizeof x);
	}
	geo_facet_measure(f);
}

/* The image of an emitter by a chain; its corners go to `corner`. */
static void make_image(const struct emitter_images *s, const struct chain *all, size_t chain,
                       const struct emitter *t, double *corner, struct facet *to)
{
	*to = t->f;
	if (!chain)
		return;
	memcpy(corner, t->f.v, 3 * (size_t)t->f.n * sizeof *corner);
	to->v = corner;
	for (size_t c = chain; c && to->n; c = all[c].parent)
		turn(to, &s->mirrors.plane[all[c].plane], s->centre, corner);
}

static int new_images(struct emitter_images *s, size_t corners, struct err *e)
{
	s->n = s->emitters.n * s->chains;
	s->image = mem_new(s->n, sizeof *s->image, "images of emitters", e);
	s->corner = mem_new((s->chains - 1) * corners, 3 * sizeof *s->corner, "images of emitters", e);
	s->turn = mem_new(s->chains * s->mirrors.n, sizeof *s->turn, "images of emitters", e);
	s->before = mem_new(s->chains, sizeof *s->before, "images of emitters", e);
	return s->image && s->corner && s->turn && s->before ? 0 : -1;
}

/* Trees of the images, by their power in the mean of the bands. */
static int make_trees(struct emitter_images *s, const struct model *m, const struct chain *all,
                      struct err *e)
{
	double *power = mem_new(s->n, sizeof *power, "images of emitters", e);

	for (size_t i = 0; power && i < s->n; i++) {
		const struct emitter *t = &s->emitters.emitter[i % s->emitters.n];
		for (int b = 0; b < m->bands && s->image[i].n; b++)
			power[i] += all[i / s->emitters.n].part[b] * t->radiance[b] * t->f.area / m->bands;
	}
	int bad = !power || aim_tree_init(&s->all, s->image, power, s->n, e);
	if (!bad) {
		memset(power, 0, s->emitters.n * sizeof *power);
		bad = aim_tree_init(&s->turned, s->image, power, s->n, e);
	}
	free(power);
	return bad ? -1 : 0;
}

static int make_images(struct emitter_images *s, const struct model *m, struct err *e)
{
	struct array list = { 0 };
	size_t corners = 0, used = 0;

	for (size_t i = 0; i < s->emitters.n; i++)
		corners += (size_t)s->emitters.emitter[i].f.n;
	int bad = list_chains(s, m, &list, e) || new_images(s, corners, e);
	const struct chain *all = list.data;
	for (size_t i = 0; !bad && i < s->n; i++) {
		const struct emitter *t = &s->emitters.emitter[i % s->emitters.n];
		make_image(s, all, i / s->emitters.n, t, s->corner + used, &s->image[i]);
		used += i < s->emitters.n ? 0 : 3 * (size_t)t->f.n;
	}
	for (size_t i = 0; !bad && i < s->chains * s->mirrors.n; i++)
		s->turn[i] = -1;
	for (size_t c = 1; !bad && c < s->chains; c++) {
		s->turn[all[c].parent * s->mirrors.n + all[c].plane] = (int32_t)c;
		s->before[c] = all[c].parent;
	}
	if (!bad)
		bad = make_trees(s, m, all, e);
	free(list.data);
	return bad ? -1 : 0;
}

/* ---- emitters of elements ---- */

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

/* The emitter that a point on a side that faces along n is on. */
struct sought {
	const struct emitter_images *s;
	double x[3], n[3];
	uint32_t found;
};

static int is_emitter(uint32_t light, void *arg)
{
	struct sought *o = arg;
	const struct facet *f = &o->s->image[light];

	if (light >= o->s->emitters.n || v3_dot(o->n, f->normal) <= same_way ||
	    fabs(v3_dot(o->x, f->normal) - f->offset) >= in_plane * f->radius || !inside(f, o->x))
		return 0;
	o->found = light;
	return 1;
}

static uint32_t emitter_of(const struct emitter_images *s, const struct model *m, size_t element,
                           int side)
{
	struct sought o = { .s = s, .found = UINT32_MAX };

	for (size_t k = 0; k < 3; k++) {
		o.x[k] = -s->centre[k];
		o.n[k] = (side == FRONT ? 1 : -1) * m->element.normal[3 * element + k];
	}
	for (size_t k = 0; k < 3; k++)
		v3_mad(o.x, 1. / 3, &m->vertex[3 * (size_t)m->element.corner[3 * element + k]], o.x);
	aim_tree_at(&s->all, o.x, in_plane, is_emitter, &o);
	return o.found;
}

int aim_images_init(struct emitter_images *s, const struct model *m, struct err *e)
{
	*s = (struct emitter_images){ .n = 0 };
	occ_facet_centre(m, s->centre);
	s->panes = bsdf_any_pane(&m->material);
	if (occ_emitters_init(&s->emitters, m, e) || ray_mirrors_find(m, &s->mirrors, e))
		return -1;
	if (s->emitters.n == 0)
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

void aim_images_free(struct emitter_images *s)
{
	occ_emitters_free(&s->emitters);
	ray_mirrors_free(&s->mirrors);
	aim_tree_free(&s->all);
	aim_tree_free(&s->turned);
	free(s->image);
	free(s->corner);
	free(s->turn);
	free(s->before);
	free(s->of);
}

int aim_images_plane(const struct emitter_images *s, uint32_t material, int side,
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

int32_t aim_images_next(const struct emitter_images *s, int32_t chain, int32_t longer)
{
	while ((int32_t)s->before[longer] != chain)
		longer = (int32_t)s->before[longer];
	return longer;
}

/* ---- aiming ---- */

void aim_images_choose(const struct emitter_images *s, const struct aim_lobe *l,
                                int straight, double enough, struct aim *a)
{
	a->tree = straight || s->panes ? &s->all : &s->turned;
	v3_sub(l->x, s->centre, a->lobe.x);
	memcpy(a->lobe.axis, l->axis, sizeof a->lobe.axis);
	memcpy(a->lobe.normal, l->normal, sizeof a->lobe.normal);
	a->lobe.k = l->k;
	if (!aim_tree_worth(a->tree, &a->lobe, enough))
		a->tree = NULL;
}

double aim_images_density(const struct emitter_images *s, const struct aim *a,
                                   size_t image, double way, double cosine)
{
	return aim_tree_chance(a->tree, &a->lobe, (uint32_t)image) * way * way /
	       (fmax(cosine, cosine_least) * s->image[image].area);
}

double aim_images_aim(const struct emitter_images *s, const struct aim *a,
                               const double u[3], double dir[3], uint32_t *image)
{
	double at = u[0], y[3], chance = aim_tree_choose(a->tree, &a->lobe, &at, image);

	if (!(chance > 0))
		return 0;
	const struct facet *f = &s->image[*image];
	geo_facet_point(f, u[1], u[2], y);
	v3_sub(y, a->lobe.x, dir);
	double way = v3_normalise(dir), cosine = -v3_dot(dir, f->normal);
	return cosine > 0 ? chance * way * way / (fmax(cosine, cosine_least) * f->area) : 0;
}
