/* The stages of mesh_run, in the order in which it runs them. All return 0,
 * or -1 and an error. */
#ifndef TWOPASS_STAGES_H
#define TWOPASS_STAGES_H

#include "lib/geometry/weld.h"
#include "lib/mesh/division.h"
#include "lib/mesh/mesher.h"

/* degenerate.c: drops triangles without area, makes vertices surface by surface and
 * welds them. Vertices keep their order. */
int mesh_clean_degenerate(struct model *m, struct mesh_report *r, struct err *e);

/* A vertex of its own for each surface that uses it, in the order of the old
 * ones; group[v] becomes the surface of new vertex v, to be freed in any case. */
int mesh_clean_separate(struct model *m, uint32_t **group, struct err *e);

/* Removes the triangles with keep[t] = 0 from all triangle arrays. */
void mesh_clean_compact(struct model *m, const uint8_t *keep);

/* position[v] = number of the place of vertex v, the same for vertices of different surfaces
 * that coincide, to 2^-22 of the scene's diagonal: what float32 positions are off by once
 * their nodes have moved them. To be freed; NULL and e on failure. */
uint32_t *mesh_clean_positions(const struct model *m, size_t *places, struct err *e);

/* coincident.c: drops triangles, and pairs that make up the same plane quad,
 * which coincide with ones of lower index. */
int mesh_drop_coincident(struct model *m, const uint32_t *position, struct mesh_report *r,
                         struct err *e);

/* The side that dropped triangle t showed where the kept one in its place has its back:
 * twin[kept], as mesh_merge_coincident_sheets() wants it, unless that side is black. */
void mesh_note_twin(const struct model *m, uint32_t t, uint32_t kept, uint64_t *twin);

/* coincident_sheets.c: gives kept triangles of one-sided materials the side that their
 * dropped twin showed where the kept one's black back was. twin[t] = 1 +
 * 2 (surface of the twin) + side of the twin, or 0. Called before compaction;
 * keep[t] tells which triangles stay. */
int mesh_merge_coincident_sheets(struct model *m, const uint64_t *twin, const uint8_t *keep,
                                 struct mesh_report *r, struct err *e);

/* watertight.c: counts pieces, open edges and opposite windings. */
int mesh_check_watertight(const struct model *m, const uint32_t *position, size_t places,
                          struct mesh_report *r, struct err *e);

/* bisect.c: refuses a hopeless size before any work: no mesh of edges up to `size` has
 * fewer elements than its area over that of an equilateral triangle. */
int mesh_check_element_size(const struct model *m, double size, struct err *e);

/* imprint.c: cuts triangles longer than `size` along the lines where others cross them
 * or stand on them, and parts the surface there: see imprint.h. */
int mesh_imprint(struct model *m, double size, struct mesh_report *r, struct err *e);

/* bisect.c: fills elements (in no useful order) and split trees so that no
 * edge is longer than `size`. Always the longest edge of a surface is halved,
 * together with all triangles that share it. */
int mesh_bisect(struct model *m, double size, struct err *e);

/* near_lights.c: divides elements where light of an emitter varies over less than their longest
 * edge, close to its outline, or of a punctual light, down to a sixteenth of `size`. O(n log n) in the elements made, if
 * few lights are close to each. */
int mesh_divide_near_lights(struct model *m, double size, struct err *e);

/* Divides the elements of a model further, element i at least halvings[i] times, and its
 * neighbours where no edge would otherwise be halved. Replaces vertices, elements and split
 * trees; (*origin)[e] = the element that the new one was part of, to be freed. */
int mesh_bisect_further(struct model *m, const uint8_t *halvings, uint32_t **origin,
                        struct err *e);

/* adapt.c: how often each element and each patch is to be halved; fills what r says of it.
 * `smallest` in metres. O(elements + patches log patches). */
int mesh_adapt_plan(const struct model *m, const struct solution *s,
                    const struct mesh_refinement *how, double smallest, uint8_t *halvings,
                    uint8_t *patch_halvings, struct mesh_report *r, struct err *e);

/* adapt_patches.c: the centroid of a patch and its mean front normal, unit. */
struct patch_frame {
	double centre[3], normal[3];
};

/* [patches], to be freed; NULL and e on failure. O(elements). */
struct patch_frame *mesh_patch_frames(const struct model *m, struct err *e);

/* Sum over a patch-side and over bands of squared deviations of its exitance from its mean,
 * less what noise there is in them: in the square of exitance times area. */
double mesh_patch_deviations(const struct model *m, const struct solution *s, uint32_t patch,
                             int side);

/* Adds to energy[patches] what the differences of exitance within a patch, which it shoots as
 * if there were none, cost the surfaces next to it: in units of mesh_patch_deviations. 0, or -1
 * and e. */
int mesh_patch_energies(const struct model *m, const struct solution *s,
                        const struct patch_frame *frame, double *energy, struct err *e);

/* adapt_lobes.c: the same of what lobes of finite exponents light: they mirror a patch as if
 * its exitance were everywhere the same. O(uneven patch-sides x patch-sides with lobes). */
int mesh_lobe_energies(const struct model *m, const struct solution *s,
                       const struct patch_frame *frame, double *energy, struct err *e);

/* regions.c: sets region[t] of input triangles: connected pieces of one surface,
 * plane or bending by less than the cone at each edge. */
int mesh_find_regions(const struct model *m, double size, double cos_cone, uint32_t *region,
                      struct region **regions, size_t *count, struct err *e);

/* patch_merge.c: joins patches of one region that together are still small and flat
 * enough. O(n log n) for well-shaped patches. */
int mesh_merge_patches(const struct division *d, uint32_t *patch, size_t *count, struct err *e);

/* patches.c: divides regions into patches: patch[element], *count of them. */
int mesh_find_patches(const struct model *m, double size, double cos_cone, uint32_t *patch,
                      size_t *count, struct err *e);

/* Halves earlier patches, old[element], so many times, but not to fewer than a few elements.
 * The parts of a patch follow those of the patch before it. */
int mesh_split_patches(const struct model *m, double size, double cos_cone, const uint32_t *old,
                       size_t patches, const uint8_t *halvings, uint32_t *patch, size_t *count,
                       struct err *e);

/* morton_order.c: renumbers patches, elements and vertices along a Morton curve over
 * the scene's box and fills the patch arrays. */
int mesh_order_model(struct model *m, const uint32_t *patch, size_t patches, struct err *e);

/* The same for patches that keep their numbers; origin[element] moves with the elements. */
int mesh_order_elements(struct model *m, const uint32_t *patch, size_t patches, uint32_t *origin,
                        struct err *e);

/* outline.c: the loops of planar patches. Needs model_derive. */
int mesh_outline_patches(struct model *m, size_t *planar, struct err *e);

/* x rounded to 29 significant bits (Dekker's splitting), so that lengths which
 * differ by the rounding of a rotation compare equal. */
static inline double coarse(double x)
{
	double c = x * 0x1.000001p24;
	return c - (c - x);
}

#endif
