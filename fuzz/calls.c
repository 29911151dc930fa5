/* Random sequences of calls of the C ABI. Each input is a program: a byte chooses a call, the next ones its arguments.
 * Pointers and capacities are honest (the header makes lies the host's fault); handles, numbers and order are anything.
 *
 * Fails (abort) where a call returns SHUTTERBUG_PANIC or _POISONED or a number that is no status, where a handle that
 * is not alive is accepted, where an output is written on failure, and where, after everything is destroyed, a plain
 * frame is not what it was before. The address sanitizer does the rest. Built by fuzz/run and tests/abi/fuzz.rs. */
#include <shutterbug.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { HANDLES = 12, SIDE = 24, BYTES = 384 * 1024, KINDS = 4 };
enum { ENGINE, FRAME, MEMORY, SEMAPHORE };

static struct {
    const uint8_t *at, *end;
} input;
static void *handles[HANDLES];
static int kinds[HANDLES], alive[HANDLES];
/* Ends of three pieces of memory, each followed by a page that nobody may touch: the library itself is not
 * instrumented, so pictures end there. And pages for import_host. */
static unsigned char *ends[3], *pages;
/* How often each call gave each status: what --statistics prints. */
static unsigned long counts[32][22];

static void fail(const char *why, ...) {
    va_list list;
    va_start(list, why);
    vfprintf(stderr, why, list);
    fputc('\n', stderr);
    abort();
}

static uint32_t byte(void) { return input.at < input.end ? *input.at++ : 0; }
static uint32_t word(void) { return byte() | byte() << 8 | byte() << 16 | byte() << 24; }
static int one_in(uint32_t n) { return byte() % n == n - 1; }

/* Mostly a number that makes sense, sometimes any. */
static uint32_t number(uint32_t below) { return one_in(40) ? word() : byte() % below; }

static double real(void) {
    static const double odd[] = {0.0, -0.0, -1.0, 1e300, -1e300, 1e-320, 1.0 / 0.0, 0.0 / 0.0};
    if (one_in(40)) return odd[byte() % 8];
    return byte() / 2000.0;
}

/* The slot of a handle: mostly of the right kind and alive. */
static int pick(int kind) {
    int first = (int)(byte() % HANDLES);
    if (one_in(24)) return first;
    for (int i = 0; i < HANDLES; ++i) {
        int slot = (first + i) % HANDLES;
        if (alive[slot] && kinds[slot] == kind) return slot;
    }
    return first;
}

static void *any_handle(int kind) {
    if (one_in(40)) return (void *)(uintptr_t)word();
    return handles[pick(kind)];
}

/* A call besides: it reads the same bytes as what follows, so that old programs stay what they were. */
#define aside(call)                       \
    do {                                  \
        const uint8_t *before = input.at; \
        call;                             \
        input.at = before;                \
    } while (0)

/* The struct's size is mostly right. */
#define SIZED(type, name) \
    type name;            \
    memset(&name, 0, sizeof name); \
    name.struct_size = one_in(64) ? word() : (uint32_t)sizeof name

static int keep(int kind, void *handle) {
    for (int i = 0; i < HANDLES; ++i)
        if (!alive[i]) {
            handles[i] = handle, kinds[i] = kind, alive[i] = 1;
            return 1;
        }
    return 0;
}

static shutterbug_status destroy(int kind, void *handle) {
    switch (kind) {
    case ENGINE: return shutterbug_engine_destroy(handle);
    case FRAME: return shutterbug_frame_destroy(handle);
    case MEMORY: return shutterbug_memory_destroy(handle);
    default: return shutterbug_semaphore_destroy(handle);
    }
}

static int is_alive(const void *handle, int kind) {
    for (int i = 0; i < HANDLES; ++i)
        if (alive[i] && handles[i] == handle && kinds[i] == kind) return 1;
    return 0;
}

/* Checks what a call on a handle returned. */
static shutterbug_status seen(int call, shutterbug_status status, const void *handle, int kind) {
    if (status < 0 || status > SHUTTERBUG_VULKAN) fail("call %d: status %d is none", call, status);
    if (status == SHUTTERBUG_PANIC || status == SHUTTERBUG_POISONED) {
        char text[512];
        shutterbug_last_error(handle, text, sizeof text);
        fail("call %d: %s: %s", call, shutterbug_status_text(status), text);
    }
    if (status == SHUTTERBUG_OK && kind >= 0 && !is_alive(handle, kind)) fail("call %d took a dead handle", call);
    ++counts[call][status];
    return status;
}

