/* Refinement where an earlier solution says that it pays. What an element adds to the
 * squared error of what surfaces show, integrated over them, is its energy; an element more
 * gains most where that is largest, so elements are halved until all have less than a
 * common bound, the largest that makes the expected error small enough. */
#include <math.h>
#include <stdlib.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/data/solution.h"
#include "lib/mesh/stages.h"

/* What is left of an element's energy when it has been halved once: 1/4 in a smooth field,
 * whose error is that of linear interpolation, and 1/sqrt(2) where a shadow's edge runs
 * through it, whose length stays. Edges decide. */
static const double left = .70710678118654752;   /* a ratio; derived, not measured */

/* What one step leaves of the energy, if more is asked for: the last of it would take elements
 * wherever there is any error at all. A ratio of energies; a guess. */
static const double once = .4;

/* Of the variance, what an estimate that has it subtracted may still be off by: that looks at
 * some ten second differences, which are larger than noise, and noise is far from even. A ratio
 * of variances: ten standard errors; a guess. */
static const double doubtful = 100;

enum {
	/* Elements that each part of a halved patch has, at least: one more than patches.c asks
	 * for (ELEMENTS_MIN), as cuts do not part them evenly. A guess. */
	ELEMENTS_A_PATCH = 5,
	/* Halvings in one step, at most: to a quarter of the edge, as far as an estimate made of
	 * whole elements can be trusted. A guess. */
	HALVINGS_MAX = 4,
	/* Steps of the search for the bound, whose range is 2^-40 of the largest energy to that:
	 * its logarithm is halved as often, to the last bit that matters. A guess. */
	BISECTIONS = 40
};

/* Rounding of a length, a ratio: edges that are meant to be as long as the least size are. */
static const double length_slack = 1e-9;

struct plan {
	const struct model *m;
	double *energy;       /* [elements] */
	double *patch_energy; /* [patches] what they cost others */
	double *lobe_energy;  /* [patches] of that, what they cost by lobes */
	uint8_t *most;        /* [elements] halvings that the least size leaves room for */
	uint8_t *halvings;    /* [elements] that a bound leads to, and of patches */
	uint8_t *patch_halvings;
	double allowed;       /* sum of energies that is asked for */
	size_t elements;      /* and no more than so many elements */
};

/* Square of the error of an element-side's irradiance, as far as it is certain: light straight
 * from emitters has hardly any noise. */
static double certain(const struct solution *s, size_t at)
{
	double direct = s->error.discretisation_direct[at] * s->error.discretisation_direct[at];
	double other = s->error.discretisation[at] * s->error.discretisation[at] - direct;
	double noise = s->error.sampling[at] * s->error.sampling[at] -
	               s->error.sampling_direct[at] * s->error.sampling_direct[at];

	return direct + fmax(0, other - doubtful * fmax(0, noise));
}

/* Adds up the error of what one side shows, in units of irradiance: coefficients times the
 * errors of both sides' irradiance, as if these were independent. */
static double side_energy(const struct model *m, const struct solution *s, size_t element,
                          int side)
{
	const struct materials *mt = &m->material;
	uint32_t material = model_patch_material(m, m->element.patch[element]);
	size_t bands = (size_t)m->bands, here = model_material_at(mt, material, side);
	size_t there = model_material_at(mt, material, !side), es = 2 * element + (size_t)side;
	double sum = 0;

	for (size_t k = 0; k < bands; k++) {
		double own = mt->rho_d[here + k];
		double across = mt->one_sided[material] ? 0 : mt->tau_d[there + k];
		sum += own * own * certain(s, es * bands + k);
		if (across > 0)
			sum += across * across * certain(s, (es ^ 1) * bands + k);
	}
	return m->element.area[element] * sum;
}

