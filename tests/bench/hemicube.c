/* Times of the hemicube on generated scenes, one thread: `key value` lines.
 *
 *   hemicube [REPEATS [FILE.mesh]]
 *
 * Medians over the fronts of elements spread over the model, or over points of the
 * floor and walls of generated rooms: render_ms.SCENE.N and gather_ms.SCENE.N for
 * resolution N; escape.SCENE.N is the mean factor that sees nothing. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "formats/cache/mesh_file.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/hemicube/hemicube.h"

static double seconds(void)
{
	struct timespec t;

	clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
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

static uint32_t mesh_add_vertex(struct model *m, const double p[3])
{
	for (size_t k = 0; k < 3; k++)
		m->vertex[3 * m->vertices + k] = p[k];
	return (uint32_t)m->vertices++;
}

/* A parallelogram grid of n x n quads. */
static void add_grid(struct model *m, const double o[3], const double u[3], const double v[3],
                     size_t n)
{
	size_t first = m->vertices;

	for (size_t j = 0; j <= n; j++)
		for (size_t i = 0; i <= n; i++) {
			double p[3];
			v3_mad(o, (double)i / (double)n, u, p);
			v3_mad(p, (double)j / (double)n, v, p);
			mesh_add_vertex(m, p);
		}
	for (size_t j = 0; j < n; j++)
		for (size_t i = 0; i < n; i++) {
			uint32_t a = (uint32_t)(first + j * (n + 1) + i), c = a + (uint32_t)n + 1;
			uint32_t t[6] = { a, a + 1, c + 1, a, c + 1, c };
			for (size_t k = 0; k < 6; k++)
				m->element.corner[3 * m->element.n + k] = t[k];
			m->element.n += 2;
		}
}

/* A box with n x n quads a side, its faces outwards (or inwards, size < 0). */
static void add_box(struct model *m, const double lo[3], const double size[3], size_t n)
{
	for (int k = 0; k < 3; k++)
		for (int far = 0; far < 2; far++) {
			double o[3] = { lo[0], lo[1], lo[2] }, u[3] = { 0 }, v[3] = { 0 };
			o[k] += far * size[k];
			int a = (k + 1 + !far) % 3, b = (k + 1 + far) % 3;
			u[a] = size[a], v[b] = size[b];
			add_grid(m, o, u, v, n);
		}
}

/* A sphere of rings x 2 rings quads. */
static void add_sphere(struct model *m, const double centre[3], double radius, size_t rings)
{
	size_t from = m->vertices;
	double o[3] = { 0 }, u[3] = { 2, 0, 0 }, v[3] = { 0, 1, 0 };

	add_grid(m, o, u, v, rings);
	for (size_t i = from; i < m->vertices; i++) {
		double *p = &m->vertex[3 * i], a = p[0] * acos(-1), b = p[1] * acos(-1);
		double q[3] = { cos(a) * sin(b), sin(a) * sin(b), -cos(b) };
		v3_mad(centre, radius, q, p);
	}
}

static struct model room(size_t wall, size_t spheres, size_t rings, size_t boxes, size_t grid)
{
	size_t elements = 12 * wall * wall + 2 * spheres * rings * rings + 12 * boxes * grid * grid;
	struct model m = { 0 };
	struct rng r = rng_seed(7, elements);
	double lo[3] = { 0, 0, 0 }, size[3] = { 6, 5, 3 };

	m.vertex = must(malloc(4 * elements * 3 * sizeof(double)));
	m.element.corner = must(malloc(elements * 3 * sizeof(uint32_t)));
	add_box(&m, lo, size, wall);
	for (size_t i = 0; i < spheres; i++) {
		double c[3] = { .5 + 5 * rng_uniform(&r), .5 + 4 * rng_uniform(&r),
			        .3 + 1.4 * rng_uniform(&r) };
		add_sphere(&m, c, .05 + .2 * rng_uniform(&r), rings);
	}
	for (size_t i = 0; i < boxes; i++) {
		double c[3] = { 5 * rng_uniform(&r), 4 * rng_uniform(&r), .01 };
		double d[3] = { .1 + .8 * rng_uniform(&r), .1 + .8 * rng_uniform(&r),
			        .1 + 1.4 * rng_uniform(&r) };
		add_box(&m, c, d, grid);
	}
	return m;
}

