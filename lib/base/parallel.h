/* Parallel loops whose results do not depend on the number of threads. */
#ifndef TWOPASS_PARALLEL_H
#define TWOPASS_PARALLEL_H

#include <stddef.h>

/* Work on items [begin, end); `thread` in [0, threads) selects scratch space. */
typedef void par_fn(void *arg, size_t begin, size_t end, int thread);

/* Called now and then, never from two threads at once, with done out of total. */
struct progress {
	void (*fn)(void *arg, double done, double total);
	void *arg;
};

/* Runs fn over [0, n) in chunks taken from a common counter. Which thread
 * gets a chunk is not defined, so fn must write only what its items own.
 * Each thread runs with denormals flushed. progress may be NULL. */
void par_for(size_t n, size_t chunk, int threads, par_fn *fn, void *arg,
             const struct progress *progress);

/* Processors this process may use, at least 1. */
int par_cpus(void);

#endif
