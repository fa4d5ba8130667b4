#include "lib/ff/exchange_matrix.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/ff/ff_stats.h"
#include "lib/ff/row_remainder.h"
#include "lib/ff_tally/closure.h"
#include "lib/occlusion/exchange.h"

/* BAND_BYTES: memory of the rows at work; a guess, small beside a machine's and large beside a
 * row. ROWS_AT_A_TIME: a batch of the file. TILE x TILE pairs of facets at a time stay in the
 * cache. Rays of a row's rest, and of a pair with a crowd between: guesses, whose noise the row's
 * error states. `make bench-form-factors` measures time and error of them all.
 * ROUNDS: closed rows that miss by more than they state are refined so often at most, each time
 * with an error FINER times less, for so many times the evaluations, and rays to begin with.
 * SURE_RAYS: rays that would have escaped, had they been cast so that 16 are expected to, tell that
 * nothing does; PROOF_RAYS: the most that are cast for that. Guesses. */
enum { BAND_BYTES = 192 << 20, ROWS_AT_A_TIME = 64, TILE = 32, REST_RAYS = 256,
       CROWD_RAYS = 1024, ROUNDS = 3, FINER = 8, SURE_RAYS = 16, PROOF_RAYS = 1 << 20 };

struct thread {
	struct exchanger x;
	struct ff_rest rest;
	struct array doubt;           /* struct doubt */
	struct err e;
};

struct matrix {
	const struct ff_job *job;
	uint32_t *side;               /* [n] modelled patch-sides */
	size_t n;
	double *area;                 /* [n] */
	int curved;                   /* some side is: it has no facets, its pairs are by rays */
	struct facet_set facets;
	struct occluder_set occluders;
	struct cubature_pair_table table;     /* empty unless side i is facet i, and nothing ever between */
	double centre[3];
	struct thread *thread;
	/* The band in work: rows [first, first + rows), all columns. */
	size_t first, rows;
	float *e32;                   /* [rows][n] exchange areas, one of them */
	double *e64;
	struct ff_batch_row *row;        /* [rows] */
	struct tally_rest *rest;      /* [rows] what of them no side receives */
	uint8_t *closed;              /* [rows] what leaves the side arrives on sides */
	struct array doubt;           /* struct doubt, by pair */
	size_t *doubt_start;          /* [rows+1] of each row, in doubt_of_row */
	uint32_t *doubt_of_row;       /* numbers of doubts */
	float *value_error;           /* [2 patches] of the row that is put */
};

static double get(const struct matrix *m, size_t row, size_t j)
{
	return m->e32 ? (double)m->e32[row * m->n + j] : m->e64[row * m->n + j];
}

static void set(struct matrix *m, size_t row, size_t j, double x)
{
	if (m->e32)
		m->e32[row * m->n + j] = (float)x;
	else
		m->e64[row * m->n + j] = x;
}

/* ---- exchange areas ---- */

/* Of sides i < j: the sum over their facets. */
static double exchange(struct matrix *m, struct thread *t, size_t i, size_t j, double *error)
{
	const uint32_t *start = m->facets.start;
	uint32_t p = m->side[i], q = m->side[j];
	double sum = 0, off;

	*error = 0;
	for (uint32_t f = start[p]; f < start[p + 1]; f++)
		for (uint32_t g = start[q]; g < start[q + 1]; g++) {
			sum += occ_exchange(&t->x, &m->facets, f, &m->facets, g, &off, &t->e);
			*error += off;
		}
	return sum;
}

/* The same in the same order whichever is asked for; notes what is in doubt. */
static double pair(struct matrix *m, struct thread *t, size_t a, size_t b)
{
	size_t i = a < b ? a : b, j = a < b ? b : a;
	double error, sum = exchange(m, t, i, j, &error);

	if (error > 2 * t->x.o.relative * sum) {
		struct doubt d = { (uint32_t)i, (uint32_t)j, error };
		mem_append(&t->doubt, &d, 1, sizeof d, &t->e);
	}
	return sum;
}

/* Values [begin, end) of a row, all left or all right of the diagonal: where one cheap rule
 * does, four at a time. */
