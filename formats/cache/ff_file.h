/* .ff files: a struct ff, written in batches of rows. Array names: ff(5). */
#ifndef TWOPASS_FF_FILE_H
#define TWOPASS_FF_FILE_H

#include "formats/cache/cache.h"
#include "lib/base/mem.h"
#include "lib/data/ff.h"
#include "lib/data/ff_check.h"

struct ff_writer;

/* Form factors of the model m (which outlives the writer), of which the file keeps
 * what makes it readable by itself: the patches' elements, areas and names. f64:
 * values are float64. to_patches: columns are patch-sides, and what batches have for
 * the elements of one is summed. */
struct ff_writer *file_ff_create(const char *path, const struct model *m, int f64,
                                 int to_patches, struct err *e);

/* Appends a batch: its rows, blocks, entries, arrivals and links (all indices in
 * it relative to the batch; chains ignored, block_chain and link_chain are those
 * of the final table) behind those written so far. Its columns are lists; they
 * become spans where these are shorter, and arrays of the usual are left out. O(batch). */
int file_ff_append(struct ff_writer *w, const struct ff *batch, struct err *e);

/* Writes the chain table and patch range of `whole` (its rows are ignored) and
 * the info, and finishes. Frees w in any case. */
int file_ff_finish(struct ff_writer *w, const struct ff *whole, const struct cache_info *i,
                   struct err *e);
void file_ff_abandon(struct ff_writer *w);

/* Gives the file, made for the geometry of m, the names of m's surfaces and materials.
 * 0 if it has them already, 1 if it was rewritten with them, -1 and e. O(file) then. */
int file_ff_rename(const char *path, const struct model *m, struct err *e);

/* An open .ff; f's and scene's arrays point into the mapped file, or were made since it
 * leaves them out (do not ff_free f, do not write to them). */
struct ff_file {
	struct container *container;
	struct ff f;
	struct cache_info info;
	uint32_t patches;          /* of the model it was made for */
	/* That model, as far as the file knows it. */
	struct ff_scene scene;
	size_t surfaces;
	char **surface_name;       /* [surfaces] */
	char **light_name;         /* [scene.lights] */
	const uint32_t *patch_surface;
	struct array made;         /* void *: arrays that the file leaves out, see ff(5) */
};

/* Opens and checks all (digests, monotone starts, ranges against `m`, finite and
 * non-negative values, row closure to 1e-9, link order). m may be NULL (inspect):
 * ranges are then checked against the file's own counts. If m_info is given and
 * geometry_id differs: "room.ff: made for another geometry; run ffcalc again".
 * O(file); touches every byte twice. */
int file_ff_open(const char *path, const struct model *m, const struct cache_info *m_info,
                 struct ff_file *out, struct err *e);
void file_ff_close(struct ff_file *f);

/* Names of all 2 patches patch-sides: "floor:f", or "floor[3]:b" where a surface has
 * several patches (counted from 0 in the file's order). NULL and e when out of
 * memory; release with file_cache_names_free(names, 2 patches). */
char **file_ff_side_names(const struct ff_file *f, struct err *e);

#endif