/* Energies, over the square of the mean exitance, and that an error of 1 would have. */
static double find_energies(struct plan *p, const struct solution *s)
{
	const struct model *m = p->m;
	double area = 0, sum = 0;

	for (size_t i = 0; i < m->element.n; i++)
		for (int side = 0; side < 2; side++) {
			if (!model_side_modelled(m, 2 * m->element.patch[i] + (uint32_t)side))
				continue;
			area += m->element.area[i];
			p->energy[i] += side_energy(m, s, i, side);
			for (int k = 0; k < m->bands; k++)
				sum += m->element.area[i] *
				       solution_exitance(m, s, 2 * i + (size_t)side, k);
		}
	double mean = area > 0 ? sum / area / m->bands : 0;
	for (size_t i = 0; i < m->element.n; i++)
		p->energy[i] = mean > 0 ? p->energy[i] / (mean * mean) : 0;
	for (size_t i = 0; i < m->patch.n; i++) {
		p->lobe_energy[i] = mean > 0 ? p->lobe_energy[i] / (mean * mean) : 0;
		p->patch_energy[i] = p->lobe_energy[i] +
		                     (mean > 0 ? p->patch_energy[i] / (mean * mean) : 0);
	}
	return area * m->bands;
}

static double longest(const struct model *m, size_t element)
{
	double longest = 0, d[3];

	for (size_t k = 0; k < 3; k++) {
		v3_sub(&m->vertex[3 * (size_t)m->element.corner[3 * element + (k + 1) % 3]],
		       &m->vertex[3 * (size_t)m->element.corner[3 * element + k]], d);
		longest = fmax(longest, v3_length(d));
	}
	return longest;
}

static void find_room(struct plan *p, double smallest)
{
	for (size_t i = 0; i < p->m->element.n; i++) {
		double edge = longest(p->m, i);
		while (p->most[i] < HALVINGS_MAX &&
		       edge >= smallest * sqrt(2) * (1 - length_slack)) {
			edge /= sqrt(2);
			p->most[i]++;
		}
	}
}

/* Halvings of what has this energy until each of its parts has no more than the bound. */
static uint8_t halvings(double energy, uint8_t most, double bound)
{
	uint8_t n = 0;

	for (; n < most && energy > bound; n++)
		energy *= left / 2;
	return n;
}

/* Halvings of the elements of a patch that leave enough of them in its parts. */
static uint8_t halvings_with(const struct plan *p, uint32_t patch)
{
	double elements = p->m->patch.start[patch + 1] - p->m->patch.start[patch];
	double wanted = p->patch_halvings[patch] + log2(ELEMENTS_A_PATCH / elements);

	if (!p->patch_halvings[patch] || !(wanted > .5)) /* rounds to none */
		return 0;
	return (uint8_t)fmin(HALVINGS_MAX, wanted + .5);
}

/* What a bound leads to: halvings, elements, and the sum of energies that is left. A patch
 * more costs less than an element more. */
static double expect(struct plan *p, double bound, size_t *elements)
{
	const struct model *m = p->m;
	double sum = 0, kept[HALVINGS_MAX + 1] = { 1 };

	for (int n = 0; n < HALVINGS_MAX; n++)
		kept[n + 1] = kept[n] * left;
	*elements = 0;
	for (uint32_t i = 0; i < m->patch.n; i++) {
		uint8_t n = halvings(p->patch_energy[i], HALVINGS_MAX, bound), with;
		p->patch_halvings[i] = n;
		with = halvings_with(p, i);
		sum += p->patch_energy[i] * kept[n];
		for (uint32_t k = m->patch.start[i]; k < m->patch.start[i + 1]; k++) {
			n = halvings(p->energy[k], p->most[k], bound);
			if (n < with)
				n = with < p->most[k] ? with : p->most[k];
			p->halvings[k] = n;
			sum += p->energy[k] * kept[n];
			*elements += (size_t)1 << n;
		}
	}
	return sum;
}

/* The largest bound that leaves no more than the allowed sum, or the least that does not
 * take too many elements. */
