/* glTF files that are good: what the model then holds. */
#include <math.h>

#include "tests/unit/fixtures/gltf_files.h"

#include "lib/scatter/gltf_to_bsdf.h"

struct scene {
	struct model m;
	struct gltf_report r;
	struct err e;
};

static struct scene read_text(const char *text, struct gltf_options o)
{
	struct scene s = { 0 };

	put("s.gltf", text, strlen(text));
	if (gltf_file_read(in_scratch("s.gltf"), &o, &s.m, &s.r, &s.e))
		fail_msg("%s", s.e.text);
	return s;
}

/* Reads base with edits (see edit_base), which end with NULL. */
static struct scene read_with(struct gltf_options o, ...)
{
	char text[TEXT];
	va_list edits;

	va_start(edits, o);
	edit_base(text, edits);
	va_end(edits);
	return read_text(text, o);
}

#define read_edited(...) read_with(GLTF_OPTIONS_DEFAULT, __VA_ARGS__)

static void end(struct scene *s)
{
	model_free(&s->m);
	gltf_report_free(&s->r);
}

static int noted(const struct scene *s, const char *part)
{
	for (size_t i = 0; i < s->r.notes; i++)
		if (strstr(s->r.note[i], part))
			return 1;
	return 0;
}

static const double *corner(const struct model *m, size_t t, size_t k)
{
	return m->vertex + 3 * (size_t)m->triangle.corner[3 * t + k];
}

#define assert_point(p, x, y, z) do { \
	const double *q_ = (p); \
	assert_that(fabs(q_[0] - (x)) + fabs(q_[1] - (y)) + fabs(q_[2] - (z)), <, 1e-12); \
} while (0)

static void test_base(void **state)
{
	struct scene s = read_edited(NULL);

	(void)state;
	assert_int_equal(s.m.bands, 1);
	assert_int_equal(s.m.triangle.n, 2);
	assert_int_equal(s.m.vertices, 4);
	assert_int_equal(s.m.element.n, 0);
	assert_string_equal(s.m.surface.name[0], "floor");
	assert_int_equal(s.m.surface.has_normals[0], 0);
	assert_point(corner(&s.m, 1, 1), 1, 1, 0);
	assert_int_equal(s.m.material.n, 1);
	assert_string_equal(s.m.material.name[0], "paint");
	assert_int_equal(s.m.material.one_sided[0], 1);
	assert_int_equal(s.m.cameras, 1);
	assert_string_equal(s.m.camera[0].name, "eye");
	assert_that(s.m.camera[0].yfov, ==, 1);
	assert_that(s.m.camera[0].aspect, ==, 0);
	assert_int_equal(strlen(s.r.digest), 32);
	assert_int_equal(s.r.nodes, 2);
	end(&s);
}

static void test_digest_covers_the_buffer(void **state)
{
	unsigned char b[BUFFER];
	struct scene one = read_edited(NULL), two;

	(void)state;
	fill_buffer(b);
	b[0] = 1;
	put("b.bin", b, sizeof b);
	two = read_edited(NULL);
	assert_string_not_equal(one.r.digest, two.r.digest);
	fill_buffer(b);
	put("b.bin", b, sizeof b);
	end(&one);
	end(&two);
}

static void test_glb_is_the_same(void **state)
{
	struct scene a = read_edited(NULL), b = { 0 };
	struct gltf_options o = GLTF_OPTIONS_DEFAULT;
	unsigned char glb[TEXT];
	char text[TEXT];

	(void)state;
	base_with(text, ",'uri':'b.bin'", "", NULL);
	put("s.glb", glb, make_glb(text, glb));
	if (gltf_file_read(in_scratch("s.glb"), &o, &b.m, &b.r, &b.e))
		fail_msg("%s", b.e.text);
	assert_int_equal(a.m.vertices, b.m.vertices);
	assert_memory_equal(a.m.vertex, b.m.vertex, 24 * a.m.vertices);
	assert_memory_equal(a.m.triangle.corner, b.m.triangle.corner,
	                    12 * a.m.triangle.n);
	end(&a);
	end(&b);
}

