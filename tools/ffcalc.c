/* ffcalc: form factors, diffuse and directional, of a mesh. */
#include <getopt.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/cache/ff_file.h"
#include "formats/cache/mesh_file.h"
#include "formats/container/digest.h"
#include "formats/container/history.h"
#include "lib/ff/ff_build.h"
#include "tools/common/cli.h"

enum { OPT_PRECISION = 256, OPT_PART, OPT_DEPTH, OPT_SEED, OPT_LOBE_RAYS, OPT_GAIN, OPT_GATHER,
       OPT_TO, OPT_CLOSE, OPT_LOBE_DEPTH, OPT_LINKS };

static const struct cli_option options[] = {
	{ 'o', "output", "FILE", "write the form factors to FILE (.ff)" },
	{ 'm', "method", "METHOD", "auto, rays, hemicube or analytic (default auto)" },
	{ 'n', "samples", "N", "rays a patch-side (default 4096), or pixels along a hemicube's edge (64)" },
	{ 'p', "points", "N", "hemicubes a patch-side (default 16)" },
	{ 't', "target", "X", "formulas: absolute error of a factor that is partly hidden (default 1e-4, to patches 1e-6)" },
	{ OPT_TO, "to", "WHAT", "elements or patches: what receives (default elements)" },
	{ OPT_CLOSE, "close", NULL, "formulas to patches: change what is in doubt so that closed rows add up" },
	{ OPT_GAIN, "emitter-gain", "N", "times as many rays for emitters (default 8)" },
	{ OPT_GATHER, "gather", "N", "rays an element-side gathers with (default a sixteenth of -n)" },
	{ OPT_LOBE_RAYS, "lobe-rays", "N", "rays a patch-side for each directional lobe (default 4096)" },
	{ OPT_LINKS, "links", "HOW", "rays or centroid (the paper's): where light comes to a lobe from (default rays)" },
	{ OPT_LOBE_DEPTH, "lobe-depth", "N", "most lobes that light of a lobe is followed through (default 4)" },
	{ OPT_DEPTH, "depth", "N", "longest chain of mirrors, panes and lobes that is told apart (default 256)" },
	{ OPT_PRECISION, "precision", "TYPE", "f32 or f64 (default f32)" },
	{ OPT_PART, "part", "K/N", "compute the K-th of N shards only" },
	{ OPT_SEED, "seed", "N", "seed of the sample points (default 1)" },
	{ 0, NULL, NULL, NULL }
};

struct request {
	const char *mesh, *output;
	struct ff_options ff;
};

static void parse_part(const struct cli *c, const char *text, struct ff_options *o)
{
	unsigned k, n;
	char end;

	if (sscanf(text, "%u/%u%c", &k, &n, &end) != 2 || k < 1 || k > n || n > 1000000)
		cli_usage(c, "--part %s: a shard is K/N with 1 <= K <= N, such as 2/4", text);
	o->shard = k;
	o->shards = n;
}

static void parse_word(const struct cli *c, const char *option, const char *text,
                       const char *yes, const char *no, int *value)
{
	if (strcmp(text, yes) && strcmp(text, no))
		cli_usage(c, "%s %s: must be %s or %s", option, text, no, yes);
	*value = strcmp(text, yes) == 0;
}

static const char *const method_name[] = { "rays", "hemicube", "analytic", "auto" };

static enum ff_method parse_method(const struct cli *c, const char *text)
{
	for (int i = 0; i < 4; i++)
		if (strcmp(text, method_name[i]) == 0)
			return (enum ff_method)i;
	cli_usage(c, "--method %s: must be auto, rays, hemicube or analytic", text);
	return FF_AUTO;
}

