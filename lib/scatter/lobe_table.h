/* The normaliser of one lobe, for many angles: interpolated. */
#ifndef TWOPASS_LOBE_TABLE_H
#define TWOPASS_LOBE_TABLE_H

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

#endif
