#include "reconstruct.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mem.h"
#include "par.h"
#include "reconstruct_parts.h"

/* ---- keeping means ----
 *
 * Fits flatten what is curved, and wide ones do so within the noise, but always to
 * the same side. What the means of elements miss is spread by area-weighted averages,
 * which keep its sum over a surface, and added: noise cancels in it, bias does not. */

/* Mean over an element of what its corners have. */
static double corner_mean(const struct reconstruct_job *j, const double *at_groups, size_t element,
                          size_t channel)
{
	size_t channels = 2 * (size_t)j->columns;
	const uint32_t *g = &j->g.group[3 * element];

	return (at_groups[g[0] * channels + channel] + at_groups[g[1] * channels + channel] +
	        at_groups[g[2] * channels + channel]) / 3;
}

static void find_rest(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;
	size_t channels = 2 * (size_t)j->columns;

	(void)thread;
	for (size_t e = begin; e < end; e++)
		for (size_t c = 0; c < channels; c++)
			j->rest[e * channels + c] = j->h[e * channels + c] -
			                            corner_mean(j, j->value, e, c);
}

static void spread_to_elements(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;
	size_t channels = 2 * (size_t)j->columns;

	(void)thread;
	for (size_t e = begin; e < end; e++)
		for (size_t c = 0; c < channels; c++)
			j->rest[e * channels + c] = corner_mean(j, j->shift, e, c);
}

static void spread_to_groups(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;
	size_t channels = 2 * (size_t)j->columns;

	(void)thread;
	for (size_t g = begin; g < end; g++) {
		double *shift = j->shift + g * channels, area = 0;
		memset(shift, 0, channels * sizeof *shift);
		for (uint32_t i = j->g.start[g]; i < j->g.start[g + 1]; i++) {
			size_t e = j->g.corner[i] / 3;
			double a = j->m->element_area[e];
			area += a;
			for (size_t c = 0; c < channels; c++)
				shift[c] += a * j->rest[e * channels + c];
		}
		for (size_t c = 0; c < channels && area > 0; c++)
			shift[c] /= area;
	}
}

/* Adds the shift, without leaving the range of the elements at the vertex further
 * than the fit did, and stores. */
static void store_groups(void *arg, size_t begin, size_t end, int thread)
{
	const struct reconstruct_job *j = arg;
	size_t channels = 2 * (size_t)j->columns, bands = (size_t)j->s->bands;

	(void)thread;
	for (size_t g = begin; g < end; g++)
		for (size_t c = 0; c < channels; c++) {
			size_t to = c / (size_t)j->columns * bands + c % bands;
			double value = j->value[g * channels + c], low = value, high = value;
			for (uint32_t i = j->g.start[g]; i < j->g.start[g + 1]; i++) {
				low = fmin(low, reconstruct_mean(j, j->g.corner[i] / 3, c));
				high = fmax(high, reconstruct_mean(j, j->g.corner[i] / 3, c));
			}
			value = fmin(fmax(value + j->shift[g * channels + c], low), high);
			for (uint32_t i = j->g.start[g]; i < j->g.start[g + 1]; i++)
				j->out->corner[j->g.corner[i] * 2 * bands + to] += (float)value;
		}
}

static void run(struct reconstruct_job *j, int threads)
{
	enum { CHUNK = 1024, SPREADS = 3 };

	par_for(j->g.groups, CHUNK, threads, reconstruct_fit, j, NULL);
	par_for(j->m->elements, CHUNK, threads, find_rest, j, NULL);
	for (int i = 0; i < SPREADS; i++) {
		if (i > 0)
			par_for(j->m->elements, CHUNK, threads, spread_to_elements, j, NULL);
		par_for(j->g.groups, CHUNK, threads, spread_to_groups, j, NULL);
	}
	par_for(j->g.groups, CHUNK, threads, store_groups, j, NULL);
}

/* Adds a part of the irradiance to a column of the bands. */
static void add_part(struct reconstruct_job *j, const double *part, size_t column)
{
	const struct solution *s = j->s;
	size_t bands = (size_t)s->bands, n = s->element_sides * bands;

	for (size_t i = 0; i < s->groups * n; i++)
		j->h[i % n / bands * (size_t)j->columns + column * bands + i % bands] += part[i];
}

