/* The JSON of a glTF file against a table of the properties that are read: types,
 * ranges, lengths, references. Everything after it may rely on them. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"

enum kind {
	ROOT, ASSET, BUFFER, VIEW, ACCESSOR, SPARSE, SPARSE_INDICES, SPARSE_VALUES, MESH,
	PRIMITIVE, NODE, SCENE, CAMERA, PERSPECTIVE, ORTHOGRAPHIC, MATERIAL, PBR, TEXTURE,
	MATERIAL_EXTENSIONS, TRANSMISSION, DIFFUSE_TRANSMISSION, IOR, SPECULAR, STRENGTH,
	ROOT_EXTENSIONS, LIGHTS, LIGHT, SPOT, NODE_EXTENSIONS, LIGHT_OF_NODE
};

enum type {
	T_INTEGER, T_NUMBER, T_NUMBERS, T_STRING, T_STRINGS, T_BOOLEAN, T_CHOICE,
	T_INDEX,    /* into the root array `text` */
	T_INDICES,
	T_INDEX_MAP,/* an object whose values are indices */
	T_OBJECT, T_OBJECTS
};

struct rule {
	enum kind in;
	const char *key;
	enum type type;
	int needed;
	const char *text;  /* the choices, or the array that an index is for: of the root, or
	                      "lights" */
	double min, max;
	size_t length;     /* of T_NUMBERS; T_INTEGER is a multiple of it; 0 = any */
	enum kind of;      /* of objects */
};

#define MAX_INTEGER 9007199254740992. /* 2^53, the spec's limit */
#define MAX_INT32 2147483647.
#define RIGHT_ANGLE 1.5707965 /* rounded up: files have float32 numbers */

#define INTEGER(in, key, needed, min, max) { in, key, T_INTEGER, needed, NULL, min, max, 0, ROOT }
#define NUMBER(in, key, needed, min, max) { in, key, T_NUMBER, needed, NULL, min, max, 0, ROOT }
#define NUMBERS(in, key, n, min, max) { in, key, T_NUMBERS, 0, NULL, min, max, n, ROOT }
#define STRING(in, key) { in, key, T_STRING, 0, NULL, 0, 0, 0, ROOT }
#define STRINGS(in, key) { in, key, T_STRINGS, 0, NULL, 0, 0, 0, ROOT }
#define BOOLEAN(in, key) { in, key, T_BOOLEAN, 0, NULL, 0, 0, 0, ROOT }
#define CHOICE(in, key, needed, list) { in, key, T_CHOICE, needed, list, 0, 0, 0, ROOT }
#define INDEX(in, key, needed, array) { in, key, T_INDEX, needed, array, 0, 0, 0, ROOT }
#define INDICES(in, key, array) { in, key, T_INDICES, 0, array, 0, 0, 0, ROOT }
#define INDEX_MAP(in, key, array) { in, key, T_INDEX_MAP, 1, array, 0, 0, 0, ROOT }
#define OBJECT(in, key, needed, of) { in, key, T_OBJECT, needed, NULL, 0, 0, 0, of }
#define OBJECTS(in, key, needed, of) { in, key, T_OBJECTS, needed, NULL, 0, 0, 0, of }

