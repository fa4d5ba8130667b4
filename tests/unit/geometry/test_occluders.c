/* Occluders, shafts and partly hidden polygons: against hand-made scenes and brute force. */
#include <math.h>
#include <stdlib.h>

#include "lib/occlusion/exchange.h"
#include "lib/occlusion/facet_set.h"
#include "lib/occlusion/occluder_set.h"
#include "lib/occlusion/visible_region.h"
#include "tests/unit/fixtures/brute.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/random_scene.h"

struct lab {
	struct model m;
	struct facet_set s;
	struct occluder_set occluders;
	double centre[3];
	struct exchanger x;
};

static void ready(struct lab *l, double absolute)
{
	struct err e = { 0 };
	struct exchange_options o = { .relative = 1e-9, .absolute = absolute, .most = 50000,
	                              .occluders = SHAFT_OCCLUDERS };

	assert_int_equal(occ_facet_set_init(&l->s, &l->m, FACETS_OF_PATCHES, &e), 0);
	assert_int_equal(occ_occluder_set_init(&l->occluders, &l->m, &e), 0);
	occ_facet_centre(&l->m, l->centre);
	occ_exchanger_init(&l->x, &o, &l->occluders, NULL, l->centre);
}

static void finish(struct lab *l)
{
	occ_exchanger_free(&l->x);
	occ_facet_set_free(&l->s);
	occ_occluder_set_free(&l->occluders);
	model_free(&l->m);
}

static size_t flats(const struct occluder_set *s)
{
	size_t n = 0;

	for (size_t i = 0; i < s->occluders; i++)
		n += s->occluder[i].flat != 0;
	return n;
}

/* ---- occluders ---- */

/* A wide room: nothing else is on the scene's hull. */
static void far_room(struct model *m, int one_sided)
{
	scene_begin(m, one_sided);
	scene_block(m, -10, -10, -10, 10, 10, 10, ALL_FACES, 1, 1);
}

/* Bodies of a scene of one block in a room: how many, and how many are flat. */
static void check_block(int faces, int k, int one_sided, size_t occluders, size_t flat)
{
	struct lab l = { 0 };

	far_room(&l.m, one_sided);
	scene_block(&l.m, 0, 0, 0, 1, 2, 3, faces, k, 0);
	assert_int_equal(scene_end(&l.m), 0);
	ready(&l, 1e-6);
	assert_int_equal(l.occluders.occluders, occluders);
	assert_int_equal(flats(&l.occluders), flat);
	if (occluders && !flat) {
		assert_int_equal(l.occluders.occluder[0].corners, 8);
		assert_int_equal(l.occluders.occluder[0].edges, 12);
		assert_int_equal(l.occluders.occluder[0].faces, 6);
	}
	finish(&l);
}

static void test_block(void **state)
{
	(void)state;
	for (int k = 1; k <= 4; k++) {
		given("k %d", k);
		check_block(ALL_FACES, k, 1, 1, 0);
		check_block(NO_BOTTOM, k, 1, 1, 0);
		check_block(ALL_FACES, k, 0, 1, 0);   /* nothing sees into it */
		check_block(NO_BOTTOM, k, 0, 5, 5);   /* its backs are seen from below */
		check_block(51, k, 1, 4, 4);          /* two faces are missing */
		check_block(1, k, 1, 1, 1);
	}
}

static void test_room(void **state)
{
	(void)state;
	for (int inwards = 0; inwards < 2; inwards++)
		for (int one_sided = 0; one_sided < 2; one_sided++)
			for (int faces = 1; faces < 64; faces = 2 * faces + 1) {
				given("inwards %d, one_sided %d, faces %d", inwards, one_sided, faces);
				struct lab l = { 0 };
				scene_begin(&l.m, one_sided);
				scene_block(&l.m, 0, 0, 0, 1, 2, 3, faces, 3, inwards);
				assert_int_equal(scene_end(&l.m), 0);
				ready(&l, 1e-6);
				assert_int_equal(l.occluders.occluders, 0);
				finish(&l);
			}
}

