#include "formats/cache/rad_file.h"

#include <stdlib.h>
#include <string.h>

#include "formats/cache/mesh_file.h"
#include "formats/container/fields.h"

#define FORMAT "twopass.rad"

enum { FIELDS_MAX = 17 }; /* room for the list of fields below */

/* What is a plain member of the struct and an array in the file. */
struct plain {
	uint64_t *shots;
	double *round;
};

/* The solution's arrays with shapes from its counts. */
static size_t solution_fields(struct solution *s, struct plain *plain,
                              struct field out[FIELDS_MAX])
{
	const uint64_t b = (uint64_t)s->bands, sides = s->element_sides, g = s->groups;
	const struct field f[] = {
		{ &s->irradiance.direct, "irradiance_direct", DT_F64, 3, { g, sides, b } },
		{ &s->irradiance.caustic, "irradiance_caustic", DT_F64, 3, { g, sides, b } },
		{ &s->irradiance.indirect, "irradiance_indirect", DT_F64, 3, { g, sides, b } },
		{ &s->error.sampling, "irradiance_error", DT_F64, 2, { sides, b } },
		{ &s->error.sampling_direct, "irradiance_error_direct", DT_F64, 2, { sides, b } },
		{ &s->error.discretisation_direct, "irradiance_discretisation_direct", DT_F64, 2,
		  { sides, b } },
		{ &s->error.discretisation, "irradiance_discretisation", DT_F64, 2, { sides, b } },
		{ &s->error.uneven, "irradiance_error_uneven", DT_F64, 2, { sides, b } },
		{ &s->uneven, "irradiance_uneven", DT_F32, 3, { g, sides, b } },
		{ &s->unshot.emission, "unshot_emission", DT_F64, 2, { s->sources, b } },
		{ &s->unshot.diffuse, "unshot_diffuse", DT_F64, 3, { s->patch_sides, g, b } },
		{ &s->unshot.link, "unshot_link", DT_F64, 4, { s->links, 2, g, b } },
		{ &s->shot, "shot", DT_F64, 4, { s->rows, 2, g, b } },
		{ &s->ledger, "ledger", DT_F64, 3, { LEDGER_TERMS, g, b } },
		{ &plain->round, "round", DT_F64, 1, { ROUND_TERMS } },
		{ &plain->shots, "shots", DT_U64, 1, { 1 } },
		{ &s->emitter_group, "emitter_group", DT_U32, 1, { s->emitters } },
	};

	memcpy(out, f, sizeof f);
	return sizeof f / sizeof *f;
}

static int put_solution(struct container_writer *w, const struct model *m,
                        const struct solution *s, struct err *e)
{
	struct field f[FIELDS_MAX];
	struct solution view = *s; /* the list points at pointers: those of this copy */
	struct plain plain = { &view.shots, view.round };
	struct err why = { 0 };

	if (solution_check(m, s, &why))
		return err_set(e, "%s: cannot write: %s", file_container_writer_path(w), why.text);
	return file_fields_put(w, f, solution_fields(&view, &plain, f), e) ||
	       file_cache_write_names(w, "light_groups", s->group_name, s->groups, e) ? -1 : 0;
}

int file_rad_write(const char *path, const struct model *m, const struct solution *s,
                   const struct cache_info *i, struct err *e)
{
	struct container_writer *w = file_container_create(path, e);
	struct cache_info info = *i;

	if (!w)
		return -1;
	file_cache_ids(m, &info);
	if (file_mesh_put_model(w, m, e) || put_solution(w, m, s, e) ||
	    file_cache_write_info(w, FORMAT, &info, e)) {
		file_container_abandon(w);
		return -1;
	}
	return file_container_finish(w, e);
}

static int get_solution(const struct container *c, const struct model *m,
                        struct solution *s, struct err *e)
{
	struct field f[FIELDS_MAX];
	struct err why = { 0 };
	struct plain plain = { 0 };
	int failed;

	*s = (struct solution){ .bands = m->bands, .element_sides = 2 * m->element.n,
	                        .patch_sides = 2 * m->patch.n, .sources = model_sources(m),
	                        .emitters = m->material.n + m->light.n };
	if (file_fields_size(c, "irradiance_direct", DT_F64, 3, 0, &s->groups, e) ||
	    file_fields_size(c, "unshot_link", DT_F64, 4, 0, &s->links, e) ||
	    file_fields_size(c, "shot", DT_F64, 4, 0, &s->rows, e))
		return -1;
	if (!(failed = file_fields_copy(c, f, solution_fields(s, &plain, f), e))) {
		s->shots = *plain.shots;
		memcpy(s->round, plain.round, sizeof s->round);
	}
	free(plain.shots);
	free(plain.round);
	if (failed || file_cache_read_names(c, "light_groups", &s->group_name, s->groups, e))
		return -1;
	return solution_check(m, s, &why) ? file_container_refuse(c, e, "%s", why.text) : 0;
}

int file_rad_read(const char *path, struct model *m, struct solution *s,
                  struct cache_info *i, struct err *e)
{
	struct container *c = file_container_open(path, FORMAT, e);
	int failed = !c || file_container_verify_all(c, e) || file_cache_read_info(c, i, e) ||
	             file_mesh_get_model(c, m, e) || file_mesh_check_ids(c, m, i, e) ||
	             get_solution(c, m, s, e);

	file_container_close(c);
	if (!failed)
		return 0;
	model_free(m);
	solution_free(s);
	file_cache_info_free(i);
	return -1;
}