/* A new handle, or none where the call failed. By address: arguments are evaluated in any order. */
static void made(int call, shutterbug_status status, int kind, void **where) {
    void *handle = *where;
    if ((status == SHUTTERBUG_OK) != (handle != NULL)) fail("call %d: status %d with handle %p", call, status, handle);
    if (handle && !keep(kind, handle) && destroy(kind, handle) != SHUTTERBUG_OK) fail("call %d: not destroyed", call);
}

static shutterbug_engine *create(void) {
    SIZED(shutterbug_engine_options, options);
    char why[64];
    options.max_side_px = SIDE;
    options.method = number(5), options.frames_in_flight = number(4), options.motion_images = number(7);
    options.samples = one_in(12) ? number(17) : one_in(4) ? 16 : 1, options.flags = number(4) & ~1u, options.max_blur_samples = number(64);
    options.time_limit_s = one_in(8) ? real() : 0, options.seed = word();
    options.error_text = why, options.error_capacity = number(sizeof why) % sizeof why;
    shutterbug_engine *engine = NULL;
    made(0, seen(0, shutterbug_engine_create(one_in(64) ? NULL : &options, &engine), NULL, -1), ENGINE, (void **)&engine);
    return engine;
}

static void set_camera(shutterbug_engine *engine) {
    SIZED(shutterbug_camera, camera);
    camera.width = number(SIDE) + !one_in(16), camera.height = number(SIDE) + !one_in(16);
    camera.fx_px = one_in(8) ? real() : 12, camera.fy_px = one_in(8) ? real() : 12;
    camera.cx_px = camera.width / 2.0, camera.cy_px = one_in(8) ? real() : camera.height / 2.0;
    camera.frame_period_s = one_in(8) ? real() : 0.04, camera.readout_time_s = real(), camera.exposure_time_s = real() / 4;
    camera.scan_order = number(4), camera.flags = number(2), camera.reserved = one_in(64);
    seen(1, shutterbug_engine_set_camera(engine, &camera), engine, ENGINE);
}

static shutterbug_image image(uint32_t format, uint32_t width, uint32_t height, int which) {
    static const uint32_t bytes[] = {4, 3, 4, 4, 8, 16, 4, 4, 8, 4, 2, 1};
    SIZED(shutterbug_image, it);
    it.format = one_in(12) ? number(10) : format;
    it.width = one_in(16) ? number(40) : width, it.height = one_in(16) ? number(40) : height;
    uint64_t row = (uint64_t)width * bytes[format < 12 ? format : format % 9];
    it.stride_bytes = row + (one_in(8) ? byte() % 40 : 0);
    if (one_in(32)) it.stride_bytes = (uint64_t)word() << byte() % 33;
    /* Just enough, mostly. */
    it.capacity_bytes = it.stride_bytes * (height ? height - 1 : 0) + row + (one_in(16) ? byte() % 32 : 0);
    if (one_in(16) || it.capacity_bytes > BYTES) it.capacity_bytes = byte() * 16;
    it.pixels = one_in(40) ? NULL : ends[which] - it.capacity_bytes;
    if (one_in(12)) it.memory = any_handle(MEMORY), it.memory_offset = number(64) * 4;
    return it;
}

/* What needs no engine; the sentence ends before a guarded page. */
static void convert(void) {
    SIZED(shutterbug_motion_convention, motion);
    uint64_t room = byte();
    char *text = one_in(8) ? NULL : (char *)ends[0] - room;
    uint32_t w = 1 + number(SIDE), h = 1 + number(SIDE);
    shutterbug_image from = image(7 + byte() % 2, w, h, 1), to = image(7 + byte() % 2, w, h, 2);
    seen(25, shutterbug_motion_preset(number(7), one_in(40) ? NULL : &motion, text, text ? room : 0), NULL, -1);
    if (one_in(4)) motion.scale_x = real(), motion.interval_s = real(), motion.unit = number(4);
    double interval_s = one_in(8) ? real() : 0.04;
    seen(26, shutterbug_motion_convert(one_in(40) ? NULL : &from, &motion, interval_s, one_in(40) ? NULL : &to, text,
                                       text ? room : 0), NULL, -1);
}

