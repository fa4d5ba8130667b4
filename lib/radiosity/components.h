/* Which patch-sides light can pass between, and whether it can end anywhere. */
#ifndef TWOPASS_COMPONENTS_H
#define TWOPASS_COMPONENTS_H

#include "lib/radiosity/transport.h"

struct components {
	uint32_t n;
	uint32_t *of;        /* [2P+L] component of a patch-side or light */
};

/* Patch-sides joined by any row, or by transmission through the patch itself.
 * O(runs). 0, or -1 and e. */
int radiosity_components_init(struct components *c, const struct transport *t, struct err *e);
void radiosity_components_free(struct components *c);

/* 0 if all light can be absorbed or leave; else -1 and "no steady state", for light
 * of some band that reaches a closed part of albedo 1. O(runs x depth), but O(patches)
 * where no albedo is 1. */
int radiosity_components_need_sink(const struct transport *t, struct err *e);

#endif