/* The unit square as base64, longer than needed and with a media type of its own. */
static void test_data_uri(void **state)
{
	struct scene s = read_edited("'buffer':0,'byteOffset':0", "'buffer':1,'byteOffset':0",
	    "'b.bin'}", "'b.bin'},{'byteLength':48,'uri':'data:application/x-test;base64,"
	    "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAgD8AAAAAAAAA'}", NULL);

	(void)state;
	assert_point(corner(&s.m, 0, 2), 1, 1, 0);
	end(&s);
}

static void test_modes(void **state)
{
	struct scene s = read_edited("'indices':1,", "'mode':5,", NULL);

	(void)state;
	assert_int_equal(s.m.triangle.n, 2);
	assert_point(corner(&s.m, 0, 0), 0, 0, 0);
	assert_point(corner(&s.m, 0, 2), 1, 1, 0);
	assert_point(corner(&s.m, 1, 0), 1, 0, 0); /* the odd one: 1, 3, 2 */
	assert_point(corner(&s.m, 1, 1), 0, 1, 0);
	assert_point(corner(&s.m, 1, 2), 1, 1, 0);
	end(&s);
	s = read_edited("'indices':1,", "'mode':6,", NULL);
	assert_int_equal(s.m.triangle.n, 2);
	assert_point(corner(&s.m, 1, 0), 1, 1, 0); /* 2, 3, 0 */
	assert_point(corner(&s.m, 1, 1), 0, 1, 0);
	assert_point(corner(&s.m, 1, 2), 0, 0, 0);
	end(&s);
	s = read_edited("'indices':1,", "'mode':1,", NULL);
	assert_int_equal(s.m.triangle.n, 0);
	assert_int_equal(s.m.surface.n, 0);
	assert_int_equal(s.r.skipped, 1);
	assert_true(noted(&s, "points and lines are skipped"));
	end(&s);
}

static void test_sparse(void **state)
{
	struct scene s = read_edited("'POSITION':0", "'POSITION':4", NULL);

	(void)state;
	assert_point(corner(&s.m, 0, 1), 1, 0, 0);
	assert_point(corner(&s.m, 0, 2), 2, 2, 0);
	end(&s);
	s = read_edited("'POSITION':0", "'POSITION':4", "{'bufferView':0,'componentType':5126,"
	                "'count':4,'type':'VEC3','sparse'", "{'componentType':5126,'count':4,"
	                "'type':'VEC3','sparse'", NULL);
	assert_point(corner(&s.m, 0, 1), 0, 0, 0); /* zeros where nothing is said */
	assert_point(corner(&s.m, 0, 2), 2, 2, 0);
	end(&s);
}

static void test_quantised(void **state)
{
	struct scene s = read_edited("'asset'", "'extensionsUsed':['KHR_mesh_quantization'],"
	    "'extensionsRequired':['KHR_mesh_quantization'],'asset'",
	    "'POSITION':0", "'POSITION':5", "5120,", "5120,'normalized':true,", NULL);

	(void)state;
	assert_point(corner(&s.m, 0, 2), 1, 1, 0);
	assert_point(corner(&s.m, 1, 2), -1, 1, 0); /* -128 is -1 too */
	end(&s);
}

static void test_attributes_and_mirroring(void **state)
{
	struct scene s = read_edited("'POSITION':0}",
	                             "'POSITION':0,'NORMAL':2,'TEXCOORD_0':3}", NULL);

	(void)state;
	assert_int_equal(s.m.surface.has_normals[0], 1);
	assert_float_equal(s.m.triangle.normal[5], 1, 1e-7);
	assert_float_equal(s.m.triangle.uv[4], 1, 1e-7);
	end(&s);
	s = read_edited("'POSITION':0}", "'POSITION':0,'NORMAL':2,'TEXCOORD_0':3}",
	                "'mesh':0", "'mesh':0,'scale':[-2,1,3]", NULL);
	assert_point(corner(&s.m, 0, 1), -2, 1, 0); /* the winding is turned over */
	assert_point(corner(&s.m, 0, 2), -2, 0, 0);
	assert_float_equal(s.m.triangle.uv[3], 1, 1e-7);
	assert_float_equal(s.m.triangle.normal[2], 1, 1e-7);
	end(&s);
}

