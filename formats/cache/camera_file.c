#include "formats/cache/camera_file.h"

#include <math.h>
#include <string.h>

#include "formats/cache/cache.h"
#include "lib/base/mem.h"
#include "lib/data/camera_pose.h"

/* The array of this name with a row for each camera, verified. */
static const void *rows(const struct container *c, const char *name, enum dtype t,
                        uint64_t n, uint64_t width, struct err *e)
{
	uint64_t shape[2] = { n, width };
	const struct container_view *v = file_container_need(c, name, t, width > 1 ? 2 : 1, shape,
	                                                     e);

	return v && file_container_verify(c, v, e) == 0 ? v->data : NULL;
}

static int check(const struct container *c, const struct camera *camera, struct err *e)
{
	double sum = camera->yfov + camera->aspect + camera->xmag + camera->ymag;

	for (int k = 0; k < 16; k++)
		sum += camera->to_world[k];
	if (!isfinite(sum) || (!camera->orthographic && !model_camera_yfov_valid(camera->yfov)))
		return file_container_refuse(c, e, "camera '%s': values out of range", camera->name);
	return 0;
}

int file_camera_get(const struct container *c, struct model *m, struct err *e)
{
	const struct container_view *v = file_container_find(c, "camera_to_world");
	uint64_t n = v && v->dims == 2 ? v->shape[0] : UINT64_MAX;
	const double *to_world = rows(c, "camera_to_world", DT_F64, n, 16, e);
	const double *yfov = rows(c, "camera_yfov", DT_F64, n, 1, e);
	const double *aspect = rows(c, "camera_aspect", DT_F64, n, 1, e);
	const double *xmag = rows(c, "camera_xmag", DT_F64, n, 1, e);
	const double *ymag = rows(c, "camera_ymag", DT_F64, n, 1, e);
	const uint8_t *orthographic = rows(c, "camera_orthographic", DT_U8, n, 1, e);
	char **name = NULL;
	int bad = 0;

	if (!to_world || !yfov || !aspect || !xmag || !ymag || !orthographic ||
	    file_cache_read_names(c, "cameras", &name, (size_t)n, e))
		return -1;
	m->camera = mem_new((size_t)n, sizeof *m->camera, "cameras", e);
	bad = m->camera ? 0 : -1;
	for (; !bad && m->cameras < n; m->cameras++) {
		size_t i = m->cameras;
		struct camera *camera = &m->camera[i];
		*camera = (struct camera){ .name = name[i], .orthographic = orthographic[i],
			.yfov = yfov[i], .aspect = aspect[i], .xmag = xmag[i], .ymag = ymag[i] };
		memcpy(camera->to_world, &to_world[16 * i], sizeof camera->to_world);
		name[i] = NULL; /* now the camera's */
		bad = check(c, camera, e);
	}
	file_cache_names_free(name, (size_t)n);
	return bad;
}
