/* Outlines of planar patches: the boundary half-edges of the elements, chained. At
 * a corner where the outline touches itself the chain turns within the elements
 * around the corner, so loops never cross. O(n log n). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/geometry/half_edge.h"
#include "lib/mesh/stages.h"

/* A half-edge of the patch being traced, half relative to its first element. */
struct arc {
	uint32_t from, to, half;
};

struct loop {
	double area;        /* twice, signed about the patch's normal */
	uint32_t begin, end;
};

struct tracer {
	struct model *m;
	struct err *e;
	struct array arc;   /* sorted by from, to */
	struct array done;  /* [half-edges] 1: traced */
	struct array corner;  /* vertices of the loops found in this patch */
	struct array loop;  /* these loops */
	struct array start, index; /* what becomes loop_start and loop_index */
	const uint32_t *element; /* corners of the patch's elements */
	double normal[3];
};

static const double *vertex(const struct tracer *t, uint32_t v)
{
	return &t->m->vertex[3 * (size_t)v];
}

/* Are all corners within 1e-5 of the patch's extent of its mean plane? Finer than
 * any error that formulas for plane polygons are quoted with, coarser than what
 * float32 positions do to a plane; a guess in between. */
static int planar(struct tracer *t, uint32_t begin, uint32_t end)
{
	const struct model *m = t->m;
	const double *origin = vertex(t, m->element.corner[3 * (size_t)begin]);
	double extent = 0, lowest = 0, highest = 0, *n = t->normal;

	n[0] = n[1] = n[2] = 0;
	for (uint32_t i = begin; i < end; i++)
		v3_mad(n, m->element.area[i], &m->element.normal[3 * (size_t)i], n);
	v3_normalise(n);
	for (size_t i = 3 * (size_t)begin; i < 3 * (size_t)end; i++) {
		double d[3];
		v3_sub(vertex(t, m->element.corner[i]), origin, d);
		extent = fmax(extent, v3_length(d));
		lowest = fmin(lowest, v3_dot(d, n));
		highest = fmax(highest, v3_dot(d, n));
	}
	for (uint32_t i = begin; i < end; i++)
		if (v3_dot(&m->element.normal[3 * (size_t)i], n) <= 0)
			return 0;
	return highest - lowest <= 1e-5 * extent;
}

static int compare_arcs(const void *pa, const void *pb)
{
	const struct arc *a = pa, *b = pb;

	if (a->from != b->from)
		return a->from < b->from ? -1 : 1;
	if (a->to != b->to)
		return a->to < b->to ? -1 : 1;
	return 0;
}

static const struct arc *find_arc(const struct tracer *t, uint32_t from, uint32_t to)
{
	struct arc want = { from, to, 0 };

	return bsearch(&want, t->arc.data, t->arc.n, sizeof want, compare_arcs);
}

/* Collects the half-edges. 1 if two of them are the same (elements overlap: there
 * is no outline), -1 and an error, else 0. */
static int collect_arcs(struct tracer *t, uint32_t n)
{
	t->arc.n = t->done.n = 0;
	if (mem_reserve(&t->arc, 3 * (size_t)n, sizeof(struct arc), t->e) ||
	    mem_reserve(&t->done, 3 * (size_t)n, 1, t->e))
		return -1;
	t->arc.n = t->done.n = 3 * (size_t)n;
	memset(t->done.data, 0, t->done.n);
	struct arc *a = t->arc.data;
	for (uint32_t h = 0; h < 3 * n; h++)
		a[h] = (struct arc){ geo_half_edge_from(t->element, h),
			             geo_half_edge_to(t->element, h), h };
	qsort(a, t->arc.n, sizeof *a, compare_arcs);
	for (size_t i = 1; i < t->arc.n; i++)
		if (!compare_arcs(&a[i], &a[i - 1]))
			return 1;
	return 0;
}

/* The boundary half-edge that follows boundary half-edge h. */
static uint32_t next_boundary(const struct tracer *t, uint32_t h)
{
	for (;;) {
		h = h % 3 == 2 ? h - 2 : h + 1;
		const struct arc *twin = find_arc(t, geo_half_edge_to(t->element, h),
		                                  geo_half_edge_from(t->element, h));
		if (!twin)
			return h;
		h = twin->half;
	}
}

/* Of what is straight but for rounding: the sine of its angle, a guess; and how far, in units of the
 * largest coordinate, a corner lies from where it was meant to: eight units in the last place. */
static const double straight_sine = 1e-9, rounding = 0x1p-49;

/* Does b lie on the straight way from a to c, but for rounding? */
static int straight(const struct tracer *t, uint32_t a, uint32_t b, uint32_t c)
{
	double u[3], v[3], w[3], largest = 0;

	v3_sub(vertex(t, b), vertex(t, a), u);
	v3_sub(vertex(t, c), vertex(t, b), v);
	if (v3_dot(u, v) <= 0)
		return 0;
	for (int k = 0; k < 3; k++)
		largest = fmax(largest, fabs(vertex(t, b)[k]));
	double length = v3_length(u) + v3_length(v);
	v3_cross(u, v, w);
	return v3_length(w) <= length * (straight_sine * fmin(v3_length(u), v3_length(v)) +
	                                 rounding * largest);
}

