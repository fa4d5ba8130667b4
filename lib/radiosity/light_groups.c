#include "lib/radiosity/light_groups.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/channels.h"
#include "lib/base/mem.h"
#include "lib/data/punctual.h"
#include "lib/data/solution.h"
#include "lib/scatter/bsdf.h"

/* ---- who is in which ---- */

static int emits(const struct model *m, uint32_t material)
{
	return bsdf_emits(&m->material, material, FRONT) ||
	       bsdf_emits(&m->material, material, BACK);
}

static int shines(const struct model *m, uint32_t light)
{
	for (int k = 0; k < m->bands; k++)
		if (model_light_flux(m, light, k) > 0)
			return 1;
	return 0;
}

static int has_group(const struct solution *s, size_t groups, const char *name)
{
	for (size_t g = 0; g < groups; g++)
		if (strcmp(s->group_name[g], name) == 0)
			return 1;
	return 0;
}

static char *unique_name(const struct solution *s, size_t groups, const char *name,
                         struct err *e)
{
	size_t size = strlen(name) + 24;
	char *text = mem_new(size, 1, "light groups", e);

	for (int i = 1; text && (i == 1 || has_group(s, groups, text)); i++)
		snprintf(text, size, i == 1 ? "%s" : "%s#%d", name, i);
	return text;
}

static int is_used(const struct model *m, uint32_t material)
{
	for (size_t p = 0; p < m->patch.n; p++)
		if (model_patch_material(m, (uint32_t)p) == material)
			return 1;
	return 0;
}

int radiosity_groups_set(struct solution *s, const struct model *m, int apart, struct err *e)
{
	const size_t most = CHANNELS_MAX / (size_t)m->bands;
	size_t groups = 0;

	s->emitters = m->material.n + m->light.n;
	s->emitter_group = mem_new(s->emitters, sizeof *s->emitter_group, "light groups", e);
	s->group_name = mem_new(s->emitters + 1, sizeof *s->group_name, "light groups", e);
	s->groups = 1;
	if (!s->emitter_group || !s->group_name)
		return -1;
	for (uint32_t i = 0; apart && i < s->emitters; i++) {
		const uint32_t materials = (uint32_t)m->material.n;
		const char *name = i < materials ? m->material.name[i]
		                                 : m->light.name[i - materials];
		if (i < materials ? !emits(m, i) || !is_used(m, i) : !shines(m, i - materials))
			continue;
		if (groups == most)
			return err_set(e, "more than %zu light groups; solve without them", most);
		s->group_name[groups] = unique_name(s, groups, name, e);
		if (!s->group_name[groups])
			return -1;
		s->emitter_group[i] = (uint32_t)groups++;
		s->groups = groups;
	}
	if (groups == 0)
		s->group_name[0] = unique_name(s, 0, LIGHT_GROUP_ALL, e);
	return s->group_name[0] ? 0 : -1;
}

/* ---- mixing ---- */

/* The group whose name the text begins with, the longest, before a '='; groups if none. */
static size_t find_group(const struct solution *s, const char *text)
{
	size_t found = s->groups, longest = 0;

	for (size_t g = 0; g < s->groups; g++) {
		size_t n = strlen(s->group_name[g]);
		if (strncmp(text, s->group_name[g], n) == 0 && text[n] == '=' && n >= longest) {
			found = g;
			longest = n;
		}
	}
	return found;
}

static int unknown(const struct solution *s, const char *text, struct err *e)
{
	char names[256] = "";
	size_t n = 0, length = strcspn(text, "=,");

	if (text[length] != '=')
		return err_set(e, "'%.*s' is not NAME=X", (int)length, text);
	for (size_t g = 0; g < s->groups && n < sizeof names; g++)
		n += (size_t)snprintf(names + n, sizeof names - n, "%s%s", g ? ", " : "",
		                      s->group_name[g]);
	if (n >= sizeof names)
		strcpy(names + sizeof names - 4, "...");
	if (s->groups == 1 && strcmp(s->group_name[0], LIGHT_GROUP_ALL) == 0)
		return err_set(e, "no light group '%.*s'; solve with shoot --light-groups (there "
		               "is only %s)", (int)length, text, names);
	return err_set(e, "no light group '%.*s'; there are: %s", (int)length, text, names);
}

/* One factor or one for each band. Returns what follows them, or NULL and e. */
static const char *factors(const struct solution *s, const char *text, double *f, struct err *e)
{
	int n = 0;

	for (;; text++) {
		char *end;
		double x = strtod(text, &end);
		if (end == text || !isfinite(x) || x < 0 || n == s->bands)
			break;
		f[n++] = x;
		text = end;
		if (*text != ':')
			break;
	}
	if ((n != 1 && n != s->bands) || (*text && *text != ','))
		return err_set(e, "a light group's factor is a number of at least 0, or %d of them "
		               "with colons between", s->bands), NULL;
	for (int k = n; k < s->bands; k++)
		f[k] = f[0];
	return text;
}

static void scale_irradiance(struct solution *s, const double *factor)
{
	double *h[] = { s->irradiance.direct, s->irradiance.caustic, s->irradiance.indirect };
	size_t bands = (size_t)s->bands, n = s->element_sides * bands;

	for (size_t i = 0; i < n; i++) {
		double before = solution_irradiance(s, i / bands, (int)(i % bands)), most = 0;
		for (size_t g = 0; g < s->groups; g++) {
			double f = factor[g * bands + i % bands];
			most = fmax(most, f);
			for (int p = 0; p < 3; p++)
				h[p][g * n + i] *= f;
		}
		double after = solution_irradiance(s, i / bands, (int)(i % bands));
		double change = before > 0 ? after / before : most;
		s->error.sampling[i] *= change;
		s->error.sampling_direct[i] *= change;
		s->error.discretisation[i] *= change;
		s->error.discretisation_direct[i] *= change;
	}
}

static void scale_emission(const struct solution *s, struct model *m, const double *factor)
{
	size_t bands = (size_t)s->bands;

	for (size_t i = 0; i < m->light.n; i++)
		for (size_t k = 0; k < bands; k++)
			m->light.intensity[i * bands + k] *=
				factor[s->emitter_group[m->material.n + i] * bands + k];
	for (size_t i = 0; i < m->material.n; i++)
		for (size_t k = 0; k < 2 * bands; k++)
			m->material.emission[model_material_at(&m->material, i, FRONT) + k] *=
				factor[s->emitter_group[i] * bands + k % bands];
}

int radiosity_groups_mix(struct solution *s, struct model *m, const char *mix, struct err *e)
{
	double *factor = mem_new(solution_channels(s), sizeof *factor, "light groups", e);

	if (!factor)
		return -1;
	for (size_t i = 0; i < solution_channels(s); i++)
		factor[i] = 1;
	for (const char *at = mix; at; at = *at ? at + 1 : NULL) {
		size_t g = find_group(s, at);
		if (g == s->groups) {
			unknown(s, at, e);
			break;
		}
		at = factors(s, at + strlen(s->group_name[g]) + 1, factor + g * (size_t)s->bands,
		             e);
		if (!at)
			break;
	}
	if (!e->set) {
		scale_irradiance(s, factor);
		scale_emission(s, m, factor);
	}
	free(factor);
	return e->set ? -1 : 0;
}
