/* The cameras of a .mesh or .rad file, without reading the rest of it. */
#ifndef TWOPASS_CAMERA_FILE_H
#define TWOPASS_CAMERA_FILE_H

#include "formats/container/container.h"
#include "lib/data/model.h"

/* Fills the cameras of a zeroed model. Their arrays are verified. The cost does not
 * depend on the size of the scene. 0, or -1 and e; release with model_free. */
int file_camera_get(const struct container *c, struct model *m, struct err *e);

#endif
