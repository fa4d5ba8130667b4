/* The one file that knows tinygltf: checked JSON to plain C arrays. */
#include <cstdlib>
#include <cstring>
#include <exception>
#include <string>
#include <vector>

#include <tiny_gltf.h>

extern "C" {
#include "lib/base/mem.h"
}
#include "formats/gltf/gltf_doc.h"

namespace {

void copy(double *to, const std::vector<double> &from)
{
	for (size_t i = 0; i < from.size(); i++)
		to[i] = from[i];
}

int attribute(const tinygltf::Primitive &p, const char *name)
{
	auto found = p.attributes.find(name);
	return found == p.attributes.end() ? GLTF_NONE : found->second;
}

void set_shape(gltf_accessor *a, int type)
{
	switch (type) {
	case TINYGLTF_TYPE_MAT2:
		a->rows = a->columns = 2;
		break;
	case TINYGLTF_TYPE_MAT3:
		a->rows = a->columns = 3;
		break;
	case TINYGLTF_TYPE_MAT4:
		a->rows = a->columns = 4;
		break;
	default:
		a->rows = tinygltf::GetNumComponentsInType(static_cast<uint32_t>(type));
		a->columns = 1;
	}
}

gltf_accessor accessor_of(const tinygltf::Accessor &from)
{
	gltf_accessor a = {};
	a.at = { from.bufferView, from.byteOffset, from.componentType };
	a.count = from.count;
	a.normalised = from.normalized;
	set_shape(&a, from.type);
	if (from.sparse.isSparse) {
		a.sparse = static_cast<size_t>(from.sparse.count);
		a.index = { from.sparse.indices.bufferView,
			    static_cast<size_t>(from.sparse.indices.byteOffset),
			    from.sparse.indices.componentType };
		a.value = { from.sparse.values.bufferView,
			    static_cast<size_t>(from.sparse.values.byteOffset),
			    from.componentType };
	}
	return a;
}

gltf_node node_of(const tinygltf::Node &from)
{
	gltf_node n = {};
	n.mesh = from.mesh;
	n.camera = from.camera;
	n.has_matrix = !from.matrix.empty();
	n.parent = GLTF_NONE;
	n.rotation[3] = n.scale[0] = n.scale[1] = n.scale[2] = 1;
	copy(n.matrix, from.matrix);
	copy(n.translation, from.translation);
	copy(n.rotation, from.rotation);
	copy(n.scale, from.scale);
	return n;
}

gltf_camera camera_of(const tinygltf::Camera &from)
{
	return { from.type == "orthographic", from.perspective.yfov,
		 from.perspective.aspectRatio, from.orthographic.xmag,
		 from.orthographic.ymag };
}

template <typename T> T *allocate(size_t n, const char *what, err *e)
{
	return static_cast<T *>(mem_new(n, sizeof(T), what, e));
}

int take_buffers(const tinygltf::Model &m, gltf_doc *d, err *e)
{
	d->view = allocate<gltf_view>(m.bufferViews.size(), "bufferViews", e);
	d->accessor = allocate<gltf_accessor>(m.accessors.size(), "accessors", e);
	if (!d->view || !d->accessor)
		return -1;
	for (const auto &v : m.bufferViews)
		d->view[d->views++] = { static_cast<size_t>(v.buffer), v.byteOffset,
					v.byteLength, v.byteStride };
	for (const auto &a : m.accessors)
		d->accessor[d->accessors++] = accessor_of(a);
	return 0;
}

int take_meshes(const tinygltf::Model &m, gltf_doc *d, err *e)
{
	size_t n = 0;

	for (const auto &mesh : m.meshes)
		n += mesh.primitives.size();
	d->mesh = allocate<gltf_mesh>(m.meshes.size(), "meshes", e);
	d->primitive = allocate<gltf_primitive>(n, "primitives", e);
	if (!d->mesh || !d->primitive)
		return -1;
	for (const auto &mesh : m.meshes) {
		d->mesh[d->meshes++] = { d->primitives, mesh.primitives.size() };
		for (const auto &p : mesh.primitives)
			d->primitive[d->primitives++] = {
				p.mode, p.material, p.indices, attribute(p, "POSITION"),
				attribute(p, "NORMAL"), attribute(p, "TEXCOORD_0")
			};
	}
	return 0;
}

int take_nodes(const tinygltf::Model &m, gltf_doc *d, err *e)
{
	size_t n = 0;

	for (const auto &node : m.nodes)
		n += node.children.size();
	d->node = allocate<gltf_node>(m.nodes.size(), "nodes", e);
	d->child = allocate<int>(n, "children of nodes", e);
	d->camera = allocate<gltf_camera>(m.cameras.size(), "cameras", e);
	if (!d->node || !d->child || !d->camera)
		return -1;
	for (const auto &node : m.nodes) {
		gltf_node *to = &d->node[d->nodes++];
		*to = node_of(node);
		to->child = d->children;
		to->children = node.children.size();
		for (int c : node.children)
			d->child[d->children++] = c;
	}
	for (const auto &c : m.cameras)
		d->camera[d->cameras++] = camera_of(c);
	return 0;
}

/* The default scene: `scene`, else the first. */
int take_scene(const tinygltf::Model &m, gltf_doc *d, err *e)
{
	d->scene = GLTF_NONE;
	if (m.scenes.empty())
		return 0;
	d->scene = m.defaultScene < 0 ? 0 : m.defaultScene;
	const auto &nodes = m.scenes[static_cast<size_t>(d->scene)].nodes;
	d->root = allocate<int>(nodes.size(), "scene nodes", e);
	if (!d->root)
		return -1;
	for (int n : nodes)
		d->root[d->roots++] = n;
	return 0;
}

int parse(const char *path, const char *json, size_t bytes, tinygltf::Model *m, err *e)
{
	tinygltf::TinyGLTF reader;
	std::string error, warning;

	if (bytes > UINT32_MAX)
		return err_set(e, "%s: more than 4 GB of JSON; use external buffers", path);
	bool ok = reader.LoadASCIIFromString(m, &error, &warning, json,
	                                     static_cast<unsigned>(bytes), "");
	/* It may succeed with an error, meaning that something was left out. */
	if (!ok || !error.empty())
		return err_set(e, "%s: tinygltf refuses it: %s; correct the file", path,
		               error.c_str());
	return 0;
}

} // namespace

