/* The item buffer's rasteriser.
 *
 * Closed surfaces stay closed: whether a pixel's centre is left of an edge is a
 * function of the edge's two end points alone, so the two triangles at an edge
 * split a row at the same pixel, and rows are split half-open at the vertices.
 * Triangles that cross or pass behind the eye are clipped by the planes of a
 * pyramid somewhat wider than the face, whose apex is the eye: there is no near
 * plane. Depth is 1/w, which is affine in a face's pixels. */
#include <math.h>
#include <string.h>

#include "hemicube.h"
#include "hemicube_scene.h"
#include "vec3.h"

typedef double v4d __attribute__((vector_size(32)));
typedef int64_t v4l __attribute__((vector_size(32)));
typedef int32_t v4i __attribute__((vector_size(16)));
typedef float v4f __attribute__((vector_size(16)));
typedef float v8f __attribute__((vector_size(32)));
typedef int32_t v8i __attribute__((vector_size(32)));
typedef uint32_t v8u __attribute__((vector_size(32)));

/* The pyramid's half width in units of the face's. Wide enough that few
 * triangles need clipping. */
static const double GUARD = 4;

static const double THIN = 1e-7;

/* Bits of a vertex's code. */
enum { OUT_RIGHT = 1, OUT_LEFT = 2, OUT_UP = 4, OUT_DOWN = 8, OUT_PYRAMID = 15,
       BELOW_HORIZON = 16 };

/* Face coordinates (u, v, w), right-handed: u = su frame[u], w = sw frame[w]. */
static const struct face {
	int u, v, w;
	double su, sw;
} faces[5] = { { 0, 1, 2, 1, 1 }, { 1, 2, 0, 1, 1 }, { 1, 2, 0, -1, -1 },
	{ 0, 2, 1, -1, 1 }, { 0, 2, 1, 1, -1 } };

/* A face of one hemicube being drawn. */
struct target {
	uint32_t *item;
	float *depth;
	int columns, rows;
	double half, pixel;   /* pixels per unit of u/w, and its inverse */
	double centre_row;    /* row coordinate of v = 0 */
	float *far;           /* tiles */
	int tiles;            /* in a row of them */
};

/* A vertex on a face: pixel coordinates, 1/w, and the first column and row whose
 * pixel centres are not before it. */
struct corner {
	double x, y, q;
	int32_t column, row;
};

/* 1/w = q0 + qx x + qy y over a triangle, (x, y) in pixels. */
struct depth_plane {
	double q0, qx, qy;
};

static inline double min_d(double a, double b)
{
	return a < b ? a : b;
}

static inline double max_d(double a, double b)
{
	return a > b ? a : b;
}

static inline int min_i(int a, int b)
{
	return a < b ? a : b;
}

static inline int max_i(int a, int b)
{
	return a > b ? a : b;
}

/* Draws columns [left, right) of a row. A pixel's depth is a function of the plane
 * and the pixel alone, so coincident surfaces get the same. */
static inline void draw_span(const struct target *t, int row, int left, int right,
                             const struct depth_plane *p, uint32_t item)
{
	static const v8i lane = { 0, 1, 2, 3, 4, 5, 6, 7 };
	static const v4d low = { .5, 1.5, 2.5, 3.5 }, high = { 4.5, 5.5, 6.5, 7.5 };
	size_t first = (size_t)row * (size_t)t->columns;
	double q = p->q0 + p->qy * (row + .5);
	v8u id = item - (v8u){ 0 };

	for (int i = left; i < right; i += HEMI_LANES) {
		v4f a = __builtin_convertvector(q + p->qx * (low + i), v4f);
		v4f b = __builtin_convertvector(q + p->qx * (high + i), v4f);
		v8f z, near = __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
		v8u seen;
		memcpy(&z, t->depth + first + i, sizeof z);
		memcpy(&seen, t->item + first + i, sizeof seen);
		v8i wins = (lane < right - i) &
		           ((near > z) | ((near == z) & (v8i)(id < seen)));
		z = (v8f)(((v8i)near & wins) | ((v8i)z & ~wins));
		seen = (id & (v8u)wins) | (seen & ~(v8u)wins);
		memcpy(t->depth + first + i, &z, sizeof z);
		memcpy(t->item + first + i, &seen, sizeof seen);
	}
}

/* An edge from a to b, a->row < b->row: where it crosses rows. */
struct edge {
	double x, y, slope, low, high;
};

