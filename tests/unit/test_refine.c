/* Refinement: what is divided, that it stays conforming, what stays as it was. */
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/grid.h"
#include "tests/unit/fixtures/shapes.h"

static const struct mesh_refinement how = { .01, { .02, 0 }, 100000 };

static void centroid(const struct model *m, size_t e, double c[3])
{
	c[0] = c[1] = c[2] = 0;
	for (size_t k = 0; k < 3; k++)
		v3_mad(c, 1. / 3, &m->vertex[3 * (size_t)m->element.corner[3 * e + k]], c);
}

/* Errors near a point of the front. */
static void doubt(const struct model *m, struct solution *s, const double at[3], double reach)
{
	for (size_t e = 0; e < m->element.n; e++) {
		double c[3];
		centroid(m, e, c);
		v3_sub(c, at, c);
		if (v3_length(c) < reach)
			s->error.discretisation[2 * e] = s->error.discretisation_direct[2 * e] = .5;
	}
}

static double longest(const struct model *m, size_t e)
{
	double most = 0, d[3];

	for (size_t k = 0; k < 3; k++) {
		v3_sub(&m->vertex[3 * (size_t)m->element.corner[3 * e + k]],
		       &m->vertex[3 * (size_t)m->element.corner[3 * e + (k + 1) % 3]], d);
		most = fmax(most, v3_length(d));
	}
	return most;
}

struct refined {
	struct model base, old, m; /* base is used up by refining, old is the same again */
	struct solution s;         /* of these: light 1 everywhere, without errors at first */
	struct mesh_report r;
	uint32_t *origin;
	struct err e;
};

static void mesh(struct model *m, void (*make)(struct model *), struct mesh_options o)
{
	make(m);
	struct mesh_report r = run(m, o);
	mesh_report_free(&r);
}

static void prepare(struct refined *f, void (*make)(struct model *), struct mesh_options o)
{
	*f = (struct refined){ 0 };
	mesh(&f->base, make, o);
	mesh(&f->old, make, o);
	make(&f->m);
	grid_solution(&f->old, 0, &f->s);
	for (size_t i = 0; i < f->s.element_sides; i++)
		f->s.irradiance.direct[i] = 1;
}

/* Light that differs along some of the axes. */
static void make_uneven(struct refined *f, double by, int first_axis)
{
	for (size_t i = 0; i < f->old.element.n; i++) {
		double c[3];
		centroid(&f->old, i, c);
		for (int k = first_axis; k < 3; k++)
			f->s.irradiance.direct[2 * i] += by * sin(8 * acos(-1) * c[k]);
	}
}

static int refine_once(struct refined *f, const struct mesh_options *o,
                       const struct mesh_refinement *to)
{
	return mesh_refine(&f->m, o, &f->base, &f->s, to, &f->origin, &f->r, &f->e);
}

/* The mesh of a scene, refined near a point. */
static void refine(struct refined *f, void (*make)(struct model *), double size,
                   const double at[3], double reach)
{
	struct mesh_options o = sizes(size, size / 2, 0);

	prepare(f, make, o);
	doubt(&f->old, &f->s, at, reach);
	assert_int_equal(refine_once(f, &o, &how), 0);
	assert_int_equal(model_check(&f->m, &f->e), 0);
	check_locations(&f->m);
	check_conforming(&f->m);
	check_patches(&f->m, o.normal_cone);
	check_outlines(&f->m, 1e-10);
}

static void release(struct refined *f)
{
	grid_solution_free(&f->s);
	mesh_report_free(&f->r);
	model_free(&f->base);
	model_free(&f->old);
	model_free(&f->m);
	free(f->origin);
}

static void check_origins(const struct refined *f)
{
	double *area = calloc(f->old.element.n, sizeof *area);

	for (size_t i = 0; i < f->m.element.n; i++) {
		uint32_t o = f->origin[i];
		assert_that(o, <, f->old.element.n);
		assert_int_equal(f->m.element.triangle[i], f->old.element.triangle[o]);
		area[o] += f->m.element.area[i];
	}
	for (size_t o = 0; o < f->old.element.n; o++)
		assert_near(area[o], f->old.element.area[o], 1e-12);
	free(area);
}

