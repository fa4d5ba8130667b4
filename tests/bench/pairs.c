/* Stated against true: exchange areas of random pairs of polygons with things between, at several
 * tolerances. pairs FIRST COUNT: seeds. Prints a table; with -v the pairs that are off, too. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "tests/unit/fixtures/random_pairs.h"

enum { TARGETS = 4 };

static struct brute brute;
static struct exchanger exchanger;

/* What was found of one target. */
struct found {
	double *ratio;                /* [pairs] of the true error to max(stated, target) */
	size_t beyond_stated, beyond; /* pairs off by more than stated; than both */
	double seconds, evaluations;
};

static double seconds(void)
{
	struct timespec t;

	clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
	return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

/* Compares a pair; what the truth itself may be off by counts for nothing. */
static void compare(struct random_pair *p, double target, struct found *found, size_t at)
{
	struct exchange_options o = { .relative = 1e-9, .absolute = target, .most = 50000,
	                              .occluders = SHAFT_OCCLUDERS };
	struct err e = { 0 };
	double stated;

	occ_exchanger_init(&exchanger, &o, &p->bodies, NULL, p->centre);
	double begun = seconds();
	double got = occ_exchange(&exchanger, &p->s, p->f, &p->s, p->g, &stated, &e);
	found->seconds += seconds() - begun;
	found->evaluations += exchanger.counts.evaluations;
	double off = fmax(0, fabs(got - p->truth) - p->doubt);
	found->ratio[at] = off > 0 ? off / fmax(stated, 1e-12 * p->least) : 0;
	found->beyond_stated += off > stated;
	found->beyond += off > fmax(stated, target * p->least);
	occ_exchanger_free(&exchanger);
}

int main(int argc, char **argv)
{
	uint64_t first = argc > 1 ? strtoull(argv[1], NULL, 10) : 1;
	size_t count = argc > 2 ? (size_t)strtoull(argv[2], NULL, 10) : 100;
	int talk = argc > 3 && strcmp(argv[3], "-v") == 0;
	struct found found[TARGETS] = { 0 };

	for (int t = 0; t < TARGETS; t++)
		if (!(found[t].ratio = calloc(count + 1, sizeof(double))))
			return 1;
	for (size_t k = 0; k < count; k++) {
		struct random_pair p;
		if (random_pair_init(&p, first + k, &brute, 1e-6))
			return 1;
		for (int t = 0; t < TARGETS; t++) {
			size_t beyond = found[t].beyond;
			compare(&p, pow(10, -3 - t), &found[t], k);
			if (talk && found[t].beyond > beyond)
				printf("seed %lu -t 1e-%d\n", (unsigned long)(first + k), 3 + t);
		}
		random_pair_free(&p);
	}
	printf("| `-t` | evaluations | µs | median | 90 %% | 99 %% | most | beyond stated | "
	       "beyond both |\n|---|---|---|---|---|---|---|---|---|\n");
	for (int t = 0; t < TARGETS; t++) {
		struct found *f = &found[t];
		qsort(f->ratio, count, sizeof *f->ratio, by_size);
		printf("| 1e-%d | %.0f | %.0f | %.3f | %.3f | %.3f | %.3f | %zu of %zu | %zu |\n", 3 + t,
		       f->evaluations / (double)count, 1e6 * f->seconds / (double)count,
		       f->ratio[count / 2], f->ratio[count * 9 / 10], f->ratio[count * 99 / 100],
		       f->ratio[count - 1], f->beyond_stated, count, f->beyond);
		free(f->ratio);
	}
	return 0;
}