static inline struct edge edge_between(const struct corner *a, const struct corner *b)
{
	return (struct edge){ a->x - .5, a->y - .5, (b->x - a->x) / (b->y - a->y),
	                      min_d(a->x, b->x) - .5, max_d(a->x, b->x) - .5 };
}

/* First column whose centre is not left of the edge at a row's centre. */
static inline int edge_column(const struct edge *e, int row)
{
	double x = e->x + (row - e->y) * e->slope;

	return (int)ceil(max_d(min_d(x, e->high), e->low));
}

static inline void draw_rows(const struct target *t, int begin, int end,
                             const struct edge *e, const struct edge *f,
                             const struct depth_plane *p, uint32_t item)
{
	for (int row = begin; row < end; row++) {
		int i = edge_column(e, row), j = edge_column(f, row);
		int left = max_i(min_i(i, j), 0), right = min_i(max_i(i, j), t->columns);
		if (left < right)
			draw_span(t, row, left, right, p, item);
	}
}

/* Sorts by row and draws above and below the middle corner. */
static void draw_triangle(const struct target *t, const struct corner *a,
                          const struct corner *b, const struct corner *c,
                          const struct depth_plane *p, uint32_t item)
{
	const struct corner *swap;

	if (b->row < a->row)
		swap = a, a = b, b = swap;
	if (c->row < b->row) {
		swap = b, b = c, c = swap;
		if (b->row < a->row)
			swap = a, a = b, b = swap;
	}
	int begin = max_i(a->row, 0), end = min_i(c->row, t->rows);
	if (begin >= end)
		return;
	struct edge whole = edge_between(a, c);
	int middle = max_i(begin, min_i(b->row, end));
	if (begin < middle) {
		struct edge upper = edge_between(a, b);
		draw_rows(t, begin, middle, &whole, &upper, p, item);
	}
	if (middle < end) {
		struct edge lower = edge_between(b, c);
		draw_rows(t, middle, end, &whole, &lower, p, item);
	}
}

/* The depth plane of the triangle abc (face coordinates), whose 1/w lies in
 * [low, high], and the side of it that faces the eye. With normal N and D = N.a,
 * 1/w = N.(u/w, v/w, 1) / D. */
static inline int depth_plane(const struct target *t, const double a[3], const double b[3],
                              const double c[3], double low, double high,
                              struct depth_plane *p)
{
	double d[3], e[3];

	for (int k = 0; k < 3; k++)
		d[k] = b[k] - a[k], e[k] = c[k] - a[k];
	double n[3] = { d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2],
		        d[0] * e[1] - d[1] * e[0] };
	double D = n[0] * a[0] + n[1] * a[1] + n[2] * a[2], inverse = 1 / D;
	p->qx = n[0] * inverse * t->pixel;
	p->qy = n[1] * inverse * t->pixel;
	p->q0 = (n[2] - n[0]) * inverse - p->qy * t->centre_row;
	/* Seen edge on, thinner than THIN pixels: the plane is ill defined, but gaps
	 * must not open. */
	if (!((fabs(p->qx) + fabs(p->qy)) * THIN < high - low))
		p->q0 = high, p->qx = p->qy = 0;
	return D < 0 ? FRONT : BACK;
}

static int32_t ceil_centre(double x)
{
	return (int32_t)ceil(x - .5);
}

/* Distance inside plane k of the pyramid, times a constant. */
static double inside(int k, const double p[3])
{
	double x = p[k / 2];

	return k % 2 ? GUARD * p[2] + x : GUARD * p[2] - x;
}

/* Clips the polygon a of n corners by the pyramid's planes (Sutherland and
 * Hodgman 1974); the number of corners left in a, at most n + 4. Where an edge
 * is cut does not depend on its direction. */
static int clip(double (*a)[3], int n)
{
	double b[8][3];

	for (int k = 0; k < 4; k++) {
		int m = 0;
		for (int i = 0; i < n; i++) {
			const double *p = a[i], *q = a[i + 1 < n ? i + 1 : 0];
			double dp = inside(k, p), dq = inside(k, q);
			if (dp >= 0)
				memcpy(b[m++], p, sizeof b[0]);
			if ((dp >= 0) == (dq >= 0))
				continue;
			for (int j = 0; j < 3; j++)
				b[m][j] = (p[j] * dq - q[j] * dp) / (dq - dp);
			m++;
		}
		n = m;
		memcpy(a, b, (size_t)n * sizeof a[0]);
	}
	return n;
}