static void test_conforming(void **state)
{
	struct refined f;

	(void)state;
	refine(&f, make_cube, .25, (double[]){ .3, .4, 1 }, .1);
	assert_that(f.r.marked, >, 0);
	assert_that(f.m.element.n, >, f.old.element.n);
	check_origins(&f);
	for (size_t e = 0; e < f.m.element.n; e++) {
		given("e %zu", e);
		uint32_t o = f.origin[e];
		double l = longest(&f.m, e);
		assert_that(l, <=, longest(&f.old, o));
		assert_that(l, >, how.smallest.value * .999);
		if (f.s.error.discretisation[2 * o] > 0) /* three times, which leaves .35 of the energy */
			assert_that(l, <, .36 * longest(&f.old, o));
		/* Bisected right triangles stay right and isosceles. */
		assert_that(f.m.element.area[e], >, .249 * l * l);
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
	for (size_t e = 0; e < f.m.element.n; e++) {
		given("e %zu", e);
		double c[3];
		centroid(&f.m, e, c);
		v3_sub(c, at, c);
		if (v3_length(c) < .5)
			continue;
		assert_that(f.m.element.area[e], ==, f.old.element.area[f.origin[e]]);
		assert_near(f.m.patch.area[f.m.element.patch[e]],
		            f.old.patch.area[f.old.element.patch[f.origin[e]]], 1e-15);
		same++;
	}
	assert_that(same, >, f.old.element.n / 2);
	release(&f);
}

static void test_nothing_to_do(void **state)
{
	struct refined f;

	(void)state;
	refine(&f, make_room, .3, (double[]){ 9, 9, 9 }, .1);
	assert_int_equal(f.r.marked, 0);
	assert_int_equal(f.m.element.n, f.old.element.n);
	assert_int_equal(f.m.patch.n, f.old.patch.n);
	for (size_t i = 0; i < f.m.element.n; i++) {
		given("i %zu", i);
		assert_int_equal(f.origin[i], i);
	}
	assert_memory_equal(f.m.vertex, f.old.vertex, 3 * f.m.vertices * sizeof(double));
	release(&f);
}

/* Errors that halving cannot take to what is asked for, since there is room for one of it, are
 * no reason to halve everything else. */
static void test_out_of_reach(void **state)
{
	const double at[3] = { .3, .4, 1 };
	const struct mesh_refinement one = { how.error, { .08, 0 }, how.elements };
	const struct mesh_options o = sizes(.25, .125, 0);
	struct refined f;
	size_t near = 0;

	(void)state;
	prepare(&f, make_cube, o);
	for (size_t i = 0; i < f.s.element_sides; i++)
		f.s.error.discretisation[i] = f.s.error.discretisation_direct[i] = 1e-4;
	doubt(&f.old, &f.s, at, .1);
	for (size_t i = 0; i < f.s.element_sides; i++)
		near += f.s.error.discretisation[i] > .1;
	assert_int_equal(refine_once(&f, &o, &one), 0);
	assert_int_equal(f.r.marked, near);
	assert_that(f.r.error_expected, >, one.error);
	release(&f);
}

/* A patch next to another wall whose light differs from end to end is halved, though its
 * elements are right; one in the middle of a wall is not. */
static void test_patches(void **state)
{
	struct mesh_options o = sizes(.25, .1, 0);
	struct refined f;

	(void)state;
	prepare(&f, make_room, o);
	make_uneven(&f, .4, 0);
	assert_int_equal(refine_once(&f, &o, &how), 0);
	assert_that(f.r.patches_marked, >, 0);
	assert_that(f.r.marked, ==, 0);
	assert_that(f.m.patch.n, >, f.old.patch.n);
	for (uint32_t p = 0; p < f.m.patch.n; p++) {
		given("p %u", p);
		int border = 0;
		for (size_t i = 3 * (size_t)f.m.patch.start[p];
		     i < 3 * (size_t)f.m.patch.start[p + 1]; i++)
			for (size_t k = 0; k < 3; k++) {
				double x = f.m.vertex[3 * (size_t)f.m.element.corner[i] + k];
				const double *n = &f.m.element.normal[3 * (i / 3)];
				border |= fabs(n[k]) < .5 && (x < .26 || x > .74);
			}
		assert_true(border || f.m.patch.area[p] > .9 / 16);
	}
	release(&f);
}

/* A wall, and a shiny plate of an exponent that faces it at a distance. */
static double plate_distance, plate_exponent;

static void make_plate(struct model *m)
{
	begin(m, 2, 1);
	add_rectangle(m, (double[]){ 0, 0, 0 }, (double[]){ 0, 1, 0 }, (double[]){ 0, 0, 1 }, 0);
	add_rectangle(m, (double[]){ plate_distance, 0, 0 }, (double[]){ 0, 0, 1 },
	              (double[]){ 0, 1, 0 }, 1);
	m->material.rho_d[2] = 0;
	m->material.rho_s[2] = .9;
	m->material.alpha[2] = plate_exponent;
}

/* Patches of a surface. */
static size_t count(const struct model *m, uint32_t surface)
{
	size_t n = 0;

	for (size_t p = 0; p < m->patch.n; p++)
		n += m->patch.surface[p] == surface;
	return n;
}

/* Patches of the wall that are halved for the plate, where its light is uneven by so much. */
static size_t halved_for(double distance, double exponent, double uneven)
{
	struct mesh_options o = sizes(.25, .1, 0);
	struct refined f;

	plate_distance = distance;
	plate_exponent = exponent;
	prepare(&f, make_plate, o);
	make_uneven(&f, uneven, 2);
	assert_int_equal(refine_once(&f, &o, &how), 0);
	size_t halved = f.r.patches_for_lobes;
	assert_int_equal(f.r.patches_marked, halved);
	assert_int_equal(count(&f.m, 1), count(&f.old, 1));
	assert_int_equal(count(&f.m, 0) > count(&f.old, 0), halved > 0);
	release(&f);
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
	struct mesh_options o = sizes(.25, .1, 0);
	struct refined f;

	(void)state;
	prepare(&f, make_cube, o);
	f.m.vertex[0] -= 1e-3;
	assert_int_equal(refine_once(&f, &o, &how), -1);
	assert_non_null(strstr(f.e.text, "has changed"));
	release(&f);
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
