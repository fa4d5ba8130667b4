#include "lib/data/camera_pose.h"

#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/vec.h"

int model_camera_pose(const double affine[16], double to_world[16])
{
	double right[3], up[3], back[3];

	memcpy(up, affine + 4, sizeof up);
	memcpy(back, affine + 8, sizeof back);
	if (!(v3_normalise(up) > 0) || !(v3_normalise(back) > 0))
		return -1;
	v3_cross(up, back, right);
	if (!(v3_normalise(right) > 0))
		return -1;
	v3_cross(back, right, up);
	memset(to_world, 0, 16 * sizeof *to_world);
	memcpy(to_world, right, sizeof right);
	memcpy(to_world + 4, up, sizeof up);
	memcpy(to_world + 8, back, sizeof back);
	memcpy(to_world + 12, affine + 12, 3 * sizeof *to_world);
	to_world[15] = 1;
	return 0;
}

int model_camera_yfov_valid(double yfov)
{
	return yfov > 0 && yfov < PI;
}
