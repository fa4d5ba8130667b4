#include "formats/container/history.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"

/* What an option of the left-out kind does with the argument after it. */
enum left_out { KEEP, DROP, DROP_WITH_NEXT };

static int put(struct array *line, const char *text, size_t n, struct err *e)
{
	return mem_append(line, text, n, 1, e);
}

/* "1/4" is a number of parts, not a path. */
static int is_ratio(const char *s)
{
	size_t n = strspn(s, "0123456789");

	return n && s[n] == '/' && s[n + 1] && !s[n + 1 + strspn(s + n + 1, "0123456789")];
}

/* The part of a path after its last slash, trailing slashes aside. */
static void base_name(const char *s, const char **begin, size_t *n)
{
	*begin = s;
	*n = strlen(s);
	if (is_ratio(s))
		return;
	while (*n > 1 && s[*n - 1] == '/')
		--*n;
	for (size_t i = *n - (*n > 0); i-- > 0;)
		if (s[i] == '/') {
			*begin = s + i + 1;
			*n -= i + 1;
			return;
		}
}

/* Control characters and what is not UTF-8 would break the line or the JSON it
 * goes into: they are written as bash and POSIX.1-2024 $'...' do. */
static int put_escaped(struct array *line, const char *s, size_t n, struct err *e)
{
	char hex[8];
	int failed = put(line, "$'", 2, e);

	for (size_t i = 0; i < n && !failed; i++) {
		unsigned char c = (unsigned char)s[i];
		if (c == '\'' || c == '\\')
			failed = put(line, c == '\'' ? "\\'" : "\\\\", 2, e);
		else if (c < ' ' || c >= 0x7f)
			failed = put(line, hex, (size_t)snprintf(hex, sizeof hex, "\\%03o", c), e);
		else
			failed = put(line, &s[i], 1, e);
	}
	return failed || put(line, "'", 1, e) ? -1 : 0;
}

static int put_quoted(struct array *line, const char *s, size_t n, struct err *e)
{
	static const char safe[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
	                           "0123456789_@%+=:,./-";
	json_t *utf8 = json_stringn(s, n);
	size_t plain = 0, control = 0;

	for (size_t i = 0; i < n; i++) {
		plain += strchr(safe, s[i]) != NULL;
		control += (unsigned char)s[i] < ' ' || s[i] == 0x7f;
	}
	json_decref(utf8);
	if (n && plain == n)
		return put(line, s, n, e);
	if (!utf8 || control)
		return put_escaped(line, s, n, e);
	int failed = put(line, "'", 1, e);
	for (size_t i = 0; i < n && !failed; i++)
		failed = s[i] == '\'' ? put(line, "'\\''", 4, e) : put(line, &s[i], 1, e);
	return failed || put(line, "'", 1, e) ? -1 : 0;
}

/* An operand, an option's value, or "--name=value". */
static int put_argument(struct array *line, const char *arg, struct err *e)
{
	const char *equals = strncmp(arg, "--", 2) == 0 ? strchr(arg, '=') : NULL;
	const char *begin;
	size_t n;

	if (put(line, " ", 1, e))
		return -1;
	if (!equals) {
		base_name(arg, &begin, &n);
		return put_quoted(line, begin, n, e);
	}
	base_name(equals + 1, &begin, &n);
	if (put_quoted(line, arg, (size_t)(equals - arg), e) || put(line, "=", 1, e))
		return -1;
	return n ? put_quoted(line, begin, n, e) : 0;
}

/* getopt_long takes abbreviations that stand for one option only. */
static enum left_out long_option(const char *arg, const struct history_option *aside)
{
	size_t n = strcspn(arg + 2, "=");

	for (; n && aside->name; aside++)
		if (strncmp(arg + 2, aside->name, n) == 0)
			return aside->argument && !arg[2 + n] ? DROP_WITH_NEXT : DROP;
	return KEEP;
}

static const struct history_option *find_letter(const struct history_option *aside, char letter)
{
	for (; letter && aside->name; aside++)
		if (aside->letter == letter)
			return aside;
	return NULL;
}

/* A cluster of short options: leading ones that are to be left out go, the last of them
 * perhaps with its value. *rest is what is left of it ("" if nothing). */
static enum left_out short_options(const char *arg, const struct history_option *aside,
                                   const char **rest)
{
	const struct history_option *o;

	for (*rest = arg + 1; (o = find_letter(aside, **rest)); ++*rest)
		if (o->argument)
			return (*rest)[1] ? DROP : DROP_WITH_NEXT;
	return **rest ? KEEP : DROP;
}

static int put_command(struct array *line, int argc, char *const argv[],
                       const struct history_option *aside, struct err *e)
{
	int operands_only = 0;
	const char *begin, *rest;
	size_t n;

	base_name(argc ? argv[0] : "", &begin, &n);
	if (put_quoted(line, begin, n, e))
		return -1;
	for (int i = 1; i < argc; i++) {
		const char *arg = argv[i];
		enum left_out what = KEEP;
		if (!operands_only && strncmp(arg, "--", 2) == 0) {
			operands_only = !arg[2];
			what = long_option(arg, aside);
		} else if (!operands_only && arg[0] == '-' && arg[1]) {
			what = short_options(arg, aside, &rest);
			if (what == KEEP && rest > arg + 1) {
				if (put(line, " -", 2, e) || put_quoted(line, rest, strlen(rest), e))
					return -1;
				continue;
			}
		}
		if (what == DROP_WITH_NEXT)
			i++;
		if (what == KEEP && put_argument(line, arg, e))
			return -1;
	}
	return 0;
}

char *file_history_append(const char *before, int argc, char *const argv[],
                          const struct history_option *aside, struct err *e)
{
	struct array line = { 0 };
	size_t n = before ? strlen(before) : 0;

	while (n && before[n - 1] == '\n')
		n--;
	if ((n && (put(&line, before, n, e) || put(&line, "\n", 1, e))) ||
	    put_command(&line, argc, argv, aside, e) || put(&line, "", 1, e)) {
		free(line.data);
		return NULL;
	}
	return line.data;
}
