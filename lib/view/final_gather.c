#include "lib/view/final_gather.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"
#include "lib/geometry/half_edge.h"
#include "lib/interpolate/smooth_groups.h"
#include "lib/view/final_gather_rays.h"

/* Root mean square over an element of what linear interpolation misses, by the second
 * difference across an edge: h^2 f'' / sqrt(120) by h^2 f'', .091, where f'' is the same all
 * around; a little more, since it seldom is. */
static const double per_difference = .1;

/* What interpolation may miss, relative to all irradiance, where no error is asked for: about
 * what a screen of 8 bits can show. A guess. */
static const double usual_miss = .01;

/* Counts. A group has six corners as a rule; one of more than VALENCE is taken in pieces, which
 * share no gathering. FEWEST: rays of a point that gathers for itself, below which its four
 * parts tell no error. Guesses. */
enum { VALENCE = 64, FEWEST = 64 };

/* Work for a thread at a time, counts: gathering groups takes long, comparing sides does not. */
enum { GROUPS_AT_ONCE = 16, SIDES_AT_ONCE = 1024 };

struct gather {
	const struct view_scene *v;
	struct gather_options o;
	struct smooth_groups groups;
	struct half_edges edges;
	unsigned char *wanted;  /* [groups][2] */
	unsigned char *asked;   /* [2 elements] */
	float *value;           /* [elements][3 corners][2][bands] irradiance, */
	float *error;           /* its standard error, and */
	float *common;          /* what that has of errors of the solution */
	float *miss;            /* [2 elements][bands] of interpolation */
	struct gather_table table;
	struct gather_worker *worker; /* [threads] */
};

/* ---- making one ---- */

static int new_arrays(struct gather *g, struct err *e)
{
	size_t n = g->v->m->element.n, bands = (size_t)g->v->m->bands;

	g->wanted = mem_new(g->groups.groups, 2, "gathering", e);
	g->asked = mem_new(n, 2, "gathering", e);
	g->value = mem_new(6 * n, bands * sizeof *g->value, "gathering", e);
	g->error = mem_new(6 * n, bands * sizeof *g->error, "gathering", e);
	g->common = mem_new(6 * n, bands * sizeof *g->common, "gathering", e);
	g->miss = mem_new(2 * n, bands * sizeof *g->miss, "gathering", e);
	g->worker = mem_new((size_t)g->o.threads, sizeof *g->worker, "gathering", e);
	if (!g->wanted || !g->asked || !g->value || !g->error || !g->common || !g->miss ||
	    !g->worker)
		return -1;
	for (int t = 0; t < g->o.threads; t++)
		if (view_gather_worker_init(&g->worker[t], &g->table, g->v, g->o.depth, e))
			return -1;
	return 0;
}

struct gather *view_gather_new(const struct view_scene *v, const struct gather_options *o,
                               struct err *e)
{
	const struct model *m = v->m;
	struct gather *g = mem_new(1, sizeof *g, "gathering", e);

	if (!g)
		return NULL;
	g->v = v;
	g->o = *o;
	if (!view_gather_table_init(&g->table, v, v->s, o->threads, e) &&
	    !interp_smooth_groups_new(m, COS_CREASE, &g->groups, e) &&
	    !geo_half_edges_build(&g->edges, m->element.corner, m->element.n, m->vertices, e) &&
	    !new_arrays(g, e))
		return g;
	view_gather_free(g);
	return NULL;
}

void view_gather_free(struct gather *g)
{
	if (!g)
		return;
	for (int t = 0; t < g->o.threads && g->worker; t++)
		view_gather_worker_free(&g->worker[t]);
	view_gather_table_free(&g->table);
	interp_smooth_groups_free(&g->groups);
	geo_half_edges_free(&g->edges);
	free(g->worker);
	free(g->wanted);
	free(g->asked);
	free(g->value);
	free(g->error);
	free(g->common);
	free(g->miss);
	free(g);
}

int view_gather_check(const struct gather *g, struct err *e)
{
	for (int t = 0; t < g->o.threads; t++)
		if (g->worker[t].e.set)
			return err_set(e, "%s", g->worker[t].e.text);
	return 0;
}

uint64_t view_gather_rays(const struct gather *g)
{
	uint64_t sum = 0;

	for (int t = 0; t < g->o.threads; t++)
		sum += g->worker[t].rays + g->worker[t].tails->rays;
	return sum;
}

