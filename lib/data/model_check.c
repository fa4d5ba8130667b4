#include "lib/data/model_check.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/index_check.h"
#include "lib/base/mem.h"
#include "lib/base/vec.h"

static const double albedo_slack = MODEL_ALBEDO_SLACK;
/* By how much dot products of a rigid matrix's columns may be off 0 and 1: a guess, a hundred
 * roundings of float32, as matrices are products of glTF's float32 numbers. */
static const double rigid_slack = 1e-5;

static const char *side_name(size_t side)
{
	return side == FRONT ? "front" : "back";
}

/* ---- names ---- */

static int by_text(const void *a, const void *b)
{
	return strcmp(*(char *const *)a, *(char *const *)b);
}

static int unique_names(const char *what, char *const *name, size_t n, struct err *e)
{
	char **sorted = mem_new(n, sizeof *sorted, what, e);

	if (!sorted)
		return -1;
	if (n)
		memcpy(sorted, name, n * sizeof *sorted);
	qsort(sorted, n, sizeof *sorted, by_text);
	for (size_t i = 1; i < n; i++)
		if (strcmp(sorted[i - 1], sorted[i]) == 0) {
			err_set(e, "names of %s: '%.100s' is there twice", what, sorted[i]);
			free(sorted);
			return -1;
		}
	free(sorted);
	return 0;
}

/* ---- materials ---- */

static int check_side(const struct materials *mt, size_t m, size_t side, struct err *e)
{
	const struct {
		const char *name;
		const double *value;
	} coefficient[] = { { "rho_d", mt->rho_d }, { "tau_d", mt->tau_d },
	                    { "rho_s", mt->rho_s }, { "tau_s", mt->tau_s } };
	const size_t at = model_material_at(mt, m, (int)side);

	for (int b = 0; b < mt->bands; b++) {
		double sum = 0, l = mt->emission[at + (size_t)b];
		for (size_t i = 0; i < sizeof coefficient / sizeof *coefficient; i++) {
			double v = coefficient[i].value[at + (size_t)b];
			if (!(v >= 0 && v <= 1 + albedo_slack))
				return err_set(e, "array material_%s: material '%.100s', %s, band %d: "
				               "%g is not between 0 and 1", coefficient[i].name,
				               mt->name[m], side_name(side), b, v);
			sum += v;
		}
		if (sum > 1 + albedo_slack)
			return err_set(e, "arrays material_rho_d, _tau_d, _rho_s, _tau_s: material "
			               "'%.100s', %s, band %d: they sum to %.9g, more than 1",
			               mt->name[m], side_name(side), b, sum);
		if (!(l >= 0 && isfinite(l)))
			return err_set(e, "array material_emission: material '%.100s', %s, band "
			               "%d: %g is not a radiance", mt->name[m], side_name(side), b,
			               l);
	}
	return 0;
}

static int check_exponents(const struct materials *mt, size_t m, size_t side, struct err *e)
{
	const size_t i = 2 * m + side;
	const struct {
		const char *name;
		double value;
		int finite;
	} exponent[] = { { "alpha", mt->alpha[i], 0 }, { "beta", mt->beta[i], 0 },
	                 { "emission_exponent", mt->emission_exponent[i], 1 } };

	for (size_t k = 0; k < sizeof exponent / sizeof *exponent; k++)
		if (!(exponent[k].value >= 0) || (exponent[k].finite && isinf(exponent[k].value)))
			return err_set(e, "array material_%s: material '%.100s', %s: %g is not an "
			               "exponent", exponent[k].name, mt->name[m], side_name(side),
			               exponent[k].value);
	return 0;
}

/* What would leave a side that is not modelled has nowhere to go. */
static int check_one_sided(const struct materials *mt, size_t m, struct err *e)
{
	if (mt->one_sided[m] > 1)
		return err_set(e, "array material_one_sided: material '%.100s': %d is not 0 or 1",
		               mt->name[m], mt->one_sided[m]);
	for (int b = 0; mt->one_sided[m] && b < mt->bands; b++) {
		size_t at = model_material_at(mt, m, FRONT) + (size_t)b;
		if (mt->tau_d[at] > 0 || mt->tau_s[at] > 0)
			return err_set(e, "array material_one_sided: material '%.100s' is "
			               "one-sided but transmits light", mt->name[m]);
	}
	return 0;
}

