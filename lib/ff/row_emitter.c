/* What an emitter lights: direct light is the brightest of a picture and the easiest to
 * get right, with pairs of points on the emitter and on each element. */
#include "lib/ff/row_emitter.h"

#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/vec.h"
#include "lib/ff_rays/ray_samples.h"
#include "lib/geometry/solid_angle.h"

/* Pairs of points for an element, counts: more than 1024 are not worth it beside the noise of other
 * light, and 64 tell how many there should be. Guesses. */
enum { MOST_PAIRS = 1024, PILOT_PAIRS = 64 };

/* Of a close element's rays, if so many may meet the source they are as good as directions
 * to it, and less work.
 * A fraction of the rays; a guess. */
static const double plenty = .04;

/* Below this solid angle, sr, a triangle is far enough for points of it by area: directions by
 * solid angle then lose digits to cancellation. A guess. */
static const double tiny = 1e-4;

/* An element-side is tried for sure if it would be met by one in so many rays; a fainter
 * one by chance, which keeps the expectation.
 * Rays; a guess. */
static const double faint = .25;

/* ... and is worth a formula if by as many rays, or, however small it is, if the source is
 * as much of what it can see.
 * Rays, and a form factor; guesses. */
static const double worth = 1, much = 1e-5;

/* How near centres are taken to be, at least, for what an element may get: a fraction of the squared
 * sizes of both; and what of a full cosine each pair has at least, as centres say little of what
 * is askew. Guesses. */
static const double nearest = .25, askew = .02;

/* Closer than so many squared sizes of both, rays of the element meet the source. A guess. */
static const double close = 2;

/* Sine of what is in a plane, but for rounding. */
static const double in_plane = 1e-9;

/* The form factor per area between two points. */
static double kernel(const double x[3], const double nx[3], const double y[3],
                     const double ny[3])
{
	double d[3], r2, cx, cy;

	v3_sub(y, x, d);
	r2 = v3_dot(d, d);
	cx = v3_dot(d, nx);
	cy = -v3_dot(d, ny);
	return cx > 0 && cy > 0 ? cx * cy / (PI * r2 * r2) : 0;
}

static void point_on(const struct ff_element *el, double u0, double u1, double x[3])
{
	double r = sqrt(u0), w1 = r * (1 - u1), w2 = r * u1;

	for (int k = 0; k < 3; k++)
		x[k] = el->corner[k] + w1 * el->edge[0][k] + w2 * el->edge[1][k];
}

/* An element-side as the centre of the source sees it. */
struct outlook {
	double want;  /* of the row's rays, how many may be expected if nothing is in the way */
	double share; /* of the light that the element could get from all around */
	int close;    /* so close that weights of pairs of points may vary much */
};

/* From the centres, but always some of what is close or askew; none if the source is
 * behind the element. */
static struct outlook look(const struct ff_job *j, uint32_t source, uint32_t column, uint32_t rays)
{
	const double *c = j->reciprocal.centre[source >> 1];
	double x[3], d[3], nx[3], ny[3], area = j->m->element.area[column >> 1];
	double size = c[3] + j->element[column >> 1].size;

	point_on(&j->element[column >> 1], 4. / 9, .5, x);
	ff_normal(j, column >> 1, (int)(column & 1), nx);
	ff_normal(j, j->m->patch.start[source >> 1], (int)(source & 1), ny);
	v3_sub(c, x, d);
	double r2 = v3_dot(d, d), cx = v3_dot(d, nx), cy = -v3_dot(d, ny);
	if (cx < -c[3])
		return (struct outlook){ 0 };
	double s2 = fmax(r2, nearest * size * size);
	double f = fmax(fmax(0, cx) * fmax(0, cy) / s2, askew) / (PI * s2);
	return (struct outlook){ rays * area * f, j->m->patch.area[source >> 1] * f,
	                         r2 < close * size * size };
}

static int above(const struct model *m, uint32_t first, uint32_t end, const double x[3],
                 const double n[3])
{
	for (size_t i = 3 * (size_t)first; i < 3 * (size_t)end; i++) {
		double d[3];
		v3_sub(&m->vertex[3 * (size_t)m->element.corner[i]], x, d);
		if (v3_dot(d, n) > in_plane * v3_length(d))
			return 1;
	}
	return 0;
}

/* Whether light can go from the source to an element-side at all, exactly where the
 * source is plane. */
