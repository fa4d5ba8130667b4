#include "tools/common/options.h"

#include <ctype.h>
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/container/history.h"
#include "lib/base/mem.h"
#include "lib/mesh/mesher.h"
#include "lib/picture/camera.h"
#include "tools/common/cli.h"

enum { OPTIONS_MAX = 64 }; /* of all tables together: cli.given has a bit for each */

#define REQUEST struct cli

static const struct option_spec threads_option[] = {
	{ 'j', "threads", "N", "threads to use (default: one for each processor)",
	  INTEGER(threads, 1, 256), .role = OPTION_ASIDE },
	{ 0 }
};

static const struct option_spec version_option[] = {
	{ 0, "any-version", NULL, "keep what another version made of the same", FLAG(any_version),
	  .role = OPTION_ASIDE },
	{ 0 }
};

static const struct option_spec common_options[] = {
	{ 'q', "quiet", NULL, "print errors and warnings only", FLAG(quiet), .role = OPTION_ASIDE },
	{ 'v', "verbose", NULL, "print more about what is done", FLAG(verbose),
	  .role = OPTION_ASIDE },
	{ 0, "help", NULL, "print this help and exit", FLAG(help), .role = OPTION_ASIDE },
	{ 0, "version", NULL, "print the version and exit", FLAG(version), .role = OPTION_ASIDE },
	{ 0 }
};

/* ---- all options of a program ---- */

struct options {
	const struct option_spec *spec[OPTIONS_MAX];
	int own, n;                    /* the program's own come first */
	char usual[OPTIONS_MAX][48];   /* their defaults, for --help */
};

static void collect(struct options *all, const struct option_spec *table)
{
	for (; table->name && all->n < OPTIONS_MAX; table++)
		all->spec[all->n++] = table;
}

static struct options options_of(const struct cli *c)
{
	struct options all = { .n = 0 };

	collect(&all, c->options);
	all.own = all.n;
	if (c->uses_threads)
		collect(&all, threads_option);
	if (c->keeps_output)
		collect(&all, version_option);
	collect(&all, common_options);
	return all;
}

/* ---- help ---- */

static int label(const struct option_spec *o, char *text, size_t size)
{
	char letter[8] = "    ";

	if (o->letter)
		snprintf(letter, sizeof letter, "-%c, ", o->letter);
	return snprintf(text, size, "  %s--%s%s%s", letter, o->name,
	                o->argument && *o->argument != '[' ? " " : "", o->argument ? o->argument : "");
}

static long integer_in(const struct option_spec *o, const void *field)
{
	int narrow;
	long wide;

	if (o->size == sizeof narrow) {
		memcpy(&narrow, field, sizeof narrow);
		return narrow;
	}
	memcpy(&wide, field, sizeof wide);
	return wide;
}

/* As the help has it: .05 for 0.05. */
static void number_text(double x, char *text, size_t size)
{
	int n = snprintf(text, size, "%g", x);

	if (strncmp(text, "0.", 2) == 0)
		memmove(text, text + 1, (size_t)n);
}

/* A value as one would type it; "" for those of a type that has no default. */
static void value_text(const struct option_spec *o, const void *field, char *text, size_t size)
{
	const struct mesh_size *length = field;
	const double *v = field;

	switch (o->type) {
	case OPTION_INTEGER: snprintf(text, size, "%ld", integer_in(o, field)); break;
	case OPTION_WORD: snprintf(text, size, "%s", o->words[integer_in(o, field)]); break;
	case OPTION_NUMBER:
		if (o->words && isnan(*v))
			snprintf(text, size, "%s", o->words[0]);
		else
			number_text(*v, text, size);
		break;
	case OPTION_LENGTH:
		number_text(length->relative ? 100 * length->value : length->value, text, size - 1);
		if (length->relative)
			strcat(text, "%");
		break;
	case OPTION_VECTOR: snprintf(text, size, "%g,%g,%g", v[0], v[1], v[2]); break;
	default: break;
	}
}

static void note_defaults(struct options *all, const void *request)
{
	for (int i = 0; i < all->own; i++)
		if (strstr(all->spec[i]->help, "%s"))
			value_text(all->spec[i], (const char *)request + all->spec[i]->at,
			           all->usual[i], sizeof *all->usual);
}

static void print_option(const struct option_spec *o, const char *usual, int width)
{
	const char *gap = *usual ? strstr(o->help, "%s") : NULL;
	char text[256];

	label(o, text, sizeof text);
	printf("%-*s  ", width, text);
	if (gap)
		printf("%.*s%s%s\n", (int)(gap - o->help), o->help, usual, gap + 2);
	else
		printf("%s\n", o->help);
}

