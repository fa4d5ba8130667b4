/* Patch matrices and the laws that --verify checks. */
#include <float.h>

#include "lib/audit/patch_matrix.h"
#include "lib/audit/side_table.h"
#include "lib/audit/verify.h"
#include "lib/base/constants.h"
#include "tests/unit/fixtures/check.h"
#include "tests/unit/fixtures/small_scene.h"

static const uint8_t sides[] = { 3, 1 };

static struct ff_scene scene_of(const struct model *m)
{
	return (struct ff_scene){ .patches = m->patch.n, .elements = m->element.n,
		.materials = m->material.n, .patch_start = m->patch.start,
		.patch_area = m->patch.area, .patch_sides = sides };
}

static void test_matrix(void **state)
{
	struct model m;
	struct ff f;
	struct patch_matrix pm;
	struct err e = { 0 };
	double row[3], black, escape;

	(void)state;
	small_model(&m);
	small_ff(&f);
	struct ff_scene s = scene_of(&m);
	assert_int_equal(ff_check(&f, &s, &e), 0);
	assert_int_equal(ff_patch_matrix_init(&pm, &f, &s, &e), 0);
	assert_int_equal(pm.sides, 3);
	assert_int_equal(pm.unmodelled, 1);
	ff_patch_matrix_row(&pm, 0, row, &black, &escape);
	assert_near(row[0], 0, 1e-14);
	assert_near(row[1], .25, 1e-14);
	assert_near(row[2], .25, 1e-14);
	assert_near(black, .125, 1e-14);
	assert_near(escape, .375, 1e-14);
	ff_patch_matrix_row(&pm, 2, row, &black, &escape); /* a scaled row */
	assert_near(row[0] + row[1] + row[2] + black + escape, 1, 1e-14);
	ff_patch_matrix_free(&pm);
	f.row.kind[1] = FF_REFLECTED;
	assert_int_equal(ff_patch_matrix_init(&pm, &f, &s, &e), 0);
	ff_patch_matrix_row(&pm, 1, row, &black, &escape);
	assert_true(isnan(row[0]) && isnan(escape));
	ff_patch_matrix_free(&pm);
	ff_free(&f);
	model_free(&m);
}

/* The same factors with patches as receivers make the same matrix. */
static void test_matrix_of_patches(void **state)
{
	const uint32_t column[] = { 1, 2, 2, 0, 2, 2 };
	const float value[] = { .25f, .25f, .125f, .25f, .125f, .5f };
	const uint64_t start[] = { 0, 2, 3, 3, 5, 6 };
	struct model m;
	struct ff elements, patches;
	struct patch_matrix a, b;
	struct verify v;
	struct err e = { 0 };
	double row[2][3], black[2], escape[2];

	(void)state;
	small_model(&m);
	small_ff(&elements);
	small_ff(&patches);
	patches.to_patches = 1;
	patches.entries = 6;
	memcpy(patches.column, column, sizeof column);
	memcpy(patches.value, value, sizeof value);
	memcpy(patches.block.start, start, sizeof start);
	struct ff_scene s = scene_of(&m);
	assert_int_equal(ff_check(&patches, &s, &e), 0);
	assert_int_equal(ff_verify(&patches, &s, &v, &e), 0);
	assert_int_equal(ff_patch_matrix_init(&a, &elements, &s, &e), 0);
	assert_int_equal(ff_patch_matrix_init(&b, &patches, &s, &e), 0);
	for (size_t i = 0; i < 3; i++) {
		given("i %zu", i);
		ff_patch_matrix_row(&a, i, row[0], &black[0], &escape[0]);
		ff_patch_matrix_row(&b, i, row[1], &black[1], &escape[1]);
		assert_memory_equal(row[0], row[1], sizeof row[0]);
		assert_that(black[0], ==, black[1]);
		assert_that(escape[0], ==, escape[1]);
	}
	ff_patch_matrix_free(&a);
	ff_patch_matrix_free(&b);
	ff_free(&elements);
	ff_free(&patches);
	model_free(&m);
}

