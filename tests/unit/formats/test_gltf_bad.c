/* glTF files that are bad: each is refused with its own message, and nothing crashes. */
#include "tests/unit/fixtures/gltf_files.h"

struct bad {
	const char *from, *to; /* edit of base */
	const char *message;   /* part of what must be said */
};

static void refused(const char *name, const char *message)
{
	struct gltf_options o = GLTF_OPTIONS_DEFAULT;
	struct model m = { 0 };
	struct gltf_report r = { 0 };
	struct err e = { 0 };

	if (!gltf_file_read(in_scratch(name), &o, &m, &r, &e))
		fail_msg("accepted, but should say: %s", message);
	if (!strstr(e.text, message) || strchr(e.text, '\n'))
		fail_msg("says: %s\n\tbut should say: %s", e.text, message);
	if (strncmp(e.text, in_scratch(name), strlen(in_scratch(name))) != 0)
		fail_msg("does not begin with the file: %s", e.text);
	assert_null(m.vertex);
	assert_null(m.material.name);
	gltf_report_free(&r);
}

static void refuse_all(const struct bad *bad, size_t n)
{
	char text[TEXT];

	for (size_t i = 0; i < n; i++) {
		base_with(text, bad[i].from, bad[i].to, NULL);
		put("s.gltf", text, strlen(text));
		refused("s.gltf", bad[i].message);
	}
}

#define REFUSE(list) refuse_all(list, sizeof list / sizeof *list)

