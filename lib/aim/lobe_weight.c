#include "lib/aim/lobe_weight.h"

#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/vec.h"
#include "lib/scatter/lobe.h"

double aim_lobe_per_density(const struct aim_lobe *l, enum lobe_kind kind, double cos_i)
{
	return bsdf_lobe_table_weight(l->table, kind, l->cosine, cos_i);
}

double aim_lobe_density(const struct aim_lobe *l, enum lobe_kind kind, const double dir[3])
{
	double power = bsdf_lobe_power(l->k, v3_dot(l->axis, dir));

	return kind == LOBE_RECIPROCAL ? (l->k + 1) / (2 * PI) * power
	                               : power / bsdf_lobe_table_normaliser(l->table, l->cosine);
}

double aim_lobe_weight_at(const double dir[3], const void *arg)
{
	const struct aim_lobe_weight *w = arg;
	double cos_i = v3_dot(w->l->normal, dir);
	double power = bsdf_lobe_power(w->l->k, v3_dot(w->l->axis, dir));

	if (!(cos_i > 0) || power == 0)
		return 0;
	return w->kind == LOBE_RECIPROCAL
	     ? (w->l->k + 1) / (2 * PI) * power * cos_i / fmax(cos_i, w->l->cosine)
	     : power * cos_i / (w->l->cosine * bsdf_lobe_table_normaliser(w->l->table, cos_i));
}

struct direct_weight aim_lobe_weight(const struct aim_lobe_weight *w)
{
	/* cos^k falls to exp(-1/2) over its width, and at its reach to what no picture shows,
	 * exp(-18.4) = 1e-8. k = 0 reaches everywhere. */
	static const double logarithm_at_reach = -18.4, k_least = 1e-9;
	double cos_reach = exp(logarithm_at_reach / fmax(w->l->k, k_least));
	struct direct_weight d = { .at = aim_lobe_weight_at, .arg = w,
	                           .width = 1 / sqrt(w->l->k + 1), .reach = acos(cos_reach) };

	memcpy(d.axis, w->l->axis, sizeof d.axis);
	return d;
}