/* An L-shaped prism is not one solid, nor are two boxes that share a face. */
static void test_not_convex(void **state)
{
	static const double outline[6][2] = { { 0, 0 }, { 2, 0 }, { 2, 1 }, { 1, 1 }, { 1, 2 }, { 0, 2 } };
	struct lab l = { 0 };
	double v[6][3];

	(void)state;
	far_room(&l.m, 1);
	for (int i = 0; i < 6; i++) {
		const double *a = outline[i], *b = outline[(i + 1) % 6];
		scene_quad(&l.m, (double[]){ a[0], a[1], 0 }, (double[]){ b[0], b[1], 0 },
		           (double[]){ b[0], b[1], 1 }, (double[]){ a[0], a[1], 1 });
	}
	/* As fans from the inner corner, which see it all. */
	for (int i = 0; i < 6; i++) {
		memcpy(v[i], (double[]){ outline[(i + 3) % 6][0], outline[(i + 3) % 6][1], 1 }, sizeof v[i]);
	}
	scene_polygon(&l.m, 6, (const double (*)[3])v);
	assert_int_equal(scene_end(&l.m), 0);
	ready(&l, 1e-6);
	for (size_t i = 0; i < l.occluders.occluders; i++) {
		given("i %zu", i);
		const struct occluder_shape *b = &l.occluders.occluder[i];
		/* No body holds the notch. */
		int holds = !b->flat;
		for (uint32_t f = 0; holds && f < b->faces; f++) {
			const struct plane *p = &l.occluders.face[b->face + f];
			const double notch[3] = { 1.5 - l.centre[0], 1.5 - l.centre[1], .5 - l.centre[2] };
			holds = v3_dot(p->normal, notch) < p->offset;
		}
		assert_false(holds);
	}
	finish(&l);
}

/* Whatever they are made of, a wide face of theirs hides as one. */
static void test_sharing(void **state)
{
	struct lab l = { 0 };
	struct err e = { 0 };
	double off;

	(void)state;
	far_room(&l.m, 1);
	scene_block(&l.m, 0, 0, 0, 1, 1, 1, ALL_FACES, 1, 0);
	scene_block(&l.m, 1, 0, 0, 2, 1, 1, ALL_FACES, 1, 0);
	scene_quad(&l.m, (double[]){ .5, .4, -1 }, (double[]){ 1.5, .4, -1 }, (double[]){ 1.5, .6, -1 },
	           (double[]){ .5, .6, -1 });
	scene_quad(&l.m, (double[]){ .5, .4, 2 }, (double[]){ .5, .6, 2 }, (double[]){ 1.5, .6, 2 },
	           (double[]){ 1.5, .4, 2 });
	assert_int_equal(scene_end(&l.m), 0);
	ready(&l, 1e-6);
	uint32_t n = (uint32_t)l.s.facets;
	assert_near(occ_exchange(&l.x, &l.s, n - 1, &l.s, n - 2, &off, &e), 0, 1e-6);
	finish(&l);
}

/* A floor of unlike rectangles with T-junctions, away from the hull: it hides as one. */
static void test_t_junctions(void **state)
{
	struct lab l = { 0 };
	double off;
	struct err e = { 0 };

	(void)state;
	far_room(&l.m, 1);
	scene_grid(&l.m, (double[]){ -9, -9, 0 }, (double[]){ 9, 0, 0 }, (double[]){ 0, 18, 0 }, 1);
	scene_grid(&l.m, (double[]){ 0, -9, 0 }, (double[]){ 9, 0, 0 }, (double[]){ 0, 18, 0 }, 3);
	const double up = .5, down = -.5;
	scene_quad(&l.m, (double[]){ -1, -1, down }, (double[]){ 1, -1, down }, (double[]){ 1, 1, down },
	           (double[]){ -1, 1, down });
	scene_quad(&l.m, (double[]){ -1, -1, up }, (double[]){ -1, 1, up }, (double[]){ 1, 1, up },
	           (double[]){ 1, -1, up });
	assert_int_equal(scene_end(&l.m), 0);
	ready(&l, 1e-6);
	uint32_t n = (uint32_t)l.s.facets;
	assert_near(occ_exchange(&l.x, &l.s, n - 1, &l.s, n - 2, &off, &e), 0, 4e-6);
	finish(&l);
}

/* What is inside a two-sided box sees it, and the open side of an open one. */
static void test_inside(void **state)
{
	struct err e = { 0 };

	(void)state;
	for (int faces = 31; faces < 64; faces += 32) {
		given("faces %d", faces);
		struct lab l = { 0 };
		double off, sum = 0;
		far_room(&l.m, 0);
		scene_block(&l.m, 0, 0, 0, 1, 1, 1, faces, 1, 0);
		assert_int_equal(scene_end(&l.m), 0);
		ready(&l, 1e-7);
		/* The back of its first face: two faces before are the room's. */
		uint32_t back = l.s.start[2 * 6 + 1];
		for (uint32_t i = 0; i < l.s.facets; i++)
			sum += i == back ? 0 : occ_exchange(&l.x, &l.s, back, &l.s, i, &off, &e);
		assert_near(sum, 1, 1e-5);
		finish(&l);
	}
}