static int check_materials(const struct materials *mt, int bands, struct err *e)
{
	if (bands < 1 || bands > BANDS_MAX || mt->bands != bands)
		return err_set(e, "array material_rho_d: %d bands are not between 1 and %d",
		               mt->bands, BANDS_MAX);
	for (size_t m = 0; m < mt->n; m++) {
		for (size_t side = FRONT; side <= BACK; side++)
			if (check_side(mt, m, side, e) || check_exponents(mt, m, side, e))
				return -1;
		if (check_one_sided(mt, m, e))
			return -1;
	}
	return 0;
}

/* ---- lights ---- */

static int check_light(const struct lights *l, size_t i, int bands, struct err *e)
{
	const double *x = &l->position[3 * i], *d = &l->direction[3 * i], *cone = &l->cone[2 * i];
	double length = v3_length(d);

	if (l->kind[i] >= LIGHT_KINDS)
		return err_set(e, "array light_kind: light '%.100s': %d is no kind of light",
		               l->name[i], l->kind[i]);
	if (!isfinite(x[0] + x[1] + x[2]))
		return err_set(e, "array light_position: light '%.100s': not finite", l->name[i]);
	if (l->kind[i] == LIGHT_POINT ? length != 0 : !(fabs(length - 1) <= rigid_slack))
		return err_set(e, "array light_direction: light '%.100s': length %g instead of %d",
		               l->name[i], length, l->kind[i] != LIGHT_POINT);
	if (l->kind[i] == LIGHT_SPOT
	        ? !(cone[0] >= 0 && cone[0] <= cone[1] && cone[1] > 0 && cone[1] <= PI / 2)
	        : cone[0] != 0 || cone[1] != 0)
		return err_set(e, "array light_cone: light '%.100s': %g, %g are no cones",
		               l->name[i], cone[0], cone[1]);
	for (int b = 0; b < bands; b++) {
		double intensity = l->intensity[i * (size_t)bands + (size_t)b];
		if (!(intensity >= 0 && isfinite(intensity)))
			return err_set(e, "array light_intensity: light '%.100s', band %d: %g is "
			               "no intensity", l->name[i], b, intensity);
	}
	return 0;
}

static int check_lights(const struct model *m, struct err *e)
{
	for (size_t i = 0; i < m->light.n; i++)
		if (check_light(&m->light, i, m->bands, e))
			return -1;
	return unique_names("lights", m->light.name, m->light.n, e);
}

/* ---- cameras ---- */

static int rigid(const double t[16])
{
	for (int i = 0; i < 3; i++)
		for (int j = i; j < 3; j++)
			if (!(fabs(v3_dot(&t[4 * i], &t[4 * j]) - (i == j)) <= rigid_slack))
				return 0;
	for (int k = 0; k < 3; k++)
		if (!isfinite(t[12 + k]) || t[4 * k + 3] != 0)
			return 0;
	return t[15] == 1;
}

static int check_camera(const struct camera *c, struct err *e)
{
	if (c->orthographic != 0 && c->orthographic != 1)
		return err_set(e, "array camera_orthographic: camera '%.100s': %d is not 0 or 1",
		               c->name, c->orthographic);
	if (!rigid(c->to_world))
		return err_set(e, "array camera_to_world: camera '%.100s': not a rigid matrix",
		               c->name);
	if (c->orthographic && !(c->xmag > 0 && c->ymag > 0 && isfinite(c->xmag + c->ymag)))
		return err_set(e, "arrays camera_xmag, camera_ymag: camera '%.100s': %g x %g is "
		               "no view", c->name, c->xmag, c->ymag);
	if (!c->orthographic && !(c->yfov > 0 && c->yfov < PI))
		return err_set(e, "array camera_yfov: camera '%.100s': %g is not between 0 and PI",
		               c->name, c->yfov);
	if (!(c->aspect >= 0 && isfinite(c->aspect)))
		return err_set(e, "array camera_aspect: camera '%.100s': %g is not an aspect",
		               c->name, c->aspect);
	return 0;
}

