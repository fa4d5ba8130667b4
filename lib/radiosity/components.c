#include "lib/radiosity/components.h"

#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/data/punctual.h"
#include "lib/scatter/bsdf.h"

/* Albedos from this on count as 1: no light is absorbed. What is further off is more than sums
 * of single-precision form factors may hide, and takes 1e9 reflections; a guess. */
static const double white = 1 - 1e-9;

/* ---- connected components: union-find with path halving ---- */

static uint32_t root(uint32_t *of, uint32_t i)
{
	while (of[i] != i)
		i = of[i] = of[of[i]];
	return i;
}

static void join(uint32_t *of, uint32_t a, uint32_t b)
{
	a = root(of, a);
	b = root(of, b);
	if (a < b)
		of[b] = a;
	else
		of[a] = b;
}

static int passes(const struct model *m, uint32_t patch)
{
	const struct materials *mt = &m->material;
	size_t at = model_material_at(mt, model_patch_material(m, patch), 0);

	for (int k = 0; k < 2 * mt->bands; k++)
		if (mt->tau_d[at + (size_t)k] > 0 || mt->tau_s[at + (size_t)k] > 0)
			return 1;
	return 0;
}

int radiosity_components_init(struct components *c, const struct transport *t, struct err *e)
{
	uint32_t sides = model_sources(t->m);

	*c = (struct components){ 0 };
	if (!(c->of = mem_new(sides, sizeof *c->of, "components", e)))
		return -1;
	for (uint32_t i = 0; i < sides; i++)
		c->of[i] = i;
	for (uint32_t p = 0; p < t->m->patch.n; p++)
		if (passes(t->m, p))
			join(c->of, 2 * p, 2 * p + 1);
	for (size_t r = 0; r < t->rows; r++)
		for (uint64_t i = t->block[t->row_block[r]].run;
		     i < t->block[t->row_block[r + 1]].run; i++)
			join(c->of, t->row_side[r], t->run_target[i]);
	for (uint32_t i = 0; i < sides; i++)
		c->of[i] = root(c->of, i);
	/* A root is the lowest member, so its number stands before a member asks. */
	for (uint32_t i = 0; i < sides; i++)
		c->of[i] = c->of[i] == i ? c->n++ : c->of[c->of[i]];
	return 0;
}

void radiosity_components_free(struct components *c)
{
	free(c->of);
	*c = (struct components){ 0 };
}

/* ---- can all light end? ---- */

struct ends {
	const struct transport *t;
	int band;
	uint8_t *reached;    /* [rows] light of this band can be sent by the row */
	uint8_t *leaks;      /* [rows] some of what it sends can end */
	int changed;
};

typedef int row_test(struct ends *x, uint32_t row);

/* Whether `test` holds for any row that light arriving on patch-side ps leaves by. */
static int any_row_of(struct ends *x, uint32_t ps, row_test *test)
{
	const struct transport *t = x->t;
	const struct materials *mt = &t->m->material;
	size_t at = model_material_at(mt, model_patch_material(t->m, ps >> 1), (int)(ps & 1)) +
	            (size_t)x->band;
	int found = 0;

	if (mt->rho_d[at] > 0 && t->diffuse_row[ps] != FF_NO_ROW)
		found |= test(x, t->diffuse_row[ps]);
	if (mt->tau_d[at] > 0 && t->diffuse_row[ps ^ 1] != FF_NO_ROW)
		found |= test(x, t->diffuse_row[ps ^ 1]);
	for (uint64_t l = 2 * t->target_link[ps]; l < 2 * t->target_link[ps + 1]; l++)
		if (t->link_row[l] != FF_NO_ROW && (l & 1 ? mt->tau_s : mt->rho_s)[at] > 0)
			found |= test(x, t->link_row[l]);
	return found;
}

static int reach(struct ends *x, uint32_t row)
{
	x->changed |= !x->reached[row];
	x->reached[row] = 1;
	return 0;
}

static int is_leaky(struct ends *x, uint32_t row)
{
	return x->leaks[row];
}

static double albedo(const struct transport *t, uint32_t ps, int band)
{
	return bsdf_albedo(&t->m->material, model_patch_material(t->m, ps >> 1), (int)(ps & 1),
	                   band);
}

static int row_leaks(struct ends *x, uint32_t row)
{
	const struct transport *t = x->t;

	for (uint64_t b = t->row_block[row]; b < t->row_block[row + 1]; b++) {
		if (t->block[b].escape > 0 || t->block[b].black > 0 || t->block[b].lost > 0)
			return 1;
		for (uint64_t i = t->block[b].run; i < t->block[b + 1].run; i++)
			if (albedo(t, t->run_target[i], x->band) < white ||
			    any_row_of(x, t->run_target[i], is_leaky))
				return 1;
	}
	return 0;
}

static void spread(struct ends *x, uint32_t row)
{
	const struct transport *t = x->t;

	for (uint64_t i = t->block[t->row_block[row]].run;
	     i < t->block[t->row_block[row + 1]].run; i++)
		any_row_of(x, t->run_target[i], reach);
}

static void start_at_emitters(struct ends *x)
{
	const struct transport *t = x->t;

	for (uint32_t ps = 0; ps < 2 * t->m->patch.n; ps++) {
		uint32_t row = t->emission_row[ps] != FF_NO_ROW ? t->emission_row[ps]
		                                                : t->diffuse_row[ps];
		if (row != FF_NO_ROW &&
		    bsdf_exitance(&t->m->material, model_patch_material(t->m, ps >> 1),
		                  (int)(ps & 1), x->band) > 0)
			x->reached[row] = 1;
	}
	for (size_t i = 0; i < t->m->light.n; i++)
		if (t->light_row[i] != FF_NO_ROW && model_light_flux(t->m, i, x->band) > 0)
			x->reached[t->light_row[i]] = 1;
}

static const char *source_name(const struct model *m, uint32_t source)
{
	return source < 2 * m->patch.n ? m->surface.name[m->patch.surface[source >> 1]]
	                               : m->light.name[source - 2 * m->patch.n];
}

static int band_ends(struct ends *x, struct err *e)
{
	const struct transport *t = x->t;

	start_at_emitters(x);
	do {
		x->changed = 0;
		for (uint32_t r = 0; r < t->rows; r++)
			if (x->reached[r])
				spread(x, r);
	} while (x->changed);
	do {
		x->changed = 0;
		for (uint32_t r = 0; r < t->rows; r++)
			if (x->reached[r] && !x->leaks[r] && row_leaks(x, r))
				x->changed = x->leaks[r] = 1;
	} while (x->changed);
	for (uint32_t r = 0; r < t->rows; r++)
		if (x->reached[r] && !x->leaks[r])
			return err_set(e, "no steady state: light in band %d that reaches %s can "
			               "neither be absorbed nor leave; lower an albedo of that "
			               "closed part below 1 or open it", x->band,
			               source_name(t->m, t->row_side[r]));
	return 0;
}

int radiosity_components_need_sink(const struct transport *t, struct err *e)
{
	int bad = 0;

	for (int band = 0; !bad && band < t->m->bands; band++) {
		struct ends x = { .t = t, .band = band };
		int any_white = 0;
		for (uint32_t ps = 0; ps < 2 * t->m->patch.n; ps++)
			any_white |= albedo(t, ps, band) >= white;
		if (!any_white)
			continue;
		x.reached = mem_new(t->rows, 1, "sinks", e);
		x.leaks = mem_new(t->rows, 1, "sinks", e);
		bad = !x.reached || !x.leaks || band_ends(&x, e);
		free(x.reached);
		free(x.leaks);
	}
	return bad ? -1 : 0;
}
