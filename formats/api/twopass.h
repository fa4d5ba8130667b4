/* libcommon: meshes, form factors, light and pictures of a scene, from C and C++.
 *
 *     struct twopass_error e;
 *     struct twopass_scene *s = twopass_mesh("room.gltf", NULL, &e);
 *     if (!s || twopass_form_factors(s, NULL, NULL, &e) || twopass_solve(s, NULL, &e))
 *             fprintf(stderr, "%s\n", e.text);
 *
 * The steps are those of the programs mesh, ffcalc, shoot and trace, and so are the files
 * and the defaults; twopass(3) tells more. Lengths are in metres, irradiance is in lx if the
 * emission of the scene is in cd/m2, or in W/m2 if the scene is radiometric.
 *
 * Functions return NULL, or an int other than 0, where they fail; if `error` is not NULL it
 * then says why, else it is "". Options may be NULL: the defaults. A scene may be read by
 * several threads at once, but changed by one only, while no other uses it. */
#ifndef TWOPASS_H
#define TWOPASS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A line without newline, as the programs print it after their name. */
struct twopass_error {
	char text[1024];
};

/* A division of surfaces, and as far as they were computed or read its form factors and
 * its light. */
struct twopass_scene;

/* Of the library: "0.1.0". */
const char *twopass_version(void);

/* ---- meshes ---- */

/* Metres, or if relative a fraction of the diameter of the smallest ball about the scene; INFINITY
 * is no bound. */
struct twopass_length {
	double value;
	int relative;
};

struct twopass_mesh_options {
	struct twopass_length patch;   /* longest side of a patch, which sends light */
	struct twopass_length element; /* longest edge of an element, which receives it */
	int element_within_patch;      /* 1: no longer than the patch size either */
	double normal_cone;            /* degrees, 0 to 80, that normals in a curved patch turn */
	int no_imprint;                /* 1: do not cut surfaces where others touch them */
	int bands;                     /* 1 to 32; 0: 1 for a grey scene, else 3 */
	int clamp;                     /* 1: rescale materials that return more than they receive */
};

struct twopass_mesh_options twopass_mesh_defaults(void);

/* Reads a glTF scene and divides its surfaces. The scene is to be freed; NULL and error
 * where that failed. */
struct twopass_scene *twopass_mesh(const char *gltf, const struct twopass_mesh_options *options,
                                   struct twopass_error *error);

/* ---- files ---- */

/* Reads a .mesh file, or a .rad file, whose light comes with it. The scene is to be freed;
 * NULL and error where that failed. */
struct twopass_scene *twopass_read(const char *path, struct twopass_error *error);

/* Writes a .rad file if the scene is solved, else a .mesh file. */
int twopass_write(const struct twopass_scene *scene, const char *path,
                  struct twopass_error *error);

/* Frees the scene and all that belongs to it. scene may be NULL. */
void twopass_free(struct twopass_scene *scene);

/* ---- what the scene is made of ---- */

enum { TWOPASS_BANDS_MAX = 32 };

/* One side of a patch. Names belong to the scene. */
struct twopass_patch {
	const char *name;       /* "floor:f", or "floor[3]:b" where a surface has several
	                           patches; f is the front, b the back */
	const char *surface;
	const char *material;
	uint32_t patch;         /* number in the files */
	int back;               /* 0: front, 1: back */
	double area;            /* m2 */
};

/* One side of an element. Light is there once the scene is solved, before that 0; arrays
 * are used as far as there are bands. */
struct twopass_element {
	size_t patch;           /* the patch-side it is part of, for twopass_get_patch */
	uint32_t element;       /* number in the files */
	int back;               /* 0: front, 1: back */
	double area;            /* m2 */
	double centroid[3];
	double normal[3];       /* unit, of this side */
	double irradiance[TWOPASS_BANDS_MAX];
	double sampling_error[TWOPASS_BANDS_MAX];  /* standard error of irradiance, from the
	                                              sampling of the form factors */
	double element_error[TWOPASS_BANDS_MAX];   /* estimated root mean square, over the
	                                              element, of what interpolation misses */
	double exitance[TWOPASS_BANDS_MAX];        /* diffuse, without emission */
	double emission[TWOPASS_BANDS_MAX];        /* emitted exitance */
};

int twopass_bands(const struct twopass_scene *scene);