static int faces(const struct ff_job *j, uint32_t source, uint32_t column)
{
	const struct model *m = j->m;
	const uint32_t *start = &m->patch.start[source >> 1], el = column >> 1;
	int plane = m->patch.loop[(source >> 1) + 1] > m->patch.loop[source >> 1];
	double n[3];

	ff_normal(j, el, (int)(column & 1), n);
	if (!above(m, start[0], start[1], &m->vertex[3 * (size_t)m->element.corner[3 * (size_t)el]], n))
		return 0;
	ff_normal(j, start[0], (int)(source & 1), n);
	return !plane || above(m, el, el + 1, j->reciprocal.centre[source >> 1], n);
}

static uint64_t pair_seed(const struct ff_job *j, uint32_t stream, uint32_t source, uint32_t column)
{
	return rng_mix(rng_mix(j->o.seed + stream) ^ (((uint64_t)source << 32) | column));
}

/* F[source -> element-side] by rays of the element. */
static struct ff_share by_rays(struct ff_thread *t, uint32_t source, uint32_t column)
{
	const struct ff_job *j = t->job;
	uint64_t seed = pair_seed(j, 4, source, column);
	uint32_t seeds[FF_DIMS], hits = 0;
	struct ff_ray_batch b;

	for (int d = 0; d < FF_DIMS; d++)
		seeds[d] = rng_sobol_seed(seed, d);
	for (uint32_t first = 0; first < FF_CLOSE_RAYS; first += RAY_BATCH) {
		ff_rays_from_element(j, &j->of_rows, seeds, column, first, RAY_BATCH, &b);
		for (int i = 0; i < RAY_BATCH; i++)
			hits += b.ray.triangle[i] != RAY_MISS && b.ray.side[i] == (source & 1) &&
			        j->m->element.patch[b.hit[i]] == source >> 1;
	}
	t->rays += FF_CLOSE_RAYS;
	double f = (double)hits / FF_CLOSE_RAYS;
	double scale = j->m->element.area[column >> 1] / j->m->patch.area[source >> 1];
	return (struct ff_share){ column, scale * f, scale * scale * f * (1 - f) / FF_CLOSE_RAYS };
}

/* A pair of points, moved off their surfaces, and its weight. */
static double draw_pair(const struct ff_job *j, uint32_t source, uint32_t column, uint32_t i,
                        uint64_t seed, double x[3], double y[3])
{
	double nx[3], ny[3], k;
	uint32_t el = ff_point(j, source >> 1, rng_sobol(i, 0, seed), rng_sobol(i, 1, seed), y);

	point_on(&j->element[column >> 1], rng_sobol(i, 2, seed), rng_sobol(i, 3, seed), x);
	ff_normal(j, column >> 1, (int)(column & 1), nx);
	ff_normal(j, el, (int)(source & 1), ny);
	if ((k = kernel(x, nx, y, ny)) > 0) {
		ray_leave(j->rays, nx, x);
		ray_leave(j->rays, ny, y);
	}
	return k;
}

/* The same, close to: a direction from the point of the element, uniform by the solid angle
 * of one of the source's triangles, that is chosen by area. The weight is that angle times
 * the cosine, where that of points by area has no bound as they meet. y is where the
 * direction meets the triangle. */
static double draw_direction(const struct ff_job *j, uint32_t source, uint32_t column,
                             uint32_t i, uint64_t seed, double x[3], double y[3])
{
	double u[2] = { rng_sobol(i, 0, seed), rng_sobol(i, 1, seed) };
	const struct ff_element *to = &j->element[ff_choose(j, source >> 1, &u[0])];
	double corner[9], nx[3], ny[3], dir[3], off[3], k = 0;

	point_on(&j->element[column >> 1], rng_sobol(i, 2, seed), rng_sobol(i, 3, seed), x);
	ff_normal(j, column >> 1, (int)(column & 1), nx);
	ff_normal(j, (uint32_t)(to - j->element), (int)(source & 1), ny);
	v3_sub(x, to->corner, off);
	for (int c = 0; c < 3; c++) {
		corner[c] = to->corner[c];
		corner[3 + c] = to->corner[c] + to->edge[0][c];
		corner[6 + c] = to->corner[c] + to->edge[1][c];
	}
	double height = v3_dot(off, ny), angle = height > 0 ? geo_solid_angle(corner, x) : 0;
	if (angle > tiny) {
		geo_solid_angle_sample(corner, x, angle, u, dir);
		double fall = -v3_dot(dir, ny);
		k = fall > 0 ? fmax(0, v3_dot(dir, nx)) * angle * to->per_area / PI : 0;
		memcpy(y, x, sizeof ny);
		v3_mad(y, k > 0 ? height / fall : 0, dir, y);
	} else if (angle > 0) {
		point_on(to, u[0], u[1], y);
		k = kernel(x, nx, y, ny);
	}
	ray_leave(j->rays, nx, x);
	ray_leave(j->rays, ny, y);
	return k;
}

