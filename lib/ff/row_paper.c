/* The paper's algorithm, to the letter: its hemicubes on front and back, its unshot radiosity
 * by source, whose light comes from the source's centroid to that of the patch, its
 * directional form factors
 *     G'(i->e) = cos^k a / cos theta F(i->e),    G(i->e) = G'(i->e) / sum of G' over elements,
 * where F and G are sums over the pixels that show e. */
#include "lib/ff/row_paper.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/data/punctual.h"
#include "lib/ff/hemicube_pilot.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/hemicube/hemicube_lobe.h"
#include "lib/scatter/bsdf.h"
#include "lib/scatter/lobe.h"

/* ---- the centre of a patch ---- */

static void element_centre(const struct model *m, uint32_t el, double c[3])
{
	memset(c, 0, 3 * sizeof *c);
	for (size_t k = 0; k < 3; k++)
		v3_mad(c, 1. / 3, &m->vertex[3 * (size_t)m->element.corner[3 * (size_t)el + k]], c);
}

static void centroid(const struct model *m, uint32_t patch, double c[3])
{
	double at[3];

	memset(c, 0, 3 * sizeof *c);
	for (uint32_t el = m->patch.start[patch]; el < m->patch.start[patch + 1]; el++) {
		element_centre(m, el, at);
		v3_mad(c, m->element.area[el] / m->patch.area[patch], at, c);
	}
}

/* Whether a point is above or below an element, and how far. */
static int is_over(const struct model *m, uint32_t el, const double p[3], double *height)
{
	const double *n = &m->element.normal[3 * (size_t)el], *v[3];
	double edge[3], to[3], across[3];

	for (size_t k = 0; k < 3; k++)
		v[k] = &m->vertex[3 * (size_t)m->element.corner[3 * (size_t)el + k]];
	for (int k = 0; k < 3; k++) {
		v3_sub(v[(k + 1) % 3], v[k], edge);
		v3_sub(p, v[k], to);
		v3_cross(edge, to, across);
		if (v3_dot(across, n) < 0)
			return 0;
	}
	*height = v3_dot(to, n);
	return 1;
}

/* Where the hemicubes of a patch stand: at its centroid, or, where that is not on the patch,
 * on the element below or above it, or else at the centre of the nearest. */
static uint32_t stand(const struct model *m, uint32_t patch, double x[3])
{
	double c[3], at[3], d[3], least = INFINITY, nearest = INFINITY, height = 0;
	uint32_t over = UINT32_MAX, found = m->patch.start[patch];

	centroid(m, patch, c);
	for (uint32_t el = m->patch.start[patch]; el < m->patch.start[patch + 1]; el++) {
		if (is_over(m, el, c, &height) && fabs(height) < least) {
			least = fabs(height);
			over = el;
			v3_mad(c, -height, &m->element.normal[3 * (size_t)el], x);
		}
		element_centre(m, el, at);
		v3_sub(at, c, d);
		if (v3_dot(d, d) < nearest) {
			nearest = v3_dot(d, d);
			found = el;
		}
	}
	if (over != UINT32_MAX)
		return over;
	element_centre(m, found, x);
	return found;
}

static uint32_t *items(const struct ff_thread *t, int side)
{
	return t->item + (size_t)side * t->job->grid.pixels;
}

static void render(struct ff_thread *t, const struct view *v, int side)
{
	const struct ff_job *j = t->job;
	double frame[3][3];

	memcpy(frame, v->frame, sizeof frame);
	ff_hemicube_render(&t->cube, j->cubes, v->eye, (const double (*)[3])frame, HEMICUBE_VOID);
	memcpy(items(t, side), t->cube.item, j->grid.pixels * sizeof *t->item);
}

/* Hemicubes on front and back. */
static void look(struct ff_thread *t, uint32_t patch)
{
	double x[3];
	uint32_t element = stand(t->job->m, patch, x);

	for (int side = 0; side < 2; side++) {
		struct view *v = t->view + side;
		v->element = element;
		memcpy(v->eye, x, sizeof v->eye);
		ff_normal(t->job, element, side, v->frame[2]);
		v3_frame(v->frame[2], v->frame[0], v->frame[1]);
		ray_leave(t->job->rays, v->frame[2], v->eye);
		render(t, v, side);
	}
}

