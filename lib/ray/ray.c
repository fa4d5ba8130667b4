/* The only file that knows Embree (3 or 4). */
#include "lib/ray/ray.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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

#include "lib/base/mem.h"
#include "lib/base/vec.h"

struct ray_scene {
	RTCDevice device;
	RTCScene scene;
	double centre[3];
	double unit;        /* world length of one unit inside */
	double per_unit;    /* 1 / unit */
	float (*normal)[3]; /* [triangles] front normals */
	size_t slivers;
	uint32_t *sliver;   /* [slivers] triangles that are a geometry of their own */
	double (*sliver_plane)[4]; /* [slivers] unit normal, offset, at unit scale */
	int coherent;       /* packets of neighbouring rays pay as packets */
};

/* A length at unit scale. Origins leave surfaces by 8 float32 steps of 2^-24: rounding of the
 * vertices, of the origin and of the plane together stay below 4. */
static const double offset_units = 0x1p-21;

/* A count of triangles up to which a packet of rays with similar directions is best traced as
 * one; in larger scenes its rays part too soon. Measured by a loop of sorted rays: half as fast again
 * with 36 triangles, no faster with 100 000. */
enum { COHERENT_MOST = 1000 };

/* A count of triangles up to which a scene is built by one thread, in hundredths of a second:
 * Embree's others would go on looking for work for longer. A guess. */
enum { ALONE_MOST = 20000 };

/* How far from the edges of a triangle rays begin: in offsets, and the most as a part of the way
 * to its centre. Measured: of 1e7 rays in a box one escapes with 4 offsets, none with 16. The most is a
 * guess that leaves tiny triangles most of their area. */
static const double inset_offsets = 16, inset_most = .2;

enum { TRIANGLES, SLIVERS };  /* geometries */

/* length^2 / height, at unit scale, beyond which a triangle is a sliver: half of the offset
 * in float32 steps. */
enum { SLIVER = 4 };

static void bounds(const struct model *m, struct ray_scene *s)
{
	double lo[3] = { INFINITY, INFINITY, INFINITY };
	double hi[3] = { -INFINITY, -INFINITY, -INFINITY };

	for (size_t i = 0; i < 3 * m->triangle.n; i++)
		for (int k = 0; k < 3; k++) {
			double x = m->vertex[3 * (size_t)m->triangle.corner[i] + (size_t)k];
			lo[k] = fmin(lo[k], x);
			hi[k] = fmax(hi[k], x);
		}
	s->unit = 0;
	for (int k = 0; k < 3; k++) {
		s->centre[k] = m->triangle.n ? lo[k] + (hi[k] - lo[k]) / 2 : 0;
		s->unit = fmax(s->unit, (hi[k] - lo[k]) / 2);
	}
	if (!(s->unit > 0))
		s->unit = 1;
	s->per_unit = 1 / s->unit;
}

static void to_unit(const struct ray_scene *s, const double x[3], float out[3])
{
	for (int k = 0; k < 3; k++)
		out[k] = (float)((x[k] - s->centre[k]) * s->per_unit);
}

/* Embree takes the plane of a triangle from the cross product of float32 edges: over the
 * length of a sliver it is off by about length^2 / height float32 steps, and a ray may then
 * hit the triangle that it has just left. */
static int is_sliver(const struct ray_scene *s, const struct model *m, size_t triangle)
{
	const uint32_t *c = &m->triangle.corner[3 * triangle];
	double n[3], longest = 0;

	v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
	        &m->vertex[3 * (size_t)c[2]], n);
	for (int k = 0; k < 3; k++) {
		double d[3];
		v3_sub(&m->vertex[3 * (size_t)c[(k + 1) % 3]], &m->vertex[3 * (size_t)c[k]], d);
		longest = fmax(longest, v3_length(d));
	}
	return longest * longest * longest > SLIVER * s->unit * 2 * v3_length(n);
}

