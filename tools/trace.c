/* trace: the view-dependent pass; pictures of a solved scene. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/cache/cache.h"
#include "formats/cache/camera_file.h"
#include "formats/cache/rad_file.h"
#include "formats/container/atomic_file.h"
#include "formats/picture/exr_file.h"
#include "lib/base/mem.h"
#include "lib/picture/camera.h"
#include "lib/radiosity/light_groups.h"
#include "lib/view/view.h"
#include "tools/common/cli.h"
#include "tools/common/key.h"
#include "tools/common/pattern.h"

/* Samples of a pixel at most, where an error is aimed at and they are not given: four times
 * less noise than the usual 4 have. A guess. */
enum { TARGET_SAMPLES = 64 };

/* A picture to be made. */
struct shot {
	const struct camera *camera;
	struct view_frame frame;
	char *path;
	char key[KEY_BYTES];
	int done;
};

struct trace {
	struct cli cli;
	/* options */
	const char *rad, *output;
	char *mix;                  /* of all --mix together */
	struct option_list camera;  /* names asked for */
	int all;                    /* 1: every camera, as one of them says */
	int size[2];                /* of the picture, or 0 */
	double eye[3], target[3], up[3], fov;
	enum view_method method;
	int paper;
	double budget;              /* seconds for a picture; 0: not given */
	struct view_options view;
	struct exr_file_options exr;
	/* the work */
	char content[33];           /* digest of the .rad but for its cameras */
	struct model cameras_of;    /* only cameras filled in */
	struct camera ad_hoc;
	struct shot *shot;
	size_t shots;
	struct model m;
	struct solution s;
	struct cache_info info;
	struct ray_scene *rays;
	struct view_scene *scene;
	char *history;
	char ready[1024];           /* what reading and building took */
	FILE *results;              /* stderr when the picture goes to stdout */
};

/* ---- options ---- */

#define REQUEST struct trace

static const char *const methods[] = { "mesh", "direct", "gather", NULL };

/* What says which views there are is in the key as camera and size of each. */
static const struct option_spec option_table[] = {
	{ 'c', "camera", "NAME", "camera to render; repeatable, or 'all'", LIST(camera),
	  .role = OPTION_RECORDED },
	{ 'o', "output", "FILE", "picture to write (EXR); %s stands for the camera's name",
	  TEXT(output), .role = OPTION_ASIDE },
	{ 's', "size", "WxH", "pixels (default: 640 wide, height from the camera's aspect)",
	  RESOLUTION(size), .role = OPTION_RECORDED },
	{ 0, "eye", "X,Y,Z", "render a view from this point", VECTOR(eye), .role = OPTION_RECORDED },
	{ 0, "target", "X,Y,Z", "point it looks at", VECTOR(target), .role = OPTION_RECORDED },
	{ 0, "up", "X,Y,Z", "its upright direction (default: %s)", VECTOR(up),
	  .role = OPTION_RECORDED },
	{ 0, "fov", "DEGREES", "its vertical field of view (default: %s)", NUMBER(fov, 1e-3, 179.9),
	  .role = OPTION_RECORDED },
	{ 'd', "diffuse", "METHOD",
	  "where diffuse light comes from: mesh, %s (default), gather", WORD(method, methods) },
	{ 0, "paper", NULL, "the paper's pass 2: -d mesh, and lobes along their axes alone", FLAG(paper) },
	{ 't', "error", "X", "relative standard error of pixels at which sampling stops",
	  NUMBER(view.relative, 1e-6, 1) },
	{ 0, "budget", "SECONDS", "as many samples and rays as fit in, for each picture",
	  NUMBER(budget, 1e-3, 1e9) },
	{ 0, "samples", "N", "positions in each pixel (default: %s; 1: its centre)",
	  INTEGER(view.samples, 1, 1 << 16) },
	{ 0, "lobe-samples", "N",
	  "samples of a finite lobe (default: by their noise; 0: one ray about its axis)",
	  INTEGER(view.lobe_samples, 0, 1 << 16) },
	{ 0, "gather-rays", "N", "rays that -d gather takes at a point (default: %s)",
	  INTEGER(view.gather_rays, 4, 1 << 20) },
	{ 0, "depth", "N", "directional events that are followed (default: %s)",
	  INTEGER(view.depth, 0, 100000) },
	{ 0, "cutoff", "X", "cut tails that carry less than this part (default: 0.001)",
	  NUMBER(view.cutoff, 0, 1) },
	{ 0, "layers", "LIST",
	  "also diffuse,directional,emission,Z,N,element,patch,error or all",
	  SET(view.layers, view_layer_name) },
	{ 0, "half", NULL, "colours as 16-bit floats", FLAG(exr.half) },
	{ 0, "compression", "METHOD", "%s (default), zip, zips, piz, rle or none",
	  WORD(exr.compression, file_exr_compression_name) },
	{ 0, "mix", "NAME=X,...", "scale the light of groups by X, or X:X:X for each band",
	  JOINED(mix) },
	{ 0 }
};

