#include "lib/audit/side_table.h"

#include "lib/scatter/bsdf.h"

void solution_side_row(const struct model *m, const struct solution *s, size_t element_side,
                       struct side_row *out)
{
	const size_t i = element_side >> 1;
	const uint32_t *corner = &m->element.corner[3 * i];

	*out = (struct side_row){ .element = (uint32_t)i, .patch = m->element.patch[i],
	                          .side = (int)(element_side & 1), .area = m->element.area[i] };
	out->surface = m->patch.surface[out->patch];
	out->material = m->surface.material[out->surface];
	for (int k = 0; k < 3; k++) {
		for (int c = 0; c < 3; c++)
			out->centre[k] += m->vertex[3 * (size_t)corner[c] + (size_t)k] / 3;
		out->normal[k] = m->element.normal[3 * i + (size_t)k];
		if (out->side == BACK)
			out->normal[k] = 0 - out->normal[k]; /* never -0 */
	}
	for (int b = 0; b < m->bands; b++) {
		out->e[b] = bsdf_exitance(&m->material, out->material, out->side, b);
		if (s) {
			out->h[b] = solution_irradiance(s, element_side, b);
			out->m[b] = solution_exitance(m, s, element_side, b);
		}
	}
}