static double find_bound(struct plan *p)
{
	double low = 0, high = 0;
	size_t elements;

	for (size_t i = 0; i < p->m->element.n; i++)
		high = fmax(high, p->energy[i]);
	for (size_t i = 0; i < p->m->patch.n; i++)
		high = fmax(high, p->patch_energy[i]);
	double least = ldexp(high, -BISECTIONS);
	for (int i = 0; i < BISECTIONS; i++) {
		double bound = sqrt(fmax(low, least) * high), sum = expect(p, bound, &elements);
		if (sum <= p->allowed || elements > p->elements)
			low = bound;
		else
			high = bound;
	}
	expect(p, low, &elements);
	return elements > p->elements ? high : low;
}

static double total(const double *energy, size_t n)
{
	double sum = 0;

	for (size_t i = 0; i < n; i++)
		sum += energy[i];
	return sum;
}

/* Of the elements' energies, what stays because they are about as small as they may become:
 * nothing else is to make up for that. The rest is what all halvings can take to the same
 * part of it everywhere. */
static double stuck(const struct plan *p)
{
	double sum = 0, all = 1 - pow(left, HALVINGS_MAX);

	for (size_t i = 0; i < p->m->element.n; i++)
		sum += p->energy[i] * (1 - (1 - pow(left, p->most[i])) / all);
	return sum;
}

static int find_patch_energies(struct plan *p, const struct solution *s, struct err *e)
{
	struct patch_frame *frame = mesh_patch_frames(p->m, e);
	int status = frame && !mesh_patch_energies(p->m, s, frame, p->patch_energy, e) &&
	             !mesh_lobe_energies(p->m, s, frame, p->lobe_energy, e) ? 0 : -1;

	free(frame);
	return status;
}

static int allocate(struct plan *p, struct err *e)
{
	const struct model *m = p->m;

	p->energy = mem_new(m->element.n, sizeof *p->energy, "errors of elements", e);
	p->patch_energy = mem_new(m->patch.n, sizeof *p->patch_energy, "errors of patches", e);
	p->lobe_energy = mem_new(m->patch.n, sizeof *p->lobe_energy, "errors of patches", e);
	p->most = mem_new(m->element.n, sizeof *p->most, "errors of elements", e);
	return p->energy && p->patch_energy && p->lobe_energy && p->most ? 0 : -1;
}

/* What is more than the bound. Of a patch the larger part of its energy is the reason. */
static void count_marked(const struct plan *p, double bound, struct mesh_report *r)
{
	for (size_t i = 0; i < p->m->element.n; i++)
		r->marked += p->energy[i] > bound && p->most[i] > 0;
	for (size_t i = 0; i < p->m->patch.n; i++) {
		r->patches_marked += p->patch_energy[i] > bound;
		r->patches_for_lobes += p->patch_energy[i] > bound &&
		                        2 * p->lobe_energy[i] > p->patch_energy[i];
	}
}

int mesh_adapt_plan(const struct model *m, const struct solution *s,
                    const struct mesh_refinement *o, double smallest, uint8_t *halving,
                    uint8_t *patch_halving, struct mesh_report *r, struct err *e)
{
	struct plan p = { .m = m, .elements = o->elements, .halvings = halving,
		          .patch_halvings = patch_halving };
	size_t elements;

	int status = allocate(&p, e) || find_patch_energies(&p, s, e) ? -1 : 0;
	if (!status) {
		double unit = find_energies(&p, s);
		find_room(&p, smallest);
		double own = total(p.energy, m->element.n);
		double others = total(p.patch_energy, m->patch.n);
		double stays = stuck(&p);
		p.allowed = stays + fmax(o->error * o->error * unit, once * (own + others - stays));
		double bound = own + others <= p.allowed ? INFINITY : find_bound(&p);
		double expected = expect(&p, bound, &elements);
		count_marked(&p, bound, r);
		if (unit > 0) {
			r->error_before = sqrt((own + others) / unit);
			r->patch_error_before = sqrt(others / unit);
			r->error_expected = sqrt(expected / unit);
		}
	}
	free(p.energy);
	free(p.patch_energy);
	free(p.lobe_energy);
	free(p.most);
	return status;
}
