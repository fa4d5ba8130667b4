/* Form factors of parallelograms far from one another: one cubature rule for both at once,
 * of 24 points in the four dimensions in place of 49 or more by products. */
#ifndef TWOPASS_JOINT_H
#define TWOPASS_JOINT_H

#include "facet.h"

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

#endif
