/* mesh: from a glTF scene to elements and patches. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/cache/mesh_file.h"
#include "formats/cache/rad_file.h"
#include "formats/gltf/gltf_file.h"
#include "lib/mesh/mesher.h"
#include "tools/common/cli.h"
#include "tools/common/key.h"

#define FORMAT "twopass.mesh"

struct request {
	const char *scene, *output;
	struct mesh_options mesher;
	const char *solution;            /* to refine, or NULL */
	struct mesh_refinement refine;
	struct gltf_options gltf;
};

#define REQUEST struct request

static const char *const lobes[] = { "paper", "reciprocal", NULL };

static const struct option_spec options[] = {
	{ 'o', "output", "FILE", "write the mesh to FILE (.mesh; - is standard output)",
	  TEXT(output), .role = OPTION_ASIDE },
	{ 'p', "patch-size", "SIZE",
	  "longest side of a patch: metres, 5% of the scene, inf (default %s)",
	  LENGTH(mesher.patch) },
	{ 'e', "element-size", "SIZE",
	  "longest edge of an element (default %s, but within the patch size)",
	  LENGTH(mesher.element) },
	{ 0, "normal-cone", "DEG", "how far normals in a curved patch may turn (default %s)",
	  NUMBER(mesher.normal_cone, 0, 80) },
	{ 0, "no-imprint", NULL, "do not cut surfaces where others cross or touch them",
	  FLAG(mesher.no_imprint) },
	{ 0, "min-directional", "X", "fold derived lobes below this share into diffuse (default %s)",
	  NUMBER(gltf.min_directional, 0, 1) },
	{ 0, "min-exponent", "K", "fold derived lobes of lower exponent into diffuse (default %s)",
	  NUMBER(gltf.min_exponent, 0, INFINITY) },
	{ 0, "lobe", "KIND", "what exponents mean: %s (default) or reciprocal",
	  WORD(gltf.lobe, lobes) },
	{ 0, "bands", "N", "number of bands (default: 1 for a grey scene, else 3)",
	  INTEGER(gltf.bands, 1, BANDS_MAX) },
	{ 0, "clamp", NULL, "rescale materials that return more than they receive",
	  FLAG(gltf.clamp) },
	{ 0, "refine", "FILE.rad", "divide the mesh of an earlier solution further where it is in error",
	  TEXT(solution), .role = OPTION_RECORDED },
	{ 0, "refine-error", "X", "until its relative error is X (default %s)",
	  NUMBER(refine.error, 0, INFINITY) },
	{ 0, "refine-smallest", "SIZE", "but no element to a shorter longest edge (default %s)",
	  LENGTH(refine.smallest) },
	{ 0, "refine-elements", "N", "and to about N elements at most (default %s)",
	  INTEGER(refine.elements, 1, 1 << 28) },
	{ 0 }
};

struct job {
	struct cli *cli;
	const struct request *r;
	struct model m;
	struct gltf_report gltf;
	struct mesh_report mesher;
	struct cache_info info;
	struct model old;                /* of the solution to refine */
	struct solution s;
	struct cache_info old_info;
	char solution_content[33];       /* its digest, or "" */
	uint32_t *origin;                /* [elements] in the old model */
};

static void settle(struct cli *c, int operand, struct request *r)
{
	r->mesher.element_within_patch = !options_given(c, "element-size");
	if (c->argc - operand != 1)
		cli_usage(c, "one glTF file is needed");
	if (!r->output)
		cli_usage(c, "an output is needed: -o FILE.mesh");
	if (!r->solution &&
	    (options_given(c, "refine-error") || options_given(c, "refine-smallest") ||
	     options_given(c, "refine-elements")))
		cli_usage(c, "--refine-error, -smallest and -elements need --refine FILE.rad");
	r->scene = c->argv[operand];
	cli_keep_input(c, r->output, r->scene);
	if (r->solution)
		cli_keep_input(c, r->output, r->solution);
}

/* ---- options and report as JSON ---- */

