/* Two opaque sheets in one place are one sheet that shows the outer side of each:
 * where the kept one is one-sided, its black back becomes the side of the dropped
 * one that faced that way. Light never passes between them. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/mesh/stages.h"

/* Kept triangles of one surface whose twins are one side of one other. */
struct pairing {
	uint32_t surface;
	uint64_t twin;      /* as in mesh_merge_coincident_sheets */
	uint32_t triangles; /* how many */
	uint32_t made;      /* the surface that they get */
};

static int compare_pairings(const void *pa, const void *pb)
{
	const struct pairing *a = pa, *b = pb;

	if (a->surface != b->surface)
		return a->surface < b->surface ? -1 : 1;
	return a->twin < b->twin ? -1 : a->twin > b->twin;
}

/* Does triangle t of a one-sided material have a twin to show? */
static int wants_merge(const struct model *m, const uint64_t *twin, const uint8_t *keep,
                       size_t t)
{
	return keep[t] && twin[t] &&
	       m->material.one_sided[m->surface.material[m->triangle.surface[t]]];
}

static struct pairing *find_pairings(const struct model *m, const uint64_t *twin,
                                     const uint8_t *keep, size_t *n, size_t *triangles,
                                     struct err *e)
{
	struct pairing *p = mem_new(m->triangle.n, sizeof *p, "coincident surfaces", e);
	size_t all = 0;

	*n = 0;
	for (size_t t = 0; p && t < m->triangle.n; t++)
		if (wants_merge(m, twin, keep, t))
			p[all++] = (struct pairing){ m->triangle.surface[t], twin[t], 1, 0 };
	if (!p)
		return NULL;
	qsort(p, all, sizeof *p, compare_pairings);
	for (size_t i = 0; i < all; i++) {
		if (i == 0 || compare_pairings(&p[i], &p[*n - 1]))
			p[(*n)++] = p[i];
		else
			p[*n - 1].triangles++;
	}
	*triangles = all;
	return p;
}

static char *join_names(const char *a, const char *b, struct err *e)
{
	size_t n = strlen(a) + strlen(b) + 2;
	char *s = mem_new(n, 1, "names", e);

	if (s)
		snprintf(s, n, "%s|%s", a, b);
	return s;
}

/* A surface name that nobody has yet: `base`, or base#2, base#3 … Takes base. */
static char *unique_name(const struct surfaces *s, char *base, struct err *e)
{
	size_t n = base ? strlen(base) + 24 : 1;
	char *name = base ? mem_new(n, 1, "names", e) : NULL;

	for (unsigned k = 1; name; k++) {
		size_t i = 0;
		snprintf(name, n, k > 1 ? "%s#%u" : "%s", base, k);
		while (i < s->n && strcmp(s->name[i], name))
			i++;
		if (i == s->n)
			break;
	}
	free(base);
	return name;
}

static int grow(void *array, size_t n, size_t size, struct err *e)
{
	void **a = array, *p = mem_new(n + 1, size, "surfaces", e);

	if (!p)
		return -1;
	memcpy(p, *a, n * size);
	free(*a);
	*a = p;
	return 0;
}

static int add_surface(struct surfaces *s, char *name, uint8_t has_normals, struct err *e)
{
	if (!name || grow(&s->name, s->n, sizeof *s->name, e) ||
	    grow(&s->material, s->n, sizeof *s->material, e) ||
	    (s->has_normals && grow(&s->has_normals, s->n, 1, e))) {
		free(name);
		return -1;
	}
	s->name[s->n] = name;
	if (s->has_normals)
		s->has_normals[s->n] = has_normals;
	s->n++;
	return 0;
}

/* Copies side `from` of material i of `in` to side `to` of material j of `out`. */
static void copy_side(struct materials *out, size_t j, int to, const struct materials *in,
                      size_t i, int from)
{
	size_t bytes = (size_t)in->bands * sizeof(double);
	size_t a = model_material_at(in, i, from), b = model_material_at(out, j, to);
	size_t ka = 2 * i + (size_t)from, kb = 2 * j + (size_t)to;

	memcpy(&out->rho_d[b], &in->rho_d[a], bytes);
	memcpy(&out->tau_d[b], &in->tau_d[a], bytes);
	memcpy(&out->rho_s[b], &in->rho_s[a], bytes);
	memcpy(&out->tau_s[b], &in->tau_s[a], bytes);
	memcpy(&out->emission[b], &in->emission[a], bytes);
	out->alpha[kb] = in->alpha[ka];
	out->beta[kb] = in->beta[ka];
	out->emission_exponent[kb] = in->emission_exponent[ka];
}

