#include "lib/geometry/facet.h"

#include <string.h>

#include "lib/base/vec.h"

/* Centre and radius; twice the area vector. */
static void spread(struct facet *f, double twice[3])
{
	double far = 0, first[3], a[3], b[3], c[3];

	memset(f->centre, 0, sizeof f->centre);
	for (int i = 0; i < f->n; i++)
		v3_mad(f->centre, 1, &f->v[3 * i], f->centre);
	for (int k = 0; k < 3; k++) {
		f->centre[k] /= f->n;
		twice[k] = 0;
	}
	v3_sub(f->v, f->centre, first);
	memcpy(a, first, sizeof a);
	for (int i = 1; i <= f->n; i++) {
		if (i < f->n)
			v3_sub(&f->v[3 * i], f->centre, b);
		else
			memcpy(b, first, sizeof b);
		v3_cross(a, b, c);
		v3_mad(twice, 1, c, twice);
		far = v3_dot(a, a) > far ? v3_dot(a, a) : far;
		memcpy(a, b, sizeof a);
	}
	f->radius = sqrt(far);
}

void geo_facet_measure(struct facet *f)
{
	double sum = 0;

	spread(f, f->normal);
	f->area = v3_normalise(f->normal) / 2;
	for (int i = 0; i < f->n; i++)
		sum += v3_dot(f->normal, &f->v[3 * i]);
	f->offset = sum / f->n;
}

void geo_facet_heights(const struct facet *f, const double normal[3], double offset,
                       double *lowest, double *highest)
{
	*lowest = INFINITY;
	*highest = -INFINITY;
	for (int i = 0; i < f->n; i++) {
		double h = v3_dot(normal, &f->v[3 * i]) - offset;
		*lowest = h < *lowest ? h : *lowest;
		*highest = h > *highest ? h : *highest;
	}
}

void geo_edge_divide(const double a[3], double ha, const double b[3], double hb, double out[3])
{
	const double *low = ha < hb ? a : b, *high = ha < hb ? b : a;
	double w = ha < hb ? ha / (ha - hb) : hb / (hb - ha);

	for (int k = 0; k < 3; k++)
		out[k] = low[k] + w * (high[k] - low[k]);
}

int geo_facet_clip(const struct facet *f, const double normal[3], double offset,
                   struct facet_room *out)
{
	double corner[FACET_CORNERS * 3], h[FACET_CORNERS];
	int n = 0;

	for (int i = 0; i < f->n; i++)
		h[i] = v3_dot(normal, &f->v[3 * i]) - offset;
	for (int i = 0; i < f->n; i++) {
		int j = (i + 1) % f->n;
		if (h[i] >= 0 && n < FACET_CORNERS)
			memcpy(&corner[3 * n++], &f->v[3 * i], 3 * sizeof *corner);
		if (((h[i] > 0 && h[j] < 0) || (h[i] < 0 && h[j] > 0)) && n < FACET_CORNERS)
			geo_edge_divide(&f->v[3 * i], h[i], &f->v[3 * j], h[j], &corner[3 * n++]);
	}
	if (n < 3)
		return 0;
	struct facet g = { .n = n, .v = out->corner };
	memcpy(out->corner, corner, (size_t)n * 3 * sizeof *corner);
	double twice[3];
	spread(&g, twice);
	memcpy(g.normal, f->normal, sizeof g.normal);
	g.offset = f->offset;
	g.area = v3_dot(twice, g.normal) / 2;
	out->f = g;
	return g.area > 0;
}

int geo_facet_split(const struct facet *f, const double normal[3], double offset,
                    struct facet_room part[2])
{
	double back[3] = { -normal[0], -normal[1], -normal[2] };

	return f->n < FACET_CORNERS && geo_facet_clip(f, normal, offset, &part[0]) &&
	       geo_facet_clip(f, back, -offset, &part[1]);
}

/* Unit vector along the longest edge. */
static void longest_edge(const struct facet *f, double along[3])
{
	double longest = 0, u[3];

	for (int i = 0; i < f->n; i++) {
		v3_sub(&f->v[3 * ((i + 1) % f->n)], &f->v[3 * i], u);
		double l = v3_normalise(u);
		if (l > longest) {
			longest = l;
			memcpy(along, u, sizeof u);
		}
	}
}

int geo_facet_halve(const struct facet *f, struct facet_room half[2])
{
	double along[3] = { 0 };

	longest_edge(f, along);
	return geo_facet_split(f, along, v3_dot(along, f->centre), half);
}

int geo_facet_quarter_off(const struct facet *f, const double shift[2],
                          struct facet_room quarter[4])
{
	struct facet_room half[2];
	double along[3] = { 0 }, across[3], low, high;

	longest_edge(f, along);
	v3_cross(f->normal, along, across);
	geo_facet_heights(f, across, 0, &low, &high);
	double middle = v3_dot(across, f->centre) + shift[1] * (high - low);
	geo_facet_heights(f, along, 0, &low, &high);
	return geo_facet_split(f, along, v3_dot(along, f->centre) + shift[0] * (high - low), half) &&
	       geo_facet_split(&half[0].f, across, middle, quarter) &&
	       geo_facet_split(&half[1].f, across, middle, quarter + 2);
}

int geo_facet_quarter(const struct facet *f, struct facet_room quarter[4])
{
	return geo_facet_quarter_off(f, (const double[2]){ 0, 0 }, quarter);
}

void geo_facet_point(const struct facet *f, double u, double v, double x[3])
{
	double sum = 0, area[FACET_CORNERS] = { 0 };
	int i;

	for (int k = 1; k + 1 < f->n; k++) {
		double n[3];
		v3_area(f->v, &f->v[3 * k], &f->v[3 * (k + 1)], n);
		sum += area[k] = v3_length(n);
	}
	for (i = 1, u *= sum; i + 2 < f->n && u >= area[i]; i++)
		u -= area[i];
	double r = sqrt(fmin(1, u / area[i]));
	for (int k = 0; k < 3; k++)
		x[k] = (1 - r) * f->v[k] +
		       r * ((1 - v) * f->v[3 * i + k] + v * f->v[3 * i + 3 + k]);
}
