/* Patches: regions are halved in their own frame until the pieces are small and
 * flat enough; what a cut leaves unconnected becomes separate patches. A rectangle
 * is halved like the elements in it, so its patches are rectangles. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/mesh/stages.h"

/* Elements that each half of a patch that is halved has on average, at least: with fewer, a patch
 * costs as much as its elements. A count; a guess. */
enum { ELEMENTS_MIN = 4 };

/* Rounding, as ratios: of positions along a piece, of cosines, of lengths or scores that are
 * compared; and of a variance, over the sum of squares that it is the difference of. */
static const double position_slack = 1e-9, cosine_slack = 1e-9, length_slack = 1e-6;
static const double variance_slack = 1e-12;

/* Connected elements order[begin, end) of a region and the box, in its frame, that
 * they stand for. The box is halved exactly; elements that straddle the cut belong
 * to the side of their centroid and do not widen it. */
struct piece {
	uint32_t begin, end, region;
	uint32_t halvings;    /* that it is still to go through, whatever its size */
	double lo[3], hi[3];
};

struct divider {
	struct division d;
	uint32_t *order, *queue; /* [elements] */
	uint32_t *label;         /* [elements] the piece being divided */
	uint32_t *edge_label;    /* [edges] the search that has passed */
	uint32_t labels;
	struct array todo;
	struct err *e;
};

/* Puts queue[begin, end) on the list of pieces, with its bounding box clipped to
 * that of the piece it is part of. */
static int push_piece(struct divider *d, uint32_t begin, uint32_t end,
                      const struct piece *within)
{
	struct piece p = *within;

	p.begin = begin;
	p.end = end;
	for (int k = 0; k < 3; k++) {
		const double *axis = d->d.region[p.region].axis[k];
		double lo = INFINITY, hi = -INFINITY, low, high;
		for (uint32_t i = begin; i < end; i++) {
			mesh_division_extent(&d->d, d->queue[i], axis, &low, &high);
			lo = fmin(lo, low);
			hi = fmax(hi, high);
		}
		p.lo[k] = fmax(p.lo[k], lo);
		p.hi[k] = fmin(p.hi[k], hi);
	}
	return mem_append(&d->todo, &p, 1, sizeof p, d->e);
}

/* Appends to the queue the elements with the given label that element's edges
 * lead to, and takes their label away. */
static uint32_t spread(struct divider *d, uint32_t element, uint32_t label, uint32_t tail)
{
	for (size_t k = 0; k < 3; k++) {
		uint32_t edge = d->d.g.of[3 * (size_t)element + k];
		if (d->edge_label[edge] == label)
			continue;
		d->edge_label[edge] = label;
		for (uint32_t u = d->d.g.start[edge]; u < d->d.g.start[edge + 1]; u++) {
			uint32_t next = d->d.g.use[u] / 3;
			if (d->label[next] != label)
				continue;
			d->label[next] = 0;
			d->queue[tail++] = next;
		}
	}
	return tail;
}

/* Puts the connected parts of order[begin, end) on the list of pieces. */
static int push_connected(struct divider *d, uint32_t begin, uint32_t end,
                          const struct piece *within)
{
	uint32_t label = ++d->labels, tail = begin;

	for (uint32_t i = begin; i < end; i++)
		d->label[d->order[i]] = label;
	for (uint32_t i = begin; i < end; i++) {
		uint32_t part = tail, head = tail;
		if (d->label[d->order[i]] != label)
			continue;
		d->label[d->order[i]] = 0;
		d->queue[tail++] = d->order[i];
		while (head < tail)
			tail = spread(d, d->queue[head++], label, tail);
		if (push_piece(d, part, tail, within))
			return -1;
	}
	memcpy(d->order + begin, d->queue + begin, (end - begin) * sizeof *d->order);
	return 0;
}

/* Rounding along an axis of a piece: centroids on a cut go to its upper side
 * however the scene is turned and scaled. */
static double slack(const struct piece *p, int axis)
{
	return position_slack * (p->hi[axis] - p->lo[axis]);
}

/* Divides a piece, and its box, at centroid . axis = at. */
static int cut(struct divider *d, const struct piece *p, int axis, double at)
{
	struct piece low = *p, high = *p;
	double above_from = at - slack(p, axis);
	uint32_t n = p->begin, above = p->begin;

	for (uint32_t i = p->begin; i < p->end; i++)
		if (v3_dot(&d->d.centroid[3 * (size_t)d->order[i]],
		           d->d.region[p->region].axis[axis]) >= above_from)
			d->queue[above++] = d->order[i];
		else
			d->order[n++] = d->order[i];
	memcpy(d->order + n, d->queue + p->begin, (above - p->begin) * sizeof *d->order);
	low.hi[axis] = high.lo[axis] = at;
	low.halvings = high.halvings = p->halvings ? p->halvings - 1 : 0;
	return push_connected(d, p->begin, n, &low) || push_connected(d, n, p->end, &high) ? -1 : 0;
}

