#include "lib/picture/camera.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/vec.h"

/* The sine of the angle between view and up direction below which the picture's upright is
 * rounding. A guess. */
static const double parallel = 1e-9;

static int no_such_camera(const struct model *m, const char *name, struct err *e)
{
	char list[512];
	size_t at = 0;

	if (!m->cameras)
		return err_set(e, "the scene has no cameras; give a view by --eye and --target");
	for (size_t i = 0; i < m->cameras && at < sizeof list; i++) {
		int n = snprintf(list + at, sizeof list - at, "%s%s", i ? ", " : "",
		                 m->camera[i].name);
		at += n > 0 ? (size_t)n : 0;
	}
	return err_set(e, "%s%s%s; there are: %s%s", name ? "no camera '" : "choose a camera",
	               name ? name : "", name ? "'" : "", list,
	               at < sizeof list ? "" : "...");
}

int picture_camera_find(const struct model *m, const char *name, struct err *e)
{
	for (size_t i = 0; name && i < m->cameras; i++)
		if (strcmp(m->camera[i].name, name) == 0)
			return (int)i;
	return no_such_camera(m, name, e);
}

static double aspect_of(const struct camera *c)
{
	double a = c->orthographic ? c->xmag / c->ymag : c->aspect;
	return a > 0 && isfinite(a) ? a : CAMERA_ASPECT;
}

int picture_camera_frame(const struct camera *c, int width, int height, struct view_frame *f,
                         struct err *e)
{
	if (width <= 0)
		width = CAMERA_WIDTH;
	double h = height > 0 ? height : fmax(1, floor(width / aspect_of(c) + .5));
	if (h > CAMERA_SIZE_MAX)
		return err_set(e, "camera '%s': %d pixels of width make %.0f of height; "
		               "give both", c->name ? c->name : "", width, h);

	*f = (struct view_frame){ .width = width, .height = (int)h,
	                          .orthographic = c->orthographic };
	memcpy(f->up, c->to_world + 4, sizeof f->up);
	for (int k = 0; k < 3; k++)
		f->forward[k] = -c->to_world[8 + k];
	memcpy(f->eye, c->to_world + 12, sizeof f->eye);
	double l = v3_normalise(f->forward);
	v3_cross(f->forward, f->up, f->right);
	double r = v3_normalise(f->right);
	v3_cross(f->right, f->forward, f->up);
	f->half_y = c->orthographic ? fabs(c->ymag) : tan(c->yfov / 2);
	f->half_x = f->half_y * width / h;
	f->step_x = 2 * f->half_x / width;
	f->step_y = 2 * f->half_y / h;
	if (!(r > 0 && l > 0 && f->half_x > 0 && isfinite(r + l + f->half_x)))
		return err_set(e, "camera '%s' has no usable field of view or orientation",
		               c->name ? c->name : "");
	return 0;
}

void picture_camera_ray(const struct view_frame *f, double x, double y, double org[3],
                        double dir[3])
{
	double sx = x * f->step_x - f->half_x, sy = f->half_y - y * f->step_y;
	double across[3];

	for (int k = 0; k < 3; k++)
		across[k] = sx * f->right[k] + sy * f->up[k];
	if (f->orthographic) {
		v3_mad(f->eye, 1, across, org);
		memcpy(dir, f->forward, sizeof f->forward);
		return;
	}
	/* The axes are orthonormal; one division, for this runs for every pixel. */
	double scale = 1 / sqrt(1 + sx * sx + sy * sy);
	for (int k = 0; k < 3; k++) {
		org[k] = f->eye[k];
		dir[k] = scale * (f->forward[k] + across[k]);
	}
}

double picture_camera_depth(const struct view_frame *f, const double point[3])
{
	double d[3];
	v3_sub(point, f->eye, d);
	return v3_dot(d, f->forward);
}

void picture_camera_world_to_camera(const struct view_frame *f, float matrix[16])
{
	const double *axis[3] = { f->right, f->up, f->forward };

	memset(matrix, 0, 16 * sizeof *matrix);
	for (int j = 0; j < 3; j++) {
		for (int k = 0; k < 3; k++)
			matrix[4 * k + j] = (float)axis[j][k];
		matrix[12 + j] = (float)-v3_dot(axis[j], f->eye);
	}
	matrix[15] = 1;
}

int picture_camera_look_at(const double eye[3], const double target[3], const double up[3],
                           double fov_degrees, struct camera *c, struct err *e)
{
	double back[3], right[3], upright[3];

	v3_sub(eye, target, back);
	if (!(v3_normalise(back) > 0))
		return err_set(e, "the eye and the target of the view are the same point");
	v3_cross(up, back, right);
	if (!(v3_normalise(right) > parallel * v3_length(up)))
		return err_set(e, "the view's up direction lies along its line of sight; "
		               "give another one by --up");
	if (!(fov_degrees > 0 && fov_degrees < 180))
		return err_set(e, "the field of view must lie between 0 and 180 degrees");
	v3_cross(back, right, upright);
	*c = (struct camera){ .yfov = fov_degrees * (PI / 180) };
	memcpy(c->to_world, right, sizeof right);
	memcpy(c->to_world + 4, upright, sizeof upright);
	memcpy(c->to_world + 8, back, sizeof back);
	memcpy(c->to_world + 12, eye, 3 * sizeof *eye);
	c->to_world[15] = 1;
	return 0;
}
