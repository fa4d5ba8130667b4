/* What elements see: the other way to a form factor. A_j F[j->e] = A_e F[e->j], so rays
 * of an element, stratified over its own area and hemisphere, tell what each patch-side
 * sends there, and what they tell of all patch-sides together adds up to what the
 * element can see: its irradiance is an average with stratified samples, where landings
 * of other patches' rays come by chance. */
#include "lib/ff/row_reciprocal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/ff_rays/landings.h"
#include "lib/ff/row_emitter.h"
#include "lib/ff_rays/ray_budget.h"
#include "lib/ff_rays/ray_samples.h"

/* An element's own rays tell what a patch-side sends it, if its area is small beside the
 * patch's, and if of rays between them so many are the element's, beside those that the
 * row casts: they are stratified over all that the element sees, so fewer do. A large
 * element is better told by the rays of a small patch.
 * Ratios; the commit that has them says that large elements keep their row's rays, nothing that
 * was measured is left: guesses. */
static const double larger = 2.2, enough = .11;

/* How far the sum of reciprocal factors may be from what must land there, a fraction; a guess. */
static const double misfit = .25;

/* ... besides so many standard errors: one in 400 by chance. */
static const double unlikely = 3;

/* Of the rays of an element, as many as so many independent ones to the irradiance: they are
 * stratified, and what one patch gets too many of them another lacks. Measured: 1.2 n^.4
 * within 4 % in a closed room with n from 64 to 1024, for whose standard errors that is
 * 2.5 to 4.4 times less; the exponent is between those of two and of four dimensions. */
static double worth(uint32_t rays)
{
	return fmax(1, 1.2 * pow(rays, .4));
}

/* Stated errors beyond which something is sure: one in 16 000, if they are normal. */
static const double certain = 4;

/* Looking at an element from afar takes so much less time than a ray; a guess. */
enum { LOOKS_A_RAY = 4 };

struct gatherer {
	const struct ff_job *job;
	struct ff_reciprocal *to;
	uint32_t **hits;           /* [threads][2P] of the element-side at work */
	struct array *met;         /* [threads] uint32_t: patch-sides hit by it */
	struct array *pairs;       /* [patches] struct pair, by place */
	uint32_t *pairs_of;          /* [2E] pairs of an element-side, by place */
	struct ff_landings *landings; /* of patches [begin, end) */
	uint32_t begin, end;
	int useful;                /* rows are made of pairs, too; else landings alone are kept */
	double *rays;              /* [threads] cast */
	struct err *err;           /* [threads] */
};

struct pair {
	uint32_t source, count;
};

/* The rays of an element-side; how many escape, how many meet black sides. land: it is kept
 * where they land. */
static void cast(struct gatherer *g, uint32_t column, int land, int thread, uint32_t lost[2])
{
	const struct ff_job *j = g->job;
	uint64_t seed = rng_mix(rng_mix(j->o.seed + 1) ^ rng_mix(~(uint64_t)column));
	uint32_t seeds[FF_DIMS], *hits = g->hits[thread], rays = ff_reciprocal_rays(j, column >> 1);
	const struct ff_samples *samples = rays < j->o.gather ? &j->of_small : &j->of_reciprocal;
	struct ff_ray_batch b;

	for (int d = 0; d < FF_DIMS; d++)
		seeds[d] = rng_sobol_seed(seed, d);
	for (uint32_t first = 0; first < rays; first += RAY_BATCH) {
		uint32_t n = rays - first < RAY_BATCH ? rays - first : RAY_BATCH;
		ff_rays_from_element(j, samples, seeds, column, first, n, &b);
		if (land)
			ff_landings_fetch(g->landings, n, &b);
		for (uint32_t i = 0; i < n; i++) {
			if (b.ray.triangle[i] == RAY_MISS) {
				lost[0]++;
				continue;
			}
			uint32_t ps = 2 * j->m->element.patch[b.hit[i]] + b.ray.side[i];
			lost[1] += j->is_black[ps];
			if (j->shoots_diffuse[ps] && hits[ps]++ == 0)
				mem_append(&g->met[thread], &ps, 1, sizeof ps, &g->err[thread]);
			if (land)
				g->rays[thread] += ff_landings_add(g->landings, column, &b, i, thread,
				                                   &g->err[thread]);
		}
	}
}