/* The longest side of the box that exceeds the patch size, or -1. */
static int too_long(const struct divider *d, const struct piece *p)
{
	double longest = d->d.size * (1 + length_slack);
	int axis = -1;

	for (int k = 0; k < 3; k++)
		if (p->hi[k] - p->lo[k] > longest * (axis < 0 ? 1 : 1 + length_slack)) {
			longest = p->hi[k] - p->lo[k];
			axis = k;
		}
	return axis;
}

/* The longest side of the box. */
static int longest_axis(const struct piece *p)
{
	int axis = 0;

	for (int k = 1; k < 3; k++)
		if (p->hi[k] - p->lo[k] > (p->hi[axis] - p->lo[axis]) * (1 + length_slack))
			axis = k;
	return axis;
}

/* Does an element turn away from the mean normal by more than the cone? */
static int too_curved(const struct divider *d, const struct piece *p)
{
	double mean[3] = { 0 };

	for (uint32_t i = p->begin; i < p->end; i++)
		v3_mad(mean, 1, &d->d.area[3 * (size_t)d->order[i]], mean);
	double bound = d->d.cos_cone * v3_length(mean);
	for (uint32_t i = p->begin; i < p->end; i++) {
		const double *n = &d->d.area[3 * (size_t)d->order[i]];
		double length = v3_length(n);
		if (!(v3_dot(n, mean) >= (bound - cosine_slack * v3_length(mean)) * length))
			return 1;
	}
	return 0;
}

/* Sums over a piece for one axis of its frame. */
struct bend {
	double lo, hi;          /* range of the centroids */
	double score;           /* how much the normal changes along the axis */
};

/* Covariance of position and normal over the deviation of the position: along a
 * cylinder nothing bends, across it everything does. */
static struct bend measure_bend(const struct divider *d, const struct piece *p, int axis)
{
	struct bend b = { INFINITY, -INFINITY, 0 };
	double n = p->end - p->begin, sx = 0, sxx = 0, sn[3] = { 0 }, sxn[3] = { 0 }, c[3];

	for (uint32_t i = p->begin; i < p->end; i++) {
		double normal[3], x = v3_dot(&d->d.centroid[3 * (size_t)d->order[i]],
		                             d->d.region[p->region].axis[axis]);
		b.lo = fmin(b.lo, x);
		b.hi = fmax(b.hi, x);
		x -= .5 * (p->lo[axis] + p->hi[axis]);
		memcpy(normal, &d->d.area[3 * (size_t)d->order[i]], sizeof normal);
		v3_normalise(normal);
		sx += x;
		sxx += x * x;
		v3_mad(sn, 1, normal, sn);
		v3_mad(sxn, x, normal, sxn);
	}
	v3_mad(sxn, -sx / n, sn, c);
	double variance = sxx - sx * sx / n;
	if (variance > variance_slack * sxx)
		b.score = v3_length(c) / sqrt(variance);
	return b;
}

/* Halves a piece where it bends most. */
static int cut_bend(struct divider *d, const struct piece *p)
{
	struct bend best = { 0 };
	int axis = -1;

	for (int k = 0; k < 3; k++) {
		struct bend b = measure_bend(d, p, k);
		if (b.hi - b.lo > 4 * slack(p, k) &&
		    (axis < 0 || b.score > best.score * (1 + length_slack))) {
			best = b;
			axis = k;
		}
	}
	if (axis >= 0)
		return cut(d, p, axis, .5 * (best.lo + best.hi));
	/* All centroids coincide: any halves will do. */
	uint32_t middle = p->begin + (p->end - p->begin) / 2;
	return push_connected(d, p->begin, middle, p) || push_connected(d, middle, p->end, p) ? -1
	                                                                                      : 0;
}

/* The same for patches that there were, by their halvings. */
static int divide_further(struct divider *d, uint32_t *patch, size_t *count)
{
	while (d->todo.n) {
		struct piece p = ((struct piece *)d->todo.data)[--d->todo.n];
		int axis = longest_axis(&p);
		if (p.halvings && p.end - p.begin >= 2 * ELEMENTS_MIN) {
			if (cut(d, &p, axis, .5 * (p.lo[axis] + p.hi[axis])))
				return -1;
			continue;
		}
		for (uint32_t i = p.begin; i < p.end; i++)
			patch[d->order[i]] = (uint32_t)*count;
		(*count)++;
	}
	return 0;
}

