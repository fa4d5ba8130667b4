/* Refinement: what is divided, that it stays conforming, what stays as it was. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "shapes.h"

static const struct mesher_refinement how = { .01, { .02, 0 }, 100000 };

/* An even solution without errors. */
static struct solution lit(const struct model *m)
{
	size_t n = 2 * m->elements * (size_t)m->bands;
	struct solution s = { .groups = 1, .element_sides = 2 * m->elements, .bands = m->bands,
		.direct = calloc(n, sizeof(double)), .caustic = calloc(n, sizeof(double)),
		.indirect = calloc(n, sizeof(double)), .error = calloc(n, sizeof(double)),
		.error_direct = calloc(n, sizeof(double)),
		.discretisation = calloc(n, sizeof(double)),
		.discretisation_direct = calloc(n, sizeof(double)) };

	for (size_t i = 0; i < n; i++)
		s.direct[i] = 1;
	return s;
}

static void centroid(const struct model *m, size_t e, double c[3])
{
	c[0] = c[1] = c[2] = 0;
	for (size_t k = 0; k < 3; k++)
		v3_mad(c, 1. / 3, &m->vertex[3 * (size_t)m->element[3 * e + k]], c);
}

/* Errors near a point of the front. */
static void doubt(const struct model *m, struct solution *s, const double at[3], double reach)
{
	for (size_t e = 0; e < m->elements; e++) {
		double c[3];
		centroid(m, e, c);
		v3_sub(c, at, c);
		if (v3_length(c) < reach)
			s->discretisation[2 * e] = s->discretisation_direct[2 * e] = .5;
	}
}

static double longest(const struct model *m, size_t e)
{
	double most = 0, d[3];

	for (size_t k = 0; k < 3; k++) {
		v3_sub(&m->vertex[3 * (size_t)m->element[3 * e + k]],
		       &m->vertex[3 * (size_t)m->element[3 * e + (k + 1) % 3]], d);
		most = fmax(most, v3_length(d));
	}
	return most;
}

struct refined {
	struct model old, m;
	struct solution s;
	struct mesher_report r;
	uint32_t *origin;
};

/* The mesh of a scene, refined once; old is made again, since refining uses it up. */
static void refine(struct refined *f, void (*make)(struct model *), double size,
                   const double at[3], double reach)
{
	struct model base;
	struct err e = { 0 };

	*f = (struct refined){ 0 };
	make(&base);
	f->r = run(&base, sizes(size, size / 2, 0));
	f->s = lit(&base);
	doubt(&base, &f->s, at, reach);
	mesher_report_free(&f->r);
	make(&f->old);
	struct mesher_report r = run(&f->old, sizes(size, size / 2, 0));
	mesher_report_free(&r);
	make(&f->m);
	struct mesher_options o = sizes(size, size / 2, 0);
	assert_int_equal(mesher_refine(&f->m, &o, &base, &f->s, &how, &f->origin, &f->r, &e), 0);
	assert_int_equal(model_check(&f->m, &e), 0);
	check_locations(&f->m);
	check_conforming(&f->m);
	check_patches(&f->m, o.normal_cone);
	check_outlines(&f->m, 1e-10);
	model_free(&base);
}

static void release(struct refined *f)
{
	solution_free(&f->s);
	mesher_report_free(&f->r);
	model_free(&f->old);
	model_free(&f->m);
	free(f->origin);
}

static void check_origins(const struct refined *f)
{
	double *area = calloc(f->old.elements, sizeof *area);

	for (size_t i = 0; i < f->m.elements; i++) {
		uint32_t o = f->origin[i];
		assert_true(o < f->old.elements);
		assert_int_equal(f->m.element_triangle[i], f->old.element_triangle[o]);
		area[o] += f->m.element_area[i];
	}
	for (size_t o = 0; o < f->old.elements; o++)
		assert_true(fabs(area[o] - f->old.element_area[o]) < 1e-12);
	free(area);
}

