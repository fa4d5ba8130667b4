/* What an emitter lights: direct light is the brightest of a picture and the easiest to
 * get right, with pairs of points on the emitter and on each element. */
#include <math.h>

#include "ff_job.h"
#include "vec3.h"

#define PI 3.14159265358979323846

enum { MOST_PAIRS = 1024 };

/* An element-side is tried for sure if it would be met by one in so many rays; a fainter
 * one by chance, which keeps the expectation. */
static const double faint = .25;

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

/* How many of a row's rays an element-side may be expected to get if nothing is in the
 * way: from the centres, but of something close or askew always some; 0 if the one is
 * behind the other. */
static double expected(const struct ff_job *j, uint32_t source, uint32_t column, uint32_t rays)
{
	const double *c = j->gather.centre[source >> 1];
	const struct ff_element *el = &j->element[column >> 1];
	double x[3], d[3], nx[3], ny[3], radius, r2, cx, cy;

	point_on(el, 4. / 9, .5, x);
	radius = sqrt(j->m->element_area[column >> 1]);
	ff_normal(j, column >> 1, (int)(column & 1), nx);
	ff_normal(j, j->m->patch_start[source >> 1], (int)(source & 1), ny);
	v3_sub(c, x, d);
	r2 = v3_dot(d, d);
	cx = v3_dot(d, nx);
	cy = -v3_dot(d, ny);
	if (cx < -c[3])
		return 0;
	r2 = fmax(r2, .25 * (c[3] + radius) * (c[3] + radius));
	double f = fmax(fmax(0, cx) * fmax(0, cy) / r2, .02) / (PI * r2);
	return rays * j->m->element_area[column >> 1] * f;
}

/* F[source -> element-side] by n pairs of points. */
static struct ff_sight by_pairs(struct ff_thread *t, uint32_t source, uint32_t column, uint32_t n)
{
	const struct ff_job *j = t->job;
	double area = j->m->element_area[column >> 1], sum = 0, squares = 0, nx[3];
	uint64_t seed = rng_mix(rng_mix(j->o.seed + 2) ^ (((uint64_t)source << 32) | column));

	ff_normal(j, column >> 1, (int)(column & 1), nx);
	for (uint32_t i = 0; i < n; i++) {
		double x[3], y[3], ny[3], k;
		uint32_t el = ff_point(j, source >> 1, rng_sobol(i, 0, seed), rng_sobol(i, 1, seed), y);
		ff_normal(j, el, (int)(source & 1), ny);
		point_on(&j->element[column >> 1], rng_sobol(i, 2, seed), rng_sobol(i, 3, seed), x);
		if (!((k = kernel(x, nx, y, ny)) > 0))
			continue;
		ray_leave(j->rays, nx, x);
		ray_leave(j->rays, ny, y);
		t->rays++;
		if (ray_blocked(j->rays, x, y))
			continue;
		sum += k;
		squares += k * k;
	}
	double mean = sum / n, spread = n > 1 ? squares / n - mean * mean : mean * mean;
	return (struct ff_sight){ column, area * mean,
	                          area * area * fmax(0, spread) / (n > 1 ? n - 1 : 1) };
}

double ff_see(struct ff_thread *t, uint32_t source, uint32_t rays, struct err *e)
{
	const struct ff_job *j = t->job;
	struct rng chance = rng_seed(j->o.seed + 3, source);
	double sum = 0;

	t->sights.n = 0;
	for (uint32_t ps = 0; ps < 2 * j->m->patches; ps++) {
		if (j->is_black[ps] || j->is_ideal[ps])
			continue;
		for (uint32_t el = j->m->patch_start[ps >> 1]; el < j->m->patch_start[(ps >> 1) + 1]; el++) {
			double want = expected(j, source, 2 * el + (ps & 1), rays), odds = 1;
			uint32_t n = 1;
			if (want <= 0)
				continue;
			if (want < faint) {
				odds = want / faint;
				if (rng_uniform(&chance) >= odds)
					continue;
			}
			while (n < MOST_PAIRS && n < want)
				n *= 2;
			struct ff_sight s = by_pairs(t, source, 2 * el + (ps & 1), n);
			if (!(s.w > 0))
				continue;
			s.variance = s.variance / (odds * odds) + s.w * s.w * (1 / odds - 1) / odds;
			s.w /= odds;
			sum += s.w;
			if (vec_append(&t->sights, &s, 1, sizeof s, e))
				return 0;
		}
	}
	return sum;
}
