/* Pictures. */
#include "formats/api/api_scene.h"
#include "lib/picture/camera.h"
#include "lib/picture/image.h"
#include "lib/ray/ray.h"
#include "lib/view/view.h"

_Static_assert((int)TWOPASS_DIFFUSE_MESH == (int)VIEW_MESH &&
               (int)TWOPASS_DIFFUSE_DIRECT == (int)VIEW_DIRECT &&
               (int)TWOPASS_DIFFUSE_GATHER == (int)VIEW_GATHER, "methods of the public header");

struct twopass_view twopass_view_defaults(void)
{
	return (struct twopass_view){
		.up = CAMERA_UP, .fov = CAMERA_FOV, .width = CAMERA_WIDTH,
		.height = (int)(CAMERA_WIDTH / CAMERA_ASPECT), .diffuse = TWOPASS_DIFFUSE_DIRECT,
		.samples = VIEW_OPTIONS_DEFAULT.samples };
}

static int frame(const struct model *m, const struct twopass_view *v, struct view_frame *f,
                 struct err *e)
{
	struct camera by_points;
	const struct camera *c = &by_points;

	if (api_within("width", v->width, 1, CAMERA_SIZE_MAX, e) ||
	    api_within("height", v->height, 1, CAMERA_SIZE_MAX, e))
		return -1;
	if (v->camera) {
		int k = picture_camera_find(m, v->camera, e);
		if (k < 0)
			return -1;
		c = &m->camera[k];
	} else if (api_within("fov", v->fov, 1e-3, 179.9, e) ||
	           picture_camera_look_at(v->eye, v->target, v->up, v->fov, &by_points, e)) {
		return -1;
	}
	return picture_camera_frame(c, v->width, v->height, f, e);
}

static void interleave(const struct image *im, float *rgb)
{
	static const char *const colour[] = { "R", "G", "B" };
	const size_t pixels = (size_t)im->width * (size_t)im->height;

	for (size_t k = 0; k < 3; k++) {
		const float *plane = picture_image_plane(im, picture_image_channel(im, colour[k]));
		for (size_t i = 0; i < pixels; i++)
			rgb[3 * i + k] = plane[i];
	}
}

static int render(const struct twopass_scene *s, const struct twopass_view *v, float *rgb,
                  double *relative_error, struct err *e)
{
	struct view_options o = VIEW_OPTIONS_DEFAULT;
	struct view_frame f;
	struct view_stats stats;
	struct image picture = { 0 };
	struct ray_scene *rays = NULL;
	struct view_scene *scene = NULL;

	if (!s->s.irradiance.direct)
		return err_set(e, "the scene is not solved");
	o.samples = v->samples;
	o.threads = api_threads(v->threads);
	int bad = frame(&s->m, v, &f, e) || api_within("samples", o.samples, 1, 1 << 16, e) ||
	          api_within("diffuse", (double)v->diffuse, 0, TWOPASS_DIFFUSE_GATHER, e) ||
	          !(rays = ray_scene_new(&s->m, e)) ||
	          !(scene = view_scene_new(&s->m, &s->s, rays, (enum view_method)v->diffuse,
	                                   o.threads, e)) ||
	          view_render(scene, &f, &o, NULL, &picture, &stats, e);
	if (!bad) {
		interleave(&picture, rgb);
		if (relative_error)
			*relative_error = stats.error;
	}
	picture_image_free(&picture);
	view_scene_free(scene);
	ray_scene_free(rays);
	return bad ? -1 : 0;
}

int twopass_render(const struct twopass_scene *s, const struct twopass_view *view, float *rgb,
                   double *relative_error, struct twopass_error *error)
{
	const struct twopass_view usual = twopass_view_defaults();
	struct err e = { 0 };

	(void)render(s, view ? view : &usual, rgb, relative_error, &e);
	return api_status(&e, error);
}