/* Appends a two-sided material: front of `front`, and for the back that side of
 * `back`. One-sided sheets transmit nothing, so neither does the pair. */
static int add_material(struct materials *mt, size_t front, size_t back, int side,
                        struct err *e)
{
	struct materials out;
	size_t n = mt->n;

	if (model_materials_new(&out, n + 1, mt->bands, e))
		goto failed;
	for (size_t i = 0; i < n; i++)
		for (int s = 0; s < 2; s++)
			copy_side(&out, i, s, mt, i, s);
	copy_side(&out, n, FRONT, mt, front, FRONT);
	copy_side(&out, n, BACK, mt, back, side);
	for (int b = 0; b < mt->bands; b++) {
		size_t at = model_material_at(&out, n, BACK) + (size_t)b;
		out.tau_d[at] = out.tau_s[at] = 0;
	}
	if (!(out.name[n] = join_names(mt->name[front], mt->name[back], e)))
		goto failed;
	memcpy(out.name, mt->name, n * sizeof *mt->name);
	memcpy(out.one_sided, mt->one_sided, n);
	memset(mt->name, 0, n * sizeof *mt->name);
	model_materials_free(mt);
	*mt = out;
	return 0;
failed:
	model_materials_free(&out);
	return -1;
}

/* The material of a pairing: an earlier one of the same pair, or a new one. */
static int pair_material(struct model *m, const struct pairing *all, size_t i,
                         const uint32_t *before, uint32_t *material, struct err *e)
{
	uint32_t twin = (uint32_t)((all[i].twin - 1) / 2);
	uint64_t side = (all[i].twin - 1) % 2;

	for (size_t j = 0; j < i; j++)
		if (before[all[j].surface] == before[all[i].surface] &&
		    before[(all[j].twin - 1) / 2] == before[twin] &&
		    (all[j].twin - 1) % 2 == side) {
			*material = m->surface.material[all[j].made];
			return 0;
		}
	*material = (uint32_t)m->material.n;
	return add_material(&m->material, before[all[i].surface], before[twin], (int)side, e);
}

/* How many kept triangles each surface has. */
static uint32_t *count_kept(const struct model *m, const uint8_t *keep, struct err *e)
{
	uint32_t *kept = mem_new(m->surface.n, sizeof *kept, "surfaces", e);

	for (size_t t = 0; kept && t < m->triangle.n; t++)
		kept[m->triangle.surface[t]] += keep[t];
	return kept;
}

/* Finds or makes the surface for pairing i. One all of whose triangles belong to
 * the pairing simply changes its material. */
static int make_pair(struct model *m, const uint32_t *kept, struct pairing *all, size_t i,
                     const uint32_t *before, struct err *e)
{
	struct pairing *p = &all[i];
	struct surfaces *s = &m->surface;
	uint32_t material, other = (uint32_t)((p->twin - 1) / 2);

	if (pair_material(m, all, i, before, &material, e))
		return -1;
	p->made = p->surface;
	if (p->triangles != kept[p->surface]) {
		p->made = (uint32_t)s->n;
		char *name = join_names(s->name[p->surface], s->name[other], e);
		if (add_surface(s, unique_name(s, name, e),
		                s->has_normals && s->has_normals[p->surface], e))
			return -1;
	}
	s->material[p->made] = material;
	return 0;
}

int mesh_merge_coincident_sheets(struct model *m, const uint64_t *twin, const uint8_t *keep,
                                 struct mesh_report *r, struct err *e)
{
	int status = -1;
	size_t n, triangles = 0;
	uint32_t *before = NULL, *kept = NULL;
	struct pairing *p = find_pairings(m, twin, keep, &n, &triangles, e);

	before = mem_new(m->surface.n, sizeof *before, "surfaces", e);
	kept = count_kept(m, keep, e);
	if (!p || !before || !kept)
		goto done;
	memcpy(before, m->surface.material, m->surface.n * sizeof *before);
	uint32_t *surface = m->triangle.surface;
	for (size_t i = 0; i < n; i++)
		if (make_pair(m, kept, p, i, before, e))
			goto done;
	for (size_t t = 0; t < m->triangle.n; t++) {
		/* Materials may have changed under wants_merge: ask the pairings alone. */
		struct pairing want = { surface[t], twin[t], 0, 0 }, *found = NULL;
		if (keep[t] && twin[t])
			found = bsearch(&want, p, n, sizeof *p, compare_pairings);
		if (found)
			surface[t] = found->made;
	}
	r->merged += (uint32_t)triangles;
	status = 0;
done:
	free(p);
	free(before);
	free(kept);
	return status;
}
