/* Nodes with meshes to surfaces and triangles, nodes with cameras to cameras, nodes with
 * lights to lights. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"
#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/data/camera_pose.h"

struct scene {
	struct gltf_reader *g;
	struct model *m;
	double *world;           /* [nodes][16] */
	uint8_t *reached;        /* [nodes] */
	json_t *names;           /* taken */
	struct array vertex;     /* double[3] */
	uint32_t *map, *stamp;   /* [largest accessor] its vertex in the model, valid
	                            where the stamp is that of the surface */
	size_t surface, triangle;/* filled so far */
	struct err *e;
};

/* One primitive of one node, while it is copied. */
struct instance {
	size_t node;
	double matrix[16];
	double normal_matrix[9]; /* columns; only directions matter */
	int flip;                /* mirrored: the winding turns over */
	const struct gltf_primitive *p;
	struct gltf_elements position, normal, uv, index;
};

/* ---- names ---- */

/* A node's name, else that of the mesh or camera it carries, else its kind and
 * number; with `suffix`. */
static char *name_of(struct scene *s, size_t node, const char *array, int index,
                     const char *kind, const char *suffix)
{
	const json_t *root = s->g->source.root;
	const char *name = gltf_string(json_array_get(json_object_get(root, "nodes"), node),
	                               "name");
	char plain[40], *whole, *unique;

	if (!name || !*name)
		name = gltf_string(json_array_get(json_object_get(root, array), (size_t)index),
		                   "name");
	snprintf(plain, sizeof plain, "%s%d", kind, index);
	if (!name || !*name)
		name = plain;
	size_t size = strlen(name) + strlen(suffix) + 1;
	whole = mem_new(size, 1, "a name", s->e);
	if (!whole)
		return NULL;
	snprintf(whole, size, "%s%s", name, suffix);
	unique = gltf_unique_name(s->names, whole, s->e);
	free(whole);
	return unique;
}

/* ---- triangles ---- */

static size_t count_corners(const struct gltf_doc *d, const struct gltf_primitive *p)
{
	return d->accessor[p->indices == GLTF_NONE ? p->position : p->indices].count;
}

static size_t count_triangles(const struct gltf_doc *d, const struct gltf_primitive *p)
{
	size_t corners = count_corners(d, p);

	return p->mode == GLTF_TRIANGLES ? corners / 3 : corners - 2;
}

/* Corner k of triangle t in the primitive's sequence (glTF 2.0, 3.7.2.1). */
static size_t corner(int mode, size_t t, size_t k)
{
	switch (mode) {
	case GLTF_STRIP:
		return k == 0 ? t : k == 1 ? t + 1 + (t & 1) : t + 2 - (t & 1);
	case GLTF_FAN:
		return k == 2 ? 0 : t + 1 + k;
	default:
		return 3 * t + k;
	}
}

/* The inverse transpose of the linear part times |det|: its columns are the cross
 * products of the matrix's, with the sign of the determinant. */
static void set_matrix(struct instance *i, const double m[16])
{
	double det;

	memcpy(i->matrix, m, sizeof i->matrix);
	v3_cross(m + 4, m + 8, i->normal_matrix);
	v3_cross(m + 8, m, i->normal_matrix + 3);
	v3_cross(m, m + 4, i->normal_matrix + 6);
	det = v3_dot(m, i->normal_matrix);
	i->flip = det < 0;
	for (int k = 0; i->flip && k < 9; k++)
		i->normal_matrix[k] = -i->normal_matrix[k];
}

static int mesh_add_vertex(struct scene *s, const struct instance *i, size_t from, uint32_t *out)
{
	double x[3], w[3];

	if (s->stamp[from] == s->surface + 1) {
		*out = s->map[from];
		return 0;
	}
	gltf_element(&i->position, from, x);
	for (int r = 0; r < 3; r++) {
		const double *m = i->matrix + r;
		w[r] = m[0] * x[0] + m[4] * x[1] + m[8] * x[2] + m[12];
		if (!isfinite(w[r]))
			return err_set(s->e, "%s: nodes[%zu]: a vertex is not finite in world "
			               "coordinates; correct its matrix", s->g->source.path, i->node);
	}
	if (s->vertex.n >= UINT32_MAX)
		return err_set(s->e, "%s: more than 2^32 vertices; split the scene",
		               s->g->source.path);
	*out = (uint32_t)s->vertex.n;
	s->map[from] = *out;
	s->stamp[from] = (uint32_t)s->surface + 1;
	return mem_append(&s->vertex, w, 1, sizeof w, s->e);
}

