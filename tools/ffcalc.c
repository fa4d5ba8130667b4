/* ffcalc: form factors, diffuse and directional, of a mesh. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/cache/ff_file.h"
#include "formats/cache/mesh_file.h"
#include "lib/ff/ff_build.h"
#include "tools/common/cli.h"
#include "tools/common/key.h"

struct request {
	const char *mesh, *output;
	uint32_t shard[2];
	struct ff_options ff;
};

#define REQUEST struct request

/* In the order of their values. */
static const char *const methods[] = { "rays", "hemicube", "analytic", "auto", NULL };
static const char *const receivers[] = { "elements", "patches", NULL };
static const char *const sources[] = { "rays", "centroid", NULL };
static const char *const papers[] = { "no", "printed", "closed", NULL };
static const char *const precisions[] = { "f32", "f64", NULL };

static const struct option_spec options[] = {
	{ 'o', "output", "FILE", "write the form factors to FILE (.ff)", TEXT(output),
	  .role = OPTION_ASIDE },
	{ 'm', "method", "METHOD", "auto, rays, hemicube or analytic (default %s)",
	  WORD(ff.method, methods) },
	{ 0, "paper", "[=HOW]",
	  "the paper's algorithm, as printed or, closed, with what escapes in the sum of eq. (3)",
	  WORD(ff.paper, papers) },
	{ 'n', "samples", "N",
	  "rays a patch-side (default 4096), or pixels along a hemicube's edge (64)",
	  INTEGER(ff.rays, 4, 1 << 26) },
	{ 'p', "points", "N", "hemicubes a patch-side (default %s)", INTEGER(ff.points, 1, 4096) },
	{ 't', "target", "X",
	  "formulas: absolute error of a factor that is partly hidden (default 1e-4, to patches 1e-6)",
	  NUMBER(ff.target, 1e-12, 1) },
	{ 0, "to", "WHAT", "elements or patches: what receives (default %s)",
	  WORD(ff.to_patches, receivers) },
	{ 0, "pair-errors", NULL, "formulas to patches: keep the error of each factor, too",
	  FLAG(ff.pair_errors) },
	{ 0, "close", NULL,
	  "formulas to patches: change what is in doubt so that closed rows add up",
	  FLAG(ff.close) },
	{ 0, "emitter-gain", "N", "times as many rays for emitters (default %s)",
	  INTEGER(ff.emitter_gain, 1, 4096) },
	{ 0, "gather", "N", "rays an element-side gathers with (default a sixteenth of -n)",
	  INTEGER(ff.gather, 0, 1 << 20) },
	{ 0, "lobe-rays", "N", "rays a patch-side for each directional lobe (default %s)",
	  INTEGER(ff.lobe_rays, 1, 1 << 26) },
	{ 0, "links", "HOW",
	  "rays or centroid (the paper's): where light comes to a lobe from (default %s)",
	  WORD(ff.centroid, sources) },
	{ 0, "lobe-depth", "N", "most lobes that light of a lobe is followed through (default %s)",
	  INTEGER(ff.lobe_depth, 0, 64) },
	{ 0, "depth", "N",
	  "longest chain of mirrors, panes and lobes that is told apart (default %s)",
	  INTEGER(ff.depth, 0, 1000000) },
	{ 0, "precision", "TYPE", "f32 or f64 (default %s)", WORD(ff.f64, precisions) },
	{ 0, "part", "K/N", "compute the K-th of N shards only", RATIO(shard) },
	{ 0, "seed", "N", "seed of the sample points (default %s)", 
	  INTEGER(ff.seed, 0, INT64_MAX) },
	{ 0 }
};

/* What the paper's algorithm has no place for. */
static void refuse_with_paper(const struct cli *c, const struct ff_options *o)
{
	static const char *const other[] = { "points", "target", "close", "to", "emitter-gain", "gather",
	                                     "lobe-rays", "links", "lobe-depth", "depth" };

	if (!o->paper)
		return;
	if (options_given(c, "method") && o->method != FF_HEMICUBE)
		cli_usage(c, "--paper is by hemicubes: leave out -m %s", methods[o->method]);
	for (size_t i = 0; i < sizeof other / sizeof *other; i++)
		if (options_given(c, other[i]))
			cli_usage(c, "--paper leaves nothing to --%s: leave one of them out", other[i]);
}

