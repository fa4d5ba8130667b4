/* OpenEXR pictures, through OpenEXR's C core library. */
#ifndef TWOPASS_EXR_FILE_H
#define TWOPASS_EXR_FILE_H

#include <stddef.h>

#include "formats/container/key.h"
#include "lib/base/err.h"
#include "lib/picture/image.h"

/* Attributes of the header. Begin with {0}. Strings are owned. */
struct exr_file_string {
	char *name, *value;
};

struct exr_file_info {
	float white_luminance;     /* cd/m^2 of R = G = B = 1; 0 = absent */
	int has_world_to_camera;
	float world_to_camera[16]; /* row-major, for row vectors; see camera.h */
	size_t strings;            /* every attribute of type string */
	struct exr_file_string *string;
};

/* Names of string attributes with a fixed meaning. */
#define EXR_FILE_CAMERA "camera"   /* name of the camera */
#define EXR_FILE_HISTORY "history" /* commands, one per line */
#define EXR_FILE_KEY "twopassKey"  /* formats/container/key.h */

/* Adds or replaces a string. 0, or -1 and e. O(strings). */
int file_exr_info_set(struct exr_file_info *i, const char *name, const char *value,
                      struct err *e);
/* Its value, or NULL. */
const char *file_exr_info_get(const struct exr_file_info *i, const char *name);
void file_exr_info_free(struct exr_file_info *i);

enum exr_file_compression {
	EXR_FILE_AUTO, /* the default: zip, except for rows that it hardly makes smaller */
	EXR_FILE_ZIP,  /* 16 rows together */
	EXR_FILE_ZIPS, EXR_FILE_PIZ, EXR_FILE_RLE, EXR_FILE_NONE
};

/* Their names, in this order, and NULL. */
extern const char *const file_exr_compression_name[];

struct exr_file_options {
	enum exr_file_compression compression;
	/* 1: colours (channels whose last name is R, G or B) are 16-bit floats,
	 * finite values beyond 65504 clipped to it; all other channels stay 32-bit. */
	int half;
};

/* Writes a scanline file ("-" = stdout); its bytes depend on the arguments only.
 * options and info may be NULL; clipped (may be NULL) receives the number of
 * values that half clipped. 0, or -1 and e, with the old file whole. */
int file_exr_write(const char *path, const struct image *im, const struct exr_file_info *info,
                   const struct exr_file_options *options, size_t *clipped, struct err *e);

/* Reads a single-part scanline or tiled (level 0) file ("-" = stdin), all channels
 * as 32-bit floats over the data window. NaN and infinity pass. info may be NULL;
 * both are overwritten, and empty on failure. */
int file_exr_read(const char *path, struct image *im, struct exr_file_info *info,
                  struct err *e);

/* Whether `path` is a picture whose attribute EXR_FILE_KEY fits: then the file is touched
 * (mtime now). Pixels are not read, but for scanline files it is checked that the last rows
 * are there: its cost is independent of the number of pixels but for a table of 8 bytes per
 * 16 rows. */
enum key_fit file_exr_up_to_date(const char *path, const char *key, int any_version);

#endif