static int find_slivers(struct ray_scene *s, const struct model *m, struct err *e)
{
	for (size_t i = 0; i < m->triangle.n; i++)
		s->slivers += (size_t)is_sliver(s, m, i);
	s->sliver = mem_new(s->slivers, sizeof *s->sliver, "ray scene", e);
	s->sliver_plane = mem_new(s->slivers, sizeof *s->sliver_plane, "ray scene", e);
	if (!s->sliver || !s->sliver_plane)
		return -1;
	for (size_t i = 0, k = 0; i < m->triangle.n && k < s->slivers; i++) {
		const uint32_t *c = &m->triangle.corner[3 * i];
		double *plane = s->sliver_plane[k], x[3];
		if (!is_sliver(s, m, i))
			continue;
		s->sliver[k++] = (uint32_t)i;
		v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
		        &m->vertex[3 * (size_t)c[2]], plane);
		v3_normalise(plane);
		v3_sub(&m->vertex[3 * (size_t)c[0]], s->centre, x);
		plane[3] = v3_dot(plane, x) * s->per_unit;
	}
	return 0;
}

/* Embree's filter: a ray does not meet a sliver whose plane it begins on. */
static void leave_slivers(const struct RTCFilterFunctionNArguments *a)
{
	const struct ray_scene *s = a->geometryUserPtr;
	/* Rows of N in the order of RTCRay and RTCHit: the origin comes first, primID sixth.
	 * Embree has names for them in C++ only. */
	const float *org = (const float *)a->ray;
	const unsigned *primitive = (const unsigned *)a->hit + 5 * a->N;

	for (unsigned i = 0; i < a->N; i++) {
		if (!a->valid[i])
			continue;
		const double *plane = s->sliver_plane[primitive[i]];
		double h = plane[0] * (double)org[i] + plane[1] * (double)org[a->N + i] +
		           plane[2] * (double)org[2 * a->N + i] - plane[3];
		if (fabs(h) < 1.5 * offset_units)
			a->valid[i] = 0;
	}
}

/* The slivers, with the vertices of the other geometry. */
static int add_slivers(struct ray_scene *s, const struct model *m, RTCGeometry all, struct err *e)
{
	RTCGeometry g = rtcNewGeometry(s->device, RTC_GEOMETRY_TYPE_TRIANGLE);
	uint32_t *t = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
	                                      3 * sizeof *t, s->slivers);
	int bad = !t && err_set(e, "Embree: no memory for %zu triangles", s->slivers);

	if (!bad) {
		rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
		                           rtcGetGeometryBufferData(all, RTC_BUFFER_TYPE_VERTEX, 0),
		                           0, 3 * sizeof(float), m->vertices);
		for (size_t k = 0; k < s->slivers; k++)
			memcpy(&t[3 * k], &m->triangle.corner[3 * (size_t)s->sliver[k]],
			       3 * sizeof *t);
		rtcSetGeometryUserData(g, s);
		rtcSetGeometryIntersectFilterFunction(g, leave_slivers);
		rtcSetGeometryOccludedFilterFunction(g, leave_slivers);
		rtcCommitGeometry(g);
		rtcAttachGeometryByID(s->scene, g, SLIVERS);
	}
	rtcReleaseGeometry(g);
	return bad ? -1 : 0;
}

static int fill_geometry(struct ray_scene *s, const struct model *m, RTCGeometry g,
                         struct err *e)
{
	float *v = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
	                                   3 * sizeof *v, m->vertices);
	uint32_t *t = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
	                                      3 * sizeof *t, m->triangle.n);
	if (!v || !t)
		return err_set(e, "Embree: no memory for %zu triangles", m->triangle.n);
	for (size_t i = 0; i < m->vertices; i++)
		to_unit(s, &m->vertex[3 * i], &v[3 * i]);
	memcpy(t, m->triangle.corner, 3 * m->triangle.n * sizeof *t);
	for (size_t k = 0; k < s->slivers; k++) { /* a triangle without area is never hit */
		uint32_t *corner = &t[3 * (size_t)s->sliver[k]];
		corner[1] = corner[2] = corner[0];
	}
	for (size_t i = 0; i < m->triangle.n; i++) {
		const uint32_t *c = &m->triangle.corner[3 * i];
		double n[3];
		v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
		        &m->vertex[3 * (size_t)c[2]], n);
		v3_normalise(n);
		for (int k = 0; k < 3; k++)
			s->normal[i][k] = (float)n[k];
	}
	return 0;
}