/* ---- rows ---- */

static uint32_t side_of(const struct model *m, uint32_t item)
{
	return 2 * m->element.patch[item >> 1] + (item & 1);
}

/* Pixels of a side's hemicube, each with a weight, into the tally. */
static void land(struct ff_thread *t, int side, const double *weight)
{
	const struct ff_job *j = t->job;
	const struct view *v = &t->view[side];
	const uint32_t *item = items(t, side);

	for (size_t i = 0; i < j->grid.pixels; i++) {
		if (!(weight[i] > 0))
			continue;
		if (item[i] == HEMICUBE_VOID) {
			ff_tally_rest(&t->tally, 0)->escape += weight[i];
			continue;
		}
		if (j->is_black[side_of(j->m, item[i])]) {
			ff_tally_rest(&t->tally, 0)->black += weight[i];
			continue;
		}
		double dir[3] = { 0 };
		for (int k = 0; k < 3; k++)
			v3_mad(dir, j->grid.direction[3 * i + (size_t)k], v->frame[k], dir);
		ff_tally_hit(&t->tally, 0, item[i], weight[i], dir);
	}
}

static int finish(struct ff_thread *t, uint32_t ps, enum ff_row_kind kind, struct ff_batch *b,
                  struct err *e)
{
	return ff_tally_finish(&t->tally, b, ps, kind, (uint32_t)t->job->grid.pixels, 1, e);
}

/* A lobe that leaves a patch-side, about an axis in world coordinates. Where it finds nothing
 * to be normalised over, all is lost. */
static int lobe_row(struct ff_thread *t, uint32_t ps, const double axis[3], double exponent,
                    int escape, enum ff_row_kind kind, struct ff_batch *b, struct err *e)
{
	const struct ff_job *j = t->job;
	int side = (int)(ps & 1);
	double local[3];

	for (int k = 0; k < 3; k++)
		local[k] = v3_dot(axis, t->view[side].frame[k]);
	if (ff_hemicube_lobe(&j->grid, items(t, side), local, exponent, escape, t->weight))
		ff_tally_rest(&t->tally, 0)->lost += 1;
	land(t, side, t->weight);
	return finish(t, ps, kind, b, e);
}

/* ---- links ---- */

/* The direction that light of a source comes from, as the paper has it: its centroid, seen
 * from that of the patch. Of a source that reaches below the horizon, whose centroid is
 * there, only the elements above count. 0 if there is none. */
static int direction_to(const struct ff_job *j, uint32_t ps, const double from[3], uint32_t source,
                        double l[3])
{
	const struct model *m = j->m;
	double c[3], above[3] = { 0 }, n[3], at[3];

	ff_normal(j, m->patch.start[ps >> 1], (int)(ps & 1), n);
	centroid(m, source >> 1, c);
	v3_sub(c, from, l);
	for (uint32_t el = m->patch.start[source >> 1];
	     !(v3_dot(l, n) > 0) && el < m->patch.start[(source >> 1) + 1]; el++) {
		element_centre(m, el, at);
		v3_sub(at, from, at);
		if (v3_dot(at, n) > 0)
			v3_mad(above, m->element.area[el], at, above);
	}
	if (!(v3_dot(l, n) > 0))
		memcpy(l, above, sizeof above);
	v3_normalise(l);
	return v3_dot(l, n) > 0;
}

static int light_direction(const struct model *m, const double from[3], const double n[3],
                           uint32_t light, double l[3])
{
	const double *d = &m->light.direction[3 * (size_t)light];

	if (m->light.kind[light] == LIGHT_DIRECTIONAL)
		for (int k = 0; k < 3; k++)
			l[k] = -d[k];
	else
		v3_sub(&m->light.position[3 * (size_t)light], from, l);
	v3_normalise(l);
	return v3_dot(l, n) > 0;
}

static int add_link(struct ff_thread *t, uint32_t ps, uint32_t source, const double l[3],
                    struct ff_batch *b, struct err *e)
{
	const struct ff_job *j = t->job;
	const struct materials *mt = &j->m->material;
	uint32_t material = model_patch_material(j->m, ps >> 1), side = ps & 1, chain = 0;
	uint32_t row[2] = { FF_NO_ROW, FF_NO_ROW };
	float direction[3] = { (float)l[0], (float)l[1], (float)l[2] };
	double axis[3];