static void test_not_gltf(void **state)
{
	static const struct {
		const char *text, *message;
	} files[] = {
		{ "", "is empty; give a .gltf or .glb file" },
		{ "solid cube\n", "is not glTF, neither JSON nor GLB" },
		{ "[1]", "is not glTF, neither JSON nor GLB" },
		{ "{", "not valid JSON" },
		{ "{\"a\":1,\"a\":2}", "duplicate" },
		{ "{\"a\":NaN}", "line 1, column" },
		{ "{\"a\":1e400}", "real number overflow" },
		{ "{\"a\":\"\xff\"}", "not valid JSON" },
		{ "{}", "asset: is missing" },
		{ "{\"asset\":{}}", "asset.version: is missing" },
		{ "{\"asset\":{\"version\":2}}", "asset.version: is missing" },
		{ "{\"asset\":{\"version\":\"1.0\"},\"nodes\":{}}", "glTF 1.0 is not read" },
		{ "{\"asset\":{\"version\":\"2.1\",\"minVersion\":\"2.1\"}}", "minVersion: glTF 2.1" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
		given("i %zu", i);
		put("s.gltf", files[i].text, strlen(files[i].text));
		refused("s.gltf", files[i].message);
	}
	refused("nothing.gltf", "No such file");
}

static void test_deep_nesting(void **state)
{
	enum { DEEP = 200000 };
	static char text[DEEP + 10];

	(void)state;
	memset(text, '[', sizeof text);
	memcpy(text, "{\"a\":", 5);
	put("s.gltf", text, sizeof text);
	refused("s.gltf", "JSON is nested too deeply");
}

static void test_types(void **state)
{
	static const struct bad list[] = {
		{ "'nodes':[{", "'nodes':[7,{", "nodes[0]: must be an object" },
		{ "'scene':0", "'scene':1", "scene: index 1 is out of range, the file has 1 scenes" },
		{ "'scene':0", "'scene':-1", "scene: index -1 is out of range" },
		{ "'nodes':[0,1]", "'nodes':[0,2]", "scenes[0].nodes[1]: index 2 is out of range" },
		{ "'nodes':[0,1]", "'nodes':[0,0]", "scenes[0]: lists nodes[0] twice" },
		{ "'mesh':0", "'mesh':0.5", "nodes[0].mesh: must be an integer" },
		{ "'mesh':0", "'mesh':3", "nodes[0].mesh: index 3 is out of range" },
		{ "'mesh':0", "'mesh':99999999999", "nodes[0].mesh: index 99999999999 is out of" },
		{ "'camera':0", "'camera':'x'", "nodes[1].camera: must be an integer" },
		{ "'mesh':0", "'children':[-1]", "nodes[0].children[0]: index -1 is out of range" },
		{ "'mesh':0", "'children':[9]", "nodes[0].children[0]: index 9 is out of range" },
		{ "'mesh':0", "'matrix':[1,2,3]", "nodes[0].matrix: has 3 numbers, must have 16" },
		{ "'mesh':0", "'scale':[1,1,'1']", "nodes[0].scale[2]: must be a number" },
		{ "'mesh':0", "'skin':0", "nodes[0].skin: index 0 is out of range" },
		{ "'primitives'", "'primitive'", "meshes[0].primitives: is missing" },
		{ "{'POSITION':0}", "[0]", "primitives[0].attributes: must be an object of indices" },
		{ "'POSITION':0", "'POSITION':17", "attributes.POSITION: index 17 is out of range" },
		{ "'indices':1", "'indices':6", "primitives[0].indices: index 6 is out of range" },
		{ "'material':0", "'material':1", "primitives[0].material: index 1 is out of range" },
		{ "'indices':1", "'mode':7", "primitives[0].mode: 7 is above 6" },
		{ "'count':4", "'count':0", "accessors[0].count: 0 is below 1" },
		{ "'count':4,", "", "accessors[0].count: is missing" },
		{ "5126", "5124", "accessors[0]: componentType 5124 is unknown" },
		{ "5126", "5130", "accessors[0].componentType: 5130 is above 5126" },
		{ "'VEC3'", "'VEC5'", "accessors[0].type: must be one of SCALAR VEC2" },
		{ "'VEC3'", "'EC3 '", "accessors[0].type: must be one of SCALAR VEC2" },
		{ "'bufferView':0", "'bufferView':7", "accessors[0].bufferView: index 7 is out of" },
		{ "'buffer':0", "'buffer':1", "bufferViews[0].buffer: index 1 is out of range" },
		{ "'byteStride':4", "'byteStride':6", "bufferViews[6].byteStride: 6 is no multiple" },
		{ "'byteStride':4", "'byteStride':256", "bufferViews[6].byteStride: 256 is above" },
		{ "'byteLength':176", "'byteLength':-1", "buffers[0].byteLength: -1 is below 1" },
		{ "'b.bin'", "7", "buffers[0].uri: must be a string" },
		{ "'asset'", "'extensionsUsed':[1],'asset'", "extensionsUsed[0]: must be a string" },
		{ "'asset'", "'extensionsRequired':['KHR_draco_mesh_compression'],'asset'",
		  "extensionsRequired: KHR_draco_mesh_compression is not supported" },
		{ "'yfov':1,", "", "cameras[0].perspective.yfov: is missing" },
		{ "'yfov':1", "'yfov':0", "cameras[0].perspective.yfov: 0 is not between 0 and pi" },
		{ "'yfov':1", "'yfov':3.2", "cameras[0].perspective.yfov: 3.2 is not between" },
		{ "'znear':0.1", "'znear':0", "cameras[0].perspective.znear: must be above 0" },
		{ "'znear':0.1", "'znear':1,'zfar':1", "zfar: must be above znear" },
		{ "'yfov':1", "'yfov':1,'aspectRatio':0", "aspectRatio: must be above 0" },
		{ "'type':'perspective',", "'type':'fisheye',", "must be one of perspective ortho" },
		{ "'type':'perspective',", "'type':'orthographic',", "cameras[0].orthographic: is mis" },
	};

	(void)state;
	REFUSE(list);
}

static void test_layout(void **state)
{
	static const struct bad list[] = {
		{ "'b.bin'", "'none.bin'", "buffers[0]: none.bin: No such file" },
		{ "'b.bin'", "'../b.bin'", "'../b.bin' leaves the directory" },
		{ "'b.bin'", "'x/%2e%2E/b.bin'", "leaves the directory" },
		{ "'b.bin'", "'/etc/passwd'", "leaves the directory" },
		{ "'b.bin'", "'b.bin%00'", "leaves the directory" },
		{ "'b.bin'", "''", "leaves the directory" },
		{ "'b.bin'", "'http://x/b.bin'", "only relative and data: URIs are read" },
		{ "'b.bin'", "'.'", "is not a regular file" },
		{ ",'uri':'b.bin'", "", "buffers[0]: has no uri and the file no BIN chunk" },
		{ "'b.bin'", "'data:,abc'", "its data: URI is not base64" },
		{ "'b.bin'", "'data:;base64,AAAA'", "has 3 bytes, byteLength says 176" },
		{ "'b.bin'", "'data:;base64,'", "its data: URI is not base64" },
		{ "'byteLength':176", "'byteLength':177", "has 176 bytes, byteLength says 177" },
		{ "'byteLength':16,'byteS", "'byteLength':37,'byteS",
		  "bufferViews[6]: bytes 140 to 177 are outside buffers[0] of 176 bytes" },
		{ "'byteOffset':0", "'byteOffset':9007199254740992", "bufferViews[0]: bytes" },
		{ "'count':4", "'count':5", "accessors[0]: 5 elements do not fit into bufferViews[0]" },
		{ "'count':4", "'count':9007199254740992", "elements do not fit" },
		{ "'bufferView':0", "'bufferView':0,'byteOffset':4", "4 elements do not fit" },
		{ "'bufferView':0", "'bufferView':0,'byteOffset':2", "accessors[0]: its byte offset is" },
		{ "'bufferView':0,", "'normalized':true,'bufferView':0,", "can be normalized" },
		{ "5120,'count':4,'type':'VEC3'", "5122,'count':2,'type':'VEC3'",
		  "accessors[5]: byteStride 4 does not suit elements of 6 bytes" },
		{ "'bufferView':0,'componentType':5126,'count':4", "'componentType':5126,'count':99999999",
		  "accessors[0]: 99999999 elements without a bufferView" },
		{ "'sparse':{'count':1", "'sparse':{'count':5", "accessors[4].sparse: replaces 5 of 4" },
		{ "'sparse':{'count':1", "'sparse':{'count':2", "accessors[4].sparse.indices: 2 elem" },
		{ "{'bufferView':4,'componentType':5123}", "{'bufferView':4,'componentType':5122}",
		  "accessors[4].sparse.indices: componentType 5122 is no unsigned" },
		{ "{'bufferView':4,'componentType':5123}", "{'bufferView':3,'byteOffset':4,"
		  "'componentType':5123}", "accessors[4].sparse.indices: index 65535 is out of range" },
		{ "'values':{'bufferView':5}", "'value':{}", "accessors[4].sparse.values: is missing" },
		{ "'POSITION':0", "'NORMAL':0", "meshes[0].primitives[0]: has no POSITION" },
		{ "'POSITION':0", "'POSITION':3", "POSITION in accessors[3] must be VEC3 of floats" },
		{ "'POSITION':0", "'POSITION':5", "KHR_mesh_quantization" },
		{ "'POSITION':0}", "'POSITION':0,'TEXCOORD_0':2}", "TEXCOORD_0 in accessors[2] must" },
		{ "'POSITION':0}", "'POSITION':0,'NORMAL':5}", "NORMAL in accessors[5] must be VEC3" },
		{ "'indices':1", "'indices':0", "indices in accessors[0] must be SCALAR unsigned" },
		{ "'count':6", "'count':5", "5 corners are no whole number of triangles" },
		{ "'indices':1,", "", "4 corners are no whole number of triangles" },
		{ "'byteOffset':48", "'byteOffset':108", "index 65535 at position 2 of accessors[1]" },
		{ "'byteOffset':48,'byteLength':12", "'byteOffset':48,'byteLength':24,'byteStride':4",
		  "indices in accessors[1] cannot have a byteStride" },
	};

	(void)state;
	REFUSE(list);
}

static void test_nodes(void **state)
{
	static const struct bad list[] = {
		{ "'mesh':0", "'children':[0]", "nodes[0]: is on or below a cycle" },
		{ "'mesh':0},{", "'children':[1]},{'children':[0],", "is on or below a cycle" },
		{ "'mesh':0},{", "'children':[1]},{", "scenes[0]: nodes[1] is no root" },
		{ "'mesh':0},", "'children':[2]},{'children':[2]},", "nodes[2]: has two parents" },
		{ "'mesh':0", "'children':[1,1]", "nodes[1]: has two parents" },
		{ "'mesh':0", "'scale':[1,0,1]", "nodes[0]: its matrix is singular" },
		{ "'mesh':0", "'matrix':[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,1]", "matrix is singular" },
		{ "'mesh':0", "'matrix':[1,0,0,0,0,1,0,0,0,0,1,1,0,0,0,1]", "is not affine" },
		{ "'mesh':0", "'rotation':[0,0,0,0]", "nodes[0].rotation: is no unit quaternion" },
		{ "'mesh':0", "'scale':[1,1,1],'matrix':[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]",
		  "nodes[0]: has both matrix and translation" },
		{ "'mesh':0", "'mesh':0,'scale':[1e200,1e200,1e200]", "is singular" },
		{ "'mesh':0", "'mesh':0,'translation':[1e308,0,0],'children':[2]},"
		  "{'camera':0},{'translation':[1e308,0,0]", "world matrix is not finite" },
	};

	(void)state;
	REFUSE(list);
}

static void test_vertices(void **state)
{
	static const unsigned char nan[] = { 0, 0, 0xc0, 0x7f }, inf[] = { 0, 0, 0x80, 0xff };
	unsigned char b[BUFFER];
	char text[TEXT];

	(void)state;
	base_with(text, "'POSITION':0}", "'POSITION':0,'NORMAL':2}", NULL);
	put("s.gltf", text, strlen(text));
	fill_buffer(b);
	memcpy(b + 28, nan, 4);
	put("b.bin", b, sizeof b);
	refused("s.gltf", "accessors[0]: POSITION 2 is not finite");
	fill_buffer(b);
	memcpy(b + 60 + 12, inf, 4);
	put("b.bin", b, sizeof b);
	refused("s.gltf", "accessors[2]: NORMAL 1 is not finite");
	put("b.bin", b, 100);
	refused("s.gltf", "b.bin: has 100 bytes, byteLength says 176");
	fill_buffer(b);
	put("b.bin", b, sizeof b);
}

#define PAINT "{'name':'paint','pbrMetallicRoughness':{'metallicFactor':0}}"
#define EXTRAS(text) PAINT, "{'name':'paint','extras':{'twopass':" text "}}"
#define BANDS33 "[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]"

static void test_materials(void **state)
{
	static const struct bad list[] = {
		{ EXTRAS("7"), "material paint: extras.twopass: must be an object" },
		{ EXTRAS("{'back':1}"), "material paint: extras.twopass.back: must be an object" },
		{ EXTRAS("{'rho':0.5}"), "unknown key 'rho'; a typo? allowed are rho_d, tau_d, rho_s" },
		{ EXTRAS("{'back':{'emission_back':1}}"), "extras.twopass.back: unknown key" },
		{ EXTRAS("{'rho_d':-0.1}"), "material paint: extras.twopass.rho_d: -0.1 must not" },
		{ EXTRAS("{'rho_d':'x'}"), "rho_d: must be a number or an array of numbers" },
		{ EXTRAS("{'rho_d':[0.1,0.2,'x']}"), "rho_d: must be a number or an array" },
		{ EXTRAS("{'rho_d':[0,0,0],'rho_s':[0,0]}"), "rho_s: has 2 numbers; give 1 or 3" },
		{ EXTRAS("{'rho_d':[]}"), "rho_d: has 0 numbers; give 1 or 3" },
		{ EXTRAS("{'rho_d':" BANDS33 "}"), "with 33 bands; at most 32" },
		{ EXTRAS("{'rho_s':1,'alpha':'infinite'}"), "alpha: must be a number or \"inf\"" },
		{ EXTRAS("{'rho_s':1,'alpha':-2}"), "alpha: -2 must not be negative" },
		{ EXTRAS("{'emission_front':1,'emission_exponent':'inf'}"), "must be finite" },
		{ EXTRAS("{'emission_front':-1}"), "emission_front: -1 must not be negative" },
		{ EXTRAS("{'rho_d':0.7,'tau_d':0.5}"), "material paint: front side, band 0: rho_d + "
		  "tau_d + rho_s + tau_s = 1.2 exceeds 1" },
		{ EXTRAS("{'rho_d':[0,0,1.00001]}"), "front side, band 2" },
		{ EXTRAS("{'rho_d':0.7,'back':{'rho_s':0.5}}"), "material paint: back side, band 0" },
		{ PAINT, "{'emissiveFactor':[0,0,-1]}", "materials[0].emissiveFactor[2]: -1 is below 0" },
		{ PAINT, "{'emissiveFactor':[1e300,0,0],'extensions':"
		  "{'KHR_materials_emissive_strength':{'emissiveStrength':1e300}}}", "not finite" },
		{ PAINT, "{'extensions':{'KHR_materials_ior':{'ior':0.5}}}", "ior: 0.5 is neither" },
		{ PAINT, "{'extensions':{'KHR_materials_ior':7}}", "KHR_materials_ior: must be an obj" },
		{ PAINT, "{'alphaMode':'blend'}", "materials[0].alphaMode: must be one of OPAQUE" },
		{ PAINT, "{'pbrMetallicRoughness':{'roughnessFactor':'0.5'}}", "must be a number" },
		{ PAINT, "{'pbrMetallicRoughness':{'baseColorFactor':[1,1,1]}}", "must have 4" },
		{ PAINT, "{'pbrMetallicRoughness':{'baseColorTexture':{'index':0}}}",
		  "baseColorTexture.index: index 0 is out of range, the file has 0 textures" },
		{ PAINT, "{'name':'paint','emissiveFactor':[1,0,0],'extras':{'twopass':{'rho_d':[0,0]}}}",
		  "material paint: its emission is an RGB colour" },
	};

	(void)state;
	REFUSE(list);
}

static void test_glb(void **state)
{
	unsigned char glb[TEXT], bad[TEXT];
	char text[TEXT];

	(void)state;
	base_with(text, ",'uri':'b.bin'", "", NULL);
	size_t n = make_glb(text, glb), bin = n - BUFFER - 8;
	const struct {
		size_t at;
		uint32_t value;
		const char *message;
	} words[] = {
		{ 4, 1, "GLB: version 1 is not read" },
		{ 8, (uint32_t)n + 4, "GLB: truncated, its header says" },
		{ 8, (uint32_t)n - 4, "GLB: 4 bytes follow" },
		{ 12, 0xfffffff0, "GLB: chunk 0: says 4294967280 bytes" },
		{ 16, 0x004e4942, "GLB: the first chunk is not JSON" },
		{ bin, BUFFER + 4, "GLB: chunk 1: says 180 bytes, 176 are left" },
		{ bin, BUFFER - 2, "GLB: chunk 1: its length 174 is no multiple of 4" },
		{ bin + 4, 0x12345678, "buffers[0]: has no uri and the file no BIN chunk" },
	};
	for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
		given("i %zu", i);
		memcpy(bad, glb, n);
		memcpy(bad + words[i].at, &words[i].value, 4);
		put("s.glb", bad, n);
		refused("s.glb", words[i].message);
	}
	for (size_t k = 4; k < n; k += k < 32 || k > n - 200 ? 1 : 37) {
		given("k %zu", k);
		put("s.glb", glb, k);
		refused("s.glb", "GLB: truncated");
	}
}