/* Standard errors of the columns: of all, if that is all that is known. */
static void set_errors(struct reconstruct_job *j, unsigned parts)
{
	const struct solution *s = j->s;
	size_t bands = (size_t)s->bands;

	for (size_t i = 0; i < s->element_sides * bands; i++) {
		double *to = &j->error[i / bands * (size_t)j->columns + i % bands];
		double all = s->error[i], direct = s->error_direct ? s->error_direct[i] : all;
		double other = s->error_direct ? sqrt(fmax(0, all * all - direct * direct)) : all;
		if ((size_t)j->columns > bands)
			to[bands] = other;
		*to = parts & PART_DIRECT ? direct : other;
	}
}

static int set_columns(struct reconstruct_job *j, unsigned parts, struct err *e)
{
	const struct solution *s = j->s;
	int apart = parts & PART_DIRECT && parts != PART_DIRECT && s->error && s->error_direct;

	j->columns = s->bands * (1 + apart);
	j->h = mem_new(s->element_sides, (size_t)j->columns * sizeof *j->h, "irradiance", e);
	if (!j->h || (s->error && !(j->error = mem_new(s->element_sides, (size_t)j->columns *
	                                               sizeof *j->error, "irradiance", e))))
		return -1;
	if (parts & PART_DIRECT)
		add_part(j, s->direct, 0);
	if (parts & PART_CAUSTIC)
		add_part(j, s->caustic, (size_t)apart);
	if (parts & PART_INDIRECT)
		add_part(j, s->indirect, (size_t)apart);
	if (s->error)
		set_errors(j, parts);
	return 0;
}

static int new_values(struct reconstruct_job *j, struct err *e)
{
	size_t bytes = 2 * (size_t)j->columns * sizeof(double);

	j->value = mem_new(j->g.groups, bytes, "irradiance at vertices", e);
	j->shift = mem_new(j->g.groups, bytes, "irradiance at vertices", e);
	j->rest = mem_new(j->m->elements, bytes, "irradiance", e);
	return j->value && j->shift && j->rest ? 0 : -1;
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
		s->stamp = mem_new(j->m->elements, sizeof *s->stamp, "scratch", e);
		s->near = mem_new(most + RINGS * NEAR_MAX, sizeof *s->near, "scratch", e);
		if (!s->stamp || !s->near)
			return -1;
	}
	return j->scratch ? 0 : -1;
}

static void free_job(struct reconstruct_job *j, int threads)
{
	for (int t = 0; t < threads && j->scratch; t++) {
		free(j->scratch[t].stamp);
		free(j->scratch[t].near);
	}
	free(j->scratch);
	free(j->h);
	free(j->error);
	free(j->value);
	free(j->rest);
	free(j->shift);
	smooth_groups_free(&j->g);
}

int reconstruct(const struct model *m, const struct solution *s, unsigned parts, int threads,
                struct reconstruction *r, struct err *e)
{
	struct reconstruct_job j = { .m = m, .s = s, .out = r };
	int bad = -1;

	*r = (struct reconstruction){ .elements = m->elements, .bands = s->bands };
	if (s->element_sides != 2 * m->elements)
		return err_set(e, "the solution has %zu element-sides, its model %zu",
		               s->element_sides, 2 * m->elements);
	if (m->elements <= SIZE_MAX / (6 * BANDS_MAX))
		r->corner = mem_new(m->elements * 6 * (size_t)s->bands, sizeof *r->corner,
		                    "irradiance at corners", e);
	if (r->corner && !set_columns(&j, parts, e) && !smooth_groups_new(m, COS_CREASE, &j.g, e) &&
	    !new_values(&j, e) && !new_scratch(&j, threads, e)) {
		run(&j, threads);
		bad = 0;
	}
	free_job(&j, threads);
	if (bad)
		reconstruction_free(r);
	return bad;
}

void reconstruction_free(struct reconstruction *r)
{
	free(r->corner);
	*r = (struct reconstruction){ 0 };
}
