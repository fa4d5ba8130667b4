#include "lib/ff_rays/row_formula.h"

int ff_formula_init(struct ff_formula *f, const struct model *m, int all, struct err *e)
{
	f->on = 1;
	f->all = all;
	occ_facet_centre(m, f->centre);
	return occ_facet_set_init(&f->sources, m, FACETS_OF_PATCHES, e) ||
	       occ_facet_set_init(&f->receivers, m, FACETS_OF_ELEMENTS, e) ||
	       occ_occluder_set_init(&f->occluders, m, e) ? -1 : 0;
}

void ff_formula_free(struct ff_formula *f)
{
	occ_facet_set_free(&f->sources);
	occ_facet_set_free(&f->receivers);
	occ_occluder_set_free(&f->occluders);
	*f = (struct ff_formula){ 0 };
}

int ff_formula_exchange(struct exchanger *x, const struct ff_formula *f, uint32_t source,
                        uint32_t column, double *area, double *error, struct err *e)
{
	double crowded = x->counts.crowded, off;

	*area = *error = 0;
	for (uint32_t i = f->sources.start[source]; i < f->sources.start[source + 1]; i++)
		for (uint32_t j = f->receivers.start[column]; j < f->receivers.start[column + 1]; j++) {
			*area += occ_exchange(x, &f->sources, i, &f->receivers, j, &off, e);
			*error += off;
		}
	return x->counts.crowded == crowded;
}