void view_gather_want(struct gather *g, uint32_t element_side)
{
	for (uint32_t k = 0; k < 3; k++) {
		size_t group = g->groups.group[3 * (element_side >> 1) + k];
		__atomic_store_n(&g->wanted[2 * group + (element_side & 1)], 1, __ATOMIC_RELAXED);
	}
	__atomic_store_n(&g->asked[element_side], 1, __ATOMIC_RELAXED);
}

/* ---- corners ---- */

/* The point that stands for corners of elements: their vertex if they are all around it.
 * At the edge of a surface it is away from the vertex, towards the middle of the elements:
 * there light falls off steeply in the last fraction of an element, and what is wanted is
 * the linear function that is right over all of it. */
struct corner_point {
	double x[3], n[3];
	double h[BANDS_MAX];    /* all irradiance there, interpolated */
	double shift[BANDS_MAX];/* what indirect light has more at the vertex, by interpolation */
};

/* How far that is, as parts of the way from the vertex to the middle. Half of it,
 * where elements bend no further than it takes to leave the vertex. Where two are compared
 * across an edge, close to the vertex, so that little but what stands on the edge is in
 * between, and so many ray offsets above. Guesses. */
static const double towards_middle = .5, towards_middle_bent = 1e-3, beside_edge = .02;
static const double above = 8;

/* Elements bend where the cosine between their normals is less: 1.4e-3 radians. */
static const double same_plane = 1 - 1e-6;

static void centroid(const struct model *m, uint32_t element, double x[3])
{
	memset(x, 0, 3 * sizeof *x);
	for (int k = 0; k < 3; k++)
		v3_mad(x, 1. / 3,
		       &m->vertex[3 * (size_t)m->element.corner[3 * (size_t)element + (size_t)k]],
		       x);
}

/* How far towards the middle it goes: where elements bend, no further than needed. */
static double inwards(const struct model *m, const uint32_t *corner, const uint32_t *of, uint32_t n,
                      uint32_t cluster)
{
	const double *first = &m->element.normal[3 * (size_t)(corner[cluster] / 3)];

	for (uint32_t i = 0; i < n; i++)
		if (of[i] == cluster &&
		    v3_dot(first, &m->element.normal[3 * (size_t)(corner[i] / 3)]) < same_plane)
			return towards_middle_bent;
	return towards_middle;
}

/* Adds what the solution says of a corner's side, and of its light from the corner to the
 * middle, weighed by the area of its element. */
static void add_corner(const struct gather *g, uint32_t corner, int side, double step,
                       struct corner_point *p)
{
	const float *all = g->v->all.corner, *indirect = g->table.indirect.corner;
	size_t bands = (size_t)g->v->m->bands, e = corner / 3;
	double a = g->v->m->element.area[e];

	for (size_t b = 0; b < bands; b++) {
		size_t at = (2 * (size_t)corner + (size_t)side) * bands + b, mean[3];
		for (size_t k = 0; k < 3; k++)
			mean[k] = (2 * (3 * e + k) + (size_t)side) * bands + b;
		p->h[b] += a * (double)all[at];
		p->shift[b] +=
		    a * step *
		    (double)(indirect[at] -
		             (indirect[mean[0]] + indirect[mean[1]] + indirect[mean[2]]) / 3);
	}
}

static void find_point(const struct gather *g, const uint32_t *corner, const uint32_t *of,
                       uint32_t n, uint32_t cluster, int side, struct corner_point *p)
{
	const struct model *m = g->v->m;
	const double *vertex = &m->vertex[3 * (size_t)m->element.corner[corner[0]]];
	double middle[3] = { 0 }, c[3], area = 0, step = inwards(m, corner, of, n, cluster);
	size_t bands = (size_t)m->bands;

	*p = (struct corner_point){ 0 };
	for (uint32_t i = 0; i < n; i++) {
		uint32_t e = corner[i] / 3;
		double a = m->element.area[e];
		if (of[i] != cluster)
			continue;
		centroid(m, e, c);
		v3_sub(c, vertex, c);
		v3_mad(middle, a, c, middle);
		v3_mad(p->n, side ? -a : a, &m->element.normal[3 * (size_t)e], p->n);
		area += a;
		add_corner(g, corner[i], side, step, p);
	}
	for (size_t b = 0; b < bands; b++) {
		p->h[b] /= area;
		p->shift[b] /= area;
	}
	v3_normalise(p->n);
	/* In the tangent plane: the middle of what bends is inside of it. */
	v3_mad(middle, -v3_dot(middle, p->n), p->n, middle);
	v3_mad(vertex, step / area, middle, p->x);
	ray_leave(g->v->rays, p->n, p->x);
}

