/* Rooms of lobes, mirrors, panes and lamps drawn at random: what pictures state of the noise of
 * lobes, and that this has no bias. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "tests/unit/fixtures/stage.h"

#include "lib/base/rng.h"

/* ROOMS: as many as take some seconds. LAMPS: more in one room than formulas look at one by one. */
enum { ROOMS = 16, WALLS = 6, SHEETS = 2, LAMPS = 60, WIDE = 14, HIGH = 10 };

static double draw(struct rng *r, double low, double high)
{
	return low + (high - low) * rng_uniform(r);
}

static double draw_exponent(struct rng *r)
{
	return 2 * pow(150, rng_uniform(r));
}

/* A wall: matt, glossy or, at most one, a mirror. 1 if it is that. */
static int paint_wall(struct model *m, size_t material, struct rng *r, int mirror)
{
	double kind = rng_uniform(r), rho = draw(r, .2, .7);

	if (kind < .4)
		set(m, material, FRONT, draw(r, 0, .3), 0, rho, 0, draw_exponent(r));
	else if (kind < .55 && mirror)
		set(m, material, FRONT, 0, 0, rho, 0, (double)INFINITY);
	else
		set(m, material, FRONT, rho, 0, 0, 0, 1);
	return kind >= .4 && kind < .55;
}

/* A sheet across the room: frosted, or a clear pane. */
static void put_sheet(struct model *m, size_t material, struct rng *r)
{
	double z = draw(r, .2, .7), slant = draw(r, -.1, .1), x = draw(r, .05, .4);
	double o[3] = { x, .02, z - slant }, across[3] = { .5, 0, 0 };
	double up[3] = { 0, draw(r, .4, .6), 2 * slant }, k = draw_exponent(r);
	double tau = draw(r, .3, .6), rho = draw(r, 0, .3);

	if (rng_uniform(r) < .3)
		k = (double)INFINITY;
	for (int side = 0; side < 2; side++)
		set(m, material, side, 0, 0, rho, tau, k);
	grid_quad(m, 1, (uint32_t)material, o, across, up);
}

static void put_lamps(struct model *m, size_t material, struct rng *r, int lamps)
{
	double half = draw(r, .04, .12) / sqrt(lamps);

	set(m, material, FRONT, 0, 0, 0, 0, 1);
	for (int i = 0; i < lamps; i++) {
		double o[3] = { draw(r, .1, .9) - half, .97, draw(r, .1, .9) - half };
		double x[3] = { 2 * half, 0, 0 }, z[3] = { 0, 0, 2 * half };
		grid_quad(m, 1, (uint32_t)material, o, x, z);
	}
}

static void make_room(struct stage *t, uint64_t seed)
{
	static const int lamps[] = { 1, 2, 5, LAMPS };
	static const double lo[3] = { 0, 0, 0 }, hi[3] = { 1, 1, 1 };
	static const uint32_t of[WALLS] = { 0, 1, 2, 3, 4, 5 };
	struct rng r = rng_seed(seed, 0);
	int mirror = 1, some = lamps[rng_next(&r) % 4], sheets = (int)(rng_next(&r) % (SHEETS + 1));

	*t = (struct stage){ 0 };
	grid_new(&t->m, (size_t)(WALLS + SHEETS + LAMPS), 3, WALLS + SHEETS + 1, 1);
	t->m.lobe = rng_next(&r) % 2 ? LOBE_RECIPROCAL : LOBE_PAPER;
	for (size_t i = 0; i < WALLS; i++)
		mirror &= !paint_wall(&t->m, i, &r, mirror);
	grid_box(&t->m, 3, of, lo, hi);
	for (size_t i = 0; i < (size_t)sheets; i++)
		put_sheet(&t->m, WALLS + i, &r);
	put_lamps(&t->m, WALLS + SHEETS, &r, some);
	memset(t->m.material.emission, 0, 2 * t->m.material.n * sizeof *t->m.material.emission);
	t->m.material.emission[2 * (WALLS + SHEETS)] = 1000;
	stage_end(t, 0);
	for (size_t e = 0; e < t->m.element.n; e++)
		t->s.irradiance.indirect[2 * e] = draw(&r, 0, 20);
	use_method(t, VIEW_MESH);
}

/* Squared errors of a picture by default samples, stated and true, and what it differs in the mean
 * with its standard error, relative. */
struct judged {
	double stated, off, bias, error;
};

static struct judged judge(const struct stage *t)
{
	struct view_frame f = frame(.45, .55, .95, .5, .3, 0, WIDE, HIGH);
	struct view_options o = options();
	struct judged j = { 0 };
	struct image a, b;
	double all = 0, shown = 0;

	o.layers = VIEW_ERROR | VIEW_EMISSION;
	o.lobe_samples = VIEW_LOBE_ENOUGH;
	render(t, &f, &o, &a);
	o.lobe_samples = 512;
	render(t, &f, &o, &b);
	const float *stated = picture_image_plane(&a, picture_image_channel(&a, "error.R"));
	const float *noise = picture_image_plane(&b, picture_image_channel(&b, "error.R"));
	const float *lamp = picture_image_plane(&a, picture_image_channel(&a, "emission.R"));
	for (size_t i = 0; i < (size_t)WIDE * HIGH; i++) {
		double off = (double)a.pixel[i] - (double)b.pixel[i], left = (double)noise[i];
		if (lamp[i] > 0)
			continue;
		j.stated += (double)stated[i] * (double)stated[i];
		j.off += off * off - left * left;
		j.bias += off;
		j.error += (double)stated[i] * (double)stated[i] + left * left;
		all += (double)b.pixel[i];
		shown++;
	}
	assert_that(shown, >, 0);
	j.bias /= all;
	j.error = sqrt(j.error) / all;
	picture_image_free(&a);
	picture_image_free(&b);
	return j;
}

static void test_rooms(void **state)
{
	double squares = 0, rooms = 0;
	(void)state;

	for (uint64_t seed = 0; seed < ROOMS; seed++) {
		given("room %d", (int)seed);
		struct stage t;
		make_room(&t, seed);
		struct judged j = judge(&t);
		stage_free(&t);
		if (!(j.stated > 0))
			continue;
		double ratio = sqrt(fmax(0, j.off) / j.stated);
		printf("# room %d: true %.2f of the stated error, bias %+.2f %% +- %.2f\n", (int)seed,
		       ratio, 100 * j.bias, 100 * j.error);
		assert_that(ratio, <, 2);
		assert_that(fabs(j.bias), <, .005 + 3 * j.error);
		squares += ratio * ratio;
		rooms++;
	}
	printf("# rms %.2f of %g rooms\n", sqrt(squares / rooms), rooms);
	assert_that(rooms, >, ROOMS / 2);
	assert_that(squares / rooms, >, .7 * .7);
	assert_that(squares / rooms, <, 1.4 * 1.4);
}

int main(void)
{
	const struct CMUnitTest tests[] = { slow_unit_test(test_rooms) };

	return cmocka_run_group_tests(tests, NULL, NULL);
}
