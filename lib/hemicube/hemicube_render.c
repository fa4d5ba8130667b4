/* Which clusters and elements a hemicube has to draw: those above the horizon, in
 * a face's pyramid and not behind what has been drawn already. */
#include <math.h>
#include <string.h>

#include "lib/base/vec.h"
#include "lib/hemicube/hemicube.h"
#include "lib/hemicube/hemicube_raster.h"
#include "lib/hemicube/hemicube_scene.h"

typedef double v4d __attribute__((vector_size(32)));
typedef int64_t v4l __attribute__((vector_size(32)));
typedef int32_t v4i __attribute__((vector_size(16)));
typedef float v8f __attribute__((vector_size(32)));
typedef int32_t v8i __attribute__((vector_size(32)));

/* Bits of a vertex's code. */
enum { OUT_RIGHT = 1, OUT_LEFT = 2, OUT_UP = 4, OUT_DOWN = 8, OUT_PYRAMID = 15,
       BELOW_HORIZON = 16 };

/* Face coordinates (u, v, w), right-handed: u = su frame[u], w = sw frame[w]. */
static const struct face {
	int u, v, w;
	double su, sw;
} faces[5] = { { 0, 1, 2, 1, 1 }, { 1, 2, 0, 1, 1 }, { 1, 2, 0, -1, -1 },
	{ 0, 2, 1, -1, 1 }, { 0, 2, 1, 1, -1 } };

