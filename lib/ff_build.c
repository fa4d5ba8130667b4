#include "ff_build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bsdf.h"
#include "ff_job.h"
#include "ff_matrix.h"
#include "vec3.h"

enum { FORMULA_EVALUATIONS = 1000, FORMULA_BODIES = 8, PATCHES_AT_A_TIME = 64,
       SOBOL_POINTS_MAX = 1 << 16, GATHER_FEWEST = 32 };

/* Of what nothing hides, by formula to elements: finer than any picture shows. */
static const double FORMULA_ERROR = 1e-5;

/* ---- what leaves which side ---- */

static int any(const double *x, int n)
{
	for (int i = 0; i < n; i++)
		if (x[i] > 0)
			return 1;
	return 0;
}

static void side_flags(struct ff_job *j, uint32_t ps)
{
	const struct materials *mt = &j->m->material;
	uint32_t material = model_patch_material(j->m, ps >> 1);
	int side = (int)(ps & 1), bands = mt->bands;
	size_t here = material_at(mt, material, side), there = material_at(mt, material, !side);
	int emits = any(&mt->emission[here], bands);
	int plain = mt->emission_exponent[2 * material + (uint32_t)side] == 1;

	j->is_black[ps] = !model_side_modelled(j->m, ps);
	if (j->is_black[ps])
		return;
	j->emits[ps] = (uint8_t)emits;
	j->shoots_diffuse[ps] = (emits && plain) || any(&mt->rho_d[here], bands) ||
	                        any(&mt->tau_d[there], bands);
	j->shoots_lobe[ps] = emits && !plain;
	j->has_lobe[ps] = bsdf_has_lobe(mt, material, side, 0) ||
	                  bsdf_has_lobe(mt, material, side, 1);
	j->is_ideal[ps] = bsdf_has_ideal(mt, material, side, 0) ||
	                  bsdf_has_ideal(mt, material, side, 1);
	j->has_panes |= bsdf_has_ideal(mt, material, side, 1);
	j->has_ideal |= j->is_ideal[ps];
	j->is_source[ps] = j->shoots_diffuse[ps] || j->shoots_lobe[ps] ||
	                   bsdf_has_lobe(mt, material, side, 0) ||
	                   bsdf_has_lobe(mt, material, !side, 1);
}

/* ---- a job ---- */

static int by_formula(const struct ff_options *o)
{
	return o->method == FF_ANALYTIC || o->method == FF_AUTO;
}

static int job_arrays(struct ff_job *j, struct err *e)
{
	size_t sides = 2 * j->m->patches;
	j->element = mem_new(j->m->elements, sizeof *j->element, "sampling tables", e);
	j->shoots_diffuse = mem_new(sides, 1, "patch flags", e);
	j->shoots_lobe = mem_new(sides, 1, "patch flags", e);
	j->has_lobe = mem_new(sides, 1, "patch flags", e);
	j->emits = mem_new(sides, 1, "patch flags", e);
	j->is_source = mem_new(sides, 1, "patch flags", e);
	j->is_black = mem_new(sides, 1, "patch flags", e);
	j->is_ideal = mem_new(sides, 1, "patch flags", e);
	return j->element && j->shoots_diffuse && j->shoots_lobe && j->has_lobe && j->emits &&
	       j->is_source && j->is_black && j->is_ideal ? 0 : -1;
}

/* Bits of x spread to the even places. */
static uint64_t spread(uint32_t x)
{
	uint64_t v = x;

	v = (v | v << 16) & 0x0000ffff0000ffffu;
	v = (v | v << 8) & 0x00ff00ff00ff00ffu;
	v = (v | v << 4) & 0x0f0f0f0f0f0f0f0fu;
	v = (v | v << 2) & 0x3333333333333333u;
	return (v | v << 1) & 0x5555555555555555u;
}

struct sample {
	uint32_t bits[FF_DIMS];
};

static int by_direction(const void *a, const void *b)
{
	const uint32_t *x = ((const struct sample *)a)->bits, *y = ((const struct sample *)b)->bits;
	uint64_t p = spread(rng_reverse_bits(x[2])) << 1 | spread(rng_reverse_bits(x[3]));
	uint64_t q = spread(rng_reverse_bits(y[2])) << 1 | spread(rng_reverse_bits(y[3]));

	return (p > q) - (p < q);
}

