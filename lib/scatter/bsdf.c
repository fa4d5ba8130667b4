#include "lib/scatter/bsdf.h"

#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/vec.h"
#include "lib/scatter/lobe.h"

/* A cosine: directions that have a smaller one to the normal lie in the surface, as far as the
 * rounding of a dot product (some 1e-16) tells: they belong to no side and scatter nothing.
 * A guess. */
static const double in_plane = 1e-14;

/* One way to scatter: coefficients, exponent and chance of being sampled. */
struct part {
	enum bsdf_event event;
	const double *coefficient;
	double k, chance;
};

enum { PARTS_MAX = 4 };  /* rho_d, tau_d, rho_s, tau_s */

/* The parts open to a known direction, with chances that sum to 1 (or n = 0). */
struct parts {
	int n;
	double cosine;      /* n.known, signed */
	struct part part[PARTS_MAX];
};

static int black_side(const struct materials *mt, size_t material, int side)
{
	return side == BACK && mt->one_sided[material];
}

static double band_mean(const double *c, int bands)
{
	double sum = 0;

	for (int b = 0; b < bands; b++)
		sum += c[b];
	return sum / bands;
}

static void add_part(struct parts *p, enum bsdf_event event, const double *coefficient,
                     double k, int bands)
{
	double mean = band_mean(coefficient, bands);

	if (mean > 0)
		p->part[p->n++] = (struct part){ event, coefficient, k, mean };
}

static void list_parts(const struct model *m, size_t material, const double n[3],
                       const double known[3], enum bsdf_transport transport,
                       struct parts *p)
{
	const struct materials *mt = &m->material;
	double total = 0;

	p->n = 0;
	p->cosine = v3_dot(n, known);
	if (fabs(p->cosine) < in_plane)
		return;
	/* Coefficients are those of wi's side: for transmission seen from the eye
	 * that is the side across from the known direction. */
	int side = p->cosine > 0 ? FRONT : BACK;
	int across = transport == BSDF_FROM_LIGHT ? side : !side;
	size_t r = model_material_at(mt, material, side);
	size_t t = model_material_at(mt, material, across);
	if (!black_side(mt, material, side)) {
		double k = mt->alpha[2 * material + (size_t)side];
		add_part(p, BSDF_DIFFUSE_R, &mt->rho_d[r], 0, mt->bands);
		add_part(p, isinf(k) ? BSDF_IDEAL_R : BSDF_LOBE_R, &mt->rho_s[r], k, mt->bands);
	}
	if (!black_side(mt, material, across)) {
		double k = mt->beta[2 * material + (size_t)across];
		add_part(p, BSDF_DIFFUSE_T, &mt->tau_d[t], 0, mt->bands);
		add_part(p, isinf(k) ? BSDF_IDEAL_T : BSDF_LOBE_T, &mt->tau_s[t], k, mt->bands);
	}
	for (int i = 0; i < p->n; i++)
		total += p->part[i].chance;
	for (int i = 0; i < p->n; i++)
		p->part[i].chance /= total;
}

static int transmits(enum bsdf_event event)
{
	return event == BSDF_DIFFUSE_T || event == BSDF_LOBE_T || event == BSDF_IDEAL_T;
}

/* Density of the way bsdf_sample draws from a lobe about an axis at this angle. */
static double lobe_pdf(enum lobe_kind kind, double k, double power, double cos_axis)
{
	if (kind == LOBE_RECIPROCAL)
		return (k + 1) / (2 * PI) * power;
	return power / bsdf_lobe_normaliser(k, cos_axis);
}

/* f of a lobe with unit coefficient from its density about the known direction's
 * axis; a and b are the absolute cosines of the known and the unknown direction.
 * Light incident at theta_i has its axis at theta_i on whichever side it leaves. */
static double lobe_f(enum lobe_kind kind, double k, double power, double density, double a,
                     double b, enum bsdf_transport transport)
{
	if (kind == LOBE_RECIPROCAL) /* Neumann, Neumann & Szirmay-Kalos 1999 */
		return density / fmax(a, b);
	if (transport == BSDF_FROM_LIGHT)
		return density / b;
	return power / (bsdf_lobe_normaliser(k, b) * a);
}