static char *dump(json_t *object, struct err *e)
{
	char *text = object ? json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(17)) : NULL;

	json_decref(object);
	if (!text)
		err_set(e, "out of memory for options and report");
	return text;
}

/* JSON knows no infinity. */
static json_t *length_json(double x)
{
	return isfinite(x) ? json_real(x) : json_string("inf");
}

static json_t *size_json(struct mesh_size s)
{
	return json_pack("{s:o, s:s}", "value", length_json(s.value), "of",
	                 s.relative ? "scene" : "metre");
}

static char *options_text(const struct request *r, struct err *e)
{
	json_t *o = json_pack("{s:o, s:o, s:b, s:f, s:b, s:f, s:o, s:s, s:i, s:b}",
	                      "patch_size", size_json(r->mesher.patch),
	                      "element_size", size_json(r->mesher.element),
	                      "element_within_patch", r->mesher.element_within_patch,
	                      "normal_cone", r->mesher.normal_cone,
	                      "imprint", !r->mesher.no_imprint,
	                      "min_directional", r->gltf.min_directional,
	                      "min_exponent", length_json(r->gltf.min_exponent),
	                      "lobe", lobes[r->gltf.lobe],
	                      "bands", r->gltf.bands, "clamp", r->gltf.clamp);

	if (r->solution)
		json_object_update_new(o, json_pack("{s:f, s:o, s:I}", "refine_error", r->refine.error,
		                                    "refine_smallest", size_json(r->refine.smallest),
		                                    "refine_elements",
		                                    (json_int_t)r->refine.elements));
	return dump(o, e);
}

static json_t *notes_json(const struct gltf_report *r)
{
	json_t *list = json_array();

	for (size_t i = 0; i < r->notes; i++)
		json_array_append_new(list, json_string(r->note[i]));
	return list;
}

static json_t *cleaned_json(const struct mesh_surface *s)
{
	return json_pack("{s:I, s:I, s:I, s:I}", "degenerate", (json_int_t)s->degenerate,
	                 "duplicate", (json_int_t)s->duplicate,
	                 "welded", (json_int_t)s->welded,
	                 "opposite_winding", (json_int_t)s->opposite);
}

/* What was cleaned where, surfaces without anything left out. */
static json_t *surfaces_json(const struct job *j)
{
	static const struct mesh_surface clean;
	json_t *object = json_object();

	for (size_t i = 0; i < j->mesher.surfaces; i++)
		if (memcmp(&j->mesher.surface[i], &clean, sizeof clean))
			json_object_set_new(object, j->m.surface.name[i],
			                    cleaned_json(&j->mesher.surface[i]));
	return object;
}

static json_t *materials_json(const struct mesh_report *r)
{
	return json_pack("{s:I, s:I, s:I, s:I, s:I, s:I}", "used", (json_int_t)r->materials,
	                 "two_sided", (json_int_t)r->two_sided,
	                 "emitters", (json_int_t)r->emitters, "lobes", (json_int_t)r->lobes,
	                 "ideal", (json_int_t)r->ideal,
	                 "transmitting", (json_int_t)r->transmitting);
}

static json_t *imprint_json(const struct mesh_report *r)
{
	return json_pack("{s:I, s:I, s:I, s:I}", "cut", (json_int_t)r->cut, "lines",
	                 (json_int_t)r->lines, "fine_contacts", (json_int_t)r->fine_contacts,
	                 "covered", (json_int_t)r->covered);
}

static json_t *pieces_json(const struct mesh_report *r)
{
	return json_pack("{s:I, s:I, s:I, s:I}", "connected", (json_int_t)r->components,
	                 "closed", (json_int_t)r->closed_components,
	                 "open_edges", (json_int_t)r->open_edges,
	                 "crowded_edges", (json_int_t)r->crowded_edges);
}

