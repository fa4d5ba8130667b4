/* Pictures of solved scenes: furnaces, mirrors, panes, lobes, layers, cuts. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "grid.h"

#include "../../lib/bsdf.h"
#include "../../lib/lobe.h"
#include "../../lib/view.h"
#include "../../lib/vec3.h"

#define PI 3.14159265358979323846

/* A scene with its solution, ready to be viewed. */
struct stage {
	struct model m;
	struct solution s;
	struct ray_scene *rays;
	struct view_scene *view;
};

static void use_method(struct stage *t, enum view_method method)
{
	struct err e = { 0 };

	view_scene_free(t->view);
	assert_non_null(t->view = view_scene_new(&t->m, &t->s, t->rays, method, 1, &e));
}

static void stage_end(struct stage *t, double h)
{
	struct err e = { 0 };

	grid_end(&t->m);
	grid_solution(&t->m, h, &t->s);
	assert_non_null(t->rays = ray_scene_new(&t->m, &e));
	use_method(t, VIEW_MESH);
}

static void stage_free(struct stage *t)
{
	view_scene_free(t->view);
	ray_scene_free(t->rays);
	grid_solution_free(&t->s);
	model_free(&t->m);
}

static struct view_frame frame(double ex, double ey, double ez, double tx, double ty,
                               double tz, int width, int height)
{
	double eye[3] = { ex, ey, ez }, target[3] = { tx, ty, tz }, up[3] = { .1, .2, 1 };
	struct camera c;
	struct view_frame f;
	struct err e = { 0 };

	assert_int_equal(camera_look_at(eye, target, up, 70, &c, &e), 0);
	assert_int_equal(camera_frame(&c, width, height, &f, &e), 0);
	return f;
}

static struct view_options options(void)
{
	return (struct view_options){ .samples = 1, .depth = 32, .cutoff = 1e-3, .threads = 1 };
}

static struct view_stats render(const struct stage *t, const struct view_frame *f,
                                const struct view_options *o, struct image *im)
{
	struct view_stats stats;
	struct err e = { 0 };

	assert_int_equal(view_render(t->view, f, o, NULL, im, &stats, &e), 0);
	return stats;
}

/* One pixel that looks from eye to target. */
static double look(const struct stage *t, const struct view_options *o, double ex,
                   double ey, double ez, double tx, double ty, double tz)
{
	struct view_frame f = frame(ex, ey, ez, tx, ty, tz, 1, 1);
	struct image im;

	render(t, &f, o, &im);
	double v = (double)im.pixel[0];
	image_free(&im);
	return v;
}

/* Sets all bands of a side; emission fills the side up to radiance 1 / pi. */
static void set(struct model *m, size_t material, int side, double rho_d, double tau_d,
                double rho_s, double tau_s, double k)
{
	struct materials *mt = &m->material;
	size_t at = material_at(mt, material, side);

	for (size_t b = at; b < at + (size_t)mt->bands; b++) {
		mt->rho_d[b] = rho_d;
		mt->tau_d[b] = tau_d;
		mt->rho_s[b] = rho_s;
		mt->tau_s[b] = tau_s;
		mt->emission[b] = (1 - rho_d - tau_d - rho_s - tau_s) / PI;
	}
	mt->alpha[2 * material + (size_t)side] = k;
	mt->beta[2 * material + (size_t)side] = k;
}

/* A closed box of irradiance 1: diffuse and mirror walls, and across its middle a
 * sheet that does everything. Everything must look 1 / pi bright. */
static void furnace(struct stage *t, double k)
{
	static const uint32_t material[6] = { 0, 1, 0, 1, 0, 0 };
	double lo[3] = { -1, -1, -1 }, hi[3] = { 1, 1, 1 };
	double o[3] = { -.9, -.8, -.1 }, x[3] = { 1.7, 0, .1 }, y[3] = { 0, 1.6, .2 };

	*t = (struct stage){ 0 };
	grid_new(&t->m, 7, 3, 3, 3);
	set(&t->m, 0, FRONT, .5, 0, 0, 0, (double)INFINITY);
	set(&t->m, 1, FRONT, .3, 0, .6, 0, k);
	t->m.material.one_sided[0] = t->m.material.one_sided[1] = 1;
	for (int side = 0; side < 2; side++)
		set(&t->m, 2, side, .1, .1, .3, .5, k);
	grid_box(&t->m, 3, material, lo, hi);
	grid_quad(&t->m, 3, 2, o, x, y);
	stage_end(t, 1);
}

