#include "lib/interpolate/reconstruct.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/parallel.h"
#include "lib/base/vec.h"
#include "lib/data/solution.h"
#include "lib/interpolate/reconstruct_internal.h"

/* ---- keeping means ----
 *
 * Fits flatten what is curved, and wide ones do so within the noise, but always to
 * the same side. What the means of elements miss is spread by area-weighted averages,
 * which keep its sum over a surface, and added: noise cancels in it, bias does not. */

/* Mean over an element of vector v of what its corners have. */
static lanes corner_mean(const struct reconstruct_job *j, const lanes *at_groups, size_t element,
                         size_t v)
{
	const uint32_t *g = &j->g.group[3 * element];

	return (at_groups[g[0] * j->vectors + v] + at_groups[g[1] * j->vectors + v] +
	        at_groups[g[2] * j->vectors + v]) * (1. / 3);
}

static void find_rest(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;

	(void)thread;
	for (size_t e = begin; e < end; e++)
		for (size_t v = 0, at = e * j->vectors; v < j->vectors; v++)
			j->rest[at + v] = j->h[at + v] - corner_mean(j, j->value, e, v);
}

static void spread_to_elements(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;

	(void)thread;
	for (size_t e = begin; e < end; e++)
		for (size_t v = 0; v < j->vectors; v++)
			j->rest[e * j->vectors + v] = corner_mean(j, j->shift, e, v);
}

static void spread_to_groups(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;

	(void)thread;
	for (size_t g = begin; g < end; g++)
		for (size_t v = 0; v < j->vectors; v++) {
			lanes sum = { 0 };
			double area = 0;
			for (uint32_t i = j->g.start[g]; i < j->g.start[g + 1]; i++) {
				size_t e = j->g.corner[i] / 3;
				area += j->place[e].area;
				sum += j->place[e].area * j->rest[e * j->vectors + v];
			}
			j->shift[g * j->vectors + v] = area > 0 ? sum * (1 / area) : sum;
		}
}

/* Adds the shift, without leaving the range of the elements at the vertex further
 * than the fit did. */
static void shift_group(const struct reconstruct_job *j, size_t g)
{
	for (size_t v = 0, at = g * j->vectors; v < j->vectors; v++) {
		lanes value = j->value[at + v], low = value, high = value;
		for (uint32_t i = j->g.start[g]; i < j->g.start[g + 1]; i++) {
			lanes h = j->h[j->g.corner[i] / 3 * j->vectors + v];
			low = lanes_min(low, h);
			high = lanes_max(high, h);
		}
		j->value[at + v] = lanes_min(lanes_max(value + j->shift[at + v], low), high);
	}
}

/* Sums the columns of a side of a group for each band and stores them at its corners. */
static void store_side(const struct reconstruct_job *j, size_t g, size_t side)
{
	size_t bands = (size_t)j->s->bands, columns = (size_t)j->columns;
	const double *value = (const double *)(j->value + g * j->vectors) + side * columns;
	float sum[BANDS_MAX];

	for (size_t b = 0; b < bands; b++)
		sum[b] = (float)(value[b] + (columns > bands ? value[bands + b] : 0));
	for (uint32_t i = j->g.start[g]; i < j->g.start[g + 1]; i++)
		memcpy(&j->out->corner[(2 * (size_t)j->g.corner[i] + side) * bands], sum,
		       bands * sizeof *sum);
}

static void store_groups(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;

	(void)thread;
	for (size_t g = begin; g < end; g++) {
		shift_group(j, g);
		for (int side = 0; side < j->sides; side++)
			store_side(j, g, (size_t)side);
	}
}