static json_t *refined_json(const struct mesh_report *r)
{
	return json_pack("{s:I, s:I, s:I, s:I, s:I, s:f, s:f, s:f}",
	                 "elements", (json_int_t)r->elements_before,
	                 "marked", (json_int_t)r->marked,
	                 "patches", (json_int_t)r->patches_before,
	                 "patches_marked", (json_int_t)r->patches_marked,
	                 "patches_for_lobes", (json_int_t)r->patches_for_lobes,
	                 "error", r->error_before, "error_of_patches", r->patch_error_before,
	                 "expected_error", r->error_expected);
}

static char *report_text(const struct job *j, struct err *e)
{
	const struct mesh_report *r = &j->mesher;
	json_t *o = json_pack("{s:i, s:o, s:I, s:I, s:I, s:I, s:I, s:I, s:f, s:o, s:o, s:f, s:f,"
	                      " s:o, s:I, s:o, s:o, s:o, s:o}",
	                      "bands", j->m.bands, "materials", materials_json(r),
	                      "surfaces", (json_int_t)j->m.surface.n,
	                      "triangles", (json_int_t)j->m.triangle.n,
	                      "elements", (json_int_t)j->m.element.n,
	                      "patches", (json_int_t)j->m.patch.n,
	                      "planar_patches", (json_int_t)r->planar_patches,
	                      "largest_patch", (json_int_t)r->largest_patch,
	                      "diameter", r->diameter,
	                      "patch_size", length_json(r->patch_size),
	                      "element_size", length_json(r->element_size),
	                      "area_front", r->area_front, "area_back", r->area_back,
	                      "cleaned", cleaned_json(&r->total),
	                      "merged", (json_int_t)r->merged,
	                      "cleaned_surfaces", surfaces_json(j),
	                      "imprint", imprint_json(r),
	                      "pieces", pieces_json(r), "notes", notes_json(&j->gltf));

	if (j->r->solution)
		json_object_set_new(o, "refined", refined_json(r));
	return dump(o, e);
}

/* Everything the mesh depends on. */
static char *make_key(const struct job *j)
{
	struct digest *d = key_begin(j->cli, j->r);
	char key[KEY_BYTES];
	uint8_t within = (uint8_t)j->r->mesher.element_within_patch;

	file_digest_bytes(d, &within, sizeof within);
	file_digest_string(d, j->gltf.digest);
	file_digest_string(d, j->solution_content);
	key_end(d, key);
	return strdup(key);
}

/* ---- the report for people ---- */

static const char *plural(size_t n)
{
	return n == 1 ? "" : "s";
}

static void print_size(FILE *f, const char *what, double metres)
{
	if (isfinite(metres))
		fprintf(f, ", %s up to %.4g m", what, metres);
	fputc('\n', f);
}

static void print_counts(FILE *f, const struct job *j)
{
	const struct mesh_report *r = &j->mesher;
	const struct model *m = &j->m;

	fprintf(f, "scene       %zu surface%s, %zu light%s, %zu camera%s, %.6g m across\n",
	        m->surface.n, plural(m->surface.n), m->light.n, plural(m->light.n), m->cameras,
	        plural(m->cameras), r->diameter);
	fprintf(f, "triangles   %zu", m->triangle.n);
	if (r->total.degenerate)
		fprintf(f, ", %u without area dropped", r->total.degenerate);
	if (r->total.duplicate)
		fprintf(f, ", %u coincident dropped", r->total.duplicate);
	if (r->total.welded)
		fprintf(f, ", %u vertices welded", r->total.welded);
	if (r->cut)
		fprintf(f, "\nimprint     %zu triangle%s cut along %zu line%s where others touch",
		        r->cut, plural(r->cut), r->lines, plural(r->lines));
	if (r->fine_contacts)
		fprintf(f, "%s%zu contact%s of less than half an element left alone",
		        r->cut ? "; " : "\nimprint     ", r->fine_contacts, plural(r->fine_contacts));
	if (r->covered)
		fprintf(f, "%s%zu part%s under coplanar surfaces dropped",
		        r->cut || r->fine_contacts ? "; " : "\nimprint     ", r->covered,
		        plural(r->covered));
	if (j->r->solution)
		fprintf(f, "\nrefined     %zu of %zu elements, %zu of %zu patches, %zu of them for lobes\n"
		        "error       %.3g relative (%.3g of it from patches), %.3g expected now",
		        r->marked, r->elements_before, r->patches_marked, r->patches_before,
		        r->patches_for_lobes, r->error_before, r->patch_error_before, r->error_expected);
	fprintf(f, "\nelements    %zu", m->element.n);
	print_size(f, "edges", r->element_size);
	fprintf(f, "patches     %zu, %zu of them plane", m->patch.n, r->planar_patches);
	print_size(f, "sides", r->patch_size);
	fprintf(f, "area        %.6g m2 front, %.6g m2 back\n", r->area_front, r->area_back);
	fprintf(f, "closed      %zu of %zu connected piece%s; %zu open edge%s, %zu with more than "
	        "two triangles\n", r->closed_components, r->components, plural(r->components),
	        r->open_edges, plural(r->open_edges), r->crowded_edges);
}