static void test_furnace(void **state)
{
	double exponent[] = { (double)INFINITY, 20 }; /* the lobe's mirror ray: the same */
	struct view_options o = options();
	struct view_frame f = frame(.3, -.5, .6, -.2, .4, -.5, 40, 30);
	(void)state;

	o.samples = 4;
	o.depth = 60;
	o.cutoff = 1e-9;
	for (int i = 0; i < 2; i++) {
		struct stage t;
		struct image im;
		furnace(&t, exponent[i]);
		struct view_stats s = render(&t, &f, &o, &im);
		for (size_t p = 0; p < 3 * 40 * 30; p++)
			assert_true(fabs((double)im.pixel[p] * PI - 1) < 1e-6);
		assert_true(s.cut < 1e-6 * s.radiance);
		image_free(&im);
		stage_free(&t);
	}
}

/* What is cut is bounded by what is said. */
static void test_cut_bound(void **state)
{
	struct view_frame f = frame(-.5, -.7, .3, .9, .8, .2, 24, 24);
	struct stage t;
	(void)state;

	furnace(&t, (double)INFINITY);
	for (int i = 0; i < 5; i++) {
		struct view_options o = options();
		struct image im;
		o.depth = i < 4 ? i : 32;
		o.cutoff = i < 4 ? 0 : .1;
		struct view_stats s = render(&t, &f, &o, &im);
		double missing = 3 / PI - s.radiance;
		assert_true(missing > 0);
		assert_true(missing <= s.cut * (1 + 1e-6));
		assert_true(missing > .5 * s.cut); /* and the bound is not idle */
		image_free(&im);
	}
	stage_free(&t);
}

static void test_layers(void **state)
{
	struct view_options o = options();
	struct view_frame f = frame(.3, -.5, .6, -.2, .4, -.5, 24, 20);
	struct stage t;
	struct image im;
	(void)state;

	furnace(&t, (double)INFINITY);
	o.samples = 3;
	o.layers = VIEW_ALL;
	render(&t, &f, &o, &im);
	static const char *const name[] = { "R", "G", "B", "diffuse.R", "diffuse.G", "diffuse.B",
		"directional.R", "directional.G", "directional.B", "emission.R", "emission.G",
		"emission.B", "Z", "N.X", "N.Y", "N.Z", "element", "patch", "error.R", "error.G",
		"error.B" };
	assert_int_equal(im.channels, 21);
	for (int c = 0; c < 21; c++)
		assert_string_equal(im.name[c], name[c]);
	for (size_t p = 0; p < 24 * 20; p++)
		for (int c = 0; c < 3; c++) {
			float sum = image_plane(&im, 3 + c)[p] + image_plane(&im, 6 + c)[p] +
			            image_plane(&im, 9 + c)[p];
			assert_true(fabsf(sum - image_plane(&im, c)[p]) < 1e-6f);
		}
	for (size_t j = 0; j < 20; j++)
		for (size_t i = 0; i < 24; i++) {
			double org[3], dir[3], n[3], x[3];
			size_t p = j * 24 + i, element = (size_t)image_plane(&im, 16)[p];
			camera_ray(&f, (double)i + .5, (double)j + .5, org, dir);
			for (int k = 0; k < 3; k++)
				n[k] = (double)image_plane(&im, 13 + k)[p];
			assert_true(v3_dot(n, dir) < 0 && fabs(v3_length(n) - 1) < 1e-6);
			double t1 = (double)image_plane(&im, 12)[p] / v3_dot(dir, f.forward);
			v3_mad(org, t1, dir, x); /* Z leads to the element's plane */
			v3_sub(x, &t.m.vertex[3 * (size_t)t.m.element[3 * element]], x);
			assert_true(fabs(v3_dot(x, n)) < 1e-5);
			assert_true(image_plane(&im, 17)[p] ==
			            (float)t.m.element_patch[element]);
		}
	image_free(&im);
	stage_free(&t);
}

static void test_layer_names(void **state)
{
	unsigned l = 0;
	(void)state;

	assert_int_equal(view_parse_layers("Z", &l), 0);
	assert_int_equal(l, VIEW_Z);
	assert_int_equal(view_parse_layers("patch,diffuse,N", &l), 0);
	assert_int_equal(l, VIEW_PATCH | VIEW_DIFFUSE | VIEW_N);
	assert_int_equal(view_parse_layers("all", &l), 0);
	assert_int_equal(l, VIEW_ALL);
	static const char *const wrong[] = { "", "z", "Z,", ",Z", "Z,,N", "diff", "diffuse.R" };
	for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
		assert_int_equal(view_parse_layers(wrong[i], &l), -1);
}

