/* reference: the yardstick; unbiased pictures and irradiance by Monte Carlo. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/cache/cache.h"
#include "formats/cache/mesh_file.h"
#include "formats/container/atomic_file.h"
#include "formats/picture/exr_file.h"
#include "lib/base/mem.h"
#include "lib/picture/camera.h"
#include "lib/reference/pathtrace.h"
#include "tools/common/cli.h"
#include "tools/common/key.h"

/* Paths a pixel and particles where --samples is not given: seconds for a small scene. Guesses. */
enum { PICTURE_SAMPLES = 64, PARTICLES = 1000000 };

struct reference {
	struct cli cli;
	/* options */
	const char *mesh, *output, *camera;
	int size[2], irradiance;
	struct pathtrace_options o;
	struct exr_file_options exr;
	/* the work */
	struct model m;
	struct cache_info info;
	struct view_frame frame;
	const struct camera *view;
	char key[KEY_BYTES];
	struct ray_scene *rays;
	struct pathtrace *tracer;
	FILE *results;              /* stderr when the output goes to stdout */
};

/* ---- options ---- */

#define REQUEST struct reference

/* What says which view is in the key as its camera and size. */
static const struct option_spec option_table[] = {
	{ 'c', "camera", "NAME", "camera to render", TEXT(camera), .role = OPTION_RECORDED },
	{ 'o', "output", "FILE", "picture (EXR) or table (CSV) to write; - for standard output",
	  TEXT(output), .role = OPTION_ASIDE },
	{ 's', "size", "WxH", "pixels (default: 640 wide, height from the camera's aspect)",
	  RESOLUTION(size), .role = OPTION_RECORDED },
	{ 0, "irradiance", NULL, "irradiance of all element-sides by particles", FLAG(irradiance) },
	{ 0, "samples", "N", "paths in each pixel (default: 64), or particles (1000000)",
	  INTEGER(o.samples, 1, 1000000000000) },
	{ 0, "centre", NULL, "sample each pixel at its centre, as trace --samples 1 does",
	  FLAG(o.centre) },
	{ 0, "seed", "N", "start of the random numbers (default: %s)",
	  INTEGER(o.seed, 0, INT64_MAX) },
	{ 0, "compression", "METHOD", "%s (default), zip, zips, piz, rle or none",
	  WORD(exr.compression, file_exr_compression_name) },
	{ 0 }
};

static void settle(struct reference *r, int operand)
{
	const struct cli *c = &r->cli;

	if (c->argc - operand != 1)
		cli_usage(c, c->argc == operand ? "a .mesh file is needed" : "one .mesh file at a time");
	r->mesh = c->argv[operand];
	cli_keep_input(c, r->output, r->mesh);
	if (r->irradiance && (r->camera || r->size[0]))
		cli_usage(c, "--irradiance has no camera and no size");
	if (r->irradiance && r->o.centre)
		cli_usage(c, "--irradiance has no pixels to sample at their centres");
	if (!r->output && !r->irradiance)
		cli_usage(c, "-o is needed: the picture to write");
	if (!r->output)
		r->output = "-";
	if (!r->o.samples)
		r->o.samples = r->irradiance ? PARTICLES : PICTURE_SAMPLES;
	if (r->irradiance && r->o.samples < 2)
		cli_usage(c, "--samples: a standard error needs at least 2 particles");
	r->o.threads = r->cli.threads;
	r->results = strcmp(r->output, "-") == 0 ? stderr : stdout;
}

/* ---- what is to be made ---- */

/* Everything a picture depends on. */
static void picture_key(struct reference *r, const char *content)
{
	const int size[] = { r->frame.width, r->frame.height };
	struct digest *d = key_begin(&r->cli, r);
	char camera[33];

	file_cache_camera_id(r->view, camera);
	file_digest_string(d, content);
	file_digest_string(d, camera);
	file_digest_bytes(d, size, sizeof size);
	key_end(d, r->key);
}

static int choose_view(struct reference *r, const char *content, struct err *e)
{
	struct err why = { 0 };
	int i = !r->camera && r->m.cameras == 1
	      ? 0 /* a scene's only camera need not be named */
	      : picture_camera_find(&r->m, r->camera ? r->camera : "", &why);

	if (i < 0)
		return err_set(e, "%s: %s%s", r->mesh, r->camera ? "" : "a camera is needed (-c); ",
		               why.text);
	r->view = &r->m.camera[i];
	if (picture_camera_frame(r->view, r->size[0], r->size[1], &r->frame, e))
		return -1;
	picture_key(r, content);
	return 0;
}