static void print_modelled(FILE *f, const struct job *j)
{
	const struct mesh_report *r = &j->mesher;
	const struct model *m = &j->m;

	fprintf(f, "materials   %zu: %zu emit, %zu two-sided, %zu transmit, %zu with lobes, "
	        "%zu ideal\n", r->materials, r->emitters, r->two_sided, r->transmitting, r->lobes,
	        r->ideal);
	fprintf(f, "bands       %d%s\n", m->bands,
	        m->bands > 1 ? "" : j->r->gltf.bands ? "" : ": the scene is grey");
	if (r->lobes)
		fprintf(f, "lobes       %s\n", lobes[m->lobe]);
	fprintf(f, "left out    ");
	int any = 0;
	if (r->two_sided < r->materials)
		fprintf(f, "%sbacks of %zu one-sided material%s", any++ ? "; " : "",
		        r->materials - r->two_sided, plural(r->materials - r->two_sided));
	if (!r->lobes && !r->ideal)
		fprintf(f, "%sdirections: no material is directional", any++ ? "; " : "");
	if (j->gltf.skipped)
		fprintf(f, "%s%zu primitive%s of points and lines", any++ ? "; " : "",
		        j->gltf.skipped, plural(j->gltf.skipped));
	fprintf(f, "%s\n", any ? "" : "nothing");
	for (size_t i = 0; i < j->gltf.notes; i++)
		fprintf(f, "note        %s\n", j->gltf.note[i]);
}

/* Every surface that lost triangles or whose winding is mixed. */
static void warn_surfaces(const struct job *j)
{
	const struct mesh_report *r = &j->mesher;

	for (size_t i = 0; i < r->surfaces; i++) {
		const char *name = j->m.surface.name[i];
		const struct mesh_surface *s = &r->surface[i];
		if (s->degenerate)
			cli_note(j->cli, "%s: %s: dropped %u triangle%s without area", j->r->scene,
			         name, s->degenerate, plural(s->degenerate));
		if (s->opposite)
			cli_warn(j->cli, "%s: %s: neighbouring triangles with opposite winding at "
			         "%u edge%s; check which side is the front", j->r->scene, name,
			         s->opposite, plural(s->opposite));
		if (s->duplicate)
			cli_detail(j->cli, "%s: %s: dropped %u coincident triangle%s", j->r->scene,
			           name, s->duplicate, plural(s->duplicate));
	}
	if (r->total.duplicate)
		cli_warn(j->cli, "%s: dropped %u triangle%s that coincide with others; kept the "
		         "first of each place%s", j->r->scene, r->total.duplicate,
		         plural(r->total.duplicate),
		         r->merged ? ", with the other's front for its back" : "");
}

/* ---- the run ---- */

static int is_stdout(const struct job *j)
{
	return strcmp(j->r->output, "-") == 0;
}