/* Takes the corners that lie on straight edges out of the loop corner[begin ...]. */
static void straighten(struct tracer *t, uint32_t begin)
{
	uint32_t *c = (uint32_t *)t->corner.data + begin;
	size_t n = t->corner.n - begin, first = 0, kept = 0;

	while (first < n && straight(t, c[first ? first - 1 : n - 1], c[first],
	                             c[first + 1 < n ? first + 1 : 0]))
		first++;
	if (first == n)
		return;
	/* Turn the loop to begin at a true corner. */
	for (size_t i = 0; i < first; i++) {
		uint32_t v = c[0];
		memmove(c, c + 1, (n - 1) * sizeof *c);
		c[n - 1] = v;
	}
	for (size_t i = 0; i < n; i++)
		if (i == 0 || !straight(t, c[kept - 1], c[i], c[i + 1 < n ? i + 1 : 0]))
			c[kept++] = c[i];
	t->corner.n = begin + kept;
}

static double loop_area(const struct tracer *t, const uint32_t *c, size_t n)
{
	double sum[3] = { 0 }, u[3], v[3], w[3];

	for (size_t i = 1; i + 1 < n; i++) {
		v3_sub(vertex(t, c[i]), vertex(t, c[0]), u);
		v3_sub(vertex(t, c[i + 1]), vertex(t, c[0]), v);
		v3_cross(u, v, w);
		v3_mad(sum, 1, w, sum);
	}
	return v3_dot(sum, t->normal);
}

/* Follows the boundary from half-edge h until it comes back. */
static int trace_loop(struct tracer *t, uint32_t h)
{
	uint8_t *done = t->done.data;
	struct loop l = { .begin = (uint32_t)t->corner.n };

	for (; !done[h]; h = next_boundary(t, h)) {
		done[h] = 1;
		if (mem_append(&t->corner, &t->element[h], 1, sizeof *t->element, t->e))
			return -1;
	}
	straighten(t, l.begin);
	if (t->corner.n - l.begin < 3) {
		t->corner.n = l.begin; /* there and back along a slit: it bounds no area */
		return 0;
	}
	l.end = (uint32_t)t->corner.n;
	l.area = loop_area(t, (uint32_t *)t->corner.data + l.begin, l.end - l.begin);
	return mem_append(&t->loop, &l, 1, sizeof l, t->e);
}

/* The outer loop, the one with the largest area, first; holes as they come. */
static int append_loops(struct tracer *t)
{
	struct loop *l = t->loop.data;
	size_t outer = 0;

	for (size_t i = 1; i < t->loop.n; i++)
		if (l[i].area > l[outer].area)
			outer = i;
	struct loop first = l[outer];
	memmove(l + 1, l, outer * sizeof *l);
	l[0] = first;
	for (size_t i = 0; i < t->loop.n; i++) {
		if (mem_append(&t->index, (uint32_t *)t->corner.data + l[i].begin,
		               l[i].end - l[i].begin, sizeof(uint32_t), t->e))
			return -1;
		uint64_t end = t->index.n;
		if (mem_append(&t->start, &end, 1, sizeof end, t->e))
			return -1;
	}
	return 0;
}

/* 1 if the patch has an outline, 0 if not, -1 and an error. */
static int trace_patch(struct tracer *t, uint32_t begin, uint32_t end)
{
	if (!planar(t, begin, end))
		return 0;
	t->element = &t->m->element.corner[3 * (size_t)begin];
	t->corner.n = t->loop.n = 0;
	int overlap = collect_arcs(t, end - begin);
	if (overlap)
		return overlap < 0 ? -1 : 0;
	for (uint32_t h = 0; h < 3 * (end - begin); h++) {
		if (((uint8_t *)t->done.data)[h] ||
		    find_arc(t, geo_half_edge_to(t->element, h), geo_half_edge_from(t->element, h)))
			continue;
		if (trace_loop(t, h))
			return -1;
	}
	if (t->loop.n == 0)
		return 0;
	return append_loops(t) ? -1 : 1;
}

static int trace_all(struct tracer *t, size_t *planar_patches)
{
	struct model *m = t->m;
	uint64_t zero = 0;

	m->patch.loop = mem_new(m->patch.n + 1, sizeof *m->patch.loop, "outlines", t->e);
	if (!m->patch.loop || mem_append(&t->start, &zero, 1, sizeof zero, t->e))
		return -1;
	for (size_t p = 0; p < m->patch.n; p++) {
		int traced = trace_patch(t, m->patch.start[p], m->patch.start[p + 1]);
		if (traced < 0)
			return -1;
		*planar_patches += (size_t)traced;
		m->patch.loop[p + 1] = t->start.n - 1;
	}
	/* mem_new's arrays are never NULL; neither are these. */
	if (mem_reserve(&t->index, 1, sizeof(uint32_t), t->e))
		return -1;
	m->patch.loops = t->start.n - 1;
	m->patch.loop_start = t->start.data;
	m->patch.loop_indices = t->index.n;
	m->patch.loop_index = t->index.data;
	t->start.data = t->index.data = NULL;
	return 0;
}

int mesh_outline_patches(struct model *m, size_t *planar_patches, struct err *e)
{
	struct tracer t = { .m = m, .e = e };
	int status = trace_all(&t, planar_patches);

	free(t.arc.data);
	free(t.done.data);
	free(t.corner.data);
	free(t.loop.data);
	free(t.start.data);
	free(t.index.data);
	return status;
}