static void corner_project(const struct target *t, const double p[3], struct corner *c)
{
	double limit = (GUARD + 1) * t->half;

	c->q = 1 / p[2];
	c->x = (p[0] * c->q + 1) * t->half;
	c->y = p[1] * c->q * t->half + t->centre_row;
	c->x = max_d(-limit, min_d(c->x, limit));
	c->y = max_d(-limit, min_d(c->y, limit));
	c->column = ceil_centre(c->x);
	c->row = ceil_centre(c->y);
}

static void draw_clipped(const struct target *t, double (*v)[3], uint32_t element)
{
	double polygon[8][3];
	struct corner c[8];
	struct depth_plane p;
	double low = INFINITY, high = 0;

	memcpy(polygon, v, 3 * sizeof polygon[0]);
	int n = clip(polygon, 3);
	for (int i = 0; i < n; i++) {
		if (!(polygon[i][2] > 0))
			return; /* touches the eye: it is seen edge on */
		corner_project(t, polygon[i], &c[i]);
		low = min_d(low, c[i].q);
		high = max_d(high, c[i].q);
	}
	if (n < 3)
		return;
	uint32_t side = (uint32_t)depth_plane(t, v[0], v[1], v[2], low, high, &p);
	for (int i = 2; i < n; i++)
		draw_triangle(t, &c[0], &c[i - 1], &c[i], &p, 2 * element + side);
}

/* Cluster vertices into the cube's frame. */
static void transform(const struct hemi_scene *s, const struct hemi_cluster *c,
                      const double eye[3], const double frame[3][3], struct hemi_work *w)
{
	for (int i = 0; i < c->vertices; i += 4) {
		v4d x, y, z;
		memcpy(&x, s->x + c->vertex + i, sizeof x);
		memcpy(&y, s->y + c->vertex + i, sizeof y);
		memcpy(&z, s->z + c->vertex + i, sizeof z);
		x -= eye[0], y -= eye[1], z -= eye[2];
		for (int k = 0; k < 3; k++) {
			v4d d = frame[k][0] * x + frame[k][1] * y + frame[k][2] * z;
			memcpy(&w->v[k][i], &d, sizeof d);
		}
	}
}

/* First column or row whose pixel centre is not before x, |x| < 2^31: ceil(x - .5).
 * Adding and subtracting 3 2^51 rounds to the nearest integer. */
static inline void store_ceil_centre(int32_t *out, const v4d *x)
{
	v4d at = *x - .5, r = (at + 0x1.8p52) - 0x1.8p52;

	r += (v4d)((r < at) & (v4l)((v4d){ 0 } + 1));
	v4i i = __builtin_convertvector(r, v4i);
	memcpy(out, &i, sizeof i);
}

/* Projects a cluster's vertices. If `coded`, also says on which sides of the
 * pyramid and of the horizon they are; those outside are not projected. */
static void project(const struct target *t, const struct face *f, struct hemi_work *w,
                    int vertices, int coded, double horizon)
{
	for (int i = 0; i < vertices; i += 4) {
		v4d a, b, c, one = (v4d){ 0 } + 1;
		memcpy(&a, &w->v[f->u][i], sizeof a);
		memcpy(&b, &w->v[f->v][i], sizeof b);
		memcpy(&c, &w->v[f->w][i], sizeof c);
		a *= f->su, c *= f->sw;
		if (coded) {
			v4l out = ((a > GUARD * c) & OUT_RIGHT) | ((a < -GUARD * c) & OUT_LEFT) |
			          ((b > GUARD * c) & OUT_UP) | ((b < -GUARD * c) & OUT_DOWN);
			v4d height;
			memcpy(&height, &w->v[2][i], sizeof height);
			v4i code = __builtin_convertvector(
			    out | ((height <= horizon) & BELOW_HORIZON), v4i);
			memcpy(&w->code[i], &code, sizeof code);
			v4l safe = (c > 0) & (out == 0);
			a = (v4d)((v4l)a & safe), b = (v4d)((v4l)b & safe);
			c = (v4d)(((v4l)c & safe) | ((v4l)one & ~safe));
		}
		v4d q = 1 / c, x = (a * q + 1) * t->half, y = b * q * t->half + t->centre_row;
		memcpy(&w->px[i], &x, sizeof x);
		memcpy(&w->py[i], &y, sizeof y);
		memcpy(&w->pq[i], &q, sizeof q);
		store_ceil_centre(&w->column[i], &x);
		store_ceil_centre(&w->row[i], &y);
	}
}

