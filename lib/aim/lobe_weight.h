/* A finite lobe as a weight of directions. */
#ifndef TWOPASS_LOBE_WEIGHT_H
#define TWOPASS_LOBE_WEIGHT_H

#include "lib/occlusion/direct.h"
#include "lib/scatter/lobe_table.h"

/* A lobe that a ray meets. */
struct aim_lobe {
	double k, axis[3], normal[3];  /* normal: of the side that its light arrives on */
	const struct lobe_table *table;
	double cosine;                 /* of the axis to the normal */
	double x[3];                   /* the point, on its surface */
	uint32_t element, id;          /* id: 4 material + 2 side + transmitted */
	int side;                      /* that light arrives on */
	double other[BANDS_MAX];       /* radiance beside that the pixel shows, about */
};

/* The density that samples of a lobe are taken with, of solid angle. */
double aim_lobe_density(const struct aim_lobe *l, enum lobe_kind kind,
                         const double dir[3]);

/* lib/scatter/bsdf's f cos theta_i of a lobe with unit coefficient, over that density. */
double aim_lobe_per_density(const struct aim_lobe *l, enum lobe_kind kind, double cos_i);

/* The lobe as a weight of directions, for unit coefficient: f cos theta_i. l must outlive
 * it. */
struct aim_lobe_weight {
	const struct aim_lobe *l;
	enum lobe_kind kind;
};

/* weight: struct aim_lobe_weight. */
double aim_lobe_weight_at(const double dir[3], const void *weight);

struct direct_weight aim_lobe_weight(const struct aim_lobe_weight *w);

#endif
