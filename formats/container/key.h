/* The key of an output: 32 hexadecimal digits, a digest of the options and inputs that it was
 * made from, a colon, and 32 of the sources of the program that made it. */
#ifndef TWOPASS_KEY_H
#define TWOPASS_KEY_H

enum { KEY_BYTES = 32 + 1 + 32 + 1 };

enum key_fit { KEY_DIFFERS, KEY_FITS, KEY_OTHER_VERSION };

/* Whether an output with the key `have` (NULL: it has none) is one with the key `want`, or was
 * made of the same by other sources, where any_version allows that. */
enum key_fit file_key_fit(const char *have, const char *want, int any_version);

#endif
