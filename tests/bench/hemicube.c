/* Times of the hemicube on generated scenes, one thread: `key value` lines.
 *
 *   hemicube [REPEATS]
 *
 * Each scene is a closed room seen from points of its floor and walls:
 * render_ms.SCENE.N and gather_ms.SCENE.N for resolution N. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "../../lib/hemicube.h"
#include "../../lib/rng.h"
#include "../../lib/vec3.h"

struct soup {
	struct model m;
	size_t capacity;
};

static double seconds(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void *must(void *p)
{
	if (!p) {
		fprintf(stderr, "hemicube: out of memory\n");
		exit(1);
	}
	return p;
}

static uint32_t add_vertex(struct soup *s, const double p[3])
{
	struct model *m = &s->m;

	for (size_t k = 0; k < 3; k++)
		m->vertex[3 * m->vertices + k] = p[k];
	return (uint32_t)m->vertices++;
}

/* A parallelogram grid of n x n quads. */
static void add_grid(struct soup *s, const double o[3], const double u[3], const double v[3],
                     size_t n)
{
	struct model *m = &s->m;
	size_t first = m->vertices;

	for (size_t j = 0; j <= n; j++)
		for (size_t i = 0; i <= n; i++) {
			double p[3];
			v3_mad(o, (double)i / (double)n, u, p);
			v3_mad(p, (double)j / (double)n, v, p);
			add_vertex(s, p);
		}
	for (size_t j = 0; j < n; j++)
		for (size_t i = 0; i < n; i++) {
			uint32_t a = (uint32_t)(first + j * (n + 1) + i), c = a + (uint32_t)n + 1;
			uint32_t t[6] = { a, a + 1, c + 1, a, c + 1, c };
			for (size_t k = 0; k < 6; k++)
				m->element[3 * m->elements + k] = t[k];
			m->elements += 2;
		}
}

/* A box with n x n quads a side, its faces outwards (or inwards, size < 0). */
static void add_box(struct soup *s, const double lo[3], const double size[3], size_t n)
{
	for (int k = 0; k < 3; k++)
		for (int far = 0; far < 2; far++) {
			double o[3] = { lo[0], lo[1], lo[2] }, u[3] = { 0 }, v[3] = { 0 };
			o[k] += far * size[k];
			int a = (k + 1 + !far) % 3, b = (k + 1 + far) % 3;
			u[a] = size[a], v[b] = size[b];
			add_grid(s, o, u, v, n);
		}
}

/* A sphere of rings x 2 rings quads. */
static void add_sphere(struct soup *s, const double centre[3], double radius, size_t rings)
{
	size_t from = s->m.vertices;
	double o[3] = { 0 }, u[3] = { 2, 0, 0 }, v[3] = { 0, 1, 0 };

	add_grid(s, o, u, v, rings);
	for (size_t i = from; i < s->m.vertices; i++) {
		double *p = &s->m.vertex[3 * i], a = p[0] * acos(-1), b = p[1] * acos(-1);
		double q[3] = { cos(a) * sin(b), sin(a) * sin(b), -cos(b) };
		v3_mad(centre, radius, q, p);
	}
}

static struct soup room(size_t wall, size_t spheres, size_t rings, size_t boxes, size_t grid)
{
	size_t elements = 12 * wall * wall + 2 * spheres * rings * rings + 12 * boxes * grid * grid;
	struct soup s = { .capacity = elements };
	struct rng r = rng_seed(7, elements);
	double lo[3] = { 0, 0, 0 }, size[3] = { 6, 5, 3 };

	s.m.vertex = must(malloc(4 * elements * 3 * sizeof(double)));
	s.m.element = must(malloc(elements * 3 * sizeof(uint32_t)));
	add_box(&s, lo, size, wall);
	for (size_t i = 0; i < spheres; i++) {
		double c[3] = { .5 + 5 * rng_uniform(&r), .5 + 4 * rng_uniform(&r),
			        .3 + 1.4 * rng_uniform(&r) };
		add_sphere(&s, c, .05 + .2 * rng_uniform(&r), rings);
	}
	for (size_t i = 0; i < boxes; i++) {
		double c[3] = { 5 * rng_uniform(&r), 4 * rng_uniform(&r), .01 };
		double d[3] = { .1 + .8 * rng_uniform(&r), .1 + .8 * rng_uniform(&r),
			        .1 + 1.4 * rng_uniform(&r) };
		add_box(&s, c, d, grid);
	}
	return s;
}