static void test_hierarchy(void **state)
{
	struct scene s = read_edited("{'name':'floor','mesh':0}",
	    "{'children':[2],'translation':[10,0,0],"
	    "'rotation':[0,0,0.7071067811865476,0.7071067811865476]}",
	    "'camera':0}]", "'camera':0},{'name':'x','mesh':0,'matrix':"
	    "[2,0,0,0,0,1,0,0,0,0,1,0,0,0,5,1]}]", NULL);

	(void)state;
	assert_int_equal(s.r.nodes, 3);
	assert_point(corner(&s.m, 0, 1), 10, 2, 5); /* (1,0,0): doubled, turned, moved */
	assert_point(corner(&s.m, 0, 2), 9, 2, 5);
	end(&s);
	s = read_edited("'nodes':[0,1]", "'nodes':[1]", NULL); /* not in the scene */
	assert_int_equal(s.m.triangle.n, 0);
	end(&s);
	s = read_edited("'scene':0,'scenes':[{'nodes':[0,1]}],", "", NULL);
	assert_int_equal(s.m.triangle.n, 2);
	end(&s);
	s = read_edited("'scene':0,'scenes':[", "'scene':1,'scenes':[{'nodes':[1]},", NULL);
	assert_int_equal(s.m.triangle.n, 2);
	assert_true(noted(&s, "the file has 2 scenes, only scenes[1] is read"));
	end(&s);
}

static void test_names(void **state)
{
	struct scene s = read_edited("'nodes':[0,1]}", "'nodes':[0,1,2,3,4]}",
	    "'camera':0}]", "'camera':0},{'name':'floor','mesh':0},{'mesh':0},"
	    "{'name':'a\\nb','mesh':1}]",
	    "'meshes':[", "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1}]},"
	    "{'name':'two','primitives':[{'attributes':{'POSITION':0},'indices':1},"
	    "{'attributes':{'POSITION':0},'indices':1}]},", NULL);
	static const char *const want[] = { "floor", "floor#2", "mesh0", "a b#p0", "a b#p1" };

	(void)state;
	assert_int_equal(s.m.surface.n, 5);
	for (size_t i = 0; i < 5; i++) {
		given("i %zu", i);
		assert_string_equal(s.m.surface.name[i], want[i]);
	}
	assert_int_equal(s.m.vertices, 20);
	assert_string_equal(s.m.material.name[0], "default");
	assert_true(noted(&s, "glTF's default"));
	end(&s);
}

static void test_cameras(void **state)
{
	struct scene s = read_edited("{'name':'eye','camera':0}", "{'camera':0,'matrix':"
	    "[0,0,-7,0,0,7,0,0,-7,0,0,0,1,2,3,1]}", "{'yfov':1,", "{'yfov':1,'aspectRatio':2,",
	    NULL);
	const struct camera *c = s.m.camera;

	(void)state;
	assert_string_equal(c->name, "camera0");
	assert_that(c->aspect, ==, 2);
	assert_point(c->to_world + 8, -1, 0, 0); /* unit columns, right-handed */
	assert_point(c->to_world + 4, 0, 1, 0);
	assert_point(c->to_world, 0, 0, 1);
	assert_point(c->to_world + 12, 1, 2, 3);
	end(&s);
	s = read_edited("{'type':'perspective','perspective':{'yfov':1,'znear':0.1}}",
	    "{'type':'orthographic','orthographic':{'xmag':2,'ymag':1,'znear':0,'zfar':9}}",
	    NULL);
	assert_true(s.m.camera->orthographic);
	assert_that(s.m.camera->xmag, ==, 2);
	end(&s);
}

/* ---- materials ---- */

#define PAINT "{'name':'paint','pbrMetallicRoughness':{'metallicFactor':0}}"

static struct scene paint(const char *material)
{
	return read_edited(PAINT, material, NULL);
}


