/* tone: an OpenEXR picture as a PNG to look at. */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/container/history.h"
#include "formats/picture/exr_file.h"
#include "formats/picture/png_file.h"
#include "lib/base/mem.h"
#include "lib/picture/tonemap.h"
#include "tools/common/cli.h"

enum { OPT_NO_LEGEND = 256, OPT_MIN, OPT_MAX };

static const struct cli_option option_table[] = {
	{ 'o', "output", "FILE", "write the PNG to FILE, - for standard output" },
	{ 'e', "exposure", "EV", "multiply by 2^EV (default: auto)" },
	{ 'w', "white", "X", "show X, after exposure, as white (default: 1; 4 with -c)" },
	{ 'c', "compress", NULL, "compress highlights instead of cutting them off" },
	{ 'l', "layer", "NAME", "show layer NAME instead of R, G, B" },
	{ 'b', "bits", "N", "8 or 16 bits for each channel (default: 8)" },
	{ 'f', "false-colour", NULL, "show luminance in false colours, with a legend" },
	{ 's', "scale", "KIND", "log (default) or linear false colours" },
	{ OPT_MIN, "min", "X", "lower end of the false colours (default: from the picture)" },
	{ OPT_MAX, "max", "X", "upper end of the false colours (default: from the picture)" },
	{ OPT_NO_LEGEND, "no-legend", NULL, "leave out the legend" },
	{ 0, NULL, NULL, NULL }
};

struct options {
	const char *input, *output, *layer;
	int automatic, bits, false_colour, no_legend;
	struct tone_curve curve;
	struct tone_scale scale;
	const char *curve_option, *scale_option; /* given, for checks */
};

static void parse_one(const struct cli *c, int letter, struct options *o)
{
	switch (letter) {
	case 'o': o->output = optarg; break;
	case 'l': o->layer = optarg; break;
	case 'f': o->false_colour = 1; break;
	case 'b': o->bits = (int)cli_integer(c, "--bits", optarg, 8, 16); break;
	case 'c':
		o->curve.compress = 1;
		o->curve_option = "--compress";
		break;
	case 'e':
		o->automatic = strcmp(optarg, "auto") == 0;
		if (!o->automatic)
			o->curve.exposure = cli_number(c, "--exposure", optarg, -200, 200);
		o->curve_option = "--exposure";
		break;
	case 'w':
		o->curve.white = cli_number(c, "--white", optarg, 1e-6, 1e6);
		o->curve_option = "--white";
		break;
	case 's':
		o->scale.logarithmic = strcmp(optarg, "log") == 0;
		if (!o->scale.logarithmic && strcmp(optarg, "linear") != 0)
			cli_usage(c, "--scale: '%s' is neither log nor linear", optarg);
		o->scale_option = "--scale";
		break;
	case OPT_MIN:
		o->scale.min = cli_number(c, "--min", optarg, -1e38, 1e38);
		o->scale_option = "--min";
		break;
	case OPT_MAX:
		o->scale.max = cli_number(c, "--max", optarg, -1e38, 1e38);
		o->scale_option = "--max";
		break;
	case OPT_NO_LEGEND:
		o->no_legend = 1;
		o->scale_option = "--no-legend";
		break;
	}
}

static void parse(struct cli *c, int argc, char **argv, struct options *o)
{
	int letter;

	*o = (struct options){ .automatic = 1, .bits = 8, .scale = { NAN, NAN, 1 } };
	while ((letter = cli_next(c, argc, argv)) != -1)
		parse_one(c, letter, o);
	if (argc - optind != 1)
		cli_usage(c, "one picture is needed");
	o->input = argv[optind];
	cli_keep_input(c, o->output, o->input);
	if (!o->output)
		cli_usage(c, "say with --output where the PNG goes");
	if (o->bits != 8 && o->bits != 16)
		cli_usage(c, "--bits: %d is neither 8 nor 16", o->bits);
	if (o->scale_option && !o->false_colour)
		cli_usage(c, "%s needs --false-colour", o->scale_option);
	if (o->curve_option && o->false_colour)
		cli_usage(c, "%s does not go with --false-colour", o->curve_option);
	if (o->scale.logarithmic && (o->scale.min <= 0 || o->scale.max <= 0))
		cli_usage(c, "--min and --max of a logarithmic scale are above 0");
	if (o->scale.min >= o->scale.max)
		cli_usage(c, "--min is not below --max");
	if (o->curve.white == 0)
		o->curve.white = o->curve.compress ? 4 : 1;
}

static int find_layer(const struct options *o, const struct image *im, int channel[3],
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
static int render(const struct cli *c, struct options *o, const struct image *im,
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
		if (o->automatic) {
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

static int write_png(const struct options *o, const struct canvas *canvas,
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
	struct options o;
	struct image im = { 0 };
	struct exr_file_info info = { 0 };
	struct canvas canvas = { 0 };
	struct err e = { 0 };
	char *history = NULL;
	int channel[3], status = 0;

	parse(&c, argc, argv, &o);
	cli_signals();
	if (file_exr_read(o.input, &im, &info, &e) || find_layer(&o, &im, channel, &e) ||
	    render(&c, &o, &im, channel, &canvas, &e) ||
	    !(history = file_history_append(file_exr_info_get(&info, EXR_FILE_HISTORY), argc, argv,
	                                    &e)) ||
	    write_png(&o, &canvas, history, &e))
		status = cli_fail(&c, &e);
	free(history);
	picture_canvas_free(&canvas);
	file_exr_info_free(&info);
	picture_image_free(&im);
	return cli_finish(&c, status);
}