static int by_value(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

/* A view from the shell of a generated room. */
static void room_view(struct rng *r, size_t i, double eye[3], double normal[3])
{
	double size[3] = { 6, 5, 3 };

	for (size_t k = 0; k < 3; k++) {
		eye[k] = i % 3 == k ? 0 : size[k] * rng_uniform(r);
		normal[k] = i % 3 == k;
	}
}

static uint32_t element_view(const struct model *m, struct rng *r, double eye[3],
                             double normal[3])
{
	size_t e = (size_t)(rng_uniform(r) * (double)m->element.n);

	for (size_t k = 0; k < 3; k++) {
		eye[k] = 0;
		normal[k] = m->element.normal[3 * e + k];
	}
	for (size_t c = 0; c < 3; c++)
		v3_mad(eye, 1. / 3, &m->vertex[3 * (size_t)m->element.corner[3 * e + c]], eye);
	return (uint32_t)e;
}

static void turn(const double normal[3], double a, double frame[3][3])
{
	double t[3], b[3];

	v3_frame(normal, t, b);
	for (int c = 0; c < 3; c++) {
		frame[0][c] = cos(a) * t[c] + sin(a) * b[c];
		frame[1][c] = cos(a) * b[c] - sin(a) * t[c];
		frame[2][c] = normal[c];
	}
}

static void measure(const char *name, const struct model *m, int n, size_t repeats)
{
	struct err e = { 0 };
	struct hemicube_grid g = { 0 };
	struct hemicube h = { 0 };
	struct rng r = rng_seed(1, 1);
	double *render = must(malloc(repeats * sizeof *render)), begun = seconds();
	double escape = 0;
	struct locator locator = { 0 };
	int find = m->triangle.n > 0;
	struct hemicube_scene *s = !find || !ray_locator_init(&locator, m, &e)
	                         ? ff_hemicube_scene_new(m, find ? &locator : NULL, &e) : NULL;

	printf("build_ms.%s %.1f\n", name, 1e3 * (seconds() - begun));
	if (!s || ff_hemicube_grid_init(&g, n, &e) || ff_hemicube_init(&h, &g, &e)) {
		fprintf(stderr, "hemicube: %s\n", e.text);
		exit(1);
	}
	for (size_t i = 0; i < repeats; i++) {
		double eye[3], normal[3], frame[3][3];
		uint32_t own = HEMICUBE_VOID;
		if (m->element.normal)
			own = element_view(m, &r, eye, normal);
		else
			room_view(&r, i, eye, normal);
		turn(normal, 7 * rng_uniform(&r), frame);
		double t0 = seconds();
		ff_hemicube_render(&h, s, eye, (const double (*)[3])frame, own);
		render[i] = 1e3 * (seconds() - t0);
		for (size_t k = 0; k < g.pixels; k++)
			escape += h.item[k] == HEMICUBE_VOID ? g.delta[k] : 0;
	}
	qsort(render, repeats, sizeof *render, by_value);
	printf("render_ms.%s.%d %.3f\n", name, n, render[repeats / 2]);
	printf("escape.%s.%d %.3g\n", name, n, escape / (double)repeats);
	ff_hemicube_free(&h);
	ff_hemicube_grid_free(&g);
	ff_hemicube_scene_free(s);
	ray_locator_free(&locator);
	free(render);
}

static int measure_file(const char *path, size_t repeats)
{
	struct model m = { 0 };
	struct cache_info info = { 0 };
	struct err e = { 0 };

	if (file_mesh_read(path, &m, &info, &e)) {
		fprintf(stderr, "hemicube: %s\n", e.text);
		return 1;
	}
	printf("elements.file %zu\n", m.element.n);
	for (int n = 32; n <= 512; n *= 2)
		measure("file", &m, n, repeats);
	file_cache_info_free(&info);
	model_free(&m);
	return 0;
}

static void measure_rooms(size_t repeats)
{
	static const struct {
		const char *name;
		size_t wall, spheres, rings, boxes, grid;
	} scene[] = { { "36", 1, 0, 0, 2, 1 }, { "6k", 20, 0, 0, 2, 7 },
		{ "9k", 10, 20, 14, 0, 0 }, { "40k", 20, 100, 13, 0, 0 },
		{ "100k", 40, 100, 18, 30, 6 }, { "1M", 100, 400, 32, 30, 12 } };

	for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
		struct model m = room(scene[i].wall, scene[i].spheres, scene[i].rings,
		                     scene[i].boxes, scene[i].grid);
		printf("elements.%s %zu\n", scene[i].name, m.element.n);
		for (int n = 256; n <= 512; n *= 2)
			measure(scene[i].name, &m, n, repeats);
		free(m.vertex);
		free(m.element.corner);
	}
}

int main(int argc, char **argv)
{
	size_t repeats = argc > 1 ? strtoul(argv[1], NULL, 10) : 60;

	if (!repeats || argc > 3) {
		fprintf(stderr, "usage: hemicube [REPEATS [FILE.mesh]]\n");
		return 2;
	}
	if (argc == 3)
		return measure_file(argv[2], repeats);
	measure_rooms(repeats);
	return 0;
}