typedef double draw_fn(const struct ff_job *j, uint32_t source, uint32_t column, uint32_t i,
                       uint64_t seed, double x[3], double y[3]);

/* F[source -> element-side] by n pairs of points. */
static struct ff_share by_pairs(struct ff_thread *t, uint32_t source, uint32_t column,
                                uint32_t n, draw_fn *draw)
{
	const struct ff_job *j = t->job;
	double area = j->m->element.area[column >> 1], sum = 0, squares = 0, x[3], y[3];
	uint64_t seed = pair_seed(j, 2, source, column);

	for (uint32_t i = 0; i < n; i++) {
		double k = draw(j, source, column, i, seed, x, y);
		if (!(k > 0))
			continue;
		t->rays++;
		if (ray_blocked(j->rays, x, y))
			continue;
		sum += k;
		squares += k * k;
	}
	double mean = sum / n, spread = n > 1 ? squares / n - mean * mean : mean * mean;
	return (struct ff_share){ column, area * mean,
	                          area * area * fmax(0, spread) / (n > 1 ? n - 1 : 1) };
}

/* F[element-side -> source] if nothing is in the way, roughly. */
static double unhidden(const struct ff_job *j, uint32_t source, uint32_t column)
{
	uint64_t seed = pair_seed(j, 5, source, column);
	double sum = 0, x[3], y[3];

	for (uint32_t i = 0; i < PILOT_PAIRS; i++)
		sum += draw_direction(j, source, column, i, seed, x, y);
	return j->m->patch.area[source >> 1] * sum / PILOT_PAIRS;
}

/* An element-side close to the source. */
static struct ff_share see_close(struct ff_thread *t, uint32_t source, uint32_t column)
{
	if (!faces(t->job, source, column))
		return (struct ff_share){ 0 };
	return unhidden(t->job, source, column) > plenty
	       ? by_rays(t, source, column)
	       : by_pairs(t, source, column, MOST_PAIRS, draw_direction);
}

/* An element-side's sight of the source, to be trusted as far as `rays` rays of the row;
 * weight 0 if there is none. */
static struct ff_share element_share(struct ff_thread *t, uint32_t source, uint32_t column,
                                     uint32_t rays, struct rng *chance)
{
	struct outlook o = look(t->job, source, column, rays);
	struct ff_share s = { column, 0, 0 };
	double odds = fmin(1, o.want / faint), e, off;
	uint32_t n = 1;

	if ((t->job->formula.all || o.close || o.want >= worth || o.share >= much) &&
	    ff_formula_has(&t->job->formula, source) &&
	    ff_formula_exchange(t->formula, &t->job->formula, source, column, &e, &off,
	                        &t->tally.err)) {
		double area = t->job->m->patch.area[source >> 1];
		return (struct ff_share){ column, e / area, off / area * (off / area) };
	}
	if (o.close)
		return see_close(t, source, column);
	if (odds < 1 && !(rng_uniform(chance) < odds))
		return s;
	while (n < MOST_PAIRS && n < o.want)
		n *= 2;
	s = by_pairs(t, source, column, n, draw_pair);
	s.variance = s.variance / (odds * odds) + s.w * s.w * (1 / odds - 1) / odds;
	s.w /= odds;
	return s;
}

double ff_emitter_row(struct ff_thread *t, uint32_t source, uint32_t rays, struct err *e)
{
	const struct ff_job *j = t->job;
	struct rng chance = rng_seed(j->o.seed + 3, source);
	double sum = 0;

	t->shares.n = 0;
	for (uint32_t ps = 0; ps < 2 * j->m->patch.n; ps++) {
		const uint32_t *start = &j->m->patch.start[ps >> 1];
		if (j->is_black[ps] || j->is_ideal[ps])
			continue;
		for (uint32_t el = start[0]; el < start[1]; el++) {
			struct ff_share s = element_share(t, source, 2 * el + (ps & 1), rays, &chance);
			sum += s.w;
			if (s.w > 0 && mem_append(&t->shares, &s, 1, sizeof s, e))
				return 0;
		}
	}
	return sum;
}
