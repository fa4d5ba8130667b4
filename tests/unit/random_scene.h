/* Random scenes of things that stand in one another's light. */
#ifndef TEST_RANDOM_SCENE_H
#define TEST_RANDOM_SCENE_H

#include "polygon_scene.h"

enum { ALL_FACES = 63, NO_BOTTOM = 47 };

/* A box of some size about `at`, its frame upright on z = at[2] or turned about. */
static inline void random_box(struct model *m, struct dice *d, const double at[3], double size,
                              int upright, int faces)
{
	double frame[3][3], corner[3];

	roll_frame(d, upright, frame);
	memcpy(corner, at, sizeof corner);
	for (int i = 0; i < 3; i++) {
		double length = size * roll(d, .3, 1);
		for (int k = 0; k < 3; k++) {
			frame[i][k] *= length;
			corner[k] -= i < 2 ? frame[i][k] / 2 : 0;
		}
	}
	scene_cuboid(m, corner, (const double (*)[3])frame, faces, 1, 0);
}

static inline void random_plate(struct model *m, struct dice *d, const double at[3], double size)
{
	double frame[3][3], corner[3];

	roll_frame(d, roll(d, 0, 1) < .3, frame);
	for (int i = 0; i < 2; i++) {
		double length = size * roll(d, .2, 1);
		for (int k = 0; k < 3; k++)
			frame[i][k] *= length;
	}
	v3_mad(at, -.5, frame[0], corner);
	v3_mad(corner, -.5, frame[1], corner);
	scene_grid(m, corner, frame[0], frame[1], 1);
}

static inline void random_tetrahedron(struct model *m, struct dice *d, const double at[3],
                                      double size)
{
	static const int face[4][3] = { { 0, 2, 1 }, { 0, 1, 3 }, { 0, 3, 2 }, { 1, 2, 3 } };
	double frame[3][3], x[4][3];

	roll_frame(d, 0, frame);
	memcpy(x[0], at, sizeof x[0]);
	for (int i = 0; i < 3; i++)
		v3_mad(at, size * roll(d, .3, 1), frame[i], x[i + 1]);
	for (int f = 0; f < 4; f++) {
		double v[3][3];
		for (int i = 0; i < 3; i++)
			memcpy(v[i], x[face[f][i]], sizeof v[i]);
		scene_polygon(m, 3, (const double (*)[3])v);
	}
}

/* A wall across x = at with a gap: upright, or a hole with a lintel and a sill. */
static inline void random_wall(struct model *m, struct dice *d, double x)
{
	double a = roll(d, 0, 1.7), b = a + roll(d, .05, .3), low = roll(d, 0, 1), high = low + .5;

	scene_quad(m, (double[]){ x, 0, 0 }, (double[]){ x, a, 0 }, (double[]){ x, a, 2 },
	           (double[]){ x, 0, 2 });
	scene_quad(m, (double[]){ x, b, 0 }, (double[]){ x, 2, 0 }, (double[]){ x, 2, 2 },
	           (double[]){ x, b, 2 });
	if (roll(d, 0, 1) < .5)
		return;
	scene_quad(m, (double[]){ x, a, 0 }, (double[]){ x, b, 0 }, (double[]){ x, b, low },
	           (double[]){ x, a, low });
	scene_quad(m, (double[]){ x, a, high }, (double[]){ x, b, high }, (double[]){ x, b, 2 },
	           (double[]){ x, a, 2 });
}

/* Two boxes along the axes that share a part of a face, or interpenetrate. */
static inline void random_pair(struct model *m, struct dice *d, const double at[3])
{
	double x = at[0], y = at[1], z = at[2], a = roll(d, .2, .5), b = roll(d, .2, .5);
	double over = roll(d, 0, 1) < .5 ? 0 : roll(d, .02, .15), up = roll(d, -.1, .1);

	scene_block(m, x, y, z, x + a, y + a, z + a, ALL_FACES, 1, 0);
	scene_block(m, x + a - over, y + .05, z + up, x + a + b, y + .05 + b, z + up + b, ALL_FACES,
	            1, 0);
}

static inline void random_thing(struct model *m, struct dice *d)
{
	double at[3], size = roll(d, 0, 1) < .2 ? .03 : roll(d, .2, .9);

	for (int k = 0; k < 3; k++)
		at[k] = roll(d, .4, 1.6);
	if (roll(d, 0, 1) < .25) /* close to a wall */
		at[roll_int(d, 0, 2)] = roll(d, 0, 1) < .5 ? roll(d, .02, .2) : roll(d, 1.8, 1.98);
	switch (roll_int(d, 0, 6)) {
	case 0:
		at[2] = 0;
		random_box(m, d, at, size, 1, NO_BOTTOM);
		break;
	case 1: /* a bottom that is seen from inside is not the floor */
		at[2] = m->material.one_sided[0] ? 0 : .01;
		random_box(m, d, at, size, 1, ALL_FACES);
		break;
	case 2: random_box(m, d, at, .6 * size, 0, ALL_FACES); break;
	case 3: random_plate(m, d, at, size); break;
	case 4: random_tetrahedron(m, d, at, .7 * size); break;
	case 5: random_wall(m, d, at[0]); break;
	case 6: random_pair(m, d, at); break;
	}
}

/* A room of side 2 with 2 to 6 things in it. One-sided where the seed is even. */
static inline int random_scene(struct model *m, uint64_t seed)
{
	struct dice d = { seed, 0 };
	int things = roll_int(&d, 2, 6);

	scene_begin(m, !(seed & 1));
	scene_block(m, 0, 0, 0, 2, 2, 2, ALL_FACES, roll_int(&d, 1, 2), 1);
	for (int i = 0; i < things; i++)
		random_thing(m, &d);
	return scene_end(m);
}

#endif