static void settle_paper(struct trace *t)
{
	const struct cli *c = &t->cli;

	if (options_given(c, "diffuse") || options_given(c, "lobe-samples") ||
	    options_given(c, "gather-rays"))
		cli_usage(c, "--paper goes without -d, --lobe-samples and --gather-rays, which it sets");
	t->method = VIEW_MESH;
	t->view.lobe_samples = 0;
}

static void settle(struct trace *t, int operand)
{
	const struct cli *c = &t->cli;
	int has_eye = options_given(c, "eye");

	if (c->argc - operand != 1)
		cli_usage(c, c->argc == operand ? "a .rad file is needed" : "one .rad file at a time");
	t->rad = c->argv[operand];
	cli_keep_input(c, t->output, t->rad);
	if (!t->output)
		cli_usage(c, "-o is needed: the picture to write");
	if (has_eye != options_given(c, "target"))
		cli_usage(c, "--eye and --target go together");
	if (!has_eye && (options_given(c, "up") || options_given(c, "fov")))
		cli_usage(c, "--up and --fov belong to a view by --eye and --target");
	if (t->budget > 0 && (t->view.relative > 0 || options_given(c, "samples") ||
	                      options_given(c, "gather-rays")))
		cli_usage(c, "--budget goes without -t, --samples and --gather-rays, which it chooses");
	if (t->paper)
		settle_paper(t);
	if (!options_given(c, "samples") && t->view.relative > 0)
		t->view.samples = TARGET_SAMPLES;
	for (size_t i = 0; i < t->camera.n; i++)
		t->all |= strcmp(t->camera.item[i], "all") == 0;
	t->view.threads = t->cli.threads;
	t->results = strcmp(t->output, "-") == 0 ? stderr : stdout;
}

/* ---- what is to be made ---- */

static int ad_hoc_camera(struct trace *t, struct err *e)
{
	static const double minus_z[3] = { 0, 0, -1 };
	struct err steep = { 0 }, *why = options_given(&t->cli, "up") ? e : &steep;

	/* -Z does for looking straight up or down. */
	if (picture_camera_look_at(t->eye, t->target, t->up, t->fov, &t->ad_hoc, why) &&
	    (why == e || picture_camera_look_at(t->eye, t->target, minus_z, t->fov, &t->ad_hoc, e)))
		return -1;
	t->ad_hoc.name = mem_new(1, sizeof "view", "name", e);
	return t->ad_hoc.name ? (void)strcpy(t->ad_hoc.name, "view"), 0 : -1;
}

/* Everything a picture depends on. */
static void picture_key(const struct trace *t, struct shot *s)
{
	const int size[] = { s->frame.width, s->frame.height };
	struct digest *d = key_begin(&t->cli, t);
	char camera[33];

	file_cache_camera_id(s->camera, camera);
	file_digest_string(d, t->content);
	file_digest_string(d, camera);
	file_digest_bytes(d, size, sizeof size);
	key_end(d, s->key);
}

static int add_shot(struct trace *t, const struct camera *c, struct err *e)
{
	struct shot *s = &t->shot[t->shots++];

	s->camera = c;
	s->path = pattern_fill(t->output, c->name, e);
	if (!s->path || picture_camera_frame(c, t->size[0], t->size[1], &s->frame, e))
		return -1;
	for (const struct shot *p = t->shot; p < s; p++)
		if (strcmp(p->path, s->path) == 0)
			return err_set(e, "%s: cameras '%s' and '%s' would both be written there; "
			               "put %%s into -o", s->path, p->camera->name, c->name);
	picture_key(t, s);
	return 0;
}

static int list_shots(struct trace *t, struct err *e)
{
	const struct model *m = &t->cameras_of;
	int has_eye = options_given(&t->cli, "eye");

	t->shot = mem_new(m->cameras + t->camera.n + 1, sizeof *t->shot, "views", e);
	if (!t->shot || (has_eye && (ad_hoc_camera(t, e) || add_shot(t, &t->ad_hoc, e))))
		return -1;
	if (t->all && m->cameras == 0)
		return err_set(e, "%s: has no cameras; give a view by --eye and --target", t->rad);
	/* A scene's only camera need not be named. */
	if (!has_eye && !t->all && t->camera.n == 0 && m->cameras == 1)
		t->all = 1;
	for (size_t i = 0; i < m->cameras && t->all; i++)
		if (add_shot(t, &m->camera[i], e))
			return -1;
	for (size_t i = 0; i < t->camera.n && !t->all; i++) {
		struct err why = { 0 };
		int k = picture_camera_find(m, t->camera.item[i], &why);
		if (k < 0)
			return err_set(e, "%s: %s", t->rad, why.text);
		if (add_shot(t, &m->camera[k], e))
			return -1;
	}
	if (t->shots == 0) {
		struct err why = { 0 };
		picture_camera_find(m, NULL, &why);
		return err_set(e, "%s: %s", t->rad, why.text);
	}
	return 0;
}

