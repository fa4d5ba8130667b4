#include "lib/mesh/imprint.h"

#include <math.h>
#include <stdlib.h>

#include "lib/mesh/stages.h"

/* Thick: 1e-6 of the scene is far above the rounding of float32 positions and far below
 * an element. Fractions of the element size: what is much smaller than an element does
 * not pay for elements of its own, and a gap much narrower shows in none. That is why they are
 * fractions; which ones is a guess (man/mesh.1 states close and shortest). 0x1p-48: sixteen times
 * the rounding of the largest coordinate; 1e-8 is rounding, as in bisect.c. */
static struct imprint_limits limits_of(const struct model *m, double size)
{
	double lo[3], hi[3], largest = 0, diagonal = 0;

	model_box(m, lo, hi);
	for (int k = 0; k < 3; k++) {
		diagonal = hypot(diagonal, hi[k] - lo[k]);
		largest = fmax(largest, fmax(fabs(lo[k]), fabs(hi[k])));
	}
	double thick = fmax(1e-6 * diagonal, 0x1p-48 * largest);
	return (struct imprint_limits){ .size = size * (1 + 1e-8), .thick = thick,
		                        .close = fmax(size / 8, thick),
		                        .apart = fmax(1e-3 * size, 2 * thick),
		                        .shortest = size / 2, .fine = size / 16 };
}

int mesh_imprint(struct model *m, double size, struct mesh_report *r, struct err *e)
{
	struct imprint_limits limits = limits_of(m, size);
	struct half_edges g = { 0 };
	struct contacts contacts = { 0 };
	struct pieces pieces = { 0 };
	int status = -1;

	if (!isfinite(size))
		return 0;
	if (geo_half_edges_build(&g, m->triangle.corner, m->triangle.n, m->vertices, e) ||
	    mesh_find_contacts(m, &g, &limits, &contacts, e))
		goto done;
	status = 0;
	if (contacts.list.n)
		status = mesh_constrain_edges(m, &g, &contacts, &limits, &pieces, e) ||
		         mesh_imprint_replace(m, &pieces, &r->lines, e) ? -1 : 0;
	r->cut = pieces.cut;
	r->fine_contacts = contacts.fine;
	if (!status)
		status = mesh_drop_covered(m, &limits, r, e);
done:
	geo_half_edges_free(&g);
	free(contacts.list.data);
	free(pieces.vertex.data);
	free(pieces.piece.data);
	return status;
}
