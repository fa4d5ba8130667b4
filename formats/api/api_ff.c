/* Form factors, in a file that is mapped. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "formats/api/api_scene.h"
#include "lib/ff/ff_build.h"

_Static_assert((int)TWOPASS_RAYS == (int)FF_RAYS && (int)TWOPASS_HEMICUBE == (int)FF_HEMICUBE &&
               (int)TWOPASS_ANALYTIC == (int)FF_ANALYTIC && (int)TWOPASS_AUTO == (int)FF_AUTO,
               "methods of the public header");

struct twopass_ff_options twopass_ff_defaults(void)
{
	const struct ff_options o = FF_OPTIONS_DEFAULT;

	return (struct twopass_ff_options){
		.method = (enum twopass_method)o.method, .samples = o.rays, .target = o.target,
		.to_patches = o.to_patches, .close = o.close, .f64 = o.f64, .seed = o.seed };
}

static int ff_options(const struct twopass_ff_options *from, struct ff_options *o, struct err *e)
{
	*o = FF_OPTIONS_DEFAULT;
	o->method = (enum ff_method)from->method;
	o->rays = from->samples;
	o->target = from->target;
	o->to_patches = from->to_patches != 0;
	o->close = from->close;
	o->f64 = from->f64 != 0;
	o->seed = from->seed;
	o->threads = api_threads(from->threads);
	return api_within("method", (double)from->method, 0, TWOPASS_AUTO, e) ||
	       (o->rays && api_within("samples", o->rays, 4, 1 << 26, e)) ||
	       (o->target != 0 && api_within("target", o->target, 1e-12, 1, e)) ||
	       ff_options_complete(o, e) ? -1 : 0;
}

static int put(void *arg, const struct ff *batch, struct err *e)
{
	return file_ff_append(arg, batch, e);
}

static int compute(const struct twopass_scene *s, const struct ff_options *o, const char *path,
                   struct err *e)
{
	struct cache_info info = { 0 };
	struct ff whole = { 0 };
	struct ff_stats stats;
	struct ff_writer *w = file_ff_create(path, &s->m, o->f64, o->to_patches, e);
	struct ff_sink sink = { put, w };

	if (!w)
		return -1;
	int bad = api_history(&info, s->info.history, "twopass_form_factors", NULL, e) ||
	          ff_build(&s->m, o, &whole, &stats, &sink, NULL, e);
	if (bad)
		file_ff_abandon(w);
	else
		bad = file_ff_finish(w, &whole, &info, e);
	ff_free(&whole);
	file_cache_info_free(&info);
	return bad;
}

static int open_file(struct twopass_scene *s, const char *path, struct err *e)
{
	ff_patch_matrix_free(&s->matrix);
	file_ff_close(&s->ff);
	return file_ff_open(path, &s->m, &s->info, &s->ff, e) ||
	       ff_patch_matrix_init(&s->matrix, &s->ff.f, &s->ff.scene, e) ? -1 : 0;
}

/* A mapped file is there as long as it is open, whatever becomes of its name. */
static int compute_unnamed(struct twopass_scene *s, const struct ff_options *o, struct err *e)
{
	const char *folder = getenv("TMPDIR");
	char path[4096];
	int n = snprintf(path, sizeof path, "%s/twopass.XXXXXX",
	                 folder && *folder ? folder : "/tmp");
	int fd = n < (int)sizeof path ? mkstemp(path) : -1;

	if (fd < 0)
		return err_set(e, "%s: cannot make a temporary file", path);
	close(fd);
	int bad = compute(s, o, path, e) || open_file(s, path, e);
	unlink(path);
	return bad;
}

int twopass_form_factors(struct twopass_scene *s, const struct twopass_ff_options *options,
                         const char *path, struct twopass_error *error)
{
	const struct twopass_ff_options usual = twopass_ff_defaults();
	struct ff_options o;
	struct err e = { 0 };

	if (path && strcmp(path, "-") == 0)
		err_set(&e, "form factors cannot go to standard output; name a file");
	else if (ff_options(options ? options : &usual, &o, &e) == 0)
		(void)(path ? compute(s, &o, path, &e) || open_file(s, path, &e)
		            : compute_unnamed(s, &o, &e));
	return api_status(&e, error);
}

int twopass_read_form_factors(struct twopass_scene *s, const char *path,
                              struct twopass_error *error)
{
	struct err e = { 0 };

	(void)open_file(s, path, &e);
	return api_status(&e, error);
}

int twopass_form_factor_row(const struct twopass_scene *s, size_t i, double *to,
                            double *row_error, struct twopass_error *error)
{
	struct err e = { 0 };

	if (!s->matrix.f) {
		err_set(&e, "the scene has no form factors");
	} else if (i >= s->patches) {
		err_set(&e, "there is no patch-side %zu; there are %zu", i, s->patches);
	} else {
		const uint32_t row = s->matrix.row[i];
		ff_patch_matrix_row(&s->matrix, i, to, &to[s->patches], &to[s->patches + 1]);
		if (row_error)
			*row_error = row == FF_NO_ROW ? (double)NAN
			                              : (double)s->ff.f.row.error[row];
	}
	return api_status(&e, error);
}