/* Any change of any bytes: read or refused, without a crash. */
static void mutate(const char *name, const unsigned char *good, size_t n, unsigned seed)
{
	static const char alphabet[] = "0123456789-.,:[]{}\"eE tfn";
	unsigned char bad[TEXT];
	struct gltf_options o = GLTF_OPTIONS_DEFAULT;

	for (int round = 0; round < 1500; round++) {
		memcpy(bad, good, n);
		size_t length = n;
		for (int k = 0; k <= round % 4; k++) {
			seed = seed * 1664525 + 1013904223;
			size_t at = (seed >> 8) % n;
			seed = seed * 1664525 + 1013904223;
			if (round % 3 == 0)
				bad[at] ^= (unsigned char)(1u << (seed >> 24) % 8);
			else if (round % 3 == 1)
				bad[at] = (unsigned char)alphabet[(seed >> 16) % (sizeof alphabet - 1)];
			else
				bad[at] = (unsigned char)(seed >> 24);
		}
		if (round % 50 == 49)
			length = (seed >> 8) % n;
		put(name, bad, length);
		struct model m = { 0 };
		struct gltf_report r = { 0 };
		struct err e = { 0 };
		if (gltf_file_read(in_scratch(name), &o, &m, &r, &e))
			assert_null(strchr(e.text, '\n'));
		model_free(&m);
		gltf_report_free(&r);
	}
}

static void test_mutations(void **state)
{
	unsigned char glb[TEXT];
	char text[TEXT];

	(void)state;
	base_with(text, "'POSITION':0}", "'POSITION':4,'NORMAL':2,'TEXCOORD_0':3}", PAINT,
	          "{'extras':{'twopass':{'rho_d':[0.1,0.2,0.3],'back':{'alpha':3}}}}", NULL);
	mutate("s.gltf", (const unsigned char *)text, strlen(text), 1);
	base_with(text, "'POSITION':0}", "'POSITION':4,'NORMAL':2,'TEXCOORD_0':3}",
	          ",'uri':'b.bin'", "", NULL);
	mutate("s.glb", glb, make_glb(text, glb), 2);
}

int main(void)
{
	static const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_not_gltf),
		cmocka_unit_test(test_deep_nesting),
		cmocka_unit_test(test_types),
		cmocka_unit_test(test_layout),
		cmocka_unit_test(test_nodes),
		cmocka_unit_test(test_vertices),
		cmocka_unit_test(test_materials),
		cmocka_unit_test(test_glb),
		cmocka_unit_test(test_mutations),
	};

	return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
