/* trace: the view-dependent pass; pictures of a solved scene. */
#include <getopt.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/cache/cache.h"
#include "formats/cache/camera_file.h"
#include "formats/cache/rad_file.h"
#include "formats/container/atomic_file.h"
#include "formats/container/digest.h"
#include "formats/container/history.h"
#include "formats/picture/exr_file.h"
#include "lib/base/mem.h"
#include "lib/picture/camera.h"
#include "lib/radiosity/light_groups.h"
#include "lib/view/view.h"
#include "tools/common/cli.h"
#include "tools/common/pattern.h"

enum { OPT_EYE = 256, OPT_TARGET, OPT_UP, OPT_FOV, OPT_SAMPLES, OPT_LOBE_SAMPLES, OPT_DEPTH,
       OPT_CUTOFF, OPT_HALF, OPT_COMPRESSION, OPT_LAYERS, OPT_MIX, OPT_GATHER_RAYS,
       OPT_BUDGET };

/* At most, where an error is aimed at. */
enum { TARGET_SAMPLES = 64 };

static const struct cli_option option_table[] = {
	{ 'c', "camera", "NAME", "camera to render; repeatable, or 'all'" },
	{ 'o', "output", "FILE", "picture to write (EXR); %s stands for the camera's name" },
	{ 's', "size", "WxH", "pixels (default: 640 wide, height from the camera's aspect)" },
	{ OPT_EYE, "eye", "X,Y,Z", "render a view from this point" },
	{ OPT_TARGET, "target", "X,Y,Z", "point it looks at" },
	{ OPT_UP, "up", "X,Y,Z", "its upright direction (default: 0,1,0)" },
	{ OPT_FOV, "fov", "DEGREES", "its vertical field of view (default: 50)" },
	{ 'd', "diffuse", "METHOD", "where diffuse light comes from: mesh, direct (default), gather" },
	{ 't', "error", "X", "relative standard error of pixels at which sampling stops" },
	{ OPT_BUDGET, "budget", "SECONDS", "as many samples and rays as fit in, for each picture" },
	{ OPT_SAMPLES, "samples", "N", "positions in each pixel (default: 4; 1: its centre)" },
	{ OPT_LOBE_SAMPLES, "lobe-samples", "N",
	  "samples of a finite lobe (default: by their noise; 0: one ray about its axis)" },
	{ OPT_GATHER_RAYS, "gather-rays", "N", "rays that -d gather takes at a point (default: 1024)" },
	{ OPT_DEPTH, "depth", "N", "directional events that are followed (default: 32)" },
	{ OPT_CUTOFF, "cutoff", "X", "cut tails that carry less than this part (default: 0.001)" },
	{ OPT_LAYERS, "layers", "LIST",
	  "also diffuse,directional,emission,Z,N,element,patch or all" },
	{ OPT_HALF, "half", NULL, "colours as 16-bit floats" },
	{ OPT_COMPRESSION, "compression", "METHOD", "auto (default), zip, zips, piz, rle or none" },
	{ OPT_MIX, "mix", "NAME=X,...",
	  "scale the light of groups by X, or X:X:X for each band" },
	{ 0, NULL, NULL, NULL }
};

/* A picture to be made. */
struct shot {
	const struct camera *camera;
	struct view_frame frame;
	char *path;
	char key[33];
	int done;
};

