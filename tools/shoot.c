/* shoot: the radiosity solution from a mesh and its form factors. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "formats/cache/ff_file.h"
#include "formats/cache/mesh_file.h"
#include "formats/cache/rad_file.h"
#include "formats/container/atomic_file.h"
#include "lib/base/mem.h"
#include "lib/interpolate/discretisation.h"
#include "lib/radiosity/light_groups.h"
#include "lib/radiosity/radiosity.h"
#include "lib/radiosity/transport.h"
#include "tools/common/cli.h"
#include "tools/common/key.h"

struct request {
	const char *mesh, *output, *log;
	char *const *ff;
	size_t shards;
	int resume, light_groups, paper;
	struct radiosity_options solve;
};

#define REQUEST struct request

static const struct option_spec options[] = {
	{ 'o', "output", "FILE", "write the solution to FILE (.rad)", TEXT(output),
	  .role = OPTION_ASIDE },
	{ 'e', "stop", "X", "stop when unshot / emitted flux is X everywhere (default 1e-4)",
	  NUMBER(solve.stop, 0, 1) },
	{ 0, "paper", NULL, "the paper's algorithm, with form factors of ffcalc --paper", FLAG(paper) },
	{ 'n', "shots", "N", "stop after N shots", INTEGER(solve.max_shots, 0, INT64_MAX) },
	{ 0, "light-groups", NULL, "keep the light of each emitting material apart",
	  FLAG(light_groups) },
	{ 0, "resume", NULL, "go on from the solution in the output file", FLAG(resume) },
	{ 0, "log", "FILE", "a line a round: shots, unshot flux of each band, residual, seconds",
	  TEXT(log), .role = OPTION_RECORDED },
	{ 0 }
};

struct job {
	struct cli *cli;
	const struct request *r;
	struct model m;
	struct cache_info mesh, info;
	struct ff_file *file;       /* [shards] */
	const struct ff **ff;       /* [shards] */
	const char **name;          /* [shards] */
	struct transport t;
	struct solution s;
	struct radiosity_report report;
	int cubes;                  /* any form factors by hemicubes */
	FILE *log;
	struct progress progress;   /* by the logarithm of what is unshot */
	double begun;
	double prepare_seconds, solve_seconds, element_seconds, estimate_seconds;
};

static void settle(struct cli *c, int operand, struct request *r)
{
	if (c->argc - operand < 2)
		cli_usage(c, "a .mesh file and at least one .ff file are needed");
	if (!r->output)
		cli_usage(c, "an output is needed: -o FILE.rad");
	for (int i = operand; i < c->argc; i++)
		cli_keep_input(c, r->output, c->argv[i]);
	r->mesh = c->argv[operand];
	r->ff = c->argv + operand + 1;
	r->shards = (size_t)(c->argc - operand - 1);
	r->solve.threads = c->threads;
}

/* ---- inputs ---- */

/* Shards in the order of their patches, however they were given. */
static void sort_shards(struct job *j)
{
	for (size_t i = 1; i < j->r->shards; i++)
		for (size_t k = i;
		     k > 0 && j->file[k].f.patch_begin < j->file[k - 1].f.patch_begin; k--) {
			struct ff_file file = j->file[k];
			const char *name = j->name[k];
			j->file[k] = j->file[k - 1];
			j->name[k] = j->name[k - 1];
			j->file[k - 1] = file;
			j->name[k - 1] = name;
		}
	for (size_t i = 0; i < j->r->shards; i++)
		j->ff[i] = &j->file[i].f;
}

/* How form factors were made: the paper's have no chains, as ideal surfaces are lobes in them;
 * errors of hemicubes are smooth. */
static int check_method(struct job *j, const struct ff_file *f, const char *name,
                       struct err *e)
{
	json_t *made_by = json_loads(f->info.options ? f->info.options : "{}", 0, NULL);
	int is_paper = json_object_get(made_by, "paper") != NULL;
	const char *method = json_string_value(json_object_get(made_by, "method"));

