/* Reading OpenEXR files that nobody vouches for. */
#include <errno.h>
#include <fcntl.h>
#include <openexr.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "formats/picture/exr_file.h"
#include "lib/base/mem.h"

/* Pixels either way (as CAMERA_SIZE_MAX) and channels: beyond this a header is wrong or the
 * picture is not ours to look at. Guesses. */
enum { SIZE_LIMIT = 65536, CHANNEL_LIMIT = 4096 };

struct input {
	exr_context_t context;
	const char *path;
	int fd;
	struct array bytes;      /* the whole file where it cannot be sought in */
	int64_t size;
	exr_storage_t storage;
	exr_attr_box2i_t window; /* data window */
	int width, height;
	const exr_attr_chlist_t *channels;
	struct err *e;
};

static void on_error(exr_const_context_t c, exr_result_t code, const char *message)
{
	void *user = NULL;
	struct input *in;

	(void)code;
	if (exr_get_user_data(c, &user) == EXR_ERR_SUCCESS && user) {
		in = user;
		err_set(in->e, "%s: broken OpenEXR file: %s", in->path, message);
	}
}

static int64_t on_read(exr_const_context_t c, void *user, void *buffer, uint64_t size,
                       uint64_t offset, exr_stream_error_func_ptr_t report)
{
	struct input *in = user;
	uint64_t done = 0;

	if (offset >= (uint64_t)in->size)
		size = 0;
	else if (size > (uint64_t)in->size - offset)
		size = (uint64_t)in->size - offset;
	if (in->bytes.data) {
		memcpy(buffer, (char *)in->bytes.data + offset * (size > 0), size);
		return (int64_t)size;
	}
	while (done < size) {
		ssize_t n = pread(in->fd, (char *)buffer + done, size - done,
		                  (off_t)(offset + done));

		if (n < 0 && errno == EINTR)
			continue;
		if (n < 0)
			return report(c, EXR_ERR_READ_IO, "%s", strerror(errno)), -1;
		if (n == 0)
			break;
		done += (uint64_t)n;
	}
	return (int64_t)done;
}

static int64_t on_size(exr_const_context_t c, void *user)
{
	(void)c;
	return ((struct input *)user)->size;
}

/* The library's calls return a code and mostly have reported through on_error. */
static int check(struct input *in, exr_result_t code)
{
	if (code == EXR_ERR_SUCCESS)
		return 0;
	return err_set(in->e, "%s: broken OpenEXR file: %s", in->path,
	               exr_get_default_error_message(code));
}

static int read_pipe(struct input *in)
{
	enum { STEP = 1 << 16 }; /* bytes, what a pipe holds */
	ssize_t n;

	do {
		if (mem_reserve(&in->bytes, STEP, 1, in->e))
			return -1;
		n = read(in->fd, (char *)in->bytes.data + in->bytes.n, STEP);
		if (n > 0)
			in->bytes.n += (size_t)n;
	} while (n > 0 || (n < 0 && errno == EINTR));
	if (n < 0)
		return err_set(in->e, "%s: cannot read: %s", in->path, strerror(errno));
	in->size = (int64_t)in->bytes.n;
	return 0;
}

static int open_bytes(struct input *in)
{
	static const unsigned char magic[4] = { 0x76, 0x2f, 0x31, 0x01 };
	unsigned char head[4] = { 0 };
	struct stat st;

	in->fd = strcmp(in->path, "-") == 0 ? STDIN_FILENO : open(in->path, O_RDONLY | O_CLOEXEC);
	if (in->fd < 0 || fstat(in->fd, &st) != 0)
		return err_set(in->e, "%s: cannot open: %s", in->path, strerror(errno));
	if (S_ISDIR(st.st_mode))
		return err_set(in->e, "%s: is a directory; an OpenEXR file is needed", in->path);
	in->size = st.st_size;
	if ((!S_ISREG(st.st_mode) || in->fd == STDIN_FILENO) && read_pipe(in))
		return -1;
	if (in->size >= 4)
		on_read(NULL, in, head, sizeof head, 0, NULL);
	if (memcmp(head, magic, sizeof magic) != 0)
		return err_set(in->e, "%s: not an OpenEXR file", in->path);
	return 0;
}

static int check_channels(struct input *in)
{
	if (check(in, exr_get_channels(in->context, 0, &in->channels)))
		return -1;
	if (in->channels->num_channels < 1 || in->channels->num_channels > CHANNEL_LIMIT)
		return err_set(in->e, "%s: %d channels; 1 to %d are supported", in->path,
		               in->channels->num_channels, CHANNEL_LIMIT);
	for (int c = 0; c < in->channels->num_channels; c++) {
		const exr_attr_chlist_entry_t *ch = &in->channels->entries[c];

		if (ch->x_sampling != 1 || ch->y_sampling != 1)
			return err_set(in->e, "%s: channel %s is subsampled, which is not supported",
			               in->path, ch->name.str);
		if ((unsigned)ch->pixel_type >= EXR_PIXEL_LAST_TYPE)
			return err_set(in->e, "%s: channel %s is of an unknown type", in->path,
			               ch->name.str);
	}
	return 0;
}

