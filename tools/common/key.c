#include "tools/common/key.h"

#include <stdio.h>

/* Made by the build, by tools/code_digest.pl. */
extern const char program_code[33];

struct digest *key_begin(const struct cli *c, const void *request)
{
	struct digest *d = file_digest_new();

	file_digest_string(d, c->program);
	options_digest(c, request, d);
	return d;
}

void key_end(struct digest *d, char key[KEY_BYTES])
{
	char made_of[33];

	file_digest_end(d, made_of);
	snprintf(key, KEY_BYTES, "%s%s%s", made_of, *made_of ? ":" : "",
	         *made_of ? program_code : "");
}

void key_kept(const struct cli *c, const char *path, enum key_fit fit)
{
	cli_note(c, "%s: %s", path,
	         fit == KEY_FITS ? "up to date" : "made by another version, kept");
}