/* Errors of the mesher name no file, as it knows none. */
static int divide(struct job *j, struct err *e)
{
	struct cli_progress bar;
	struct progress progress = cli_progress_begin(&bar, j->cli, "meshing");
	struct mesh_options o = j->r->mesher;
	struct err inner = { 0 };

	o.progress = &progress;
	int status = j->r->solution ? mesh_refine(&j->m, &o, &j->old, &j->s, &j->r->refine,
	                                          &j->origin, &j->mesher, &inner)
	                            : mesh_run(&j->m, &o, &j->mesher, &inner);
	cli_progress_end(&bar);
	return status ? err_set(e, "%s: %s", j->r->scene, inner.text) : 0;
}

static int write_mesh(struct job *j, struct err *e)
{
	j->info.report = report_text(j, e);
	j->info.history = options_history(j->cli, NULL, e);
	if (!j->info.report || !j->info.history)
		return -1;
	file_cache_ids(&j->m, &j->info);
	return file_mesh_write(j->r->output, &j->m, &j->info, e);
}

static void print_report(const struct job *j)
{
	FILE *f = is_stdout(j) ? stderr : stdout;

	if (j->cli->quiet)
		return;
	print_counts(f, j);
	print_modelled(f, j);
}

/* The solution to refine, if there is one. */
static int read_solution(struct job *j, struct err *e)
{
	const char *path = j->r->solution;
	struct container *c = path ? file_container_open(path, "twopass.rad", e) : NULL;

	if (!c)
		return path ? -1 : 0;
	file_container_digest(c, j->solution_content);
	file_container_close(c);
	return file_rad_read(path, &j->old, &j->s, &j->old_info, e);
}

static int work(struct job *j, struct err *e)
{
	double begun = cli_seconds();

	if (gltf_file_read(j->r->scene, &j->r->gltf, &j->m, &j->gltf, e))
		return -1;
	for (size_t i = 0; i < j->gltf.notes; i++)
		cli_note(j->cli, "%s: %s", j->r->scene, j->gltf.note[i]);
	if (read_solution(j, e))
		return -1;
	j->info.options = options_text(j->r, e);
	if (!j->info.options || !(j->info.key = make_key(j)))
		return err_set(e, "out of memory for options");
	enum key_fit fit = is_stdout(j) ? KEY_DIFFERS
	                 : file_cache_up_to_date(j->r->output, FORMAT, j->info.key, j->cli->any_version);
	if (fit) {
		key_kept(j->cli, j->r->output, fit);
		return 0;
	}
	if (divide(j, e))
		return -1;
	warn_surfaces(j);
	if (write_mesh(j, e))
		return -1;
	print_report(j);
	cli_detail(j->cli, "%s: %.2f s, %.0f MB", j->r->output, cli_seconds() - begun,
	           cli_peak_megabytes());
	return 0;
}

int main(int argc, char **argv)
{
	struct cli c = { .program = "mesh", .synopsis = "[OPTION]... SCENE.gltf -o FILE.mesh",
		         .about = "Reads a glTF scene, cleans it, and divides its surfaces into "
		                  "elements and patches.",
		         .options = options, .uses_threads = 1, .keeps_output = 1 };
	struct request r = { .mesher = MESH_OPTIONS_DEFAULT, .gltf = GLTF_OPTIONS_DEFAULT,
		             .refine = { .error = .02, .smallest = { .0025, 1 },
		                         .elements = 1000000 } };
	struct job j = { .cli = &c, .r = &r };
	struct err e = { 0 };

	cli_signals();
	settle(&c, options_parse(&c, argc, argv, &r), &r);
	int status = work(&j, &e) ? cli_fail(&c, &e) : 0;
	mesh_report_free(&j.mesher);
	gltf_report_free(&j.gltf);
	file_cache_info_free(&j.info);
	file_cache_info_free(&j.old_info);
	solution_free(&j.s);
	model_free(&j.old);
	model_free(&j.m);
	free(j.origin);
	return cli_finish(&c, status);
}