/* The first n sample points, each aligned block of a power of two that divides `each`, but
 * none longer than the fewest points that are used at a time, in an order in which
 * neighbours have similar directions (their places on a Morton curve, which scrambling
 * keeps): rays and memory then see coherent work. */
static int fill_samples(struct ff_samples *s, uint32_t each, uint64_t n, struct err *e)
{
	uint32_t block = each & (~each + 1);

	block = block < FF_CLOSE_RAYS ? block : FF_CLOSE_RAYS;
	s->n = n < SOBOL_POINTS_MAX ? (uint32_t)n : SOBOL_POINTS_MAX;
	s->bits = mem_new((size_t)s->n * FF_DIMS, sizeof *s->bits, "sample points", e);
	struct sample *sample = mem_new(s->n, sizeof *sample, "sample points", e);
	for (uint32_t i = 0; s->bits && sample && i < s->n; i++)
		for (int d = 0; d < FF_DIMS; d++)
			sample[i].bits[d] = rng_sobol_bits(i, d);
	for (uint32_t i = 0; s->bits && sample && block && i + block <= s->n; i += block)
		qsort(sample + i, block, sizeof *sample, by_direction);
	for (uint32_t i = 0; s->bits && sample && i < s->n; i++)
		for (uint32_t d = 0; d < FF_DIMS; d++)
			s->bits[(size_t)d * s->n + i] = sample[i].bits[d];
	free(sample);
	return s->bits && sample ? 0 : -1;
}

/* A quarter of the mean area of an element as a picture shows them, each for its area. */
static double small_area(const struct model *m)
{
	double sum = 0, squares = 0;

	for (size_t i = 0; i < m->elements; i++) {
		sum += m->element_area[i];
		squares += m->element_area[i] * m->element_area[i];
	}
	return squares / (4 * sum);
}

/* A replicate is whole blocks of the rows' points, an element-side's rays are of the
 * gathering ones. */
static int make_samples(struct ff_job *j, struct err *e)
{
	uint32_t each = j->o.rays / FF_REPLICATES, gather = j->o.gather;

	if (j->o.method == FF_HEMICUBE)
		return 0;
	if (gather / 4 >= GATHER_FEWEST)
		j->small_area = small_area(j->m);
	return fill_samples(&j->of_rows, each, (uint64_t)each * j->o.emitter_gain, e) ||
	       fill_samples(&j->of_gathering, gather, gather, e) ||
	       fill_samples(&j->of_small, gather / 4, gather / 4, e) ? -1 : 0;
}

/* A ray that lands on some sides has more to it than where it lands. */
static int make_places(struct ff_job *j, struct err *e)
{
	uint8_t *apart = mem_new(2 * j->m->patches, 1, "patch flags", e);
	int bad = !apart;

	for (size_t ps = 0; !bad && ps < 2 * j->m->patches; ps++)
		apart[ps] = j->is_black[ps] || j->is_ideal[ps] || j->has_lobe[ps];
	bad = bad || tally_places_init(&j->places, j->m, apart, e);
	free(apart);
	return bad ? -1 : 0;
}

static int job_init(struct ff_job *j, const struct model *m, const struct ff_options *o,
                    struct err *e)
{
	*j = (struct ff_job){ .m = m, .o = *o };
	if (job_arrays(j, e) || locator_init(&j->locator, m, e) ||
	    !(j->rays = ray_scene_new(m, e)))
		return -1;
	for (uint32_t ps = 0; ps < 2 * m->patches; ps++)
		side_flags(j, ps);
	ff_element_table(j);
	return light_images_new(m, ray_offset(j->rays), 1, SIZE_MAX, 0, &j->images, e);
}

/* What rows that are computed one by one need beside. */
static int prepare_rows(struct ff_job *j, int patches, struct err *e)
{
	int formula = patches && by_formula(&j->o), cubes = patches && j->o.method == FF_HEMICUBE;

	if (cubes && (hemi_grid_init(&j->grid, (int)j->o.rays, e) ||
	              !(j->cubes = hemi_scene_new(j->m, e))))
		return -1;
	if (formula && ff_formula_init(&j->formula, j->m, j->o.method == FF_ANALYTIC, e))
		return -1;
	return make_samples(j, e) || make_places(j, e) || ff_find_chain_most(j, e) ? -1 : 0;
}