static void do_span(struct matrix *m, struct thread *t, size_t r, size_t begin, size_t end)
{
	size_t i = m->first + r;
	double one[PAIR_ONE], x[4];

	if (m->table.n)
		geo_pair_one(&m->table, i, one);
	for (size_t j = begin; j < end; j += 4) {
		int known = m->table.n ? geo_pair_four(&m->table, one, j, j < i, x) : 0;
		for (size_t k = 0; k < 4 && j + k < end; k++) {
			if (!(known >> k & 1)) {
				set(m, r, j + k, pair(m, t, i, j + k));
				continue;
			}
			set(m, r, j + k, x[k]);
			t->x.counts.pairs += x[k] > 0;
			t->x.counts.unoccluded += x[k] > 0;
		}
	}
}

/* A row of the band: what is right of the diagonal, and all outside the band. */
static void do_rows(void *arg, size_t begin, size_t end, int thread)
{
	struct matrix *m = arg;
	struct thread *t = &m->thread[thread];

	for (size_t r = begin; r < end; r++) {
		do_span(m, t, r, 0, m->first);
		do_span(m, t, r, m->first + r + 1, m->n);
	}
}

/* Left of the diagonal, by tiles: from the other half. */
static void mirror(struct matrix *m)
{
	for (size_t a = 0; a < m->rows; a += TILE)
		for (size_t b = 0; b <= a; b += TILE)
			for (size_t i = a; i < a + TILE && i < m->rows; i++)
				for (size_t j = b; j < b + TILE && j < i; j++)
					set(m, i, m->first + j, get(m, j, m->first + i));
}

static int by_pair(const void *a, const void *b)
{
	const struct doubt *x = a, *y = b;

	if (x->i != y->i)
		return x->i < y->i ? -1 : 1;
	return (x->j > y->j) - (x->j < y->j);
}

/* The doubts of all threads, in an order that does not depend on them. */
static int gather_doubts(struct matrix *m, struct err *e)
{
	m->doubt.n = 0;
	for (int t = 0; t < m->job->o.threads; t++) {
		struct array *v = &m->thread[t].doubt;
		if (m->thread[t].e.set)
			return err_set(e, "%s", m->thread[t].e.text);
		if (mem_append(&m->doubt, v->data, v->n, sizeof(struct doubt), e))
			return -1;
		v->n = 0;
	}
	if (m->doubt.n)
		qsort(m->doubt.data, m->doubt.n, sizeof(struct doubt), by_pair);
	return 0;
}

/* ---- rows ---- */

static int is_curved(const struct matrix *m, size_t i)
{
	return m->facets.start[m->side[i] + 1] == m->facets.start[m->side[i]];
}

/* Gives what formulas leave of a row to where its rays go that formulas know nothing of:
 * curved patches (to a curved one, all), the outside, black backs. Returns how many rays
 * these are. */
static double share_rest(struct matrix *m, size_t r, uint32_t least, struct ff_rest *rest)
{
	struct ff_batch_row *row = &m->row[r];
	size_t i = m->first + r;
	uint32_t emits = m->job->emits[row->side];
	uint32_t rays = m->curved ? m->job->o.rays * (emits ? m->job->o.emitter_gain : 1) : least;
	int all = is_curved(m, i);
	double lost, hits = 0, variance = 0;

	ff_remainder_cast(rest, m->job, row->side, rays);
	lost = rest->escaped + rest->black;
	for (size_t j = 0; m->curved && j < m->n; j++)
		hits += all || is_curved(m, j) ? ff_remainder_landed(rest, m->side[j]) : 0;
	if (!(hits + lost > 0))
		return 0;
	double each = row->residual / (hits + lost);
	for (size_t j = 0; hits > 0 && j < m->n; j++)
		if (all || is_curved(m, j)) {
			set(m, r, j, each * ff_remainder_landed(rest, m->side[j]) * m->area[i]);
			variance += each * each * ff_remainder_variance(rest, m->side[j]);
		}
	if (hits > 0) {
		/* All rays in one place tell no more than a ray's weight. */
		row->error = fmax(sqrt(row->error * row->error + variance), each);
		row->samples = rays;
	}
	m->rest[r] = (struct tally_rest){ .escape = each * rest->escaped, .black = each * rest->black };
	return hits + lost;
}