static void set_uv(const struct scene *s, const struct instance *i, size_t from, size_t to)
{
	float *uv = s->m->triangle.uv + 2 * to;
	double x[4];

	if (i->p->uv == GLTF_NONE)
		return;
	gltf_element(&i->uv, from, x);
	uv[0] = (float)x[0];
	uv[1] = (float)x[1];
}

static void set_normal(const struct scene *s, const struct instance *i, size_t from,
                       size_t to)
{
	float *normal = s->m->triangle.normal + 3 * to;
	const double *c = i->normal_matrix;
	double x[4], w[3];

	if (i->p->normal == GLTF_NONE)
		return;
	gltf_element(&i->normal, from, x);
	for (int r = 0; r < 3; r++)
		w[r] = c[r] * x[0] + c[3 + r] * x[1] + c[6 + r] * x[2];
	if (!(v3_normalise(w) > 0))
		return;
	for (int r = 0; r < 3; r++)
		normal[r] = (float)w[r];
}

static int add_triangle(struct scene *s, const struct instance *i, size_t t)
{
	size_t at = s->triangle++;

	s->m->triangle.surface[at] = (uint32_t)s->surface;
	for (size_t k = 0; k < 3; k++) {
		size_t from = corner(i->p->mode, t, i->flip && k ? 3 - k : k);
		if (i->p->indices != GLTF_NONE)
			from = gltf_index(&i->index, from);
		if (mesh_add_vertex(s, i, from, &s->m->triangle.corner[3 * at + k]))
			return -1;
		set_uv(s, i, from, 3 * at + k);
		set_normal(s, i, from, 3 * at + k);
	}
	return 0;
}

static int add_surface(struct scene *s, struct instance *i, int mesh, size_t primitive,
                       int several)
{
	const struct gltf_reader *g = s->g;
	const struct gltf_primitive *p = i->p;
	struct surfaces *to = &s->m->surface;
	size_t n = count_triangles(&g->doc, p);
	char suffix[32] = "";

	if (several)
		snprintf(suffix, sizeof suffix, "#p%zu", primitive);
	to->name[s->surface] = name_of(s, i->node, "meshes", mesh, "mesh", suffix);
	if (!to->name[s->surface])
		return -1;
	to->material[s->surface] = p->material == GLTF_NONE ? UINT32_MAX
	                                                    : (uint32_t)p->material;
	to->has_normals[s->surface] = p->normal != GLTF_NONE;
	i->position = gltf_access(g, p->position);
	if (p->normal != GLTF_NONE)
		i->normal = gltf_access(g, p->normal);
	if (p->uv != GLTF_NONE)
		i->uv = gltf_access(g, p->uv);
	if (p->indices != GLTF_NONE)
		i->index = gltf_access(g, p->indices);
	for (size_t t = 0; t < n; t++)
		if (add_triangle(s, i, t))
			return -1;
	s->surface++;
	return 0;
}

static int add_node(struct scene *s, size_t node)
{
	const struct gltf_doc *d = &s->g->doc;
	int index = d->node[node].mesh;
	struct instance i = { .node = node };

	if (!s->reached[node] || index == GLTF_NONE)
		return 0;
	const struct gltf_mesh *mesh = &d->mesh[index];
	set_matrix(&i, s->world + 16 * node);
	for (size_t p = 0; p < mesh->primitives; p++) {
		i.p = &d->primitive[mesh->primitive + p];
		if (i.p->mode >= GLTF_TRIANGLES &&
		    add_surface(s, &i, index, p, mesh->primitives > 1))
			return -1;
	}
	return 0;
}