#include "paths.h"

static void submit_outside(shutterbug_engine *engine, const uint32_t *size) {
    aside(submit_path(engine, size));
    SIZED(shutterbug_outside, o);
    uint32_t margin[2] = {one_in(4) ? byte() % 5 : 0, one_in(4) ? byte() % 5 : 0};
    uint32_t w = size[0] + 2 * margin[0], h = size[1] + 2 * margin[1];
    shutterbug_image color = image(1 + byte() % 5, w, h, 0), motions[6], depth = image(SHUTTERBUG_R32F, w, h, 1);
    SIZED(shutterbug_motion_convention, motion);
    SIZED(shutterbug_depth_convention, of_depth);
    shutterbug_stamped_pose poses[2] = {{0, {{0}, {0, 0, 0, 1}}}, {0.05, {{0.1}, {0, 0, 0, 1}}}};
    shutterbug_motion_preset(byte() % 6, &motion, NULL, 0);
    if (one_in(4)) motion.scale_x = real(), motion.interval_s = real(), motion.unit = number(4);
    of_depth.kind = number(3), of_depth.near_m = 0.1, of_depth.far_m = one_in(4) ? real() : 100;
    if (one_in(8)) poses[byte() % 2].world_from_camera.rotation_xyzw[byte() % 4] = real();
    if (one_in(8)) poses[byte() % 2].time_s = real();
    o.frame_index = word(), o.time_s = real(), o.color_time_s = one_in(4) ? real() : 0.02;
    o.first_motion_time_s = real(), o.motion_step_s = one_in(4) ? real() : 0.01, o.encoding = number(2);
    o.margin_x_px = one_in(32) ? word() : margin[0], o.margin_y_px = margin[1], o.flags = one_in(64);
    o.motion_count = one_in(3) ? 0 : 1 + number(6);
    if (o.motion_count > 6 && one_in(2)) o.motion_count = 6;
    for (int i = 0; i < 6; ++i) motions[i] = image(7 + byte() % 2, w, h, 1);
    o.color = one_in(40) ? NULL : &color, o.motions = one_in(40) ? NULL : motions, o.motion_convention = &motion;
    o.depth = one_in(40) ? NULL : &depth, o.depth_convention = &of_depth, o.poses = one_in(40) ? NULL : poses;
    if (one_in(12)) o.picture_memory = any_handle(MEMORY);
    shutterbug_frame *frame = NULL;
    made(2, seen(2, shutterbug_engine_submit_outside(engine, &o, &frame), engine, ENGINE), FRAME, (void **)&frame);
}

static void of_frame(shutterbug_frame *frame, const uint32_t *size) {
    aside(read_finer(frame, size, FRAME));
    uint32_t ready = 7, plane = 1 + byte() % 4;
    size_t count = 99;
    SIZED(shutterbug_frame_info, info);
    shutterbug_pass_time times[64];
    static const uint32_t formats[] = {3, 5, 8, 6};
    shutterbug_image to = image(plane == 1 ? 1 + byte() % 3 : formats[plane - 1], size[0], size[1], 2);
    switch (byte() % 6) {
    case 0: seen(3, shutterbug_frame_poll(frame, &ready), frame, FRAME); break;
    case 1: seen(4, shutterbug_frame_wait(frame, one_in(4) ? real() : -1), frame, FRAME); break;
    case 2: seen(5, shutterbug_frame_read(frame, one_in(32) ? word() : plane, &to), frame, FRAME); break;
    case 3: seen(6, shutterbug_frame_get_info(frame, &info), frame, FRAME); break;
    case 4: seen(7, shutterbug_frame_get_times(frame, one_in(4) ? NULL : times, byte() % 65, &count), frame, FRAME); break;
    default:
        if (!seen(4, shutterbug_frame_wait(frame, -1), frame, FRAME)) seen(5, shutterbug_frame_read(frame, plane, &to), frame, FRAME);
    }
}