	j->cubes |= method && strcmp(method, "hemicube") == 0;
	json_decref(made_by);
	if (is_paper && !j->r->paper)
		return err_set(e, "%s: made by ffcalc --paper; give --paper here, too", name);
	if (!is_paper && j->r->paper)
		return err_set(e, "%s: not made by ffcalc --paper, which --paper needs", name);
	return 0;
}

static int open_inputs(struct job *j, struct err *e)
{
	const struct request *r = j->r;

	j->file = mem_new(r->shards, sizeof *j->file, "form factor files", e);
	j->ff = mem_new(r->shards, sizeof *j->ff, "form factor files", e);
	j->name = mem_new(r->shards, sizeof *j->name, "form factor files", e);
	if (!j->file || !j->ff || !j->name || file_mesh_read(r->mesh, &j->m, &j->mesh, e))
		return -1;
	for (size_t i = 0; i < r->shards; i++) {
		if (file_ff_open(r->ff[i], &j->m, &j->mesh, &j->file[i], e) ||
		    check_method(j, &j->file[i], r->ff[i], e))
			return -1;
		j->name[i] = r->ff[i];
	}
	sort_shards(j);
	return 0;
}

/* Everything the solution depends on; cameras are looked after apart. */
static void make_key(const struct job *j, char key[KEY_BYTES])
{
	struct digest *d = key_begin(j->cli, j->r);
	const struct model *m = &j->m;
	char content[33];

	file_digest_string(d, j->mesh.geometry_id);
	file_digest_string(d, j->mesh.material_id);
	for (size_t i = 0; i < m->surface.n; i++)
		file_digest_string(d, m->surface.name[i]);
	for (size_t i = 0; i < m->material.n; i++)
		file_digest_string(d, m->material.name[i]);
	file_digest_bytes(d, m->triangle.uv, 6 * m->triangle.n * sizeof *m->triangle.uv);
	file_digest_bytes(d, m->triangle.normal, 9 * m->triangle.n * sizeof *m->triangle.normal);
	for (size_t i = 0; i < j->r->shards; i++) {
		file_container_digest(j->file[i].container, content);
		file_digest_string(d, content);
	}
	key_end(d, key);
}

static char *options_text(const struct request *r)
{
	json_t *o = json_pack("{s:f}", "stop", r->solve.stop);
	char *text;

	if (r->solve.max_shots != UINT64_MAX)
		json_object_set_new(o, "shots", json_integer((json_int_t)r->solve.max_shots));
	if (r->light_groups)
		json_object_set_new(o, "light-groups", json_true());
	if (r->paper)
		json_object_set_new(o, "paper", json_true());
	if (r->resume)
		json_object_set_new(o, "resume", json_true());
	text = json_dumps(o, JSON_COMPACT | JSON_SORT_KEYS);
	json_decref(o);
	return text;
}

/* ---- an existing output ---- */

/* 1 if the output already holds this solution: as it is, or with other cameras,
 * which are then replaced. -1 and e if that failed. */
static int kept(struct job *j, const char *key, struct err *e)
{
	struct container *c;
	struct err ignored = { 0 };
	struct model old = { 0 };
	struct solution s = { 0 };
	struct cache_info info = { 0 };
	int same_cameras, status;
	enum key_fit fit = file_cache_up_to_date(j->r->output, "twopass.rad", key,
	                                         j->cli->any_version);

	if (!fit || !(c = file_container_open(j->r->output, "twopass.rad", &ignored)))
		return 0;
	const char *camera_id = file_container_get_meta(c, "camera_id");
	same_cameras = camera_id && strcmp(camera_id, j->mesh.camera_id) == 0;
	file_container_close(c);
	if (same_cameras) {
		key_kept(j->cli, j->r->output, fit);
		return 1;
	}
	if (file_rad_read(j->r->output, &old, &s, &info, &ignored))
		return 0;
	free(info.history);
	info.history = strdup(j->info.history);
	status = file_rad_write(j->r->output, &j->m, &s, &info, e);
	if (status == 0)
		cli_note(j->cli, "%s: cameras replaced, solution kept", j->r->output);
	if (status == 0 && fit != KEY_FITS)
		key_kept(j->cli, j->r->output, fit);
	model_free(&old);
	solution_free(&s);
	file_cache_info_free(&info);
	return status ? -1 : 1;
}