static void test_dielectric(void **state)
{
	struct scene s = paint("{'name':'paint','doubleSided':true,'pbrMetallicRoughness':"
	    "{'metallicFactor':0,'roughnessFactor':0.5,'baseColorFactor':[0.5,0.25,0.125,1]},"
	    "'emissiveFactor':[0.5,1,0],'extensions':{'KHR_materials_emissive_strength':"
	    "{'emissiveStrength':10}}}");
	const struct materials *m = &s.m.material;

	(void)state;
	assert_int_equal(s.m.bands, 3);
	assert_near(m->rho_s[0], .04, 1e-12);
	assert_near(m->rho_d[1], .96 * .25, 1e-12);
	assert_near(m->rho_d[3 + 2], .96 * .125, 1e-12);
	assert_near(m->alpha[0], (2 / .0625 - 2) / 4, 1e-12);
	assert_true(isinf(m->beta[0]));
	assert_near(m->emission[0], 5, 1e-12);
	assert_near(m->emission[3 + 1], 10, 1e-12);
	assert_int_equal(m->one_sided[0], 0);
	assert_int_equal(s.r.notes, 0);
	end(&s);
}

static void test_folding(void **state)
{
	struct scene s = paint("{'name':'paint','pbrMetallicRoughness':"
	                       "{'baseColorFactor':[0.5,0.5,0.5,1]}}");

	(void)state;
	assert_near(s.m.material.rho_d[0], .5, 1e-12); /* plain glTF: metallic 1, roughness 1 */
	assert_that(s.m.material.rho_s[0], ==, 0);
	assert_true(isinf(s.m.material.alpha[0]));
	assert_true(noted(&s, "material paint: its reflected lobe is folded"));
	end(&s);
	s = paint("{'name':'paint','pbrMetallicRoughness':"
	          "{'metallicFactor':0,'roughnessFactor':0.1}}");
	assert_near(s.m.material.rho_d[0], 1, 1e-12); /* .04 of 1 is weak; energy kept */
	assert_true(noted(&s, "its share of the albedo, 0.04, is below 0.05"));
	end(&s);
	struct gltf_options o = GLTF_OPTIONS_DEFAULT;
	o.min_directional = 0;
	s = read_with(o, PAINT, "{'pbrMetallicRoughness':{'metallicFactor':0,"
	              "'roughnessFactor':0}}", NULL);
	assert_near(s.m.material.rho_s[0], .04, 1e-12);
	assert_true(isinf(s.m.material.alpha[0]));
	assert_string_equal(s.m.material.name[0], "material0");
	end(&s);
}

static void test_transmission(void **state)
{
	struct scene s = paint("{'pbrMetallicRoughness':{'metallicFactor':0,'roughnessFactor':0,"
	    "'baseColorFactor':[0.8,0.8,0.8,1]},'extensions':{"
	    "'KHR_materials_transmission':{'transmissionFactor':0.5},"
	    "'KHR_materials_diffuse_transmission':{'diffuseTransmissionFactor':0.25,"
	    "'diffuseTransmissionColorFactor':[0.5,0.5,0.5]},"
	    "'KHR_materials_ior':{'ior':3}}}");
	const struct materials *m = &s.m.material;

	(void)state;
	assert_near(m->rho_s[0], .25, 1e-12); /* ((3 - 1) / (3 + 1))^2 */
	assert_near(m->tau_s[0], .75 * .5 * .8, 1e-12);
	assert_near(m->tau_d[0], .75 * .5 * .25 * .5, 1e-12);
	assert_near(m->rho_d[0], .75 * .5 * .75 * .8, 1e-12);
	assert_int_equal(m->one_sided[0], 0);
	assert_near(m->tau_s[1], m->tau_s[0], 1e-12);
	end(&s);
	s = paint("{'alphaMode':'BLEND','pbrMetallicRoughness':"
	          "{'baseColorFactor':[0.5,0.5,0.5,0.25]}}");
	assert_near(s.m.material.tau_s[0], .75, 1e-12);
	assert_near(s.m.material.rho_d[0], .125, 1e-12);
	assert_true(isinf(s.m.material.beta[0]));
	end(&s);
	s = paint("{'alphaMode':'MASK','pbrMetallicRoughness':"
	          "{'baseColorFactor':[0.5,0.5,0.5,0.25]}}");
	assert_near(s.m.material.tau_s[0], 1, 1e-12);
	end(&s);
	s = paint("{'pbrMetallicRoughness':{'metallicFactor':0,'roughnessFactor':0,"
	    "'baseColorFactor':[0,0,0,1]},'extensions':{'KHR_materials_specular':"
	    "{'specularFactor':0.5,'specularColorFactor':[1,0.5,30]}}}");
	assert_near(s.m.material.rho_s[0], .02, 1e-12);
	assert_near(s.m.material.rho_s[1], .01, 1e-12);
	assert_near(s.m.material.rho_s[2], .5, 1e-12);
	end(&s);
}

