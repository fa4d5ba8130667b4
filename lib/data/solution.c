#include "lib/data/solution.h"

#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/base/channels.h"

double solution_scattered(const struct model *m, size_t element_side, int band, double here_h,
                          double there_h)
{
	const struct materials *mt = &m->material;
	uint32_t material = model_patch_material(m, m->element.patch[element_side >> 1]);
	int side = (int)(element_side & 1);
	size_t here = model_material_at(mt, material, side) + (size_t)band;
	size_t there = model_material_at(mt, material, !side) + (size_t)band;

	/* A black back gives nothing back and lets nothing through. */
	if (mt->one_sided[material])
		return side == BACK ? 0 : mt->rho_d[here] * here_h;
	return mt->rho_d[here] * here_h + mt->tau_d[there] * there_h;
}

double solution_exitance(const struct model *m, const struct solution *s,
                         size_t element_side, int band)
{
	return solution_scattered(m, element_side, band, solution_irradiance(s, element_side, band),
	                          solution_irradiance(s, element_side ^ 1, band));
}

static int check_sizes(const struct model *m, const struct solution *s, struct err *e)
{
	if (s->bands != m->bands || s->element_sides != 2 * m->element.n ||
	    s->patch_sides != 2 * m->patch.n || s->sources != model_sources(m) ||
	    s->groups < 1)
		return err_set(e, "array irradiance_direct: it is not that of the model's "
		               "elements");
	if (s->groups > CHANNELS_MAX / (size_t)s->bands)
		return err_set(e, "array irradiance_direct: more than %zu light groups",
		               CHANNELS_MAX / (size_t)s->bands);
	for (size_t i = 0; i < s->emitters; i++)
		if (s->emitter_group[i] >= s->groups)
			return err_set(e, "array emitter_group: value %zu is %u", i,
			               s->emitter_group[i]);
	return 0;
}

/* An array of finite numbers, with signs or without. */
struct numbers {
	const char *name;
	const double *v;
	size_t n;
	int signs;
};

static int check_numbers(const struct numbers *x, struct err *e)
{
	for (size_t i = 0; i < x->n; i++)
		if (!isfinite(x->v[i]) || (x->v[i] < 0 && !x->signs))
			return err_set(e, "array %s: value %zu is %g", x->name, i, x->v[i]);
	return 0;
}

int solution_check(const struct model *m, const struct solution *s, struct err *e)
{
	if (check_sizes(m, s, e))
		return -1;
	size_t bands = (size_t)s->bands, sides = s->element_sides * bands;
	size_t channels = solution_channels(s);
	const struct numbers array[] = {
		{ "irradiance_direct", s->irradiance.direct, s->groups * sides, 0 },
		{ "irradiance_caustic", s->irradiance.caustic, s->groups * sides, 0 },
		{ "irradiance_indirect", s->irradiance.indirect, s->groups * sides, 1 },
		{ "irradiance_error", s->error.sampling, sides, 0 },
		{ "irradiance_error_direct", s->error.sampling_direct, sides, 0 },
		{ "irradiance_discretisation_direct", s->error.discretisation_direct, sides, 0 },
		{ "irradiance_discretisation", s->error.discretisation, sides, 0 },
		{ "irradiance_error_uneven", s->error.uneven, sides, 0 },
		{ "unshot_emission", s->unshot.emission, s->sources * bands, 1 },
		{ "unshot_diffuse", s->unshot.diffuse, s->patch_sides * channels, 1 },
		{ "unshot_link", s->unshot.link, 2 * s->links * channels, 1 },
		{ "shot", s->shot, 2 * s->rows * channels, 1 },
		{ "round", s->round, ROUND_TERMS, 0 },
		{ "ledger", s->ledger, LEDGER_TERMS * channels, 1 },
	};

	for (size_t i = 0; i < sizeof array / sizeof *array; i++)
		if (check_numbers(&array[i], e))
			return -1;
	return 0;
}

double solution_mean_error(const struct model *m, const struct solution *s)
{
	size_t bands = (size_t)s->bands;
	double error = 0, all = 0;

	for (size_t es = 0; es < s->element_sides; es++)
		for (size_t k = 0; k < bands; k++) {
			double area = m->element.area[es >> 1];
			error += area * s->error.sampling[es * bands + k];
			all += area * solution_irradiance(s, es, (int)k);
		}
	return all > 0 ? error / all : 0;
}

double solution_relative_rms(const struct model *m, const struct solution *s,
                             const double *x)
{
	size_t bands = (size_t)s->bands;
	double square = 0, all = 0, area = 0;

	for (size_t es = 0; es < s->element_sides; es++) {
		double a = m->element.area[es >> 1];
		if (!model_side_modelled(m, 2 * m->element.patch[es >> 1] + (uint32_t)(es & 1)))
			continue;
		for (size_t k = 0; k < bands; k++) {
			square += a * x[es * bands + k] * x[es * bands + k];
			all += a * solution_irradiance(s, es, (int)k);
			area += a;
		}
	}
	return all > 0 ? sqrt(square * area) / all : 0;
}

void solution_free(struct solution *s)
{
	for (size_t g = 0; s->group_name && g < s->groups; g++)
		free(s->group_name[g]);
	MEM_FREE(s->group_name, s->emitter_group, s->irradiance.direct, s->irradiance.caustic,
	         s->irradiance.indirect, s->error.sampling, s->error.sampling_direct,
	         s->error.discretisation, s->error.discretisation_direct, s->error.uneven,
	         s->uneven, s->unshot.emission,
	         s->unshot.diffuse, s->unshot.link, s->shot, s->ledger);
	*s = (struct solution){ 0 };
}