static void test_conforming(void **state)
{
	struct refined f;

	(void)state;
	refine(&f, make_cube, .25, (double[]){ .3, .4, 1 }, .1);
	assert_true(f.r.marked > 0 && f.m.elements > f.old.elements);
	check_origins(&f);
	for (size_t e = 0; e < f.m.elements; e++) {
		uint32_t o = f.origin[e];
		double l = longest(&f.m, e);
		assert_true(l <= longest(&f.old, o) && l > how.smallest.value * .999);
		if (f.s.discretisation[2 * o] > 0) /* three times, which leaves .35 of the energy */
			assert_true(l < .36 * longest(&f.old, o));
		/* Bisected right triangles stay right and isosceles. */
		assert_true(f.m.element_area[e] > .249 * l * l);
	}
	release(&f);
}

/* Far from the error nothing changes, patches included. */
static void test_elsewhere(void **state)
{
	const double at[3] = { .3, .4, 1 };
	struct refined f;
	size_t same = 0;

	(void)state;
	refine(&f, make_cube, .25, at, .1);
	for (size_t e = 0; e < f.m.elements; e++) {
		double c[3];
		centroid(&f.m, e, c);
		v3_sub(c, at, c);
		if (v3_length(c) < .5)
			continue;
		assert_true(f.m.element_area[e] == f.old.element_area[f.origin[e]]);
		assert_true(fabs(f.m.patch_area[f.m.element_patch[e]] -
		                 f.old.patch_area[f.old.element_patch[f.origin[e]]]) < 1e-15);
		same++;
	}
	assert_true(same > f.old.elements / 2);
	release(&f);
}

static void test_nothing_to_do(void **state)
{
	struct refined f;

	(void)state;
	refine(&f, make_room, .3, (double[]){ 9, 9, 9 }, .1);
	assert_int_equal(f.r.marked, 0);
	assert_int_equal(f.m.elements, f.old.elements);
	assert_int_equal(f.m.patches, f.old.patches);
	for (size_t i = 0; i < f.m.elements; i++)
		assert_int_equal(f.origin[i], i);
	assert_memory_equal(f.m.vertex, f.old.vertex, 3 * f.m.vertices * sizeof(double));
	release(&f);
}

/* Errors that halving cannot take to what is asked for, since there is room for one of it, are
 * no reason to halve everything else. */
static void test_out_of_reach(void **state)
{
	const double at[3] = { .3, .4, 1 };
	const struct mesher_refinement one = { how.error, { .08, 0 }, how.elements };
	const struct mesher_options o = sizes(.25, .125, 0);
	struct model base, m;
	struct mesher_report r;
	struct err e = { 0 };
	uint32_t *origin;
	size_t near = 0;

	(void)state;
	make_cube(&base);
	r = run(&base, o);
	mesher_report_free(&r);
	make_cube(&m);
	struct solution s = lit(&base);
	for (size_t i = 0; i < s.element_sides; i++)
		s.discretisation[i] = s.discretisation_direct[i] = 1e-4;
	doubt(&base, &s, at, .1);
	for (size_t i = 0; i < s.element_sides; i++)
		near += s.discretisation[i] > .1;
	assert_int_equal(mesher_refine(&m, &o, &base, &s, &one, &origin, &r, &e), 0);
	assert_int_equal(r.marked, near);
	assert_true(r.error_expected > one.error);
	mesher_report_free(&r);
	free(origin);
	solution_free(&s);
	model_free(&base);
	model_free(&m);
}

/* A patch next to another wall whose light differs from end to end is halved, though its
 * elements are right; one in the middle of a wall is not. */
static void test_patches(void **state)
{
	struct model old, again;
	struct mesher_report r;
	struct mesher_options o = sizes(.25, .1, 0);
	struct err e = { 0 };
	uint32_t *origin;

	(void)state;
	make_room(&old);
	r = run(&old, o);
	mesher_report_free(&r);
	struct solution s = lit(&old);
	for (size_t i = 0; i < old.elements; i++) {
		double c[3];
		centroid(&old, i, c);
		for (int k = 0; k < 3; k++)
			s.direct[2 * i] += .4 * sin(8 * acos(-1) * c[k]);
	}
	make_room(&again);
	size_t before = old.patches;
	assert_int_equal(mesher_refine(&again, &o, &old, &s, &how, &origin, &r, &e), 0);
	assert_true(r.patches_marked > 0 && r.marked == 0 && again.patches > before);
	for (uint32_t p = 0; p < again.patches; p++) {
		int border = 0;
		for (size_t i = 3 * (size_t)again.patch_start[p];
		     i < 3 * (size_t)again.patch_start[p + 1]; i++)
			for (size_t k = 0; k < 3; k++) {
				double x = again.vertex[3 * (size_t)again.element[i] + k];
				const double *n = &again.element_normal[3 * (i / 3)];
				border |= fabs(n[k]) < .5 && (x < .26 || x > .74);
			}
		assert_true(border || again.patch_area[p] > .9 / 16);
	}
	solution_free(&s);
	mesher_report_free(&r);
	model_free(&old);
	model_free(&again);
	free(origin);
}