static void parse(struct cli *c, int argc, char **argv, struct request *r)
{
	int letter;
	struct ff_options *o = &r->ff;
	struct err wrong = { 0 };

	*o = FF_OPTIONS_DEFAULT;
	while ((letter = cli_next(c, argc, argv)) != -1) {
		switch (letter) {
		case 'o': r->output = optarg; break;
		case 'm': o->method = parse_method(c, optarg); break;
		case 't': o->target = cli_number(c, "--target", optarg, 1e-12, 1); break;
		case OPT_TO: parse_word(c, "--to", optarg, "patches", "elements", &o->to_patches); break;
		case 'n': o->rays = (uint32_t)cli_integer(c, "--samples", optarg, 4, 1 << 26); break;
		case 'p': o->points = (uint32_t)cli_integer(c, "--points", optarg, 1, 4096); break;
		case OPT_CLOSE: o->close = 1; break;
		case OPT_GAIN: o->emitter_gain = (uint32_t)cli_integer(c, "--emitter-gain", optarg, 1, 4096); break;
		case OPT_GATHER: o->gather = (uint32_t)cli_integer(c, "--gather", optarg, 0, 1 << 20); break;
		case OPT_LOBE_RAYS: o->lobe_rays = (uint32_t)cli_integer(c, "--lobe-rays", optarg, 1, 1 << 26); break;
		case OPT_LINKS: parse_word(c, "--links", optarg, "centroid", "rays", &o->centroid); break;
		case OPT_LOBE_DEPTH: o->lobe_depth = (uint32_t)cli_integer(c, "--lobe-depth", optarg, 0, 64); break;
		case OPT_DEPTH: o->depth = (uint32_t)cli_integer(c, "--depth", optarg, 0, 1000000); break;
		case OPT_PRECISION: parse_word(c, "--precision", optarg, "f64", "f32", &o->f64); break;
		case OPT_PART: parse_part(c, optarg, o); break;
		case OPT_SEED: o->seed = (uint64_t)cli_integer(c, "--seed", optarg, 0, 0x7fffffffffffffff); break;
		}
	}
	if (argc - optind != 1)
		cli_usage(c, "one .mesh file is needed");
	if (!r->output)
		cli_usage(c, "an output is needed: -o FILE.ff");
	r->mesh = argv[optind];
	cli_keep_input(c, r->output, r->mesh);
	o->threads = c->threads;
	if (ff_options_complete(o, &wrong))
		cli_usage(c, "%s", wrong.text);
}

static json_t *options_json(const struct ff_options *o)
{
	json_t *j = json_pack("{s:s, s:I, s:I, s:I, s:I, s:s, s:I, s:I}",
		"method", method_name[o->method],
		"samples", (json_int_t)o->rays, "lobe_rays", (json_int_t)o->lobe_rays,
		"depth", (json_int_t)o->depth, "seed", (json_int_t)o->seed,
		"precision", o->f64 ? "f64" : "f32",
		"part", (json_int_t)o->shard, "parts", (json_int_t)o->shards);

	if (o->method != FF_HEMICUBE)
		json_object_set_new(j, "gather", json_integer(o->gather));
	json_object_set_new(j, "emitter_gain", json_integer(o->emitter_gain));
	json_object_set_new(j, "links", json_string(o->centroid ? "centroid" : "rays"));
	json_object_set_new(j, "lobe_depth", json_integer(o->lobe_depth));
	if (o->to_patches)
		json_object_set_new(j, "to", json_string("patches"));
	if (o->close)
		json_object_set_new(j, "close", json_true());
	if (o->method == FF_ANALYTIC || o->method == FF_AUTO)
		json_object_set_new(j, "target", json_real(o->target));
	if (o->method == FF_HEMICUBE)
		json_object_set_new(j, "points", json_integer(o->points));
	return j;
}

static json_t *report_json(const struct ff_stats *s)
{
	return json_pack("{s:{s:I, s:I, s:I, s:I, s:I}, s:I, s:I, s:I, s:f, s:f, s:f, s:f, s:f, s:f}",
		"rows", "diffuse", (json_int_t)s->rows[FF_DIFFUSE],
		"emission", (json_int_t)s->rows[FF_EMISSION],
		"reflected", (json_int_t)s->rows[FF_REFLECTED],
		"transmitted", (json_int_t)s->rows[FF_TRANSMITTED],
		"lights", (json_int_t)s->rows[FF_LIGHT],
		"links", (json_int_t)s->links, "blocks", (json_int_t)s->blocks,
		"entries", (json_int_t)s->entries, "rays", s->rays, "samples", s->samples,
		"worst_residual", s->worst_residual, "mean_row_error", s->mean_error,
		"worst_row_error", s->worst_error, "largest_cut", s->cut);
}

/* Everything the output depends on, so that an equal one need not be made again. */
static void make_key(const struct cache_info *mesh, const char *chosen, char key[33])
{
	struct digest *d = file_digest_new();

	file_digest_string(d, "ffcalc " TWOPASS_VERSION " " REVISION_FF);
	file_digest_string(d, mesh->geometry_id);
	file_digest_string(d, chosen);
	file_digest_end(d, key);
}

static int put(void *arg, const struct ff *batch, struct err *e)
{
	return file_ff_append(arg, batch, e);
}