struct ray_scene *ray_scene_new(const struct model *m, struct err *e)
{
	struct ray_scene *s = mem_new(1, sizeof *s, "ray scene", e);
	RTCGeometry g = NULL;
	int bad = -1;

	if (!s)
		return NULL;
	bounds(m, s);
	s->coherent = m->triangle.n <= COHERENT_MOST;
	s->normal = mem_new(m->triangle.n, sizeof *s->normal, "triangle normals", e);
	s->device = rtcNewDevice(m->triangle.n <= ALONE_MOST ? "threads=1" : NULL);
	if (s->normal && s->device) {
		s->scene = rtcNewScene(s->device);
		rtcSetSceneFlags(s->scene, RTC_SCENE_FLAG_ROBUST);
		g = rtcNewGeometry(s->device, RTC_GEOMETRY_TYPE_TRIANGLE);
		bad = find_slivers(s, m, e) || fill_geometry(s, m, g, e);
	}
	if (!bad) {
		rtcCommitGeometry(g);
		rtcAttachGeometryByID(s->scene, g, TRIANGLES);
		bad = s->slivers && add_slivers(s, m, g, e);
	}
	if (!bad) {
		rtcCommitScene(s->scene);
		if (rtcGetDeviceError(s->device) != RTC_ERROR_NONE)
			bad = err_set(e, "Embree: could not build the ray scene");
	}
	if (g)
		rtcReleaseGeometry(g);
	if (!bad)
		return s;
	err_set(e, "Embree: no device");
	ray_scene_free(s);
	return NULL;
}

void ray_scene_free(struct ray_scene *s)
{
	if (!s)
		return;
	if (s->scene)
		rtcReleaseScene(s->scene);
	if (s->device)
		rtcReleaseDevice(s->device);
	free(s->normal);
	free(s->sliver);
	free(s->sliver_plane);
	free(s);
}

double ray_offset(const struct ray_scene *s)
{
	return offset_units * s->unit;
}

void ray_leave(const struct ray_scene *s, const double n[3], double x[3])
{
	v3_mad(x, offset_units * s->unit, n, x);
}

double ray_inset(const struct ray_scene *s, double area)
{
	return fmin(inset_most, inset_offsets * ray_offset(s) / sqrt(area));
}

void ray_point(const struct ray_scene *s, const struct model *m, uint32_t triangle,
               const double weight[3], double x[3])
{
	const uint32_t *c = &m->triangle.corner[3 * (size_t)triangle];
	const double *corner[3];
	double n[3], w[3], sum = 0;

	for (int i = 0; i < 3; i++)
		corner[i] = &m->vertex[3 * (size_t)c[i]];
	v3_area(corner[0], corner[1], corner[2], n);
	double least = ray_inset(s, v3_length(n)) / 3;
	for (int i = 0; i < 3; i++)
		sum += w[i] = fmax(weight[i], least);
	for (int k = 0; k < 3; k++)
		x[k] = (w[0] * corner[0][k] + w[1] * corner[1][k] + w[2] * corner[2][k]) / sum;
}

void ray_nearest(const struct ray_scene *s, const double org[3], const double dir[3],
                 struct ray_hit *hit)
{
	struct RTCRayHit r;
	float o[3];

	to_unit(s, org, o);
	r.ray.org_x = o[0];
	r.ray.org_y = o[1];
	r.ray.org_z = o[2];
	r.ray.dir_x = (float)dir[0];
	r.ray.dir_y = (float)dir[1];
	r.ray.dir_z = (float)dir[2];
	r.ray.tnear = 0;
	r.ray.tfar = INFINITY;
	r.ray.time = 0;
	r.ray.mask = 0xffffffffu;
	r.ray.id = 0;
	r.ray.flags = 0;
	r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
	r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if EMBREE >= 4
	rtcIntersect1(s->scene, &r, NULL);
#else
	struct RTCIntersectContext context;
	rtcInitIntersectContext(&context);
	rtcIntersect1(s->scene, &context, &r);
#endif
	hit->triangle = RAY_MISS;
	if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID)
		return;
	hit->triangle = r.hit.geomID == SLIVERS ? s->sliver[r.hit.primID] : r.hit.primID;
	const float *n = s->normal[hit->triangle];
	hit->side = (double)n[0] * dir[0] + (double)n[1] * dir[1] + (double)n[2] * dir[2] > 0;
	hit->t = (double)r.ray.tfar * s->unit;
	hit->w[1] = (double)r.hit.u;
	hit->w[2] = (double)r.hit.v;
	hit->w[0] = 1 - hit->w[1] - hit->w[2];
}

