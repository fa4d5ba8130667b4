/* The normaliser of one lobe, for many angles: interpolated; and what needs it. */
#ifndef TWOPASS_LOBE_TABLE_H
#define TWOPASS_LOBE_TABLE_H

#include "lib/data/model.h"

/* A count of steps: a guess, with which unit test lobe finds the relative error below 1e-5. */
enum { LOBE_TABLE = 96 };

struct lobe_table {
	double k;
	double whole;                   /* N_k(0) */
	double end, per_step;           /* the cosine from which on that holds; steps up to it */
	double value[LOBE_TABLE + 3];   /* at -1 step, 0, ... end, one step beyond */
};

void bsdf_lobe_table_make(struct lobe_table *t, double k);

/* bsdf_lobe_normaliser(k, cos_theta), 0 <= cos_theta <= 1, to a relative error of 1e-5. */
double bsdf_lobe_table_normaliser(const struct lobe_table *t, double cos_theta);

/* f cos theta_i (bsdf.h) of a lobe of unit coefficient, for light from an angle of cosine cos_i that
 * leaves at one of cos_o, over the density of samples about its axis. */
double bsdf_lobe_table_weight(const struct lobe_table *t, enum lobe_kind kind, double cos_o,
                              double cos_i);

/* Where light may have come from that a lobe sends to the eye: a sample, out, about the axis as seen
 * from there, at an angle of cosine cos_o to n, the unit normal of the side that it arrives on; and
 * its weight as above, 0 below the horizon. */
double bsdf_lobe_table_sample(const struct lobe_table *t, enum lobe_kind kind, const double axis[3],
                              const double n[3], double cos_o, const double u[2], double out[3]);

#endif