/* Reads what the header and the cameras say, and decides what has to be done. */
static int plan(struct trace *t, struct err *e)
{
	struct container *c = file_container_open(t->rad, "twopass.rad", e);
	int bad = c ? file_camera_get(c, &t->cameras_of, e) : -1;

	if (!bad)
		file_container_digest(c, t->content);
	file_container_close(c);
	return bad ? -1 : list_shots(t, e);
}

/* ---- the work ---- */

static int read_scene(struct trace *t, struct err *e)
{
	double begun = cli_seconds();
	struct err why = { 0 };

	if (file_rad_read(t->rad, &t->m, &t->s, &t->info, e))
		return -1;
	if (t->mix && radiosity_groups_mix(&t->s, &t->m, t->mix, &why))
		return err_set(e, "%s: --mix: %s", t->rad, why.text);
	t->history = options_history(&t->cli, t->info.history, e);
	double read = cli_seconds();
	t->rays = ray_scene_new(&t->m, e);
	if (!t->history || !t->rays)
		return -1;
	double built = cli_seconds();
	t->scene = view_scene_new(&t->m, &t->s, t->rays, t->method, t->view.threads, e);
	double ready = cli_seconds();
	snprintf(t->ready, sizeof t->ready, "%s: %zu triangles, %zu elements, %d band%s; read "
	         "in %.3f s, ray structure in %.3f s, interpolation in %.3f s", t->rad,
	         t->m.triangle.n, t->m.element.n, t->m.bands, t->m.bands == 1 ? "" : "s",
	         read - begun, built - read, ready - built);
	if (!t->scene)
		return -1;
	if (view_misses(t->scene))
		cli_warn(&t->cli, "%s: highlights of punctual lights that curved mirrors turn, or plane "
		         "ones very often, are not modelled", t->rad);
	return 0;
}

/* The bound on what is missing, relative to the picture's mean radiance. */
static void cut_text(const struct view_stats *s, char *text, size_t size)
{
	if (s->cut == 0)
		snprintf(text, size, "nothing cut");
	else if (isfinite(s->cut) && s->radiance > 0)
		snprintf(text, size, "cut tails hold at most %.2g of the mean radiance",
		         s->cut / s->radiance);
	else
		snprintf(text, size, "cut tails have no finite bound");
}

static int describe(const struct trace *t, const struct shot *s, const struct view_stats *v,
                    struct exr_file_info *info, struct err *e)
{
	char statistics[256], cut[48] = "null";

	if (isfinite(v->cut))
		snprintf(cut, sizeof cut, "%.9g", v->cut);
	snprintf(statistics, sizeof statistics,
	         "{\"samples\": %d, \"rays\": %" PRIu64 ", \"mean_radiance\": %.9g, "
	         "\"cut_bound\": %s, \"relative_error\": %.9g}", t->view.samples, v->rays,
	         v->radiance, cut, v->error);
	info->white_luminance = 1;
	info->has_world_to_camera = 1;
	picture_camera_world_to_camera(&s->frame, info->world_to_camera);
	return file_exr_info_set(info, EXR_FILE_CAMERA, s->camera->name, e) ||
	       file_exr_info_set(info, EXR_FILE_HISTORY, t->history, e) ||
	       file_exr_info_set(info, EXR_FILE_KEY, s->key, e) ||
	       file_exr_info_set(info, "statistics", statistics, e) ? -1 : 0;
}

/* Is some colour too bright for 32-bit floats? */
static int beyond_float(const struct image *im)
{
	static const char *const colour[] = { "R", "G", "B" };
	size_t pixels = (size_t)im->width * (size_t)im->height;

	for (int c = 0; c < 3; c++) {
		const float *plane = picture_image_plane(im, picture_image_channel(im, colour[c]));
		for (size_t i = 0; i < pixels; i++)
			if (!isfinite(plane[i]))
				return 1;
	}
	return 0;
}

static int write_picture(const struct trace *t, const struct shot *s,
                         const struct view_stats *v, const struct image *im, struct err *e)
{
	struct exr_file_info info = { 0 };
	size_t clipped = 0;

	if (beyond_float(im))
		return err_set(e, "%s: radiance is beyond the range of 32-bit floats; scale down what "
		               "emits, or --mix", s->path);
	int bad = describe(t, s, v, &info, e) ||
	          file_exr_write(s->path, im, &info, &t->exr, &clipped, e);

	file_exr_info_free(&info);
	if (!bad && clipped)
		cli_warn(&t->cli, "%s: %zu values beyond the range of --half were clipped", s->path,
		         clipped);
	return bad ? -1 : 0;
}

