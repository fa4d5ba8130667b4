#include "lib/scatter/lobe_table.h"

#include <math.h>

#include "lib/base/vec.h"
#include "lib/scatter/lobe.h"

/* An exponent: lobes of smaller ones have a normaliser that is not smooth at cosine 1, where it
 * differs from N_k(0) as sin^(k+1): it is as (1 - cosine)^(1/4) in steps of that. A guess, which
 * unit test lobe checks with LOBE_TABLE. */
static const double sharp_from = 5;

/* The sine, times sqrt(k + 1), of the angle where cos^k has fallen to e^-18 = 2e-8: what the
 * horizon cuts off beyond it does not count. */
static const double reach = 6;

void bsdf_lobe_table_make(struct lobe_table *t, double k)
{
	t->k = k;
	t->whole = bsdf_lobe_normaliser(k, 1);
	/* The horizon cuts off cos^k of more than the angle whose sine is `end`. */
	t->end = k < sharp_from ? 1 : fmin(1, reach / sqrt(k + 1));
	t->per_step = LOBE_TABLE / t->end;
	for (int i = 0; i <= LOBE_TABLE + 2; i++) {
		double c = (i - 1) / t->per_step;
		if (k < sharp_from)
			c = 1 - c * c * c * c;
		/* What a lobe below the horizon loses, one above it has. */
		t->value[i] = c < 0 ? t->whole - bsdf_lobe_normaliser(k, -c)
		                    : bsdf_lobe_normaliser(k, fmin(1, c));
	}
}

double bsdf_lobe_table_normaliser(const struct lobe_table *t, double cos_theta)
{
	if (cos_theta >= t->end)
		return t->whole;
	double at = t->k < sharp_from ? sqrt(sqrt(1 - cos_theta)) : cos_theta;
	at *= t->per_step;
	double i = fmin(floor(at), LOBE_TABLE - 1), u = at - i;
	const double *p = &t->value[(int)i];
	/* The cubic through four values (Lagrange). */
	return (-p[0] * u * (u - 1) * (u - 2) + 3 * p[1] * (u + 1) * (u - 1) * (u - 2) -
	        3 * p[2] * (u + 1) * u * (u - 2) + p[3] * (u + 1) * u * (u - 1)) / 6;
}

double bsdf_lobe_table_weight(const struct lobe_table *t, enum lobe_kind kind, double cos_o,
                              double cos_i)
{
	return kind == LOBE_RECIPROCAL
	     ? cos_i / fmax(cos_i, cos_o)
	     : cos_i / cos_o * bsdf_lobe_table_normaliser(t, cos_o) /
	       bsdf_lobe_table_normaliser(t, cos_i);
}

double bsdf_lobe_table_sample(const struct lobe_table *t, enum lobe_kind kind, const double axis[3],
                              const double n[3], double cos_o, const double u[2], double out[3])
{
	if (kind == LOBE_RECIPROCAL)
		bsdf_lobe_sample_whole(t->k, axis, u, out);
	else
		bsdf_lobe_sample(t->k, axis, n, u, out);
	double cos_i = v3_dot(n, out);
	return cos_i > 0 ? bsdf_lobe_table_weight(t, kind, cos_o, cos_i) : 0;
}
