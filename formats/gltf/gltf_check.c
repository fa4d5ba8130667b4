/* Everything about buffers, accessors and primitives that the table of
 * gltf_schema.c cannot say, before any byte of them is used. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"
#include "lib/base/mem.h"
#include "lib/data/camera_pose.h"

/* Accessors of zeros (without a bufferView) cost nothing in the file, so that a
 * small file could ask for any amount of memory. Elements at most: 256 MiB of VEC4, a guess. */
enum { ZEROS_MAX = 1 << 24 };

static int check_camera(const char *path, size_t i, const json_t *camera, struct err *e)
{
	const char *type = gltf_string(camera, "type");
	const json_t *o = json_object_get(camera, type);
	double near = gltf_number(o, "znear", 1), far = gltf_number(o, "zfar", INFINITY);

	if (!o)
		return err_set(e, "%s: cameras[%zu].%s: is missing; correct the file", path, i,
		               type);
	if (strcmp(type, "perspective") == 0) {
		if (!model_camera_yfov_valid(gltf_number(o, "yfov", 0)))
			return err_set(e, "%s: cameras[%zu].perspective.yfov: %.15g is not between 0 "
			               "and pi; correct the file", path, i, gltf_number(o, "yfov", 0));
		if (!(near > 0))
			return err_set(e, "%s: cameras[%zu].perspective.znear: must be above 0; "
			               "correct the file", path, i);
		if (!(gltf_number(o, "aspectRatio", 1) > 0))
			return err_set(e, "%s: cameras[%zu].perspective.aspectRatio: must be above 0; "
			               "correct the file", path, i);
	} else if (!(gltf_number(o, "xmag", 0) > 0) || !(gltf_number(o, "ymag", 0) > 0)) {
		return err_set(e, "%s: cameras[%zu].orthographic: xmag and ymag must be above 0; "
		               "correct the file", path, i);
	}
	if (!(far > near))
		return err_set(e, "%s: cameras[%zu].%s.zfar: must be above znear; correct the "
		               "file", path, i, type);
	return 0;
}

int gltf_check_cameras(const char *path, const json_t *root, struct err *e)
{
	const json_t *cameras = json_object_get(root, "cameras");

	for (size_t i = 0; i < json_array_size(cameras); i++)
		if (check_camera(path, i, json_array_get(cameras, i), e))
			return -1;
	return 0;
}

struct check {
	const struct gltf_reader *g;
	const char *path;
	const struct gltf_doc *d;
	int quantised;          /* KHR_mesh_quantization is in use */
	uint8_t *finite;        /* [accessors] found finite */
	struct err *e;
};

static int check_views(const struct check *c)
{
	for (size_t i = 0; i < c->d->views; i++) {
		const struct gltf_view *v = &c->d->view[i];
		size_t bytes = c->g->source.buffer[v->buffer].bytes;
		if (v->offset > bytes || v->length > bytes - v->offset)
			return err_set(c->e, "%s: bufferViews[%zu]: bytes %zu to %zu are outside "
			               "buffers[%zu] of %zu bytes; correct the file", c->path, i,
			               v->offset, v->offset + v->length, v->buffer, bytes);
	}
	return 0;
}

/* `count` elements of `size` bytes, `stride` apart, lie inside the view. */
static int check_fit(const struct check *c, size_t accessor, const char *part,
                     struct gltf_place at, size_t count, size_t size, size_t stride)
{
	const struct gltf_view *v = &c->d->view[at.view];
	size_t component = gltf_component_size(at.component);

	if ((v->offset + at.offset) % component || at.offset % component)
		return err_set(c->e, "%s: accessors[%zu]%s: its byte offset is no multiple of its "
		               "component size %zu; export it again", c->path, accessor, part,
		               component);
	if (stride < size || stride % component)
		return err_set(c->e, "%s: accessors[%zu]%s: byteStride %zu does not suit elements "
		               "of %zu bytes; correct the file", c->path, accessor, part, stride,
		               size);
	if (at.offset > v->length || size > v->length - at.offset ||
	    count - 1 > (v->length - at.offset - size) / stride)
		return err_set(c->e, "%s: accessors[%zu]%s: %zu elements do not fit into "
		               "bufferViews[%d] of %zu bytes; correct the file", c->path,
		               accessor, part, count, at.view, v->length);
	return 0;
}