/* A cone's front part has more edges than the cone; one of many sides stays its faces. */
static void check_cone(int sides, size_t occluders, size_t flat)
{
	struct lab l = { 0 };
	struct err e = { 0 };
	double off, sum = 0, x[32][3];

	far_room(&l.m, 1);
	for (int i = 0; i < sides; i++) {
		x[i][0] = cos(2 * 3.14159265358979 * i / sides);
		x[i][1] = sin(2 * 3.14159265358979 * i / sides);
		x[i][2] = -10;
	}
	for (int i = 0; i < sides; i++) {
		double v[3][3] = { { x[i][0], x[i][1], -10 }, { 0, 0, 0 }, { 0 } };
		memcpy(v[1], x[(i + 1) % sides], sizeof v[1]);
		scene_polygon(&l.m, 3, (const double (*)[3])v);
	}
	/* It looks down from just below the top, beside it. */
	scene_quad(&l.m, (double[]){ .3, -2, -1 }, (double[]){ .3, 2, -1 }, (double[]){ 2, 2, -1 },
	           (double[]){ 2, -2, -1 });
	assert_int_equal(scene_end(&l.m), 0);
	ready(&l, 1e-3);
	assert_int_equal(l.occluders.occluders, occluders);
	assert_int_equal(flats(&l.occluders), flat);
	uint32_t last = (uint32_t)l.s.facets - 1;
	for (uint32_t i = 0; i < last; i++)
		sum += occ_exchange(&l.x, &l.s, last, &l.s, i, &off, &e);
	assert_false(e.set);
	assert_near(sum, l.s.facet[last].area, .03 * l.s.facet[last].area);
	finish(&l);
}

static void test_cone(void **state)
{
	(void)state;
	check_cone(5, 2, 1);
	check_cone(24, 2, 1);
	check_cone(31, 32, 32);
}

/* ---- shafts ---- */

/* Of two unit squares, past a beam between them from x = at. */
static enum shaft_state look(int solid, double at, double side)
{
	struct lab l = { 0 };
	struct shaft s = { .most = SHAFT_OCCLUDERS };

	far_room(&l.m, 1);
	scene_quad(&l.m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 1, 1, 0 },
	           (double[]){ 0, 1, 0 });
	scene_quad(&l.m, (double[]){ 0, 0, 2 }, (double[]){ 0, 1, 2 }, (double[]){ 1, 1, 2 },
	           (double[]){ 1, 0, 2 });
	if (solid)
		scene_block(&l.m, at, -.5, .8, at + side, 1.5, 1.2, ALL_FACES, 1, 0);
	else
		scene_grid(&l.m, (double[]){ at, -.5, 1 }, (double[]){ side, 0, 0 }, (double[]){ 0, 2, 0 }, 1);
	assert_int_equal(scene_end(&l.m), 0);
	ready(&l, 1e-6);
	enum shaft_state found = occ_shaft_cull(&s, &l.occluders, &l.s.facet[6], &l.s.facet[7]);
	finish(&l);
	return found;
}

static void test_shaft(void **state)
{
	(void)state;
	for (int solid = 0; solid < 2; solid++) {
		given("solid %d", solid);
		assert_int_equal(look(solid, 1, 1), SHAFT_UNOCCLUDED);       /* touches the shaft */
		assert_int_equal(look(solid, 2, 1), SHAFT_UNOCCLUDED);
		assert_int_equal(look(solid, .9, 1), SHAFT_PARTLY);
		assert_int_equal(look(solid, .4, .01), SHAFT_PARTLY);
		assert_int_equal(look(solid, -.2, 1), SHAFT_PARTLY);
		assert_int_equal(look(solid, -.5, 2), SHAFT_HIDDEN);
		assert_int_equal(look(solid, -2, 6), SHAFT_HIDDEN);
	}
}

/* ---- against brute force ---- */

static struct brute brute;

/* A part of a facet in front of another. 0 if there is none. */
static int in_front(const struct facet *f, const struct facet *of, double near,
                    struct facet_room *room, struct facet *out)
{
	double low, high;

	geo_facet_heights(f, of->normal, of->offset, &low, &high);
	*out = *f;
	if (high <= near || low >= -near)
		return high > near;
	if (!geo_facet_clip(f, of->normal, of->offset, room))
		return 0;
	*out = room->f;
	return 1;
}