static int check_cameras(const struct model *m, struct err *e)
{
	char **name = mem_new(m->cameras, sizeof *name, "cameras", e);
	int failed = !name;

	for (size_t i = 0; i < m->cameras && !failed; i++) {
		name[i] = m->camera[i].name;
		failed = check_camera(&m->camera[i], e);
	}
	failed = failed || unique_names("cameras", name, m->cameras, e);
	free(name);
	return failed ? -1 : 0;
}

/* ---- arrays ---- */

static int finite_f64(const char *name, const double *v, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++)
		if (!isfinite(v[i]))
			return err_set(e, "array %s: value %zu is %g", name, i, v[i]);
	return 0;
}

static int finite_f32(const char *name, const float *v, size_t n, struct err *e)
{
	for (size_t i = 0; i < n; i++)
		if (!isfinite(v[i]))
			return err_set(e, "array %s: value %zu is %g", name, i, (double)v[i]);
	return 0;
}

static int check_surfaces(const struct model *m, struct err *e)
{
	const struct surfaces *s = &m->surface;

	for (size_t i = 0; i < s->n; i++)
		if (s->has_normals[i] > 1)
			return err_set(e, "array surface_has_normals: value %zu is not 0 or 1", i);
	return err_check_below("surface_material", s->material, s->n, m->material.n, e) ||
	       unique_names("surfaces", s->name, s->n, e) ? -1 : 0;
}

static int check_vertices_and_triangles(const struct model *m, struct err *e)
{
	return finite_f64("vertex", m->vertex, 3 * m->vertices, e) ||
	       err_check_below("triangle", m->triangle.corner, 3 * m->triangle.n, m->vertices, e) ||
	       err_check_below("triangle_surface", m->triangle.surface, m->triangle.n,
	                m->surface.n, e) ||
	       finite_f32("triangle_uv", m->triangle.uv, 6 * m->triangle.n, e) ||
	       finite_f32("triangle_normal", m->triangle.normal, 9 * m->triangle.n, e) ? -1 : 0;
}

static int check_elements(const struct model *m, struct err *e)
{
	if (err_check_below("element", m->element.corner, 3 * m->element.n, m->vertices, e) ||
	    err_check_below("element_triangle", m->element.triangle, m->element.n,
	                    m->triangle.n, e))
		return -1;
	for (size_t i = 0; i < m->element.n; i++) {
		const uint32_t *c = &m->element.corner[3 * i];
		double n[3];
		v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
		        &m->vertex[3 * (size_t)c[2]], n);
		double area = v3_length(n);
		if (!(area > 0 && isfinite(area)))
			return err_set(e, "array element: element %zu has area %g", i, area);
	}
	return 0;
}

/* ---- split trees ---- */

struct walk {
	const struct model *m;
	uint8_t *split_reached, *element_reached;
	int32_t *stack;    /* each split is pushed once at most */
	size_t depth;
};

/* A root or child: an element of triangle t not yet reached, or a split to visit. */
static int reach(struct walk *w, int32_t at, size_t t, struct err *e)
{
	const struct model *m = w->m;
	size_t i = at >= 0 ? (size_t)at : (size_t)~at;
	uint8_t *reached = at >= 0 ? w->split_reached : w->element_reached;

	if (i >= (at >= 0 ? m->splits : m->element.n))
		return err_set(e, "array triangle_split or split: the tree of triangle %zu leads "
		               "to %s %zu of %zu", t, at >= 0 ? "split" : "element", i,
		               at >= 0 ? m->splits : m->element.n);
	if (reached[i])
		return err_set(e, "array triangle_split or split: %s %zu is reached twice",
		               at >= 0 ? "split" : "element", i);
	reached[i] = 1;
	if (at >= 0)
		w->stack[w->depth++] = at;
	else if (m->element.triangle[i] != t)
		return err_set(e, "array element_triangle: the tree of triangle %zu leads to "
		               "element %zu of triangle %" PRIu32, t, i, m->element.triangle[i]);
	return 0;
}