static int check_parts(struct input *in)
{
	int parts = 0;

	if (check(in, exr_get_count(in->context, &parts)))
		return -1;
	if (parts != 1)
		return err_set(in->e, "%s: has %d parts; only single-part files are supported",
		               in->path, parts);
	if (check(in, exr_get_storage(in->context, 0, &in->storage)))
		return -1;
	if (in->storage != EXR_STORAGE_SCANLINE && in->storage != EXR_STORAGE_TILED)
		return err_set(in->e, "%s: holds deep data, which are not supported", in->path);
	return 0;
}

static int check_header(struct input *in)
{
	int64_t w, h;

	if (check_parts(in) || check(in, exr_get_data_window(in->context, 0, &in->window)))
		return -1;
	w = (int64_t)in->window.max.x - in->window.min.x + 1;
	h = (int64_t)in->window.max.y - in->window.min.y + 1;
	if (w < 1 || h < 1 || w > SIZE_LIMIT || h > SIZE_LIMIT)
		return err_set(in->e, "%s: data window of %lld x %lld pixels; at most %d x %d are "
		               "supported", in->path, (long long)w, (long long)h, SIZE_LIMIT,
		               SIZE_LIMIT);
	in->width = (int)w;
	in->height = (int)h;
	return check_channels(in);
}

static int open_input(struct input *in)
{
	exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;

	init.error_handler_fn = on_error;
	init.read_fn = on_read;
	init.size_fn = on_size;
	init.user_data = in;
	init.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
	if (open_bytes(in) || check(in, exr_start_read(&in->context, in->path, &init)))
		return -1;
	return check_header(in);
}

static void close_input(struct input *in)
{
	if (in->context)
		exr_finish(&in->context);
	if (in->fd > STDIN_FILENO)
		close(in->fd);
	free(in->bytes.data);
}

/* ---- attributes ---- */

static int read_attributes(struct input *in, struct exr_file_info *info)
{
	int32_t n = 0;
	const exr_attribute_t *a;

	if (check(in, exr_get_attribute_count(in->context, 0, &n)))
		return -1;
	for (int32_t i = 0; i < n; i++) {
		if (check(in, exr_get_attribute_by_index(in->context, 0, EXR_ATTR_LIST_FILE_ORDER,
		                                         i, &a)))
			return -1;
		/* "name" and "type" belong to the format. */
		if (a->type == EXR_ATTR_STRING && a->string->str &&
		    strcmp(a->name, "name") != 0 && strcmp(a->name, "type") != 0 &&
		    file_exr_info_set(info, a->name, a->string->str, in->e))
			return -1;
		if (a->type == EXR_ATTR_FLOAT && strcmp(a->name, "whiteLuminance") == 0)
			info->white_luminance = a->f;
		if (a->type == EXR_ATTR_M44F && strcmp(a->name, "worldToCamera") == 0) {
			info->has_world_to_camera = 1;
			memcpy(info->world_to_camera, a->m44f->m, sizeof info->world_to_camera);
		}
	}
	return 0;
}

/* ---- pixels ---- */

/* The chunk of rows that begins at row y; its size is what the header says. */
static int scanline_chunk(struct input *in, int y, int lines, exr_chunk_info_t *chunk)
{
	int expect = in->height - y < lines ? in->height - y : lines;

	if (check(in, exr_read_scanline_chunk_info(in->context, 0, in->window.min.y + y, chunk)))
		return -1;
	if (chunk->start_y != in->window.min.y + y || chunk->height != expect ||
	    chunk->width != in->width)
		return err_set(in->e, "%s: broken OpenEXR file: chunk of row %d is for others",
		               in->path, y);
	return 0;
}

static int tile_chunk(struct input *in, int x, int y, const int32_t size[2],
                      exr_chunk_info_t *chunk)
{
	int w = in->width - x < size[0] ? in->width - x : size[0];
	int h = in->height - y < size[1] ? in->height - y : size[1];

	if (check(in, exr_read_tile_chunk_info(in->context, 0, x / size[0], y / size[1], 0, 0,
	                                       chunk)))
		return -1;
	if (chunk->width != w || chunk->height != h)
		return err_set(in->e, "%s: broken OpenEXR file: tile at %d, %d has a wrong size",
		               in->path, x, y);
	return 0;
}