static void settle(struct cli *c, int operand, struct request *r)
{
	struct ff_options *o = &r->ff;
	struct err contradiction = { 0 };

	if (c->argc - operand != 1)
		cli_usage(c, "one .mesh file is needed");
	if (!r->output)
		cli_usage(c, "an output is needed: -o FILE.ff");
	r->mesh = c->argv[operand];
	cli_keep_input(c, r->output, r->mesh);
	refuse_with_paper(c, o);
	if (ff_options_complete(o, &contradiction))
		cli_usage(c, "%s", contradiction.text);
	o->shard = r->shard[0];
	o->shards = r->shard[1];
	o->threads = c->threads;
}

static json_t *options_json(const struct ff_options *o)
{
	json_t *j = json_pack("{s:s, s:I, s:I, s:I, s:I, s:s, s:I, s:I}",
		"method", methods[o->method],
		"samples", (json_int_t)o->rays, "lobe_rays", (json_int_t)o->lobe_rays,
		"depth", (json_int_t)o->depth, "seed", (json_int_t)o->seed,
		"precision", precisions[o->f64],
		"part", (json_int_t)o->shard, "parts", (json_int_t)o->shards);

	if (o->method != FF_HEMICUBE)
		json_object_set_new(j, "gather", json_integer(o->gather));
	json_object_set_new(j, "emitter_gain", json_integer(o->emitter_gain));
	json_object_set_new(j, "links", json_string(sources[o->centroid]));
	json_object_set_new(j, "lobe_depth", json_integer(o->lobe_depth));
	if (o->paper)
		json_object_set_new(j, "paper", json_string(papers[o->paper]));
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

/* Everything the form factors depend on. */
static void make_key(const struct cli *c, const struct request *r, const struct cache_info *mesh,
                     char key[KEY_BYTES])
{
	struct digest *d = key_begin(c, r);

	file_digest_string(d, mesh->geometry_id);
	key_end(d, key);
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
		fprintf(out, "pixels        %.0f (%.2f Mpixel/s)\n", s->samples,
		        s->samples / seconds * 1e-6);
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
	struct model lobes = { 0 };
	struct cli_progress bar;
	double begun = cli_seconds();

	if (!w)
		return -1;
	struct progress progress = cli_progress_begin(&bar, c, "form factors");
	int bad = r->ff.paper && model_ideal_as_lobes(m, &lobes, e);
	bad = bad || ff_build(r->ff.paper ? &lobes : m, &r->ff, &whole, &stats, &sink, &progress, e);
	model_lobes_free(&lobes);
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

/* An output that fits is kept, with the names that the model has now. */
static int keep(const struct cli *c, const struct request *r, const struct model *m,
                enum key_fit fit, struct err *e)
{
	int renamed = file_ff_rename(r->output, m, e);

	if (renamed < 0)
		return -1;
	if (renamed)
		cli_note(c, "%s: names replaced, form factors kept", r->output);
	if (!renamed || fit != KEY_FITS)
		key_kept(c, r->output, fit);
	return 0;
}

static int run(struct cli *c, const struct request *r, struct err *e)
{
	struct model m = { 0 };
	struct cache_info mesh = { 0 }, info = { 0 };
	char key[KEY_BYTES];
	int bad = file_mesh_read(r->mesh, &m, &mesh, e);

	if (!bad) {
		make_key(c, r, &mesh, key);
		enum key_fit fit = file_cache_up_to_date(r->output, "twopass.ff", key,
		                                         c->any_version);
		if (fit) {
			bad = keep(c, r, &m, fit, e);
		} else {
			json_t *j = options_json(&r->ff);
			info.options = json_dumps(j, JSON_COMPACT | JSON_SORT_KEYS);
			json_decref(j);
			info.key = strdup(key);
			info.history = options_history(c, mesh.history, e);
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
	                 .uses_threads = 1, .keeps_output = 1 };
	struct request r = { .shard = { 1, 1 }, .ff = FF_OPTIONS_DEFAULT };
	struct err e = { 0 };

	settle(&c, options_parse(&c, argc, argv, &r), &r);
	cli_signals();
	return cli_finish(&c, run(&c, &r, &e) ? cli_fail(&c, &e) : 0);
}