static void job_free(struct ff_job *j)
{
	void *array[] = { j->element, j->shoots_diffuse, j->shoots_lobe, j->has_lobe,
		j->is_source, j->emits, j->is_ideal, j->is_black, j->of_rows.bits,
		j->of_gathering.bits, j->of_small.bits };

	for (size_t i = 0; i < sizeof array / sizeof *array; i++)
		free(array[i]);
	light_images_free(&j->images);
	locator_free(&j->locator);
	tally_places_free(&j->places);
	ff_gather_free(&j->gather);
	ff_formula_free(&j->formula);
	ray_scene_free(j->rays);
	hemi_scene_free(j->cubes);
	hemi_grid_free(&j->grid);
}

static int thread_init(struct ff_thread *t, const struct ff_job *j, struct err *e)
{
	const struct exchange_options o = { FORMULA_ERROR, j->o.target, FORMULA_EVALUATIONS,
	                                    FORMULA_BODIES, 0 };

	*t = (struct ff_thread){ .job = j };
	if (tally_init(&t->tally, j->m, &j->places, j->has_lobe, j->chain_most, e))
		return -1;
	if (j->formula.on) {
		t->formula = mem_new(1, sizeof *t->formula, "formulas", e);
		if (!t->formula)
			return -1;
		exchanger_init(t->formula, &o, &j->formula.bodies, j->rays, j->formula.centre);
	}
	if (j->o.method != FF_HEMICUBE)
		return 0;
	t->item = mem_new(2 * (size_t)j->o.points, j->grid.pixels * sizeof *t->item,
	                  "hemicube items", e);
	t->view = mem_new(2 * (size_t)j->o.points, sizeof *t->view, "hemicube views", e);
	return t->item && t->view ? hemicube_init(&t->cube, &j->grid, e) : -1;
}

static void thread_free(struct ff_thread *t)
{
	tally_free(&t->tally);
	hemicube_free(&t->cube);
	if (t->formula)
		exchanger_free(t->formula);
	free(t->formula);
	free(t->captures.data);
	free(t->pairs.data);
	free(t->sights.data);
	free(t->lit.data);
	free(t->item);
	free(t->view);
	free(t->chain_map.data);
}

/* ---- the loop over patches, and then lights ---- */

struct run {
	const struct ff_job *job;
	struct ff_thread *thread;
	struct ff_batch *batch;   /* [PATCHES_AT_A_TIME] */
	int *owner;               /* thread that made each batch */
	struct err *err;          /* [PATCHES_AT_A_TIME] */
	uint32_t first;
};

static void do_patches(void *arg, size_t begin, size_t end, int thread)
{
	struct run *r = arg;

	for (size_t i = begin; i < end; i++) {
		uint32_t patch = r->first + (uint32_t)i, patches = (uint32_t)r->job->m->patches;
		r->owner[i] = thread;
		if (patch >= patches)
			ff_light_row(&r->thread[thread], patch - patches, &r->batch[i], &r->err[i]);
		else if (r->job->o.method == FF_HEMICUBE)
			ff_patch_hemicube(&r->thread[thread], patch, &r->batch[i], &r->err[i]);
		else
			ff_patch_rays(&r->thread[thread], patch, &r->batch[i], &r->err[i]);
	}
}

void ff_count(struct ff_stats *s, const struct ff *f)
{
	for (size_t r = 0; r < f->rows; r++) {
		double cut = 0;
		s->rows[f->row_kind[r]]++;
		s->worst_residual = fmax(s->worst_residual, fabs((double)f->row_residual[r]));
		for (uint64_t b = f->row_block[r]; b < f->row_block[r + 1]; b++)
			cut += f->block_cut[b] * f->row_scale[r];
		s->cut = fmax(s->cut, cut);
		if (f->row_kind[r] == FF_DIFFUSE) {
			s->samples += f->row_samples[r];
			s->mean_error += (double)f->row_error[r];
			s->worst_error = fmax(s->worst_error, (double)f->row_error[r]);
		}
	}
	s->links += f->links;
	s->blocks += f->blocks;
	s->entries += f->entries;
}

void ff_count_pairs(struct ff_stats *s, const struct exchange_counts *c)
{
	s->pairs[0] += c->clear;
	s->pairs[1] += c->hidden;
	s->pairs[2] += c->partly;
	s->pairs[3] += c->crowded;
	s->evaluations += c->evaluations;
}

