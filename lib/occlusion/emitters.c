#include "lib/occlusion/emitters.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/occlusion/facet_set.h"
#include "lib/occlusion/occluder_polygons.h"
#include "lib/scatter/bsdf.h"

/* A count: corners of a facet; larger polygons are cut into fans. As in facet_set.c. */
enum { AT_ONCE = 8 };

struct maker {
	const struct model *m;
	double shift[3];              /* from corners of polygons to those of facets */
	struct array emitter, corner;
	struct err *e;
};

static int put_facet(struct maker *k, const struct polygons *p, const uint32_t *corner, int n,
                     size_t material, int side)
{
	const struct materials *mt = &k->m->material;
	struct emitter t = { .f.n = n,
		             .radiance = &mt->emission[model_material_at(mt, material, side)],
		             .exponent = mt->emission_exponent[2 * material + (size_t)side] };
	double x[3];

	for (int i = 0; i < n; i++) {
		v3_mad(occ_polygon_point(p, corner[side == BACK ? n - 1 - i : i]), 1, k->shift, x);
		if (mem_append(&k->corner, x, 3, sizeof *x, k->e))
			return -1;
	}
	return mem_append(&k->emitter, &t, 1, sizeof t, k->e);
}

static int put_polygon(struct maker *k, const struct polygons *p, const struct polygon *q,
                       size_t material, int side)
{
	for (uint32_t i = 1; i + 1 < q->n; i += AT_ONCE - 2) {
		uint32_t part[AT_ONCE] = { q->first };
		int n = 1;
		for (uint32_t c = i; c < q->n && n < AT_ONCE; c++)
			part[n++] = q->first + c;
		if (put_facet(k, p, part, n, material, side))
			return -1;
	}
	return 0;
}

/* The triangles of a material alone, as a model, made into polygons. */
static int put_material(struct maker *k, size_t material, uint32_t *triangle, uint32_t *surface)
{
	const struct model *m = k->m;
	struct model sub = *m;
	struct polygons p = { 0 };
	double centre[3], own[3];

	sub.triangle.n = 0;
	sub.triangle.corner = triangle;
	sub.triangle.surface = surface;
	for (size_t i = 0; i < m->triangle.n; i++) {
		if (m->surface.material[m->triangle.surface[i]] != material)
			continue;
		memcpy(&triangle[3 * sub.triangle.n], &m->triangle.corner[3 * i],
		       3 * sizeof *triangle);
		surface[sub.triangle.n++] = m->triangle.surface[i];
	}
	if (sub.triangle.n == 0)
		return 0;
	occ_facet_centre(m, centre);
	occ_facet_centre(&sub, own);
	v3_sub(own, centre, k->shift);
	int bad = occ_polygons_init(&p, &sub, k->e);
	for (size_t i = 0; !bad && i < p.polygon.n; i++)
		for (int side = FRONT; side <= BACK && !bad; side++)
			if (bsdf_emits(&m->material, material, side))
				bad = put_polygon(k, &p, (const struct polygon *)p.polygon.data + i,
				                  material, side);
	occ_polygons_free(&p);
	return bad;
}

static void measure(struct emitters *s, const struct maker *k)
{
	size_t at = 0;

	for (size_t i = 0; i < s->n; i++) {
		struct emitter *t = &s->emitter[i];
		t->f.v = s->corner + at;
		at += 3 * (size_t)t->f.n;
		geo_facet_measure(&t->f);
		for (int b = 0; b < k->m->bands; b++)
			t->power += t->radiance[b] / k->m->bands * t->f.area;
	}
}

int occ_emitters_init(struct emitters *s, const struct model *m, struct err *e)
{
	struct maker k = { .m = m, .e = e };
	uint32_t *triangle = mem_new(m->triangle.n, 3 * sizeof *triangle, "emitters", e);
	uint32_t *surface = mem_new(m->triangle.n, sizeof *surface, "emitters", e);
	int bad = !triangle || !surface;

	for (size_t i = 0; i < m->material.n && !bad; i++)
		if (bsdf_emits(&m->material, i, FRONT) || bsdf_emits(&m->material, i, BACK))
			bad = put_material(&k, i, triangle, surface);
	*s = (struct emitters){ k.emitter.n, k.emitter.data, k.corner.data };
	if (!bad)
		measure(s, &k);
	free(triangle);
	free(surface);
	return bad ? -1 : 0;
}

void occ_emitters_free(struct emitters *s)
{
	free(s->emitter);
	free(s->corner);
	*s = (struct emitters){ 0 };
}