static void print_report(const struct ff_stats *s, const struct request *r, double seconds)
{
	FILE *out = strcmp(r->output, "-") ? stdout : stderr;

	fprintf(out, "rows          %zu diffuse, %zu emission lobes, %zu reflected, %zu transmitted, "
	        "%zu lights\n", s->rows[FF_DIFFUSE], s->rows[FF_EMISSION], s->rows[FF_REFLECTED],
	        s->rows[FF_TRANSMITTED], s->rows[FF_LIGHT]);
	fprintf(out, "links         %zu\n", s->links);
	fprintf(out, "entries       %zu in %zu blocks\n", s->entries, s->blocks);
	fprintf(out, "rays          %.0f (%.2f Mray/s)\n", s->rays, s->rays / seconds * 1e-6);
	if (r->ff.method == FF_HEMICUBE)
		fprintf(out, "pixels        %.0f (%.2f Mpixel/s)\n", s->samples, s->samples / seconds * 1e-6);
	if (s->pairs[0] + s->pairs[1] + s->pairs[2] + s->pairs[3] > 0)
		fprintf(out, "pairs         %.0f clear, %.0f hidden, %.0f partly (%.1f evaluations each), "
		        "%.0f sampled\n", s->pairs[0], s->pairs[1], s->pairs[2],
		        s->evaluations / fmax(1, s->pairs[2]), s->pairs[3]);
	if (r->ff.to_patches && s->directional)
		fprintf(out, "by rays       what is between patches: there are lobes, mirrors or panes\n");
	if (s->curved)
		fprintf(out, "by rays       %s %zu of %zu patch-sides: they are curved\n",
		        r->ff.to_patches ? "pairs with" : "light from", s->curved, s->sides);
	fprintf(out, "row sums      within %.3g of 1 before scaling\n", s->worst_residual);
	fprintf(out, "row error     %.3g mean, %.3g worst (%s)\n", s->mean_error, s->worst_error,
	        s->samples > 0 ? "standard error, root of squares over receivers"
	                       : "estimates, summed over receivers");
	if (s->cut > 0)
		fprintf(out, "cut           at most %.3g of a row, by --depth %u\n", s->cut, r->ff.depth);
	fprintf(out, "seconds       %.3f\n", seconds);
	fprintf(out, "peak memory   %.0f MB\n", cli_peak_megabytes());
}

static int compute(struct cli *c, const struct request *r, const struct model *m,
                   struct cache_info *info, struct err *e)
{
	struct ff_writer *w = file_ff_create(r->output, m, r->ff.f64, r->ff.to_patches, e);
	struct ff_sink sink = { put, w };
	struct ff_stats stats;
	struct ff whole = { 0 };
	struct cli_progress bar;
	double begun = cli_seconds();

	if (!w)
		return -1;
	struct progress progress = cli_progress_begin(&bar, c, "form factors");
	int bad = ff_build(m, &r->ff, &whole, &stats, &sink, &progress, e);
	cli_progress_end(&bar);
	if (bad) {
		file_ff_abandon(w);
	} else {
		json_t *report = report_json(&stats);
		info->report = json_dumps(report, JSON_COMPACT);
		json_decref(report);
		bad = file_ff_finish(w, &whole, info, e);
	}
	ff_free(&whole);
	if (!bad && !c->quiet)
		print_report(&stats, r, cli_seconds() - begun);
	return bad;
}

static int run(struct cli *c, const struct request *r, int argc, char **argv, struct err *e)
{
	struct model m = { 0 };
	struct cache_info mesh = { 0 }, info = { 0 };
	char key[33];
	int bad = file_mesh_read(r->mesh, &m, &mesh, e);

	if (!bad) {
		json_t *j = options_json(&r->ff);
		info.options = json_dumps(j, JSON_COMPACT | JSON_SORT_KEYS);
		json_decref(j);
		make_key(&mesh, info.options, key);
		if (file_cache_up_to_date(r->output, "twopass.ff", key)) {
			int renamed = file_ff_rename(r->output, &m, e);
			bad = renamed < 0 ? -1 : 0;
			if (!bad)
				cli_note(c, "%s: %s", r->output, renamed ? "names replaced, form factors kept"
				                                         : "up to date");
		} else {
			info.key = strdup(key);
			info.history = file_history_append(mesh.history, argc, argv, e);
			bad = !info.history || !info.key || compute(c, r, &m, &info, e);
		}
	}
	model_free(&m);
	file_cache_info_free(&mesh);
	file_cache_info_free(&info);
	return bad;
}

int main(int argc, char **argv)
{
	struct cli c = { .program = "ffcalc", .synopsis = "[OPTION]... -o FILE.ff FILE.mesh",
	                 .about = "Computes the form factors of a mesh.", .options = options,
	                 .uses_threads = 1 };
	struct request r = { 0 };
	struct err e = { 0 };

	parse(&c, argc, argv, &r);
	cli_signals();
	return cli_finish(&c, run(&c, &r, argc, argv, &e) ? cli_fail(&c, &e) : 0);
}
