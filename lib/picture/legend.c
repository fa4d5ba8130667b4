/* The legend of false colours: a bar and numbers. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "lib/picture/tonemap.h"

/* Dots of a glyph: the smallest that digits can be told apart in. Ticks at most, and rows of
 * pixels at least: what is easily read, and two numbers with room between; guesses by eye, as are
 * the distances in draw_legend. */
enum { GLYPH_WIDTH = 5, GLYPH_HEIGHT = 7, TICKS_MAX = 16, ROWS_MIN = 40 };

/* Rows of pixels for each that a dot is high: 1 up to that many. A guess by eye. */
enum { ROWS_A_DOT = 500 };

/* Of a value or a range: what powers of ten are off by rounding, and more. */
static const double rounded = 1e-9;

static const float white[3] = { 1, 1, 1 };

/* Rows from the top, the leftmost dot is 16. */
static const struct {
	char c;
	unsigned char row[GLYPH_HEIGHT];
} glyphs[] = {
	{ '0', { 14, 17, 17, 21, 17, 17, 14 } }, { '1', { 4, 12, 4, 4, 4, 4, 14 } },
	{ '2', { 14, 17, 1, 6, 8, 16, 31 } },    { '3', { 30, 1, 1, 14, 1, 1, 30 } },
	{ '4', { 2, 6, 10, 18, 31, 2, 2 } },     { '5', { 31, 16, 30, 1, 1, 17, 14 } },
	{ '6', { 14, 16, 16, 30, 17, 17, 14 } }, { '7', { 31, 1, 2, 2, 4, 4, 4 } },
	{ '8', { 14, 17, 17, 14, 17, 17, 14 } }, { '9', { 14, 17, 17, 15, 1, 1, 14 } },
	{ '.', { 0, 0, 0, 0, 0, 12, 12 } },      { '-', { 0, 0, 0, 14, 0, 0, 0 } },
	{ '+', { 0, 4, 4, 31, 4, 4, 0 } },       { 'e', { 0, 0, 14, 17, 31, 16, 14 } },
};

static void fill(struct canvas *c, int x0, int y0, int width, int height, const float rgb[3])
{
	for (int y = y0 > 0 ? y0 : 0; y < y0 + height && y < c->height; y++)
		for (int x = x0 > 0 ? x0 : 0; x < x0 + width && x < c->width; x++)
			memcpy(c->rgb + 3 * ((size_t)y * (size_t)c->width + (size_t)x), rgb,
			       3 * sizeof *rgb);
}

/* One dot of a glyph is dot x dot pixels. */
static void draw_text(struct canvas *c, int x, int y, int dot, const char *text)
{
	for (; *text; text++, x += (GLYPH_WIDTH + 1) * dot)
		for (size_t g = 0; g < sizeof glyphs / sizeof *glyphs; g++)
			for (int i = 0; glyphs[g].c == *text && i < GLYPH_WIDTH * GLYPH_HEIGHT; i++)
				if (glyphs[g].row[i / GLYPH_WIDTH] & 16 >> i % GLYPH_WIDTH)
					fill(c, x + i % GLYPH_WIDTH * dot,
					     y + i / GLYPH_WIDTH * dot, dot, dot, white);
}

/* Multiples of 1, 2 or 5 times a power of ten. Returns how many, at most `most`. */
static int linear_ticks(const struct tone_scale *s, int most, double *tick)
{
	static const double steps[] = { 1, 2, 5 };
	int power = (int)floor(log10((s->max - s->min) / most));
	double slack = rounded * (s->max - s->min);

	for (int i = 0; i < 30; i++) {
		double step = steps[i % 3] * pow(10, power + i / 3);
		double first = ceil((s->min - slack) / step), last = floor((s->max + slack) / step);

		if (last - first + 1 > most)
			continue;
		int n = last < first ? 0 : (int)(last - first + 1);
		for (int k = 0; k < n; k++)
			tick[k] = (first + k) * step + 0.; /* no -0 */
		return n;
	}
	return 0;
}