static void print_help(const struct cli *c, const struct options *all)
{
	char text[256];
	int width = 0;

	for (int i = 0; i < all->n; i++) {
		int n = label(all->spec[i], text, sizeof text);
		width = n > width ? n : width;
	}
	printf("Usage: %s %s\n%s\n\n", c->program, c->synopsis, c->about);
	for (int i = 0; i < all->n; i++)
		print_option(all->spec[i], all->usual[i], width);
}

/* ---- numbers ---- */

static void __attribute__((noreturn)) out_of_range(const struct cli *c,
                                                   const struct option_spec *o,
                                                   const char *text)
{
	if (o->min > -INFINITY && o->max < INFINITY)
		cli_usage(c, "--%s: %s is not in the range from %g to %g", o->name, text, o->min,
		          o->max);
	if (o->min > -INFINITY)
		cli_usage(c, "--%s: %s is not a number of at least %g", o->name, text, o->min);
	cli_usage(c, "--%s: %s is not a number of at most %g", o->name, text, o->max);
}

static double number(const struct cli *c, const struct option_spec *o, const char *text)
{
	char *end;
	double v;

	errno = 0;
	v = strtod(text, &end);
	if (end == text || *end || isspace((unsigned char)*text) || isnan(v))
		cli_usage(c, "--%s: '%s' is not a number", o->name, text);
	/* 1e999 is a typing error, not infinity. */
	if ((errno == ERANGE && isinf(v)) || v < o->min || v > o->max)
		out_of_range(c, o, text);
	return v;
}

static long integer(const struct cli *c, const struct option_spec *o, const char *text)
{
	char *end;
	long v;

	errno = 0;
	v = strtol(text, &end, 10);
	if (end == text || *end || isspace((unsigned char)*text))
		cli_usage(c, "--%s: '%s' is not a whole number", o->name, text);
	if (errno == ERANGE || v < o->least || v > o->most)
		cli_usage(c, "--%s: %s is not in the range from %ld to %ld", o->name, text, o->least,
		          o->most);
	return v;
}

/* ---- a value of each type, into its field of the request ---- */

typedef void take_fn(const struct cli *c, const struct option_spec *o, const char *text,
                     void *field);

static void put_integer(const struct option_spec *o, long v, void *field)
{
	uint32_t narrow = (uint32_t)v;
	uint64_t wide = (uint64_t)v;

	if (o->size == sizeof narrow)
		memcpy(field, &narrow, sizeof narrow);
	else
		memcpy(field, &wide, sizeof wide);
}

static void take_flag(const struct cli *c, const struct option_spec *o, const char *text,
                      void *field)
{
	(void)c;
	(void)text;
	put_integer(o, 1, field);
}

static void take_integer(const struct cli *c, const struct option_spec *o, const char *text,
                         void *field)
{
	put_integer(o, integer(c, o, text), field);
}

static void take_number(const struct cli *c, const struct option_spec *o, const char *text,
                        void *field)
{
	double *v = field;

	*v = o->words && strcmp(text, o->words[0]) == 0 ? NAN : number(c, o, text);
}

/* Refuses what the words of an option do not have. */
static void __attribute__((noreturn)) no_such_word(const struct cli *c,
                                                   const struct option_spec *o,
                                                   const char *text)
{
	char list[256] = "";

	for (size_t i = 0, n = 0; o->words[i] && n < sizeof list; i++)
		n += (size_t)snprintf(list + n, sizeof list - n, "%s%s", i ? ", " : "", o->words[i]);
	cli_usage(c, "--%s: '%s' is not %s %s", o->name, text,
	          o->type == OPTION_SET ? "a list of" : "one of", list);
}

/* The place among the words of the first n bytes of text; -1 where they are none of them. */
static int find_word(const struct option_spec *o, const char *text, size_t n)
{
	for (int i = 0; o->words[i]; i++)
		if (strlen(o->words[i]) == n && strncmp(o->words[i], text, n) == 0)
			return i;
	return -1;
}

static void take_word(const struct cli *c, const struct option_spec *o, const char *text,
                      void *field)
{
	int i = text ? find_word(o, text, strlen(text)) : 1;

	if (i < 0)
		no_such_word(c, o, text);
	put_integer(o, i, field);
}

