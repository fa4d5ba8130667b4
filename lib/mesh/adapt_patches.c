/* What patches cost by shooting evenly. From afar only their total counts; what is about as
 * close as the patch is wide sees how it is distributed. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/data/solution.h"
#include "lib/geometry/box_tree.h"
#include "lib/mesh/stages.h"

/* Of the squared deviations in a patch, what arrives at a surface that meets it at a right
 * angle, as large as itself: the irradiance there is off by half of them at the common edge,
 * and by hardly anything a patch away. A ratio of energies; a guess. */
static const double arriving = .1;

/* How close a patch is that sees how light is distributed: a fraction of the root of the area. A
 * guess; man/mesh.1 states it. */
static const double reach = .25;

/* Cosine of two patches' normals from which they count as parts of one plane or bent surface: 26
 * degrees, wider than the default normal cone. A guess. */
static const double one_surface = .9;

/* Sine of the height of a patch's centre above the plane of another, from which it is in front:
 * 6 degrees. A guess. */
static const double in_front = .1;

struct search {
	const struct model *m;
	struct boxes boxes;
	double *corner;       /* [2 patches][3] of boxes */
	uint32_t *triangle;   /* [patches][3] that have these boxes */
	const struct patch_frame *frame;
	struct array found;
	struct err *e;
};

struct patch_frame *mesh_patch_frames(const struct model *m, struct err *e)
{
	struct patch_frame *frame = mem_new(m->patch.n, sizeof *frame, "patches", e);

	for (uint32_t i = 0; frame && i < m->element.n; i++) {
		uint32_t p = m->element.patch[i];
		double part = m->element.area[i] / (3 * m->patch.area[p]);
		for (size_t k = 0; k < 3; k++)
			v3_mad(frame[p].centre, part,
			       &m->vertex[3 * (size_t)m->element.corner[3 * i + k]],
			       frame[p].centre);
		v3_mad(frame[p].normal, m->element.area[i], &m->element.normal[3 * (size_t)i],
		       frame[p].normal);
	}
	for (uint32_t p = 0; frame && p < m->patch.n; p++)
		v3_normalise(frame[p].normal);
	return frame;
}

static int prepare(struct search *s)
{
	const struct model *m = s->m;

	s->corner = mem_new(m->patch.n, 6 * sizeof *s->corner, "patches", s->e);
	s->triangle = mem_new(m->patch.n, 3 * sizeof *s->triangle, "patches", s->e);
	if (!s->corner || !s->triangle)
		return -1;
	for (uint32_t p = 0; p < m->patch.n; p++) {
		double *lo = &s->corner[6 * (size_t)p], *hi = lo + 3;
		for (size_t k = 0; k < 3; k++) {
			lo[k] = INFINITY, hi[k] = -INFINITY;
			s->triangle[3 * (size_t)p + k] = 2 * p + (k > 0);
		}
		for (size_t i = 3 * (size_t)m->patch.start[p];
		     i < 3 * (size_t)m->patch.start[p + 1]; i++)
			for (size_t k = 0; k < 3; k++) {
				double x = m->vertex[3 * (size_t)m->element.corner[i] + k];
				lo[k] = fmin(lo[k], x);
				hi[k] = fmax(hi[k], x);
			}
	}
	return geo_boxes_build(&s->boxes, s->corner, s->triangle, m->patch.n, s->e);
}

/* Is any patch that is not in the plane of p, nor behind it, close to the side? -1: e. */
static int is_close(struct search *s, uint32_t p, int side)
{
	double sign = side == FRONT ? 1 : -1, d[3];

	s->found.n = 0;
	if (geo_boxes_find(&s->boxes, &s->boxes.box[p], reach * sqrt(s->m->patch.area[p]),
	                   &s->found, s->e))
		return -1;
	const uint32_t *q = s->found.data;
	for (size_t i = 0; i < s->found.n; i++) {
		const struct patch_frame *here = &s->frame[p], *there = &s->frame[q[i]];
		v3_sub(there->centre, here->centre, d);
		if (fabs(v3_dot(here->normal, there->normal)) < one_surface &&
		    sign * v3_dot(here->normal, d) > in_front * v3_length(d))
			return 1;
	}
	return 0;
}

double mesh_patch_deviations(const struct model *m, const struct solution *s, uint32_t p, int side)
{
	const struct materials *mt = &m->material;
	size_t here = model_material_at(mt, model_patch_material(m, p), side);
	size_t bands = (size_t)m->bands;
	double all = 0;

	for (size_t k = 0; k < bands; k++) {
		double sum = 0, square = 0, noise = 0;
		for (size_t i = m->patch.start[p]; i < m->patch.start[p + 1]; i++) {
			size_t es = 2 * i + (size_t)side;
			double a = m->element.area[i], x = solution_exitance(m, s, es, (int)k);
			double error = mt->rho_d[here + k] * s->error.sampling[es * bands + k];
			sum += a * x;
			square += a * x * x;
			noise += a * error * error;
		}
		all += fmax(0, square - sum * sum / m->patch.area[p] - noise);
	}
	return all;
}

int mesh_patch_energies(const struct model *m, const struct solution *s,
                        const struct patch_frame *frame, double *energy, struct err *e)
{
	struct search search = { .m = m, .frame = frame, .e = e };
	int status = prepare(&search);

	for (uint32_t ps = 0; !status && ps < 2 * m->patch.n; ps++) {
		uint32_t p = ps >> 1;
		int side = (int)(ps & 1);
		int close = model_side_modelled(m, ps) ? is_close(&search, p, side) : 0;
		status = close < 0 ? -1 : 0;
		if (close > 0)
			energy[p] += arriving * mesh_patch_deviations(m, s, p, side);
	}
	free(search.corner);
	free(search.triangle);
	free(search.found.data);
	geo_boxes_free(&search.boxes);
	return status;
}