static void load(shutterbug_engine *engine) {
    char text[260] = "width = 20\nheight = 14\nfx = 12\nfy = 12\ncx = 10\ncy = 7\nframe_period_s = 0.04\n"
                     "[rolling_shutter]\nreadout_time_s = 0.02\n[motion_blur]\nexposure_time_s = 0.01\n[lens_distortion]\nk1 = -0.1";
    if (one_in(2)) *strstr(text, "[lens") = 0;
    if (one_in(3)) strcpy(strstr(text, "[motion"), "[auto_exposure]\ntarget = 0.5");
    if (one_in(8)) seen(24, shutterbug_engine_reset_exposure(engine), engine, ENGINE);
    shutterbug_stamped_pose poses[3] = {{0, {{0}, {0, 0, 0, 1}}}, {0.1, {{0.1}, {0, 0, 0, 1}}}, {1, {{1}, {0, 0, 0, 1}}}};
    switch (byte() % 4) {
    case 0:
        if (one_in(4)) text[byte() % sizeof text] = (char)byte();
        text[sizeof text - 1] = 0;
        seen(8, shutterbug_engine_set_camera_text(engine, text), engine, ENGINE);
        break;
    case 1: seen(9, shutterbug_engine_load_capture(engine, one_in(4) ? "nowhere" : "demo/capture"), engine, ENGINE); break;
    case 2: seen(10, shutterbug_engine_load_scene(engine, one_in(8) ? "nowhere" : "demo/capture/scene.obj"), engine, ENGINE); break;
    default:
        if (one_in(4)) poses[byte() % 3].world_from_camera.translation_m[0] = real();
        seen(11, shutterbug_engine_set_trajectory(engine, one_in(40) ? NULL : poses, byte() % 4), engine, ENGINE);
    }
}

static void submit(shutterbug_engine *engine, double zero_s) {
    SIZED(shutterbug_request, request);
    request.frame_index = byte(), request.time_s = zero_s + (one_in(16) ? real() : byte() / 1000.0);
    request.flags = number(2);
    if (one_in(6)) request.picture_memory = any_handle(MEMORY);
    shutterbug_frame *frame = NULL;
    made(12, seen(12, shutterbug_engine_submit(engine, &request, &frame), engine, ENGINE), FRAME, (void **)&frame);
}

/* Images that are the engine's own; of a host's device there are none here. */
static void share_image(shutterbug_engine *engine, shutterbug_memory **memory, int *fd) {
    static const uint32_t formats[] = {37, 43, 44, 50, 97, 109, 100, 126, 83, 103, 1};
    SIZED(shutterbug_gpu_image, it);
    uint64_t bytes = 0;
    it.vk_format = one_in(16) ? word() : formats[byte() % 11];
    it.width = one_in(16) ? word() : 1 + number(SIDE), it.height = one_in(16) ? word() : 1 + number(SIDE);
    it.vk_layout = one_in(8) ? number(9) : 1, it.vk_layout_after = number(3) % 2;
    it.vk_tiling = one_in(4) ? number(3) : 0, it.vk_usage = one_in(8) ? byte() : 3, it.vk_image = one_in(16);
    if (one_in(8)) {
        seen(22, shutterbug_memory_use_image(engine, &it, memory), engine, ENGINE);
        return;
    }
    made(20, seen(20, shutterbug_memory_export_image_fd(engine, &it, memory, fd, &bytes), engine, ENGINE), MEMORY,
         (void **)memory);
    if (*fd < 0 || one_in(2)) return;
    shutterbug_memory *again = NULL;
    if (one_in(4)) bytes = byte();
    shutterbug_status status = seen(21, shutterbug_memory_import_image_fd(engine, &it, *fd, bytes, &again), engine, ENGINE);
    if (!status) *fd = -1; /* the driver's now */
    made(21, status, MEMORY, (void **)&again);
}

/* A descriptor of the engine's own comes in again. */
static void semaphore_again(shutterbug_engine *engine, int *fd) {
    shutterbug_semaphore *again = NULL;
    shutterbug_status status = seen(27, shutterbug_semaphore_import_fd(engine, *fd, number(3), &again), engine, ENGINE);
    if (!status) *fd = -1; /* the driver's now */
    made(27, status, SEMAPHORE, (void **)&again);
}

