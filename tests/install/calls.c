/* Every call of the installed library, on the furnace (H = 1 and M + E = 1 everywhere, every
 * pixel 1/pi), and what it says to what it cannot do.
 * usage: calls FURNACE.gltf FOLDER. Prints what is wrong. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <twopass.h>

enum { WIDTH = 5, HEIGHT = 4 };

static int wrong; /* line of the last */
static struct twopass_error e;

static void expect(int line, const char *what, int good)
{
	if (good || line == wrong) /* once in a loop is enough */
		return;
	printf("line %d: not %s (error: %s)\n", line, what, e.text);
	wrong = line;
}
#define EXPECT(x) expect(__LINE__, #x, x)
/* Fails, and says so. */
#define REFUSED(x, why) expect(__LINE__, #x, (x) && strstr(e.text, why))

static const char *file(const char *folder, const char *name)
{
	static char path[2][4096];
	static int turn;

	turn = !turn;
	snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
	return path[turn];
}

static struct twopass_scene *mesh(const char *gltf)
{
	struct twopass_mesh_options o = twopass_mesh_defaults();

	o.patch.value = o.element.value = .5;
	o.patch.relative = o.element.relative = 0;
	struct twopass_scene *s = twopass_mesh(gltf, &o, &e);
	EXPECT(s && !*e.text);
	if (!s)
		exit(EXIT_FAILURE);
	return s;
}

static void check_form_factors(struct twopass_scene *s, const char *folder)
{
	struct twopass_ff_options o = twopass_ff_defaults();
	size_t n = twopass_patches(s);
	double *row = (double *)calloc(n + 2, sizeof *row), error = -1;

	o.to_patches = o.f64 = 1;
	EXPECT(!twopass_form_factors(s, &o, NULL, &e));
	for (size_t i = 0; i < n; i++) {
		double sum = 0;
		EXPECT(!twopass_form_factor_row(s, i, row, &error, &e) && error >= 0 && error < 1e-3);
		for (size_t k = 0; k < n + 2; k++)
			sum += row[k];
		EXPECT(fabs(sum - 1) < 1e-9);
	}
	REFUSED(twopass_form_factor_row(s, n, row, NULL, &e), "no patch-side");
	o.samples = 1;
	REFUSED(twopass_form_factors(s, &o, NULL, &e), "samples is 1");
	o.samples = 5;
	o.method = TWOPASS_HEMICUBE;
	REFUSED(twopass_form_factors(s, &o, NULL, &e), "even");
	REFUSED(twopass_form_factors(s, NULL, "-", &e), "standard output");
	REFUSED(twopass_form_factors(s, NULL, file(folder, "no/a.ff"), &e), "No such file");
	REFUSED(twopass_read_form_factors(s, file(folder, "no.ff"), &e), "No such file");
	REFUSED(twopass_form_factor_row(s, 0, row, NULL, &e), "no form factors");
	free(row);
}

static void check_light(const struct twopass_scene *s)
{
	EXPECT(twopass_bands(s) == 1 && twopass_patches(s) == 24 && twopass_elements(s) >= 48);
	for (size_t i = 0; i < twopass_elements(s); i++) {
		struct twopass_element a;
		EXPECT(!twopass_get_element(s, i, &a) && !a.back && a.patch < twopass_patches(s));
		EXPECT(fabs(a.irradiance[0] - 1) < 1e-3 && a.sampling_error[0] < 1e-2);
		EXPECT(fabs(a.exitance[0] + a.emission[0] - 1) < 1e-3 && a.element_error[0] < 1);
	}
}

static void check_picture(const struct twopass_scene *s)
{
	struct twopass_view v = twopass_view_defaults();
	float rgb[HEIGHT][WIDTH][3];
	double error = -1;

	REFUSED(twopass_render(s, &v, &rgb[0][0][0], NULL, &e), "same point");
	v.width = WIDTH;
	v.height = HEIGHT;
	v.camera = "nobody";
	REFUSED(twopass_render(s, &v, &rgb[0][0][0], NULL, &e), "nobody");
	v.camera = "inside";
	v.diffuse = TWOPASS_DIFFUSE_MESH;
	EXPECT(!twopass_render(s, &v, &rgb[0][0][0], &error, &e) && error >= 0 && error < 1);
	for (int i = 0; i < WIDTH * HEIGHT * 3; i++)
		EXPECT(fabs(1 / acos(-1) - (double)(&rgb[0][0][0])[i]) < 1e-3);
	v.samples = 0;
	REFUSED(twopass_render(s, &v, &rgb[0][0][0], NULL, &e), "samples is 0");
}

static void check_meshes(const char *gltf)
{
	struct twopass_mesh_options o = twopass_mesh_defaults();

	o.patch.value = NAN;
	REFUSED(!twopass_mesh(gltf, &o, &e), "patch is nan");
	o = twopass_mesh_defaults();
	o.bands = 33;
	REFUSED(!twopass_mesh(gltf, &o, &e), "bands is 33");
	REFUSED(!twopass_mesh("/no/such.gltf", NULL, &e), "/no/such.gltf");
	REFUSED(!twopass_read("/no/such.mesh", &e), "/no/such.mesh");
	REFUSED(!twopass_read(gltf, &e), gltf);
	EXPECT(!twopass_read(gltf, NULL));
	twopass_free(NULL);
}

int main(int argc, char **argv)
{
	const char *gltf = argc == 3 ? argv[1] : "", *folder = argc == 3 ? argv[2] : "";
	struct twopass_solve_options stop = twopass_solve_defaults();
	struct twopass_scene *s = mesh(gltf), *again;
	struct twopass_patch patch;
	struct twopass_element element;
	float rgb[3] = { 0 };

	EXPECT(*twopass_version());
	check_meshes(gltf);
	EXPECT(!twopass_get_patch(s, 0, &patch) && fabs(patch.area - .25) < 1e-12);
	EXPECT(strstr(patch.name, patch.surface) == patch.name && *patch.material);
	EXPECT(twopass_get_patch(s, 24, &patch) && !patch.name);
	EXPECT(twopass_get_element(s, twopass_elements(s), &element) && element.area == 0);
	REFUSED(twopass_solve(s, NULL, &e), "no form factors");
	REFUSED(twopass_render(s, NULL, rgb, NULL, &e), "not solved");
	REFUSED(twopass_write(s, file(folder, "no/a.mesh"), &e), "No such file");
	check_form_factors(s, folder);
	EXPECT(!twopass_write(s, file(folder, "a.mesh"), &e));
	EXPECT(!twopass_form_factors(s, NULL, file(folder, "a.ff"), &e));
	stop.stop = -1;
	REFUSED(twopass_solve(s, &stop, &e), "stop is -1");
	stop.stop = 1e-9;
	EXPECT(!twopass_solve(s, &stop, &e));
	check_light(s);
	check_picture(s);
	EXPECT(!twopass_write(s, file(folder, "a.rad"), &e));
	twopass_free(s);

	again = twopass_read(file(folder, "a.rad"), &e);
	EXPECT(again && !twopass_read_form_factors(again, file(folder, "a.ff"), &e));
	check_light(again);
	REFUSED(!twopass_read(file(folder, "a.ff"), &e), "a.ff");
	twopass_free(again);
	return wrong != 0;
}