/* What a row says beside its values. What is missing of a closed row is its error; of
 * others, what nothing received by formula. */
static void judge(struct matrix *m, size_t r, struct ff_rest *rest)
{
	struct ff_batch_row *row = &m->row[r];
	double area = m->area[m->first + r], sum = 0;

	for (size_t j = 0; j < m->n; j++)
		sum += get(m, r, j);
	sum /= area;
	row->side = m->side[m->first + r];
	row->residual = 1 - sum;
	row->error = row->error / area + m->thread[0].x.o.relative * sum;
	/* What the formulas leave at any rate is not worth rays. */
	if (row->residual > m->thread[0].x.o.relative && share_rest(m, r, REST_RAYS, rest) > 0)
		row->residual = 0;
	else
		m->closed[r] = 1;
}

static void judge_rows(void *arg, size_t begin, size_t end, int thread)
{
	struct matrix *m = arg;

	for (size_t r = begin; r < end; r++)
		judge(m, r, &m->thread[thread].rest);
}

static int misses(const struct matrix *m, size_t r)
{
	return m->closed[r] && fabs(m->row[r].residual) > m->row[r].error;
}

/* Of rows that miss light by more than they state: it may leave by an opening too small for a few
 * rays, which more of them find. Where so many would have found it, none is. */
static void find_openings(void *arg, size_t begin, size_t end, int thread)
{
	struct matrix *m = arg;

	for (size_t r = begin; r < end; r++) {
		struct ff_batch_row *row = &m->row[r];
		if (!misses(m, r) || row->residual < 0)
			continue;
		uint32_t rays = (uint32_t)fmin(PROOF_RAYS, SURE_RAYS / row->residual);
		rays += (FF_REPLICATES - rays % FF_REPLICATES) % FF_REPLICATES;
		if (share_rest(m, r, rays, &m->thread[thread].rest) <= 0)
			continue;
		m->closed[r] = 0;
		row->residual = 0;
	}
}

static void judge_all(struct matrix *m)
{
	const struct doubt *d = m->doubt.data;

	memset(m->row, 0, m->rows * sizeof *m->row);
	memset(m->rest, 0, m->rows * sizeof *m->rest);
	memset(m->closed, 0, m->rows);
	for (size_t k = 0; k < m->doubt.n; k++) {
		size_t i = d[k].i - m->first, j = d[k].j - m->first; /* beyond rows if outside */
		if (i < m->rows)
			m->row[i].error += d[k].error;
		if (j < m->rows)
			m->row[j].error += d[k].error;
	}
	par_for(m->rows, 16, m->job->o.threads, judge_rows, m, NULL);
	par_for(m->rows, 16, m->job->o.threads, find_openings, m, NULL);
}

/* ---- closed rows that miss by more than they state ---- */

/* Is side i in the band, of a row that misses? */
static int in_missing_row(const struct matrix *m, size_t i)
{
	return i >= m->first && i - m->first < m->rows && misses(m, i - m->first);
}

/* Both places of a pair that are in the band. */
static void set_pair(struct matrix *m, size_t i, size_t j, double x)
{
	if (i - m->first < m->rows)
		set(m, i - m->first, j, x);
	if (j - m->first < m->rows)
		set(m, j - m->first, i, x);
}

static void refine_pairs(void *arg, size_t begin, size_t end, int thread)
{
	struct matrix *m = arg;
	struct thread *t = &m->thread[thread];
	struct doubt *d = m->doubt.data;

	for (size_t k = begin; k < end; k++)
		if (in_missing_row(m, d[k].i) || in_missing_row(m, d[k].j))
			set_pair(m, d[k].i, d[k].j, exchange(m, t, d[k].i, d[k].j, &d[k].error));
}

