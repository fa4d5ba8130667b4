#define _DEFAULT_SOURCE
/* Random scenes: exchange areas at a loose and a tight tolerance, and by brute force where
 * they disagree and for every so many others. stress_exchange FIRST LAST [EVERY [TOLERANCE]] */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <stdio.h>
#include <time.h>

#include "tests/unit/fixtures/brute.h"
#include "tests/unit/fixtures/random_scene.h"
#include "lib/occlusion/exchange.h"

static double seconds(void)
{
	struct timespec t;

	clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
	return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* A facet clipped to the front of another, or itself. */
static int front(const struct facet *f, const struct facet *of, double near,
                 struct facet_room *room, struct facet *out)
{
	double low, high;

	geo_facet_heights(f, of->normal, of->offset, &low, &high);
	*out = *f;
	if (high <= near)
		return 0;
	if (low >= -near)
		return 1;
	if (!geo_facet_clip(f, of->normal, of->offset, room))
		return 0;
	*out = room->f;
	return 1;
}

static double brute(const struct model *m, struct brute *b, const struct occluder_set *occluders,
                    const double centre[3], const struct facet *f, const struct facet *g)
{
	struct facet_room room[2];
	struct facet a, c;

	if (!front(f, g, occluders->near, &room[0], &a) || !front(g, f, occluders->near, &room[1], &c))
		return 0;
	brute_begin(b, m, centre, &a, &c, occluders->near);
	return brute_exchange(b, 1e-4 * fmin(f->area, g->area), 3);
}

static struct brute b;

static void scene(uint64_t seed, int every, double tolerance)
{
	struct model m;
	struct facet_set s;
	struct occluder_set occluders;
	struct err e = { 0 };
	double centre[3];
	struct exchanger x, y;
	struct exchange_options o = { .relative = 1e-9, .absolute = tolerance, .most = 20000,
	                              .occluders = SHAFT_OCCLUDERS };

	if (random_scene(&m, seed) || occ_facet_set_init(&s, &m, FACETS_OF_PATCHES, &e) ||
	    occ_occluder_set_init(&occluders, &m, &e)) {
		printf("seed %lu: %s\n", (unsigned long)seed, e.text);
		return;
	}
	occ_facet_centre(&m, centre);
	occ_exchanger_init(&x, &o, &occluders, NULL, centre);
	o.absolute = 1e-8;
	o.most = 20000;
	occ_exchanger_init(&y, &o, &occluders, NULL, centre);
	double begun = seconds(), worst_off = 0, fine_time = 0, brute_time = 0, main_time = 0;
	int bad = 0, checked = 0;
	double ratio = 0;
	for (uint32_t i = 0; i < s.facets; i++)
		for (uint32_t j = 0; j < i; j++) {
			double off, off2, least = fmin(s.facet[i].area, s.facet[j].area);
			double before = x.counts.partly, crowd = x.counts.crowded, t = seconds();
			double a = occ_exchange(&x, &s, i, &s, j, &off, &e);
			double t2 = seconds() - t;
			main_time += t2;
			if (t2 > 1)
				printf("seed %lu pair %u %u: %.2f s\n", (unsigned long)seed, i, j, t2);
			if (x.counts.crowded > crowd) {
				printf("seed %lu pair %u %u: crowded\n", (unsigned long)seed, i, j);
				continue;
			}
			int suspect = !isfinite(a) || !isfinite(off) || a < -1e-18 || a > least * (1 + 1e-9);
			double fine = a;
			if (x.counts.partly > before) {
				t = seconds();
				fine = occ_exchange(&y, &s, i, &s, j, &off2, &e);
				fine_time += seconds() - t;
				double gap = fabs(a - fine);
				suspect |= gap > 4 * (off + off2) + tolerance * least;
				ratio = fmax(ratio, gap / (off + off2 + 1e-9 * least));
				worst_off = fmax(worst_off, fabs(a - fine) / least);
			}
			if (!suspect && (every <= 0 || rng_mix(seed * 1000003 + i * 1009 + j) % (uint64_t)every))
				continue;
			checked++;
			t = seconds();
			double truth = brute(&m, &b, &occluders, centre, &s.facet[i], &s.facet[j]);
			brute_time += seconds() - t;
			double err1 = fabs(a - truth) / least, err2 = fabs(fine - truth) / least;
			if (suspect || err1 > 1e-5 + 4 * off / least) {
				bad++;
				printf("seed %lu pair %u %u: F %.9g fine %.9g brute %.9g stated %.2g "
				       "%.2g off %.2g %.2g%s\n", (unsigned long)seed, i, j, a / least,
				       fine / least, truth / least, off / least, off2 / least, err1, err2,
				       suspect ? " *" : "");
			}
		}
	printf("seed %lu: %zu facets, %zu occluders, %.0f clear %.0f hidden %.0f partly, %.0f ev each, "
	       "%d checked %d bad, worst 1e-6:1e-8 %.2g, %.2g of stated, %.1f s (%.1f fine %.1f brute %.1f)\n", (unsigned long)seed, s.facets,
	       occluders.occluders, x.counts.unoccluded, x.counts.hidden, x.counts.partly,
	       x.counts.evaluations / fmax(1, x.counts.partly), checked, bad, worst_off, ratio,
	       seconds() - begun, main_time, fine_time, brute_time);
	fflush(stdout);
	occ_exchanger_free(&x);
	occ_exchanger_free(&y);
	occ_facet_set_free(&s);
	occ_occluder_set_free(&occluders);
	model_free(&m);
}

static int crosses(const double v[3][3], const double p[3], const double q[3])
{
	double n[3], x[3], c[3], u[3], w[3];

	v3_area(v[0], v[1], v[2], n);
	v3_normalise(n);
	double o = v3_dot(n, v[0]), hp = v3_dot(n, p) - o, hq = v3_dot(n, q) - o;
	if (!((hp > 1e-9 && hq < -1e-9) || (hp < -1e-9 && hq > 1e-9)))
		return 0;
	for (int k = 0; k < 3; k++)
		x[k] = p[k] + hp / (hp - hq) * (q[k] - p[k]);
	for (int i = 0; i < 3; i++) {
		v3_sub(v[(i + 1) % 3], v[i], u);
		v3_sub(x, v[i], w);
		v3_cross(u, w, c);
		if (v3_dot(c, n) < 0)
			return 0;
	}
	return 1;
}

static void pick(struct dice *d, const struct facet *f, double x[3])
{
	double area[FACET_CORNERS], sum = 0, n[3];
	int i;

	for (i = 1; i + 1 < f->n; i++) {
		v3_area(f->v, &f->v[3 * i], &f->v[3 * i + 3], n);
		sum += area[i] = v3_length(n);
	}
	double u = roll(d, 0, sum);
	for (i = 1; i + 2 < f->n && u > area[i]; i++)
		u -= area[i];
	double r = sqrt(roll(d, 0, 1)), s = roll(d, 0, 1);
	for (int k = 0; k < 3; k++)
		x[k] = (1 - r) * f->v[k] + r * ((1 - s) * f->v[3 * i + k] + s * f->v[3 * i + 3 + k]);
}

/* One pair, looked at closely. */
static void one(uint64_t seed, uint32_t i, uint32_t j)
{
	struct model m;
	struct facet_set s;
	struct occluder_set occluders;
	struct err e = { 0 };
	double centre[3], off, least;
	struct shaft l;

	random_scene(&m, seed);
	occ_facet_set_init(&s, &m, FACETS_OF_PATCHES, &e);
	occ_occluder_set_init(&occluders, &m, &e);
	occ_facet_centre(&m, centre);
	const struct facet *f = &s.facet[i], *g = &s.facet[j];
	least = fmin(f->area, g->area);
	for (int k = 0; k < 2; k++) {
		const struct facet *h = k ? g : f;
		printf("facet %d:", k);
		for (int c = 0; c < h->n; c++)
			printf(" (%.6f %.6f %.6f)", h->v[3 * c], h->v[3 * c + 1], h->v[3 * c + 2]);
		printf(" normal %.4f %.4f %.4f\n", h->normal[0], h->normal[1], h->normal[2]);
	}
	struct facet_room room[2];
	struct facet a, c;
	front(f, g, occluders.near, &room[0], &a);
	front(g, f, occluders.near, &room[1], &c);
	printf("shaft %d, occluders", (int)occ_shaft_cull(&l, &occluders, &a, &c));
	for (int k = 0; k < l.occluders; k++) {
		const struct occluder_shape *o = &occluders.occluder[l.occluder[k]];
		printf("\n  %s, %u corners:", o->flat ? "flat" : "solid", o->corners);
		for (uint32_t q = 0; q < o->corners; q++)
			printf(" (%.6f %.6f %.6f)", occluders.corner[3 * (o->corner + q)], occluders.corner[3 * (o->corner + q) + 1], occluders.corner[3 * (o->corner + q) + 2]);
	}
	printf("\n");
	for (double t = 1e-3; t > 5e-10; t /= 10) {
		struct exchanger x;
		struct exchange_options o = { .relative = 1e-9, .absolute = t, .most = 200000 };
		occ_exchanger_init(&x, &o, &occluders, NULL, centre);
		double v = occ_exchange(&x, &s, i, &s, j, &off, &e), w = occ_exchange(&x, &s, j, &s, i, &off, &e);
		printf("t %.0e: %.10g %.10g stated %.2g, %.0f evaluations\n", t, v / least, w / least, off / least, x.counts.evaluations);
		occ_exchanger_free(&x);
	}
	brute_begin(&b, &m, centre, &a, &c, occluders.near);
	for (double t = 1e-3; t > 5e-8; t /= 10) {
		b.evaluations = 0;
		double v = brute_exchange(&b, t * least, 3);
		printf("brute %.0e: %.10g (%.0f ev)\n", t, v / least, b.evaluations);
	}
	brute_begin(&b, &m, centre, &c, &a, occluders.near);
	printf("brute 1e-6: %.10g\n", brute_exchange(&b, 1e-6 * least, 3) / least);
	struct dice d = { 1, 0 };
	double sum = 0, sq = 0;
	int n = 1000000;
	for (int k = 0; k < n; k++) {
		double p[3], q[3], r[3];
		pick(&d, &a, p);
		pick(&d, &c, q);
		v3_sub(q, p, r);
		double r2 = v3_dot(r, r), w = fmax(0, v3_dot(r, a.normal)) * fmax(0, -v3_dot(r, c.normal)) / (r2 * r2 * 3.14159265358979);
		for (int t = 0; t < b.triangles && w > 0; t++)
			if (crosses((const double (*)[3])b.triangle[t], p, q))
				w = 0;
		sum += w;
		sq += w * w;
	}
	double mean = sum / n, scale = a.area * c.area / least;
	printf("random: %.8g +- %.2g\n", mean * scale, scale * sqrt((sq / n - mean * mean) / n));
}

int main(int argc, char **argv)
{
	setlinebuf(stdout);
	uint64_t first = argc > 1 ? strtoull(argv[1], NULL, 10) : 1;
	uint64_t last = argc > 2 ? strtoull(argv[2], NULL, 10) : first;

	if (argc == 5 && atoi(argv[1]) && strcmp(argv[2], "pair") == 0) {
		one(first, (uint32_t)atoi(argv[3]), (uint32_t)atoi(argv[4]));
		return 0;
	}
	for (uint64_t seed = first; seed <= last; seed++)
		scene(seed, argc > 3 ? atoi(argv[3]) : 40, argc > 4 ? atof(argv[4]) : 1e-6);
	return 0;
}
