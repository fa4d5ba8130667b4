/* Overshooting: what all sides still have to send, further reflections included, solved
 * for by GMRES (Saad & Schultz 1986), and sent in one shot each.
 *
 * With x the unshot flux of diffuse sides and links and K what shooting it leaves unshot,
 * what is to be sent is d = x + K d. K is not symmetric: of transmission, lobes, ideal
 * chains and sampling. Each channel has a Krylov space of its own, but all share the
 * passes over the form factors. Dot products weigh flux by 1 / (area albedo), in which
 * diffuse reflection is symmetric, and components by what they emit. Since the shots are
 * made as any others are, the ledger holds whatever d is, and its error stays unshot. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/radiosity/propagate_exact.h"
#include "lib/radiosity/shoot.h"

/* Steps of GMRES, each one more vector of the basis: at most, and at least however much memory
 * that takes. A guess; a residual left after them is shot as any other, or overshot again. */
enum { BASIS_MAX = 40, BASIS_MIN = 4 };

/* Bytes that the basis may take beyond BASIS_MIN vectors: 512 MiB, a guess. */
static const double basis_bytes = 1 << 29;

/* Parts of a vector's norm before Gram-Schmidt: less is what rounding has left (a few DBL_EPSILON
 * of a sum of items), and no direction. */
static const double rounding = 1e-14;

/* An albedo that is added to all in the weights, so that black sides have a finite one: a
 * guess. */
static const double albedo_least = .01;

/* The residual aimed at, over what unshot flux may be left. Light that is absorbed slowly does
 * many times what is unshot; two digits more cost a pass or two. */
static const double spare = .01;

/* Of what was unshot: overshooting that leaves more has failed. A guess. */
static const double success = .9;

struct gmres {
	struct shooter *v;
	size_t vectors, channels;
	size_t items;         /* diffuse sides, then links by origin */
	size_t size;          /* items x vectors */
	size_t most;          /* steps */
	lanes *weight;        /* [2P][vectors] */
	lanes *basis;         /* [most+1][size] */
	lanes *h;             /* [most][most+1][vectors] upper triangular */
	lanes *cos, *sin;     /* [most][vectors] rotations */
	lanes *g;             /* [most+1][vectors] right-hand side, rotated */
	lanes *norm;          /* [vectors] of x */
	void *room[7];
};

static lanes *h_at(const struct gmres *k, size_t column, size_t row)
{
	return k->h + (column * (k->most + 1) + row) * k->vectors;
}

static lanes *basis_at(const struct gmres *k, size_t i)
{
	return k->basis + i * k->size;
}

static uint32_t side_of(const struct gmres *k, size_t item)
{
	size_t sides = k->v->s->patch_sides;
	return item < sides ? (uint32_t)item : k->v->t->link_target[(item - sides) >> 1];
}

/* ---- arithmetic by channel ---- */

static void dot(const struct gmres *k, const lanes *a, const lanes *b, lanes *sum)
{
	size_t n = k->vectors;

	memset(sum, 0, n * sizeof *sum);
	for (size_t i = 0; i < k->items; i++) {
		const lanes *w = k->weight + side_of(k, i) * n;
		for (size_t v = 0; v < n; v++)
			sum[v] += w[v] * a[i * n + v] * b[i * n + v];
	}
}

static void norm(const struct gmres *k, const lanes *a, lanes *to)
{
	dot(k, a, a, to);
	for (size_t c = 0; c < k->channels; c++)
		((double *)to)[c] = sqrt(((double *)to)[c]);
}

/* y += f x */
static void add(const struct gmres *k, const lanes *f, const lanes *x, lanes *y)
{
	for (size_t i = 0; i < k->items; i++)
		for (size_t v = 0; v < k->vectors; v++)
			y[i * k->vectors + v] += f[v] * x[i * k->vectors + v];
}

/* x /= f, 0 where f is. */
static void divide(const struct gmres *k, const lanes *f, lanes *x)
{
	lanes inverse[VECTORS_MAX];

	memset(inverse, 0, k->vectors * sizeof *inverse);
	for (size_t c = 0; c < k->channels; c++) {
		double by = ((const double *)f)[c];
		((double *)inverse)[c] = by > 0 ? 1 / by : 0;
	}
	for (size_t i = 0; i < k->items; i++)
		for (size_t v = 0; v < k->vectors; v++)
			x[i * k->vectors + v] *= inverse[v];
}

/* ---- K ---- */

/* y = x - K x. The propagator's own unshot flux gives way to y meanwhile. */
static void apply(struct gmres *k, const lanes *x, lanes *y)
{
	struct shooter *v = k->v;
	struct propagator *s = &v->propagator;
	lanes *diffuse = s->unshot_diffuse, *link = s->unshot_link;
	size_t n = k->vectors, sides = v->s->patch_sides;

	memset(y, 0, k->size * sizeof *y);
	s->unshot_diffuse = y;
	s->unshot_link = y + sides * n;
	for (size_t i = 0; i < sides; i++)
		radiosity_shoot_diffuse(v, (uint32_t)i, x + i * n, NULL);
	for (size_t l = 0; l < 2 * v->s->links; l++)
		radiosity_shoot_link(v, l, x + (sides + l) * n, NULL);
	radiosity_shot_ledger_clear(&v->booked);
	s->unshot_diffuse = diffuse;
	s->unshot_link = link;
	for (size_t i = 0; i < k->size; i++)
		y[i] = x[i] - y[i];
}