struct trace {
	struct cli cli;
	/* options */
	const char *rad, *output;
	char *mix;                  /* of all --mix together */
	const char **camera;        /* [cameras] names asked for */
	int cameras, all;
	int width, height;
	int has_eye, has_target, has_up;
	double eye[3], target[3], up[3], fov;
	enum view_method method;
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

/* Always 1: an option that is there. */
static int vector(const struct cli *c, const char *option, const char *text, double v[3])
{
	char extra;

	if (sscanf(text, "%lf,%lf,%lf%c", &v[0], &v[1], &v[2], &extra) != 3 ||
	    !isfinite(v[0] + v[1] + v[2]))
		cli_usage(c, "%s: '%s' is not three numbers X,Y,Z", option, text);
	return 1;
}

static void diffuse_method(struct trace *t, const char *text)
{
	static const char *const name[] = { "mesh", "direct", "gather" };

	for (int i = 0; i < 3; i++)
		if (strcmp(text, name[i]) == 0) {
			t->method = (enum view_method)i;
			return;
		}
	cli_usage(&t->cli, "--diffuse: there is no method '%s'; use mesh, direct or gather", text);
}

static void compression(struct trace *t, const char *text)
{
	int method = file_exr_compression_by_name(text);

	if (method < 0)
		cli_usage(&t->cli, "--compression: '%s' is none of auto, zip, zips, piz, rle, none", text);
	t->exr.compression = (enum exr_file_compression)method;
}

/* Appends to what was to be mixed before. */
static void take_mix(struct trace *t, const char *more)
{
	size_t n = t->mix ? strlen(t->mix) : 0, size = n + strlen(more) + 2;
	char *mix = realloc(t->mix, size);
	struct err e = { 0 };

	if (!mix) {
		err_set(&e, "out of memory for --mix");
		exit(cli_fail(&t->cli, &e));
	}
	snprintf(mix + n, size - n, "%s%s", n ? "," : "", more);
	t->mix = mix;
}

static void take_camera(struct trace *t, const char *name)
{
	if (strcmp(name, "all") == 0)
		t->all = 1;
	else
		t->camera[t->cameras++] = name;
}

static void take_option(struct trace *t, int letter)
{
	const struct cli *c = &t->cli;

	switch (letter) {
	case 'c': take_camera(t, optarg); break;
	case 'o': t->output = optarg; break;
	case 's':
		if (picture_camera_parse_size(optarg, &t->width, &t->height))
			cli_usage(c, "--size: '%s' is not a size such as 640x480", optarg);
		break;
	case 'd': diffuse_method(t, optarg); break;
	case OPT_EYE: t->has_eye = vector(c, "--eye", optarg, t->eye); break;
	case OPT_TARGET: t->has_target = vector(c, "--target", optarg, t->target); break;
	case OPT_UP: t->has_up = vector(c, "--up", optarg, t->up); break;
	case OPT_FOV: t->fov = cli_number(c, "--fov", optarg, 1e-3, 179.9); break;
	case 't': t->view.relative = cli_number(c, "-t", optarg, 1e-6, 1); break;
	case OPT_BUDGET: t->budget = cli_number(c, "--budget", optarg, 1e-3, 1e9); break;
	case OPT_SAMPLES:
		t->view.samples = (int)cli_integer(c, "--samples", optarg, 1, 1 << 16);
		break;
	case OPT_LOBE_SAMPLES:
		t->view.lobe_samples = (int)cli_integer(c, "--lobe-samples", optarg, 0, 1 << 16);
		break;
	case OPT_GATHER_RAYS:
		t->view.gather_rays = (int)cli_integer(c, "--gather-rays", optarg, 4, 1 << 20);
		break;
	case OPT_DEPTH:
		t->view.depth = (int)cli_integer(c, "--depth", optarg, 0, 100000);
		break;
	case OPT_CUTOFF: t->view.cutoff = cli_number(c, "--cutoff", optarg, 0, 1); break;
	case OPT_MIX: take_mix(t, optarg); break;
	case OPT_HALF: t->exr.half = 1; break;
	case OPT_COMPRESSION: compression(t, optarg); break;
	case OPT_LAYERS:
		if (view_parse_layers(optarg, &t->view.layers))
			cli_usage(c, "--layers: '%s' is not a list of diffuse, directional, emission, "
			          "Z, N, element, patch, error or all", optarg);
		break;
	}
}

static void parse(struct trace *t, int argc, char **argv)
{
	const struct cli *c = &t->cli;
	int letter;

	while ((letter = cli_next(&t->cli, argc, argv)) != -1)
		take_option(t, letter);
	if (argc - optind != 1)
		cli_usage(c, argc == optind ? "a .rad file is needed" : "one .rad file at a time");
	t->rad = argv[optind];
	cli_keep_input(c, t->output, t->rad);
	if (!t->output)
		cli_usage(c, "-o is needed: the picture to write");
	if (t->has_eye != t->has_target)
		cli_usage(c, "--eye and --target go together");
	if (!t->has_eye && (t->has_up || t->fov > 0))
		cli_usage(c, "--up and --fov belong to a view by --eye and --target");
	if (t->budget > 0 && (t->view.relative > 0 || t->view.samples || t->view.gather_rays))
		cli_usage(c, "--budget goes without -t, --samples and --gather-rays, which it chooses");
	if (!t->view.samples)
		t->view.samples = t->view.relative > 0 ? TARGET_SAMPLES
		                                        : VIEW_OPTIONS_DEFAULT.samples;
	if (!t->view.gather_rays)
		t->view.gather_rays = VIEW_OPTIONS_DEFAULT.gather_rays;
	t->view.threads = t->cli.threads;
	t->results = strcmp(t->output, "-") == 0 ? stderr : stdout;
}

/* ---- what is to be made ---- */

static int ad_hoc_camera(struct trace *t, struct err *e)
{
	static const double y[3] = { 0, 1, 0 }, minus_z[3] = { 0, 0, -1 };
	double fov = t->fov > 0 ? t->fov : CAMERA_FOV;
	struct err steep = { 0 };

	if (t->has_up) {
		if (picture_camera_look_at(t->eye, t->target, t->up, fov, &t->ad_hoc, e))
			return -1;
	} else if (picture_camera_look_at(t->eye, t->target, y, fov, &t->ad_hoc, &steep) &&
	           picture_camera_look_at(t->eye, t->target, minus_z, fov, &t->ad_hoc, e)) {
		return -1; /* -Z would do for looking straight up or down */
	}
	t->ad_hoc.name = mem_new(1, sizeof "view", "name", e);
	return t->ad_hoc.name ? (void)strcpy(t->ad_hoc.name, "view"), 0 : -1;
}

/* Everything that decides a picture's contents. */
static void picture_key(const struct trace *t, struct shot *s)
{
	const struct view_options *v = &t->view;
	const double number[] = { s->frame.width, s->frame.height, v->samples, v->lobe_samples,
		v->depth, v->cutoff, v->layers, t->method, v->gather_rays, v->relative, t->budget,
		t->exr.compression, t->exr.half };
	char camera[33];
	struct digest *d = file_digest_new();

	file_cache_camera_id(s->camera, camera);
	file_digest_string(d, "twopass.exr " TWOPASS_VERSION " " REVISION_VIEW);
	file_digest_string(d, t->content);
	file_digest_string(d, camera);
	file_digest_bytes(d, number, sizeof number);
	if (t->mix)
		file_digest_string(d, t->mix);
	file_digest_end(d, s->key);
}

static int add_shot(struct trace *t, const struct camera *c, struct err *e)
{
	struct shot *s = &t->shot[t->shots++];

	s->camera = c;
	s->path = pattern_fill(t->output, c->name, e);
	if (!s->path || picture_camera_frame(c, t->width, t->height, &s->frame, e))
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

	t->shot = mem_new(m->cameras + (size_t)t->cameras + 1, sizeof *t->shot, "views", e);
	if (!t->shot || (t->has_eye && (ad_hoc_camera(t, e) || add_shot(t, &t->ad_hoc, e))))
		return -1;
	if (t->all && m->cameras == 0)
		return err_set(e, "%s: has no cameras; give a view by --eye and --target", t->rad);
	/* A scene's only camera need not be named. */
	if (!t->has_eye && !t->all && t->cameras == 0 && m->cameras == 1)
		t->all = 1;
	for (size_t i = 0; i < m->cameras && t->all; i++)
		if (add_shot(t, &m->camera[i], e))
			return -1;
	for (int i = 0; i < t->cameras && !t->all; i++) {
		struct err why = { 0 };
		int k = picture_camera_find(m, t->camera[i], &why);
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

static int read_scene(struct trace *t, int argc, char **argv, struct err *e)
{
	double begun = cli_seconds();
	struct err why = { 0 };

	if (file_rad_read(t->rad, &t->m, &t->s, &t->info, e))
		return -1;
	if (t->mix && radiosity_groups_mix(&t->s, &t->m, t->mix, &why))
		return err_set(e, "%s: --mix: %s", t->rad, why.text);
	t->history = file_history_append(t->info.history, argc, argv, e);
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
static int render_within(const struct trace *t, const struct shot *s, const struct progress *progress,
                         struct image *im, struct view_stats *v, struct err *e)
{
	enum { MOST = 12 }; /* doublings */
	struct view_options o = t->view;
	double begun = cli_seconds(), last = begun;
	int level = 0, bad;

	for (;;) {
		picture_image_free(im);
		*im = (struct image){ 0 };
		o.samples = 1 << level;
		o.gather_rays = VIEW_OPTIONS_DEFAULT.gather_rays / 8 << level;
		bad = view_render(t->scene, &s->frame, &o, progress, im, v, e);
		double now = cli_seconds(), left = t->budget - (now - begun);
		double more = now > last ? .9 * left / (now - last) : 0;
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

static int run(struct trace *t, int argc, char **argv, struct err *e)
{
	size_t left = 0;

	if (plan(t, e))
		return -1;
	for (struct shot *s = t->shot; s < t->shot + t->shots; s++) {
		s->done = file_exr_up_to_date(s->path, s->key);
		left += !s->done;
		if (s->done)
			cli_note(&t->cli, "%s: up to date", s->path);
		else if (file_atomic_check(s->path, e))
			return -1;
	}
	if (left == 0)
		return 0;
	if (read_scene(t, argc, argv, e))
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
	free(t->camera);
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
		         .options = option_table, .uses_threads = 1 },
		.method = VIEW_DIRECT,
		.view = VIEW_OPTIONS_DEFAULT
	};
	struct err e = { 0 };
	int status = 0;

	t.view.samples = t.view.gather_rays = 0; /* not given */
	cli_signals();
	t.camera = mem_new((size_t)argc, sizeof *t.camera, "camera names", &e);
	if (!t.camera)
		return cli_fail(&t.cli, &e);
	parse(&t, argc, argv);
	if (run(&t, argc, argv, &e))
		status = cli_fail(&t.cli, &e);
	release(&t);
	return cli_finish(&t.cli, status);
}