struct ray_units ray_units(const struct ray_scene *s)
{
	return (struct ray_units){ { s->centre[0], s->centre[1], s->centre[2] }, s->per_unit };
}

enum { PACKET = 8 };  /* a count: of floats in a vector of AVX */

/* The parts of a packet that no ray changes, and those that a cast has changed. */
static void packet_begin(struct RTCRayHit8 *p)
{
	for (int i = 0; i < PACKET; i++) {
		p->ray.tnear[i] = 0;
		p->ray.time[i] = 0;
		p->ray.tfar[i] = INFINITY;
		p->ray.mask[i] = 0xffffffffu;
		p->ray.id[i] = 0;
		p->ray.flags[i] = 0;
		p->hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
		p->hit.primID[i] = RTC_INVALID_GEOMETRY_ID;
		p->hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
	}
}

static void packet_cast(const struct ray_scene *s, struct ray_batch *b, uint32_t at, uint32_t n)
{
	struct RTCRayHit8 p;
	int valid[PACKET] __attribute__((aligned(32)));
	float *to[6] = { p.ray.org_x, p.ray.org_y, p.ray.org_z, p.ray.dir_x, p.ray.dir_y,
		p.ray.dir_z };

	packet_begin(&p);
	for (uint32_t i = 0; i < PACKET; i++)
		valid[i] = i < n ? -1 : 0;
	for (int k = 0; k < 3; k++) {
		memcpy(to[k], &b->org[k][at], sizeof p.ray.org_x);
		memcpy(to[3 + k], &b->dir[k][at], sizeof p.ray.dir_x);
	}
#if EMBREE >= 4
	struct RTCIntersectArguments arguments;
	rtcInitIntersectArguments(&arguments);
	arguments.flags = s->coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
	rtcIntersect8(valid, s->scene, &p, &arguments);
#else
	struct RTCIntersectContext context;
	rtcInitIntersectContext(&context);
	context.flags = s->coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
	                            : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
	rtcIntersect8(valid, s->scene, &context, &p);
#endif
	memcpy(&b->triangle[at], p.hit.primID, sizeof p.hit.primID);
	for (uint32_t i = 0; s->slivers && i < PACKET; i++)
		if (p.hit.geomID[i] == SLIVERS)
			b->triangle[at + i] = s->sliver[p.hit.primID[i]];
	memcpy(&b->w[0][at], p.hit.u, sizeof p.hit.u);
	memcpy(&b->w[1][at], p.hit.v, sizeof p.hit.v);
}

void ray_nearest_batch(const struct ray_scene *s, struct ray_batch *b, uint32_t n)
{
	for (uint32_t i = 0; i < n; i += PACKET)
		packet_cast(s, b, i, n - i);
	for (uint32_t i = 0; i < n; i++) {
		if (b->triangle[i] == RAY_MISS)
			continue;
		const float *normal = s->normal[b->triangle[i]];
		b->side[i] = normal[0] * b->dir[0][i] + normal[1] * b->dir[1][i] +
		             normal[2] * b->dir[2][i] > 0;
	}
}

int ray_blocked(const struct ray_scene *s, const double a[3], const double b[3])
{
	struct RTCRay r;
	float o[3], end[3];

	to_unit(s, a, o);
	to_unit(s, b, end);
	r.org_x = o[0];
	r.org_y = o[1];
	r.org_z = o[2];
	r.dir_x = end[0] - o[0];
	r.dir_y = end[1] - o[1];
	r.dir_z = end[2] - o[2];
	r.tnear = 0;
	r.tfar = 1;
	r.time = 0;
	r.mask = 0xffffffffu;
	r.id = 0;
	r.flags = 0;
#if EMBREE >= 4
	rtcOccluded1(s->scene, &r, NULL);
#else
	struct RTCIntersectContext context;
	rtcInitIntersectContext(&context);
	rtcOccluded1(s->scene, &context, &r);
#endif
	return r.tfar < 0;
}