static void set_fineness(struct matrix *m, int round)
{
	double finer = pow(FINER, round);

	for (int t = 0; t < m->job->o.threads; t++) {
		struct exchange_options *o = &m->thread[t].x.o;
		o->absolute = m->job->o.target / finer;
		o->most = (int)(m->job->o.evaluations * finer);
		o->crowd_rays = (int)(CROWD_RAYS * finer);
	}
}

/* Rows whose sums are off by more than their factors state have one that is worse than it
 * states: all in doubt are computed anew. A pair with a side that is not in the band is so in one
 * of its two rows only. What still misses stays as the row's residual, for all to see. */
static int refine_rows(struct matrix *m, struct err *e)
{
	size_t off = m->rows;

	for (int round = 1; round <= ROUNDS && off; round++) {
		off = 0;
		for (size_t r = 0; r < m->rows; r++)
			off += (size_t)misses(m, r);
		if (!off)
			break;
		set_fineness(m, round);
		par_for(m->doubt.n, 4, m->job->o.threads, refine_pairs, m, NULL);
		judge_all(m);
	}
	for (size_t r = 0; r < m->rows; r++)
		if (misses(m, r) && m->row[r].residual > 0 &&
		    m->row[r].residual < (double)SURE_RAYS / PROOF_RAYS) {
			/* No number of rays can tell whether it escapes: so much is in doubt. */
			m->row[r].error += m->row[r].residual;
			m->rest[r].escape = m->row[r].residual;
			m->row[r].residual = 0;
			m->closed[r] = 0;
		}
	set_fineness(m, 0);
	for (int t = 0; t < m->job->o.threads; t++)
		if (m->thread[t].e.set)
			return err_set(e, "%s", m->thread[t].e.text);
	return 0;
}

/* Takes the residuals of closed rows out of the factors that are in doubt. The matrix is
 * whole: first is 0. */
static int close_rows(struct matrix *m, struct err *e)
{
	const struct doubt *d = m->doubt.data;
	double *missing = mem_new(m->rows, sizeof *missing, "closing rows", e);
	double *change = mem_new(m->doubt.n, sizeof *change, "closing rows", e);
	int bad = !missing || !change;

	for (size_t r = 0; !bad && r < m->rows; r++)
		missing[r] = m->closed[r] ? m->row[r].residual * m->area[r] : 0;
	bad = bad || ff_closure(d, m->doubt.n, m->rows, missing, m->closed, change, e);
	for (size_t k = 0; !bad && k < m->doubt.n; k++) {
		double x = fmax(0, get(m, d[k].i, d[k].j) + change[k]);
		set(m, d[k].i, d[k].j, x);
		set(m, d[k].j, d[k].i, x);
	}
	free(missing);
	free(change);
	return bad ? -1 : 0;
}

/* The doubts of each row: a counting sort. */
static int order_doubts(struct matrix *m, struct err *e)
{
	const struct doubt *d = m->doubt.data;
	size_t *end = mem_new(m->rows + 2, sizeof *end, "errors of pairs", e);

	free(m->doubt_start);
	free(m->doubt_of_row);
	m->doubt_start = end;
	m->doubt_of_row = mem_new(m->doubt.n, 2 * sizeof *m->doubt_of_row, "errors of pairs", e);
	if (!end || !m->doubt_of_row)
		return -1;
	for (size_t k = 0; k < 2 * m->doubt.n; k++) {
		size_t i = (k % 2 ? d[k / 2].j : d[k / 2].i) - m->first;
		if (i < m->rows)
			end[i + 2]++;
	}
	for (size_t r = 2; r < m->rows + 2; r++)
		end[r] += end[r - 1];
	for (size_t k = 0; k < 2 * m->doubt.n; k++) {
		size_t i = (k % 2 ? d[k / 2].j : d[k / 2].i) - m->first;
		if (i < m->rows)
			m->doubt_of_row[end[i + 1]++] = (uint32_t)(k / 2);
	}
	return 0;
}