/* A wall, and a shiny plate of this exponent that faces it at a distance. */
static void make_plate(struct model *m, double distance, double exponent)
{
	begin(m, 2, 1);
	add_rectangle(m, (double[]){ 0, 0, 0 }, (double[]){ 0, 1, 0 }, (double[]){ 0, 0, 1 }, 0);
	add_rectangle(m, (double[]){ distance, 0, 0 }, (double[]){ 0, 0, 1 },
	              (double[]){ 0, 1, 0 }, 1);
	m->material.rho_d[2] = 0;
	m->material.rho_s[2] = .9;
	m->material.alpha[2] = exponent;
}

/* Patches of a surface. */
static size_t count(const struct model *m, uint32_t surface)
{
	size_t n = 0;

	for (size_t p = 0; p < m->patches; p++)
		n += m->patch_surface[p] == surface;
	return n;
}

/* Patches of the wall that are halved for the plate, where its light is uneven by so much. */
static size_t halved_for(double distance, double exponent, double uneven)
{
	struct model old, m;
	struct mesher_report r;
	struct mesher_options o = sizes(.25, .1, 0);
	struct err e = { 0 };
	uint32_t *origin;

	make_plate(&old, distance, exponent);
	r = run(&old, o);
	mesher_report_free(&r);
	struct solution s = lit(&old);
	for (size_t i = 0; i < old.elements; i++) {
		double c[3];
		centroid(&old, i, c);
		s.direct[2 * i] += uneven * sin(8 * acos(-1) * c[2]);
	}
	size_t wall = count(&old, 0), plate = count(&old, 1);
	make_plate(&m, distance, exponent);
	assert_int_equal(mesher_refine(&m, &o, &old, &s, &how, &origin, &r, &e), 0);
	size_t halved = r.patches_for_lobes;
	assert_int_equal(r.patches_marked, halved);
	assert_int_equal(count(&m, 1), plate);
	assert_int_equal(count(&m, 0) > wall, halved > 0);
	solution_free(&s);
	mesher_report_free(&r);
	model_free(&old);
	model_free(&m);
	free(origin);
	return halved;
}

/* Uneven light that a lobe sees is halved: not where the lobe is far, wide or a mirror, nor
 * where the light is even. */
static void test_lobes(void **state)
{
	(void)state;
	assert_int_equal(halved_for(.5, 50, .4), 16);
	assert_int_equal(halved_for(30, 50, .4), 0);
	assert_int_equal(halved_for(.5, .01, .4), 0);
	assert_int_equal(halved_for(.5, INFINITY, .4), 0);
	assert_int_equal(halved_for(.5, 50, 0), 0);
}

static void test_changed(void **state)
{
	struct model old, m;
	struct mesher_report r;
	struct mesher_options o = sizes(.25, .1, 0);
	struct err e = { 0 };
	uint32_t *origin;

	(void)state;
	make_cube(&old);
	r = run(&old, o);
	mesher_report_free(&r);
	struct solution s = lit(&old);
	make_cube(&m);
	m.vertex[0] -= 1e-3;
	assert_int_equal(mesher_refine(&m, &o, &old, &s, &how, &origin, &r, &e), -1);
	assert_non_null(strstr(e.text, "has changed"));
	solution_free(&s);
	mesher_report_free(&r);
	model_free(&old);
	model_free(&m);
	free(origin);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_conforming), cmocka_unit_test(test_elsewhere),
		cmocka_unit_test(test_nothing_to_do), cmocka_unit_test(test_out_of_reach),
		cmocka_unit_test(test_patches),
		cmocka_unit_test(test_lobes), cmocka_unit_test(test_changed),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