/* Two plates of areas 1 and 2 that see only each other: F_01 = .5, F_10 = .25. */
static void exchange_of(double f01, double f10, double error, uint32_t rays, double residual,
                        struct verify *v)
{
	uint32_t start[] = { 0, 1, 2 }, side[] = { 0, 2 }, samples[] = { rays, rays }, chain[] = { 0, 0 };
	uint32_t column[] = { 2, 0 };
	double area[] = { 1, 2 }, scale[] = { 1, 1 }, zero[] = { 0, 0 };
	float errors[] = { (float)error, (float)error }, residuals[] = { (float)residual, 0 };
	double value[] = { f01, f10 }, escape[] = { 1 - f01, 1 - f10 };
	uint64_t row_block[] = { 0, 1, 2 }, block_start[] = { 0, 1, 2 }, arrival[] = { 0, 0, 0 };
	uint64_t chain_start[] = { 0, 0 };
	uint8_t kind[] = { FF_DIFFUSE, FF_DIFFUSE }, front[] = { 1, 1 };
	const struct ff f = { .chain.n = 1, .chain.most = 2, .chain.start = chain_start, .row.n = 2, .row.side = side,
		.row.kind = kind, .row.samples = samples, .row.scale = scale, .row.residual = residuals,
		.row.error = errors, .row.block = row_block, .block.n = 2, .block.chain = chain,
		.block.start = block_start, .block.escape = escape, .block.black = zero,
		.block.lost = zero, .block.cut = zero, .block.arrival = arrival, .entries = 2,
		.column = column, .value64 = value, .patch_end = 2, .shard = 1, .shards = 1 };
	const struct ff_scene s = { 2, 2, 1, 0, start, area, front };
	struct err e = { 0 };

	assert_int_equal(ff_check(&f, &s, &e), 0);
	assert_int_equal(ff_verify(&f, &s, v, &e), 0);
}

static void exchange(double f01, double f10, double error, struct verify *v)
{
	exchange_of(f01, f10, error, 1, 0, v);
}

static int all_good(const struct verify *v)
{
	for (size_t i = 0; i < v->n; i++)
		if (!verify_good(&v->item[i]))
			return 0;
	return 1;
}

static void test_reciprocity(void **state)
{
	struct verify v;

	(void)state;
	exchange(.5, .25, 0, &v); /* exact formulas state no error */
	assert_true(all_good(&v));
	exchange(.5, .2500001, 0, &v); /* float32 rounding */
	assert_true(all_good(&v));
	exchange(.5, .26, 0, &v);
	assert_false(all_good(&v));
	exchange(.5, .26, .01, &v); /* within what is stated */
	assert_true(all_good(&v));
	exchange(.5, .4, .01, &v);
	assert_false(all_good(&v));
	exchange(.5, 0, .01, &v);
	assert_false(all_good(&v));
}

/* What a row by formula misses must be within what it states; rays always close. */
static void test_residual(void **state)
{
	struct verify v;

	(void)state;
	exchange_of(.5, .25, .001, 0, .0009, &v);
	assert_true(all_good(&v));
	exchange_of(.5, .25, .001, 0, -.0011, &v);
	assert_false(all_good(&v));
	exchange_of(.5, .25, .001, 1, .5, &v);
	assert_true(all_good(&v));
}

static void test_ledger(void **state)
{
	struct model m;
	struct solution s;
	struct verify v;

	(void)state;
	small_model(&m);
	small_solution(&s, &m);
	solution_verify(&m, &s, &v);
	assert_that(v.item[0].value, <=, 4 * DBL_EPSILON);
	s.ledger[LEDGER_ESCAPED * 3 + 1] += 1e-10;
	solution_verify(&m, &s, &v);
	assert_false(verify_good(&v.item[0]));
	solution_free(&s);
	model_free(&m);
}