/* ---- GMRES ---- */

static void rotate(lanes *a, lanes *b, const lanes *cos, const lanes *sin, size_t n)
{
	for (size_t v = 0; v < n; v++) {
		lanes t = cos[v] * a[v] + sin[v] * b[v];
		b[v] = cos[v] * b[v] - sin[v] * a[v];
		a[v] = t;
	}
}

/* The rotation that makes *b 0. */
static void new_rotation(const struct gmres *k, size_t j)
{
	const double *a = (double *)h_at(k, j, j), *b = (double *)h_at(k, j, j + 1);
	double *cos = (double *)(k->cos + j * k->vectors);
	double *sin = (double *)(k->sin + j * k->vectors);

	for (size_t c = 0; c < k->channels; c++) {
		double r = hypot(a[c], b[c]);
		cos[c] = r > 0 ? a[c] / r : 1;
		sin[c] = r > 0 ? b[c] / r : 0;
	}
}

/* Step j of Arnoldi's method with modified Gram-Schmidt. */
static void arnoldi(struct gmres *k, size_t j)
{
	lanes *w = basis_at(k, j + 1), before[VECTORS_MAX], minus[VECTORS_MAX];
	lanes *next = h_at(k, j, j + 1);

	memset(before, 0, k->vectors * sizeof *before);
	apply(k, basis_at(k, j), w);
	norm(k, w, before);
	for (size_t i = 0; i <= j; i++) {
		lanes *h = h_at(k, j, i);
		dot(k, basis_at(k, i), w, h);
		for (size_t v = 0; v < k->vectors; v++)
			minus[v] = -h[v];
		add(k, minus, basis_at(k, i), w);
	}
	norm(k, w, next);
	for (size_t c = 0; c < k->channels; c++)
		if (((double *)next)[c] <= rounding * ((double *)before)[c])
			((double *)next)[c] = 0;
	divide(k, next, w);
}

/* The largest residual of a channel, relative to what it was. */
static double residual(const struct gmres *k, size_t j)
{
	const double *g = (double *)(k->g + j * k->vectors), *all = (double *)k->norm;
	double worst = 0;

	for (size_t c = 0; c < k->channels; c++)
		if (all[c] > 0)
			worst = fmax(worst, fabs(g[c]) / all[c]);
	return worst;
}

/* Steps until the residual is `target` of what it was; how many. */
static size_t iterate(struct gmres *k, double target)
{
	size_t n = k->vectors, j = 0;

	norm(k, basis_at(k, 0), k->norm);
	memcpy(k->g, k->norm, n * sizeof *k->g);
	divide(k, k->norm, basis_at(k, 0));
	for (; j < k->most && residual(k, j) > target; j++) {
		lanes *g = k->g + j * n;
		arnoldi(k, j);
		for (size_t i = 0; i < j; i++)
			rotate(h_at(k, j, i), h_at(k, j, i + 1), k->cos + i * n, k->sin + i * n, n);
		new_rotation(k, j);
		rotate(h_at(k, j, j), h_at(k, j, j + 1), k->cos + j * n, k->sin + j * n, n);
		memset(g + n, 0, n * sizeof *g);
		rotate(g, g + n, k->cos + j * n, k->sin + j * n, n);
	}
	return j;
}

/* The solution after so many steps; it takes the place of basis vector `steps`. */
static lanes *solution_of(struct gmres *k, size_t steps)
{
	lanes *d = basis_at(k, steps);

	for (size_t j = steps; j-- > 0;) {
		double *y = (double *)(k->g + j * k->vectors);
		const double *h = (double *)h_at(k, j, j);
		for (size_t c = 0; c < k->channels; c++) {
			for (size_t i = j + 1; i < steps; i++)
				y[c] -= ((double *)h_at(k, i, j))[c] *
				        ((double *)(k->g + i * k->vectors))[c];
			y[c] = h[c] != 0 ? y[c] / h[c] : 0;
		}
	}
	memset(d, 0, k->size * sizeof *d);
	for (size_t j = 0; j < steps; j++)
		add(k, k->g + j * k->vectors, basis_at(k, j), d);
	return d;
}

/* ---- shots ---- */

/* What a row has sent in all cannot be negative: raises flux so that it is not. */
static void limit(const struct gmres *k, uint32_t row, int origin, const lanes *share,
                  lanes *flux)
{
	const double *shot = k->v->s->shot + (2 * (size_t)row + (size_t)origin) * k->channels;

	if (row == FF_NO_ROW)
		return;
	for (size_t c = 0; c < k->channels; c++) {
		double by = share ? ((const double *)share)[c] : 1;
		double *x = (double *)flux + c;
		if (by > 0 && *x * by < -shot[c])
			*x = -shot[c] / by * (1 - 1e-15); /* rounding does not pass 0 */
	}
}

