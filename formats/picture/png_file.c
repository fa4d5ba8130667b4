#include "formats/picture/png_file.h"

#include <png.h>
#include <setjmp.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include "formats/container/atomic_file.h"
#include "lib/base/mem.h"

struct output {
	const char *path;
	struct array bytes; /* the file so far */
	struct err *e;
};

static void on_error(png_structp png, png_const_charp message)
{
	struct output *o = png_get_error_ptr(png);

	err_set(o->e, "%s: cannot write: %s", o->path, message);
	png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
	(void)png;
	(void)message;
}

static void on_write(png_structp png, png_bytep data, size_t bytes)
{
	struct output *o = png_get_io_ptr(png);

	if (mem_append(&o->bytes, data, bytes, 1, o->e))
		png_error(png, "out of memory");
}

static void on_flush(png_structp png)
{
	(void)png;
}

static void write_header(png_structp png, png_infop info, int width, int height, int bits,
                         const char *comment)
{
	png_set_IHDR(png, info, (png_uint_32)width, (png_uint_32)height, bits,
	             PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
	             PNG_FILTER_TYPE_DEFAULT);
	png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
	if (comment && *comment) {
		char key[] = "Comment", none[] = "";
		png_text text = { .compression = PNG_ITXT_COMPRESSION_NONE, .key = key,
		                  .lang = none, .lang_key = none };

		/* libpng takes but does not change the text. */
		text.text = (png_charp)(uintptr_t)comment;
		png_set_text(png, info, &text, 1);
	}
	png_write_info(png, info);
	if (bits == 16)
		png_set_swap(png); /* the host is little-endian, PNG is not */
}

/* Everything that may jump back on an error. */
static int encode(png_structp png, png_infop info, int width, int height, int bits,
                  const void *rgb, const char *comment)
{
	const png_byte *row = rgb;

	if (setjmp(png_jmpbuf(png)))
		return -1;
	write_header(png, info, width, height, bits, comment);
	for (int y = 0; y < height; y++)
		png_write_row(png, row + (size_t)y * (size_t)width * 3 * (size_t)(bits / 8));
	png_write_end(png, info);
	return 0;
}

int file_png_write(const char *path, int width, int height, int bits, const void *rgb,
                   const char *comment, struct err *e)
{
	struct output o = { .path = path, .e = e };
	png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &o, on_error, on_warning);
	png_infop info = png ? png_create_info_struct(png) : NULL;
	int status = -1;

	if (info) {
		png_set_write_fn(png, &o, on_write, on_flush);
		status = encode(png, info, width, height, bits, rgb, comment);
	} else {
		err_set(e, "%s: out of memory", path);
	}
	png_destroy_write_struct(&png, &info);
	if (status == 0)
		status = file_atomic_put(path, o.bytes.data, o.bytes.n, e);
	free(o.bytes.data);
	return status;
}
