#define _GNU_SOURCE
#include "lib/base/parallel.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#if defined(__SSE__)
#include <xmmintrin.h>
#endif

/* A count, which bounds arrays on the stack: a guess at the processors of any one machine. */
enum { MAX_THREADS = 256 };

struct loop {
	atomic_size_t next, done;
	size_t n, chunk;
	par_fn *fn;
	void *arg;
	const struct progress *progress;
};

struct worker {
	struct loop *loop;
	int thread;
};

static void flush_denormals(void)
{
#if defined(__SSE__)
	_mm_setcsr(_mm_getcsr() | 0x8040u); /* FTZ and DAZ, which Embree asks for */
#endif
}

static void *work(void *p)
{
	struct worker *w = p;
	struct loop *l = w->loop;

	flush_denormals();
	for (;;) {
		size_t begin = atomic_fetch_add(&l->next, l->chunk);
		if (begin >= l->n)
			return NULL;
		size_t end = l->n - begin < l->chunk ? l->n : begin + l->chunk;
		l->fn(l->arg, begin, end, w->thread);
		size_t done = atomic_fetch_add(&l->done, end - begin) + (end - begin);
		/* Only the calling thread reports, so reports never overlap. */
		if (w->thread == 0 && l->progress && l->progress->fn)
			l->progress->fn(l->progress->arg, (double)done, (double)l->n);
	}
}

void par_for(size_t n, size_t chunk, int threads, par_fn *fn, void *arg,
             const struct progress *progress)
{
	struct loop l = { .n = n, .chunk = chunk ? chunk : 1, .fn = fn, .arg = arg,
	                  .progress = progress };
	struct worker w[MAX_THREADS];
	pthread_t id[MAX_THREADS];
	int started = 1;

	if (threads > MAX_THREADS)
		threads = MAX_THREADS;
	w[0] = (struct worker){ &l, 0 };
	for (int t = 1; t < threads && (size_t)t < (n + l.chunk - 1) / l.chunk; t++) {
		w[t] = (struct worker){ &l, t };
		if (pthread_create(&id[t], NULL, work, &w[t]))
			break; /* fewer threads do the same work */
		started++;
	}
	work(&w[0]);
	for (int t = 1; t < started; t++)
		pthread_join(id[t], NULL);
}

int par_cpus(void)
{
	cpu_set_t set;
	int n = 1;

	if (sched_getaffinity(0, sizeof set, &set) == 0)
		n = CPU_COUNT(&set);
	return n < 1 ? 1 : n > MAX_THREADS ? MAX_THREADS : n;
}