static void take_set(const struct cli *c, const struct option_spec *o, const char *text,
                     void *field)
{
	unsigned *set = field;

	*set = 0;
	for (const char *p = text;; p++) {
		size_t n = strcspn(p, ",");
		int i = find_word(o, p, n);
		if (i < 0)
			no_such_word(c, o, text);
		*set |= strcmp(o->words[i], "all") == 0 ? (1u << i) - 1 : 1u << i;
		p += n;
		if (!*p)
			return;
	}
}

static void take_text(const struct cli *c, const struct option_spec *o, const char *text,
                      void *field)
{
	const char **s = field;

	(void)c;
	(void)o;
	*s = text;
}

static void __attribute__((noreturn)) no_memory(const struct cli *c, const struct option_spec *o)
{
	struct err e = { 0 };

	err_set(&e, "out of memory for --%s", o->name);
	exit(cli_fail(c, &e));
}

static void take_list(const struct cli *c, const struct option_spec *o, const char *text,
                      void *field)
{
	struct option_list *l = field;
	const char **item = realloc(l->item, (l->n + 1) * sizeof *item);

	if (!item)
		no_memory(c, o);
	l->item = item;
	l->item[l->n++] = text;
}

static void take_joined(const struct cli *c, const struct option_spec *o, const char *text,
                        void *field)
{
	char **all = field;
	size_t n = *all ? strlen(*all) : 0, size = n + strlen(text) + 2;
	char *more = realloc(*all, size);

	if (!more)
		no_memory(c, o);
	snprintf(more + n, size - n, "%s%s", n ? "," : "", text);
	*all = more;
}

static void take_length(const struct cli *c, const struct option_spec *o, const char *text,
                        void *field)
{
	struct mesh_size *s = field;
	size_t n = strlen(text);
	char figures[64];

	s->relative = n > 0 && n < sizeof figures && text[n - 1] == '%';
	if (s->relative) {
		snprintf(figures, sizeof figures, "%.*s", (int)n - 1, text);
		text = figures;
	}
	s->value = number(c, o, text);
	if (s->value == 0)
		cli_usage(c, "--%s: a size must be greater than 0", o->name);
	if (s->relative)
		s->value /= 100;
}

static int extent(const char *text, char **end, int *n)
{
	if (!isdigit((unsigned char)*text))
		return -1;
	long v = strtol(text, end, 10);
	if (v < 1 || v > CAMERA_SIZE_MAX)
		return -1;
	*n = (int)v;
	return 0;
}

static void take_pixels(const struct cli *c, const struct option_spec *o, const char *text,
                        void *field)
{
	int *size = field;
	char *end;

	if (extent(text, &end, &size[0]) || *end != 'x' || extent(end + 1, &end, &size[1]) || *end)
		cli_usage(c, "--%s: '%s' is not a size such as 640x480", o->name, text);
}

static void take_vector(const struct cli *c, const struct option_spec *o, const char *text,
                        void *field)
{
	double *v = field;
	char extra;

	if (sscanf(text, "%lf,%lf,%lf%c", &v[0], &v[1], &v[2], &extra) != 3 ||
	    !isfinite(v[0] + v[1] + v[2]))
		cli_usage(c, "--%s: '%s' is not three numbers X,Y,Z", o->name, text);
}

static void take_ratio(const struct cli *c, const struct option_spec *o, const char *text,
                       void *field)
{
	enum { MOST = 1000000 }; /* shards; more is a typing error */
	uint32_t *r = field;
	unsigned k, n;
	char extra;

	if (sscanf(text, "%u/%u%c", &k, &n, &extra) != 2 || k < 1 || k > n || n > MOST)
		cli_usage(c, "--%s: '%s' is not K/N with 1 <= K <= N, such as 2/4", o->name, text);
	r[0] = k;
	r[1] = n;
}

static take_fn *const take[] = {
	[OPTION_FLAG] = take_flag,     [OPTION_INTEGER] = take_integer,
	[OPTION_NUMBER] = take_number, [OPTION_WORD] = take_word,
	[OPTION_SET] = take_set,       [OPTION_TEXT] = take_text,
	[OPTION_LIST] = take_list,     [OPTION_JOINED] = take_joined,
	[OPTION_LENGTH] = take_length, [OPTION_PIXELS] = take_pixels,
	[OPTION_VECTOR] = take_vector, [OPTION_RATIO] = take_ratio
};

/* ---- the command line ---- */

/* What getopt_long wants. Options are known by LONG plus their index, or by letter. */
struct getopt_tables {
	char letters[2 + 2 * OPTIONS_MAX];
	struct option longs[OPTIONS_MAX + 1];
};
enum { LONG = 256 }; /* beyond all letters */

