/* PNG pictures, written through libpng. */
#ifndef TWOPASS_PNG_FILE_H
#define TWOPASS_PNG_FILE_H

#include "lib/base/err.h"

/* Writes an sRGB picture ("-" = stdout); its bytes depend on the arguments only
 * (no time is stored). bits is 8 or 16; rgb is [height][width][3] of uint8_t or of
 * native uint16_t, row 0 at the top. comment (may be NULL) is kept as UTF-8 text.
 * 0, or -1 and e, with the old file whole. */
int file_png_write(const char *path, int width, int height, int bits, const void *rgb,
                   const char *comment, struct err *e);

#endif
