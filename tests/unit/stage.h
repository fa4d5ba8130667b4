/* Scenes in memory with a solution, and pictures of them. */
#ifndef TWOPASS_TEST_STAGE_H
#define TWOPASS_TEST_STAGE_H

#include "grid.h"

#include "../../lib/view.h"

#define PI 3.14159265358979323846

/* A scene with its solution, ready to be viewed. */
struct stage {
	struct model m;
	struct solution s;
	struct ray_scene *rays;
	struct view_scene *view;
};

static inline void use_method(struct stage *t, enum view_method method)
{
	struct err e = { 0 };

	view_scene_free(t->view);
	assert_non_null(t->view = view_scene_new(&t->m, &t->s, t->rays, method, 1, &e));
}

static inline void stage_end(struct stage *t, double h)
{
	struct err e = { 0 };

	grid_end(&t->m);
	grid_solution(&t->m, h, &t->s);
	assert_non_null(t->rays = ray_scene_new(&t->m, &e));
	use_method(t, VIEW_MESH);
}

static inline void stage_free(struct stage *t)
{
	view_scene_free(t->view);
	ray_scene_free(t->rays);
	grid_solution_free(&t->s);
	model_free(&t->m);
}

static inline struct view_frame frame(double ex, double ey, double ez, double tx, double ty,
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

static inline struct view_options options(void)
{
	return (struct view_options){ .samples = 1, .depth = 32, .cutoff = 1e-3, .threads = 1 };
}

static inline struct view_stats render(const struct stage *t, const struct view_frame *f,
                                const struct view_options *o, struct image *im)
{
	struct view_stats stats;
	struct err e = { 0 };

	assert_int_equal(view_render(t->view, f, o, NULL, im, &stats, &e), 0);
	return stats;
}

/* One pixel that looks from eye to target. */
static inline double look(const struct stage *t, const struct view_options *o, double ex,
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
static inline void set(struct model *m, size_t material, int side, double rho_d, double tau_d,
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

/* A wall at z = 0 whose two sides differ: which coefficients count. */
static inline void wall(struct stage *t, enum lobe_kind kind)
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

#endif
