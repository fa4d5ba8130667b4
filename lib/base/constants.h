/* Numbers that every folder means the same by. */
#ifndef TWOPASS_CONSTANTS_H
#define TWOPASS_CONSTANTS_H

#define PI 3.14159265358979323846

/* Cosine of the crease angle, 30 degrees: where normals of neighbouring triangles differ by
 * more, a surface has an edge, and nothing is interpolated across it. A guess: facets of a
 * cylinder of 12 sides or more join, boxes and prisms of up to 11 keep their edges. */
#define COS_CREASE .86602540378443865

#endif
