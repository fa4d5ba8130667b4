/* Following one camera ray and its specular tail: the recursion of equation (1) (view.h). Each
 * surface met adds weight (L_e + M / pi); each of its lobes goes on as a branch whose weight
 * is that of the ray so far times f_s cos / density (1 for an ideal event, times its
 * coefficient). Behind a lobe that is sampled, what carries little goes on by chance. */
#ifndef TWOPASS_SPECULAR_PATH_H
#define TWOPASS_SPECULAR_PATH_H

#include "lib/view/specular_stack.h"

/* First surface seen. */
struct view_first {
	uint32_t element;           /* RAY_MISS where nothing */
	double point[3], normal[3];
};

/* Follows the camera ray b, of which org, dir, index and seed are given, and adds
 * the radiance it brings to w's parts. b is overwritten. */
void view_follow(struct view_walker *w, struct view_branch *b);

/* The surface the ray meets first. */
void view_first_seen(const struct view_scene *v, const double org[3], const double dir[3],
                     struct view_first *first);

#endif