static int read_scene(struct reference *r, struct err *e)
{
	struct container *c = file_container_open(r->mesh, "twopass.mesh", e);
	char content[33];

	if (!c)
		return -1;
	file_container_digest(c, content);
	file_container_close(c);
	if (file_mesh_read(r->mesh, &r->m, &r->info, e))
		return -1;
	return r->irradiance ? 0 : choose_view(r, content, e);
}

static int prepare(struct reference *r, struct err *e)
{
	struct err why = { 0 };

	r->rays = ray_scene_new(&r->m, e);
	if (!r->rays)
		return -1;
	r->tracer = pathtrace_new(&r->m, r->rays, &why);
	return r->tracer ? 0 : err_set(e, "%s: %s", r->mesh, why.text);
}

/* ---- pictures ---- */

static int describe(const struct reference *r, double relative, const char *history,
                    struct exr_file_info *info, struct err *e)
{
	char statistics[160], error[48] = "null";

	if (isfinite(relative))
		snprintf(error, sizeof error, "%.9g", relative);
	snprintf(statistics, sizeof statistics,
	         "{\"samples\": %ld, \"seed\": %" PRIu64 ", \"relative_standard_error\": %s}",
	         r->o.samples, r->o.seed, error);
	info->white_luminance = 1;
	info->has_world_to_camera = 1;
	picture_camera_world_to_camera(&r->frame, info->world_to_camera);
	return file_exr_info_set(info, EXR_FILE_CAMERA, r->view->name, e) ||
	       file_exr_info_set(info, EXR_FILE_HISTORY, history, e) ||
	       file_exr_info_set(info, EXR_FILE_KEY, r->key, e) ||
	       file_exr_info_set(info, "statistics", statistics, e) ? -1 : 0;
}

static int write_picture(const struct reference *r, double relative, const struct image *im,
                         struct err *e)
{
	struct exr_file_info info = { 0 };
	char *history = options_history(&r->cli, r->info.history, e);
	int bad = !history || describe(r, relative, history, &info, e) ||
	          file_exr_write(r->output, im, &info, &r->exr, NULL, e);

	file_exr_info_free(&info);
	free(history);
	return bad ? -1 : 0;
}

static void report_picture(const struct reference *r, double relative, double seconds)
{
	if (r->cli.quiet)
		return;
	fprintf(r->results, "%s: %s, %d x %d, %ld sample%s a pixel in %.3f s", r->output,
	        r->view->name, r->frame.width, r->frame.height, r->o.samples,
	        r->o.samples == 1 ? "" : "s", seconds);
	if (isfinite(relative))
		fprintf(r->results, "; standard error %.3g of the mean\n", relative);
	else
		fprintf(r->results, "; standard error unknown\n");
}

static int make_picture(const struct reference *r, struct err *e)
{
	struct image im = { 0 };
	struct cli_progress bar;
	double relative, begun = cli_seconds();
	struct progress progress = cli_progress_begin(&bar, &r->cli, r->view->name);
	int bad = pathtrace_picture(r->tracer, &r->frame, &r->o, &progress, &im, &relative, e);

	cli_progress_end(&bar);
	double seconds = cli_seconds() - begun;
	bad = bad || write_picture(r, relative, &im, e);
	picture_image_free(&im);
	if (bad)
		return -1;
	report_picture(r, relative, seconds);
	if (pathtrace_misses(r->tracer))
		cli_warn(&r->cli, "%s: light of punctual lights that curved mirrors turn, or plane "
		         "ones very often, is missing from the picture; compare --irradiance", r->mesh);
	if (pathtrace_diverges(&r->m))
		cli_warn(&r->cli, "%s: the variance of eye paths over the paper's lobe diverges: do "
		         "not rely on the picture's standard error; compare --irradiance, or use "
		         "'mesh --lobe reciprocal'", r->mesh);
	return 0;
}

/* ---- irradiance ---- */

/* RFC 4180 */
static void put_name(FILE *f, const char *name)
{
	if (!name[strcspn(name, ",\"\r\n")]) {
		fputs(name, f);
		return;
	}
	putc('"', f);
	for (; *name; name++) {
		if (*name == '"')
			putc('"', f);
		putc(*name, f);
	}
	putc('"', f);
}

