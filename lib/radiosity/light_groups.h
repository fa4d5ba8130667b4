/* Light groups: emitters whose light is kept apart, so that it can be mixed anew without
 * solving again. */
#ifndef TWOPASS_LIGHT_GROUPS_H
#define TWOPASS_LIGHT_GROUPS_H

#include "lib/base/err.h"

struct model;
struct solution;

/* The name of the only group where emitters are not kept apart. */
#define LIGHT_GROUP_ALL "all"

/* Sets groups, group_name, emitters and emitter_group of a solution: one group for each
 * material that gives light somewhere and each punctual light, if `apart`, else one for
 * all. Groups are called after their materials and lights, with #2, #3, ... where names
 * repeat. 0, or -1 and e. */
int radiosity_groups_set(struct solution *s, const struct model *m, int apart, struct err *e);

/* Scales the light of groups: "NAME=F,NAME=F:F:F,...", a factor >= 0 for all bands or one
 * for each. Irradiance and what its materials and lights emit are scaled; stated errors
 * keep their ratio to the irradiance. What was unshot is no longer of use. 0, or -1
 * and e with the names there are. O(groups x element sides). */
int radiosity_groups_mix(struct solution *s, struct model *m, const char *mix, struct err *e);

#endif