static inline struct corner corner_at(const struct hemi_work *w, int i)
{
	return (struct corner){ w->px[i], w->py[i], w->pq[i], w->column[i], w->row[i] };
}

static inline void face_vertex(const struct hemi_work *w, const struct face *f, int i,
                               double out[3])
{
	out[0] = f->su * w->v[f->u][i];
	out[1] = w->v[f->v][i];
	out[2] = f->sw * w->v[f->w][i];
}

/* Draws one triangle with corners i, j, k of the cluster. */
static inline void draw_element(const struct target *t, const struct face *f,
                                const struct hemi_work *w, const int i[3],
                                uint32_t element, int clipped)
{
	double v[3][3];

	for (int k = 0; k < 3; k++)
		face_vertex(w, f, i[k], v[k]);
	if (clipped) {
		draw_clipped(t, v, element);
		return;
	}
	struct corner a = corner_at(w, i[0]), b = corner_at(w, i[1]), c = corner_at(w, i[2]);
	struct depth_plane p;
	uint32_t side = (uint32_t)depth_plane(t, v[0], v[1], v[2],
	                                      min_d(a.q, min_d(b.q, c.q)),
	                                      max_d(a.q, max_d(b.q, c.q)), &p);
	draw_triangle(t, &a, &b, &c, &p, 2 * element + side);
}

static void draw_cluster(const struct target *t, const struct face *f,
                         const struct hemi_scene *s, const struct hemi_cluster *c,
                         const struct hemi_work *w, int coded, uint32_t own)
{
	for (size_t n = c->triangle; n < c->triangle + (size_t)c->triangles; n++) {
		const uint8_t *v = s->corner[n];
		int i[3] = { v[0], v[1], v[2] };
		if (coded) {
			int all = w->code[i[0]] & w->code[i[1]] & w->code[i[2]];
			int any = w->code[i[0]] | w->code[i[1]] | w->code[i[2]];
			if (all || s->element[n] == own)
				continue;
			if (any & OUT_PYRAMID) {
				draw_element(t, f, w, i, s->element[n], 1);
				continue;
			}
		}
		/* Most small triangles lie between pixel centres. */
		int left = min_i(w->column[i[0]], min_i(w->column[i[1]], w->column[i[2]]));
		int right = max_i(w->column[i[0]], max_i(w->column[i[1]], w->column[i[2]]));
		int low = min_i(w->row[i[0]], min_i(w->row[i[1]], w->row[i[2]]));
		int high = max_i(w->row[i[0]], max_i(w->row[i[1]], w->row[i[2]]));
		if (max_i(left, 0) < min_i(right, t->columns) &&
		    max_i(low, 0) < min_i(high, t->rows) && s->element[n] != own)
			draw_element(t, f, w, i, s->element[n], 0);
	}
}

/* Where a bounding sphere (centre in the cube's frame) is to a face's pyramid of
 * half width g: at least `slack` radii inside all its planes. */
static int sphere_inside(const struct face *f, const double c[3], double radius, double g,
                         double slack)
{
	double w = g * f->sw * c[f->w], limit = slack * radius * sqrt(1 + g * g);

	return w - fabs(c[f->u]) >= limit && w - fabs(c[f->v]) >= limit;
}

/* Notes the least depth of each tile of a face. */
static void note_far(const struct target *t)
{
	float *out = t->far;

	for (int j = 0; j < t->rows; j += HEMI_LANES)
		for (int i = 0; i < t->columns; i += HEMI_LANES, out++) {
			v8f least = (v8f){ 0 } + INFINITY;
			/* Beyond the end of a row are other pixels: that is only cautious. */
			for (int row = j; row < min_i(j + HEMI_LANES, t->rows); row++) {
				v8f z;
				memcpy(&z, t->depth + (size_t)row * (size_t)t->columns + i, sizeof z);
				v8i less = z < least;
				least = (v8f)(((v8i)z & less) | ((v8i)least & ~less));
			}
			*out = least[0];
			for (int k = 1; k < HEMI_LANES; k++)
				*out = least[k] < *out ? least[k] : *out;
		}
}

/* First and last tile that the interval [x - r, x + r] / [w - r, w + r] may reach. */
static inline void tile_range(double x, double w, double r, double half, double centre,
                              int tiles, int range[2])
{
	double low = (x - r) / (x > r ? w + r : w - r);
	double high = (x + r) / (x > -r ? w - r : w + r);

	low = max_d((low * half + centre) / HEMI_LANES - 1e-6, 0);
	high = min_d((high * half + centre) / HEMI_LANES + 1e-6, tiles - 1);
	range[0] = (int)low;
	range[1] = (int)high;
}

