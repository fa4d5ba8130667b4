/* Writing OpenEXR files. The file is made in memory, because its table of chunks
 * is filled in last and pipes cannot seek, and then put out at once. */
#include <limits.h>
#include <math.h>
#include <openexr.h>
#include <stdlib.h>
#include <string.h>

#include "formats/container/atomic_file.h"
#include "formats/picture/exr_file.h"
#include "lib/base/mem.h"

/* zlib's level, 1 to 9: above 4 they cost much time for few bytes on pictures. No figures were
 * kept; `trace --compression zip` prints the seconds of writing. */
enum { ZIP_LEVEL = 4 };

static const float half_max = 65504.f; /* the largest 16-bit float */

struct output {
	exr_context_t context;
	const char *path;
	const struct image *im;
	int half;
	enum exr_file_compression compression;
	struct array bytes;    /* the file so far */
	float *rows;           /* a chunk of clipped colours, [channels][lines][width] */
	size_t clipped;
	struct err *e;
};

const char *const file_exr_compression_name[] = { "auto", "zip", "zips", "piz", "rle", "none",
	NULL };

static const exr_compression_t compressions[] = {
	[EXR_FILE_AUTO] = EXR_COMPRESSION_ZIP,
	[EXR_FILE_ZIP] = EXR_COMPRESSION_ZIP,
	[EXR_FILE_ZIPS] = EXR_COMPRESSION_ZIPS,
	[EXR_FILE_PIZ] = EXR_COMPRESSION_PIZ,
	[EXR_FILE_RLE] = EXR_COMPRESSION_RLE,
	[EXR_FILE_NONE] = EXR_COMPRESSION_NONE,
};

static void on_error(exr_const_context_t c, exr_result_t code, const char *message)
{
	void *user = NULL;
	struct output *o;

	(void)code;
	if (exr_get_user_data(c, &user) == EXR_ERR_SUCCESS && user) {
		o = user;
		err_set(o->e, "%s: cannot write: %s", o->path, message);
	}
}

static int64_t on_write(exr_const_context_t c, void *user, const void *data, uint64_t size,
                        uint64_t offset, exr_stream_error_func_ptr_t report)
{
	struct output *o = user;
	size_t end;

	if (size > SIZE_MAX - offset)
		return report(c, EXR_ERR_WRITE_IO, "file too large"), -1;
	end = (size_t)(offset + size);
	if (end > o->bytes.n) {
		if (mem_reserve(&o->bytes, end - o->bytes.n, 1, o->e))
			return report(c, EXR_ERR_WRITE_IO, "out of memory"), -1;
		memset((char *)o->bytes.data + o->bytes.n, 0, end - o->bytes.n);
		o->bytes.n = end;
	}
	memcpy((char *)o->bytes.data + offset, data, size);
	return (int64_t)size;
}

static int is_colour(const char *name)
{
	const char *dot = strrchr(name, '.');
	const char *last = dot ? dot + 1 : name;

	return strlen(last) == 1 && strchr("RGB", *last);
}

/* The library's calls return a code and have already reported through on_error. */
static int check(struct output *o, exr_result_t code)
{
	if (code == EXR_ERR_SUCCESS)
		return 0;
	return err_set(o->e, "%s: cannot write: %s", o->path,
	               exr_get_default_error_message(code));
}

static int write_attributes(struct output *o, const struct exr_file_info *info)
{
	exr_attr_m44f_t m;

	if (info->white_luminance > 0 &&
	    check(o, exr_attr_set_float(o->context, 0, "whiteLuminance", info->white_luminance)))
		return -1;
	memcpy(m.m, info->world_to_camera, sizeof m.m);
	if (info->has_world_to_camera &&
	    check(o, exr_attr_set_m44f(o->context, 0, "worldToCamera", &m)))
		return -1;
	for (size_t i = 0; i < info->strings; i++)
		if (check(o, exr_attr_set_string(o->context, 0, info->string[i].name,
		                                 info->string[i].value)))
			return -1;
	return 0;
}

static int write_header(struct output *o, const struct exr_file_info *info)
{
	const struct image *im = o->im;

	if (check(o, exr_set_longname_support(o->context, 1)) ||
	    check(o, exr_add_part(o->context, NULL, EXR_STORAGE_SCANLINE, NULL)) ||
	    check(o, exr_initialize_required_attr_simple(o->context, 0, im->width, im->height,
	                                                 compressions[o->compression])) ||
	    check(o, exr_set_zip_compression_level(o->context, 0, ZIP_LEVEL)))
		return -1;
	for (int c = 0; c < im->channels; c++) {
		exr_pixel_type_t type =
		    o->half && is_colour(im->name[c]) ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;

		if (check(o, exr_add_channel(o->context, 0, im->name[c], type,
		                             EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1)))
			return -1;
	}
	if (info && write_attributes(o, info))
		return -1;
	return check(o, exr_write_header(o->context));
}

/* A channel's rows, clipped to what a half holds. */
static const float *clip_rows(struct output *o, int channel, const float *from, size_t n)
{
	float *to = o->rows + (size_t)channel * n;

	for (size_t i = 0; i < n; i++) {
		to[i] = from[i];
		if (isfinite(from[i]) && fabsf(from[i]) > half_max) {
			to[i] = copysignf(half_max, from[i]);
			o->clipped++;
		}
	}
	return to;
}