static void run(struct reconstruct_job *j, int threads)
{
	/* CHUNK: work for a thread at a time. SPREADS, a count: what means still miss is averaged
	 * so often, over that many rings of elements, so that noise cancels. A guess. */
	enum { CHUNK = 1024, SPREADS = 3 };

	par_for(j->g.groups, CHUNK, threads, interp_reconstruct_fit, j, NULL);
	par_for(j->m->element.n, CHUNK, threads, find_rest, j, NULL);
	for (int i = 0; i < SPREADS; i++) {
		if (i > 0)
			par_for(j->m->element.n, CHUNK, threads, spread_to_elements, j, NULL);
		par_for(j->g.groups, CHUNK, threads, spread_to_groups, j, NULL);
	}
	par_for(j->g.groups, CHUNK, threads, store_groups, j, NULL);
}

/* The channels of an element-side in rows of elements, from `column` on. */
static double *channels_of(const struct reconstruct_job *j, lanes *rows, size_t element_side,
                           size_t column)
{
	return (double *)(rows + element_side / 2 * j->vectors) +
	       element_side % 2 * (size_t)j->columns + column;
}

/* Adds a part of the irradiance to a column of the bands. */
static void add_part(struct reconstruct_job *j, const double *part, size_t column)
{
	const struct solution *s = j->s;
	size_t bands = (size_t)s->bands, step = j->sides == 1 ? 2 : 1;

	for (size_t g = 0; g < s->groups; g++, part += s->element_sides * bands)
		for (size_t i = 0; i < s->element_sides; i += step) {
			double *to = channels_of(j, j->h, i, column);
			for (size_t b = 0; b < bands; b++)
				to[b] += part[i * bands + b];
		}
}

/* 1 over a variance; of an exact value nearly the largest number there is, so that what differs
 * from it is not consistent with it. */
static double precision_of(double variance)
{
	static const double exact = 1e300;

	return variance > 1 / exact ? 1 / variance : exact;
}

/* Precisions of the columns: of the sum of all parts, if its error is all that is known. */
static void set_precisions(struct reconstruct_job *j, unsigned parts)
{
	const struct solution *s = j->s;
	size_t bands = (size_t)s->bands, step = j->sides == 1 ? 2 : 1;

	for (size_t i = 0; i < s->element_sides; i += step) {
		double *to = channels_of(j, j->precision, i, 0);
		for (size_t b = 0; b < bands; b++) {
			double all = s->error.sampling[i * bands + b];
			double direct =
			    s->error.sampling_direct ? s->error.sampling_direct[i * bands + b] : 0;
			double other = precision_of(all * all - direct * direct);
			if ((size_t)j->columns > bands)
				to[bands + b] = other;
			to[b] = s->error.sampling_direct && parts & PART_DIRECT
			            ? precision_of(direct * direct)
			            : other;
		}
	}
}

/* Rows of vectors of channels; numbered, to be freed. */
static lanes *new_rows(struct reconstruct_job *j, int number, size_t n, struct err *e)
{
	if (n > SIZE_MAX / (VECTORS_MAX * sizeof(lanes)))
		return err_set(e, "%zu elements are too many to interpolate", n), NULL;
	return lanes_new(n * j->vectors, &j->room[number], "irradiance", e);
}

static int set_columns(struct reconstruct_job *j, unsigned parts, struct err *e)
{
	const struct solution *s = j->s;
	int apart = parts & PART_DIRECT && parts != PART_DIRECT && s->error.sampling &&
	            s->error.sampling_direct;

	j->columns = s->bands * (1 + apart);
	j->sides = 1;
	for (uint32_t p = 0; p < j->m->patch.n; p++)
		if (model_side_modelled(j->m, 2 * p + BACK))
			j->sides = 2;
	j->vectors = lanes_vectors((size_t)(j->sides * j->columns));
	j->h = new_rows(j, 0, j->m->element.n, e);
	if (!j->h || (s->error.sampling && !(j->precision = new_rows(j, 1, j->m->element.n, e))))
		return -1;
	if (parts & PART_DIRECT)
		add_part(j, s->irradiance.direct, 0);
	if (parts & PART_CAUSTIC)
		add_part(j, s->irradiance.caustic, apart ? (size_t)s->bands : 0);
	if (parts & PART_INDIRECT)
		add_part(j, s->irradiance.indirect, apart ? (size_t)s->bands : 0);
	if (s->error.sampling)
		set_precisions(j, parts);
	return 0;
}

