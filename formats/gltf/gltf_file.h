/* glTF 2.0 in: .gltf and .glb to a struct model. What is read and what is not:
 * twopass-gltf(7). */
#ifndef TWOPASS_GLTF_FILE_H
#define TWOPASS_GLTF_FILE_H

#include "lib/base/err.h"
#include "lib/data/model.h"

struct gltf_options {
	double min_directional; /* lobes derived from metallic-roughness with a smaller
	                           share of the albedo are folded into diffuse */
	double min_exponent;    /* so are those with a smaller exponent */
	int bands;              /* 0: 1 if the scene is grey, else what the file has */
	int clamp;              /* rescale albedos above 1 instead of refusing them */
	enum lobe_kind lobe;
};

#define GLTF_OPTIONS_DEFAULT \
	((struct gltf_options){ .min_directional = .05, .min_exponent = 2 })

struct gltf_report {
	size_t notes;
	char **note;            /* each a line without newline, no two the same */
	char digest[33];        /* XXH3-128 of the file and its external buffers */
	size_t nodes;           /* of the scene that was read */
	size_t skipped;         /* primitives of points and lines */
};

/* Reads the default scene of `path` ("-" = standard input) into m: bands, lobe,
 * material (those in use), surface, cameras, vertices in world coordinates (each
 * surface has its own), triangles with winding, UVs and NORMALs. Elements and
 * patches stay 0; nothing is welded or dropped, and a scene without triangles is
 * no error here. m and r must be zeroed; on failure m is freed, r is not.
 * O(size of the file + size of the model). */
int gltf_file_read(const char *path, const struct gltf_options *o, struct model *m,
                   struct gltf_report *r, struct err *e);

void gltf_report_free(struct gltf_report *r);

#endif
