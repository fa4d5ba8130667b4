/* Form factors of parallelograms far from one another: one cubature rule for both at once,
 * of 24 points in the four dimensions in place of 49 or more by products. */
#ifndef TWOPASS_CUBATURE_PAIR_H
#define TWOPASS_CUBATURE_PAIR_H

#include "lib/base/err.h"
#include "lib/geometry/facet.h"

/* Points of a parallelogram by coordinate: its centroid, those towards its corners and those
 * towards its edges. */
struct cubature_pair {
	double skew;          /* how far corners are from a parallelogram's, by the radius */
	double centroid[3], corner[3][4], edge[3][4];
};

/* j->skew is INFINITY where the facet has not four corners. */
void geo_pair_fill(const struct facet *f, struct cubature_pair *j);

/* 1 if the rule's relative error for two facets in front of one another is below
 * `tolerance`. */
int geo_pair_reaches(const struct facet *a, const struct cubature_pair *ja, const struct facet *b,
                     const struct cubature_pair *jb, double tolerance);

/* Exchange area, m^2, of two parallelograms in front of one another. */
double geo_pair_exchange(const struct facet *a, const struct cubature_pair *ja,
                         const struct facet *b, const struct cubature_pair *jb);

/* Facets by number, so that one can be paired with four that follow one another at a time. */
struct cubature_pair_table {
	size_t n;
	double tolerance;     /* relative error of exchange areas */
	double near;          /* m: what is not further in front of a facet sees none of it */
	double *row;          /* [PAIR_ONE / 4][n + 3] */
};

/* Numbers of one facet, 37 (a row each), four times over for vector code. */
enum { PAIR_ONE = 148 };

int geo_pair_table_new(const struct facet *f, const struct cubature_pair *j, size_t n,
                       double tolerance, double near, struct cubature_pair_table *t, struct err *e);
void geo_pair_table_free(struct cubature_pair_table *t);

/* Facet i of the table as geo_pair_four takes it. */
void geo_pair_one(const struct cubature_pair_table *t, size_t i, double one[PAIR_ONE]);

/* Exchange areas, m^2, of a facet and facets j to j + 3 of the table, into x. Returns a bit for
 * each of them for which they hold: wholly in front of one another and within the rule's reach,
 * or one behind the other's plane (0). The facet is the first of each pair, with `swap` the
 * second: the sums are the same only for the same order. Past the table's end x means nothing. */
int geo_pair_four(const struct cubature_pair_table *t, const double one[PAIR_ONE], size_t j,
                  int swap, double x[4]);

#endif