static void test_side_rows(void **state)
{
	struct model m;
	struct solution s;
	struct side_row front, back;

	(void)state;
	small_model(&m);
	small_solution(&s, &m);
	solution_side_row(&m, &s, 0, &front);
	solution_side_row(&m, &s, 1, &back);
	assert_near(front.area, .25, 1e-14);
	assert_near(front.centre[0], .5, 1e-14);
	assert_near(front.centre[1], 1. / 3, 1e-14);
	assert_near(front.normal[2], 1, 1e-14);
	assert_near(back.normal[2], -1, 1e-14);
	assert_false(signbit(back.normal[0]));
	assert_near(back.h[0], (.5 + .25 + .125) * 3, 1e-14); /* the ramps at row 1, band 0 */
	assert_near(back.m[0], .5 * back.h[0], 1e-14);
	solution_side_row(&m, NULL, 4, &front);
	assert_near(front.e[0], 100 * PI, 1e-14);
	solution_free(&s);
	model_free(&m);
}

/* Eight elements of one patch that sees itself, in two spans. */
static void spans(uint32_t first0, uint32_t count0, uint32_t first1, uint32_t count1,
                  const char *message)
{
	uint32_t start[] = { 0, 8 }, side[] = { 0 }, samples[] = { 1 }, chain[] = { 0 };
	uint32_t column[] = { first0, count0, first1, count1 };
	double area[] = { 1 }, one[] = { 1 }, zero[] = { 0 };
	float value[8] = { .125f, .125f, .125f, .125f, .125f, .125f, .125f, .125f }, nought[] = { 0 };
	uint64_t row_block[] = { 0, 1 }, entries[] = { 0, 8 }, words[] = { 1 }, none[] = { 0, 0 };
	uint8_t kind[] = { FF_DIFFUSE }, sides2[] = { 3 };
	const struct ff f = { .chain.n = 1, .chain.most = 2, .chain.start = none, .row.n = 1, .row.side = side,
		.row.kind = kind, .row.samples = samples, .row.scale = one, .row.residual = nought,
		.row.error = nought, .row.block = row_block, .block.n = 1, .block.chain = chain,
		.block.start = entries, .block.column = words, .block.escape = zero,
		.block.black = zero, .block.lost = zero, .block.cut = zero, .block.arrival = none,
		.entries = 8, .columns = 4, .column = column, .value = value, .patch_end = 1,
		.shard = 1, .shards = 1 };
	const struct ff_scene s = { 1, 8, 1, 0, start, area, sides2 };
	struct err e = { 0 };

	if (ff_check(&f, &s, &e) != (message ? -1 : 0) || (message && !strstr(e.text, message)))
		fail_msg("'%s' instead of '%s'", e.set ? e.text : "accepted",
		         message ? message : "accepted");
}

static void test_spans(void **state)
{
	(void)state;
	spans(0, 4, 8, 4, NULL);
	spans(4, 6, 1, 2, NULL); /* fronts, then backs of the patch */
	spans(0, 4, 6, 4, "array column: value 2 is out of order");
	spans(8, 4, 0, 4, "array column: value 2 is out of order");
	spans(1, 4, 0, 4, "array column: value 2 is out of order");
	spans(16, 4, 8, 4, "array column: value 0 is 16, which must be below 16");
	spans(0, 0, 8, 4, "array column: value 1 is 0 and counts columns");
	spans(0, 4, 8, 5, "array column: value 3 is 5, with which 5 columns end beyond 16");
	spans(0, 4, 8, UINT32_MAX, "array column: value 3 is 4294967295, with which");
	spans(0, 5, 1, 4, "array column: value 3 is 4, with which block 0 has more columns");
	spans(0, 4, 8, 3, "array block_column: block 0 ends beyond the last column");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_matrix),
		cmocka_unit_test(test_matrix_of_patches),
		cmocka_unit_test(test_spans),
		cmocka_unit_test(test_reciprocity),
		cmocka_unit_test(test_residual),
		cmocka_unit_test(test_ledger),
		cmocka_unit_test(test_side_rows),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