static void test_extras(void **state)
{
	struct scene s = paint("{'emissiveFactor':[1,1,1],'extras':{'twopass':{'rho_d':0.5,"
	    "'rho_s':0.01,'alpha':0.5,'back':{'rho_d':0.25,'rho_s':0,'tau_s':0.5,'beta':'inf'},"
	    "'emission_exponent':3}}}");
	const struct materials *m = &s.m.material;

	(void)state;
	assert_int_equal(s.m.bands, 1);
	assert_near(m->rho_d[0], .5, 1e-12);
	assert_near(m->rho_d[1], .25, 1e-12);
	assert_near(m->rho_s[0], .01, 1e-12); /* weak and wide, but explicit: not folded */
	assert_near(m->alpha[0], .5, 1e-12);
	assert_true(isinf(m->alpha[1]) && isinf(m->beta[1]));
	assert_near(m->tau_s[1], .5, 1e-12);
	assert_near(m->emission[0], 1, 1e-12);
	assert_near(m->emission[1], 0, 1e-12);
	assert_near(m->emission_exponent[0], 3, 1e-12);
	assert_near(m->emission_exponent[1], 1, 1e-12); /* dark */
	assert_int_equal(m->one_sided[0], 0);
	assert_true(noted(&s, "not reciprocal"));
	end(&s);
	s = paint("{'emissiveFactor':[1,1,1],'extras':{'twopass':{'emission_back':2}}}");
	assert_near(s.m.material.emission[0], 1, 1e-12);
	assert_near(s.m.material.emission[1], 2, 1e-12);
	assert_int_equal(s.m.material.one_sided[0], 0);
	end(&s);
}

static void test_bands(void **state)
{
	struct gltf_options o = GLTF_OPTIONS_DEFAULT;
	struct scene s = paint("{'extras':{'twopass':{'rho_d':[0.1,0.2,0.3,0.4],'rho_s':[0.5]}}}");

	(void)state;
	assert_int_equal(s.m.bands, 4);
	assert_near(s.m.material.rho_d[3], .4, 1e-12);
	assert_near(s.m.material.rho_s[7], 0, 1e-12); /* black back */
	end(&s);
	s = paint("{'extras':{'twopass':{'rho_d':[0.5,0.5,0.5]}}}");
	assert_int_equal(s.m.bands, 1);
	end(&s);
	o.bands = 3;
	s = read_with(o, PAINT, "{'extras':{'twopass':{'rho_d':0.5}}}", NULL);
	assert_int_equal(s.m.bands, 3);
	assert_near(s.m.material.rho_d[2], .5, 1e-12);
	end(&s);
	o.bands = 1;
	s = read_with(o, PAINT, "{'extras':{'twopass':{'rho_d':[1,0.5,0]}}}", NULL);
	assert_near(s.m.material.rho_d[0], .2126 + .7152 / 2, 1e-12);
	assert_true(noted(&s, "luminance"));
	end(&s);
}

static void test_clamp(void **state)
{
	struct gltf_options o = GLTF_OPTIONS_DEFAULT;

	(void)state;
	o.clamp = 1;
	struct scene s = read_with(o, PAINT,
	                           "{'extras':{'twopass':{'rho_d':0.9,'rho_s':0.3}}}", NULL);
	assert_near(s.m.material.rho_d[0], .75, 1e-12);
	assert_near(s.m.material.rho_s[0], .25, 1e-12);
	assert_true(noted(&s, "is rescaled to 1"));
	end(&s);
}

