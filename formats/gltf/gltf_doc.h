/* What the parts of the glTF reader hand to one another; not for other files.
 *
 *   gltf_source.c    bytes: the file, GLB chunks, buffers  -> struct gltf_source
 *   gltf_schema.c    types, ranges and references of the JSON (a table)
 *   gltf_load.cc     tinygltf: checked JSON                -> struct gltf_doc
 *   gltf_json.c      texts and objects of the JSON that several parts need
 *   gltf_accessor.c  elements of accessors
 *   gltf_check.c     layout of buffers, accessors and primitives
 *   gltf_nodes.c     the node graph and its matrices
 *   gltf_material.c  a material
 *   gltf_bands.c     all materials of the scene            -> struct materials
 *   gltf_lights.c    punctual lights                       -> struct lights
 *   gltf_scene.c     nodes: surfaces, triangles, cameras   -> struct model
 *   gltf_report.c    notes on what is not modelled
 */
#ifndef TWOPASS_GLTF_DOC_H
#define TWOPASS_GLTF_DOC_H

#include <jansson.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/gltf/gltf_file.h"

enum { GLTF_NONE = -1 };

enum gltf_mode {
	GLTF_POINTS, GLTF_LINES, GLTF_LINE_LOOP, GLTF_LINE_STRIP,
	GLTF_TRIANGLES, GLTF_STRIP, GLTF_FAN
};

enum gltf_component {
	GLTF_I8 = 5120, GLTF_U8, GLTF_I16, GLTF_U16, GLTF_U32 = 5125, GLTF_F32
};

struct gltf_view {
	size_t buffer, offset, length;
	size_t stride;             /* 0 = tightly packed */
};

/* Where elements lie: a view and an offset in it. */
struct gltf_place {
	int view;                  /* or GLTF_NONE */
	size_t offset;
	int component;             /* enum gltf_component */
};

struct gltf_accessor {
	struct gltf_place at;
	size_t count;
	int rows, columns;         /* VEC3 is 3 x 1 */
	int normalised;
	size_t sparse;             /* number of replaced elements, 0 = none */
	struct gltf_place index, value;
};

struct gltf_primitive {
	int mode, material, indices;
	int position, normal, uv;  /* accessors or GLTF_NONE */
};

struct gltf_mesh {
	size_t primitive, primitives; /* first, count */
};

struct gltf_node {
	int mesh, camera;
	size_t child, children;    /* first in gltf_doc.child, count */
	int has_matrix;
	double matrix[16];         /* column-major */
	double translation[3], rotation[4], scale[3];
	int parent;                /* GLTF_NONE = root */
};

struct gltf_camera {
	int orthographic;
	double yfov, aspect, xmag, ymag;
};

/* The structure of the file, without names, materials and extensions, which are
 * read from the JSON. */
struct gltf_doc {
	size_t views, accessors, primitives, meshes, nodes, cameras;
	struct gltf_view *view;
	struct gltf_accessor *accessor;
	struct gltf_primitive *primitive;
	struct gltf_mesh *mesh;
	struct gltf_node *node;
	struct gltf_camera *camera;
	size_t children;
	int *child;
	size_t roots;              /* of the scene to read */
	int *root;
	int scene;                 /* its index, GLTF_NONE = all nodes without parent */
};

struct gltf_buffer {
	unsigned char *data;       /* at least `bytes` */
	size_t bytes;
	int owned;                 /* else it points into the file */
};

struct gltf_source {
	const char *path;          /* for messages */
	unsigned char *file;
	size_t bytes;
	const unsigned char *json; /* into file */
	size_t json_bytes;
	unsigned char *bin;        /* GLB's BIN chunk, NULL = none */
	size_t bin_bytes;
	json_t *root;
	size_t buffers;
	struct gltf_buffer *buffer;
};

/* Everything about one file while it is read. */
struct gltf_reader {
	struct gltf_source source;
	struct gltf_doc doc;
	const struct gltf_options *options;
	struct gltf_report *report;
};

/* ---- gltf_source.c ---- */
int gltf_source_open(struct gltf_source *s, const char *path, struct err *e);
int gltf_source_buffers(struct gltf_source *s, struct err *e); /* after the schema */
int gltf_source_digest(const struct gltf_source *s, char hex[33], struct err *e);
void gltf_source_close(struct gltf_source *s);