static const struct rule table[] = {
	OBJECT(ROOT, "asset", 1, ASSET),
	STRINGS(ROOT, "extensionsUsed"),
	STRINGS(ROOT, "extensionsRequired"),
	OBJECTS(ROOT, "buffers", 0, BUFFER),
	OBJECTS(ROOT, "bufferViews", 0, VIEW),
	OBJECTS(ROOT, "accessors", 0, ACCESSOR),
	OBJECTS(ROOT, "materials", 0, MATERIAL),
	OBJECTS(ROOT, "meshes", 0, MESH),
	OBJECTS(ROOT, "cameras", 0, CAMERA),
	OBJECTS(ROOT, "nodes", 0, NODE),
	OBJECTS(ROOT, "scenes", 0, SCENE),
	INDEX(ROOT, "scene", 0, "scenes"),
	OBJECT(ROOT, "extensions", 0, ROOT_EXTENSIONS),

	STRING(ASSET, "version"),
	STRING(ASSET, "minVersion"),

	STRING(BUFFER, "uri"),
	INTEGER(BUFFER, "byteLength", 1, 1, MAX_INTEGER),

	INDEX(VIEW, "buffer", 1, "buffers"),
	INTEGER(VIEW, "byteOffset", 0, 0, MAX_INTEGER),
	INTEGER(VIEW, "byteLength", 1, 1, MAX_INTEGER),
	{ VIEW, "byteStride", T_INTEGER, 0, NULL, 4, 252, 4, ROOT },

	INDEX(ACCESSOR, "bufferView", 0, "bufferViews"),
	INTEGER(ACCESSOR, "byteOffset", 0, 0, MAX_INTEGER),
	INTEGER(ACCESSOR, "componentType", 1, GLTF_I8, GLTF_F32),
	BOOLEAN(ACCESSOR, "normalized"),
	INTEGER(ACCESSOR, "count", 1, 1, MAX_INTEGER),
	CHOICE(ACCESSOR, "type", 1, "SCALAR VEC2 VEC3 VEC4 MAT2 MAT3 MAT4"),
	OBJECT(ACCESSOR, "sparse", 0, SPARSE),
	INTEGER(SPARSE, "count", 1, 1, MAX_INT32),
	OBJECT(SPARSE, "indices", 1, SPARSE_INDICES),
	OBJECT(SPARSE, "values", 1, SPARSE_VALUES),
	INDEX(SPARSE_INDICES, "bufferView", 1, "bufferViews"),
	INTEGER(SPARSE_INDICES, "byteOffset", 0, 0, MAX_INT32),
	INTEGER(SPARSE_INDICES, "componentType", 1, GLTF_U8, GLTF_U32),
	INDEX(SPARSE_VALUES, "bufferView", 1, "bufferViews"),
	INTEGER(SPARSE_VALUES, "byteOffset", 0, 0, MAX_INT32),

	STRING(MESH, "name"),
	OBJECTS(MESH, "primitives", 1, PRIMITIVE),
	INDEX_MAP(PRIMITIVE, "attributes", "accessors"),
	INDEX(PRIMITIVE, "indices", 0, "accessors"),
	INDEX(PRIMITIVE, "material", 0, "materials"),
	INTEGER(PRIMITIVE, "mode", 0, GLTF_POINTS, GLTF_FAN),

	STRING(CAMERA, "name"),
	CHOICE(CAMERA, "type", 1, "perspective orthographic"),
	OBJECT(CAMERA, "perspective", 0, PERSPECTIVE),
	OBJECT(CAMERA, "orthographic", 0, ORTHOGRAPHIC),
	NUMBER(PERSPECTIVE, "yfov", 1, 0, INFINITY),
	NUMBER(PERSPECTIVE, "znear", 1, 0, INFINITY),
	NUMBER(PERSPECTIVE, "zfar", 0, 0, INFINITY),
	NUMBER(PERSPECTIVE, "aspectRatio", 0, 0, INFINITY),
	NUMBER(ORTHOGRAPHIC, "xmag", 1, 0, INFINITY),
	NUMBER(ORTHOGRAPHIC, "ymag", 1, 0, INFINITY),
	NUMBER(ORTHOGRAPHIC, "znear", 1, 0, INFINITY),
	NUMBER(ORTHOGRAPHIC, "zfar", 1, 0, INFINITY),

	STRING(NODE, "name"),
	INDEX(NODE, "mesh", 0, "meshes"),
	INDEX(NODE, "camera", 0, "cameras"),
	INDEX(NODE, "skin", 0, "skins"),
	INDICES(NODE, "children", "nodes"),
	NUMBERS(NODE, "matrix", 16, -INFINITY, INFINITY),
	NUMBERS(NODE, "translation", 3, -INFINITY, INFINITY),
	NUMBERS(NODE, "rotation", 4, -INFINITY, INFINITY),
	NUMBERS(NODE, "scale", 3, -INFINITY, INFINITY),
	OBJECT(NODE, "extensions", 0, NODE_EXTENSIONS),

	STRING(SCENE, "name"),
	INDICES(SCENE, "nodes", "nodes"),

	STRING(MATERIAL, "name"),
	OBJECT(MATERIAL, "pbrMetallicRoughness", 0, PBR),
	OBJECT(MATERIAL, "normalTexture", 0, TEXTURE),
	OBJECT(MATERIAL, "occlusionTexture", 0, TEXTURE),
	OBJECT(MATERIAL, "emissiveTexture", 0, TEXTURE),
	NUMBERS(MATERIAL, "emissiveFactor", 3, 0, INFINITY),
	CHOICE(MATERIAL, "alphaMode", 0, "OPAQUE MASK BLEND"),
	NUMBER(MATERIAL, "alphaCutoff", 0, 0, INFINITY),
	BOOLEAN(MATERIAL, "doubleSided"),
	OBJECT(MATERIAL, "extensions", 0, MATERIAL_EXTENSIONS),
	NUMBERS(PBR, "baseColorFactor", 4, -INFINITY, INFINITY),
	NUMBER(PBR, "metallicFactor", 0, -INFINITY, INFINITY),
	NUMBER(PBR, "roughnessFactor", 0, -INFINITY, INFINITY),
	OBJECT(PBR, "baseColorTexture", 0, TEXTURE),
	OBJECT(PBR, "metallicRoughnessTexture", 0, TEXTURE),
	INDEX(TEXTURE, "index", 1, "textures"),

	OBJECT(MATERIAL_EXTENSIONS, "KHR_materials_transmission", 0, TRANSMISSION),
	OBJECT(MATERIAL_EXTENSIONS, "KHR_materials_diffuse_transmission", 0,
	       DIFFUSE_TRANSMISSION),
	OBJECT(MATERIAL_EXTENSIONS, "KHR_materials_ior", 0, IOR),
	OBJECT(MATERIAL_EXTENSIONS, "KHR_materials_specular", 0, SPECULAR),
	OBJECT(MATERIAL_EXTENSIONS, "KHR_materials_emissive_strength", 0, STRENGTH),
	NUMBER(TRANSMISSION, "transmissionFactor", 0, -INFINITY, INFINITY),
	OBJECT(TRANSMISSION, "transmissionTexture", 0, TEXTURE),
	NUMBER(DIFFUSE_TRANSMISSION, "diffuseTransmissionFactor", 0, -INFINITY, INFINITY),
	NUMBERS(DIFFUSE_TRANSMISSION, "diffuseTransmissionColorFactor", 3, -INFINITY,
	        INFINITY),
	OBJECT(DIFFUSE_TRANSMISSION, "diffuseTransmissionTexture", 0, TEXTURE),
	OBJECT(DIFFUSE_TRANSMISSION, "diffuseTransmissionColorTexture", 0, TEXTURE),
	NUMBER(IOR, "ior", 0, 0, INFINITY),
	NUMBER(SPECULAR, "specularFactor", 0, -INFINITY, INFINITY),
	NUMBERS(SPECULAR, "specularColorFactor", 3, 0, INFINITY),
	OBJECT(SPECULAR, "specularTexture", 0, TEXTURE),
	OBJECT(SPECULAR, "specularColorTexture", 0, TEXTURE),
	NUMBER(STRENGTH, "emissiveStrength", 0, 0, INFINITY),

	OBJECT(ROOT_EXTENSIONS, GLTF_LIGHTS, 0, LIGHTS),
	OBJECTS(LIGHTS, "lights", 1, LIGHT),
	STRING(LIGHT, "name"),
	CHOICE(LIGHT, "type", 1, "point spot directional"),
	NUMBERS(LIGHT, "color", 3, 0, INFINITY),
	NUMBER(LIGHT, "intensity", 0, 0, INFINITY),
	NUMBER(LIGHT, "range", 0, 0, INFINITY),
	OBJECT(LIGHT, "spot", 0, SPOT),
	NUMBER(SPOT, "innerConeAngle", 0, 0, RIGHT_ANGLE),
	NUMBER(SPOT, "outerConeAngle", 0, 0, RIGHT_ANGLE),
	OBJECT(NODE_EXTENSIONS, GLTF_LIGHTS, 0, LIGHT_OF_NODE),
	INDEX(LIGHT_OF_NODE, "light", 1, "lights"),
};