	for (uint32_t way = 0; way < 2; way++) {
		if (!bsdf_has_lobe(mt, material, (int)side, (int)way))
			continue;
		row[way] = (uint32_t)b->row_side.n;
		bsdf_lobe_mirror(l, t->view[side].frame[2], axis);
		for (int k = 0; k < 3 && way; k++)
			axis[k] = -l[k];
		if (lobe_row(t, ps ^ way, axis, (way ? mt->beta : mt->alpha)[2 * material + side],
		             j->o.paper == FF_PAPER_CLOSED, way ? FF_TRANSMITTED : FF_REFLECTED, b, e))
			return -1;
	}
	return mem_append(&b->link_target, &ps, 1, sizeof ps, e) ||
	       mem_append(&b->link_source, &source, 1, sizeof source, e) ||
	       mem_append(&b->link_last, &source, 1, sizeof source, e) ||
	       mem_append(&b->link_chain, &chain, 1, sizeof chain, e) ||
	       mem_append(&b->link_direction, direction, 3, sizeof *direction, e) ||
	       mem_append(&b->link_row, row, 2, sizeof *row, e) ? -1 : 0;
}

/* A link for every source that the hemicube sees, every emitter and every light; and one
 * along the normal, for light of others. */
static int link_rows(struct ff_thread *t, uint32_t ps, struct ff_batch *b, struct err *e)
{
	const struct ff_job *j = t->job;
	const uint32_t *item = items(t, (int)(ps & 1)), sides = (uint32_t)(2 * j->m->patch.n);
	const double *n = t->view[ps & 1].frame[2];
	uint8_t *sends = mem_new(sides, 1, "sources seen", e);
	double from[3], l[3];
	int bad = !sends;

	centroid(j->m, ps >> 1, from);
	for (uint32_t q = 0; !bad && q < sides; q++)
		sends[q] = j->emits[q] && q >> 1 != ps >> 1;
	for (size_t i = 0; !bad && i < j->grid.pixels; i++)
		if (item[i] != HEMICUBE_VOID && j->is_source[side_of(j->m, item[i])])
			sends[side_of(j->m, item[i])] = 1;
	for (uint32_t q = 0; !bad && q < sides; q++)
		if (sends[q] && direction_to(j, ps, from, q, l))
			bad = add_link(t, ps, q, l, b, e);
	for (uint32_t i = 0; !bad && i < j->m->light.n; i++)
		if (light_direction(j->m, from, n, i, l))
			bad = add_link(t, ps, sides + i, l, b, e);
	free(sends);
	return bad ? -1 : add_link(t, ps, FF_ANY, n, b, e);
}

static int side_rows(struct ff_thread *t, uint32_t ps, struct ff_batch *b, struct err *e)
{
	static const double normal[3] = { 0, 0, 1 };
	const struct ff_job *j = t->job;
	const struct materials *mt = &j->m->material;
	uint32_t material = model_patch_material(j->m, ps >> 1);
	int side = (int)(ps & 1);

	if (j->shoots_diffuse[ps]) {
		land(t, side, j->grid.delta);
		ff_hemicube_pilot(t, ps);
		if (finish(t, ps, FF_DIFFUSE, b, e))
			return -1;
	}
	if (j->shoots_lobe[ps]) {
		ff_hemicube_lobe(&j->grid, items(t, side), normal,
		                 mt->emission_exponent[2 * material + (uint32_t)side], 1, t->weight);
		land(t, side, t->weight);
		if (finish(t, ps, FF_EMISSION, b, e))
			return -1;
	}
	return j->has_lobe[ps] ? link_rows(t, ps, b, e) : 0;
}

int ff_patch_paper(struct ff_thread *t, uint32_t patch, struct ff_batch *b, struct err *e)
{
	const struct ff_job *j = t->job;
	const uint32_t ps = 2 * patch;

	if (j->is_source[ps] || j->is_source[ps + 1] || j->has_lobe[ps] || j->has_lobe[ps + 1])
		look(t, patch);
	return side_rows(t, ps, b, e) || side_rows(t, ps + 1, b, e) ? -1 : 0;
}