/* Cluster vertices into the cube's frame. */
static void transform(const struct hemicube_mesh *s, const struct hemicube_cluster *c,
                      const double eye[3], const double frame[3][3], struct hemicube_work *w)
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
static void project(const struct hemicube_target *t, const struct face *f, struct hemicube_work *w,
                    int vertices, int coded, double horizon)
{
	for (int i = 0; i < vertices; i += 4) {
		v4d a, b, c, one = (v4d){ 0 } + 1;
		memcpy(&a, &w->v[f->u][i], sizeof a);
		memcpy(&b, &w->v[f->v][i], sizeof b);
		memcpy(&c, &w->v[f->w][i], sizeof c);
		a *= f->su, c *= f->sw;
		if (coded) {
			v4l out = ((a > HEMICUBE_GUARD * c) & OUT_RIGHT) | ((a < -HEMICUBE_GUARD * c) & OUT_LEFT) |
			          ((b > HEMICUBE_GUARD * c) & OUT_UP) | ((b < -HEMICUBE_GUARD * c) & OUT_DOWN);
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

static inline void face_vertex(const struct hemicube_work *w, const struct face *f, int i,
                               double out[3])
{
	out[0] = f->su * w->v[f->u][i];
	out[1] = w->v[f->v][i];
	out[2] = f->sw * w->v[f->w][i];
}

/* Draws the triangle with corners i of the cluster. */
static void draw_element(const struct hemicube_target *t, const struct face *f,
                         const struct hemicube_work *w, const int i[3], uint32_t element,
                         int clipped)
{
	struct hemicube_corner c[3];
	double v[3][3];

	for (int k = 0; k < 3; k++)
		face_vertex(w, f, i[k], v[k]);
	if (clipped) {
		ff_hemicube_draw_clipped(t, v, element);
		return;
	}
	for (int k = 0; k < 3; k++)
		c[k] = (struct hemicube_corner){ w->px[i[k]], w->py[i[k]], w->pq[i[k]],
			                     w->column[i[k]], w->row[i[k]] };
	ff_hemicube_draw(t, v, c, element);
}

static void draw_cluster(const struct hemicube_target *t, const struct face *f,
                         const struct hemicube_mesh *s, const struct hemicube_cluster *c,
                         const struct hemicube_work *w, int coded, uint32_t own)
{
	for (size_t n = c->triangle; n < c->triangle + (size_t)c->triangles; n++) {
		const uint8_t *v = s->corner[n];
		int i[3] = { v[0], v[1], v[2] };
		if (coded) {
			int all = w->code[i[0]] & w->code[i[1]] & w->code[i[2]];
			int any = w->code[i[0]] | w->code[i[1]] | w->code[i[2]];
			if (all || s->number[n] == own)
				continue;
			if (any & OUT_PYRAMID) {
				draw_element(t, f, w, i, s->number[n], 1);
				continue;
			}
		}
		/* Most small triangles lie between pixel centres. */
		int left = min_i(w->column[i[0]], min_i(w->column[i[1]], w->column[i[2]]));
		int right = max_i(w->column[i[0]], max_i(w->column[i[1]], w->column[i[2]]));
		int low = min_i(w->row[i[0]], min_i(w->row[i[1]], w->row[i[2]]));
		int high = max_i(w->row[i[0]], max_i(w->row[i[1]], w->row[i[2]]));
		if (max_i(left, 0) < min_i(right, t->columns) &&
		    max_i(low, 0) < min_i(high, t->rows) && s->number[n] != own)
			draw_element(t, f, w, i, s->number[n], 0);
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
static void note_far(const struct hemicube_target *t)
{
	float *out = t->far;

	for (int j = 0; j < t->rows; j += HEMICUBE_LANES)
		for (int i = 0; i < t->columns; i += HEMICUBE_LANES, out++) {
			v8f least = (v8f){ 0 } + INFINITY;
			/* Beyond the end of a row are other pixels: that is only cautious. */
			for (int row = j; row < min_i(j + HEMICUBE_LANES, t->rows); row++) {
				v8f z;
				memcpy(&z, t->depth + (size_t)row * (size_t)t->columns + i, sizeof z);
				v8i less = z < least;
				least = (v8f)(((v8i)z & less) | ((v8i)least & ~less));
			}
			*out = least[0];
			for (int k = 1; k < HEMICUBE_LANES; k++)
				*out = least[k] < *out ? least[k] : *out;
		}
}

/* First and last tile that the interval [x - r, x + r] / [w - r, w + r] may reach. */
static inline void tile_range(double x, double w, double r, double half, double centre,
                              int tiles, int range[2])
{
	double low = (x - r) / (x > r ? w + r : w - r);
	double high = (x + r) / (x > -r ? w - r : w + r);

	low = max_d((low * half + centre) / HEMICUBE_LANES - 1e-6, 0);
	high = min_d((high * half + centre) / HEMICUBE_LANES + 1e-6, tiles - 1);
	range[0] = (int)low;
	range[1] = (int)high;
}

/* 1 if a sphere (centre in the cube's frame) was wholly behind what had been drawn
 * on the face when its tiles were noted. */
static int hidden(const struct hemicube_target *t, const struct face *f, const double c[3], double r)
{
	double w = f->sw * c[f->w];
	int column[2], row[2];

	if (!(w > 1.001 * r))
		return 0;
	double nearest = 1.000001 / (w - r);
	tile_range(f->su * c[f->u], w, r, t->half, t->half, t->tiles, column);
	tile_range(c[f->v], w, r, t->half, t->centre_row, (t->rows + HEMICUBE_LANES - 1) / HEMICUBE_LANES,
	           row);
	for (int j = row[0]; j <= row[1]; j++)
		for (int i = column[0]; i <= column[1]; i++)
			if (!(t->far[j * t->tiles + i] > nearest))
				return 0;
	return 1;
}

static struct hemicube_target target_face(const struct hemicube *h, int face)
{
	size_t n = (size_t)h->grid->n, tiles = ff_hemicube_tiles(h->grid->n);
	size_t before = face ? (size_t)(face - 1) : 0;
	size_t first = face ? n * n + before * (n * n / 2) : 0;
	size_t tile = face ? tiles * (tiles + before * ff_hemicube_tiles(h->grid->n / 2)) : 0;
	int half = h->grid->n / 2;

	return (struct hemicube_target){ .item = h->item + first, .depth = h->depth + first,
	                        .columns = h->grid->n, .rows = face ? half : 2 * half,
	                        .half = half, .pixel = 1. / half,
	                        .centre_row = face ? 0 : half,
	                        .far = h->work->far + tile, .tiles = (int)tiles };
}

/* What one call of ff_hemicube_render draws. */
struct drawing {
	const struct hemicube_mesh *s;
	const double *eye;
	const double (*frame)[3];
	uint32_t own;
	struct hemicube_target target[5];
};

static void render_cluster(const struct drawing *g, struct hemicube_work *w,
                           const struct hemicube_cluster *c)
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
		            !sphere_inside(f, at, c->radius, HEMICUBE_GUARD, 1);
		project(&g->target[k], f, w, c->vertices, coded, g->s->horizon);
		draw_cluster(&g->target[k], f, g->s, c, w, coded, g->own);
		w->drawn += (size_t)c->triangles;
	}
}

static void draw_mesh(struct hemicube *h, struct drawing *g)
{
	const struct hemicube_mesh *s = g->s;
	size_t tiles = ff_hemicube_tiles(h->grid->n) * (ff_hemicube_tiles(h->grid->n) +
	                                                4 * ff_hemicube_tiles(h->grid->n / 2));
	int32_t stack[64];
	int depth = 0;

	memset(h->item, 0xff, h->grid->pixels * sizeof *h->item);
	memset(h->depth, 0, h->grid->pixels * sizeof *h->depth);
	memset(h->work->far, 0, tiles * sizeof *h->work->far);
	h->work->drawn = 0;
	for (int k = 0; k < 5; k++)
		g->target[k] = target_face(h, k);
	if (s->clusters)
		stack[depth++] = s->root;
	while (depth > 0) {
		int32_t at = stack[--depth];
		if (at >= 0) { /* the child on the eye's side first */
			const struct hemicube_split *p = &s->split[at];
			int near = g->eye[p->axis] >= p->at;
			stack[depth++] = p->child[!near];
			stack[depth++] = p->child[near];
			continue;
		}
		render_cluster(g, h->work, &s->cluster[~at]);
		/* Noting the tiles costs about as much as drawing this many triangles. */
		if (h->work->drawn * 16 > h->grid->pixels) {
			for (int k = 0; k < 5; k++)
				note_far(&g->target[k]);
			h->work->drawn = 0;
		}
	}
}

/* The weights of corners 1 and 2 of a triangle, and the sum of all three, up to a factor, as
 * affine functions of the column along a row of pixels. */
struct row_weights {
	double at[3], step[3];
};

static const struct hemicube_found *find_triangle(struct hemicube_work *w, const struct drawing *g,
                                                  const struct model *m, uint32_t triangle)
{
	struct hemicube_found *f = &w->found[triangle % HEMICUBE_FOUND];
	double v[3][3], d[3], first[3];

	if (f->triangle == triangle)
		return f;
	f->triangle = triangle;
	for (int k = 0; k < 3; k++) {
		v3_sub(&m->vertex[3 * (size_t)m->triangle.corner[3 * (size_t)triangle + (size_t)k]],
		       g->eye, d);
		for (int c = 0; c < 3; c++)
			v[k][c] = v3_dot(g->frame[c], d);
	}
	v3_cross(v[1], v[2], first);
	v3_cross(v[2], v[0], f->side[0]);
	v3_cross(v[0], v[1], f->side[1]);
	for (int c = 0; c < 3; c++)
		f->side[2][c] = first[c] + f->side[0][c] + f->side[1][c];
	return f;
}

/* Along the row at height y of a face, column 0 at x0, in units of the face's distance. */
static struct row_weights weights_along(const struct hemicube_found *f, const struct face *face, double x0,
                                        double pixel, double y)
{
	struct row_weights w;

	for (int k = 0; k < 3; k++) {
		const double *p = f->side[k];
		w.step[k] = face->su * p[face->u] * pixel;
		w.at[k] = face->su * p[face->u] * x0 + p[face->v] * y + face->sw * p[face->w];
	}
	return w;
}

/* Some pixels of a row while their elements are found. */
enum { AT_ONCE = 64 };
struct finding {
	float x[AT_ONCE], y[AT_ONCE]; /* weights of the triangle's corners 1 and 2 */
	int32_t at[AT_ONCE];          /* a node of its split tree, or ~element */
};

/* Where pixels [i, end), all of one triangle, which begin at column `first` of the row, are in
 * the triangle's table. Nothing here depends on what the table says, so the memory of many
 * pixels is asked for together. */
static void look_up(const struct locator *l, uint32_t triangle, const struct row_weights *w,
                    int first, int i, int end, struct finding *p)
{
	for (int k = i; k < end; k++) {
		double at = first + k, whole = 1 / (w->at[2] + w->step[2] * at);
		p->x[k] = (float)((w->at[0] + w->step[0] * at) * whole);
		p->y[k] = (float)((w->at[1] + w->step[1] * at) * whole);
	}
	for (int k = i; k < end; k++)
		p->at[k] = *ray_locate_begin(l, triangle, p->x[k], p->y[k]);
}

/* Turns the input triangles of n pixels of a row at height y into elements. */
static void find_pixels(struct hemicube_work *work, const struct drawing *g, int k,
                        const struct hemicube_scene *s, double y, int first, int n, uint32_t *item)
{
	const double pixel = g->target[k].pixel;
	const struct locator *l = s->locator;
	struct finding p;

	for (int i = 0, end; i < n; i = end) {
		uint32_t triangle = item[i] >> 1;
		for (end = i + 1; end < n && item[end] >> 1 == triangle;)
			end++;
		if (item[i] == HEMICUBE_VOID)
			continue;
		struct row_weights w = weights_along(find_triangle(work, g, s->m, triangle), &faces[k],
		                                     .5 * pixel - 1, pixel, y);
		look_up(l, triangle, &w, first, i, end, &p);
	}
	for (int i = 0; i < n; i++)
		if (item[i] != HEMICUBE_VOID)
			item[i] = 2 * ray_locate_below(l, p.at[i], p.x[i], p.y[i]) + (item[i] & 1);
}

/* Turns the input triangles of a face into elements, O(1) a pixel. */
static void find_elements(struct hemicube_work *work, const struct drawing *g, int k,
                          const struct hemicube_scene *s)
{
	const struct hemicube_target *t = &g->target[k];

	for (int row = 0; row < t->rows; row++)
		for (int i = 0; i < t->columns; i += AT_ONCE)
			find_pixels(work, g, k, s, (row + .5 - t->centre_row) * t->pixel, i,
			            min_i(AT_ONCE, t->columns - i),
			            t->item + (size_t)row * (size_t)t->columns + i);
}

/* Pixels whose element is found in the time that drawing an element takes: tests/bench/hemicube.c
 * measures both. */
enum { FOUND_A_DRAWN = 8 };

void ff_hemicube_render(struct hemicube *h, const struct hemicube_scene *s, const double eye[3],
                        const double frame[3][3], uint32_t own)
{
	const struct hemicube_mesh *t = &s->triangles;
	struct drawing g = { .s = t, .eye = eye, .frame = frame, .own = own };
	int by_element = !t->triangles || (s->elements.triangles - t->triangles) * FOUND_A_DRAWN <=
	                                  h->grid->pixels;

	if (by_element)
		g.s = &s->elements;
	else if (own != HEMICUBE_VOID)
		g.own = s->m->element.triangle[own];
	draw_mesh(h, &g);
	if (by_element)
		return;
	for (int i = 0; i < HEMICUBE_FOUND; i++)
		h->work->found[i].triangle = HEMICUBE_VOID;
	for (int k = 0; k < 5; k++)
		find_elements(h->work, &g, k, s);
}
