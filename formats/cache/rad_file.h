/* .rad files: the model and its solution. Array names: rad(5). */
#ifndef TWOPASS_RAD_FILE_H
#define TWOPASS_RAD_FILE_H

#include "formats/cache/cache.h"
#include "lib/data/solution.h"

int file_rad_write(const char *path, const struct model *m, const struct solution *s,
                   const struct cache_info *i, struct err *e);
int file_rad_read(const char *path, struct model *m, struct solution *s,
                  struct cache_info *i, struct err *e);

#endif
