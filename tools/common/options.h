/* Command-line options of a program as one table: it parses them into the program's request,
 * prints --help, and says which of them an output's key and its history are made of. */
#ifndef TWOPASS_OPTIONS_H
#define TWOPASS_OPTIONS_H

#include <math.h>
#include <stddef.h>

#include "formats/container/digest.h"
#include "lib/base/err.h"

struct cli;

enum option_type {
	OPTION_FLAG,    /* int: 1 where the option is there */
	OPTION_INTEGER, /* int, uint32_t, long, uint64_t, size_t: from `least` to `most` */
	OPTION_NUMBER,  /* double: from `min` to `max`; the only word, if any, is NaN */
	OPTION_WORD,    /* int or enum: the word's place in `words` */
	OPTION_SET,     /* unsigned: a bit for each word of a list; `all` is all before it */
	OPTION_TEXT,    /* const char * */
	OPTION_LIST,    /* struct option_list: the text of each time the option is there */
	OPTION_JOINED,  /* char *: these texts with commas between, to be freed */
	OPTION_LENGTH,  /* struct mesh_size: metres, or a fraction (5%), or inf; not 0 */
	OPTION_PIXELS,  /* int[2]: width and height */
	OPTION_VECTOR,  /* double[3]: finite X,Y,Z */
	OPTION_RATIO    /* uint32_t[2]: K/N with 1 <= K <= N */
};

/* What an option is for, beside the program that it is given to. One that nothing is said
 * about determines the output. */
enum option_role {
	OPTION_DETERMINES, /* the output: its value is in the key, and the history tells it */
	OPTION_RECORDED,   /* it names what is in the key by content, or another output: in
	                      the history alone */
	OPTION_ASIDE       /* where the output goes, how fast and how loud it is made: in neither */
};

struct option_spec {
	int letter;              /* or 0 */
	const char *name;        /* long name; NULL ends a table */
	const char *argument;    /* its name in --help, or NULL; in brackets, [=NAME], where it
	                            may be left out, which stands for the second word */
	const char *help;        /* one line; %s in it is what the request holds before */
	enum option_type type;
	size_t at, size;         /* of the value in the request */
	long least, most;
	double min, max;
	const char *const *words; /* up to NULL */
	enum option_role role;
};

/* The types with their values' places, members of REQUEST, which whoever writes a table
 * defines as the type of the request. */
#define OPTION_AT(member) .at = offsetof(REQUEST, member), .size = sizeof ((REQUEST *)0)->member
#define FLAG(member) .type = OPTION_FLAG, OPTION_AT(member)
#define INTEGER(member, from, to) \
	.type = OPTION_INTEGER, OPTION_AT(member), .least = (from), .most = (to)
#define NUMBER(member, from, to) \
	.type = OPTION_NUMBER, OPTION_AT(member), .min = (from), .max = (to)
#define WORD(member, list) .type = OPTION_WORD, OPTION_AT(member), .words = (list)
#define SET(member, list) .type = OPTION_SET, OPTION_AT(member), .words = (list)
#define TEXT(member) .type = OPTION_TEXT, OPTION_AT(member)
#define LIST(member) .type = OPTION_LIST, OPTION_AT(member)
#define JOINED(member) .type = OPTION_JOINED, OPTION_AT(member)
#define LENGTH(member) .type = OPTION_LENGTH, OPTION_AT(member), .max = INFINITY
#define RESOLUTION(member) .type = OPTION_PIXELS, OPTION_AT(member)
#define VECTOR(member) .type = OPTION_VECTOR, OPTION_AT(member)
#define RATIO(member) .type = OPTION_RATIO, OPTION_AT(member)

struct option_list {
	size_t n;
	const char **item; /* [n], to be freed; the texts are argv's */
};

/* Puts what the command line says into the request, of the type the table of c was written for,
 * and into c. The request holds the defaults before. Index in argv, which is reordered and has
 * to stay, of the first operand. Prints help or version and exits 0; wrong usage exits 2. */
int options_parse(struct cli *c, int argc, char **argv, void *request);

/* 1 if an option, by its long name, was on the command line. */
int options_given(const struct cli *c, const char *name);

/* Adds all that determines the output, as the request has it. */
void options_digest(const struct cli *c, const void *request, struct digest *d);

/* `before` (may be NULL) followed by a line for this command line, as file_history_append has
 * it. */
char *options_history(const struct cli *c, const char *before, struct err *e);

#endif