/* Whether the solution keeps the light groups apart that were asked for. */
static int same_groups(const struct job *j, struct err *e)
{
	struct solution want = { .bands = j->m.bands };
	int same = radiosity_groups_set(&want, &j->m, j->r->light_groups, e) == 0 &&
	           want.groups == j->s.groups;

	for (size_t g = 0; same && g < want.groups; g++)
		same = strcmp(want.group_name[g], j->s.group_name[g]) == 0;
	solution_free(&want);
	return same;
}

/* The state of the solver in the output file, instead of the beginning. */
static int resume(struct job *j, struct err *e)
{
	struct model old = { 0 };
	struct cache_info info = { 0 };
	const char *path = j->r->output;

	if (file_rad_read(path, &old, &j->s, &info, e))
		return -1;
	if (strcmp(info.geometry_id, j->mesh.geometry_id) ||
	    strcmp(info.material_id, j->mesh.material_id))
		err_set(e, "%s: solves another scene; run shoot without --resume", path);
	else if (j->s.rows != j->t.rows || j->s.links != j->t.links)
		err_set(e, "%s: was made with other form factors; run shoot without --resume", path);
	else if (!same_groups(j, e))
		err_set(e, "%s: has other light groups; run shoot without --resume", path);
	model_free(&old);
	file_cache_info_free(&info);
	return e->set ? -1 : 0;
}

/* ---- solving ---- */

static void log_step(void *arg, const struct radiosity_step *step)
{
	struct job *j = arg;
	double unshot = 0, emitted = 0;
	/* Less than rounding is never left, for --stop 0 either. */
	const double all = -log(fmax(j->r->solve.stop, 1e-15));

	for (int k = 0; k < step->bands; k++) {
		unshot += step->unshot[k];
		emitted += step->emitted[k];
	}
	if (j->progress.fn && unshot > 0 && all > 0)
		j->progress.fn(j->progress.arg, fmin(all, fmax(0, log(emitted / unshot))), all);
	if (!j->log)
		return;
	fprintf(j->log, "%llu", (unsigned long long)step->shots);
	for (int k = 0; k < step->bands; k++)
		fprintf(j->log, " %.9g", step->unshot[k]);
	fprintf(j->log, " %.3g %.6f\n", step->residual, cli_seconds() - j->begun);
}

static int solve(struct job *j, struct err *e)
{
	struct radiosity_hooks hooks = { log_step, j };
	struct cli_progress bar;
	double t0 = cli_seconds(), t1, t2, t3;

	if (radiosity_transport_init(&j->t, &j->m, j->ff, j->name, j->r->shards, j->cli->threads, e))
		return -1;
	if (j->r->resume && access(j->r->output, F_OK) == 0) {
		if (resume(j, e))
			return -1;
	} else if (radiosity_begin(&j->s, &j->m, &j->t, j->r->light_groups, e)) {
		return -1;
	}
	t1 = cli_seconds();
	j->progress = cli_progress_begin(&bar, j->cli, "shooting");
	int bad = radiosity_solve(&j->s, &j->t, &j->r->solve, &hooks, &j->report, e);
	cli_progress_end(&bar);
	if (bad)
		return -1;
	t2 = cli_seconds();
	t3 = cli_seconds();
	if (interp_discretisation(&j->m, &j->s, !j->cubes, j->cli->threads, e))
		return -1;
	j->prepare_seconds = t1 - t0;
	j->solve_seconds = t2 - t1;
	j->element_seconds = t3 - t2;
	j->estimate_seconds = cli_seconds() - t3;
	return 0;
}

