#include "lib/mesh/division.h"

#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/mesh/stages.h"

/* Which regions the elements belong to. */
static int assign_regions(struct division *d, size_t *regions, struct err *e)
{
	uint32_t *region = mem_new(d->m->triangle.n, sizeof *region, "regions", e);
	int status = region ? mesh_find_regions(d->m, d->size, d->cos_cone, region, &d->region,
	                                        regions, e)
	                    : -1;

	d->element_region = mem_new(d->m->element.n, sizeof *d->element_region, "regions", e);
	for (size_t i = 0; !status && d->element_region && i < d->m->element.n; i++)
		d->element_region[i] = region[d->m->element.triangle[i]];
	free(region);
	return d->element_region ? status : -1;
}

static void measure_elements(struct division *d)
{
	const struct model *m = d->m;
	double lo[3], hi[3];

	model_box(m, lo, hi);
	v3_mad(lo, 1, hi, d->centre);
	for (int k = 0; k < 3; k++)
		d->centre[k] *= .5;
	for (size_t i = 0; i < m->element.n; i++) {
		const uint32_t *c = &m->element.corner[3 * i];
		for (size_t k = 0; k < 3; k++) {
			double x[3];
			v3_sub(&m->vertex[3 * (size_t)c[k]], d->centre, x);
			v3_mad(&d->centroid[3 * i], 1. / 3, x, &d->centroid[3 * i]);
		}
		v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
		        &m->vertex[3 * (size_t)c[2]], &d->area[3 * i]);
	}
}

int mesh_division_init(struct division *d, const struct model *m, double size, double cos_cone,
                  size_t *regions, struct err *e)
{
	*d = (struct division){ .m = m, .size = size, .cos_cone = cos_cone };
	if (assign_regions(d, regions, e) ||
	    geo_half_edges_build(&d->g, m->element.corner, m->element.n, m->vertices, e))
		return -1;
	d->centroid = mem_new(m->element.n, 3 * sizeof *d->centroid, "patches", e);
	d->area = mem_new(m->element.n, 3 * sizeof *d->area, "patches", e);
	if (!d->centroid || !d->area)
		return -1;
	measure_elements(d);
	return 0;
}

void mesh_division_free(struct division *d)
{
	geo_half_edges_free(&d->g);
	free(d->region);
	free(d->element_region);
	free(d->centroid);
	free(d->area);
}

void mesh_division_extent(const struct division *d, uint32_t element, const double axis[3],
                          double *lo, double *hi)
{
	const uint32_t *c = &d->m->element.corner[3 * (size_t)element];

	*lo = INFINITY, *hi = -INFINITY;
	for (int k = 0; k < 3; k++) {
		double x[3];
		v3_sub(&d->m->vertex[3 * (size_t)c[k]], d->centre, x);
		*lo = fmin(*lo, v3_dot(x, axis));
		*hi = fmax(*hi, v3_dot(x, axis));
	}
}
