/* One material of a glTF file, before it is brought into the model's bands. Not
 * for other files than gltf_material.c and gltf_bands.c. */
#ifndef TWOPASS_GLTF_MATERIAL_H
#define TWOPASS_GLTF_MATERIAL_H

#include "formats/gltf/gltf_doc.h"
#include "lib/scatter/gltf_to_bsdf.h"

struct gltf_material {
	char *name;             /* set before reading */
	struct bsdf_side side[2];
	double emission[2][BANDS_MAX];
	double emission_exponent[2];
	int one_sided;
};

/* Length of the longest array in the material's extras.twopass, at least 1. */
size_t gltf_material_bands(const json_t *material);

/* Reads a material (NULL = glTF's default) in `bands` working bands: 3 for RGB,
 * else the number that the extras of the scene's materials name. Folds weak lobes
 * and notes what it did. */
int gltf_material_read(struct gltf_reader *g, const json_t *material, int bands,
                       struct gltf_material *to, struct err *e);

#endif