/* Solves with ideal surfaces as lobes; the model in the solution stays as it is. */
static int solve_paper(struct job *j, struct err *e)
{
	struct model as_is = j->m;
	int bad = model_ideal_as_lobes(&as_is, &j->m, e) || solve(j, e);

	model_lobes_free(&j->m);
	j->m = as_is;
	return bad;
}

/* ---- the report ---- */

static const char *const term_name[LEDGER_TERMS] = { "emitted", "absorbed", "escaped", "lost",
                                                     "cut", "uneven" };

static json_t *number(double x)
{
	return isfinite(x) ? json_real(x) : json_string("no finite bound");
}

/* A term of the ledger for a band, all light groups. */
static double ledger_of(const struct solution *s, int term, int band)
{
	double sum = 0;

	for (size_t g = 0; g < s->groups; g++)
		sum += s->ledger[((size_t)term * s->groups + g) * (size_t)s->bands + (size_t)band];
	return sum;
}

static char *report_text(const struct job *j)
{
	const struct radiosity_report *r = &j->report;
	const int known = !isnan(r->uneven);
	json_t *ledger = json_object(), *o;
	char *text;

	for (int term = 0; term < LEDGER_TERMS; term++) {
		json_t *band = json_array();
		for (int k = 0; k < j->s.bands; k++)
			json_array_append_new(band, json_real(ledger_of(&j->s, term, k)));
		json_object_set_new(ledger, term_name[term], band);
	}
	o = json_pack("{s:o, s:f, s:I, s:i, s:f, s:o, s:f, s:o, s:f, s:f, s:o, s:o, s:f}", "ledger", ledger,
	              "passes", r->passes, "shots", (json_int_t)j->s.shots, "components", r->components,
	              "unshot", r->unshot, "truncation_bound", number(r->bound),
	              "guessed_directions", r->guessed, "ledger_residual", number(r->residual),
	              "mean_error", solution_mean_error(&j->m, &j->s),
	              "sampling", solution_relative_rms(&j->m, &j->s, j->s.error.sampling),
	              "uneven", known ? json_real(r->uneven) : json_null(),
	              "uneven_left", known ? json_real(solution_relative_rms(&j->m, &j->s, j->s.error.uneven))
	                                   : json_null(),
	              "discretisation", solution_relative_rms(&j->m, &j->s, j->s.error.discretisation));
	text = json_dumps(o, JSON_COMPACT);
	json_decref(o);
	return text;
}

static void print_groups(const struct solution *s, FILE *out)
{
	fprintf(out, "light groups ");
	for (size_t g = 0; g < s->groups; g++)
		fprintf(out, " %s", s->group_name[g]);
	fprintf(out, "\n");
}

static void print_errors(const struct job *j, FILE *out)
{
	const struct solution *s = &j->s;

	fprintf(out, "sampling      %.3g relative standard error of irradiance, mean over area; "
	        "%.3g rms\n", solution_mean_error(&j->m, s),
	        solution_relative_rms(&j->m, s, s->error.sampling));
	if (!isnan(j->report.uneven))
		fprintf(out, "uneven        %.3g of irradiance made up for patches that are not evenly lit; "
		        "%.3g left (estimate), rms\n", j->report.uneven,
		        solution_relative_rms(&j->m, s, s->error.uneven));
	else
		fprintf(out, "uneven        not known: no elements gathered\n");
	fprintf(out, "elements      %.3g relative error of irradiance between elements "
	        "(estimate), rms over area\n",
	        solution_relative_rms(&j->m, s, s->error.discretisation));
}

