/* exrcmp: the difference of two OpenEXR pictures in numbers. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/picture/exr_file.h"
#include "lib/base/mem.h"
#include "lib/picture/compare.h"
#include "tools/common/cli.h"

/* What --leave-out may name, each its bit. */
enum { EMITTERS = 1, NOTHING = 2 };

struct request {
	const char *file[2];
	const char *layer, *heat;
	double max_relative; /* negative: not given */
	int json;
	unsigned leave_out;  /* pixels that show these */
};

#define REQUEST struct request

static const char *const left_out[] = { "emitters", "nothing", NULL };

static const struct option_spec options[] = {
	{ 'l', "layer", "NAME", "compare the channels of layer NAME only", TEXT(layer) },
	{ 'm', "max-rel", "X", "exit with 1 when the relative rmse is beyond X",
	  NUMBER(max_relative, 0, INFINITY) },
	{ 'x', "leave-out", "LIST", "leave out pixels that show: emitters,nothing",
	  SET(leave_out, left_out) },
	{ 'd', "heat", "FILE", "write the picture of the differences a - b to FILE", TEXT(heat) },
	{ 'J', "json", NULL, "print JSON", FLAG(json) },
	{ 0 }
};

/* Channels that both pictures have. */
struct pairs {
	int n;
	int *a, *b;
	int colours; /* 1: rgb_a and rgb_b are the layer's R, G, B */
	int rgb_a[3], rgb_b[3];
};

struct pictures {
	struct image im[2];
	struct exr_file_info info[2];
	struct pairs pairs;
	unsigned char *mask; /* of pixels that are left out, or NULL */
};

static void check(const struct cli *c, int operand, struct request *o)
{
	if (c->argc - operand != 2)
		cli_usage(c, "two pictures are needed");
	o->file[0] = c->argv[operand];
	o->file[1] = c->argv[operand + 1];
	if (strcmp(o->file[0], "-") == 0 && strcmp(o->file[1], "-") == 0)
		cli_usage(c, "only one picture can come from standard input");
	if (o->heat && strcmp(o->heat, "-") == 0)
		cli_usage(c, "--heat needs a file; standard output is for the numbers");
}

static int in_layer(const char *channel, const char *layer)
{
	size_t n = layer ? strlen(layer) : 0;

	return !layer || (strncmp(channel, layer, n) == 0 &&
	                  (channel[n] == '.' || channel[n] == 0));
}

static int pair_channels(const struct cli *c, const struct request *o, struct pictures *p,
                         struct err *e)
{
	const struct image *a = &p->im[0], *b = &p->im[1];
	struct pairs *pairs = &p->pairs;

	pairs->a = mem_new((size_t)a->channels, sizeof *pairs->a, "channels", e);
	pairs->b = mem_new((size_t)a->channels, sizeof *pairs->b, "channels", e);
	if (!pairs->a || !pairs->b)
		return -1;
	for (int i = 0; i < a->channels; i++) {
		int j = picture_image_channel(b, a->name[i]);

		if (!in_layer(a->name[i], o->layer))
			continue;
		if (j < 0) {
			cli_note(c, "channel %s is only in %s", a->name[i], o->file[0]);
			continue;
		}
		pairs->a[pairs->n] = i;
		pairs->b[pairs->n++] = j;
	}
	for (int j = 0; j < b->channels; j++)
		if (in_layer(b->name[j], o->layer) && picture_image_channel(a, b->name[j]) < 0)
			cli_note(c, "channel %s is only in %s", b->name[j], o->file[1]);
	if (pairs->n == 0)
		return err_set(e, "%s: has no channel%s%s in common with %s", o->file[0],
		               o->layer ? " of layer " : "", o->layer ? o->layer : "", o->file[1]);
	pairs->colours = picture_image_layer(a, o->layer, pairs->rgb_a) == 3 &&
	                 picture_image_layer(b, o->layer, pairs->rgb_b) == 3;
	return 0;
}

static int read_pictures(const struct cli *c, const struct request *o, struct pictures *p,
                         struct err *e)
{
	for (int i = 0; i < 2; i++)
		if (file_exr_read(o->file[i], &p->im[i], &p->info[i], e))
			return -1;
	if (p->im[0].width != p->im[1].width || p->im[0].height != p->im[1].height)
		return err_set(e, "%s: is %d x %d pixels but %s is %d x %d; render both at one size",
		               o->file[0], p->im[0].width, p->im[0].height, o->file[1],
		               p->im[1].width, p->im[1].height);
	return pair_channels(c, o, p, e);
}

/* Marks the pixels that are to be left out, as either picture tells. */
static int make_mask(const struct request *o, struct pictures *p, struct err *e)
{
	const struct image *a = &p->im[0], *b = &p->im[1];

	if (!o->leave_out)
		return 0;
	p->mask = mem_new((size_t)a->width * (size_t)a->height, 1, "mask", e);
	if (!p->mask)
		return -1;
	if ((o->leave_out & EMITTERS) &&
	    (picture_compare_mask_emitters(a, p->mask) & picture_compare_mask_emitters(b, p->mask)))
		return err_set(e, "%s: no layer tells where emitters are, nor in %s; "
		               "use trace --layers emission", o->file[0], o->file[1]);
	if ((o->leave_out & NOTHING) &&
	    (picture_compare_mask_nothing(a, p->mask) & picture_compare_mask_nothing(b, p->mask)))
		return err_set(e, "%s: no channel tells where nothing is seen, nor in %s; "
		               "use trace --layers Z", o->file[0], o->file[1]);
	return 0;
}

static void print_header(void)
{
	printf("%-16s %12s %12s %12s %12s %12s %12s %12s  %-12s %9s %9s %9s %9s %9s\n", "channel",
	       "rmse", "relative", "bias", "relative", "mean a", "mean b", "max", "at", "50 %",
	       "95 %", "99 %", "pixels", "left out");
}

