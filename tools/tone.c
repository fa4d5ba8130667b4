/* tone: an OpenEXR picture as a PNG to look at. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/picture/exr_file.h"
#include "formats/picture/png_file.h"
#include "lib/base/mem.h"
#include "lib/picture/tonemap.h"
#include "tools/common/cli.h"

struct request {
	const char *input, *output, *layer;
	int bits, false_colour, no_legend;
	struct tone_curve curve;    /* exposure NaN: by the picture; white 0: by the curve */
	struct tone_scale scale;
};

#define REQUEST struct request

static const char *const automatic[] = { "auto", NULL };
static const char *const scales[] = { "linear", "log", NULL };

static const struct option_spec option_table[] = {
	{ 'o', "output", "FILE", "write the PNG to FILE, - for standard output", TEXT(output),
	  .role = OPTION_ASIDE },
	{ 'e', "exposure", "EV", "multiply by 2^EV (default: %s)",
	  NUMBER(curve.exposure, -200, 200), .words = automatic },
	{ 'w', "white", "X", "show X, after exposure, as white (default: 1; 4 with -c)",
	  NUMBER(curve.white, 1e-6, 1e6) },
	{ 'c', "compress", NULL, "compress highlights instead of cutting them off",
	  FLAG(curve.compress) },
	{ 'l', "layer", "NAME", "show layer NAME instead of R, G, B", TEXT(layer) },
	{ 'b', "bits", "N", "8 or 16 bits for each channel (default: %s)", INTEGER(bits, 8, 16) },
	{ 'f', "false-colour", NULL, "show luminance in false colours, with a legend",
	  FLAG(false_colour) },
	{ 's', "scale", "KIND", "%s (default) or linear false colours",
	  WORD(scale.logarithmic, scales) },
	{ 0, "min", "X", "lower end of the false colours (default: from the picture)",
	  NUMBER(scale.min, -1e38, 1e38) },
	{ 0, "max", "X", "upper end of the false colours (default: from the picture)",
	  NUMBER(scale.max, -1e38, 1e38) },
	{ 0, "no-legend", NULL, "leave out the legend", FLAG(no_legend) },
	{ 0 }
};

/* Options of the other way of showing a picture. */
static void check_mode(const struct cli *c, const struct request *o)
{
	static const char *const of_scale[] = { "scale", "min", "max", "no-legend" };
	static const char *const of_curve[] = { "exposure", "white", "compress" };

	for (size_t i = 0; i < sizeof of_scale / sizeof *of_scale; i++)
		if (options_given(c, of_scale[i]) && !o->false_colour)
			cli_usage(c, "--%s needs --false-colour", of_scale[i]);
	for (size_t i = 0; i < sizeof of_curve / sizeof *of_curve; i++)
		if (options_given(c, of_curve[i]) && o->false_colour)
			cli_usage(c, "--%s does not go with --false-colour", of_curve[i]);
}

static void settle(const struct cli *c, int operand, struct request *o)
{
	if (c->argc - operand != 1)
		cli_usage(c, "one picture is needed");
	o->input = c->argv[operand];
	cli_keep_input(c, o->output, o->input);
	if (!o->output)
		cli_usage(c, "say with --output where the PNG goes");
	if (o->bits != 8 && o->bits != 16)
		cli_usage(c, "--bits: %d is neither 8 nor 16", o->bits);
	check_mode(c, o);
	if (o->scale.logarithmic && (o->scale.min <= 0 || o->scale.max <= 0))
		cli_usage(c, "--min and --max of a logarithmic scale are above 0");
	if (o->scale.min >= o->scale.max)
		cli_usage(c, "--min is not below --max");
	if (o->curve.white == 0)
		o->curve.white = o->curve.compress ? 4 : 1;
}

static int find_layer(const struct request *o, const struct image *im, int channel[3],
                      struct err *e)
{
	char names[512] = "";

	if (picture_image_layer(im, o->layer, channel))
		return 0;
	if (!o->layer && im->channels == 1) {
		channel[0] = channel[1] = channel[2] = 0;
		return 0;
	}
	for (int i = 0; i < im->channels; i++) {
		size_t n = strlen(names);

		snprintf(names + n, sizeof names - n, " %s", im->name[i]);
	}
	return err_set(e, "%s: has no %s%s; choose with --layer among the channels%s", o->input,
	               o->layer ? "layer " : "R, G, B", o->layer ? o->layer : "", names);
}

/* The picture as it is to be seen. */
static int render(const struct cli *c, struct request *o, const struct image *im,
                  const int channel[3], struct canvas *canvas, struct err *e)
{
	size_t odd, lit;

	if (picture_canvas_new(canvas, im->width, im->height, e))
		return -1;
	if (o->false_colour) {
		struct err why = { 0 };

		if (picture_tonemap_scale(im, channel, &o->scale, &why))
			return err_set(e, "%s: %s", o->input, why.text);
		cli_note(c, "%s scale from %g to %g", o->scale.logarithmic ? "logarithmic" : "linear",
		         o->scale.min, o->scale.max);
		odd = picture_tonemap_false_colour(im, channel, &o->scale, canvas);
		if (!o->no_legend && picture_legend_append(canvas, &o->scale, e))
			return -1;
	} else {
		if (isnan(o->curve.exposure)) {
			o->curve.exposure = picture_tonemap_exposure(im, channel, &lit);
			cli_note(c, "exposure %+.2f EV%s", o->curve.exposure,
			         lit ? "" : " (no pixel is lit)");
		}
		odd = picture_tonemap_curve(im, channel, &o->curve, canvas);
	}
	if (odd)
		cli_warn(c, "%s: %zu pixels are infinite or not a number; they are shown in magenta",
		         o->input, odd);
	return 0;
}

static int write_png(const struct request *o, const struct canvas *canvas,
                     const char *history, struct err *e)
{
	void *rgb = mem_new((size_t)canvas->width * (size_t)canvas->height,
	                    3 * (size_t)o->bits / 8, "the PNG's pixels", e);
	int status = -1;

	if (rgb) {
		picture_canvas_quantise(canvas, o->bits, rgb);
		status = file_png_write(o->output, canvas->width, canvas->height, o->bits, rgb,
		                        history, e);
	}
	free(rgb);
	return status;
}

int main(int argc, char **argv)
{
	struct cli c = { .program = "tone", .synopsis = "[OPTION]... IN.exr -o OUT.png",
		         .about = "Turns an OpenEXR picture into a PNG to look at.",
		         .options = option_table };
	struct request o = { .bits = 8, .curve.exposure = NAN,
		             .scale = { .logarithmic = 1, .min = NAN, .max = NAN } };
	struct image im = { 0 };
	struct exr_file_info info = { 0 };
	struct canvas canvas = { 0 };
	struct err e = { 0 };
	char *history = NULL;
	int channel[3], status = 0;

	settle(&c, options_parse(&c, argc, argv, &o), &o);
	cli_signals();
	if (file_exr_read(o.input, &im, &info, &e) || find_layer(&o, &im, channel, &e) ||
	    render(&c, &o, &im, channel, &canvas, &e) ||
	    !(history = options_history(&c, file_exr_info_get(&info, EXR_FILE_HISTORY), &e)) ||
	    write_png(&o, &canvas, history, &e))
		status = cli_fail(&c, &e);
	free(history);
	picture_canvas_free(&canvas);
	file_exr_info_free(&info);
	picture_image_free(&im);
	return cli_finish(&c, status);
}