static int by_value(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

static void measure(const char *name, const struct model *m, int n, size_t repeats)
{
	struct err e = { 0 };
	struct hemi_grid g = { 0 };
	struct hemicube h = { 0 };
	struct rng r = rng_seed(1, 1);
	double *render = must(malloc(repeats * sizeof *render)), begun = seconds();
	double *gather = must(malloc(repeats * sizeof *gather));
	double *f = must(calloc(2 * m->elements, sizeof *f)), escape = 0;
	struct hemi_scene *s = hemi_scene_new(m, &e);
	double built = seconds() - begun;

	if (!s || hemi_grid_init(&g, n, &e) || hemicube_init(&h, &g, &e)) {
		fprintf(stderr, "hemicube: %s\n", e.text);
		exit(1);
	}
	for (size_t i = 0; i < repeats; i++) {
		/* Points of the shell's floor and walls. */
		double eye[3] = { 6 * rng_uniform(&r), 5 * rng_uniform(&r), 3 * rng_uniform(&r) };
		double normal[3] = { 0, 0, 0 }, frame[3][3];
		int k = (int)(i % 3);
		eye[k] = 0, normal[k] = 1;
		double t[3], b[3], a = 7 * rng_uniform(&r);
		v3_frame(normal, t, b);
		for (int c = 0; c < 3; c++) {
			frame[0][c] = cos(a) * t[c] + sin(a) * b[c];
			frame[1][c] = cos(a) * b[c] - sin(a) * t[c];
			frame[2][c] = normal[c];
		}
		double t0 = seconds();
		hemicube_render(&h, s, eye, (const double (*)[3])frame, HEMI_VOID);
		double t1 = seconds();
		escape += hemicube_gather(&h, f);
		gather[i] = 1e3 * (seconds() - t1);
		render[i] = 1e3 * (t1 - t0);
	}
	qsort(render, repeats, sizeof *render, by_value);
	qsort(gather, repeats, sizeof *gather, by_value);
	printf("render_ms.%s.%d %.3f\n", name, n, render[repeats / 2]);
	printf("gather_ms.%s.%d %.3f\n", name, n, gather[repeats / 2]);
	printf("build_ms.%s %.1f\n", name, 1e3 * built);
	printf("escape.%s.%d %.3g\n", name, n, escape / (double)repeats);
	hemicube_free(&h);
	hemi_grid_free(&g);
	hemi_scene_free(s);
	free(f);
	free(gather);
	free(render);
}

int main(int argc, char **argv)
{
	static const struct {
		const char *name;
		size_t wall, spheres, rings, boxes, grid;
	} scene[] = { { "36", 1, 0, 0, 2, 1 }, { "6k", 20, 0, 0, 2, 7 },
		{ "9k", 10, 20, 14, 0, 0 }, { "40k", 20, 100, 13, 0, 0 },
		{ "100k", 40, 100, 18, 30, 6 }, { "1M", 100, 400, 32, 30, 12 } };
	size_t repeats = argc > 1 ? strtoul(argv[1], NULL, 10) : 60;

	for (size_t i = 0; repeats && i < sizeof scene / sizeof *scene; i++) {
		struct soup s = room(scene[i].wall, scene[i].spheres, scene[i].rings,
		                     scene[i].boxes, scene[i].grid);
		printf("elements.%s %zu\n", scene[i].name, s.m.elements);
		for (int n = 256; n <= 512; n *= 2)
			measure(scene[i].name, &s.m, n, repeats);
		free(s.m.vertex);
		free(s.m.element);
	}
	return 0;
}
