/* Imprints: triangles are cut along the lines where others cross them or stand on them,
 * so that no element has one part in front of a wall and one behind it. The parts of
 * mesh_imprint() in stages.h, in the order in which it calls them. */
#ifndef TWOPASS_IMPRINT_H
#define TWOPASS_IMPRINT_H

#include "lib/base/mem.h"
#include "lib/data/model.h"
#include "lib/geometry/half_edge.h"
#include "lib/mesh/mesher.h"

struct imprint_limits {
	double size;      /* of elements: triangles with no longer edge are left alone, m */
	double thick;     /* what lies this close to a plane lies in it, m */
	double close;     /* so does what stays on one side of it this close: so little light
	                     comes between that elements show none of it, m */
	double apart;     /* points of a cut this close are one, m */
	double shortest;  /* contacts along shorter pieces of the other triangle are left out, m */
	double fine;      /* the same of an emitter, or of the border of one in the same plane, m */
};

/* A segment in the plane of a triangle, within the triangle. */
struct contact {
	uint32_t triangle;
	double end[2][3];
};

struct contacts {
	struct array list;  /* struct contact, by triangle */
	size_t fine;      /* left out for being too short */
};

double mesh_longest_edge(const struct model *m, size_t triangle);

/* contacts.c: appends the contacts of all triangles longer than the elements, each found
 * once or more. g: edges of m->triangle. O(n log n + candidates). 0, or -1 and e. */
int mesh_find_contacts(const struct model *m, const struct half_edges *g,
                       const struct imprint_limits *limits, struct contacts *out, struct err *e);

/* A part of an input triangle. Half-edge 3 piece + k leads from v[k] to v[k+1]. */
struct piece {
	uint32_t v[3];
	uint32_t across[3];   /* half-edge of the same input triangle, or RIM */
	uint32_t rim[3];      /* edge of the input mesh, where across is RIM */
	uint32_t triangle;    /* input triangle */
	uint32_t next;        /* further part of it, or RIM */
	uint8_t line[3];      /* 1: a contact runs along it */
};

#define RIM UINT32_MAX

struct pieces {
	struct array vertex;  /* double[3] */
	struct array piece;   /* the first m->triangles are the first parts of each */
	size_t cut;           /* input triangles with contacts */
};

/* constrain_edges.c: divides the triangles of m so that their contacts are edges of pieces, flipped
 * towards Delaunay's criterion and refined elsewhere. No vertex ever lies inside an edge of
 * its surface. O(contacts x pieces of a triangle) at worst. p zeroed, to be freed in any
 * case. 0, or -1 and e. */
int mesh_constrain_edges(const struct model *m, const struct half_edges *g,
                         const struct contacts *c,
                         const struct imprint_limits *limits, struct pieces *p, struct err *e);

/* imprint_replace.c: pieces become the triangles of m, their vertices its vertices. These are
 * doubled along lines, so that nothing that follows shared edges or vertices crosses them.
 * *lines = edges of pieces along lines. 0, or -1 and e. O(n log n). */
int mesh_imprint_replace(struct model *m, struct pieces *p, size_t *lines, struct err *e);

/* coplanar.c: drops triangles that an opaque, smaller surface covers in their plane, and counts
 * them in the report. O(n log n + candidates). 0, or -1 and e. */
int mesh_drop_covered(struct model *m, const struct imprint_limits *limits,
                      struct mesh_report *r, struct err *e);

#endif
