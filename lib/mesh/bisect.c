/* Conforming subdivision by longest-edge bisection (Rivara 1984), driven by the
 * edges: an edge is halved in all triangles that share it, so no vertex ever lies
 * inside an edge, and it is the longest edge of each of them, so angles stay bounded.
 * O(n log n) for n elements. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/geometry/half_edge.h"
#include "lib/mesh/stages.h"

#define NONE UINT32_MAX

/* Half-edges, three an element, are numbered by 32 bits, splits with a child by 31. */
enum { ELEMENTS_MAX = 1 << 28 };

/* By how much the square of an edge may exceed that of the size, a ratio: rounding, so that edges
 * which are meant to be as long are not halved. */
static const double size_slack = 1e-8;

/* An element to be. Half-edge 3 leaf + k belongs to a doubly linked list of the
 * half-edges of edge[k]. */
struct leaf {
	uint32_t v[3], edge[3], next[3], prev[3];
	uint32_t triangle;
	int32_t parent;        /* 2 split + child, or -1: the root of the triangle */
	uint32_t origin;       /* what it is part of: a triangle, or an earlier element */
	uint8_t halvings;      /* that it is still to go through, whatever its size */
};

struct side {
	uint32_t lo, hi;       /* vertices */
	uint32_t head;         /* first half-edge, or NONE: it has been halved */
	double length;         /* squared, coarse */
	int queued;
};

struct work {
	struct model *m;
	struct array vertex, leaf, side, split, heap;
	double limit;          /* squared */
	struct err *e;
};

static struct leaf *leaf_of(struct work *w, uint32_t half)
{
	return (struct leaf *)w->leaf.data + half / 3;
}

static struct side *side_at(struct work *w, uint32_t i)
{
	return (struct side *)w->side.data + i;
}

/* 1 if side i is to be halved before side j: longer, or as long and of lower
 * vertices, whatever its place. */
static int before(struct work *w, uint32_t i, uint32_t j)
{
	const struct side *a = side_at(w, i), *b = side_at(w, j);

	if (a->length != b->length)
		return a->length > b->length;
	return a->lo != b->lo ? a->lo < b->lo : a->hi < b->hi;
}

static int heap_push(struct work *w, uint32_t side)
{
	if (side_at(w, side)->queued)
		return 0;
	side_at(w, side)->queued = 1;
	if (mem_append(&w->heap, &side, 1, sizeof side, w->e))
		return -1;
	uint32_t *h = w->heap.data;
	size_t at = w->heap.n - 1;
	for (; at > 0 && before(w, side, h[(at - 1) / 2]); at = (at - 1) / 2)
		h[at] = h[(at - 1) / 2];
	h[at] = side;
	return 0;
}

static uint32_t heap_pop(struct work *w)
{
	uint32_t *h = w->heap.data, top = h[0], last = h[--w->heap.n];
	size_t n = w->heap.n, at = 0, child;

	while ((child = 2 * at + 1) < n) {
		if (child + 1 < n && before(w, h[child + 1], h[child]))
			child++;
		if (!before(w, h[child], last))
			break;
		h[at] = h[child];
		at = child;
	}
	h[at] = last;
	return top;
}

/* A new side between two vertices. */
static int add_side(struct work *w, uint32_t a, uint32_t b, uint32_t *out)
{
	const double *x = w->vertex.data;
	struct side s = { a < b ? a : b, a < b ? b : a, NONE, 0, 0 };
	double d[3];

	v3_sub(&x[3 * (size_t)b], &x[3 * (size_t)a], d);
	s.length = coarse(v3_dot(d, d));
	*out = (uint32_t)w->side.n;
	return mem_append(&w->side, &s, 1, sizeof s, w->e);
}

/* The side of leaf i that is to be halved first. */
static uint32_t longest_side(struct work *w, uint32_t i)
{
	const uint32_t *edge = leaf_of(w, 3 * i)->edge;
	uint32_t longest = edge[0];

	for (int k = 1; k < 3; k++)
		if (before(w, edge[k], longest))
			longest = edge[k];
	return longest;
}

/* Queues the longest side of leaf i if the leaf is to be divided. */
static int queue_leaf(struct work *w, uint32_t i)
{
	uint32_t side = longest_side(w, i);

	return leaf_of(w, 3 * i)->halvings || side_at(w, side)->length > w->limit
	           ? heap_push(w, side) : 0;
}

/* Puts half-edge h at the head of a side's list. */
static void link_half(struct work *w, uint32_t h, uint32_t side)
{
	struct side *s = side_at(w, side);
	struct leaf *l = leaf_of(w, h);

	l->edge[h % 3] = side;
	l->prev[h % 3] = NONE;
	l->next[h % 3] = s->head;
	if (s->head != NONE)
		leaf_of(w, s->head)->prev[s->head % 3] = h;
	s->head = h;
}

