/* Errors: one clear line, the first one wins. */
#ifndef TWOPASS_ERR_H
#define TWOPASS_ERR_H

struct err {
	int set;
	char text[1024];   /* bytes; names are cut to 100 where they go in, paths are short enough
	                      as a guess */
};

/* Records "what is wrong" (printf style, without program name or newline;
 * begin with the file and the place in it: "room.mesh: array element: ...")
 * unless an error is already recorded. Always returns -1, so that callers
 * can write `return err_set(...)`. */
int err_set(struct err *e, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

#endif