/* Hands the finished batches on, in patch order, with the file's chain numbers. */
static int emit(struct run *r, size_t n, struct chains *whole, struct ff_stats *stats,
                const struct ff_sink *sink, struct err *e)
{
	int bad = 0;

	for (size_t i = 0; i < n; i++) {
		struct ff_thread *t = &r->thread[r->owner[i]];
		struct ff_batch *b = &r->batch[i];
		if (!bad && r->err[i].set)
			bad = err_set(e, "%s", r->err[i].text);
		if (!bad && b->row_side.n) {
			bad = batch_renumber(b, &t->tally.chains, &t->chain_map, whole, e);
			struct ff f = batch_view(b);
			if (!bad)
				ff_count(stats, &f);
			bad = bad || sink->put(sink->arg, &f, e);
		}
		batch_free(b);
	}
	return bad;
}

struct part_progress {
	const struct progress *to;
	double before, total;
};

static void report(void *arg, double done, double total)
{
	struct part_progress *p = arg;

	(void)total;
	if (p->to && p->to->fn)
		p->to->fn(p->to->arg, p->before + done, p->total);
}

/* Before the rows, all elements gather. */
static int gather(struct ff_job *j, struct ff_stats *stats, const struct progress *progress,
                  struct err *e)
{
	struct part_progress pp = { progress, 0, 2. * (double)j->m->patches };
	struct progress inner = { report, &pp };

	if (!j->o.gather || j->o.method == FF_HEMICUBE)
		return 0;
	return ff_gather(j, &stats->rays, &inner, e);
}

/* Patches [begin, end), or lights, numbered behind the patches. */
static int all_patches(struct run *r, uint32_t begin, uint32_t end, struct chains *whole,
                       struct ff_stats *stats, const struct ff_sink *sink,
                       const struct progress *progress, struct err *e)
{
	for (uint32_t p = begin; p < end; p += PATCHES_AT_A_TIME) {
		size_t n = end - p < PATCHES_AT_A_TIME ? end - p : PATCHES_AT_A_TIME;
		double before = r->job->gather.rays ? (double)r->job->m->patches : 0;
		struct part_progress pp = { progress, before + p - begin, before + end - begin };
		struct progress inner = { report, &pp };
		r->first = p;
		par_for(n, 1, r->job->o.threads, do_patches, r, &inner);
		if (emit(r, n, whole, stats, sink, e))
			return -1;
	}
	return 0;
}

/* Where the k-th of `parts` equal shares of n ends. */
static uint32_t share(size_t n, uint32_t k, uint32_t parts)
{
	return (uint32_t)((uint64_t)n * k / parts);
}

static int all_lights(struct run *r, struct chains *whole, struct ff_stats *stats,
                      const struct ff_sink *sink, struct err *e)
{
	const struct ff_options *o = &r->job->o;
	size_t lights = r->job->m->light.n;
	uint32_t patches = (uint32_t)r->job->m->patches;

	return all_patches(r, patches + share(lights, o->part - 1, o->parts),
	                   patches + share(lights, o->part, o->parts), whole, stats, sink, NULL, e);
}

/* ---- the chain table of the file ---- */

static int put_chains(struct ff *f, const struct chains *c, struct err *e)
{
	size_t events = 0;

	for (uint32_t i = 0; i < c->n; i++)
		for (uint32_t k = 0; k < c->events; k++)
			events += chains_count(c, i)[k] > 0;
	f->chains = c->n;
	f->chain_start = mem_new(c->n + 1, sizeof *f->chain_start, "chains", e);
	f->chain_event = mem_new(events, sizeof *f->chain_event, "chains", e);
	f->chain_count = mem_new(events, sizeof *f->chain_count, "chains", e);
	if (!f->chain_start || !f->chain_event || !f->chain_count)
		return -1;
	for (uint32_t i = 0; i < c->n; i++) {
		for (uint32_t k = 0; k < c->events; k++)
			if (chains_count(c, i)[k]) {
				f->chain_event[f->chain_events] = c->event[k];
				f->chain_count[f->chain_events++] = chains_count(c, i)[k];
			}
		f->chain_start[i + 1] = f->chain_events;
	}
	return 0;
}

