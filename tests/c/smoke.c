/* Loads the capture given, renders its first frame, and checks what a host relies on. Built from the installed
 * prefix. */
#include <shutterbug.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(what)                                                                                                    \
    do {                                                                                                               \
        if (!(what)) {                                                                                                 \
            fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #what);                                         \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

static void must(shutterbug_status status, const void *handle) {
    char text[512];
    if (status == SHUTTERBUG_OK) return;
    shutterbug_last_error(handle, text, sizeof text);
    fprintf(stderr, "%s: %s\n", shutterbug_status_text(status), text);
    exit(1);
}

static void log_line(void *user, uint32_t level, const char *text) {
    (void)level, (void)text;
    ++*(int *)user;
}

int main(int argc, char **argv) {
    CHECK(argc == 2);
    CHECK(shutterbug_version() == SHUTTERBUG_VERSION_MAJOR * 1000000u + SHUTTERBUG_VERSION_MINOR * 1000u +
          SHUTTERBUG_VERSION_PATCH);
    int lines = 0;
    char why[512] = "";
    shutterbug_engine_options options = {.struct_size = sizeof options};
    options.flags = SHUTTERBUG_ENGINE_PLANES;
    options.method = SHUTTERBUG_METHOD_PAPER;
    options.samples = 4;
    options.frames_in_flight = 3;
    options.log = log_line;
    options.log_user = &lines;
    options.error_text = why;
    options.error_capacity = sizeof why;
    shutterbug_engine *engine = NULL;
    if (shutterbug_engine_create(&options, &engine) != SHUTTERBUG_OK) {
        fprintf(stderr, "create: %s\n", why);
        return 77;
    }
    must(shutterbug_engine_load_capture(engine, argv[1]), engine);
    shutterbug_engine_info info = {.struct_size = sizeof info};
    must(shutterbug_engine_get_info(engine, &info), engine);
    CHECK(info.width > 0 && info.height > 0 && info.capture_frames > 0 && info.device_name[0] != 0);
    double *times = calloc(info.capture_frames, sizeof *times);
    must(shutterbug_engine_get_frame_times(engine, times, info.capture_frames), engine);
    CHECK(shutterbug_engine_get_frame_times(engine, times, info.capture_frames - 1) == SHUTTERBUG_TOO_SMALL);

    shutterbug_request request = {.struct_size = sizeof request};
    request.time_s = times[0];
    request.flags = SHUTTERBUG_REQUEST_PLANES;
    shutterbug_frame *frame = NULL;
    must(shutterbug_engine_submit(engine, &request, &frame), engine);
    shutterbug_frame_info when = {.struct_size = sizeof when};
    CHECK(shutterbug_frame_get_info(frame, &when) == SHUTTERBUG_NOT_READY);
    must(shutterbug_frame_wait(frame, -1), frame);
    must(shutterbug_frame_get_info(frame, &when), frame);
    CHECK(when.first_line_start.time_s == times[0] && when.first_line_start.has_pose);
    CHECK(when.middle.time_s >= times[0] && when.last_line_end.time_s >= when.middle.time_s);

    size_t stride = (size_t)info.width * 4 + 12, bytes = stride * info.height;
    unsigned char *pixels = malloc(bytes);
    memset(pixels, 7, bytes);
    shutterbug_image image = {.struct_size = sizeof image};
    image.format = SHUTTERBUG_BGRA8;
    image.width = info.width;
    image.height = info.height;
    image.stride_bytes = stride;
    image.capacity_bytes = bytes;
    image.pixels = pixels;
    must(shutterbug_frame_read(frame, SHUTTERBUG_PICTURE, &image), frame);
    size_t different = 0;
    for (uint32_t y = 0; y < info.height; ++y) {
        for (uint32_t x = 0; x < info.width; ++x) {
            CHECK(pixels[y * stride + 4 * x + 3] == 255);
            different += memcmp(pixels + y * stride + 4 * x, pixels, 3) != 0;
        }
        CHECK(pixels[y * stride + 4 * info.width] == 7); /* between rows nothing is written */
    }
    CHECK(different > info.width); /* not one colour */

    float *depth = malloc((size_t)info.width * info.height * sizeof *depth);
    image.format = SHUTTERBUG_R32F;
    image.stride_bytes = info.width * sizeof *depth;
    image.capacity_bytes = image.stride_bytes * info.height;
    image.pixels = depth;
    must(shutterbug_frame_read(frame, SHUTTERBUG_DEPTH, &image), frame);
    CHECK(depth[info.width * info.height / 2] > 0);
    shutterbug_pass_time passes[32];
    size_t count = 0;
    must(shutterbug_frame_get_times(frame, passes, 32, &count), frame);
    for (size_t i = 0; i < count; ++i) printf("%-16s %8.3f ms\n", passes[i].name, passes[i].ms);
    must(shutterbug_frame_destroy(frame), frame);
    must(shutterbug_engine_destroy(engine), engine);
    CHECK(shutterbug_engine_destroy(engine) == SHUTTERBUG_HANDLE);
    CHECK(shutterbug_engine_destroy(NULL) == SHUTTERBUG_OK);
    free(depth), free(pixels), free(times);
    printf("ok: %s, %ux%u\n", info.device_name, info.width, info.height);
    return 0;
}