/* The errors of the n values that were put last. */
static int put_errors(struct ff_batch *b, const struct matrix *m, size_t r, size_t n, struct err *e)
{
	const struct doubt *d = m->doubt.data;
	const double area = m->area[m->first + r];
	int bad = 0;

	for (int pass = 0; pass < 2; pass++) {
		for (size_t k = m->doubt_start[r]; k < m->doubt_start[r + 1]; k++) {
			const struct doubt *x = &d[m->doubt_of_row[k]];
			size_t other = x->i == m->first + r ? x->j : x->i;
			m->value_error[m->side[other]] = pass ? 0 : (float)(x->error / area);
		}
		bad = bad || (!pass && ff_batch_put_errors(b, m->value_error, n, e));
	}
	return bad;
}

static int put_row(struct ff_batch *b, const struct matrix *m, size_t r, struct err *e)
{
	struct ff_batch_row *row = &m->row[r];
	double area = m->area[m->first + r], sum = m->rest[r].escape + m->rest[r].black;

	const void *x = m->e32 ? (const void *)(m->e32 + r * m->n) : m->e64 + r * m->n;

	if (ff_batch_begin(b, e) || ff_batch_reserve(b, m->n, e))
		return -1;
	size_t before = b->value.n;
	sum += ff_batch_put_values(b, m->side, x, m->n, 1 / area);
	if (m->job->o.pair_errors && put_errors(b, m, r, b->value.n - before, e))
		return -1;
	row->scale = sum > 0 ? 1 / sum : 0;
	return ff_batch_put_block(b, 0, &m->rest[r], e) || ff_batch_put_row(b, row, e) ? -1 : 0;
}

static int emit(struct matrix *m, const struct ff_sink *sink, struct ff_stats *stats,
                struct err *e)
{
	struct ff_batch b = { .f64 = m->job->o.f64 };
	int bad = m->job->o.pair_errors && order_doubts(m, e);

	for (size_t r = 0; r < m->rows && !bad; r++) {
		bad = put_row(&b, m, r, e);
		if (bad || ((r + 1) % ROWS_AT_A_TIME && r + 1 < m->rows))
			continue;
		struct ff f = ff_batch_view(&b);
		f.to_patches = 1;
		ff_stats_count(stats, &f);
		bad = sink->put(sink->arg, &f, e);
		ff_batch_free(&b);
	}
	ff_batch_free(&b);
	return bad;
}

/* ---- bands ---- */

static int bands(struct matrix *m, size_t begin, size_t end, const struct ff_sink *sink,
                 struct ff_stats *stats, const struct progress *progress, struct err *e)
{
	size_t size = m->job->o.f64 ? sizeof(double) : sizeof(float), at;
	size_t most = BAND_BYTES / size / (m->n + 1);

	most = most < 1 ? 1 : most < end - begin ? most : end - begin;
	void *room = mem_new(most * m->n, size, "exchange areas", e);
	m->row = mem_new(most, sizeof *m->row, "exchange areas", e);
	m->rest = mem_new(most, sizeof *m->rest, "exchange areas", e);
	m->closed = mem_new(most, 1, "exchange areas", e);
	if (m->job->o.close && most < m->n)
		err_set(e, "--close needs all rows at once: no --part, and at most about %zu "
		        "patch-sides", (size_t)sqrt(BAND_BYTES / (double)size));
	if (!room || !m->row || !m->rest || !m->closed || e->set) {
		free(room);
		return -1;
	}
	*(m->job->o.f64 ? (void **)&m->e64 : (void **)&m->e32) = room;
	int bad = 0;
	for (at = begin; at < end && !bad; at += m->rows) {
		m->first = at;
		m->rows = end - at < most ? end - at : most;
		if (at > begin)
			memset(room, 0, most * m->n * size);
		par_for(m->rows, 1, m->job->o.threads, do_rows, m, progress);
		mirror(m);
		if ((bad = gather_doubts(m, e)))
			break;
		judge_all(m);
		bad = refine_rows(m, e) || (m->job->o.close && close_rows(m, e)) ||
		      emit(m, sink, stats, e);
	}
	free(room);
	return bad;
}

