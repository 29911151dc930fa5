/* cycles.c CYCLES FRAMES: makes, uses and destroys so many engines, then sends so many frames through one, and fails if
 * resident memory grows from the second quarter to the last. Prints it. Third argument, for controls: "leak" loses 100
 * kB a cycle and 3 kB a frame, "overflow" promises the library more room than there is, "unload" lets the Vulkan loader
 * unload its drivers. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <link.h>
#include <malloc.h>
#include <shutterbug.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { W = 16, H = 12 };

static void must(shutterbug_status status, const void *handle) {
    char text[256];
    if (status == SHUTTERBUG_OK) return;
    shutterbug_last_error(handle, text, sizeof text);
    fprintf(stderr, "%s: %s\n", shutterbug_status_text(status), text);
    exit(1);
}

/* Keeps a loaded library for good. The Vulkan loader unloads its drivers with the last instance and loads them anew
 * with the next one; what they keep in tables of their own is lost each time, without a name: with lavapipe of Mesa
 * 22.3, 128 bytes and 6 KiB of resident memory a cycle. A program that only makes and destroys a VkInstance loses the
 * same 128 bytes. */
static int keep(struct dl_phdr_info *info, size_t size, void *unused) {
    (void)size, (void)unused;
    if (info->dlpi_name[0]) dlopen(info->dlpi_name, RTLD_LAZY | RTLD_NOLOAD | RTLD_NODELETE);
    return 0;
}

static long resident_kib(void) {
    long pages = 0, ignored = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (!file || fscanf(file, "%ld %ld", &ignored, &pages) != 2) exit(2);
    fclose(file);
    return pages * (sysconf(_SC_PAGESIZE) / 1024);
}

static shutterbug_engine *make(void) {
    shutterbug_engine_options options = {.struct_size = sizeof options, .samples = 1};
    shutterbug_engine *engine = NULL;
    char why[256] = "";
    options.error_text = why;
    options.error_capacity = sizeof why;
    shutterbug_status status = shutterbug_engine_create(&options, &engine);
    if (status != SHUTTERBUG_OK) {
        fprintf(stderr, "%s\n", why);
        exit(status == SHUTTERBUG_NO_DEVICE ? 77 : 1);
    }
    shutterbug_camera camera = {.struct_size = sizeof camera, .width = W, .height = H, .fx_px = W, .fy_px = W,
                                .cx_px = W / 2, .cy_px = H / 2, .frame_period_s = 0.04, .readout_time_s = 0.03,
                                .exposure_time_s = 0.01};
    must(shutterbug_engine_set_camera(engine, &camera), engine);
    return engine;
}

static void process(shutterbug_engine *engine, uint32_t index) {
    static unsigned char color[H][W][4];
    static float motion[H][W][2];
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x) color[y][x][x % 3] = 200, motion[y][x][0] = 5;
    shutterbug_image images[2] = {
        {.struct_size = sizeof *images, .format = SHUTTERBUG_RGBA8, .width = W, .height = H, .stride_bytes = 4 * W,
         .capacity_bytes = sizeof color, .pixels = color},
        {.struct_size = sizeof *images, .format = SHUTTERBUG_RG32F, .width = W, .height = H, .stride_bytes = 8 * W,
         .capacity_bytes = sizeof motion, .pixels = motion}};
    shutterbug_motion_convention convention = {.struct_size = sizeof convention};
    must(shutterbug_motion_preset(SHUTTERBUG_MOTION_OWN, &convention, NULL, 0), NULL);
    shutterbug_outside outside = {.struct_size = sizeof outside, .frame_index = index, .color = images,
                                  .motion_count = 1,
                                  .motions = images + 1, .motion_convention = &convention};
    shutterbug_frame *frame = NULL;
    must(shutterbug_engine_submit_outside(engine, &outside, &frame), engine);
    must(shutterbug_frame_wait(frame, -1), frame);
    static unsigned char picture[H][W][4];
    images[0].pixels = picture;
    must(shutterbug_frame_read(frame, SHUTTERBUG_PICTURE, images), frame);
    if (picture[1][1][3] != 255) exit(3);
    must(shutterbug_frame_destroy(frame), NULL);
}