/* f(wi -> wo) into f[bands] (unless NULL) and the sampling density of the unknown
 * direction w, both without deltas; returns |n.w|. */
static double evaluate(const struct model *m, const struct parts *p, const double n[3],
                       const double known[3], const double w[3],
                       enum bsdf_transport transport, double *f, double *pdf)
{
	double cos_w = v3_dot(n, w), along = v3_dot(known, w);
	double a = fabs(p->cosine), b = fabs(cos_w);
	int crosses = cos_w * p->cosine < 0;

	if (f)
		memset(f, 0, (size_t)m->bands * sizeof *f);
	*pdf = 0;
	if (b < in_plane)
		return 0;
	for (int i = 0; i < p->n; i++) {
		const struct part *part = &p->part[i];
		double scale = 1 / PI, density = b / PI;
		if (isinf(part->k) || transmits(part->event) != crosses)
			continue;
		if (part->event == BSDF_LOBE_R || part->event == BSDF_LOBE_T) {
			/* R.w = 2 (n.l)(n.w) - l.w; T.w = -l.w */
			double cos_gamma = crosses ? -along : 2 * p->cosine * cos_w - along;
			double power = bsdf_lobe_power(part->k, cos_gamma);
			if (power == 0)
				continue;
			density = lobe_pdf(m->lobe, part->k, power, a);
			if (f)
				scale = lobe_f(m->lobe, part->k, power, density, a, b, transport);
		}
		*pdf += part->chance * density;
		for (int c = 0; f && c < m->bands; c++)
			f[c] += part->coefficient[c] * scale;
	}
	return b;
}

void bsdf_eval(const struct model *m, size_t material, const double n[3],
               const double wi[3], const double wo[3], double *f)
{
	struct parts p;
	double pdf;

	list_parts(m, material, n, wi, BSDF_FROM_LIGHT, &p);
	evaluate(m, &p, n, wi, wo, BSDF_FROM_LIGHT, f, &pdf);
}

void bsdf_eval_lobes(const struct model *m, size_t material, const double n[3],
                     const double wi[3], const double wo[3], double *f)
{
	struct parts p;
	double pdf;
	int lobes = 0;

	list_parts(m, material, n, wi, BSDF_FROM_LIGHT, &p);
	for (int i = 0; i < p.n; i++)
		if (p.part[i].event == BSDF_LOBE_R || p.part[i].event == BSDF_LOBE_T)
			p.part[lobes++] = p.part[i];
	p.n = lobes;
	evaluate(m, &p, n, wi, wo, BSDF_FROM_LIGHT, f, &pdf);
}

double bsdf_pdf(const struct model *m, size_t material, const double n[3],
                const double known[3], enum bsdf_transport transport, const double w[3])
{
	struct parts p;
	double pdf;

	list_parts(m, material, n, known, transport, &p);
	evaluate(m, &p, n, known, w, transport, NULL, &pdf);
	return pdf;
}

static const struct part *choose(const struct parts *p, double u)
{
	int i = 0;

	for (; i < p->n - 1 && u >= p->part[i].chance; i++)
		u -= p->part[i].chance;
	return &p->part[i];
}

/* The unknown direction of one part, n and known as in bsdf_sample. */
static void draw(const struct model *m, const struct part *part, double cosine,
                 const double n[3], const double known[3], const double u[2], double w[3])
{
	double normal[3], axis[3], up = (cosine > 0) == !transmits(part->event) ? 1 : -1;

	for (int i = 0; i < 3; i++) {
		normal[i] = up * n[i];
		axis[i] = -known[i];
	}
	if (!transmits(part->event))
		bsdf_lobe_mirror(known, n, axis);
	if (part->event == BSDF_DIFFUSE_R || part->event == BSDF_DIFFUSE_T)
		bsdf_sample_cosine(normal, u, w);
	else if (isinf(part->k))
		memcpy(w, axis, sizeof axis);
	else if (m->lobe == LOBE_RECIPROCAL)
		bsdf_lobe_sample_whole(part->k, axis, u, w);
	else
		bsdf_lobe_sample(part->k, axis, normal, u, w);
}

