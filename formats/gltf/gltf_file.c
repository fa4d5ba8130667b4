#include "formats/gltf/gltf_file.h"

#include <stdlib.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"

static void gltf_doc_free(struct gltf_doc *d)
{
	free(d->view);
	free(d->accessor);
	free(d->primitive);
	free(d->mesh);
	free(d->node);
	free(d->camera);
	free(d->child);
	free(d->root);
	*d = (struct gltf_doc){ 0 };
}

/* tinygltf gets only the parts that are read, as it would refuse a file for what it
 * does not like in others, or load images. */
static int load(struct gltf_reader *g, struct err *e)
{
	static const char *const parts[] = { "asset", "bufferViews", "accessors", "meshes",
		"cameras", "nodes", "scenes", "scene" };
	json_t *root = json_object();
	int status = -1;

	for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
		json_t *part = json_object_get(g->source.root, parts[i]);
		if (part)
			json_object_set(root, parts[i], part);
	}
	char *text = json_dumps(root, JSON_COMPACT);
	if (text)
		status = gltf_load(g->source.path, text, strlen(text), &g->doc, e);
	else
		err_set(e, "out of memory for %s", g->source.path);
	free(text);
	json_decref(root);
	return status;
}

static int read_all(struct gltf_reader *g, const char *path, struct model *m, struct err *e)
{
	if (gltf_source_open(&g->source, path, e) ||
	    gltf_schema_check(g->source.path, g->source.root, e) ||
	    gltf_check_cameras(g->source.path, g->source.root, e) ||
	    gltf_source_buffers(&g->source, e) || load(g, e) ||
	    gltf_check_data(g, e) || gltf_check_nodes(g, e))
		return -1;
	m->lobe = g->options->lobe;
	if (gltf_scene(g, m, e) || gltf_materials(g, m, e) || gltf_report_unread(g, e))
		return -1;
	return gltf_source_digest(&g->source, g->report->digest, e);
}

int gltf_file_read(const char *path, const struct gltf_options *o, struct model *m,
                   struct gltf_report *r, struct err *e)
{
	struct gltf_reader g = { .options = o, .report = r };
	int status = read_all(&g, path, m, e);

	gltf_doc_free(&g.doc);
	gltf_source_close(&g.source);
	if (status) {
		gltf_one_line(e->text);
		model_free(m);
	}
	return status;
}