static void gather_element(struct gatherer *g, uint32_t patch, uint32_t column, int land,
                           int thread)
{
	struct array *met = &g->met[thread];
	uint32_t lost[2] = { 0 }, ps = 2 * patch + (column & 1);
	double part = g->job->m->element.area[column >> 1] /
	              (g->job->m->patch.area[patch] * ff_reciprocal_rays(g->job, column >> 1));

	met->n = 0;
	if (land)
		ff_landings_begin(g->landings, column, ff_reciprocal_rays(g->job, column >> 1), thread);
	cast(g, column, land, thread, lost);
	if (land)
		ff_landings_end(g->landings, column, lost[0] + lost[1]);
	g->rays[thread] += ff_reciprocal_rays(g->job, column >> 1);
	g->to->escape[ps] += part * lost[0];
	g->to->black[ps] += part * lost[1];
	if (!g->job->is_ideal[ps])
		g->pairs_of[g->job->places.place[column] & ~TALLY_APART] = (uint32_t)met->n;
	for (size_t i = 0; i < met->n; i++) {
		uint32_t source = ((uint32_t *)met->data)[i];
		struct pair p = { source, g->hits[thread][source] };
		g->hits[thread][source] = 0;
		if (g->useful && !g->job->is_ideal[ps])
			mem_append(&g->pairs[patch], &p, 1, sizeof p, &g->err[thread]);
	}
}

static void gather_patches(void *arg, size_t begin, size_t end, int thread)
{
	struct gatherer *g = arg;
	const struct ff_job *j = g->job;

	for (uint32_t ps = 2 * (uint32_t)begin; ps < 2 * end; ps++) {
		int land = ps >> 1 >= g->begin && ps >> 1 < g->end;
		if (j->is_black[ps] || (j->is_ideal[ps] && !land))
			continue;
		for (uint32_t el = j->m->patch.start[ps >> 1]; el < j->m->patch.start[(ps >> 1) + 1]; el++)
			gather_element(g, ps >> 1, 2 * el + (ps & 1), land, thread);
	}
}

static int is_by_formula(const struct ff_job *j, uint32_t ps)
{
	return ff_formula_has(&j->formula, ps) && (j->formula.all || j->emits[ps]);
}

static int takes(double patch_area, uint32_t cast, double element_area, uint32_t rays)
{
	return patch_area >= larger * element_area &&
	       rays * patch_area >= enough * cast * element_area;
}

/* Pairs by receiver, in order, become lists by source, in the same order. */
static int transpose(struct gatherer *g, struct err *e)
{
	struct ff_reciprocal *to = g->to;
	size_t patches = g->job->m->patch.n, sides = 2 * patches, place = 0;

	for (size_t p = 0; p < patches; p++)
		for (size_t i = 0; i < g->pairs[p].n; i++)
			to->start[((struct pair *)g->pairs[p].data)[i].source + 1]++;
	for (size_t ps = 0; ps < sides; ps++)
		to->start[ps + 1] += to->start[ps];
	to->hits = mem_new(to->start[sides], sizeof *to->hits, "gathered light", e);
	if (!to->hits)
		return -1;
	for (size_t p = 0; p < patches; p++) {
		const struct pair *pair = g->pairs[p].data, *last = pair + g->pairs[p].n;
		for (; place < 2 * (size_t)g->job->m->patch.start[p + 1]; place++)
			for (uint32_t k = g->pairs_of[place]; k && pair < last; k--, pair++)
				to->hits[to->start[pair->source]++] = (struct ff_receiver_hits){
					g->job->places.column[place], pair->count };
		free(g->pairs[p].data);
		g->pairs[p] = (struct array){ 0 };
	}
	memmove(to->start + 1, to->start, sides * sizeof *to->start);
	to->start[0] = 0;
	return 0;
}

/* Centres, weighted by area, and radii of patches. */
static void bound_patches(const struct ff_job *j, double (*centre)[4])
{
	const struct model *m = j->m;

	for (size_t i = 0; i < 3 * m->element.n; i++) {
		uint32_t p = m->element.patch[i / 3];
		v3_mad(centre[p], m->element.area[i / 3] / (3 * m->patch.area[p]),
		       &m->vertex[3 * (size_t)m->element.corner[i]], centre[p]);
	}
	for (size_t i = 0; i < 3 * m->element.n; i++) {
		double *c = centre[m->element.patch[i / 3]], d[3];
		v3_sub(&m->vertex[3 * (size_t)m->element.corner[i]], c, d);
		c[3] = fmax(c[3], v3_length(d));
	}
}

