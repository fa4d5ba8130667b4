/* The yardsticks of `make bench`: a bare Embree loop over stored rays, and the
 * machine's memory read bandwidth; `key value` lines.
 *
 *   rays FILE.mesh COUNT THREADS
 *   rays FILE.mesh COUNT THREADS --camera NAME WxH
 *
 * Without a camera, COUNT cosine-distributed rays leave patch-sides spread evenly
 * over the model, all rays of a side together, as `ffcalc -m rays` casts them.
 * With one, primary rays in tiles of 8 x 8 pixels, from one pixel centre each,
 * repeated to at least COUNT rays.
 *
 *   mray_per_s   millions of rays a second, the tracing loop alone
 *   rays, hits   how many, and the fraction that hit
 *   read_gb_per_s  sum of a buffer larger than any cache */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "formats/cache/mesh_file.h"
#include "lib/base/mem.h"
#include "lib/base/parallel.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/picture/camera.h"
#include "lib/scatter/lobe.h"

#if defined(__has_include)
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#define EMBREE 4
#endif
#endif
#ifndef EMBREE
#include <embree3/rtcore.h>
#define EMBREE 3
#endif

enum { PASSES = 5, SIDE_RAYS = 4096, TILE = 8 };

static const size_t READ_BYTES = (size_t)1 << 29;

struct stored {
	float org[3], dir[3];
};

struct bench {
	struct model m;
	RTCDevice device;
	RTCScene scene;
	double centre[3], unit;    /* as lib/ray.c: unit scale about the centre */
	struct stored *ray;
	size_t rays;
	size_t hits[256];          /* by thread */
	uint64_t *buffer;
	uint64_t sum[256];
};

/* ---- the scene, built as lib/ray.c builds it ---- */

static void measure_extent(struct bench *b)
{
	double lo[3], hi[3];

	for (int k = 0; k < 3; k++)
		lo[k] = INFINITY, hi[k] = -INFINITY;
	for (size_t i = 0; i < 3 * b->m.triangle.n; i++)
		for (int k = 0; k < 3; k++) {
			double x = b->m.vertex[3 * (size_t)b->m.triangle.corner[i] + (size_t)k];
			lo[k] = fmin(lo[k], x);
			hi[k] = fmax(hi[k], x);
		}
	for (int k = 0; k < 3; k++) {
		b->centre[k] = (lo[k] + hi[k]) / 2;
		b->unit = fmax(b->unit, (hi[k] - lo[k]) / 2);
	}
}

static void to_unit(const struct bench *b, const double x[3], float out[3])
{
	for (int k = 0; k < 3; k++)
		out[k] = (float)((x[k] - b->centre[k]) / b->unit);
}

static int build(struct bench *b)
{
	RTCGeometry g;

	b->device = rtcNewDevice(NULL);
	b->scene = rtcNewScene(b->device);
	rtcSetSceneFlags(b->scene, RTC_SCENE_FLAG_ROBUST);
	g = rtcNewGeometry(b->device, RTC_GEOMETRY_TYPE_TRIANGLE);
	float *v = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
	                                   3 * sizeof *v, b->m.vertices);
	uint32_t *t = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
	                                      3 * sizeof *t, b->m.triangle.n);
	if (!v || !t)
		return -1;
	for (size_t i = 0; i < b->m.vertices; i++)
		to_unit(b, &b->m.vertex[3 * i], &v[3 * i]);
	memcpy(t, b->m.triangle.corner, 3 * b->m.triangle.n * sizeof *t);
	rtcCommitGeometry(g);
	rtcAttachGeometry(b->scene, g);
	rtcReleaseGeometry(g);
	rtcCommitScene(b->scene);
	return rtcGetDeviceError(b->device) == RTC_ERROR_NONE ? 0 : -1;
}

/* ---- the rays ---- */

static void store(struct bench *b, const double org[3], const double dir[3])
{
	struct stored *r = &b->ray[b->rays++];

	to_unit(b, org, r->org);
	for (int k = 0; k < 3; k++)
		r->dir[k] = (float)dir[k];
}

