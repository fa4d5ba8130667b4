/* Form factors summed by receiving patch-side (private to transport*.c). */
#ifndef TWOPASS_TRANSPORT_RUNS_H
#define TWOPASS_TRANSPORT_RUNS_H

#include "lib/data/link_key.h"
#include "lib/radiosity/transport.h"

/* Fills run_target, run_sum, run_link and onward, and where each block's begin, from rows,
 * chains that are tied and links that are sorted. O(entries). 0, or -1 and e. */
int radiosity_transport_make_runs(struct transport *t, const struct link_key *link, int threads,
                                  struct err *e);

#endif