/* 1, 2 and 5 times the powers of ten in the range; else 1 and 3; else every power;
 * else every second one, and so on. */
static int logarithmic_ticks(const struct tone_scale *s, int most, double *tick)
{
	static const struct {
		int n;
		double step[3];
	} sets[] = { { 3, { 1, 2, 5 } }, { 2, { 1, 3, 0 } }, { 1, { 1, 0, 0 } } };
	int low = (int)floor(log10(s->min)), high = (int)ceil(log10(s->max));

	for (int i = 0; i < 3 + high - low; i++) {
		int set = i < 2 ? i : 2, stride = i < 3 ? 1 : i - 1, n = 0;

		for (int d = low; d <= high; d += stride) {
			for (int k = 0; k < sets[set].n; k++) {
				double v = sets[set].step[k] * pow(10, d);

				if (v < s->min * (1 - rounded) || v > s->max * (1 + rounded))
					continue;
				if (n < most)
					tick[n] = v;
				n++;
			}
		}
		if (n <= most)
			return n;
	}
	return 0;
}

static int find_ticks(const struct tone_scale *s, int most, double *tick)
{
	int n = s->logarithmic ? logarithmic_ticks(s, most, tick) : linear_ticks(s, most, tick);

	if (n >= 2)
		return n;
	tick[0] = s->min;
	tick[1] = s->max;
	return 2;
}

/* The bar and its numbers from column x on, for a canvas of the given height. */
static void draw_legend(struct canvas *c, int x, int dot, const struct tone_scale *s,
                        const double *tick, int ticks)
{
	int top = 6 * dot, bottom = c->height - 6 * dot, bar = 12 * dot;
	float rgb[3];
	char text[32];

	fill(c, x - dot, top - dot, bar + 2 * dot, bottom - top + 2 * dot, white);
	for (int y = top; y < bottom; y++) {
		picture_tonemap_colour((bottom - 1 - y) / (double)(bottom - 1 - top), rgb);
		fill(c, x, y, bar, 1, rgb);
	}
	for (int i = 0; i < ticks; i++) {
		double t = picture_tonemap_position(s, tick[i]);
		int y = bottom - 1 - (int)lround(t * (bottom - 1 - top));

		fill(c, x + bar + dot, y - dot / 2, 3 * dot, dot, white);
		snprintf(text, sizeof text, "%g", tick[i]);
		draw_text(c, x + bar + 6 * dot, y - GLYPH_HEIGHT * dot / 2, dot, text);
	}
}

int picture_legend_append(struct canvas *c, const struct tone_scale *s, struct err *e)
{
	int height = c->height < ROWS_MIN ? ROWS_MIN : c->height;
	int dot = 1 + height / ROWS_A_DOT, characters = 0;
	int most = (height - 12 * dot) / (2 * GLYPH_HEIGHT * dot);
	double tick[TICKS_MAX];
	int ticks = find_ticks(s, most > TICKS_MAX ? TICKS_MAX : most, tick);
	struct canvas wide;

	for (int i = 0; i < ticks; i++) {
		int n = snprintf(NULL, 0, "%g", tick[i]);

		characters = n > characters ? n : characters;
	}
	const int extra = (27 + characters * (GLYPH_WIDTH + 1)) * dot;
	if (picture_canvas_new(&wide, c->width + extra, height, e))
		return -1;
	for (int y = 0; y < c->height; y++)
		memcpy(wide.rgb + 3 * (size_t)y * (size_t)wide.width,
		       c->rgb + 3 * (size_t)y * (size_t)c->width,
		       3 * (size_t)c->width * sizeof *c->rgb);
	draw_legend(&wide, c->width + 6 * dot, dot, s, tick, ticks);
	picture_canvas_free(c);
	*c = wide;
	return 0;
}