static int any_ideal(const struct ff_job *j)
{
	for (size_t ps = 0; ps < 2 * j->m->patch.n; ps++)
		if (j->is_ideal[ps])
			return 1;
	return 0;
}

static int allocate(struct gatherer *g, size_t threads, struct err *e)
{
	size_t patches = g->job->m->patch.n, sides = 2 * patches;
	struct ff_reciprocal *to = g->to;
	int good = 1;

	g->hits = mem_new(threads, sizeof *g->hits, "gathering", e);
	g->met = mem_new(threads, sizeof *g->met, "gathering", e);
	g->err = mem_new(threads, sizeof *g->err, "gathering", e);
	g->rays = mem_new(threads, sizeof *g->rays, "gathering", e);
	g->pairs = mem_new(patches, sizeof *g->pairs, "gathering", e);
	g->pairs_of = mem_new(2 * g->job->m->element.n, sizeof *g->pairs_of, "gathering", e);
	to->start = mem_new(sides + 1, sizeof *to->start, "gathered light", e);
	to->centre = mem_new(patches, sizeof *to->centre, "gathered light", e);
	to->escape = mem_new(sides, sizeof *to->escape, "gathered light", e);
	to->black = mem_new(sides, sizeof *to->black, "gathered light", e);
	for (size_t t = 0; g->hits && t < threads; t++)
		good &= (g->hits[t] = mem_new(sides, sizeof **g->hits, "gathering", e)) != NULL;
	return good && g->hits && g->met && g->err && g->rays && g->pairs && g->pairs_of && to->start &&
	       to->centre && to->escape && to->black ? 0 : -1;
}

static void release(struct gatherer *g, size_t threads)
{
	for (size_t t = 0; t < threads; t++) {
		if (g->hits)
			free(g->hits[t]);
		if (g->met)
			free(g->met[t].data);
	}
	for (size_t p = 0; g->pairs && p < g->job->m->patch.n; p++)
		free(g->pairs[p].data);
	free(g->hits);
	free(g->met);
	free(g->err);
	free(g->rays);
	free(g->pairs);
	free(g->pairs_of);
}

/* Whether the largest patch-side that shoots is large beside the smallest element. */
static int any_takes(const struct ff_job *j)
{
	double most = 0, least = INFINITY;

	for (size_t ps = 0; ps < 2 * j->m->patch.n; ps++)
		if (j->shoots_diffuse[ps])
			most = fmax(most, j->m->patch.area[ps >> 1]);
	for (size_t i = 0; i < j->m->element.n; i++)
		least = fmin(least, j->m->element.area[i]);
	return takes(most, j->o.rays, least, j->o.gather);
}

/* Rows by formula are made of shares too, whatever their sizes. */
static int any_by_formula(const struct ff_job *j)
{
	for (uint32_t ps = 0; ps < 2 * j->m->patch.n; ps++)
		if (is_by_formula(j, ps))
			return 1;
	return 0;
}

/* That a side of a patch's elements casts. */
static double patch_rays(const struct ff_job *j, uint32_t patch)
{
	double n = 0;

	for (uint32_t i = j->m->patch.start[patch]; i < j->m->patch.start[patch + 1]; i++)
		n += ff_reciprocal_rays(j, i);
	return n;
}

int ff_reciprocal_cast(struct ff_job *j, uint32_t begin, uint32_t end, double *rays,
                       const struct progress *progress, struct err *e)
{
	size_t threads = j->o.threads > 0 ? (size_t)j->o.threads : 1;
	struct gatherer g = { .job = j, .to = &j->reciprocal, .landings = &j->landings,
	                      .begin = begin, .end = j->o.to_patches ? begin : end };
	int bad;

	g.useful = j->o.method != FF_HEMICUBE && (any_takes(j) || any_by_formula(j));
	if (!g.useful && j->o.to_patches)
		return 0;
	bad = (!j->o.to_patches && ff_landings_init(&j->landings, j, e)) || allocate(&g, threads, e);
	if (!bad) {
		par_for(j->m->patch.n, 1, (int)threads, gather_patches, &g, progress);
		bound_patches(j, j->reciprocal.centre);
		j->reciprocal.alone = !any_ideal(j);
	}
	for (size_t t = 0; !bad && t < threads; t++) {
		*rays += g.rays[t];
		if (g.err[t].set)
			bad = err_set(e, "%s", g.err[t].text);
	}
	bad = bad || (g.useful && transpose(&g, e));
	release(&g, threads);
	j->reciprocal.rays = bad || !g.useful ? 0 : j->o.gather;
	return bad ? -1 : 0;
}