static void share(shutterbug_engine *engine) {
    int fd = -1;
    shutterbug_memory *memory = NULL;
    shutterbug_semaphore *semaphore = NULL;
    uint64_t bytes = one_in(8) ? (uint64_t)word() << byte() % 33 : 4096 * (1 + byte() % 16);
    switch (byte() % 6) {
    case 0:
        /* 16 pages that stay as long as the program runs. */
        bytes = bytes > 65536 ? bytes | 1 : bytes;
        made(13, seen(13, shutterbug_memory_import_host(engine, pages + (one_in(8) ? byte() : 0), bytes, &memory), engine,
                      ENGINE), MEMORY, (void **)&memory);
        break;
    case 1:
        made(14, seen(14, shutterbug_memory_export_fd(engine, bytes > 1 << 20 ? 1 << 20 : bytes, &memory, &fd), engine, ENGINE),
             MEMORY, (void **)&memory);
        break;
    case 2:
        made(15, seen(15, shutterbug_semaphore_export_fd(engine, number(3), &semaphore, &fd), engine, ENGINE), SEMAPHORE,
             (void **)&semaphore);
        aside(semaphore_again(engine, &fd));
        break;
    case 3: share_image(engine, &memory, &fd); break;
    case 4: seen(23, shutterbug_semaphore_use(engine, one_in(2) ? 0 : 7, number(3), &semaphore), engine, ENGINE); break;
    default: made(16, seen(16, shutterbug_memory_import_fd(engine, -1, bytes, &memory), engine, ENGINE), MEMORY, (void **)&memory);
    }
    if (fd >= 0) close(fd);
}

static void end(int slot, int kind) {
    void *handle = handles[slot];
    int was = alive[slot] && kinds[slot] == kind;
    shutterbug_status status = seen(17, destroy(kind, handle), NULL, -1);
    if (handle && was != (status == SHUTTERBUG_OK)) fail("destroying kind %d as %d: status %d", kinds[slot], kind, status);
    if (was) alive[slot] = 0;
}

static void step(void) {
    uint32_t size[2] = {0, 0}, call = byte() % 16;
    double zero_s = 0, times[128];
    shutterbug_engine *engine = any_handle(ENGINE);
    SIZED(shutterbug_engine_info, info);
    if (seen(18, shutterbug_engine_get_info(engine, &info), engine, ENGINE) == SHUTTERBUG_OK) {
        size[0] = info.width, size[1] = info.height;
        size_t room = one_in(16) ? byte() % 8 : 128;
        if (!seen(19, shutterbug_engine_get_frame_times(engine, times, room), engine, ENGINE) && info.capture_frames) zero_s = times[0];
    }
    if (size[0] > SIDE || size[1] > SIDE) fail("a camera beyond max_side_px: %ux%u", size[0], size[1]);
    switch (call) {
    case 0: one_in(4) ? (void)create() : set_camera(engine); break;
    case 1: aside(convert()); aside(ask(engine)); set_camera(engine); break;
    case 2: case 3: load(engine); break;
    case 4: share(engine); break;
    case 5: one_in(6) ? end(pick(ENGINE), (int)number(KINDS) % KINDS) : of_frame(any_handle(FRAME), size); break;
    case 6: end(pick(one_in(3) ? MEMORY : FRAME), one_in(8) ? byte() % KINDS : FRAME); break;
    case 7: case 8: submit(engine, zero_s); break;
    case 9: case 10: case 11: submit_outside(engine, size); break;
    default: of_frame(any_handle(FRAME), size);
    }
}