/* The library writes 3 bytes beyond what malloc gave, because this program lies about the capacity. */
static void overflow(shutterbug_engine *engine) {
    static float motion[H][W][2];
    static unsigned char color[H][W][3];
    shutterbug_image images[2] = {
        {.struct_size = sizeof *images, .format = SHUTTERBUG_RGB8, .width = W, .height = H, .stride_bytes = 3 * W,
         .capacity_bytes = sizeof color, .pixels = color},
        {.struct_size = sizeof *images, .format = SHUTTERBUG_RG32F, .width = W, .height = H, .stride_bytes = 8 * W,
         .capacity_bytes = sizeof motion, .pixels = motion}};
    shutterbug_motion_convention convention = {.struct_size = sizeof convention};
    must(shutterbug_motion_preset(SHUTTERBUG_MOTION_OWN, &convention, NULL, 0), NULL);
    shutterbug_outside outside = {.struct_size = sizeof outside, .color = images, .motion_count = 1,
                                  .motions = images + 1, .motion_convention = &convention};
    shutterbug_frame *frame = NULL;
    must(shutterbug_engine_submit_outside(engine, &outside, &frame), engine);
    must(shutterbug_frame_wait(frame, -1), frame);
    images[0].pixels = malloc(sizeof color - 3);
    must(shutterbug_frame_read(frame, SHUTTERBUG_PICTURE, images), frame);
    must(shutterbug_frame_destroy(frame), NULL);
}

/* Most resident memory of the second quarter of a count, and least of the last: single readings go up and down by some
 * hundred KiB with what the driver's threads have in hand, and a leak leaves no low ones. */
struct resident {
    long second, last;
};

static void look(struct resident *r, long i, long count) {
    if (count < 40) return; /* Too few: in the first ones things are made that stay. */
    long now = resident_kib();
    if (i >= count / 4 && i < count / 2 && now > r->second) r->second = now;
    if (i >= count - (count + 3) / 4 && (!r->last || now < r->last)) r->last = now;
}

static int grew(const char *what, const struct resident *r, long allowed) {
    printf("%s: resident %ld KiB at most in the second quarter, %ld KiB at least in the last\n", what, r->second,
           r->last);
    return r->second && r->last - r->second > allowed;
}

int main(int argc, char **argv) {
    long cycles = argc > 1 ? atol(argv[1]) : 10, frames = argc > 2 ? atol(argv[2]) : 100;
    struct resident of_cycles = {0}, of_frames = {0};
    const char *control = argc > 3 ? argv[3] : "";
    time_t start = time(NULL);
    int bad = 0, leak = !strcmp(control, "leak"), over = !strcmp(control, "overflow");
    /* One heap for all threads: else the drivers' short-lived threads spread it over ever more pages for 400 cycles. */
    mallopt(M_ARENA_MAX, 1);
    /* Large blocks straight from and to the system. lavapipe (Mesa's u_upload_mgr) fills a block of 1 MiB with what it
     * uploads, some thousand of these frames, then takes the next and frees the first. glibc's threshold grows with
     * what is freed, so that the third block comes from the heap and stays resident: one step of 1028 KiB in 3 of 4
     * runs, in 0 of 4 with this. */
    mallopt(M_MMAP_THRESHOLD, 128 << 10);
    for (long i = 0; i < cycles; ++i) {
        shutterbug_engine *engine = make();
        process(engine, 0);
        if (i == 0 && strcmp(control, "unload")) dl_iterate_phdr(keep, NULL);
        if (leak) memset(malloc(100000), 1, 100000);
        if (over) overflow(engine);
        must(shutterbug_engine_destroy(engine), NULL);
        look(&of_cycles, i, cycles);
        if (i % 20 == 19)
            fprintf(stderr, "%ld cycles in %ld s, resident %ld KiB\n", i + 1, (long)(time(NULL) - start),
                    resident_kib());
    }
    if (cycles) bad |= grew("cycles", &of_cycles, 512);
    if (frames) {
        shutterbug_engine *engine = make();
        for (long i = 0; i < frames; ++i) {
            process(engine, (uint32_t)i);
            if (leak) memset(malloc(3000), 1, 3000);
            look(&of_frames, i, frames);
        }
        bad |= grew("frames", &of_frames, 64);
        must(shutterbug_engine_destroy(engine), NULL);
    }
    return bad ? 4 : 0;
}