/* ---- gltf_schema.c ---- */
/* Types, ranges, references, version and required extensions. */
int gltf_schema_check(const char *path, const json_t *root, struct err *e);
/* 1 if the extension is one that is read. */
int gltf_schema_knows(const char *extension);

/* ---- gltf_load.cc ---- */
#ifdef __cplusplus
extern "C" {
#endif
/* Parses JSON text that the schema accepts (asset, bufferViews, accessors, meshes,
 * nodes, scenes, cameras) into a zeroed doc. */
int gltf_load(const char *path, const char *json, size_t bytes, struct gltf_doc *d,
              struct err *e);
/* 1 and malloc'd bytes if the URI is a data: URI that holds at least `bytes` bytes;
 * 0 if it is none; -1 and *got (bytes found, 0 = it cannot be decoded). */
int gltf_load_data_uri(const char *uri, size_t bytes, unsigned char **data, size_t *got);
#ifdef __cplusplus
}
#endif

/* ---- gltf_check.c ---- */
/* Cameras of JSON that the schema accepts. */
int gltf_check_cameras(const char *path, const json_t *root, struct err *e);
/* Layout of all accessors and primitives, index values, finite vertices. */
int gltf_check_data(const struct gltf_reader *g, struct err *e);

/* ---- gltf_nodes.c ---- */
/* Parents, cycles, matrices; collects the roots if the file has no scene. */
int gltf_check_nodes(struct gltf_reader *g, struct err *e);
/* World matrices of the nodes that the roots reach: [nodes][16]; `reached` [nodes]
 * is set for them. 0, or -1 and e. */
int gltf_world_matrices(const struct gltf_reader *g, double *world, uint8_t *reached,
                        struct err *e);

/* ---- gltf_accessor.c ---- */
/* Access to the elements of a checked accessor. */
struct gltf_elements {
	const unsigned char *base; /* NULL = zeros */
	size_t stride, count;
	int component, n, normalised;
	size_t sparse;             /* replaced elements, in ascending order */
	const unsigned char *index, *value;
	int index_component;
	size_t value_stride;
};
size_t gltf_component_size(int component); /* 0 = no such type */
size_t gltf_element_size(const struct gltf_accessor *a);
struct gltf_elements gltf_access(const struct gltf_reader *g, int accessor);
/* Element i as n numbers. O(log sparse). */
void gltf_element(const struct gltf_elements *v, size_t i, double *out);
/* Element i of an accessor of unsigned integers. */
uint32_t gltf_index(const struct gltf_elements *v, size_t i);
/* Which element the k-th sparse value replaces. */
uint32_t gltf_sparse_index(const struct gltf_elements *v, size_t k);

/* ---- gltf_bands.c ---- */
/* Fills m->material with the materials that surfaces of m use and renumbers them;
 * before, surfaces hold glTF's indices and UINT32_MAX for none. Sets m->bands, and brings
 * the intensities of lights, RGB before, to them. */
int gltf_materials(struct gltf_reader *g, struct model *m, struct err *e);

/* ---- gltf_lights.c ---- */
/* Fills m->light with the lights of the nodes reached; intensities are RGB. world:
 * [nodes][16]. 0, or -1 and e. */
int gltf_lights(struct gltf_reader *g, struct model *m, const double *world,
                const uint8_t *reached, struct err *e);

/* ---- gltf_scene.c ---- */
int gltf_scene(struct gltf_reader *g, struct model *m, struct err *e);

/* ---- gltf_report.c ---- */
/* Adds a note unless it is there already. */
int gltf_note(struct gltf_report *r, struct err *e, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* Notes on everything in the file that is not read. */
int gltf_report_unread(struct gltf_reader *g, struct err *e);

/* ---- gltf_json.c, on checked JSON ---- */
/* Replaces control characters, so that a text stays on one line. */
void gltf_one_line(char *text);
/* Names not yet taken: `want`, else with #2, #3 … A malloc'd string, without
 * control characters. `taken` is a JSON object that remembers. */
char *gltf_unique_name(json_t *taken, const char *want, struct err *e);
#define GLTF_LIGHTS "KHR_lights_punctual"
/* The file's array of lights, NULL if there is none. */
json_t *gltf_lights_json(const json_t *root);

static inline const char *gltf_string(const json_t *o, const char *key)
{
	return json_string_value(json_object_get(o, key)); /* or NULL */
}

static inline double gltf_number(const json_t *o, const char *key, double otherwise)
{
	const json_t *v = json_object_get(o, key);

	return v ? json_number_value(v) : otherwise;
}

#endif
