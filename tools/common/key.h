/* Whether an output is there already: keys of what a program makes. */
#ifndef TWOPASS_OUTPUT_KEY_H
#define TWOPASS_OUTPUT_KEY_H

#include "formats/container/digest.h"
#include "formats/container/key.h"
#include "tools/common/cli.h"

/* Begins a key: the program and the options that determine its output. The caller adds its
 * inputs, by content, and ends it. */
struct digest *key_begin(const struct cli *c, const void *request);

/* Ends it, with the digest of the program's sources; "" when memory was short. */
void key_end(struct digest *d, char key[KEY_BYTES]);

/* Says that an output that fits is kept. */
void key_kept(const struct cli *c, const char *path, enum key_fit fit);

#endif
