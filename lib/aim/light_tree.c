#include "lib/aim/light_tree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/scatter/lobe.h"

/* A count: the depth of a tree over 2^32 lights, each split in the middle, with room. */
enum { DEEPEST = 40 };

/* What normals count beside places where lights are split, as part of the size of all: a guess,
 * by which the two faces of a panel part before its halves do. */
static const double turn_counts = .25;

/* ---- building ---- */

/* A light while the tree is built: place and normal as one point. */
struct item {
	double at[6], key;
	uint32_t light;
};

struct builder {
	const struct facet *facet;
	const double *power;
	struct item *item;
	struct light_tree *t;
};

static int by_key(const void *x, const void *y)
{
	const struct item *a = x, *b = y;

	return a->key != b->key ? (a->key > b->key) - (a->key < b->key)
	                        : (a->light > b->light) - (a->light < b->light);
}

/* Sorts items along the coordinate in which they are spread most. */
static void sort(struct item *item, size_t n)
{
	int widest = 0;
	double most = -1;

	for (int k = 0; k < 6; k++) {
		double low = INFINITY, high = -INFINITY;
		for (size_t i = 0; i < n; i++) {
			low = fmin(low, item[i].at[k]);
			high = fmax(high, item[i].at[k]);
		}
		widest = high - low > most ? k : widest;
		most = fmax(most, high - low);
	}
	for (size_t i = 0; i < n; i++)
		item[i].key = item[i].at[widest];
	qsort(item, n, sizeof *item, by_key);
}

static void make_leaf(const struct builder *b, uint32_t light, struct light_node *to)
{
	const struct facet *f = &b->facet[light];

	memcpy(to->centre, f->centre, sizeof to->centre);
	memcpy(to->axis, f->normal, sizeof to->axis);
	to->radius = f->radius;
	to->cosine = 1;
	to->power = b->power[light];
	to->area = f->area;
	to->light = light;
}

/* A sphere about two, into the first. */
static void join_spheres(struct light_node *to, const struct light_node *with)
{
	double d[3];

	v3_sub(with->centre, to->centre, d);
	double way = v3_length(d);
	if (way + with->radius <= to->radius)
		return;
	if (way + to->radius <= with->radius) {
		memcpy(to->centre, with->centre, sizeof to->centre);
		to->radius = with->radius;
		return;
	}
	double radius = (way + to->radius + with->radius) / 2;
	v3_mad(to->centre, (radius - to->radius) / way, d, to->centre);
	to->radius = radius;
}

/* The same of cones. */
static void join_cones(struct light_node *to, const struct light_node *with)
{
	double cosine = v3_dot(to->axis, with->axis), across[3];
	double a = acos(to->cosine), b = acos(with->cosine), between = acos(fmax(-1, fmin(1, cosine)));

	if (b + between <= a)
		return;
	if (a + between <= b) {
		memcpy(to->axis, with->axis, sizeof to->axis);
		to->cosine = with->cosine;
		return;
	}
	double half = (a + b + between) / 2, turn = half - a;
	v3_mad(with->axis, -cosine, to->axis, across);
	if (half >= PI || !(v3_normalise(across) > 0)) {
		to->cosine = -1;
		return;
	}
	for (int k = 0; k < 3; k++)
		to->axis[k] = cos(turn) * to->axis[k] + sin(turn) * across[k];
	to->cosine = cos(half);
}

/* Builds the tree over items [from, from + n) below a parent; returns its root. */
static uint32_t build(struct builder *b, size_t from, size_t n, uint32_t parent)
{
	uint32_t at = (uint32_t)b->t->nodes++;
	struct light_node *to = &b->t->node[at];

	to->parent = parent;
	if (n == 1) {
		make_leaf(b, b->item[from].light, to);
		b->t->leaf[to->light] = at;
		return at;
	}
	sort(b->item + from, n);
	uint32_t first = build(b, from, n / 2, at);
	uint32_t second = build(b, from + n / 2, n - n / 2, at);
	struct light_node both = b->t->node[first];
	join_spheres(&both, &b->t->node[second]);
	join_cones(&both, &b->t->node[second]);
	both.power += b->t->node[second].power;
	both.area += b->t->node[second].area;
	both.second = second;
	both.parent = parent;
	*to = both;
	return at;
}

/* Items of the lights that have power; returns their number. */
static size_t list_items(struct builder *b, size_t n)
{
	double low[3] = { INFINITY, INFINITY, INFINITY }, high[3] = { -INFINITY, -INFINITY, -INFINITY };
	double size[3];
	size_t some = 0;

	for (size_t i = 0; i < n; i++) {
		b->t->leaf[i] = UINT32_MAX;
		if (!(b->power[i] > 0) || b->facet[i].n == 0)
			continue;
		for (int k = 0; k < 3; k++) {
			low[k] = fmin(low[k], b->facet[i].centre[k]);
			high[k] = fmax(high[k], b->facet[i].centre[k]);
		}
		b->item[some++].light = (uint32_t)i;
	}
	v3_sub(high, low, size);
	for (size_t i = 0; i < some; i++) {
		const struct facet *f = &b->facet[b->item[i].light];
		for (int k = 0; k < 3; k++) {
			b->item[i].at[k] = f->centre[k];
			b->item[i].at[3 + k] = f->normal[k] * turn_counts * v3_length(size);
		}
	}
	return some;
}