/* What points see, for all pairs of random scenes: occ_shaft_cull, occ_occluder_make and seen. */
static void test_seen(void **state)
{
	(void)state;
	for (uint64_t seed = 1; seed <= 24; seed++) {
		given("seed %d", (int)seed);
		struct lab l = { 0 };
		struct dice d = { seed, 1000 };
		struct err e = { 0 };
		static struct visible_point seer;
		assert_int_equal(random_scene(&l.m, seed), 0);
		ready(&l, 1e-6);
		const double near = l.occluders.near;
		for (int pair = 0; pair < 300; pair++) {
			struct facet_room room[2];
			struct facet f, g;
			struct shaft s = { .most = SHAFT_OCCLUDERS };
			const struct facet *a = &l.s.facet[roll_int(&d, 0, (int)l.s.facets - 1)];
			const struct facet *b = &l.s.facet[roll_int(&d, 0, (int)l.s.facets - 1)];
			if (a == b || !in_front(a, b, near, &room[0], &f) ||
			    !in_front(b, a, near, &room[1], &g))
				continue;
			enum shaft_state shaft = occ_shaft_cull(&s, &l.occluders, &f, &g);
			int occluders = 0;
			for (int i = 0; shaft == SHAFT_PARTLY && i < s.occluders; i++)
				occluders += occ_occluder_make(&l.occluders, s.occluder[i], &g, &seer.occluder[occluders]);
			occ_visible_begin(&seer, occluders, near);
			brute_begin(&brute, &l.m, l.centre, &f, &g, near);
			for (int k = 0; k < 4; k++) {
				double x[3], u = sqrt(roll(&d, 0, 1)), w = roll(&d, 0, 1);
				int c = roll_int(&d, 1, f.n - 2);
				for (int i = 0; i < 3; i++)
					x[i] = (1 - u) * f.v[i] + u * ((1 - w) * f.v[3 * c + i] + w * f.v[3 * c + 3 + i]);
				double exact = brute_point(&brute, x), got = 0;
				if (shaft != SHAFT_HIDDEN)
					got = occ_visible_exchange(&seer, x, f.normal, &g, occluders ? UINT64_MAX >> (64 - occluders) : 0, &e);
				if (!(fabs(got - exact) <= 2e-6))
					fail_msg("seed %d, facets %d and %d: %.12g, brute %.12g (shaft %d)", (int)seed,
					         (int)(a - l.s.facet), (int)(b - l.s.facet), got, exact, (int)shaft);
			}
		}
		finish(&l);
	}
}

/* Boxes and plates between two quadrilaterals. */
static void test_exchange(void **state)
{
	struct err e = { 0 };
	struct dice d = { 23, 0 };

	(void)state;
	for (int k = 0; k < 12; k++) {
		given("k %d", k);
		struct lab l = { 0 };
		double off, at[3];
		far_room(&l.m, k & 1);
		scene_quad(&l.m, (double[]){ 0, 0, 0 }, (double[]){ 1, 0, 0 }, (double[]){ 1.2, 1, 0 },
		           (double[]){ 0, 1, 0 });
		scene_quad(&l.m, (double[]){ 0, 0, 2 }, (double[]){ 0, 1, 1.8 }, (double[]){ 1, 1, 1.8 },
		           (double[]){ 1, 0, 2 });
		for (int i = 0; i < 1 + k % 3; i++) {
			for (int c = 0; c < 3; c++)
				at[c] = roll(&d, .2, .8) + (c == 2 ? .4 : 0);
			if ((k + i) & 1)
				random_box(&l.m, &d, at, .5, 0, ALL_FACES);
			else
				random_plate(&l.m, &d, at, .7, roll(&d, 0, 1) < .3);
		}
		assert_int_equal(scene_end(&l.m), 0);
		ready(&l, 1e-6);
		uint32_t a = l.s.start[2 * 6], b = l.s.start[2 * 7];
		double got = occ_exchange(&l.x, &l.s, a, &l.s, b, &off, &e);
		brute_begin(&brute, &l.m, l.centre, &l.s.facet[a], &l.s.facet[b], l.occluders.near);
		assert_near(got, brute_exchange(&brute, 1e-4, 3), 4e-6);
		assert_that(off, <=, 1.2e-6);
		double back = occ_exchange(&l.x, &l.s, b, &l.s, a, &off, &e);
		assert_near(back, got, 4e-6);
		finish(&l);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_block),
		cmocka_unit_test(test_room),
		cmocka_unit_test(test_not_convex),
		cmocka_unit_test(test_sharing),
		cmocka_unit_test(test_t_junctions),
		cmocka_unit_test(test_inside),
		cmocka_unit_test(test_cone),
		cmocka_unit_test(test_shaft),
		cmocka_unit_test(test_seen),
		slow_unit_test(test_exchange),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