static void test_notes(void **state)
{
	struct scene s = read_edited(
	    "'asset'", "'textures':[{}],'animations':[{}],'skins':[{}],'asset'",
	    "'mesh':0", "'mesh':0,'skin':0,'extensions':{'EXT_mesh_gpu_instancing':{}}",
	    "'indices':1,", "'indices':1,'targets':[{'POSITION':0}],",
	    "'POSITION':0}", "'POSITION':0,'COLOR_0':0}",
	    PAINT, "{'name':'paint','normalTexture':{'index':0},'pbrMetallicRoughness':"
	    "{'baseColorTexture':{'index':0},'baseColorFactor':[2,1,1,1]},"
	    "'extensions':{'KHR_materials_sheen':{}}}", NULL);
	static const char *const want[] = { "EXT_mesh_gpu_instancing is not yet modelled",
		"KHR_materials_sheen is not yet modelled", "animations are not", "skinning is not",
		"morph targets are not", "vertex colours", "normal maps are not",
		"material paint: textures are not yet modelled, their factors are used",
		"material paint: factors outside [0,1] are clamped" };

	(void)state;
	for (size_t i = 0; i < sizeof want / sizeof *want; i++) {
		given("i %zu", i);
		if (!noted(&s, want[i]))
			fail_msg("no note '%s'", want[i]);
	}
	end(&s);
}

static void test_rules_keep_energy(void **state)
{
	struct bsdf_gltf g = bsdf_gltf_default;
	struct bsdf_side s, folded;
	struct bsdf_folding f;

	(void)state;
	for (int i = 0; i < 3 * 3 * 3 * 3 * 3; i++) {
		given("i %d", i);
		g.metallic = i % 3 / 2.;
		g.roughness = i / 3 % 3 / 2.;
		g.transmission = i / 9 % 3 / 2.;
		g.diffuse_transmission = i / 27 % 3 / 2.;
		g.opacity = i / 81 % 3 / 2.;
		bsdf_from_gltf(&g, 0, 0, &s, &f);
		bsdf_from_gltf(&g, 2, INFINITY, &folded, &f);
		for (int b = 0; b < 3; b++) {
			assert_that(bsdf_side_albedo(&s, b), <=, 1 + 1e-12);
			assert_near(bsdf_side_albedo(&s, b), bsdf_side_albedo(&folded, b), 1e-12);
			assert_near(folded.rho_s[b], 0, 1e-12);
			assert_near(folded.tau_s[b], 1 - g.opacity, 1e-12);
		}
	}
}

static void test_rules_exponent(void **state)
{
	struct bsdf_gltf g = bsdf_gltf_default;
	struct bsdf_side s;
	struct bsdf_folding f;

	(void)state;
	g.roughness = 0;
	bsdf_from_gltf(&g, 0, 0, &s, &f);
	assert_true(isinf(f.exponent));
	g.roughness = 1;
	bsdf_from_gltf(&g, 0, 0, &s, &f);
	assert_near(f.exponent, 0, 1e-12);
}

int main(void)
{
	static const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_base),
		cmocka_unit_test(test_digest_covers_the_buffer),
		cmocka_unit_test(test_glb_is_the_same),
		cmocka_unit_test(test_data_uri),
		cmocka_unit_test(test_modes),
		cmocka_unit_test(test_sparse),
		cmocka_unit_test(test_quantised),
		cmocka_unit_test(test_attributes_and_mirroring),
		cmocka_unit_test(test_hierarchy),
		cmocka_unit_test(test_names),
		cmocka_unit_test(test_cameras),
		cmocka_unit_test(test_dielectric),
		cmocka_unit_test(test_folding),
		cmocka_unit_test(test_transmission),
		cmocka_unit_test(test_extras),
		cmocka_unit_test(test_bands),
		cmocka_unit_test(test_clamp),
		cmocka_unit_test(test_notes),
		cmocka_unit_test(test_rules_keep_energy),
		cmocka_unit_test(test_rules_exponent),
	};

	return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
