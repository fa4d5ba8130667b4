/* The radiosity solution. */
#include "formats/api/api_scene.h"
#include "lib/interpolate/discretisation.h"
#include "lib/radiosity/radiosity.h"
#include "lib/radiosity/transport.h"

struct twopass_solve_options twopass_solve_defaults(void)
{
	return (struct twopass_solve_options){ .stop = RADIOSITY_OPTIONS_DEFAULT.stop };
}

static int solve(const struct twopass_scene *s, const struct twopass_solve_options *options,
                 struct solution *out, struct err *e)
{
	const struct ff *ff = &s->ff.f;
	const char *name;
	struct radiosity_options o = RADIOSITY_OPTIONS_DEFAULT;
	struct radiosity_hooks hooks = { 0 };
	struct radiosity_report report;
	struct transport t = { 0 };

	if (!s->ff.container)
		return err_set(e, "the scene has no form factors to solve with");
	o.stop = options->stop;
	o.threads = api_threads(options->threads);
	name = file_container_path(s->ff.container);
	int bad = api_within("stop", o.stop, 0, 1, e) ||
	          radiosity_transport_init(&t, &s->m, &ff, &name, 1, o.threads, e) ||
	          radiosity_begin(out, &s->m, &t, 0, e) ||
	          radiosity_solve(out, &t, &o, &hooks, &report, e) ||
	          interp_discretisation(&s->m, out, 1, o.threads, e);
	radiosity_transport_free(&t);
	return bad ? -1 : 0;
}

int twopass_solve(struct twopass_scene *s, const struct twopass_solve_options *options,
                  struct twopass_error *error)
{
	const struct twopass_solve_options usual = twopass_solve_defaults();
	struct solution new = { 0 };
	struct err e = { 0 };

	if (solve(s, options ? options : &usual, &new, &e) ||
	    api_history(&s->info, s->ff.info.history, "twopass_solve", NULL, &e)) {
		solution_free(&new);
	} else {
		file_cache_ids(&s->m, &s->info);
		solution_free(&s->s);
		s->s = new;
	}
	return api_status(&e, error);
}