static void test_threads(void **state)
{
	struct view_options o = options();
	struct view_frame f = frame(.3, -.5, .6, -.2, .4, -.5, 50, 37);
	struct stage t;
	struct image a, b;
	(void)state;

	furnace(&t, 7);
	o.samples = 5;
	o.lobe_samples = 3;
	o.layers = VIEW_ALL;
	struct view_stats sa = render(&t, &f, &o, &a);
	o.threads = 4;
	struct view_stats sb = render(&t, &f, &o, &b);
	assert_memory_equal(a.pixel, b.pixel, 50 * 37 * 21 * sizeof *a.pixel);
	assert_true(sa.rays == sb.rays && sa.radiance == sb.radiance && sa.cut == sb.cut);
	image_free(&a);
	image_free(&b);
	stage_free(&t);
}

/* A wall at z = 0 whose two sides differ: which coefficients count. */
static void wall(struct stage *t, enum lobe_kind kind)
{
	double o[3] = { -5, -5, 0 }, x[3] = { 10, 0, 0 }, y[3] = { 0, 10, 0 };
	double up[3] = { -50, -50, 4 }, px[3] = { 100, 0, 0 }, py[3] = { 0, 100, 0 };
	double down[3] = { -50, -50, -4 };

	*t = (struct stage){ 0 };
	grid_new(&t->m, 3, 2, 3, 1);
	t->m.lobe = kind;
	set(&t->m, 0, FRONT, .1, .2, 0, .3, (double)INFINITY);
	set(&t->m, 0, BACK, .15, .25, .4, .05, (double)INFINITY);
	t->m.material.emission[0] = .5;
	t->m.material.emission[1] = .25;
	for (size_t i = 1; i < 3; i++) { /* lamps above and below, towards the wall */
		t->m.material.emission[2 * i] = t->m.material.emission[2 * i + 1] = 0;
		t->m.material.emission[2 * i + (i == 1)] = i == 1 ? 10 : 20;
	}
	grid_quad(&t->m, 2, 0, o, x, y);
	grid_quad(&t->m, 2, 1, up, px, py);
	grid_quad(&t->m, 2, 2, down, px, py);
}

static void test_sides(void **state)
{
	struct view_options o = options();
	struct stage t;
	(void)state;

	wall(&t, LOBE_PAPER);
	stage_end(&t, 0);
	for (size_t i = 0; i < 8; i++) /* the wall: H front 2, back 3 */
		t.s.indirect[2 * i] = 2, t.s.indirect[2 * i + 1] = 3;
	use_method(&t, VIEW_MESH);
	/* Front: rho_s = 0 there, tau_s of the back; the lamp below shines through. */
	double front = .5 + (.1 * 2 + .25 * 3) / PI + .05 * 20;
	assert_true(fabs(look(&t, &o, .1, .2, 1, .3, .1, 0) - front) < 1e-5);
	/* Back: its own rho_s shows the lamp below, the front's tau_s the one above. */
	double back = .25 + (.15 * 3 + .2 * 2) / PI + .4 * 20 + .3 * 10;
	assert_true(fabs(look(&t, &o, .1, .2, -1, .3, .1, 0) - back) < 1e-5);
	stage_free(&t);
}

/* Uniform surroundings of radiance 10 seen in a lobe at 60 degrees. */
static void test_lobes(void **state)
{
	double cosine = .5, k = 30;
	(void)state;

	for (int kind = 0; kind < 2; kind++) {
		struct stage t;
		struct view_options o = options();
		wall(&t, kind ? LOBE_RECIPROCAL : LOBE_PAPER);
		set(&t.m, 0, FRONT, 0, 0, .6, 0, k);
		set(&t.m, 0, BACK, 0, 0, 0, 0, k);
		t.m.material.emission[0] = t.m.material.emission[1] = 0;
		stage_end(&t, 0);
		double x = sqrt(.75), a = lobe_albedo(k, cosine);
		double one = look(&t, &o, x, 0, .5, 0, 0, 0);
		assert_true(fabs(one - 10 * .6 * (kind ? a : 1)) < 1e-4);
		o.lobe_samples = 4096;
		double many = look(&t, &o, x, 0, .5, 0, 0, 0), expected = 0, sum = 0;
		/* The same integral by quadrature over the lobe. */
		for (int i = 0; i < 400; i++)
			for (int j = 0; j < 400; j++) {
				double c = (i + .5) / 400, s = sqrt(1 - c * c);
				double p = 2 * PI * (j + .5) / 400;
				double g = -s * cos(p) * x + c * cosine;
				double w = lobe_power(k, g) * 2 * PI / 160000.;
				expected += w * c / (kind ? fmax(c, cosine)
				                          : lobe_normaliser(k, c) * cosine);
				sum += w;
			}
		expected *= 10 * .6 * (kind ? (k + 1) / (2 * PI) : 1);
		assert_true(fabs(sum / lobe_normaliser(k, cosine) - 1) < 1e-3);
		assert_true(fabs(many / expected - 1) < 5e-3);
		stage_free(&t);
	}
}