/* Decodes a chunk to (x, y) of the picture. */
static int read_chunk(struct input *in, exr_decode_pipeline_t *pipe,
                      const exr_chunk_info_t *chunk, struct image *im, int x, int y)
{
	int first = pipe->channels == NULL;

	if (check(in, first ? exr_decoding_initialize(in->context, 0, chunk, pipe)
	                    : exr_decoding_update(in->context, 0, chunk, pipe)))
		return -1;
	for (int c = 0; c < pipe->channel_count; c++) {
		exr_coding_channel_info_t *ch = &pipe->channels[c];

		ch->user_data_type = EXR_PIXEL_FLOAT;
		ch->user_bytes_per_element = sizeof(float);
		ch->user_pixel_stride = sizeof(float);
		ch->user_line_stride = (int32_t)((size_t)im->width * sizeof(float));
		ch->decode_to_ptr = (uint8_t *)(picture_image_plane(im, c) +
		                                (size_t)y * (size_t)im->width + (size_t)x);
	}
	if (first && check(in, exr_decoding_choose_default_routines(in->context, 0, pipe)))
		return -1;
	return check(in, exr_decoding_run(in->context, 0, pipe));
}

/* Goes through all chunks; without `im` only their places are checked. */
static int each_chunk(struct input *in, const int32_t size[2], exr_decode_pipeline_t *pipe,
                      struct image *im)
{
	exr_chunk_info_t chunk;

	for (int y = 0; y < in->height; y += size[1]) {
		for (int x = 0; x < in->width; x += size[0]) {
			if (in->storage == EXR_STORAGE_TILED ? tile_chunk(in, x, y, size, &chunk)
			                                     : scanline_chunk(in, y, size[1], &chunk))
				return -1;
			if (im && read_chunk(in, pipe, &chunk, im, x, y))
				return -1;
		}
	}
	return 0;
}

static int chunk_size(struct input *in, int32_t size[2])
{
	size[0] = in->width;
	if (in->storage == EXR_STORAGE_TILED) {
		if (check(in, exr_get_tile_sizes(in->context, 0, 0, 0, &size[0], &size[1])))
			return -1;
	} else if (check(in, exr_get_scanlines_per_chunk(in->context, 0, &size[1]))) {
		return -1;
	}
	if (size[0] < 1 || size[1] < 1 || size[0] > SIZE_LIMIT || size[1] > SIZE_LIMIT)
		return err_set(in->e, "%s: broken OpenEXR file: tiles of %d x %d", in->path,
		               (int)size[0], (int)size[1]);
	return 0;
}

static int new_image(struct input *in, struct image *im)
{
	int n = in->channels->num_channels, status;
	const char **name = mem_new((size_t)n, sizeof *name, "channel names", in->e);

	if (!name)
		return -1;
	for (int c = 0; c < n; c++)
		name[c] = in->channels->entries[c].name.str;
	status = picture_image_new(im, in->width, in->height, n, name, in->e);
	free(name);
	return status;
}

static int read_pixels(struct input *in, struct image *im)
{
	exr_decode_pipeline_t pipe = EXR_DECODE_PIPELINE_INITIALIZER;
	int32_t size[2] = { 1, 1 };
	int status;

	/* The places are checked first, so that a lying header costs no memory. */
	if (chunk_size(in, size) || each_chunk(in, size, NULL, NULL) || new_image(in, im))
		return -1;
	status = each_chunk(in, size, &pipe, im);
	exr_decoding_destroy(in->context, &pipe);
	return status;
}

static int check_last_rows(struct input *in)
{
	int32_t size[2] = { 1, 1 };
	exr_chunk_info_t chunk;

	if (in->storage != EXR_STORAGE_SCANLINE)
		return 0;
	if (chunk_size(in, size))
		return -1;
	return scanline_chunk(in, (in->height - 1) / size[1] * size[1], size[1], &chunk);
}

static int read_file(const char *path, struct image *im, struct exr_file_info *info,
                     struct err *e)
{
	struct err own = { 0 };
	struct input in = { .path = path, .fd = -1, .e = &own };
	int status = open_input(&in);

	if (status == 0 && info)
		status = read_attributes(&in, info);
	if (status == 0)
		status = im ? read_pixels(&in, im) : check_last_rows(&in);
	close_input(&in);
	return status ? err_set(e, "%s", own.text) : 0;
}

int file_exr_read(const char *path, struct image *im, struct exr_file_info *info,
                  struct err *e)
{
	*im = (struct image){ 0 };
	if (info)
		*info = (struct exr_file_info){ 0 };
	if (read_file(path, im, info, e) == 0)
		return 0;
	picture_image_free(im);
	if (info)
		file_exr_info_free(info);
	return -1;
}

enum key_fit file_exr_up_to_date(const char *path, const char *key, int any_version)
{
	struct exr_file_info info = { 0 };
	struct err ignored = { 0 };
	struct stat st;
	enum key_fit fit = KEY_DIFFERS;

	if (strcmp(path, "-") == 0 || stat(path, &st) || !S_ISREG(st.st_mode))
		return KEY_DIFFERS;
	if (read_file(path, NULL, &info, &ignored) == 0)
		fit = file_key_fit(file_exr_info_get(&info, EXR_FILE_KEY), key, any_version);
	file_exr_info_free(&info);
	return fit != KEY_DIFFERS && utimensat(AT_FDCWD, path, NULL, 0) ? KEY_DIFFERS : fit;
}