static int find_sides(struct matrix *m, struct err *e)
{
	const struct model *model = m->job->m;

	m->side = mem_new(2 * model->patch.n, sizeof *m->side, "patch-sides", e);
	m->area = mem_new(2 * model->patch.n, sizeof *m->area, "patch-sides", e);
	m->value_error = mem_new(2 * model->patch.n, sizeof *m->value_error, "patch-sides", e);
	if (!m->side || !m->area || !m->value_error)
		return -1;
	for (uint32_t ps = 0; ps < 2 * model->patch.n; ps++)
		if (model_side_modelled(model, ps)) {
			m->area[m->n] = model->patch.area[ps >> 1];
			m->side[m->n++] = ps;
		}
	return 0;
}

/* A table of the facets, where it can be used. */
static int tabulate(struct matrix *m, double relative, struct err *e)
{
	const uint32_t *start = m->facets.start;
	int simple = !m->occluders.nodes && m->facets.facets == m->n;

	for (size_t i = 0; simple && i < m->n; i++)
		simple = start[m->side[i]] == i && start[m->side[i] + 1] == i + 1;
	return simple ? geo_pair_table_new(m->facets.facet, m->facets.pair, m->n, relative, m->occluders.near,
	                                   &m->table, e) : 0;
}

/* Nothing sends light on but by Lambert's law. */
int ff_exchange_matrix_can(const struct ff_job *j)
{
	for (uint32_t ps = 0; ps < 2 * j->m->patch.n; ps++)
		if (model_side_modelled(j->m, ps) &&
		    (j->is_ideal[ps] || j->has_lobe[ps] || j->shoots_lobe[ps]))
			return 0;
	return 1;
}

static int matrix_init(struct matrix *m, const struct ff_job *j, struct err *e)
{
	const struct exchange_options o = { .relative = j->o.f64 ? 1e-9 : 8e-7,
	                                    .absolute = j->o.target, .most = j->o.evaluations,
	                                    .occluders = SHAFT_OCCLUDERS, .crowd_rays = CROWD_RAYS };

	*m = (struct matrix){ .job = j };
	if (find_sides(m, e) || occ_facet_set_init(&m->facets, j->m, FACETS_OF_PATCHES, e) ||
	    occ_occluder_set_init(&m->occluders, j->m, e) || tabulate(m, o.relative, e))
		return -1;
	occ_facet_centre(j->m, m->centre);
	for (size_t i = 0; i < m->n; i++)
		m->curved |= is_curved(m, i);
	m->thread = mem_new((size_t)j->o.threads, sizeof *m->thread, "threads", e);
	if (!m->thread)
		return -1;
	for (int t = 0; t < j->o.threads; t++) {
		occ_exchanger_init(&m->thread[t].x, &o, &m->occluders, j->rays, m->centre);
		if (ff_remainder_init(&m->thread[t].rest, j, e))
			return -1;
	}
	return 0;
}

static void matrix_free(struct matrix *m)
{
	for (int t = 0; m->thread && t < m->job->o.threads; t++) {
		occ_exchanger_free(&m->thread[t].x);
		ff_remainder_free(&m->thread[t].rest);
		free(m->thread[t].doubt.data);
	}
	free(m->thread);
	free(m->side);
	free(m->area);
	free(m->row);
	free(m->rest);
	free(m->closed);
	free(m->doubt.data);
	free(m->doubt_start);
	free(m->doubt_of_row);
	free(m->value_error);
	geo_pair_table_free(&m->table);
	occ_facet_set_free(&m->facets);
	occ_occluder_set_free(&m->occluders);
}

int ff_exchange_matrix(const struct ff_job *j, uint32_t begin, uint32_t end, const struct ff_sink *sink,
                       struct ff_stats *stats, const struct progress *progress, struct err *e)
{
	struct matrix m;
	size_t a = 0, b;
	int bad = matrix_init(&m, j, e);

	while (!bad && a < m.n && m.side[a] < 2 * begin)
		a++;
	for (b = a; !bad && b < m.n && m.side[b] < 2 * end;)
		b++;
	bad = bad || bands(&m, a, b, sink, stats, progress, e);
	for (int t = 0; !bad && t < j->o.threads; t++) {
		ff_stats_count_pairs(stats, &m.thread[t].x.counts);
		stats->rays += m.thread[t].rest.rays;
	}
	matrix_free(&m);
	return bad ? -1 : 0;
}