/* 1 if a sphere (centre in the cube's frame) was wholly behind what had been drawn
 * on the face when its tiles were noted. */
static int hidden(const struct target *t, const struct face *f, const double c[3], double r)
{
	double w = f->sw * c[f->w];
	int column[2], row[2];

	if (!(w > 1.001 * r))
		return 0;
	double nearest = 1.000001 / (w - r);
	tile_range(f->su * c[f->u], w, r, t->half, t->half, t->tiles, column);
	tile_range(c[f->v], w, r, t->half, t->centre_row, (t->rows + HEMI_LANES - 1) / HEMI_LANES,
	           row);
	for (int j = row[0]; j <= row[1]; j++)
		for (int i = column[0]; i <= column[1]; i++)
			if (!(t->far[j * t->tiles + i] > nearest))
				return 0;
	return 1;
}

static struct target target_face(const struct hemicube *h, int face)
{
	size_t n = (size_t)h->grid->n, tiles = hemi_tiles(h->grid->n);
	size_t before = face ? (size_t)(face - 1) : 0;
	size_t first = face ? n * n + before * (n * n / 2) : 0;
	size_t tile = face ? tiles * (tiles + before * hemi_tiles(h->grid->n / 2)) : 0;
	int half = h->grid->n / 2;

	return (struct target){ .item = h->item + first, .depth = h->depth + first,
	                        .columns = h->grid->n, .rows = face ? half : 2 * half,
	                        .half = half, .pixel = 1. / half,
	                        .centre_row = face ? 0 : half,
	                        .far = h->work->far + tile, .tiles = (int)tiles };
}

/* What one call of hemicube_render draws. */
struct drawing {
	const struct hemi_scene *s;
	const double *eye;
	const double (*frame)[3];
	uint32_t own;
	struct target target[5];
};

static void render_cluster(const struct drawing *g, struct hemi_work *w,
                           const struct hemi_cluster *c)
{
	double d[3], at[3];
	int transformed = 0;

	v3_sub(c->centre, g->eye, d);
	for (int k = 0; k < 3; k++)
		at[k] = v3_dot(g->frame[k], d);
	if (at[2] + c->radius <= g->s->horizon)
		return;
	for (int k = 0; k < 5; k++) {
		const struct face *f = &faces[k];
		if (!sphere_inside(f, at, c->radius, 1, -1) ||
		    hidden(&g->target[k], f, at, c->radius))
			continue;
		if (!transformed)
			transform(g->s, c, g->eye, g->frame, w);
		transformed = 1;
		int coded = at[2] - c->radius <= g->s->horizon ||
		            !sphere_inside(f, at, c->radius, GUARD, 1);
		project(&g->target[k], f, w, c->vertices, coded, g->s->horizon);
		draw_cluster(&g->target[k], f, g->s, c, w, coded, g->own);
		w->drawn += (size_t)c->triangles;
	}
}

void hemicube_render(struct hemicube *h, const struct hemi_scene *s, const double eye[3],
                     const double frame[3][3], uint32_t own)
{
	struct drawing g = { .s = s, .eye = eye, .frame = frame, .own = own };
	size_t tiles = hemi_tiles(h->grid->n) * (hemi_tiles(h->grid->n) +
	                                         4 * hemi_tiles(h->grid->n / 2));
	int32_t stack[64];
	int depth = 0;

	memset(h->item, 0xff, h->grid->pixels * sizeof *h->item);
	memset(h->depth, 0, h->grid->pixels * sizeof *h->depth);
	memset(h->work->far, 0, tiles * sizeof *h->work->far);
	h->work->drawn = 0;
	for (int k = 0; k < 5; k++)
		g.target[k] = target_face(h, k);
	if (s->clusters)
		stack[depth++] = s->root;
	while (depth > 0) {
		int32_t at = stack[--depth];
		if (at >= 0) { /* the child on the eye's side first */
			const struct hemi_split *p = &s->split[at];
			int near = eye[p->axis] >= p->at;
			stack[depth++] = p->child[!near];
			stack[depth++] = p->child[near];
			continue;
		}
		render_cluster(&g, h->work, &s->cluster[~at]);
		/* Noting the tiles costs about as much as drawing this many triangles. */
		if (h->work->drawn * 32 > h->grid->pixels) {
			for (int k = 0; k < 5; k++)
				note_far(&g.target[k]);
			h->work->drawn = 0;
		}
	}
}