static int walk_tree(struct walk *w, size_t t, struct err *e)
{
	if (reach(w, w->m->triangle.split[t], t, e))
		return -1;
	while (w->depth) {
		int32_t at = w->stack[--w->depth];
		const struct split *s = &w->m->split[at];
		if (s->edge < 0 || s->edge > 2)
			return err_set(e, "array split: split %" PRId32 " has edge %" PRId32, at,
			               s->edge);
		if (reach(w, s->child[0], t, e) || reach(w, s->child[1], t, e))
			return -1;
	}
	return 0;
}

static int check_splits(const struct model *m, struct err *e)
{
	struct walk w = { .m = m };
	int failed;

	w.split_reached = mem_new(m->splits, 1, "split trees", e);
	w.element_reached = mem_new(m->element.n, 1, "split trees", e);
	w.stack = mem_new(m->splits, sizeof *w.stack, "split trees", e);
	failed = !w.split_reached || !w.element_reached || !w.stack;
	for (size_t t = 0; t < m->triangle.n && !failed; t++)
		failed = walk_tree(&w, t, e);
	for (size_t i = 0; i < m->element.n && !failed; i++)
		if (!w.element_reached[i])
			failed = err_set(e, "array split: no tree leads to element %zu", i);
	for (size_t i = 0; i < m->splits && !failed; i++)
		if (!w.split_reached[i])
			failed = err_set(e, "array split: no tree leads to split %zu", i);
	free(w.split_reached);
	free(w.element_reached);
	free(w.stack);
	return failed ? -1 : 0;
}

/* ---- patches ---- */

static int check_patches(const struct model *m, struct err *e)
{
	const uint32_t *start = m->patch.start;

	if (err_check_below("patch_surface", m->patch.surface, m->patch.n, m->surface.n, e))
		return -1;
	if (start[0] != 0 || start[m->patch.n] != m->element.n)
		return err_set(e, "array patch_start: it runs from %" PRIu32 " to %" PRIu32
		               " and should from 0 to %zu", start[0], start[m->patch.n],
		               m->element.n);
	for (size_t p = 0; p < m->patch.n; p++)
		if (start[p + 1] <= start[p] || start[p + 1] > m->element.n)
			return err_set(e, "array patch_start: patch %zu has no elements", p);
	for (size_t p = 0; p < m->patch.n; p++)
		for (uint32_t i = start[p]; i < start[p + 1]; i++)
			if (m->triangle.surface[m->element.triangle[i]] != m->patch.surface[p])
				return err_set(e, "array patch_surface: patch %zu holds element %"
				               PRIu32 " of another surface", p, i);
	return 0;
}

static int check_loops(const struct model *m, struct err *e)
{
	return err_check_starts("patch_loop", m->patch.loop, m->patch.n, m->patch.loops, 0, e) ||
	       err_check_starts("loop_start", m->patch.loop_start, m->patch.loops,
	                        m->patch.loop_indices, 3, e) ||
	       err_check_below("loop_index", m->patch.loop_index, m->patch.loop_indices,
	                       m->vertices, e) ? -1 : 0;
}

/* Element-sides are 32-bit, elements and splits share a signed 32-bit number. */
static int check_counts(const struct model *m, struct err *e)
{
	if (m->element.n == 0 || m->patch.n == 0 || m->triangle.n == 0)
		return err_set(e, "array element: there are no surfaces");
	if (m->element.n > INT32_MAX || m->splits > INT32_MAX || m->vertices > UINT32_MAX ||
	    m->triangle.n > UINT32_MAX)
		return err_set(e, "array element: more than 2^31 elements or 2^32 vertices");
	if (m->light.n > INT32_MAX)
		return err_set(e, "array light_kind: more than 2^31 lights");
	return 0;
}

int model_check(const struct model *m, struct err *e)
{
	return check_counts(m, e) || check_materials(&m->material, m->bands, e) ||
	       check_surfaces(m, e) || check_lights(m, e) || check_cameras(m, e) ||
	       check_vertices_and_triangles(m, e) || check_elements(m, e) ||
	       check_splits(m, e) || check_patches(m, e) || check_loops(m, e) ? -1 : 0;
}