void ff_reciprocal_free(struct ff_reciprocal *g)
{
	free(g->start);
	free(g->hits);
	free(g->centre);
	free(g->escape);
	free(g->black);
	*g = (struct ff_reciprocal){ 0 };
}

/* ---- rows of what was gathered ---- */

static int element_takes(const struct ff_job *j, uint32_t ps, uint32_t column)
{
	return takes(j->m->patch.area[ps >> 1], j->o.rays >> (j->halvings ? j->halvings[ps] : 0),
	             j->m->element.area[column >> 1], ff_reciprocal_rays(j, column >> 1));
}

/* 1 if the row of a patch-side is made with point pairs (ff_emitter_row): an emitter's, unless
 * looking at every element costs more than the row's rays. */
static int ff_row_is_of_emitter(const struct ff_job *j, uint32_t ps)
{
	return is_by_formula(j, ps) ||
	       (j->emits[ps] &&
	        j->m->element.n <= LOOKS_A_RAY * (uint64_t)j->o.rays * j->o.emitter_gain);
}

int ff_row_is_reciprocal(const struct ff_job *j, uint32_t ps)
{
	const struct ff_reciprocal *g = &j->reciprocal;
	uint64_t i = g->start[ps], end = g->start[ps + 1];

	if (!g->alone || j->has_lobe[ps])
		return 0;
	if (ff_row_is_of_emitter(j, ps))
		return 1;
	if (i == end)
		return 0;
	while (i < end && element_takes(j, ps, g->hits[i].column))
		i++;
	return i == end;
}

/* F[ps -> element-side] from what was gathered, as ff_emitter_row gives it. */
static double reciprocal_shares(struct ff_thread *t, uint32_t ps)
{
	const struct ff_job *j = t->job;
	const struct ff_reciprocal *g = &j->reciprocal;
	double sum = 0;

	t->shares.n = 0;
	for (uint64_t i = g->start[ps]; i < g->start[ps + 1]; i++) {
		uint32_t element = g->hits[i].column >> 1;
		double n = g->hits[i].count, rays = ff_reciprocal_rays(j, element);
		double one = j->m->element.area[element] / (j->m->patch.area[ps >> 1] * rays);
		struct ff_share s = { g->hits[i].column, one * n, one * one * n * (1 - n / rays) };
		if (!element_takes(j, ps, s.column))
			continue;
		if (mem_append(&t->shares, &s, 1, sizeof s, &t->tally.err))
			return 0;
		sum += s.w;
	}
	return sum;
}

/* The next place at or after `place` whose weight the row's own rays do not decide. */
static uint32_t next_taken(const struct ff_thread *t, uint32_t ps, uint64_t place)
{
	const struct ff_job *j = t->job;
	uint32_t at = ff_tally_next(&t->tally, place);

	while (at != UINT32_MAX && (j->is_ideal[ff_tally_side_at(&t->tally, at)] ||
	                            !(ff_row_is_of_emitter(j, ps) || element_takes(j, ps, j->places.column[at]))))
		at = ff_tally_next(&t->tally, (uint64_t)at + 1);
	return at;
}

/* The part of the row that its own rays bring to elements whose shares are taken from
 * elsewhere. */
static double own_landed(const struct ff_thread *t, uint32_t ps, uint32_t cast)
{
	double sum = 0;

	for (uint32_t place = next_taken(t, ps, 0); place != UINT32_MAX;
	     place = next_taken(t, ps, (uint64_t)place + 1))
		sum += ff_tally_counted(&t->tally, place);
	return sum / cast;
}

/* What shares of elements add up to, and how sure it is. */
struct share_sum {
	double sum, variance;
	double doubt;             /* summed standard errors */
	double sample;            /* what one sample of the row weighs: its light on elements, per
	                             area, has the variance of so many independent ones */
};

static struct share_sum add_up(const struct ff_thread *t, double sum)
{
	const struct ff_share *s = t->shares.data;
	struct share_sum a = { .sum = sum };
	double light = 0, spread = 0;