/* One frame of an engine of its own. */
static void plain_frame(unsigned char *picture) {
    const uint8_t *at = input.at;
    input.at = input.end; /* every choice below is 0: nothing odd */
    shutterbug_engine_options options = {.struct_size = sizeof options, .samples = 1};
    shutterbug_camera camera = {.struct_size = sizeof camera, .width = 16, .height = 12, .fx_px = 16, .fy_px = 16, .cx_px = 8,
                                .cy_px = 6, .frame_period_s = 0.04, .readout_time_s = 0.03, .exposure_time_s = 0.01};
    shutterbug_motion_convention convention = {.struct_size = sizeof convention};
    static unsigned char color[12][16][4];
    static float motion[12][16][2];
    for (int i = 0; i < 12 * 16; ++i) color[i / 16][i % 16][i % 3] = 255, motion[i / 16][i % 16][0] = 6;
    shutterbug_image images[2] = {
        {.struct_size = sizeof *images, .format = SHUTTERBUG_RGBA8, .width = 16, .height = 12, .stride_bytes = 64,
         .capacity_bytes = sizeof color, .pixels = color},
        {.struct_size = sizeof *images, .format = SHUTTERBUG_RG32F, .width = 16, .height = 12, .stride_bytes = 128,
         .capacity_bytes = sizeof motion, .pixels = motion}};
    shutterbug_motion_preset(SHUTTERBUG_MOTION_OWN, &convention, NULL, 0);
    shutterbug_outside outside = {.struct_size = sizeof outside, .color = images, .motion_count = 1, .motions = images + 1,
                                  .motion_convention = &convention};
    shutterbug_image to = images[0];
    to.pixels = picture;
    shutterbug_engine *engine = NULL;
    shutterbug_frame *frame = NULL;
    shutterbug_status status = shutterbug_engine_create(&options, &engine);
    if (status == SHUTTERBUG_NO_DEVICE) exit(77);
    if (status || shutterbug_engine_set_camera(engine, &camera) || shutterbug_engine_submit_outside(engine, &outside, &frame) ||
        shutterbug_frame_wait(frame, -1) || shutterbug_frame_read(frame, SHUTTERBUG_PICTURE, &to) ||
        shutterbug_frame_destroy(frame) || shutterbug_engine_destroy(engine))
        fail("a plain frame failed");
    input.at = at;
}

/* The end of so many bytes (a multiple of 4096), with a guarded page behind. */
static unsigned char *guarded(size_t bytes) {
    unsigned char *memory = mmap(NULL, bytes + 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED || mprotect(memory + bytes, 4096, PROT_NONE)) abort();
    memset(memory, 0x41, bytes);
    return memory + bytes;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static unsigned char before[12 * 16 * 4], after[sizeof before];
    if (!pages) {
        for (int i = 0; i < 3; ++i) ends[i] = guarded(BYTES);
        pages = aligned_alloc(4096, 65536);
        memset(pages, 0x37, 65536);
        input.at = input.end = data;
        plain_frame(before);
    }
    input.at = data, input.end = data + size;
    shutterbug_engine *first = create();
    if (first) set_camera(first), load(first), load(first), load(first);
    while (input.at < input.end) step();
    /* In any order: frames outlive their engines, engines their frames. */
    for (int i = 0; i < HANDLES; ++i)
        if (alive[i]) end(i, kinds[i]);
    memset(handles, 0, sizeof handles);
    if (size % 16 == 0) {
        plain_frame(after);
        if (memcmp(before, after, sizeof before)) fail("another picture after this input");
    }
    return 0;
}

/* What was reached: a fuzz target that is refused everywhere proves nothing. */
void shutterbug_fuzz_statistics(void) {
    static const char *names[] = {
        "engine_create", "engine_set_camera", "engine_submit_outside", "frame_poll", "frame_wait", "frame_read", "frame_get_info",
        "frame_get_times", "engine_set_camera_text", "engine_load_capture", "engine_load_scene", "engine_set_trajectory",
        "engine_submit", "memory_import_host", "memory_export_fd", "semaphore_export_fd", "memory_import_fd", "engine_destroy",
        "engine_get_info", "engine_get_frame_times", "memory_export_image_fd", "memory_import_image_fd", "memory_use_image",
        "semaphore_use", "engine_reset_exposure", "motion_preset", "motion_convert", "semaphore_import_fd",
        "pose_convert", "check_conventions", "engine_margin"};
    for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
        printf("%s", names[i]);
        for (int s = 0; s <= SHUTTERBUG_VULKAN; ++s)
            if (counts[i][s]) printf(" %d:%lu", s, counts[i][s]);
        printf("\n");
    }
    printf("finer 0:%lu\n", finer_reads);
}

/* What a broken library would do, to see that it is found. */
void shutterbug_fuzz_control(const char *name) {
    if (!strcmp(name, "double")) {
        seen(17, SHUTTERBUG_OK, (void *)(uintptr_t)0x1235, ENGINE);
    } else {
        plain_frame(guarded(4096) - (16 * 12 * 4 - 1));
    }
}