static void shoot_side(struct gmres *k, uint32_t ps, lanes *d)
{
	struct shooter *v = k->v;
	struct propagator *s = &v->propagator;
	const struct transport *t = v->t;
	size_t n = k->vectors;
	const lanes *share = radiosity_propagator_share(s, ps);

	limit(k, t->diffuse_row[ps], FROM_DIFFUSE, NULL, d + ps * n);
	radiosity_exact_take(s, radiosity_exact_diffuse(s, ps), d + ps * n);
	radiosity_shoot_diffuse(v, ps, d + ps * n, v->s->shot);
	radiosity_exact_return(s, radiosity_exact_diffuse(s, ps), &v->booked);
	for (uint64_t l = 2 * t->target_link[ps]; l < 2 * t->target_link[ps + 1]; l++) {
		lanes *flux = d + (v->s->patch_sides + l) * n;
		for (uint64_t way = 0; way < 2; way++)
			limit(k, t->link_row[(l & ~(uint64_t)1) + way], (int)(l & 1),
			      share + way * n, flux);
		radiosity_exact_take(s, radiosity_exact_link(s, l), flux);
		radiosity_shoot_link(v, l, flux, v->s->shot);
		radiosity_exact_return(s, radiosity_exact_link(s, l), &v->booked);
	}
	radiosity_book(v, NULL);
	v->s->shots++;
}

/* ---- the beginning and the end ---- */

static int krylov_init(struct gmres *k, struct shooter *v, struct err *e)
{
	size_t n = v->propagator.vectors, sides = v->s->patch_sides;

	*k = (struct gmres){ .v = v, .vectors = n, .channels = v->propagator.channels,
	                      .items = sides + 2 * v->s->links };
	k->size = k->items * n;
	k->most = (size_t)fmin(BASIS_MAX, fmax(BASIS_MIN, basis_bytes /
	                                       (double)(k->size * sizeof(lanes))));
	k->weight = lanes_new(sides * n, &k->room[0], "weights", e);
	k->basis = lanes_new((k->most + 1) * k->size, &k->room[1], "overshooting", e);
	k->h = lanes_new((k->most + 1) * k->most * n, &k->room[2], "overshooting", e);
	k->cos = lanes_new(k->most * n, &k->room[3], "overshooting", e);
	k->sin = lanes_new(k->most * n, &k->room[4], "overshooting", e);
	k->g = lanes_new((k->most + 1) * n, &k->room[5], "overshooting", e);
	k->norm = lanes_new(n, &k->room[6], "overshooting", e);
	return k->weight && k->basis && k->h && k->cos && k->sin && k->g && k->norm ? 0 : -1;
}

static void krylov_free(struct gmres *k)
{
	for (size_t i = 0; i < sizeof k->room / sizeof *k->room; i++)
		free(k->room[i]);
}

/* 1 / (area x albedo x emitted^2). */
static void set_weights(struct gmres *k)
{
	const struct shooter *v = k->v;
	const struct propagator *s = &v->propagator;
	size_t n = k->vectors;

	for (uint32_t ps = 0; ps < v->s->patch_sides; ps++)
		for (size_t i = 0; i < n; i++) {
			const lanes *here = s->split + s->surface[ps] * SPLITS * n + i;
			const lanes *there = s->split + s->surface[ps ^ 1] * SPLITS * n + i;
			lanes albedo = here[SPLIT_RHO * n] + here[SPLIT_LOBES * n] +
			               there[SPLIT_TAU * n] + albedo_least;
			lanes w = v->weight[v->components.of[ps] * n + i];
			k->weight[ps * n + i] = w * w / (albedo * v->t->m->patch.area[ps >> 1]);
		}
}

/* Overshooting knows no emission: it is shot before. */
static void shoot_emission(struct shooter *v)
{
	size_t bands = (size_t)v->s->bands;

	for (uint32_t ps = 0; ps < v->s->patch_sides; ps++)
		for (size_t b = 0; b < bands; b++)
			if (v->s->unshot.emission[ps * bands + b] > 0) {
				radiosity_shoot_side(v, ps, 0);
				break;
			}
}

int radiosity_gmres_finish(struct shooter *v, double worst, double stop, struct err *e)
{
	const double target = spare * stop / worst;
	struct gmres k;
	struct propagate_exact exact;
	double left = worst;
	int bad = krylov_init(&k, v, e);

	if (!bad) {
		shoot_emission(v);
		set_weights(&k);
		memcpy(k.basis, v->propagator.unshot_diffuse,
		       v->s->patch_sides * k.vectors * sizeof(lanes));
		memcpy(k.basis + v->s->patch_sides * k.vectors, v->propagator.unshot_link,
		       2 * v->s->links * k.vectors * sizeof(lanes));
		lanes *d = solution_of(&k, iterate(&k, target));
		bad = radiosity_exact_begin(&v->propagator, &exact, e);
		for (uint32_t ps = 0; !bad && ps < v->s->patch_sides; ps++)
			shoot_side(&k, ps, d);
		radiosity_exact_end(&v->propagator);
		radiosity_survey(v, &left);
	}
	krylov_free(&k);
	return bad ? -1 : left < success * worst;
}