enum { RULES = sizeof table / sizeof *table };

/* Bytes of a place's text in a message; a longer one is cut. */
enum { PLACE = 256 };

/* Where in the file: a chain up to the root, spelt out only for an error. */
struct place {
	const struct place *up;
	const char *key;   /* NULL: element `index` of an array */
	size_t index;
};

struct check {
	const char *path;
	const json_t *root;
	struct err *e;
};

static int check_object(const struct check *c, const struct place *at, const json_t *o,
                        enum kind kind);

static size_t spell(const struct place *at, char text[PLACE])
{
	size_t n = at->up ? spell(at->up, text) : 0;
	int more;

	if (at->key)
		more = snprintf(text + n, PLACE - n, "%s%s", n ? "." : "", at->key);
	else
		more = snprintf(text + n, PLACE - n, "[%zu]", at->index);
	n += more > 0 ? (size_t)more : 0;
	return n < PLACE ? n : PLACE - 1;
}

static int refuse(const struct check *c, const struct place *at, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

static int refuse(const struct check *c, const struct place *at, const char *format, ...)
{
	char place[PLACE], text[PLACE];
	va_list ap;

	spell(at, place);
	va_start(ap, format);
	vsnprintf(text, sizeof text, format, ap);
	va_end(ap);
	return err_set(c->e, "%s: %s: %s; correct the file", c->path, place, text);
}

static int check_range(const struct check *c, const struct place *at, double x,
                       const struct rule *r)
{
	if (x < r->min)
		return refuse(c, at, "%.15g is below %.15g", x, r->min);
	if (x > r->max)
		return refuse(c, at, "%.15g is above %.15g", x, r->max);
	return 0;
}

static int check_integer(const struct check *c, const struct place *at, const json_t *v,
                         const struct rule *r)
{
	if (!json_is_integer(v))
		return refuse(c, at, "must be an integer");
	if (r->length && json_integer_value(v) % (json_int_t)r->length)
		return refuse(c, at, "%" JSON_INTEGER_FORMAT " is no multiple of %zu",
		              json_integer_value(v), r->length);
	return check_range(c, at, json_number_value(v), r);
}

static int check_number(const struct check *c, const struct place *at, const json_t *v,
                        const struct rule *r)
{
	if (!json_is_number(v))
		return refuse(c, at, "must be a number");
	return check_range(c, at, json_number_value(v), r);
}

static int check_string(const struct check *c, const struct place *at, const json_t *v,
                        const struct rule *r)
{
	(void)r;
	return json_is_string(v) ? 0 : refuse(c, at, "must be a string");
}

static int check_index(const struct check *c, const struct place *at, const json_t *v,
                       const struct rule *r)
{
	size_t n = json_array_size(strcmp(r->text, "lights") == 0
	                           ? gltf_lights_json(c->root) : json_object_get(c->root, r->text));

	if (!json_is_integer(v))
		return refuse(c, at, "must be an integer");
	json_int_t i = json_integer_value(v);
	if (i < 0 || (size_t)i >= n || i > (json_int_t)MAX_INT32)
		return refuse(c, at, "index %" JSON_INTEGER_FORMAT
		              " is out of range, the file has %zu %s", i, n, r->text);
	return 0;
}

static int check_choice(const struct check *c, const struct place *at, const json_t *v,
                        const struct rule *r)
{
	const char *s = json_string_value(v);
	size_t n = s ? strlen(s) : 0;

	for (const char *p = r->text; n && (p = strstr(p, s)); p += n)
		if ((p == r->text || p[-1] == ' ') && (p[n] == ' ' || !p[n]))
			return 0;
	return refuse(c, at, "must be one of %s", r->text);
}

static int check_element(const struct check *c, const struct place *at, const json_t *v,
                         const struct rule *r)
{
	return check_object(c, at, v, r->of);
}

typedef int check_fn(const struct check *, const struct place *, const json_t *,
                     const struct rule *);

static int check_array(const struct check *c, const struct place *at, const json_t *v,
                       const struct rule *r, check_fn *element, const char *of)
{
	if (!json_is_array(v))
		return refuse(c, at, "must be an array of %s", of);
	for (size_t i = 0; i < json_array_size(v); i++) {
		struct place inner = { at, NULL, i };
		if (element(c, &inner, json_array_get(v, i), r))
			return -1;
	}
	return 0;
}

static int check_numbers(const struct check *c, const struct place *at, const json_t *v,
                         const struct rule *r)
{
	if (json_is_array(v) && r->length && json_array_size(v) != r->length)
		return refuse(c, at, "has %zu numbers, must have %zu", json_array_size(v),
		              r->length);
	return check_array(c, at, v, r, check_number, "numbers");
}

static int check_index_map(const struct check *c, const struct place *at, json_t *v,
                           const struct rule *r)
{
	const char *key;
	json_t *value;

	if (!json_is_object(v))
		return refuse(c, at, "must be an object of indices");
	json_object_foreach(v, key, value) {
		struct place inner = { at, key, 0 };
		if (check_index(c, &inner, value, r))
			return -1;
	}
	return 0;
}

static int check_value(const struct check *c, const struct place *at, json_t *v,
                       const struct rule *r)
{
	switch (r->type) {
	case T_INTEGER:
		return check_integer(c, at, v, r);
	case T_NUMBER:
		return check_number(c, at, v, r);
	case T_NUMBERS:
		return check_numbers(c, at, v, r);
	case T_STRING:
		return check_string(c, at, v, r);
	case T_STRINGS:
		return check_array(c, at, v, r, check_string, "strings");
	case T_BOOLEAN:
		return json_is_boolean(v) ? 0 : refuse(c, at, "must be true or false");
	case T_CHOICE:
		return check_choice(c, at, v, r);
	case T_INDEX:
		return check_index(c, at, v, r);
	case T_INDICES:
		return check_array(c, at, v, r, check_index, "indices");
	case T_INDEX_MAP:
		return check_index_map(c, at, v, r);
	case T_OBJECT:
		return check_object(c, at, v, r->of);
	case T_OBJECTS:
		return check_array(c, at, v, r, check_element, "objects");
	}
	return 0;
}

static int check_object(const struct check *c, const struct place *at, const json_t *o,
                        enum kind kind)
{
	if (!json_is_object(o))
		return refuse(c, at, "must be an object");
	for (size_t i = 0; i < RULES; i++) {
		const struct rule *r = &table[i];
		if (r->in != kind)
			continue;
		struct place inner = { at, r->key, 0 };
		json_t *v = json_object_get(o, r->key);
		if (v && check_value(c, &inner, v, r))
			return -1;
		if (!v && r->needed)
			return refuse(c, &inner, "is missing");
	}
	return 0;
}

/* Before all else, as glTF 1.0 has objects where 2.0 has arrays. */
static int check_version(const struct check *c)
{
	const json_t *asset = json_object_get(c->root, "asset");
	const char *version = gltf_string(asset, "version");
	const char *least = gltf_string(asset, "minVersion");

	if (!asset)
		return err_set(c->e, "%s: asset: is missing, so this is not glTF 2.0; give a "
		               ".gltf or .glb file", c->path);
	if (!version)
		return err_set(c->e, "%s: asset.version: is missing; say \"2.0\"", c->path);
	if (strncmp(version, "2.", 2) != 0)
		return err_set(c->e, "%s: asset.version: glTF %.20s is not read; convert it to "
		               "2.0", c->path, version);
	if (least && strcmp(least, "2.0") != 0)
		return err_set(c->e, "%s: asset.minVersion: glTF %.20s is not read; export it "
		               "for 2.0", c->path, least);
	return 0;
}

int gltf_schema_knows(const char *extension)
{
	if (strcmp(extension, "KHR_mesh_quantization") == 0 || strcmp(extension, GLTF_LIGHTS) == 0)
		return 1;
	for (size_t i = 0; i < RULES; i++)
		if (table[i].in == MATERIAL_EXTENSIONS && strcmp(table[i].key, extension) == 0)
			return 1;
	return 0;
}

static int check_required(const struct check *c)
{
	const json_t *list = json_object_get(c->root, "extensionsRequired");

	for (size_t i = 0; i < json_array_size(list); i++) {
		const char *name = json_string_value(json_array_get(list, i));
		if (!gltf_schema_knows(name))
			return err_set(c->e, "%s: extensionsRequired: %.100s is not supported; "
			               "export it without", c->path, name);
	}
	return 0;
}

int gltf_schema_check(const char *path, const json_t *root, struct err *e)
{
	struct check c = { path, root, e };

	if (!json_is_object(root))
		return err_set(e, "%s: is not glTF, its JSON is no object; give a .gltf or .glb "
		               "file", path);
	if (check_version(&c) || check_object(&c, NULL, root, ROOT))
		return -1;
	return check_required(&c);
}
