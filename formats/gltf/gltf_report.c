/* Notes for the user: what of the file is not modelled, each once. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"
#include "lib/base/mem.h"

enum { NOTE = 512 }; /* bytes of a note; a longer one is cut */

int gltf_note(struct gltf_report *r, struct err *e, const char *format, ...)
{
	char text[NOTE];
	va_list ap;

	va_start(ap, format);
	vsnprintf(text, sizeof text, format, ap);
	va_end(ap);
	gltf_one_line(text);
	for (size_t i = 0; i < r->notes; i++)
		if (strcmp(r->note[i], text) == 0)
			return 0;
	char **longer = realloc(r->note, (r->notes + 1) * sizeof *longer);
	if (longer)
		r->note = longer;
	char *copy = longer ? strdup(text) : NULL;
	if (!copy)
		return err_set(e, "out of memory for notes");
	r->note[r->notes++] = copy;
	return 0;
}

void gltf_report_free(struct gltf_report *r)
{
	for (size_t i = 0; i < r->notes; i++)
		free(r->note[i]);
	free(r->note);
	*r = (struct gltf_report){ 0 };
}

/* Counts in `found` how often each extension that is not read occurs. The depth
 * is bounded by jansson's parser. */
static void count_extensions(json_t *at, json_t *found)
{
	const char *key;
	json_t *value;
	size_t i;

	json_array_foreach(at, i, value)
		count_extensions(value, found);
	json_object_foreach(at, key, value)
		if (strcmp(key, "extras") != 0 && strcmp(key, "extensions") != 0)
			count_extensions(value, found);
	json_object_foreach(json_object_get(at, "extensions"), key, value)
		if (!gltf_schema_knows(key)) {
			json_int_t n = json_integer_value(json_object_get(found, key));
			json_object_set_new(found, key, json_integer(n + 1));
		}
}

static int note_extensions(struct gltf_reader *g, struct err *e)
{
	json_t *found = json_object(), *value;
	const char *key;
	int status = 0;

	json_object_foreach(g->source.root, key, value)
		if (strcmp(key, "extensions") != 0)
			count_extensions(value, found);
	json_object_foreach(found, key, value) {
		json_int_t n = json_integer_value(value);
		if (!status)
			status = gltf_note(g->report, e, "%.100s is not yet modelled (used %d time%s)",
			                   key, (int)n, n == 1 ? "" : "s");
	}
	json_decref(found);
	return status;
}

/* Members of the root array that have `key`. */
static size_t count_with(const struct gltf_reader *g, const char *array, const char *key)
{
	const json_t *list = json_object_get(g->source.root, array);
	size_t n = 0;

	for (size_t i = 0; i < json_array_size(list); i++)
		n += json_object_get(json_array_get(list, i), key) != NULL;
	return n;
}

static int note_primitives(struct gltf_reader *g, struct err *e)
{
	const json_t *meshes = json_object_get(g->source.root, "meshes");
	size_t coloured = 0, morphed = 0;

	for (size_t m = 0; m < json_array_size(meshes); m++) {
		const json_t *list = json_object_get(json_array_get(meshes, m), "primitives");
		for (size_t p = 0; p < json_array_size(list); p++) {
			const json_t *o = json_array_get(list, p);
			coloured += json_object_get(json_object_get(o, "attributes"),
			                            "COLOR_0") != NULL;
			morphed += json_array_size(json_object_get(o, "targets")) > 0;
		}
	}
	if (coloured && gltf_note(g->report, e, "vertex colours (COLOR_0) are not modelled "
	                          "(%zu primitives)", coloured))
		return -1;
	if (morphed && gltf_note(g->report, e, "morph targets are not modelled, their base "
	                         "shapes are used (%zu primitives)", morphed))
		return -1;
	return 0;
}

static int note_count(struct gltf_reader *g, size_t n, const char *what, struct err *e)
{
	return n ? gltf_note(g->report, e, "%s (%zu)", what, n) : 0;
}

int gltf_report_unread(struct gltf_reader *g, struct err *e)
{
	const json_t *root = g->source.root;
	size_t scenes = json_array_size(json_object_get(root, "scenes"));

	if (scenes > 1 && gltf_note(g->report, e, "the file has %zu scenes, only scenes[%d] is "
	                            "read", scenes, g->doc.scene))
		return -1;
	if (note_count(g, g->report->skipped, "primitives of points and lines are skipped, "
	               "they have no area", e) ||
	    note_count(g, json_array_size(json_object_get(root, "animations")), "animations are "
	               "not modelled, the nodes stay where the file puts them", e) ||
	    note_count(g, count_with(g, "nodes", "skin"), "skinning is not modelled, meshes "
	               "keep their rest pose", e) ||
	    note_count(g, count_with(g, "materials", "normalTexture"), "normal maps are not "
	               "modelled", e) ||
	    note_count(g, count_with(g, "materials", "occlusionTexture"), "occlusion maps are "
	               "not used, occlusion is computed", e))
		return -1;
	return note_primitives(g, e) || note_extensions(g, e) ? -1 : 0;
}
