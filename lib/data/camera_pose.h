/* What a camera in a scene file must satisfy. */
#ifndef TWOPASS_CAMERA_POSE_H
#define TWOPASS_CAMERA_POSE_H

/* The rigid part of an affine column-major matrix: keeps the position, the viewing
 * direction -Z and the half-plane of +Y, drops scale, shear and mirroring. -1 when
 * Y and Z are not independent. */
int model_camera_pose(const double affine[16], double to_world[16]);

/* 1 if a perspective camera can have this vertical field of view: 0 < yfov < pi. */
int model_camera_yfov_valid(double yfov);

#endif