/* What formulas do not do of what was asked of them. */
static void count_curved(const struct ff_job *j, struct ff_stats *s)
{
	const struct model *m = j->m;

	for (uint32_t ps = 0; ps < 2 * m->patches; ps++) {
		if (!model_side_modelled(m, ps))
			continue;
		s->sides++;
		s->curved += m->patch_loop[(ps >> 1) + 1] == m->patch_loop[ps >> 1];
		s->directional |= j->is_ideal[ps] || j->has_lobe[ps] || j->shoots_lobe[ps];
	}
}

/* All rows, one after the other; without `patches` those of lights only. */
static int build_rows(struct ff_job *j, int patches, struct ff *whole, struct ff_stats *stats,
                      const struct ff_sink *sink, const struct progress *progress,
                      struct err *e)
{
	int threads = j->o.threads > 0 ? j->o.threads : 1;
	struct chains chains = { 0 };
	struct run run = { .job = j };
	int bad = prepare_rows(j, patches, e) || chains_init(&chains, j->m, j->chain_most, e);

	run.thread = mem_new((size_t)threads, sizeof *run.thread, "threads", e);
	run.batch = mem_new(PATCHES_AT_A_TIME, sizeof *run.batch, "batches", e);
	run.owner = mem_new(PATCHES_AT_A_TIME, sizeof *run.owner, "batches", e);
	run.err = mem_new(PATCHES_AT_A_TIME, sizeof *run.err, "batches", e);
	bad = bad || !run.thread || !run.batch || !run.owner || !run.err;
	for (int t = 0; !bad && t < threads; t++)
		bad = thread_init(&run.thread[t], j, e);
	for (size_t i = 0; !bad && i < PATCHES_AT_A_TIME; i++)
		run.batch[i].f64 = j->o.f64;
	if (patches)
		bad = bad || gather(j, stats, progress, e) ||
		      all_patches(&run, whole->patch_begin, whole->patch_end, &chains, stats, sink,
		                  progress, e);
	bad = bad || all_lights(&run, &chains, stats, sink, e) || put_chains(whole, &chains, e);
	whole->chain_most = j->chain_most;
	for (int t = 0; run.thread && t < threads; t++) {
		stats->rays += run.thread[t].rays;
		if (run.thread[t].formula)
			ff_count_pairs(stats, &run.thread[t].formula->counts);
		thread_free(&run.thread[t]);
	}
	free(run.thread);
	free(run.batch);
	free(run.owner);
	free(run.err);
	chains_free(&chains);
	return bad ? -1 : 0;
}

/* The matrix between patches, whose rows have no chains, and the rows of lights. */
static int build_matrix(struct ff_job *j, struct ff *whole, struct ff_stats *stats,
                        const struct ff_sink *sink, const struct progress *progress,
                        struct err *e)
{
	if (j->m->light.n)
		return ff_matrix(j, whole->patch_begin, whole->patch_end, sink, stats, progress, e) ||
		       build_rows(j, 0, whole, stats, sink, progress, e) ? -1 : 0;
	whole->chains = whole->chain_most = 1;
	whole->chain_start = mem_new(2, sizeof *whole->chain_start, "chains", e);
	return whole->chain_start ? ff_matrix(j, whole->patch_begin, whole->patch_end, sink, stats,
	                                      progress, e) : -1;
}

int ff_build(const struct model *m, const struct ff_options *o, struct ff *whole,
             struct ff_stats *stats, const struct ff_sink *sink,
             const struct progress *progress, struct err *e)
{
	struct ff_job job;
	int bad = job_init(&job, m, o, e);
	int matrix = !bad && by_formula(o) && o->to_patches && ff_matrix_can(&job);

	*stats = (struct ff_stats){ 0 };
	*whole = (struct ff){ .part = o->part, .parts = o->parts };
	whole->patch_begin = share(m->patches, o->part - 1, o->parts);
	whole->patch_end = share(m->patches, o->part, o->parts);
	if (!bad && o->close && !matrix)
		bad = err_set(e, "--close needs factors to patches by formula (-m auto --to patches) "
		              "in a model without lobes, mirrors and panes");
	if (!bad && by_formula(o))
		count_curved(&job, stats);
	if (!bad)
		bad = matrix ? build_matrix(&job, whole, stats, sink, progress, e)
		             : build_rows(&job, 1, whole, stats, sink, progress, e);
	if (stats->rows[FF_DIFFUSE])
		stats->mean_error /= (double)stats->rows[FF_DIFFUSE];
	job_free(&job);
	return bad ? -1 : 0;
}
