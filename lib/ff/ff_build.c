/* The rows of all patches and lights, in order, and the chain table of the file. */
#include "lib/ff/ff_build.h"

#include <stdlib.h>

#include "lib/ff/exchange_matrix.h"
#include "lib/ff/ff_job.h"
#include "lib/ff/ff_stats.h"
#include "lib/ff_rays/landings.h"
#include "lib/ff/row_hemicube.h"
#include "lib/ff/row_light.h"
#include "lib/ff/row_paper.h"
#include "lib/ff/row_rays.h"
#include "lib/ff/row_reciprocal.h"
#include "lib/ff_rays/ray_budget.h"

/* A count; a guess: enough for all threads, and few enough for batches to stay in memory. */
enum { PATCHES_AT_A_TIME = 64 };

/* ---- the loop over patches, and then lights ---- */

struct run {
	const struct ff_job *job;
	struct ff_landings *landings;
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
		uint32_t patch = r->first + (uint32_t)i, patches = (uint32_t)r->job->m->patch.n;
		r->owner[i] = thread;
		if (patch >= patches)
			ff_light_row(&r->thread[thread], patch - patches, &r->batch[i], &r->err[i]);
		else if (r->job->o.paper)
			ff_patch_paper(&r->thread[thread], patch, &r->batch[i], &r->err[i]);
		else if (r->job->o.method == FF_HEMICUBE)
			ff_patch_hemicube(&r->thread[thread], patch, &r->batch[i], &r->err[i]);
		else
			ff_patch_rays(&r->thread[thread], patch, &r->batch[i], &r->err[i]);
	}
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
		if (!bad && r->first + i < r->job->m->patch.n && r->landings->patch)
			bad = ff_landings_put(r->landings, r->first + (uint32_t)i, b, whole, e);
		if (!bad && (b->row_side.n || b->gathered_rays.n)) {
			bad = ff_batch_renumber(b, &t->tally.chains, &t->chain_map, whole, e);
			struct ff f = ff_batch_view(b);
			if (!bad)
				ff_stats_count(stats, &f);
			bad = bad || sink->put(sink->arg, &f, e);
		}
		ff_batch_free(b);
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
static int gather(struct ff_job *j, const struct ff *whole, struct ff_stats *stats,
                  const struct progress *progress, struct err *e)
{
	struct part_progress pp = { progress, 0, 2. * (double)j->m->patch.n };
	struct progress inner = { report, &pp };

	if (!j->o.gather)
		return 0;
	return ff_reciprocal_cast(j, whole->patch_begin, whole->patch_end, &stats->rays, &inner, e) ||
	       (j->reciprocal.rays && ff_share_rays(j, e)) ? -1 : 0;
}