static void getopt_tables(const struct options *all, struct getopt_tables *t)
{
	char *s = t->letters;

	*s++ = ':';
	for (int i = 0; i < all->n; i++) {
		const struct option_spec *o = all->spec[i];
		t->longs[i] = (struct option){
			.name = o->name, .val = LONG + i,
			.has_arg = !o->argument ? no_argument
			         : *o->argument == '[' ? optional_argument : required_argument };
		if (!o->letter)
			continue;
		*s++ = (char)o->letter;
		if (o->argument)
			*s++ = ':';
	}
	*s = 0;
}

/* Index of the option that getopt_long calls `code`, or -1. */
static int find_option(const struct options *all, int code)
{
	if (code >= LONG)
		return code - LONG;
	for (int i = 0; i < all->n; i++)
		if (code && all->spec[i]->letter == code)
			return i;
	return -1;
}

static void __attribute__((noreturn)) wrong_option(const struct cli *c, const struct options *all,
                                                   int code, char **argv)
{
	int known = find_option(all, optopt);

	if (known >= 0)
		cli_usage(c, "option --%s %s", all->spec[known]->name,
		          code == ':' ? "needs an argument" : "takes no argument");
	if (optopt)
		cli_usage(c, "unknown option -%c", optopt);
	cli_usage(c, "unknown or ambiguous option %s", argv[optind - 1]);
}

static void take_option(struct cli *c, const struct options *all, int i, const char *text,
                        void *request)
{
	const struct option_spec *o = all->spec[i];

	if (i < all->own)
		c->given |= (uint64_t)1 << i;
	take[o->type](c, o, text, (char *)(i < all->own ? request : (void *)c) + o->at);
	if (c->help)
		print_help(c, all);
	if (c->version)
		printf("%s (twopass) %s\n", c->program, TWOPASS_VERSION);
	if (c->help || c->version)
		exit(cli_finish(c, 0));
}

int options_parse(struct cli *c, int argc, char **argv, void *request)
{
	struct options all = options_of(c);
	struct getopt_tables t = { 0 };
	int code;

	getopt_tables(&all, &t);
	c->argc = argc;
	c->argv = argv;
	c->threads = par_cpus();
	note_defaults(&all, request);
	opterr = 0;
	while ((code = getopt_long(argc, argv, t.letters, t.longs, NULL)) != -1) {
		if (code == '?' || code == ':')
			wrong_option(c, &all, code, argv);
		take_option(c, &all, find_option(&all, code), optarg, request);
	}
	return optind;
}

int options_given(const struct cli *c, const char *name)
{
	for (int i = 0; c->options[i].name; i++)
		if (strcmp(c->options[i].name, name) == 0)
			return c->given >> i & 1;
	return 0;
}

/* ---- keys and history ---- */

static void digest_text(struct digest *d, const char *text)
{
	file_digest_string(d, text ? text : "");
}

static void digest_value(const struct option_spec *o, const void *field, struct digest *d)
{
	const struct mesh_size *length = field;
	const struct option_list *list = field;

	switch (o->type) {
	case OPTION_TEXT: digest_text(d, *(const char *const *)field); break;
	case OPTION_JOINED: digest_text(d, *(char *const *)field); break;
	case OPTION_LIST:
		for (size_t i = 0; i < list->n; i++)
			digest_text(d, list->item[i]);
		break;
	case OPTION_LENGTH: /* the struct has padding */
		file_digest_bytes(d, &length->value, sizeof length->value);
		file_digest_bytes(d, &length->relative, sizeof length->relative);
		break;
	default: file_digest_bytes(d, field, o->size);
	}
}

void options_digest(const struct cli *c, const void *request, struct digest *d)
{
	for (const struct option_spec *o = c->options; o->name; o++)
		if (o->role == OPTION_DETERMINES) {
			file_digest_string(d, o->name);
			digest_value(o, (const char *)request + o->at, d);
		}
}

char *options_history(const struct cli *c, const char *before, struct err *e)
{
	struct options all = options_of(c);
	struct history_option aside[OPTIONS_MAX + 1];
	int n = 0;

	for (int i = 0; i < all.n; i++) {
		const struct option_spec *o = all.spec[i];
		if (o->role == OPTION_ASIDE)
			aside[n++] = (struct history_option){ o->letter, o->name,
			                                      o->argument != NULL };
	}
	aside[n] = (struct history_option){ 0, NULL, 0 };
	return file_history_append(before, c->argc, c->argv, aside, e);
}