/* A point of an element near a corner, a little above it. */
static void near_corner(const struct gather *g, uint32_t corner, int side, double x[3])
{
	const struct model *m = g->v->m;
	const double *vertex = &m->vertex[3 * (size_t)m->element.corner[corner]];
	const double *n = &m->element.normal[3 * (size_t)(corner / 3)];
	double c[3];

	centroid(m, corner / 3, c);
	for (int k = 0; k < 3; k++)
		c[k] = vertex[k] + beside_edge * (c[k] - vertex[k]);
	v3_mad(c, (side ? -above : above) * ray_offset(g->v->rays), n, x);
}

/* Do the elements of two corners at one vertex share an edge there? */
static int neighbours(const struct model *m, uint32_t a, uint32_t b)
{
	const uint32_t *p = &m->element.corner[a - a % 3], *q = &m->element.corner[b - b % 3];

	return p[(a + 1) % 3] == q[(b + 2) % 3] || p[(a + 2) % 3] == q[(b + 1) % 3];
}

/* Parts the corners of a group where something stands on the edge between their elements,
 * such as a wall on a floor: of[i] = the lowest corner that i is joined with. */
static void part_corners(const struct gather *g, const uint32_t *corner, uint32_t n, int side,
                         uint32_t *of)
{
	double a[3], b[3];

	for (uint32_t i = 0; i < n; i++)
		of[i] = i;
	for (uint32_t i = 0; i < n; i++)
		for (uint32_t j = i + 1; j < n; j++) {
			if (geo_sets_find(of, i) == geo_sets_find(of, j) ||
			    !neighbours(g->v->m, corner[i], corner[j]))
				continue;
			near_corner(g, corner[i], side, a);
			near_corner(g, corner[j], side, b);
			if (!ray_blocked(g->v->rays, a, b))
				geo_sets_join(of, i, j);
		}
	for (uint32_t i = 0; i < n; i++)
		of[i] = geo_sets_find(of, i);
}

/* Stores what was found at the point of a corner. */
static void store_corner(struct gather *g, uint32_t corner, int side, const struct corner_point *p,
                         const struct gathered *found)
{
	size_t bands = (size_t)g->v->m->bands, at = (2 * (size_t)corner + (size_t)side) * bands;

	for (size_t b = 0; b < bands; b++, at++) {
		g->value[at] = (float)fmax(0, found->h[b] + p->shift[b]);
		g->error[at] = (float)found->error[b];
		/* How light falls off at an edge is taken from the solution, which is too coarse
		 * to know: what is added is as uncertain as it is large. */
		g->common[at] = (float)hypot(found->common[b], p->shift[b]);
	}
}

static void gather_group(struct gather *g, struct gather_worker *w, size_t group, int side)
{
	const uint32_t *corner = &g->groups.corner[g->groups.start[group]];
	uint32_t n = g->groups.start[group + 1] - g->groups.start[group], of[VALENCE];
	struct gathered found;

	for (uint32_t from = 0; from < n; from += VALENCE) {
		uint32_t some = n - from < VALENCE ? n - from : VALENCE;
		part_corners(g, corner + from, some, side, of);
		for (uint32_t c = 0; c < some; c++) {
			struct corner_point p;
			if (of[c] != c)
				continue;
			find_point(g, corner + from, of, some, c, side, &p);
			view_gather_point(w, p.x, p.n,
			                  rng_mix(2 * corner[from + c] + (uint32_t)side), g->o.rays,
			                  g->o.relative, p.h, &found);
			for (uint32_t i = c; i < some; i++)
				if (of[i] == c)
					store_corner(g, corner[from + i], side, &p, &found);
		}
	}
}

static void gather_groups(void *arg, size_t begin, size_t end, int thread)
{
	struct gather *g = arg;

	for (size_t i = begin; i < end; i++)
		if (g->wanted[i])
			gather_group(g, &g->worker[thread], i / 2, (int)(i % 2));
}

/* ---- what interpolation misses ---- */

/* The second difference across half-edge h (from a, to b, c opposite): what the far corner
 * of the neighbour has beyond the linear function of this element, without the noise. The
 * values of both along the edge must be the same. */