/* Works through the list; pieces that need no cut become patches. */
static int divide(struct divider *d, uint32_t *patch, size_t *count)
{
	while (d->todo.n) {
		struct piece p = ((struct piece *)d->todo.data)[--d->todo.n];
		int axis = p.end - p.begin > 1 ? too_long(d, &p) : -1;
		if (axis >= 0) {
			if (cut(d, &p, axis, .5 * (p.lo[axis] + p.hi[axis])))
				return -1;
		} else if (p.end - p.begin > 1 && too_curved(d, &p)) {
			if (cut_bend(d, &p))
				return -1;
		} else {
			for (uint32_t i = p.begin; i < p.end; i++)
				patch[d->order[i]] = (uint32_t)*count;
			(*count)++;
		}
	}
	return 0;
}

/* Puts the regions on the list: order becomes the elements by region. */
static int push_regions(struct divider *d, size_t regions)
{
	const uint32_t *region = d->d.element_region;
	uint32_t *start = mem_new(regions + 1, sizeof *start, "regions", d->e);
	size_t n = d->d.m->element.n;
	int status = start ? 0 : -1;

	for (size_t i = 0; start && i < n; i++)
		start[region[i] + 1]++;
	for (size_t r = 0; start && r < regions; r++)
		start[r + 1] += start[r];
	for (size_t i = n; start && i-- > 0;)
		d->order[--start[region[i] + 1]] = (uint32_t)i;
	/* start[r + 1] now is the beginning of region r. */
	for (size_t r = 0; !status && r < regions; r++) {
		struct piece all = { .region = (uint32_t)r,
			             .lo = { -INFINITY, -INFINITY, -INFINITY },
			             .hi = { INFINITY, INFINITY, INFINITY } };
		status = push_connected(d, start[r + 1],
		                        r + 1 < regions ? start[r + 2] : (uint32_t)n, &all);
	}
	free(start);
	return status;
}

/* Puts earlier patches on the list: order becomes the elements by patch. */
static int push_patches(struct divider *d, const uint32_t *old, size_t patches,
                        const uint8_t *halvings)
{
	size_t n = d->d.m->element.n;
	uint32_t *start = mem_new(patches + 2, sizeof *start, "patches", d->e);
	int status = start ? 0 : -1;

	for (size_t i = 0; start && i < n; i++)
		start[old[i] + 2]++;
	for (size_t p = 0; start && p < patches; p++)
		start[p + 2] += start[p + 1];
	for (size_t i = 0; start && i < n; i++)
		d->order[start[old[i] + 1]++] = (uint32_t)i;
	/* start[p] now is the beginning of patch p. */
	for (size_t p = patches; !status && p-- > 0;) {
		struct piece all = { .region = d->d.element_region[d->order[start[p]]],
			             .halvings = halvings[p],
			             .lo = { -INFINITY, -INFINITY, -INFINITY },
			             .hi = { INFINITY, INFINITY, INFINITY } };
		memcpy(d->queue + start[p], d->order + start[p],
		       (start[p + 1] - start[p]) * sizeof *d->queue);
		status = push_piece(d, start[p], start[p + 1], &all);
	}
	free(start);
	return status;
}

static int divider_init(struct divider *d, const struct model *m, double size, double cos_cone,
                        size_t *regions, struct err *e)
{
	*d = (struct divider){ .e = e };
	if (mesh_division_init(&d->d, m, size, cos_cone, regions, e))
		return -1;
	d->order = mem_new(m->element.n, sizeof *d->order, "patches", e);
	d->queue = mem_new(m->element.n, sizeof *d->queue, "patches", e);
	d->label = mem_new(m->element.n, sizeof *d->label, "patches", e);
	d->edge_label = mem_new(d->d.g.n, sizeof *d->edge_label, "patches", e);
	return d->order && d->queue && d->label && d->edge_label ? 0 : -1;
}

static void divider_free(struct divider *d)
{
	mesh_division_free(&d->d);
	free(d->order);
	free(d->queue);
	free(d->label);
	free(d->edge_label);
	free(d->todo.data);
}

int mesh_find_patches(const struct model *m, double size, double cos_cone, uint32_t *patch,
                      size_t *count, struct err *e)
{
	struct divider d;
	size_t regions;
	int bad = divider_init(&d, m, size, cos_cone, &regions, e);

	*count = 0;
	bad = bad || push_regions(&d, regions) || divide(&d, patch, count) ||
	      mesh_merge_patches(&d.d, patch, count, e);
	divider_free(&d);
	return bad ? -1 : 0;
}

int mesh_split_patches(const struct model *m, double size, double cos_cone, const uint32_t *old,
                       size_t patches, const uint8_t *halvings, uint32_t *patch, size_t *count,
                       struct err *e)
{
	struct divider d;
	size_t regions;
	int bad = divider_init(&d, m, size, cos_cone, &regions, e);

	*count = 0;
	bad = bad || push_patches(&d, old, patches, halvings) || divide_further(&d, patch, count);
	divider_free(&d);
	return bad ? -1 : 0;
}
