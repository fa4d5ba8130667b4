/* Views: the size of a camera's picture and the rays through its pixels. */
#ifndef TWOPASS_CAMERA_H
#define TWOPASS_CAMERA_H

#include "lib/base/err.h"
#include "lib/data/model.h"

/* Pixels: the width of a picture that is given none, and the most either way, so that their
 * product is no more than 2^32. Conventions. */
enum { CAMERA_WIDTH = 640, CAMERA_SIZE_MAX = 65536 };

/* Vertical field of view, degrees, and upright direction of a view that gives none. The first
 * is a convention, the second glTF's. */
#define CAMERA_FOV 50.
#define CAMERA_UP { 0, 1, 0 }

/* Width over height of a camera that gives none. */
#define CAMERA_ASPECT (4. / 3)

/* A camera with a picture size. Pixels are square: the vertical extent is the
 * camera's own, the horizontal one follows from the size. */
struct view_frame {
	int width, height;
	int orthographic;
	double eye[3];
	double right[3], up[3], forward[3]; /* unit vectors, world */
	double half_x, half_y;              /* half extents: metres for orthographic
	                                       cameras, tangents for perspective ones */
	double step_x, step_y;              /* the same units for one pixel */
};

/* Index of the camera called `name` in m, or -1 and e, which lists those there are
 * (with a NULL name, asking for one of them). */
int picture_camera_find(const struct model *m, const char *name, struct err *e);

/* Sets up c's view of width x height pixels; 0 for width means CAMERA_WIDTH, 0 for
 * height the one that the camera's aspect gives. 0, or -1 and e. */
int picture_camera_frame(const struct camera *c, int width, int height, struct view_frame *f,
                         struct err *e);

/* The ray through picture coordinates (x, y): x from 0 (left edge) to width, y from
 * 0 (top edge) to height, so the centre of pixel (i, j) is (i + .5, j + .5). dir is
 * a unit vector. Perspective rays begin in the eye, orthographic ones in the plane
 * through it. */
void picture_camera_ray(const struct view_frame *f, double x, double y, double org[3],
                        double dir[3]);

/* Depth Z of a world point: its distance from the eye's plane along the viewing
 * direction, positive in front. */
double picture_camera_depth(const struct view_frame *f, const double point[3]);

/* OpenEXR's worldToCamera: row vectors times this row-major matrix give camera
 * coordinates, x to the right, y up, z in the viewing direction (left-handed). */
void picture_camera_world_to_camera(const struct view_frame *f, float matrix[16]);

/* A perspective camera at eye, looking at target, with `up` upright and a vertical
 * field of view in degrees. Its name is NULL, its aspect not given. 0, or -1 and e
 * when the directions do not make a view. */
int picture_camera_look_at(const double eye[3], const double target[3], const double up[3],
                           double fov_degrees, struct camera *c, struct err *e);

#endif