/* A glossy floor at z = 0 of exponent k below a surface of n x n cells at z = 1: a lamp of
 * radiance `lamp`, or whose elements have some irradiance each. */
static void gloss(struct stage *t, enum lobe_kind kind, double k, size_t n, double lamp)
{
	double o[3] = { -3, -3, 0 }, x[3] = { 6, 0, 0 }, y[3] = { 0, 6, 0 };
	double size = lamp > 0 ? 1 : 8, up[3] = { -size / 2, -size / 2, 1 };
	double px[3] = { 0, size, 0 }, py[3] = { size, 0, 0 };

	*t = (struct stage){ 0 };
	grid_new(&t->m, 2, n, 2, 1);
	t->m.lobe = kind;
	set(&t->m, 0, FRONT, 0, 0, .6, 0, k);
	set(&t->m, 1, FRONT, lamp > 0 ? 0 : 1, 0, 0, 0, 1);
	memset(t->m.material.emission, 0, 4 * sizeof *t->m.material.emission);
	t->m.material.emission[2] = lamp;
	grid_quad(&t->m, n, 0, o, x, y);
	grid_quad(&t->m, n, 1, up, px, py);
	stage_end(t, 0);
	for (size_t e = 2 * n * n; e < t->m.elements && lamp == 0; e++)
		t->s.indirect[2 * e] = (double)(e * 2654435761u % 97) / 97;
	use_method(t, VIEW_MESH);
}

/* What a lobe shows of a lamp, by quadrature over the lamp. */
static void test_lamp_in_lobe(void **state)
{
	double eye[3] = { .7, -.4, .8 }, at[3] = { .1, .05, 0 }, out[3];
	(void)state;

	v3_sub(eye, at, out);
	v3_normalise(out);
	for (int kind = 0; kind < 2; kind++)
		for (double k = 0; k < 2e4; k = 3 * k + 2) {
			struct stage t;
			struct view_options o = options();
			double sum = 0, f;
			int n = 800;
			gloss(&t, kind ? LOBE_RECIPROCAL : LOBE_PAPER, k, 1, 7);
			o.lobe_samples = VIEW_LOBE_ENOUGH;
			double seen = look(&t, &o, eye[0], eye[1], eye[2], at[0], at[1], at[2]);
			for (int i = 0; i < n; i++)
				for (int j = 0; j < n; j++) {
					double d[3] = { (i + .5) / n - .5 - at[0], (j + .5) / n - .5 - at[1], 1 };
					double square = v3_dot(d, d), up[3] = { 0, 0, 1 };
					v3_normalise(d);
					bsdf_eval_lobes(&t.m, 0, up, d, out, &f);
					sum += 7 * f * d[2] * d[2] / square / (n * n);
				}
			assert_true(fabs(seen - sum) < 2e-3 * sum + 1e-6);
			stage_free(&t);
		}
}

/* Squares of standard errors, of what they are of, and of radiance, over a picture of a lobe. */
static void compare(const struct stage *t, int lobe_samples, double *stated, double *true_error,
                    double *all)
{
	struct view_frame f = frame(.5, -.6, .7, .1, .1, 0, 16, 16);
	struct view_options o = options();
	struct image a, b;

	*stated = *true_error = *all = 0;
	o.layers = VIEW_ERROR;
	o.lobe_samples = lobe_samples;
	render(t, &f, &o, &a);
	o.lobe_samples = 1024;
	render(t, &f, &o, &b);
	const float *error = image_plane(&a, image_channel(&a, "error.R"));
	for (size_t i = 0; i < 16 * 16; i++) {
		double off = (double)a.pixel[i] - (double)b.pixel[i];
		*stated += (double)error[i] * (double)error[i];
		*true_error += off * off;
		*all += (double)b.pixel[i] * (double)b.pixel[i];
	}
	image_free(&a);
	image_free(&b);
}