static void put_table(FILE *f, const struct model *m, const struct pathtrace_irradiance *h)
{
	size_t bands = (size_t)m->bands;

	fputs("element,side,patch,name,area", f);
	for (size_t b = 0; b < bands; b++)
		fprintf(f, ",H_%zu", b);
	for (size_t b = 0; b < bands; b++)
		fprintf(f, ",SE_%zu", b);
	putc('\n', f);
	for (size_t row = 0; row < 2 * m->element.n; row++) {
		uint32_t patch = m->element.patch[row / 2];
		if (!model_side_modelled(m, 2 * patch + (uint32_t)(row % 2)))
			continue;
		fprintf(f, "%zu,%s,%" PRIu32 ",", row / 2, row % 2 ? "back" : "front", patch);
		put_name(f, m->surface.name[m->patch.surface[patch]]);
		fprintf(f, ",%.17g", m->element.area[row / 2]);
		for (size_t b = 0; b < bands; b++)
			fprintf(f, ",%.17g", h->h[row * bands + b]);
		for (size_t b = 0; b < bands; b++)
			fprintf(f, ",%.17g", h->error[row * bands + b]);
		putc('\n', f);
	}
}

static int write_table(const struct reference *r, const struct pathtrace_irradiance *h,
                       struct err *e)
{
	char *text = NULL;
	size_t length = 0;
	FILE *f = open_memstream(&text, &length);
	int bad;

	if (!f)
		return err_set(e, "%s: out of memory", r->output);
	put_table(f, &r->m, h);
	bad = ferror(f);
	bad |= fclose(f);
	bad = bad ? err_set(e, "%s: out of memory", r->output)
	          : file_atomic_put(r->output, text, length, e);
	free(text);
	return bad;
}

static void report_irradiance(const struct reference *r, const struct pathtrace_irradiance *h,
                              double seconds)
{
	if (r->cli.quiet)
		return;
	fprintf(r->results, "%s: %ld particles in %.3f s\n", r->output, r->o.samples, seconds);
	fprintf(r->results, "escaped, as a fraction of what is emitted:");
	for (int b = 0; b < r->m.bands; b++)
		if (h->emitted[b] > 0)
			fprintf(r->results, " %.6g +- %.2g", h->escaped[b] / h->emitted[b],
			        h->escaped_error[b] / h->emitted[b]);
		else
			fprintf(r->results, " -");
	putc('\n', r->results);
}

static int make_irradiance(const struct reference *r, struct err *e)
{
	struct pathtrace_irradiance h = { 0 };
	struct cli_progress bar;
	double begun = cli_seconds();
	struct progress progress = cli_progress_begin(&bar, &r->cli, "particles");
	int bad = pathtrace_particles(r->tracer, &r->o, &progress, &h, e);

	cli_progress_end(&bar);
	double seconds = cli_seconds() - begun;
	bad = bad || write_table(r, &h, e);
	if (!bad)
		report_irradiance(r, &h, seconds);
	pathtrace_irradiance_free(&h);
	return bad ? -1 : 0;
}

static int run(struct reference *r, struct err *e)
{
	if (read_scene(r, e))
		return -1;
	enum key_fit fit = r->irradiance ? KEY_DIFFERS
	                 : file_exr_up_to_date(r->output, r->key, r->cli.any_version);
	if (fit) {
		key_kept(&r->cli, r->output, fit);
		return 0;
	}
	if (file_atomic_check(r->output, e) || prepare(r, e) ||
	    (r->irradiance ? make_irradiance(r, e) : make_picture(r, e)))
		return -1;
	cli_detail(&r->cli, "peak memory %.0f MB", cli_peak_megabytes());
	return 0;
}

int main(int argc, char **argv)
{
	struct reference r = {
		.cli = { .program = "reference",
		         .synopsis = "[options] FILE.mesh -c CAMERA -o PICTURE.exr\n"
		                     "       reference [options] FILE.mesh --irradiance [-o TABLE.csv]",
		         .about = "Solve a scene by unbiased Monte Carlo, to compare with.",
		         .options = option_table, .uses_threads = 1, .keeps_output = 1 },
		.o.seed = 1
	};
	struct err e = { 0 };
	int status = 0;

	cli_signals();
	settle(&r, options_parse(&r.cli, argc, argv, &r));
	if (run(&r, &e))
		status = cli_fail(&r.cli, &e);
	pathtrace_free(r.tracer);
	ray_scene_free(r.rays);
	file_cache_info_free(&r.info);
	model_free(&r.m);
	return cli_finish(&r.cli, status);
}