static int check_sparse(const struct check *c, size_t i)
{
	const struct gltf_accessor *a = &c->d->accessor[i];
	size_t index_size = gltf_component_size(a->index.component);
	size_t size = gltf_element_size(a);

	if (a->sparse > a->count)
		return err_set(c->e, "%s: accessors[%zu].sparse: replaces %zu of %zu elements; "
		               "correct the file", c->path, i, a->sparse, a->count);
	if (a->index.component != GLTF_U8 && a->index.component != GLTF_U16 &&
	    a->index.component != GLTF_U32)
		return err_set(c->e, "%s: accessors[%zu].sparse.indices: componentType %d is no "
		               "unsigned integer; correct the file", c->path, i,
		               a->index.component);
	if (check_fit(c, i, ".sparse.indices", a->index, a->sparse, index_size, index_size) ||
	    check_fit(c, i, ".sparse.values", a->value, a->sparse, size, size))
		return -1;
	struct gltf_elements v = gltf_access(c->g, (int)i);
	for (size_t k = 0; k < a->sparse; k++) {
		uint32_t at = gltf_sparse_index(&v, k);
		if (at >= a->count || (k && at <= gltf_sparse_index(&v, k - 1)))
			return err_set(c->e, "%s: accessors[%zu].sparse.indices: index %u is out of "
			               "range or not ascending; correct the file", c->path, i, at);
	}
	return 0;
}

static int check_accessor(const struct check *c, size_t i)
{
	const struct gltf_accessor *a = &c->d->accessor[i];
	size_t size = gltf_element_size(a);

	if (!size)
		return err_set(c->e, "%s: accessors[%zu]: componentType %d is unknown; correct "
		               "the file", c->path, i, a->at.component);
	if (a->normalised && gltf_component_size(a->at.component) == 4)
		return err_set(c->e, "%s: accessors[%zu]: only 8 and 16 bit integers can be "
		               "normalized; correct the file", c->path, i);
	if (a->at.view != GLTF_NONE) {
		size_t stride = c->d->view[a->at.view].stride;
		if (check_fit(c, i, "", a->at, a->count, size, stride ? stride : size))
			return -1;
	} else if (a->count > ZEROS_MAX) {
		return err_set(c->e, "%s: accessors[%zu]: %zu elements without a bufferView; give "
		               "it one", c->path, i, a->count);
	}
	return a->sparse ? check_sparse(c, i) : 0;
}

/* Which component types an attribute can have. */
enum { PLAIN = 1, UNSIGNED_UNIT = 2, SIGNED_UNIT = 4, ANY_SMALL = 8 };

static int allowed(const struct gltf_accessor *a, int types)
{
	int component = a->at.component;

	if (component == GLTF_F32)
		return 1;
	if (component == GLTF_U32)
		return 0;
	if (types & ANY_SMALL)
		return 1;
	if (!a->normalised)
		return 0;
	if (component == GLTF_U8 || component == GLTF_U16)
		return types & UNSIGNED_UNIT;
	return types & SIGNED_UNIT;
}

static int check_finite(const struct check *c, int accessor, const char *name)
{
	double x[4];

	if (c->finite[accessor])
		return 0;
	struct gltf_elements v = gltf_access(c->g, accessor);
	for (size_t i = 0; i < v.count; i++) {
		gltf_element(&v, i, x);
		for (int k = 0; k < v.n; k++)
			if (!isfinite(x[k]))
				return err_set(c->e, "%s: accessors[%d]: %s %zu is not finite; correct "
				               "the file", c->path, accessor, name, i);
	}
	c->finite[accessor] = 1;
	return 0;
}

struct where {
	size_t mesh, primitive; /* of the mesh */
};

static int check_attribute(const struct check *c, struct where at, const char *name,
                           int accessor, int rows, int types, size_t count)
{
	if (accessor == GLTF_NONE)
		return 0;
	const struct gltf_accessor *a = &c->d->accessor[accessor];
	if (a->rows != rows || a->columns != 1 || !allowed(a, types))
		return err_set(c->e, "%s: meshes[%zu].primitives[%zu]: %s in accessors[%d] must "
		               "be VEC%d of floats%s; export it again", c->path, at.mesh,
		               at.primitive, name, accessor, rows,
		               c->quantised ? "" : " (small integers need "
		               "KHR_mesh_quantization in extensionsUsed)");
	if (a->count != count)
		return err_set(c->e, "%s: meshes[%zu].primitives[%zu]: %zu elements of %s for %zu "
		               "of POSITION; correct the file", c->path, at.mesh, at.primitive,
		               a->count, name, count);
	return check_finite(c, accessor, name);
}