/* Patches [begin, end), or lights, numbered behind the patches. */
static int all_patches(struct run *r, uint32_t begin, uint32_t end, struct chains *whole,
                       struct ff_stats *stats, const struct ff_sink *sink,
                       const struct progress *progress, struct err *e)
{
	for (uint32_t p = begin; p < end; p += PATCHES_AT_A_TIME) {
		size_t n = end - p < PATCHES_AT_A_TIME ? end - p : PATCHES_AT_A_TIME;
		double before = r->job->reciprocal.rays ? (double)r->job->m->patch.n : 0;
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
	uint32_t patches = (uint32_t)r->job->m->patch.n;

	return all_patches(r, patches + share(lights, o->shard - 1, o->shards),
	                   patches + share(lights, o->shard, o->shards), whole, stats, sink, NULL, e);
}

/* ---- the chain table of the file ---- */

static int put_chains(struct ff *f, const struct chains *c, struct err *e)
{
	size_t events = 0;

	for (uint32_t i = 0; i < c->n; i++)
		for (uint32_t k = 0; k < c->events; k++)
			events += bsdf_chains_count(c, i)[k] > 0;
	f->chain.n = c->n;
	f->chain.start = mem_new(c->n + 1, sizeof *f->chain.start, "chains", e);
	f->chain.event = mem_new(events, sizeof *f->chain.event, "chains", e);
	f->chain.count = mem_new(events, sizeof *f->chain.count, "chains", e);
	if (!f->chain.start || !f->chain.event || !f->chain.count)
		return -1;
	for (uint32_t i = 0; i < c->n; i++) {
		for (uint32_t k = 0; k < c->events; k++)
			if (bsdf_chains_count(c, i)[k]) {
				f->chain.event[f->chain.events] = c->event[k];
				f->chain.count[f->chain.events++] = bsdf_chains_count(c, i)[k];
			}
		f->chain.start[i + 1] = f->chain.events;
	}
	return 0;
}

/* What formulas do not do of what was asked of them. */
static void count_curved(const struct ff_job *j, struct ff_stats *s)
{
	const struct model *m = j->m;

	for (uint32_t ps = 0; ps < 2 * m->patch.n; ps++) {
		if (!model_side_modelled(m, ps))
			continue;
		s->sides++;
		s->curved += m->patch.loop[(ps >> 1) + 1] == m->patch.loop[ps >> 1];
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
	struct run run = { .job = j, .landings = &j->landings };
	int bad = ff_job_prepare(j, patches, e) || bsdf_chains_init(&chains, j->m, j->chain_most, e);

	run.thread = mem_new((size_t)threads, sizeof *run.thread, "threads", e);
	run.batch = mem_new(PATCHES_AT_A_TIME, sizeof *run.batch, "batches", e);
	run.owner = mem_new(PATCHES_AT_A_TIME, sizeof *run.owner, "batches", e);
	run.err = mem_new(PATCHES_AT_A_TIME, sizeof *run.err, "batches", e);
	bad = bad || !run.thread || !run.batch || !run.owner || !run.err;
	for (int t = 0; !bad && t < threads; t++)
		bad = ff_thread_init(&run.thread[t], j, e);
	for (size_t i = 0; !bad && i < PATCHES_AT_A_TIME; i++)
		run.batch[i].f64 = j->o.f64;
	if (patches)
		bad = bad || gather(j, whole, stats, progress, e) ||
		      all_patches(&run, whole->patch_begin, whole->patch_end, &chains, stats, sink,
		                  progress, e);
	bad = bad || all_lights(&run, &chains, stats, sink, e) || put_chains(whole, &chains, e);
	whole->chain.most = j->chain_most;
	for (int t = 0; run.thread && t < threads; t++) {
		stats->rays += run.thread[t].rays;
		if (run.thread[t].formula)
			ff_stats_count_pairs(stats, &run.thread[t].formula->counts);
		ff_thread_free(&run.thread[t]);
	}
	free(run.thread);
	free(run.batch);
	free(run.owner);
	free(run.err);
	bsdf_chains_free(&chains);
	return bad ? -1 : 0;
}

/* The matrix between patches, whose rows have no chains, and the rows of lights. */
static int build_matrix(struct ff_job *j, struct ff *whole, struct ff_stats *stats,
                        const struct ff_sink *sink, const struct progress *progress,
                        struct err *e)
{
	if (j->m->light.n)
		return ff_exchange_matrix(j, whole->patch_begin, whole->patch_end, sink, stats, progress, e) ||
		       build_rows(j, 0, whole, stats, sink, progress, e) ? -1 : 0;
	whole->chain.n = whole->chain.most = 1;
	whole->chain.start = mem_new(2, sizeof *whole->chain.start, "chains", e);
	return whole->chain.start ? ff_exchange_matrix(j, whole->patch_begin, whole->patch_end, sink, stats,
	                                               progress, e) : -1;
}

int ff_build(const struct model *m, const struct ff_options *o, struct ff *whole,
             struct ff_stats *stats, const struct ff_sink *sink,
             const struct progress *progress, struct err *e)
{
	struct ff_job job;
	int bad = ff_job_init(&job, m, o, e);
	int matrix = !bad && ff_by_formula(o) && o->to_patches && ff_exchange_matrix_can(&job);

	*stats = (struct ff_stats){ 0 };
	*whole = (struct ff){ .shard = o->shard, .shards = o->shards };
	whole->patch_begin = share(m->patch.n, o->shard - 1, o->shards);
	whole->patch_end = share(m->patch.n, o->shard, o->shards);
	if (!bad && o->paper && m->lobe != LOBE_PAPER)
		bad = err_set(e, "--paper needs the paper's lobes: run mesh with --lobe paper");
	if (!bad && o->close && !matrix)
		bad = err_set(e, "--close needs factors to patches by formula (-m auto --to patches) "
		              "in a model without lobes, mirrors and panes");
	if (!bad && ff_by_formula(o))
		count_curved(&job, stats);
	if (!bad)
		bad = matrix ? build_matrix(&job, whole, stats, sink, progress, e)
		             : build_rows(&job, 1, whole, stats, sink, progress, e);
	if (o->method == FF_HEMICUBE) /* rows say what they are worth */
		stats->samples = (double)stats->rows[FF_DIFFUSE] * (double)job.grid.pixels * o->points;
	if (stats->rows[FF_DIFFUSE])
		stats->mean_error /= (double)stats->rows[FF_DIFFUSE];
	ff_job_free(&job);
	return bad ? -1 : 0;
}