static void print_row(const char *name, const struct compare *d)
{
	char at[32];

	snprintf(at, sizeof at, "%d,%d", d->max_x, d->max_y);
	printf("%-16s %12.6g %12.6g %12.6g %12.6g %12.6g %12.6g %12.6g  %-12s %9.3g %9.3g %9.3g %9zu "
	       "%9zu\n", name, d->rmse, d->relative_rmse, d->bias, d->relative_bias, d->mean_a,
	       d->mean_b, d->max, d->pixels ? at : "-", d->percentile[0], d->percentile[1],
	       d->percentile[2], d->pixels, d->left_out + d->excluded);
}

static json_t *number(double x)
{
	return isfinite(x) ? json_real(x) : json_null();
}

static json_t *to_json(const struct compare *d)
{
	json_t *j = json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:[i,i], s:I, s:I}", "rmse",
	                 number(d->rmse), "relative_rmse", number(d->relative_rmse), "bias",
	                 number(d->bias), "relative_bias", number(d->relative_bias), "mean_a",
	                 number(d->mean_a), "mean_b", number(d->mean_b), "max", number(d->max),
	                 "max_at", d->max_x, d->max_y, "pixels", (json_int_t)d->pixels, "left_out",
	                 (json_int_t)(d->left_out + d->excluded));
	for (int i = 0; i < COMPARE_PERCENTILES; i++) {
		char name[32];
		snprintf(name, sizeof name, "percentile_%d", picture_compare_percentile[i]);
		json_object_set_new(j, name, number(d->percentile[i]));
	}
	return j;
}

/* Compares, prints, and returns what --max-rel judges in *worst: the colours
 * where there are, else the worst channel. */
static int compare_all(const struct request *o, const struct pictures *p,
                       struct compare *worst, struct err *e)
{
	const struct image *a = &p->im[0], *b = &p->im[1];
	json_t *channels = json_object(), *all = json_pack("{s:s, s:s, s:i, s:i}", "a", o->file[0],
	                                                   "b", o->file[1], "width", a->width,
	                                                   "height", a->height);
	struct compare d;

	if (!o->json)
		print_header();
	if (p->pairs.colours) {
		picture_compare_channels(a, p->pairs.rgb_a, b, p->pairs.rgb_b, 3, p->mask, worst, e);
		json_object_set_new(all, "rgb", to_json(worst));
		if (!o->json)
			print_row("RGB", worst);
	}
	for (int i = 0; i < p->pairs.n; i++) {
		const char *name = a->name[p->pairs.a[i]];

		picture_compare_channels(a, &p->pairs.a[i], b, &p->pairs.b[i], 1, p->mask, &d, e);
		json_object_set_new(channels, name, to_json(&d));
		if (!o->json)
			print_row(name, &d);
		if (!p->pairs.colours &&
		    (i == 0 || d.pixels == 0 || d.relative_rmse > worst->relative_rmse))
			*worst = d;
	}
	json_object_set_new(all, "channels", channels);
	if (o->json && json_dumpf(all, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(17)))
		err_set(e, "cannot write JSON");
	if (o->json)
		putchar('\n');
	json_decref(all);
	return e->set ? -1 : 0;
}

static int write_heat(const struct cli *c, const struct request *o, const struct pictures *p,
                      struct err *e)
{
	struct image heat = { 0 };
	struct exr_file_info info = { 0 };
	char *history = options_history(c, file_exr_info_get(&p->info[0], EXR_FILE_HISTORY), e);
	int status = -1;

	if (history && file_exr_info_set(&info, EXR_FILE_HISTORY, history, e) == 0 &&
	    picture_compare_difference(&p->im[0], p->pairs.a, &p->im[1], p->pairs.b, p->pairs.n, &heat,
	                               e) == 0)
		status = file_exr_write(o->heat, &heat, &info, NULL, NULL, e);
	free(history);
	file_exr_info_free(&info);
	picture_image_free(&heat);
	return status;
}

static int judge(const struct cli *c, const struct request *o, const struct compare *d)
{
	if (d->left_out)
		cli_note(c, "%zu of %zu pixels are not finite in both pictures and were left out",
		         d->left_out, d->left_out + d->excluded + d->pixels);
	if (d->pixels == 0) {
		cli_warn(c, "no pixel is left that is finite in both pictures");
		return 1;
	}
	if (o->max_relative < 0 || d->relative_rmse <= o->max_relative)
		return 0;
	cli_note(c, "relative rmse %g is beyond %g", d->relative_rmse, o->max_relative);
	return 1;
}

int main(int argc, char **argv)
{
	struct cli c = { .program = "exrcmp", .synopsis = "[OPTION]... A.exr B.exr",
		         .about = "Prints the difference of two OpenEXR pictures in numbers.",
		         .options = options };
	struct request o = { .max_relative = -1 };
	struct pictures p = { 0 };
	struct compare worst = { 0 };
	struct err e = { 0 };
	int status;

	check(&c, options_parse(&c, argc, argv, &o), &o);
	cli_signals();
	if (read_pictures(&c, &o, &p, &e) || make_mask(&o, &p, &e) || compare_all(&o, &p, &worst, &e) ||
	    (o.heat && write_heat(&c, &o, &p, &e)))
		status = cli_fail(&c, &e);
	else
		status = judge(&c, &o, &worst);
	for (int i = 0; i < 2; i++) {
		picture_image_free(&p.im[i]);
		file_exr_info_free(&p.info[i]);
	}
	free(p.pairs.a);
	free(p.pairs.b);
	free(p.mask);
	return cli_finish(&c, status);
}