int aim_tree_init(struct light_tree *t, const struct facet *facet, const double *power,
                         size_t n, struct err *e)
{
	struct builder b = { .facet = facet, .power = power, .t = t };

	*t = (struct light_tree){ 0 };
	if (n > UINT32_MAX / 2)
		return err_set(e, "%zu lights are too many", n);
	b.item = mem_new(n, sizeof *b.item, "light tree", e);
	t->leaf = mem_new(n, sizeof *t->leaf, "light tree", e);
	t->node = mem_new(n, 2 * sizeof *t->node, "light tree", e);
	int bad = !b.item || !t->leaf || !t->node;
	size_t some = bad ? 0 : list_items(&b, n);
	if (some)
		build(&b, 0, some, 0);
	free(b.item);
	return bad ? -1 : 0;
}

void aim_tree_free(struct light_tree *t)
{
	free(t->node);
	free(t->leaf);
	*t = (struct light_tree){ 0 };
}

/* ---- what a lobe may see ---- */

/* cos(max(0, a - b)) of angles in [0, pi], b no more than half of it. */
static double cosine_within(double cos_a, double cos_b)
{
	if (cos_a >= cos_b)
		return 1;
	return cos_a * cos_b + sqrt(fmax(0, 1 - cos_a * cos_a) * (1 - cos_b * cos_b));
}

/* About the radiance that a lobe of unit coefficient makes of a node if nothing is in the way,
 * all of it being where it is best: no more than that of its lights. Never 0 where there is any. */
static double bound(const struct light_node *t, const struct light_lobe *l)
{
	double d[3], r2 = t->radius * t->radius;

	v3_sub(t->centre, l->x, d);
	double way2 = v3_dot(d, d), way = sqrt(way2);
	if (v3_dot(l->normal, d) + t->radius <= 0)
		return 0;
	if (way2 <= r2)
		return t->power / t->area;
	double wide = sqrt(1 - r2 / way2); /* cosine of half the angle it is seen at */
	double there = -v3_dot(t->axis, d) / way, sends = cosine_within(there, fmax(0, t->cosine));
	if (t->cosine <= 0 || !(wide > 0))
		sends = 1;
	else if (sends < 1)
		sends = cosine_within(sends, wide);
	if (sends <= 0)
		return 0;
	double off = cosine_within(v3_dot(l->axis, d) / way, wide);
	double lobe = (l->k + 1) / (2 * PI) * bsdf_lobe_power(l->k, off);
	return t->power * sends * fmin(lobe / way2, 1 / t->area);
}

int aim_tree_worth(const struct light_tree *t, const struct light_lobe *l, double enough)
{
	uint32_t stack[DEEPEST];
	double sum = 0;
	int n = 0;

	if (t->nodes)
		stack[n++] = 0;
	while (n) {
		const struct light_node *at = &t->node[stack[--n]];
		double most = bound(at, l);
		if (most < enough || !at->second) {
			sum += most;
			if (sum > 0 && sum >= enough)
				return 1;
			continue;
		}
		stack[n++] = at->second;
		stack[n++] = (uint32_t)(at - t->node) + 1;
	}
	return 0;
}

/* The chance of a node's first child; -1 if neither has any. */
static double first_chance(const struct light_tree *t, const struct light_lobe *l, uint32_t at)
{
	double first = bound(&t->node[at + 1], l), second = bound(&t->node[t->node[at].second], l);

	return first + second > 0 ? first / (first + second) : -1;
}

double aim_tree_choose(const struct light_tree *t, const struct light_lobe *l, double *u,
                              uint32_t *light)
{
	double chance = t->nodes && bound(t->node, l) > 0 ? 1 : 0;
	uint32_t at = 0;

	while (chance > 0 && t->node[at].second) {
		double first = first_chance(t, l, at);
		if (first < 0)
			return 0;
		int turn = *u >= first;
		double part = turn ? 1 - first : first;
		*u = fmin((turn ? *u - first : *u) / part, 1 - 0x1p-33);
		chance *= part;
		at = turn ? t->node[at].second : at + 1;
	}
	*light = t->nodes ? t->node[at].light : 0;
	return chance;
}

double aim_tree_chance(const struct light_tree *t, const struct light_lobe *l,
                              uint32_t light)
{
	uint32_t at = t->leaf[light];
	double chance = at != UINT32_MAX && bound(t->node, l) > 0 ? 1 : 0;

	while (chance > 0 && at) {
		uint32_t up = t->node[at].parent;
		double first = first_chance(t, l, up);
		if (first < 0)
			return 0;
		chance *= at == up + 1 ? first : 1 - first;
		at = up;
	}
	return chance;
}

int aim_tree_at(const struct light_tree *t, const double x[3], double near,
                       int (*found)(uint32_t light, void *arg), void *arg)
{
	uint32_t stack[DEEPEST];
	int n = 0;

	if (t->nodes)
		stack[n++] = 0;
	while (n) {
		const struct light_node *at = &t->node[stack[--n]];
		double d[3];
		v3_sub(at->centre, x, d);
		if (v3_length(d) > at->radius * (1 + near))
			continue;
		if (!at->second) {
			if (found(at->light, arg))
				return 1;
			continue;
		}
		stack[n++] = at->second;
		stack[n++] = (uint32_t)(at - t->node) + 1;
	}
	return 0;
}
