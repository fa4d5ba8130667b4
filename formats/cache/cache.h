/* What the .mesh, .ff and .rad headers have in common, and the ids. */
#ifndef TWOPASS_CACHE_H
#define TWOPASS_CACHE_H

#include "formats/container/container.h"
#include "formats/container/key.h"
#include "lib/base/err.h"
#include "lib/data/model.h"

#define CACHE_VERSION "2"    /* of .mesh and .rad files */
#define CACHE_FF_VERSION "5" /* of .ff files */

/* Strings are owned (malloc) and may be NULL. */
struct cache_info {
	char *history;         /* commands, one per line */
	char *options;         /* the tool's options as a JSON object */
	char *report;          /* what was modelled, counts, errors, as JSON */
	char *key;             /* formats/container/key.h: equal keys, equal output */
	char geometry_id[33];  /* all that form factors depend on */
	char material_id[33];  /* coefficients, emission, intensities of lights */
	char camera_id[33];    /* all cameras */
};

void file_cache_info_free(struct cache_info *i);

/* Fills the three ids from the model. geometry_id covers vertices, triangles,
 * elements, split trees, patches, sides modelled, lobe kind, exponents, emission
 * exponents, which coefficients and emissions are non-zero (in any band), which
 * directional coefficients are 1 (in all bands), the
 * assignment of materials to surfaces, kinds, places, directions and cones of lights; not
 * names, coefficients, intensities, bands, UVs, NORMALs. */
void file_cache_ids(const struct model *m, struct cache_info *i);

/* Digest of one camera (32 hex digits). */
void file_cache_camera_id(const struct camera *c, char hex[33]);

/* Writes / reads the info as __metadata__ strings, leaving out what is NULL or "".
 * file_cache_read_info checks the format's version. */
int file_cache_write_info(struct container_writer *w, const char *format,
                          const struct cache_info *i, struct err *e);
int file_cache_read_info(const struct container *c, struct cache_info *i, struct err *e);

/* Lists of names as metadata: a JSON array of strings. The reader wants exactly n
 * of them; *name is allocated, name by name (file_cache_names_free). */
int file_cache_write_names(struct container_writer *w, const char *key, char *const *name,
                           size_t n, struct err *e);
int file_cache_read_names(const struct container *c, const char *key, char ***name, size_t n,
                          struct err *e);
void file_cache_names_free(char **name, size_t n);

/* Whether `path` exists, is a whole container of this format (structure and header digest
 * checked) and its key fits: then the file is touched (mtime now). */
enum key_fit file_cache_up_to_date(const char *path, const char *format, const char *key,
                                   int any_version);

#endif
