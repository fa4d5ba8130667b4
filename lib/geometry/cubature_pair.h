/* Form factors of parallelograms far from one another: one cubature rule for both at once,
 * of 24 points in the four dimensions in place of 49 or more by products. */
#ifndef TWOPASS_CUBATURE_PAIR_H
#define TWOPASS_CUBATURE_PAIR_H

#include "lib/base/err.h"
#include "lib/geometry/facet.h"

/* Points of a parallelogram by coordinate: its centroid, towards its corners, towards its edges. */
struct joint {
	double skew;          /* how far corners are from a parallelogram's, by the radius */
	double centroid[3], corner[3][4], edge[3][4];
};

/* j->skew is INFINITY where the facet has not four corners. */
void joint_fill(const struct facet *f, struct joint *j);

/* 1 if the rule's relative error for two facets in front of one another is below
 * `tolerance`. */
int joint_reaches(const struct facet *a, const struct joint *ja, const struct facet *b,
                  const struct joint *jb, double tolerance);

/* Exchange area, m^2, of two parallelograms in front of one another. */
double joint_exchange(const struct facet *a, const struct joint *ja, const struct facet *b,
                      const struct joint *jb);

/* Facets by number, so that one can be paired with four that follow one another at a time. */
struct joint_table {
	size_t n;
	double tolerance;     /* relative error of exchange areas */
	double near;          /* what is not further in front of a facet sees none of it */
	double *row;          /* [JOINT_ONE / 4][n + 3] */
};

enum { JOINT_ONE = 148 };

int joint_table_new(const struct facet *f, const struct joint *j, size_t n, double tolerance,
                    double near, struct joint_table *t, struct err *e);
void joint_table_free(struct joint_table *t);

/* Facet i of the table as joint_four takes it. */
void joint_one(const struct joint_table *t, size_t i, double one[JOINT_ONE]);

/* Exchange areas, m^2, of a facet and facets j to j + 3 of the table, into x. Returns a bit for
 * each of them for which they hold: wholly in front of one another and within the rule's reach,
 * or one behind the other's plane (0). The facet is the first of each pair, with `swap` the
 * second: the sums are the same only for the same order. Past the table's end x means nothing. */
int joint_four(const struct joint_table *t, const double one[JOINT_ONE], size_t j, int swap,
               double x[4]);

#endif