/* The best picture that the budget allows: a coarse one first, then as many times its
 * samples and rays as fit in the time that is left. */
static int render_within(const struct trace *t, const struct shot *s,
                         const struct progress *progress, struct image *im, struct view_stats *v,
                         struct err *e)
{
	/* Doublings of the first picture at most, which has 4096 samples a pixel then. And it has an
	 * eighth of the usual rays, so that it takes little of the budget; a tenth of what is left is
	 * kept for what a picture takes longer than the last one foretells. Guesses. */
	enum { MOST = 12, FIRST_RAYS = 8 };
	const double spent = .9;
	struct view_options o = t->view;
	double begun = cli_seconds(), last = begun;
	int level = 0, bad;

	for (;;) {
		picture_image_free(im);
		*im = (struct image){ 0 };
		o.samples = 1 << level;
		o.gather_rays = t->view.gather_rays / FIRST_RAYS << level;
		bad = view_render(t->scene, &s->frame, &o, progress, im, v, e);
		double now = cli_seconds(), left = t->budget - (now - begun);
		double more = now > last ? spent * left / (now - last) : 0;
		if (bad || more < 2 || level == MOST)
			return bad;
		level = (int)fmin(MOST, level + floor(log2(more)));
		last = now;
	}
}

static int render(const struct trace *t, const struct shot *s, struct err *e)
{
	struct view_stats v = { 0 };
	struct image im = { 0 };
	struct cli_progress bar;
	char cut[96];
	double begun = cli_seconds();
	struct progress progress = cli_progress_begin(&bar, &t->cli, s->camera->name);
	int bad = t->budget > 0
	        ? render_within(t, s, &progress, &im, &v, e)
	        : view_render(t->scene, &s->frame, &t->view, &progress, &im, &v, e);

	cli_progress_end(&bar);
	double seconds = cli_seconds() - begun;
	bad = bad || write_picture(t, s, &v, &im, e);
	double writing = cli_seconds() - begun - seconds;
	picture_image_free(&im);
	if (bad)
		return -1;
	cut_text(&v, cut, sizeof cut);
	if (!t->cli.quiet)
		fprintf(t->results, "%s: %s, %d x %d, %" PRIu64 " rays in %.3f s (%.2f Mray/s), "
		        "written in %.3f s; estimated relative rmse %.2g; %s\n", s->path,
		        s->camera->name, s->frame.width,
		        s->frame.height, v.rays, seconds, (double)v.rays / seconds / 1e6, writing,
		        v.error, cut);
	return 0;
}

static int run(struct trace *t, struct err *e)
{
	size_t left = 0;

	if (plan(t, e))
		return -1;
	for (struct shot *s = t->shot; s < t->shot + t->shots; s++) {
		enum key_fit fit = file_exr_up_to_date(s->path, s->key, t->cli.any_version);
		s->done = fit != KEY_DIFFERS;
		left += !s->done;
		if (s->done)
			key_kept(&t->cli, s->path, fit);
		else if (file_atomic_check(s->path, e))
			return -1;
	}
	if (left == 0)
		return 0;
	if (read_scene(t, e))
		return -1;
	for (const struct shot *s = t->shot; s < t->shot + t->shots; s++)
		if (!s->done && render(t, s, e))
			return -1;
	if (!t->cli.quiet)
		fprintf(t->results, "%s; peak memory %.0f MB\n", t->ready, cli_peak_megabytes());
	return 0;
}

static void release(struct trace *t)
{
	for (size_t i = 0; i < t->shots; i++)
		free(t->shot[i].path);
	free(t->shot);
	free(t->camera.item);
	free(t->mix);
	free(t->ad_hoc.name);
	free(t->history);
	view_scene_free(t->scene);
	ray_scene_free(t->rays);
	solution_free(&t->s);
	model_free(&t->m);
	model_free(&t->cameras_of);
	file_cache_info_free(&t->info);
}

int main(int argc, char **argv)
{
	struct trace t = {
		.cli = { .program = "trace", .synopsis = "[options] FILE.rad -o PICTURE.exr",
		         .about = "Render views of a solved scene, following mirrors, panes and lobes.",
		         .options = option_table, .uses_threads = 1, .keeps_output = 1 },
		.up = CAMERA_UP, .fov = CAMERA_FOV, .method = VIEW_DIRECT,
		.view = VIEW_OPTIONS_DEFAULT
	};
	struct err e = { 0 };
	int status = 0;

	cli_signals();
	settle(&t, options_parse(&t.cli, argc, argv, &t));
	if (run(&t, &e))
		status = cli_fail(&t.cli, &e);
	release(&t);
	return cli_finish(&t.cli, status);
}