static double difference(const struct gather *g, uint32_t h, uint32_t other, size_t channel)
{
	const struct model *m = g->v->m;
	size_t row = 2 * (size_t)m->bands;
	uint32_t a = h, b = h % 3 == 2 ? h - 2 : h + 1, c = h % 3 == 0 ? h + 2 : h - 1;
	uint32_t oa = other % 3 == 2 ? other - 2 : other + 1;
	uint32_t od = other % 3 == 0 ? other + 2 : other - 1;
	const double *x[4] = { &m->vertex[3 * (size_t)m->element.corner[a]],
		               &m->vertex[3 * (size_t)m->element.corner[b]],
		               &m->vertex[3 * (size_t)m->element.corner[c]],
		               &m->vertex[3 * (size_t)m->element.corner[od]] };
	double va = (double)g->value[a * row + channel], vb = (double)g->value[b * row + channel];
	double w[3], whole[3], part[3], noise = 0;

	if (g->value[oa * row + channel] != g->value[a * row + channel] ||
	    g->value[other * row + channel] != g->value[b * row + channel])
		return 0;
	v3_area(x[0], x[1], x[2], whole);
	for (int k = 0; k < 3; k++) {
		v3_area(x[3], x[(k + 1) % 3], x[(k + 2) % 3], part);
		w[k] = v3_dot(part, whole) / v3_dot(whole, whole);
		double off = w[k] * (double)g->error[(k == 0 ? a : k == 1 ? b : c) * row + channel];
		noise += off * off;
	}
	double d = (double)g->value[od * row + channel] - w[0] * va - w[1] * vb -
	           w[2] * (double)g->value[c * row + channel];
	noise += (double)g->error[od * row + channel] * (double)g->error[od * row + channel];
	return sqrt(fmax(0, d * d - 2 * noise));
}

static void find_misses(void *arg, size_t begin, size_t end, int thread)
{
	struct gather *g = arg;
	size_t bands = (size_t)g->v->m->bands;

	(void)thread;
	for (size_t es = begin; es < end; es++)
		for (uint32_t k = 0; k < 3 && g->asked[es]; k++) {
			uint32_t h = (uint32_t)(3 * (es >> 1)) + k, edge = g->edges.of[h];
			const uint32_t *use = &g->edges.use[g->edges.start[edge]];
			if (g->edges.start[edge + 1] - g->edges.start[edge] != 2)
				continue;
			uint32_t other = use[0] == h ? use[1] : use[0];
			if (g->groups.group[h] !=
			        g->groups.group[other % 3 == 2 ? other - 2 : other + 1] ||
			    !g->asked[2 * (other / 3) + (es & 1)])
				continue;
			for (size_t b = 0; b < bands; b++) {
				float d = (float)(per_difference *
				                  difference(g, h, other, (es & 1) * bands + b));
				float *miss = &g->miss[es * bands + b];
				*miss = d > *miss ? d : *miss;
			}
		}
}

void view_gather_corners(struct gather *g, const struct progress *progress)
{
	par_for(2 * g->groups.groups, GROUPS_AT_ONCE, g->o.threads, gather_groups, g, progress);
	par_for(2 * g->v->m->element.n, SIDES_AT_ONCE, g->o.threads, find_misses, g, NULL);
}

/* ---- points ---- */

void view_gather_at(struct gather *g, uint32_t element_side, const double x[3], const double w[3],
                    uint64_t seed, int thread, struct gathered *to)
{
	size_t bands = (size_t)g->v->m->bands, element = element_side >> 1, side = element_side & 1;
	double all[BANDS_MAX], wanted = g->o.relative > 0 ? g->o.relative : usual_miss;
	int good = 1;

	*to = (struct gathered){ 0 };
	interp_reconstruction_at(&g->v->all, element, (int)side, w, all);
	for (size_t b = 0; b < bands; b++) {
		double miss = (double)g->miss[element_side * bands + b];
		double square = miss * miss, common = 0;
		for (size_t k = 0; k < 3; k++) {
			size_t at = (2 * (3 * element + k) + side) * bands + b;
			double off = w[k] * (double)g->error[at];
			to->h[b] += w[k] * (double)g->value[at];
			square += off * off;
			common += w[k] * (double)g->common[at];
		}
		to->h[b] = fmax(0, to->h[b]);
		to->common[b] = sqrt(square + common * common);
		good &= miss <= wanted * all[b];
	}
	if (good)
		return;
	struct corner_point p;
	for (int k = 0; k < 3; k++)
		p.n[k] = (side ? -1 : 1) * g->v->m->element.normal[3 * element + (size_t)k];
	memcpy(p.x, x, sizeof p.x);
	ray_leave(g->v->rays, p.n, p.x);
	int rays = g->o.rays / g->o.samples > FEWEST ? g->o.rays / g->o.samples : FEWEST;
	view_gather_point(&g->worker[thread], p.x, p.n, rng_mix(seed), rays,
	                  g->o.relative * sqrt(g->o.samples), all, to);
}
