/* Prints the mean irradiance of each side of each patch of a glTF scene.
 * cc example.c $(pkg-config --cflags --libs libcommon) -o example && ./example room.gltf */
#include <stdio.h>
#include <stdlib.h>
#include <twopass.h>

int main(int argc, char **argv)
{
	struct twopass_error e = { "name a glTF file" };
	struct twopass_scene *s = argc == 2 ? twopass_mesh(argv[1], NULL, &e) : NULL;
	double *flux = s ? (double *)calloc(twopass_patches(s), sizeof *flux) : NULL;

	if (!flux || twopass_form_factors(s, NULL, NULL, &e) || twopass_solve(s, NULL, &e)) {
		fprintf(stderr, "example: %s\n", e.text);
		return EXIT_FAILURE;
	}
	for (size_t i = 0; i < twopass_elements(s); i++) {
		struct twopass_element element;
		twopass_get_element(s, i, &element);
		flux[element.patch] += element.area * element.irradiance[0];
	}
	for (size_t i = 0; i < twopass_patches(s); i++) {
		struct twopass_patch patch;
		twopass_get_patch(s, i, &patch);
		printf("%s,%.17g\n", patch.name, flux[i] / patch.area);
	}
	free(flux);
	twopass_free(s);
}