/* The element of a patch that holds the part `area` of its area. */
static uint32_t element_at(const struct model *m, size_t patch, double area)
{
	uint32_t e = m->patch.start[patch], last = m->patch.start[patch + 1] - 1;

	for (area *= m->patch.area[patch]; e < last && area >= m->element.area[e]; e++)
		area -= m->element.area[e];
	return e;
}

static void side_rays(struct bench *b, size_t patch, int side, size_t count, uint64_t seed)
{
	const struct model *m = &b->m;

	for (uint32_t i = 0; i < count; i++) {
		double u[4], x[3] = { 0 }, n[3], dir[3];
		for (int d = 0; d < 4; d++)
			u[d] = rng_sobol(i, d, seed);
		uint32_t e = element_at(m, patch, u[0]);
		double r = sqrt(rng_sobol(i, 4, seed)), w[3] = { 1 - r, r * (1 - u[1]), r * u[1] };
		for (size_t c = 0; c < 3; c++)
			v3_mad(x, w[c], &m->vertex[3 * (size_t)m->element.corner[3 * (size_t)e + c]], x);
		for (size_t k = 0; k < 3; k++)
			n[k] = (side ? -1 : 1) * m->element.normal[3 * (size_t)e + k];
		bsdf_sample_cosine(n, &u[2], dir);
		v3_mad(x, 0x1p-21 * b->unit, n, x);
		store(b, x, dir);
	}
}

static int make_patch_rays(struct bench *b, size_t count, struct err *e)
{
	size_t sides = 0, used = 0, wanted = (count + SIDE_RAYS - 1) / SIDE_RAYS;
	uint32_t *side = mem_new(2 * b->m.patch.n, sizeof *side, "patch-sides", e);

	b->ray = mem_new(count, sizeof *b->ray, "rays", e);
	if (side && b->ray) {
		for (uint32_t ps = 0; ps < 2 * b->m.patch.n; ps++)
			if (model_side_modelled(&b->m, ps))
				side[sides++] = ps;
		for (; b->rays < count; used++) {
			size_t at = wanted < sides ? used * sides / wanted : used % sides;
			size_t left = count - b->rays;
			side_rays(b, side[at] >> 1, (int)(side[at] & 1),
			          left < SIDE_RAYS ? left : SIDE_RAYS, used);
		}
	}
	free(side);
	return b->rays == count ? 0 : -1;
}

static int make_camera_rays(struct bench *b, size_t count, const char *name, const char *size,
                            struct err *e)
{
	struct view_frame f;
	int width, height, c = picture_camera_find(&b->m, name, e);

	if (c < 0)
		return -1;
	if (sscanf(size, "%dx%d", &width, &height) != 2)
		return err_set(e, "%s: not a picture size; give WxH", size);
	if (picture_camera_frame(&b->m.camera[c], width, height, &f, e))
		return -1;
	size_t pixels = (size_t)f.width * (size_t)f.height, passes = (count + pixels - 1) / pixels;
	b->ray = mem_new(passes * pixels, sizeof *b->ray, "rays", e);
	if (!b->ray)
		return -1;
	for (size_t p = 0; p < passes; p++)
		for (int y = 0; y < f.height; y += TILE)
			for (int x = 0; x < f.width; x += TILE)
				for (int k = 0; k < TILE * TILE; k++) {
					int i = x + k % TILE, j = y + k / TILE;
					double org[3], dir[3];
					if (i >= f.width || j >= f.height)
						continue;
					picture_camera_ray(&f, i + .5, j + .5, org, dir);
					store(b, org, dir);
				}
	return 0;
}

/* ---- the loops measured ---- */