static int check_indices(const struct check *c, struct where at, int accessor,
                         size_t vertices)
{
	const struct gltf_accessor *a = &c->d->accessor[accessor];
	int type = a->at.component;

	if (a->rows != 1 || a->columns != 1 || a->normalised ||
	    (type != GLTF_U8 && type != GLTF_U16 && type != GLTF_U32))
		return err_set(c->e, "%s: meshes[%zu].primitives[%zu]: indices in accessors[%d] "
		               "must be SCALAR unsigned integers; correct the file", c->path,
		               at.mesh, at.primitive, accessor);
	if (a->at.view != GLTF_NONE && c->d->view[a->at.view].stride)
		return err_set(c->e, "%s: meshes[%zu].primitives[%zu]: indices in accessors[%d] "
		               "cannot have a byteStride; correct the file", c->path, at.mesh,
		               at.primitive, accessor);
	struct gltf_elements v = gltf_access(c->g, accessor);
	for (size_t i = 0; i < v.count; i++)
		if (gltf_index(&v, i) >= vertices)
			return err_set(c->e, "%s: meshes[%zu].primitives[%zu]: index %u at position "
			               "%zu of accessors[%d] is out of range, there are %zu "
			               "vertices; correct the file", c->path, at.mesh, at.primitive,
			               gltf_index(&v, i), i, accessor, vertices);
	return 0;
}

static int check_corners(const struct check *c, struct where at,
                         const struct gltf_primitive *p, size_t corners)
{
	if (p->mode == GLTF_TRIANGLES && corners % 3)
		return err_set(c->e, "%s: meshes[%zu].primitives[%zu]: %zu corners are no whole "
		               "number of triangles; correct the file", c->path, at.mesh,
		               at.primitive, corners);
	if (corners < 3)
		return err_set(c->e, "%s: meshes[%zu].primitives[%zu]: a strip or fan needs 3 "
		               "corners, has %zu; correct the file", c->path, at.mesh,
		               at.primitive, corners);
	return 0;
}

static int check_primitive(const struct check *c, struct where at,
                           const struct gltf_primitive *p)
{
	int quantised = c->quantised ? ANY_SMALL : 0;

	if (p->mode < GLTF_TRIANGLES)
		return 0;
	if (p->position == GLTF_NONE)
		return err_set(c->e, "%s: meshes[%zu].primitives[%zu]: has no POSITION; correct "
		               "the file", c->path, at.mesh, at.primitive);
	size_t n = c->d->accessor[p->position].count;
	if (check_attribute(c, at, "POSITION", p->position, 3, PLAIN | quantised, n) ||
	    check_attribute(c, at, "NORMAL", p->normal, 3,
	                    quantised ? SIGNED_UNIT : PLAIN, n) ||
	    check_attribute(c, at, "TEXCOORD_0", p->uv, 2, UNSIGNED_UNIT | quantised, n))
		return -1;
	if (p->indices == GLTF_NONE)
		return check_corners(c, at, p, n);
	if (check_indices(c, at, p->indices, n))
		return -1;
	return check_corners(c, at, p, c->d->accessor[p->indices].count);
}

static int check_meshes(const struct check *c)
{
	for (size_t m = 0; m < c->d->meshes; m++) {
		const struct gltf_mesh *mesh = &c->d->mesh[m];
		for (size_t p = 0; p < mesh->primitives; p++) {
			struct where at = { m, p };
			if (check_primitive(c, at, &c->d->primitive[mesh->primitive + p]))
				return -1;
		}
	}
	return 0;
}

static int uses(const struct gltf_reader *g, const char *extension)
{
	const json_t *used = json_object_get(g->source.root, "extensionsUsed");

	for (size_t i = 0; i < json_array_size(used); i++)
		if (strcmp(json_string_value(json_array_get(used, i)), extension) == 0)
			return 1;
	return 0;
}

int gltf_check_data(const struct gltf_reader *g, struct err *e)
{
	struct check c = { g, g->source.path, &g->doc, uses(g, "KHR_mesh_quantization"), NULL,
		e };
	int status = -1;

	c.finite = mem_new(g->doc.accessors, 1, "marks of accessors", e);
	if (!c.finite || check_views(&c))
		goto out;
	for (size_t i = 0; i < g->doc.accessors; i++)
		if (check_accessor(&c, i))
			goto out;
	status = check_meshes(&c);
out:
	free(c.finite);
	return status;
}