static int new_values(struct reconstruct_job *j, struct err *e)
{
	j->value = new_rows(j, 2, j->g.groups, e);
	j->shift = new_rows(j, 3, j->g.groups, e);
	j->rest = new_rows(j, 4, j->m->element.n, e);
	return j->value && j->shift && j->rest ? 0 : -1;
}

static int set_places(struct reconstruct_job *j, struct err *e)
{
	const struct model *m = j->m;

	j->place = mem_new(m->element.n, sizeof *j->place, "elements", e);
	for (size_t i = 0; i < m->element.n && j->place; i++) {
		struct reconstruct_place *p = &j->place[i];
		for (size_t k = 0; k < 3; k++)
			v3_mad(p->centre, 1. / 3,
			       &m->vertex[3 * (size_t)m->element.corner[3 * i + k]], p->centre);
		memcpy(p->normal, &m->element.normal[3 * i], sizeof p->normal);
		p->area = m->element.area[i];
	}
	return j->place ? 0 : -1;
}

static int new_scratch(struct reconstruct_job *j, int threads, struct err *e)
{
	size_t most = 0;

	for (size_t g = 0; g < j->g.groups; g++)
		if (j->g.start[g + 1] - j->g.start[g] > most)
			most = j->g.start[g + 1] - j->g.start[g];
	j->scratch = mem_new((size_t)threads, sizeof *j->scratch, "scratch", e);
	for (int t = 0; t < threads && j->scratch; t++) {
		struct reconstruct_scratch *s = &j->scratch[t];
		s->listed = mem_new(j->m->element.n, sizeof *s->listed, "scratch", e);
		s->met = mem_new(j->g.groups, sizeof *s->met, "scratch", e);
		s->near = mem_new(most + RINGS * NEAR_MAX, sizeof *s->near, "scratch", e);
		if (!s->listed || !s->met || !s->near)
			return -1;
	}
	return j->scratch ? 0 : -1;
}

static void free_job(struct reconstruct_job *j, int threads)
{
	for (int t = 0; t < threads && j->scratch; t++) {
		free(j->scratch[t].listed);
		free(j->scratch[t].met);
		free(j->scratch[t].near);
	}
	free(j->scratch);
	free(j->place);
	for (size_t i = 0; i < sizeof j->room / sizeof *j->room; i++)
		free(j->room[i]);
	interp_smooth_groups_free(&j->g);
}

int interp_reconstruct(const struct model *m, const struct solution *s, unsigned parts, int threads,
                       struct reconstruction *r, struct err *e)
{
	struct reconstruct_job j = { .m = m, .s = s, .out = r };
	int bad = -1;

	*r = (struct reconstruction){ .elements = m->element.n, .bands = s->bands };
	if (s->element_sides != 2 * m->element.n)
		return err_set(e, "the solution has %zu element-sides, its model %zu",
		               s->element_sides, 2 * m->element.n);
	if (m->element.n <= SIZE_MAX / (6 * BANDS_MAX))
		r->corner = mem_new(m->element.n * 6 * (size_t)s->bands, sizeof *r->corner,
		                    "irradiance at corners", e);
	if (r->corner && !set_columns(&j, parts, e) &&
	    !interp_smooth_groups_new(m, COS_CREASE, &j.g, e) && !new_values(&j, e) &&
	    !set_places(&j, e) && !new_scratch(&j, threads, e)) {
		run(&j, threads);
		bad = 0;
	}
	free_job(&j, threads);
	if (bad)
		interp_reconstruction_free(r);
	return bad;
}

void interp_reconstruction_free(struct reconstruction *r)
{
	free(r->corner);
	*r = (struct reconstruction){ 0 };
}