static void trace(void *arg, size_t begin, size_t end, int thread)
{
	struct bench *b = arg;
	size_t hits = 0;
#if EMBREE == 3
	struct RTCIntersectContext context;

	rtcInitIntersectContext(&context);
#endif
	for (size_t i = begin; i < end; i++) {
		const struct stored *s = &b->ray[i];
		struct RTCRayHit r = {
			.ray = { .org_x = s->org[0], .org_y = s->org[1], .org_z = s->org[2],
			         .dir_x = s->dir[0], .dir_y = s->dir[1], .dir_z = s->dir[2],
			         .tfar = INFINITY, .mask = 0xffffffffu },
			.hit = { .geomID = RTC_INVALID_GEOMETRY_ID }
		};
#if EMBREE == 3
		rtcIntersect1(b->scene, &context, &r);
#else
		rtcIntersect1(b->scene, &r, NULL);
#endif
		hits += r.hit.geomID != RTC_INVALID_GEOMETRY_ID;
	}
	b->hits[thread] += hits;
}

typedef uint64_t lanes __attribute__((vector_size(32)));

static void read_buffer(void *arg, size_t begin, size_t end, int thread)
{
	struct bench *b = arg;
	lanes sum[4] = { { 0 } };

	for (size_t i = begin; i < end; i += 16)
		for (size_t k = 0; k < 4; k++) {
			lanes x;
			memcpy(&x, b->buffer + i + 4 * k, sizeof x);
			sum[k] += x;
		}
	for (int k = 0; k < 16; k++)
		b->sum[thread] += sum[k / 4][k % 4];
}

static int by_value(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

static double seconds(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Median seconds of PASSES runs, after one that warms up. */
static double seconds_of(par_fn *fn, size_t n, size_t chunk, int threads, struct bench *b)
{
	double t[PASSES];

	par_for(n, chunk, threads, fn, b, NULL);
	for (int i = 0; i < PASSES; i++) {
		double begun = seconds();
		par_for(n, chunk, threads, fn, b, NULL);
		t[i] = seconds() - begun;
	}
	qsort(t, PASSES, sizeof *t, by_value);
	return t[PASSES / 2];
}

static int run(struct bench *b, int threads, struct err *e)
{
	size_t hits = 0;

	if (build(b))
		return err_set(e, "Embree: no scene");
	double s = seconds_of(trace, b->rays, SIDE_RAYS, threads, b);
	for (int i = 0; i < 256; i++)
		hits += b->hits[i];
	printf("rays %zu\n", b->rays);
	printf("hits %.6f\n", (double)hits / (double)b->rays / (PASSES + 1));
	printf("mray_per_s %.3f\n", 1e-6 * (double)b->rays / s);
	b->buffer = mem_new(READ_BYTES, 1, "buffer", e);
	if (!b->buffer)
		return -1;
	memset(b->buffer, 1, READ_BYTES); /* pages of its own */
	s = seconds_of(read_buffer, READ_BYTES / sizeof *b->buffer, 1 << 16, threads, b);
	printf("read_gb_per_s %.2f\n", 1e-9 * (double)READ_BYTES / s);
	return 0;
}

int main(int argc, char **argv)
{
	static struct bench b;
	struct cache_info info = { 0 };
	struct err e = { 0 };
	int camera = argc == 7 && strcmp(argv[4], "--camera") == 0;
	long count = argc > 3 ? atol(argv[2]) : 0, threads = argc > 3 ? atol(argv[3]) : 0;
	int bad = 1;

	if ((argc != 4 && !camera) || count < 1 || threads < 1 || threads > 256) {
		fprintf(stderr, "usage: rays FILE.mesh COUNT THREADS [--camera NAME WxH]\n");
		return 2;
	}
	if (!file_mesh_read(argv[1], &b.m, &info, &e)) {
		measure_extent(&b);
		bad = camera ? make_camera_rays(&b, (size_t)count, argv[5], argv[6], &e)
		             : make_patch_rays(&b, (size_t)count, &e);
		bad = bad || run(&b, (int)threads, &e);
	}
	if (bad)
		fprintf(stderr, "rays: %s\n", e.text);
	if (b.scene)
		rtcReleaseScene(b.scene);
	if (b.device)
		rtcReleaseDevice(b.device);
	free(b.ray);
	free(b.buffer);
	file_cache_info_free(&info);
	model_free(&b.m);
	return bad ? 1 : 0;
}