static void unlink_half(struct work *w, uint32_t h)
{
	struct leaf *l = leaf_of(w, h);
	uint32_t prev = l->prev[h % 3], next = l->next[h % 3];

	if (prev != NONE)
		leaf_of(w, prev)->next[prev % 3] = next;
	else
		side_at(w, l->edge[h % 3])->head = next;
	if (next != NONE)
		leaf_of(w, next)->prev[next % 3] = prev;
}

/* Records the split of leaf i at edge k into itself and leaf j. */
static int record_split(struct work *w, uint32_t i, uint32_t j, int k)
{
	struct leaf *l = w->leaf.data;
	struct split s = { { ~(int32_t)i, ~(int32_t)j }, k };
	int32_t at = (int32_t)w->split.n, parent = l[i].parent;

	if (mem_append(&w->split, &s, 1, sizeof s, w->e))
		return -1;
	if (parent < 0)
		w->m->triangle.split[l[i].triangle] = at;
	else
		((struct split *)w->split.data)[parent / 2].child[parent % 2] = at;
	l[i].parent = 2 * at;
	l[j].parent = 2 * at + 1;
	return 0;
}

/* Halves the leaf of half-edge h at vertex mid; sides half[0] (to the lower
 * vertex) and half[1] replace the one h lay on. */
static int halve_leaf(struct work *w, uint32_t h, uint32_t mid, const uint32_t half[2])
{
	int k = (int)(h % 3), k1 = (k + 1) % 3, k2 = (k + 2) % 3;
	uint32_t i = h / 3, j = (uint32_t)w->leaf.n, cut;
	struct leaf new = *leaf_of(w, h);
	new.halvings = (uint8_t)(new.halvings - (new.halvings > 0));
	int swapped = new.v[k] > new.v[k1];
	uint32_t far = new.edge[k1];

	if (w->leaf.n >= ELEMENTS_MAX)
		return err_set(w->e, "more than %d elements; use a larger element size",
		               ELEMENTS_MAX);
	if (add_side(w, mid, new.v[k2], &cut))
		return -1;
	unlink_half(w, 3 * i + (uint32_t)k1);
	new.v[k] = mid;
	if (mem_append(&w->leaf, &new, 1, sizeof new, w->e))
		return -1;
	leaf_of(w, 3 * i)->v[k1] = mid;
	leaf_of(w, 3 * i)->halvings = new.halvings;
	link_half(w, 3 * i + (uint32_t)k, half[swapped]);
	link_half(w, 3 * i + (uint32_t)k1, cut);
	link_half(w, 3 * j + (uint32_t)k, half[!swapped]);
	link_half(w, 3 * j + (uint32_t)k1, far);
	link_half(w, 3 * j + (uint32_t)k2, cut);
	return record_split(w, i, j, k) || queue_leaf(w, i) || queue_leaf(w, j) ? -1 : 0;
}

static int halve_side(struct work *w, uint32_t side)
{
	struct side s = *side_at(w, side);
	const double *x = w->vertex.data;
	uint32_t mid = (uint32_t)w->vertex.n, half[2];
	double at[3];

	for (size_t k = 0; k < 3; k++)
		at[k] = .5 * (x[3 * (size_t)s.lo + k] + x[3 * (size_t)s.hi + k]);
	if (mem_append(&w->vertex, at, 1, sizeof at, w->e) ||
	    add_side(w, s.lo, mid, &half[0]) || add_side(w, mid, s.hi, &half[1]))
		return -1;
	side_at(w, side)->head = NONE;
	for (uint32_t h = s.head, next; h != NONE; h = next) {
		next = leaf_of(w, h)->next[h % 3];
		if (halve_leaf(w, h, mid, half))
			return -1;
	}
	return 0;
}

/* Leaves with these corners, their edges as sides. leaf[i].origin = i. */
static int begin(struct work *w, const uint32_t *corner, size_t leaves, const uint32_t *triangle,
                 const uint8_t *halvings)
{
	struct model *m = w->m;
	struct half_edges g;
	uint32_t side;

	if (geo_half_edges_build(&g, corner, leaves, m->vertices, w->e))
		return -1;
	int status = mem_append(&w->vertex, m->vertex, m->vertices, 3 * sizeof(double), w->e);
	for (uint32_t i = 0; !status && i < leaves; i++) {
		struct leaf l = { .triangle = triangle ? triangle[i] : i, .parent = -1,
			          .origin = i, .halvings = halvings ? halvings[i] : 0 };
		memcpy(l.v, &corner[3 * (size_t)i], sizeof l.v);
		status = mem_append(&w->leaf, &l, 1, sizeof l, w->e);
	}
	for (size_t i = 0; !status && i < g.n; i++) {
		uint32_t h = g.use[g.start[i]];
		status = add_side(w, geo_half_edge_from(corner, h), geo_half_edge_to(corner, h),
		                  &side);
		for (uint32_t u = g.start[i]; !status && u < g.start[i + 1]; u++)
			link_half(w, g.use[u], side);
	}
	geo_half_edges_free(&g);
	for (uint32_t i = 0; !status && i < leaves; i++)
		status = queue_leaf(w, i);
	return status;
}