/* Sizes of the model's arrays, and of the report. */
static int count(struct scene *s, size_t *surfaces, size_t *triangles)
{
	const struct gltf_doc *d = &s->g->doc;
	struct gltf_report *r = s->g->report;

	for (size_t i = 0; i < d->nodes; i++) {
		if (!s->reached[i])
			continue;
		r->nodes++;
		s->m->cameras += d->node[i].camera != GLTF_NONE;
		if (d->node[i].mesh == GLTF_NONE)
			continue;
		const struct gltf_mesh *mesh = &d->mesh[d->node[i].mesh];
		for (size_t k = 0; k < mesh->primitives; k++) {
			const struct gltf_primitive *p = &d->primitive[mesh->primitive + k];
			if (p->mode < GLTF_TRIANGLES) {
				r->skipped++;
				continue;
			}
			++*surfaces;
			*triangles += count_triangles(d, p);
			if (*triangles > INT32_MAX)
				return err_set(s->e, "%s: more than 2^31 triangles; split the scene",
				               s->g->source.path);
		}
	}
	return 0;
}

static int allocate(struct scene *s, size_t surfaces, size_t triangles)
{
	struct model *m = s->m;
	size_t most = 0;

	for (size_t i = 0; i < s->g->doc.accessors; i++)
		if (s->g->doc.accessor[i].count > most)
			most = s->g->doc.accessor[i].count;
	m->surface.n = surfaces;
	m->triangle.n = triangles;
	m->surface.name = mem_new(surfaces, sizeof *m->surface.name, "names", s->e);
	m->surface.material = mem_new(surfaces, sizeof *m->surface.material, "surfaces", s->e);
	m->surface.has_normals = mem_new(surfaces, 1, "surfaces", s->e);
	m->camera = mem_new(m->cameras, sizeof *m->camera, "cameras", s->e);
	m->triangle.corner = mem_new(triangles, 3 * sizeof *m->triangle.corner, "triangles", s->e);
	m->triangle.surface = mem_new(triangles, sizeof *m->triangle.surface, "triangles", s->e);
	m->triangle.uv = mem_new(triangles, 6 * sizeof *m->triangle.uv, "UVs", s->e);
	m->triangle.normal = mem_new(triangles, 9 * sizeof *m->triangle.normal, "normals", s->e);
	s->map = mem_new(most, sizeof *s->map, "vertices", s->e);
	s->stamp = mem_new(most, sizeof *s->stamp, "vertices", s->e);
	return s->e->set ? -1 : 0;
}

/* ---- cameras ---- */

static int add_camera(struct scene *s, size_t node, struct camera *to)
{
	int index = s->g->doc.node[node].camera;
	const struct gltf_camera *from = &s->g->doc.camera[index];

	to->name = name_of(s, node, "cameras", index, "camera", "");
	if (!to->name)
		return -1;
	to->orthographic = from->orthographic;
	to->yfov = from->yfov;
	to->aspect = from->aspect;
	to->xmag = from->xmag;
	to->ymag = from->ymag;
	if (model_camera_pose(s->world + 16 * node, to->to_world))
		return err_set(s->e, "%s: nodes[%zu]: its matrix gives the camera no direction; "
		               "correct it", s->g->source.path, node);
	return 0;
}

static int add_cameras(struct scene *s)
{
	size_t at = 0;

	json_object_clear(s->names);
	for (size_t i = 0; i < s->g->doc.nodes; i++)
		if (s->reached[i] && s->g->doc.node[i].camera != GLTF_NONE &&
		    add_camera(s, i, &s->m->camera[at++]))
			return -1;
	return 0;
}

static int build(struct scene *s)
{
	size_t surfaces = 0, triangles = 0, nodes = s->g->doc.nodes;

	s->world = mem_new(nodes, 16 * sizeof *s->world, "matrices", s->e);
	s->reached = mem_new(nodes, 1, "marks of nodes", s->e);
	if (!s->world || !s->reached ||
	    gltf_world_matrices(s->g, s->world, s->reached, s->e) ||
	    count(s, &surfaces, &triangles) || allocate(s, surfaces, triangles))
		return -1;
	for (size_t i = 0; i < nodes; i++)
		if (add_node(s, i))
			return -1;
	return add_cameras(s) || gltf_lights(s->g, s->m, s->world, s->reached, s->e) ? -1 : 0;
}

int gltf_scene(struct gltf_reader *g, struct model *m, struct err *e)
{
	struct scene s = { .g = g, .m = m, .names = json_object(), .e = e };
	int status = build(&s);

	m->vertices = s.vertex.n;
	m->vertex = s.vertex.data;
	json_decref(s.names);
	free(s.world);
	free(s.reached);
	free(s.map);
	free(s.stamp);
	return status;
}