static void print_report(const struct job *j)
{
	const struct solution *s = &j->s;
	const struct radiosity_report *r = &j->report;
	FILE *out = strcmp(j->r->output, "-") ? stdout : stderr;

	fprintf(out, "shots         %llu in %llu rounds, %.1f matrix passes, %d lit component%s\n",
	       (unsigned long long)s->shots, (unsigned long long)r->rounds, r->passes,
	       r->components, r->components == 1 ? "" : "s");
	if (j->r->light_groups)
		print_groups(s, out);
	for (int term = 0; term < LEDGER_TERMS; term++) {
		fprintf(out, "%-13s", term_name[term]);
		for (int k = 0; k < s->bands; k++)
			fprintf(out, " %.9g", ledger_of(s, term, k));
		fprintf(out, "\n");
	}
	fprintf(out, "unshot        %.3g of what is emitted\n", r->unshot);
	fprintf(out, "residual      %.3g of what is emitted, worst of every shot\n", r->residual);
	if (isfinite(r->bound))
		fprintf(out, "truncation    at most %.3g of what is emitted still to arrive (certified)\n",
		       r->bound);
	else
		fprintf(out, "truncation    no finite bound\n");
	print_errors(j, out);
	if (r->guessed > 0)
		fprintf(out, "directions    %.3g of what is emitted used the nearest known direction\n",
		       r->guessed);
	fprintf(out, "seconds       %.3f join, %.3f shoot, %.3f elements (%.2f GB/s of form factors), "
	        "%.3f estimate\n", j->prepare_seconds, j->solve_seconds, j->element_seconds,
	       (r->solve_bytes + r->element_bytes) /
	       (j->solve_seconds + j->element_seconds) * 1e-9, j->estimate_seconds);
	fprintf(out, "peak memory   %.0f MB\n", cli_peak_megabytes());
}

static int make(struct job *j, struct err *e)
{
	if (j->r->log && !(j->log = fopen(j->r->log, "w")))
		return err_set(e, "%s: cannot write the log", j->r->log);
	int bad = j->r->paper ? solve_paper(j, e) : solve(j, e);
	if (j->log && fclose(j->log) && !bad)
		bad = err_set(e, "%s: cannot write the log", j->r->log);
	if (bad)
		return -1;
	j->info.report = report_text(j);
	return file_rad_write(j->r->output, &j->m, &j->s, &j->info, e);
}

static int run(struct job *j, struct err *e)
{
	char key[KEY_BYTES];
	int done;

	j->begun = cli_seconds();
	if (file_atomic_check(j->r->output, e) || open_inputs(j, e))
		return -1;
	j->info.options = options_text(j->r);
	j->info.history = options_history(j->cli, j->file[0].info.history, e);
	if (!j->info.history)
		return -1;
	make_key(j, key);
	j->info.key = strdup(key);
	/* A resumed run begins from its own output, so it is never up to date. */
	done = j->r->resume ? 0 : kept(j, key, e);
	if (done)
		return done < 0 ? -1 : 0;
	if (make(j, e))
		return -1;
	if (!j->cli->quiet)
		print_report(j);
	return 0;
}

static void job_free(struct job *j)
{
	radiosity_transport_free(&j->t);
	solution_free(&j->s);
	for (size_t i = 0; j->file && i < j->r->shards; i++)
		file_ff_close(&j->file[i]);
	free(j->file);
	free(j->ff);
	free(j->name);
	model_free(&j->m);
	file_cache_info_free(&j->mesh);
	file_cache_info_free(&j->info);
}

int main(int argc, char **argv)
{
	struct cli c = { .program = "shoot", .synopsis = "[OPTION]... -o FILE.rad FILE.mesh FILE.ff...",
	                 .about = "Solves for the light in a scene by progressive shooting.",
	                 .options = options, .uses_threads = 1, .keeps_output = 1 };
	struct request r = { .solve = RADIOSITY_OPTIONS_DEFAULT };
	struct job j = { .cli = &c, .r = &r };
	struct err e = { 0 };
	int status;

	settle(&c, options_parse(&c, argc, argv, &r), &r);
	cli_signals();
	status = run(&j, &e) ? cli_fail(&c, &e) : 0;
	job_free(&j);
	return cli_finish(&c, status);
}