	for (size_t i = 0; i < t->shares.n; i++) {
		double area = t->job->m->element.area[s[i].column >> 1];
		a.variance += s[i].variance;
		a.doubt += sqrt(s[i].variance);
		light += s[i].w / area;
		spread += s[i].variance / area;
	}
	a.sample = light > 0 ? spread / light : 0;
	return a;
}

/* The part of a row that lands on elements, of which so many rays say `lands`: the mean of
 * that and of what the elements' shares add up to, each for as much as it is certain. Where
 * no ray goes elsewhere, so it is, if the shares do not surely deny it. */
static double combine_landed(double lands, double rays, const struct share_sum *a)
{
	double own = fmax(lands * (1 - lands), 1 / rays) / rays;

	if (lands >= 1 && fabs(1 - a->sum) <= certain * a->doubt)
		return 1;
	return fmin(1, (lands * a->variance + a->sum * own) / (a->variance + own));
}

/* Where no ray of the row's own tells from where light comes to a lobe. */
static void guess_arrival(struct ff_thread *t, uint32_t ps, uint32_t target)
{
	double *toward = t->tally.toward[target];

	if (t->job->has_lobe[target] && !(v3_dot(toward, toward) > 0))
		v3_sub(t->job->reciprocal.centre[ps >> 1], t->job->reciprocal.centre[target >> 1], toward);
}

/* The shares, scaled, in place of what the row's own rays say of the same elements. */
static void put_shares(struct ff_thread *t, uint32_t ps, double scale)
{
	const struct ff_job *j = t->job;
	const struct ff_share *s = t->shares.data;

	for (uint32_t place = next_taken(t, ps, 0); place != UINT32_MAX;
	     place = next_taken(t, ps, (uint64_t)place + 1))
		ff_tally_set(&t->tally, place, 0, 0);
	for (size_t i = 0; i < t->shares.n; i++) {
		ff_tally_set(&t->tally, j->places.place[s[i].column] & ~TALLY_APART, scale * s[i].w,
		             scale * scale * s[i].variance);
		guess_arrival(t, ps, 2 * j->m->element.patch[s[i].column >> 1] + (s[i].column & 1));
	}
}

/* Of what does not land, how much escapes and how much meets black sides, as the rays of the
 * patch's elements say. */
static void book_lost(struct ff_thread *t, uint32_t ps, double lost)
{
	double escape = t->job->reciprocal.escape[ps], black = t->job->reciprocal.black[ps];
	double part = escape + black > 0 ? black / (escape + black) : 0;

	*ff_tally_rest(&t->tally, 0) = (struct tally_rest){ .escape = lost * (1 - part),
	                                                 .black = lost * part };
}

/* What rays say of all that lands; how many they are. */
static double landing(const struct ff_thread *t, uint32_t ps, uint32_t cast, double *rays)
{
	const struct ff_job *j = t->job;

	*rays = cast ? cast / t->boost : patch_rays(j, ps >> 1);
	return cast ? own_landed(t, ps, cast) : 1 - j->reciprocal.escape[ps] - j->reciprocal.black[ps];
}

int ff_combine_estimates(struct ff_thread *t, uint32_t ps, uint32_t cast, struct ff_weight *w)
{
	const struct ff_job *j = t->job;
	int of_emitter = ff_row_is_of_emitter(j, ps);
	double sum = of_emitter ? ff_emitter_row(t, ps, ff_row_rays(j, ps), &t->tally.err)
	                        : reciprocal_shares(t, ps);
	struct share_sum a = add_up(t, sum);
	double rays, said = landing(t, ps, cast, &rays), lands = combine_landed(said, rays, &a);
	double per_sample = a.sample / (of_emitter ? 1 : worth(j->reciprocal.rays));

	if (t->tally.err.set || !(lands > 0 && sum > 0) ||
	    fabs(sum - said) > misfit * said + unlikely * sqrt(fmax(sum, said) / rays))
		return 0;
	/* What rays brought elsewhere stays as it is: the whole is what makes that 1 - lands. */
	double total = !cast ? 1 : said < 1 && lands < 1 ? cast * (1 - said) / (1 - lands) : cast;
	if (!cast)
		book_lost(t, ps, 1 - lands);
	put_shares(t, ps, total * lands / sum);
	per_sample += cast ? (1 - lands) / rays : 0;
	*w = (struct ff_weight){ (uint32_t)fmax(1, fmin(UINT32_MAX, 1 / per_sample)), total };
	return 1;
}