void bsdf_sample(const struct model *m, size_t material, const double n[3],
                 const double known[3], enum bsdf_transport transport,
                 const double u[3], struct bsdf_sample *out)
{
	struct parts p;
	double f[BANDS_MAX];

	*out = (struct bsdf_sample){ .event = BSDF_ABSORBED };
	list_parts(m, material, n, known, transport, &p);
	if (p.n == 0)
		return;
	const struct part *part = choose(&p, u[0]);
	draw(m, part, p.cosine, n, known, u + 1, out->w);
	if (isinf(part->k)) {
		out->event = part->event;
		for (int b = 0; b < m->bands; b++)
			out->weight[b] = part->coefficient[b] / part->chance;
		return;
	}
	/* A whole lobe's sample below the horizon is absorbed, although another
	 * part might send light there. */
	if ((v3_dot(n, out->w) * p.cosine < 0) != transmits(part->event))
		return;
	double cosine = evaluate(m, &p, n, known, out->w, transport, f, &out->pdf);
	if (!(out->pdf > 0))
		return;
	out->event = part->event;
	for (int b = 0; b < m->bands; b++)
		out->weight[b] = f[b] * cosine / out->pdf;
}

void bsdf_emission(const struct model *m, size_t material, const double n[3],
                   const double w[3], double *l)
{
	const struct materials *mt = &m->material;
	double cosine = v3_dot(n, w);
	int side = cosine > 0 ? FRONT : BACK, dark = cosine == 0 || black_side(mt, material, side);
	double exponent = mt->emission_exponent[2 * material + (size_t)side];
	double scale = dark ? 0 : exponent == 1 ? 1 : pow(fabs(cosine), exponent - 1);
	const double *emission = &mt->emission[model_material_at(mt, material, side)];

	for (int b = 0; b < mt->bands; b++)
		l[b] = scale * emission[b];
}

double bsdf_exitance(const struct materials *mt, size_t material, int side, int band)
{
	double exponent = mt->emission_exponent[2 * material + (size_t)side];

	if (black_side(mt, material, side))
		return 0;
	return 2 * PI * mt->emission[model_material_at(mt, material, side) + (size_t)band] /
	       (exponent + 1);
}

double bsdf_albedo(const struct materials *mt, size_t material, int side, int band)
{
	size_t at = model_material_at(mt, material, side) + (size_t)band;

	if (black_side(mt, material, side))
		return 0;
	return mt->rho_d[at] + mt->tau_d[at] + mt->rho_s[at] + mt->tau_s[at];
}

static int has_finite(const struct materials *mt, size_t material, int side,
                      int transmitted, int finite)
{
	size_t at = 2 * material + (size_t)side;
	double k = (transmitted ? mt->beta : mt->alpha)[at];
	const double *c = transmitted ? mt->tau_s : mt->rho_s;

	return !black_side(mt, material, side) && finite == (k < (double)INFINITY) &&
	       band_mean(&c[model_material_at(mt, material, side)], mt->bands) > 0;
}

int bsdf_has_lobe(const struct materials *mt, size_t material, int side, int transmitted)
{
	return has_finite(mt, material, side, transmitted, 1);
}

int bsdf_has_ideal(const struct materials *mt, size_t material, int side, int transmitted)
{
	return has_finite(mt, material, side, transmitted, 0);
}

int bsdf_any_pane(const struct materials *mt)
{
	for (size_t i = 0; i < 2 * mt->n; i++)
		if (bsdf_has_ideal(mt, i / 2, (int)(i % 2), 1))
			return 1;
	return 0;
}

int bsdf_emits(const struct materials *mt, size_t material, int side)
{
	return !black_side(mt, material, side) &&
	       band_mean(&mt->emission[model_material_at(mt, material, side)], mt->bands) > 0;
}