static void test_lobe_errors(void **state)
{
	static const int samples[] = { 0, 4, 16, 64, VIEW_LOBE_ENOUGH };
	double stated, off, all;
	(void)state;

	for (double k = 3; k < 500; k *= 8)
		for (int i = 0; i < 5; i++) {
			struct stage t;
			gloss(&t, LOBE_PAPER, k, 40, 0);
			compare(&t, samples[i], &stated, &off, &all);
			printf("# exponent %g, %d samples: stated %.3g of the true error\n", k, samples[i],
			       sqrt(stated / off));
			assert_true(stated > .25 * off);
			/* More than that, where there are many samples for how smooth light is. */
			assert_true(stated < 4 * off || stated < 2.5e-3 * all);
			stage_free(&t);
		}
}

/* Camera rays and their straight-through continuations pass black backs, mirrored
 * rays do not. */
static void test_one_sided(void **state)
{
	double lamp[3] = { -5, -5, 2 }, screen[3] = { -5, -5, 1 }, pane[3] = { -5, -5, 0 };
	double below[3] = { -5, -5, -1 }, x[3] = { 10, 0, 0 }, y[3] = { 0, 10, 0 };
	struct view_options o = options();
	struct stage t = { 0 };
	(void)state;

	grid_new(&t.m, 4, 1, 4, 1);
	set(&t.m, 0, FRONT, 0, 0, 0, 0, 1);        /* lamp, seen from below: its back */
	t.m.material.emission[1] = 7;
	t.m.material.emission[0] = 0;
	t.m.material.one_sided[1] = 1;             /* screen: front up, black below */
	t.m.material.emission[2] = 3;
	for (int side = 0; side < 2; side++) {
		set(&t.m, 2, side, 0, 0, 0, 1, (double)INFINITY); /* clear pane */
		set(&t.m, 3, side, 0, 0, 1, 0, (double)INFINITY); /* mirror */
	}
	grid_quad(&t.m, 1, 0, lamp, x, y);
	grid_quad(&t.m, 1, 1, screen, x, y);
	grid_quad(&t.m, 1, 2, pane, x, y);
	grid_quad(&t.m, 1, 3, below, x, y);
	stage_end(&t, 0);
	assert_true(fabs(look(&t, &o, .1, .2, .5, .3, .1, 2) - 7) < 1e-6);
	assert_true(fabs(look(&t, &o, .1, .2, -.5, .3, .1, 2) - 7) < 1e-6);
	assert_true(look(&t, &o, .1, .2, .5, .3, .1, -1) == 0);
	assert_true(fabs(look(&t, &o, .1, .2, 1.5, .3, .1, -1) - 3) < 1e-6);
	stage_free(&t);
}

static void test_background_and_bands(void **state)
{
	double p[3] = { -1, -1, 0 }, x[3] = { 2, 0, 0 }, y[3] = { 0, 2, 0 };
	struct view_options o = options();
	(void)state;

	for (int bands = 1; bands <= 5; bands++) {
		struct stage t = { 0 };
		struct image im;
		struct view_frame f = frame(0, 0, 2, .01, 0, 0, 9, 9);
		grid_new(&t.m, 1, 1, 1, bands);
		set(&t.m, 0, FRONT, 0, 0, 0, 0, 1);
		for (int b = 0; b < bands; b++)
			t.m.material.emission[b] = b + 1;
		grid_quad(&t.m, 1, 0, p, x, y);
		stage_end(&t, 0);
		o.layers = VIEW_Z | VIEW_ELEMENT;
		render(&t, &f, &o, &im);
		int named = bands == 1 || bands == 3 ? 0 : bands;
		assert_int_equal(im.channels, 3 + named + 2);
		for (int c = 0; c < 3; c++)
			assert_true(image_plane(&im, c)[40] == (float)(c < bands ? c + 1 : bands));
		for (int b = 0; b < named; b++) {
			char name[16];
			snprintf(name, sizeof name, "band.%d", b);
			assert_int_equal(image_channel(&im, name), 3 + b);
			assert_true(image_plane(&im, 3 + b)[40] == (float)(b + 1));
		}
		assert_true(im.pixel[0] == 0); /* the corner looks past it */
		assert_true(isinf(image_plane(&im, image_channel(&im, "Z"))[0]));
		assert_true(image_plane(&im, image_channel(&im, "element"))[0] == -1);
		image_free(&im);
		stage_free(&t);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_furnace), cmocka_unit_test(test_cut_bound),
		cmocka_unit_test(test_layers), cmocka_unit_test(test_layer_names),
		cmocka_unit_test(test_threads), cmocka_unit_test(test_sides),
		cmocka_unit_test(test_lobes), cmocka_unit_test(test_lamp_in_lobe),
		cmocka_unit_test(test_lobe_errors), cmocka_unit_test(test_one_sided),
		cmocka_unit_test(test_background_and_bands)
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