/* The input triangles are leaves, and roots of trees. */
static int begin_triangles(struct work *w)
{
	struct model *m = w->m;

	m->triangle.split = mem_new(m->triangle.n, sizeof *m->triangle.split, "split trees",
	                            w->e);
	for (size_t t = 0; m->triangle.split && t < m->triangle.n; t++)
		m->triangle.split[t] = ~(int32_t)t;
	return m->triangle.split ? begin(w, m->triangle.corner, m->triangle.n, NULL, NULL) : -1;
}

/* The elements are leaves of the trees that there are. */
static int begin_elements(struct work *w, const uint8_t *halvings)
{
	struct model *m = w->m;

	if (begin(w, m->element.corner, m->element.n, m->element.triangle, halvings) ||
	    mem_append(&w->split, m->split, m->splits, sizeof *m->split, w->e))
		return -1;
	for (size_t i = 0; i < 2 * m->splits; i++) {
		int32_t child = m->split[i / 2].child[i % 2];
		if (child < 0)
			leaf_of(w, 3 * (uint32_t)~child)->parent = (int32_t)i;
	}
	return 0;
}

/* The queued side to be halved next: the longest of all leaves that have it. Where a leaf
 * has a longer one, that comes first (Rivara's longest-edge propagation path). */
static int next_side(struct work *w, uint32_t *side)
{
	while (w->heap.n) {
		uint32_t first = *(uint32_t *)w->heap.data, longest = first;
		for (uint32_t h = side_at(w, first)->head; h != NONE;
		     h = leaf_of(w, h)->next[h % 3]) {
			uint32_t other = longest_side(w, h / 3);
			if (before(w, other, longest))
				longest = other;
		}
		if (longest != first) {
			if (heap_push(w, longest))
				return -1;
			continue;
		}
		heap_pop(w);
		if (side_at(w, first)->head != NONE) {
			*side = first;
			return 1;
		}
	}
	return 0;
}

static int halve_all(struct work *w)
{
	uint32_t side;
	int more;

	while ((more = next_side(w, &side)) > 0)
		if (halve_side(w, side))
			return -1;
	return more;
}

/* Leaves become elements. */
static int finish(struct work *w, uint32_t *origin)
{
	struct model *m = w->m;
	const struct leaf *l = w->leaf.data;
	uint32_t *element = mem_new(w->leaf.n, 3 * sizeof *element, "elements", w->e);
	uint32_t *triangle = mem_new(w->leaf.n, sizeof *triangle, "elements", w->e);

	free(m->element.corner);
	free(m->element.triangle);
	m->element.corner = element;
	m->element.triangle = triangle;
	if (!element || !triangle)
		return -1;
	m->element.n = w->leaf.n;
	for (size_t i = 0; i < m->element.n; i++) {
		memcpy(&element[3 * i], l[i].v, sizeof l[i].v);
		triangle[i] = l[i].triangle;
		if (origin)
			origin[i] = l[i].origin;
	}
	free(m->vertex);
	free(m->split);
	m->vertex = w->vertex.data;
	m->vertices = w->vertex.n;
	m->split = w->split.data;
	m->splits = w->split.n;
	w->vertex.data = w->split.data = NULL;
	return 0;
}

static void release(struct work *w)
{
	free(w->vertex.data);
	free(w->leaf.data);
	free(w->side.data);
	free(w->split.data);
	free(w->heap.data);
}

int mesh_check_element_size(const struct model *m, double size, struct err *e)
{
	double area = 0, a[3];

	for (size_t t = 0; t < m->triangle.n; t++) {
		const uint32_t *c = &m->triangle.corner[3 * t];
		v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
		        &m->vertex[3 * (size_t)c[2]], a);
		area += v3_length(a);
	}
	double elements = area / (sqrt(3) / 4 * size * size);
	if (elements <= ELEMENTS_MAX && m->triangle.n <= ELEMENTS_MAX)
		return 0;
	return err_set(e, "an element size of %g m makes more than %d elements; "
	               "use a larger one", size, ELEMENTS_MAX);
}

int mesh_bisect(struct model *m, double size, struct err *e)
{
	struct work w = { .m = m, .e = e, .limit = size * size * (1 + size_slack) };
	int status = begin_triangles(&w) || halve_all(&w) || finish(&w, NULL) ? -1 : 0;

	release(&w);
	return status;
}

int mesh_bisect_further(struct model *m, const uint8_t *halvings, uint32_t **origin,
                        struct err *e)
{
	struct work w = { .m = m, .e = e, .limit = INFINITY };
	int status = begin_elements(&w, halvings) || halve_all(&w) ? -1 : 0;

	*origin = status ? NULL : mem_new(w.leaf.n, sizeof **origin, "elements", e);
	status = *origin ? finish(&w, *origin) : -1;
	release(&w);
	return status;
}