extern "C" int gltf_load(const char *path, const char *json, size_t bytes, gltf_doc *d,
                         err *e)
{
	try {
		tinygltf::Model m;
		if (parse(path, json, bytes, &m, e))
			return -1;
		return take_buffers(m, d, e) || take_meshes(m, d, e) || take_nodes(m, d, e) ||
		       take_scene(m, d, e) ? -1 : 0;
	} catch (const std::exception &x) {
		return err_set(e, "%s: tinygltf fails: %s", path, x.what());
	}
}

/* tinygltf knows few media types, so that any base64 is passed on as the first. */
extern "C" int gltf_load_data_uri(const char *uri, size_t bytes, unsigned char **data,
                                  size_t *got)
{
	static const char base64[] = ";base64,";
	const char *comma = std::strchr(uri, ',');
	const size_t tail = sizeof base64 - 1;

	*got = 0;
	if (std::strncmp(uri, "data:", 5) != 0)
		return 0;
	if (!comma || static_cast<size_t>(comma + 1 - uri) < tail ||
	    std::memcmp(comma + 1 - tail, base64, tail) != 0)
		return -1;
	try {
		std::vector<unsigned char> decoded;
		std::string media;
		if (!tinygltf::DecodeDataURI(&decoded, media,
		                             std::string("data:application/octet-stream;base64,") +
		                             (comma + 1), 0, false))
			return -1;
		*got = decoded.size();
		*data = static_cast<unsigned char *>(std::malloc(decoded.size()));
		if (decoded.size() < bytes || !*data)
			return -1;
		std::memcpy(*data, decoded.data(), decoded.size());
		return 1;
	} catch (const std::exception &) {
		return -1;
	}
}
