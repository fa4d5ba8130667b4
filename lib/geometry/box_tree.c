#include "lib/geometry/box_tree.h"

#include <math.h>
#include <stdlib.h>

#include "lib/geometry/morton.h"

/* Triangles in a leaf, at most: fewer make more nodes, more make more tests a visit. A guess;
 * neither what is found nor its order depends on it. */
enum { LEAF = 4 };

struct place {
	uint64_t code;
	uint32_t triangle;
};

/* The box of a triangle's corners (rows of vertex). */
static struct box triangle_box(const double *vertex, const uint32_t *corner)
{
	struct box b;

	for (size_t k = 0; k < 3; k++) {
		double x = vertex[3 * (size_t)corner[0] + k];
		double y = vertex[3 * (size_t)corner[1] + k];
		double z = vertex[3 * (size_t)corner[2] + k];
		b.lo[k] = fmin(x, fmin(y, z));
		b.hi[k] = fmax(x, fmax(y, z));
	}
	return b;
}

static void grow(struct box *a, const struct box *b)
{
	for (int k = 0; k < 3; k++) {
		a->lo[k] = fmin(a->lo[k], b->lo[k]);
		a->hi[k] = fmax(a->hi[k], b->hi[k]);
	}
}

static int overlap(const struct box *a, const struct box *b)
{
	for (int k = 0; k < 3; k++)
		if (a->lo[k] > b->hi[k] || a->hi[k] < b->lo[k])
			return 0;
	return 1;
}

static int compare_places(const void *pa, const void *pb)
{
	const struct place *a = pa, *b = pb;

	if (a->code != b->code)
		return a->code < b->code ? -1 : 1;
	return a->triangle < b->triangle ? -1 : a->triangle > b->triangle;
}

static int sort_triangles(struct boxes *b, struct err *e)
{
	struct place *place = mem_new(b->n, sizeof *place, "boxes", e);
	struct box all = b->n ? b->box[0] : (struct box){ 0 };

	if (!place)
		return -1;
	for (size_t t = 1; t < b->n; t++)
		grow(&all, &b->box[t]);
	struct morton_curve c = geo_morton_curve(all.lo, all.hi);
	for (size_t t = 0; t < b->n; t++) {
		double x[3];
		for (int k = 0; k < 3; k++)
			x[k] = .5 * (b->box[t].lo[k] + b->box[t].hi[k]) - c.centre[k];
		place[t] = (struct place){ geo_morton(&c, x), (uint32_t)t };
	}
	qsort(place, b->n, sizeof *place, compare_places);
	for (size_t t = 0; t < b->n; t++)
		b->order[t] = place[t].triangle;
	free(place);
	return 0;
}

/* Adds the nodes of order[begin, end), halves of halves until few triangles are left. */
static void add_nodes(struct boxes *b, uint32_t begin, uint32_t end)
{
	struct boxes_node *mine = &b->node[b->nodes++];

	mine->begin = begin;
	mine->end = end;
	mine->box = b->box[b->order[begin]];
	if (end - begin <= LEAF) {
		for (uint32_t i = begin + 1; i < end; i++)
			grow(&mine->box, &b->box[b->order[i]]);
	} else {
		uint32_t middle = begin + (end - begin) / 2;
		for (int half = 0; half < 2; half++) {
			const struct box *child = &b->node[b->nodes].box;
			add_nodes(b, half ? middle : begin, half ? end : middle);
			if (half)
				grow(&mine->box, child);
			else
				mine->box = *child;
		}
	}
	mine->next = (uint32_t)b->nodes;
}

int geo_boxes_build(struct boxes *b, const double *vertex, const uint32_t *triangle, size_t n,
                    struct err *e)
{
	*b = (struct boxes){ .n = n };
	b->order = mem_new(n, sizeof *b->order, "boxes", e);
	b->box = mem_new(n, sizeof *b->box, "boxes", e);
	b->node = mem_new(n, sizeof *b->node, "boxes", e);
	if (!b->order || !b->box || !b->node)
		return -1;
	for (size_t t = 0; t < n; t++)
		b->box[t] = triangle_box(vertex, &triangle[3 * t]);
	if (sort_triangles(b, e))
		return -1;
	if (n)
		add_nodes(b, 0, (uint32_t)n);
	return 0;
}

void geo_boxes_free(struct boxes *b)
{
	free(b->order);
	free(b->box);
	free(b->node);
	*b = (struct boxes){ 0 };
}

int geo_boxes_find(const struct boxes *b, const struct box *near, double margin,
                   struct array *found, struct err *e)
{
	struct box wide = *near;

	for (int k = 0; k < 3; k++) {
		wide.lo[k] -= margin;
		wide.hi[k] += margin;
	}
	for (uint32_t at = 0; at < b->nodes;) {
		const struct boxes_node *node = &b->node[at];
		if (!overlap(&node->box, &wide)) {
			at = node->next;
			continue;
		}
		if (node->next == ++at)
			for (uint32_t i = node->begin; i < node->end; i++)
				if (overlap(&b->box[b->order[i]], &wide) &&
				    mem_append(found, &b->order[i], 1, sizeof *b->order, e))
					return -1;
	}
	return 0;
}