/* How many sides of patches and elements are modelled: backs of one-sided materials are
 * not. They are numbered from 0 in the order of the files, fronts before backs. */
size_t twopass_patches(const struct twopass_scene *scene);
size_t twopass_elements(const struct twopass_scene *scene);

/* Fills *out for side i; -1 and *out all 0 if there is none of that number. */
int twopass_get_patch(const struct twopass_scene *scene, size_t i, struct twopass_patch *out);
int twopass_get_element(const struct twopass_scene *scene, size_t i, struct twopass_element *out);

/* ---- form factors ---- */

enum twopass_method {
	TWOPASS_RAYS,           /* all by rays */
	TWOPASS_HEMICUBE,       /* all by hemicubes */
	TWOPASS_ANALYTIC,       /* all by formula */
	TWOPASS_AUTO            /* emitters, or patches to patches, by formula, others by rays */
};

struct twopass_ff_options {
	enum twopass_method method;
	uint32_t samples;       /* rays a patch-side, or pixels along a hemicube's edge; 0: as
	                           many as is usual for the method */
	double target;          /* formulas: absolute error of a factor that is partly hidden;
	                           0: what is usual */
	int to_patches;         /* 1: patches receive, not elements */
	int close;              /* 1: change what is in doubt so that closed rows add up;
	                           formulas to patches only */
	int f64;                /* 1: in double precision */
	uint64_t seed;
	int threads;            /* 0: one for each processor */
};

struct twopass_ff_options twopass_ff_defaults(void);

/* Computes the scene's form factors, in place of earlier ones, and keeps them in the file
 * `path` (.ff), which is mapped as long as the scene has them; NULL: a temporary one in
 * TMPDIR or /tmp. */
int twopass_form_factors(struct twopass_scene *scene, const struct twopass_ff_options *options,
                         const char *path, struct twopass_error *error);

/* Takes them from a file that was computed for the same geometry. */
int twopass_read_form_factors(struct twopass_scene *scene, const char *path,
                              struct twopass_error *error);

/* What leaves patch-side i diffusely, by where it first lands: to[n + 2] with n =
 * twopass_patches(scene): the form factor to each patch-side, then the parts that meet black
 * backs and that leave the scene. They add up to 1. *row_error (or NULL) is the error of the
 * row: the root of the squared standard errors, or the sum of the estimated ones if the row
 * is all by formula. All are NaN if the side is black and does not emit. -1 and error if
 * there are no form factors or no such side. */
int twopass_form_factor_row(const struct twopass_scene *scene, size_t i, double *to,
                            double *row_error, struct twopass_error *error);

/* ---- light ---- */

struct twopass_solve_options {
	double stop;            /* unshot over emitted flux at which to stop, 0 to 1 */
	int threads;            /* 0: one for each processor */
};

struct twopass_solve_options twopass_solve_defaults(void);

/* Computes the light of a scene with form factors. */
int twopass_solve(struct twopass_scene *scene, const struct twopass_solve_options *options,
                  struct twopass_error *error);

/* ---- pictures ---- */

enum twopass_diffuse {
	TWOPASS_DIFFUSE_MESH,   /* interpolated between elements */
	TWOPASS_DIFFUSE_DIRECT, /* light of emitters computed for each point */
	TWOPASS_DIFFUSE_GATHER  /* that, and indirect light gathered for each point */
};

struct twopass_view {
	const char *camera;     /* name of a camera of the scene; NULL: by eye and target */
	double eye[3];
	double target[3];
	double up[3];
	double fov;             /* vertical, degrees */
	int width, height;      /* pixels, 1 to 65536 */
	enum twopass_diffuse diffuse;
	int samples;            /* positions in each pixel, 1 to 65536 */
	int threads;            /* 0: one for each processor */
};

/* Without a camera, and with eye and target in the origin. */
struct twopass_view twopass_view_defaults(void);

/* What a camera sees of a solved scene: rgb[height][width][3] radiance, the first row at the
 * top (cd/m2, or W/(m2 sr)). *relative_error (or NULL) is the estimated relative root mean
 * square error. Each call prepares the scene anew. */
int twopass_render(const struct twopass_scene *scene, const struct twopass_view *view, float *rgb,
                   double *relative_error, struct twopass_error *error);

#ifdef __cplusplus
}
#endif

#endif