/* Points the encoder's channels (in the file's order) to the picture's rows. */
static void set_rows(struct output *o, exr_encode_pipeline_t *p)
{
	const struct image *im = o->im;
	size_t n = (size_t)p->chunk.height * (size_t)im->width;

	for (int c = 0; c < p->channel_count; c++) {
		exr_coding_channel_info_t *ch = &p->channels[c];
		const int channel = picture_image_channel(im, ch->channel_name);
		const float *rows = picture_image_plane(im, channel) +
		                    (size_t)p->chunk.start_y * (size_t)im->width;

		if (ch->data_type == EXR_PIXEL_HALF)
			rows = clip_rows(o, c, rows, n);
		ch->user_data_type = EXR_PIXEL_FLOAT;
		ch->user_bytes_per_element = sizeof *rows;
		ch->user_pixel_stride = sizeof *rows;
		ch->user_line_stride = (int32_t)((size_t)im->width * sizeof *rows);
		ch->encode_from_ptr = (const uint8_t *)rows;
	}
}

/* Has the encoder made a chunk smaller by less than an eighth? Floats that are all different
 * lose a tenth, for a third of the time that a picture takes. */
static int hardly_smaller(const exr_encode_pipeline_t *p)
{
	return p->compressed_bytes > p->packed_bytes - p->packed_bytes / 8;
}

enum { SKIPPED = 7 }; /* chunks left as they are after one that was hardly smaller; a guess */

/* The encoder of chunks, and how it compresses. */
struct encoder {
	exr_encode_pipeline_t pipe;
	exr_result_t (*compress)(exr_encode_pipeline_t *);
	int skip; /* so many chunks are left as they are before compression is tried again */
};

/* Writes the chunk that begins with row y. */
static int write_chunk(struct output *o, int y, struct encoder *c)
{
	exr_chunk_info_t chunk;

	if (check(o, exr_write_scanline_chunk_info(o->context, 0, y, &chunk)))
		return -1;
	if (check(o, y ? exr_encoding_update(o->context, 0, &chunk, &c->pipe)
	               : exr_encoding_initialize(o->context, 0, &chunk, &c->pipe)))
		return -1;
	set_rows(o, &c->pipe);
	if (y == 0) {
		if (check(o, exr_encoding_choose_default_routines(o->context, 0, &c->pipe)))
			return -1;
		c->compress = c->pipe.compress_fn;
	}
	c->pipe.compress_fn = c->skip ? NULL : c->compress;
	if (check(o, exr_encoding_run(o->context, 0, &c->pipe)))
		return -1;
	if (c->skip)
		c->skip--;
	else if (o->compression == EXR_FILE_AUTO && hardly_smaller(&c->pipe))
		c->skip = SKIPPED;
	return 0;
}

static int write_rows(struct output *o)
{
	struct encoder c = { .pipe = EXR_ENCODE_PIPELINE_INITIALIZER };
	int32_t lines;
	int bad = 0;

	if (check(o, exr_get_scanlines_per_chunk(o->context, 0, &lines)))
		return -1;
	if (o->half) {
		o->rows = mem_new((size_t)lines * (size_t)o->im->width,
		                  (size_t)o->im->channels * sizeof *o->rows, "rows", o->e);
		if (!o->rows)
			return -1;
	}
	for (int y = 0; !bad && y < o->im->height; y += lines)
		bad = write_chunk(o, y, &c);
	exr_encoding_destroy(o->context, &c.pipe);
	return bad;
}

/* What the library would not say clearly. */
static int check_image(const char *path, const struct image *im, struct err *e)
{
	if (im->channels > INT16_MAX || (size_t)im->width > INT32_MAX / sizeof *im->pixel)
		return err_set(e, "%s: a picture of width %d with %d channels is too large", path,
		               im->width, im->channels);
	for (int c = 0; c < im->channels; c++) {
		size_t length = strlen(im->name[c]);

		if (length < 1 || length > 255)
			return err_set(e, "%s: channel '%.40s': a name has 1 to 255 bytes", path,
			               im->name[c]);
		if (picture_image_channel(im, im->name[c]) != c)
			return err_set(e, "%s: channel '%s' is given twice", path, im->name[c]);
	}
	return 0;
}

int file_exr_write(const char *path, const struct image *im, const struct exr_file_info *info,
                   const struct exr_file_options *options, size_t *clipped, struct err *e)
{
	exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
	struct err own = { 0 };
	struct output o = { .path = path, .im = im, .e = &own };
	int status = check_image(path, im, &own);

	if (options) {
		o.half = options->half;
		o.compression = options->compression;
	}
	init.error_handler_fn = on_error;
	init.write_fn = on_write;
	init.user_data = &o;
	if (status == 0)
		status = check(&o, exr_start_write(&o.context, path, EXR_WRITE_FILE_DIRECTLY, &init));
	if (status == 0)
		status = write_header(&o, info);
	if (status == 0)
		status = write_rows(&o);
	/* exr_finish may succeed after an earlier failure, and fill the table of
	 * chunks or fail to: `own` knows. */
	if (o.context && exr_finish(&o.context) != EXR_ERR_SUCCESS && status == 0)
		status = err_set(&own, "%s: cannot write", path);
	if (status == 0 && !own.set)
		status = file_atomic_put(path, o.bytes.data, o.bytes.n, &own);
	if (clipped)
		*clipped = o.clipped;
	free(o.rows);
	free(o.bytes.data);
	return own.set ? err_set(e, "%s", own.text) : status;
}
