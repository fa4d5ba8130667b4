/* Form factors and solutions in memory, from a model to its irradiance. */
#ifndef TWOPASS_TEST_SOLVED_H
#define TWOPASS_TEST_SOLVED_H

#include "../../lib/radiosity.h"
#include "memory_ff.h"

/* Must stay where it is made: the transport points into it. */
struct solved {
	struct ff f;
	const struct ff *shard[1];
	struct transport t;
	struct solution s;
	struct radiosity_report r;
	struct err e;
};

/* Transport of form factors, which go over to x; NULL: computed with o. */
static inline void solved_join(struct solved *x, const struct model *m, const struct ff_options *o,
                               const struct ff *f)
{
	static const char *const name[] = { "memory" };
	struct ff_stats stats;

	*x = (struct solved){ 0 };
	if (f)
		x->f = *f;
	else
		memory_ff(m, o, &x->f, &stats);
	x->shard[0] = &x->f;
	assert_int_equal(transport_init(&x->t, m, x->shard, name, 1, 2, &x->e), 0);
}

/* And a solution with all light unshot, with light groups or without. */
static inline void solved_begin(struct solved *x, const struct model *m,
                                const struct ff_options *o, int groups)
{
	solved_join(x, m, o, NULL);
	assert_int_equal(solution_begin(&x->s, m, &x->t, groups, &x->e), 0);
}

static inline int solved_shoot(struct solved *x, double stop)
{
	struct radiosity_options o = { stop, UINT64_MAX, 2 };

	return radiosity_shoot(&x->s, &x->t, &o, NULL, &x->r, &x->e);
}

static inline void solved_gather(struct solved *x)
{
	assert_int_equal(radiosity_gather(&x->s, &x->t, 2, &x->r, &x->e), 0);
}

static inline void solved_finish(struct solved *x, double stop)
{
	if (solved_shoot(x, stop))
		fail_msg("%s", x->e.text);
	solved_gather(x);
}

/* The area mean of the irradiance of a patch-side. */
static inline double patch_mean(const struct model *m, const struct solution *s, uint32_t ps,
                                int band)
{
	uint32_t p = ps >> 1;
	double h = 0;

	for (uint32_t i = m->patch_start[p]; i < m->patch_start[p + 1]; i++)
		h += solution_irradiance(s, 2 * i + (ps & 1), band) * m->element_area[i] /
		     m->patch_area[p];
	return h;
}

static inline void solved_free(struct solved *x)
{
	solution_free(&x->s);
	transport_free(&x->t);
	ff_free(&x->f);
}

#endif
