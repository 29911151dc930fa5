/* threads.c FRAMES: two threads, each with an engine of its own, and a third that asks both for what they are busy
 * with. What the first two make must be the same to the last bit. For tools that watch threads (fuzz/threads). Second
 * argument "race": two threads write one word without a lock, which such a tool must find. */
#define _GNU_SOURCE
#include <pthread.h>
#include <shutterbug.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { W = 32, H = 24 };

struct work {
    shutterbug_engine *engine;
    long frames;
    unsigned char picture[H][W][4];
    unsigned long sum;
};

static _Atomic int done;
static _Atomic long busy;
static long raced;

static void must(shutterbug_status status, const void *handle) {
    char text[256] = "";
    if (status == SHUTTERBUG_OK) return;
    shutterbug_last_error(handle, text, sizeof text);
    fprintf(stderr, "%s: %s\n", shutterbug_status_text(status), text);
    exit(status == SHUTTERBUG_NO_DEVICE ? 77 : 1);
}

/* As long as another thread has the handle. */
#define WAIT_FOR(handle, call)                                             \
    do {                                                                   \
        shutterbug_status s_;                                              \
        while ((s_ = (call)) == SHUTTERBUG_BUSY) atomic_fetch_add(&busy, 1); \
        must(s_, handle);                                                  \
    } while (0)

static void *work(void *argument) {
    struct work *w = argument;
    static unsigned char color[H][W][4];
    static float motion[H][W][2];
    shutterbug_image images[2] = {
        {.struct_size = sizeof *images, .format = SHUTTERBUG_RGBA8, .width = W, .height = H, .stride_bytes = 4 * W,
         .capacity_bytes = sizeof color, .pixels = color},
        {.struct_size = sizeof *images, .format = SHUTTERBUG_RG32F, .width = W, .height = H, .stride_bytes = 8 * W,
         .capacity_bytes = sizeof motion, .pixels = motion}};
    shutterbug_motion_convention convention = {.struct_size = sizeof convention};
    must(shutterbug_motion_preset(SHUTTERBUG_MOTION_OWN, &convention, NULL, 0), NULL);
    for (long i = 0; i < w->frames; ++i) {
        shutterbug_outside outside = {.struct_size = sizeof outside, .frame_index = (uint32_t)i, .color = images,
                                      .motion_count = 1, .motions = images + 1, .motion_convention = &convention};
        shutterbug_frame *frame = NULL;
        WAIT_FOR(w->engine, shutterbug_engine_submit_outside(w->engine, &outside, &frame));
        WAIT_FOR(frame, shutterbug_frame_wait(frame, -1));
        shutterbug_image out = images[0];
        out.pixels = w->picture;
        WAIT_FOR(frame, shutterbug_frame_read(frame, SHUTTERBUG_PICTURE, &out));
        WAIT_FOR(frame, shutterbug_frame_destroy(frame));
        for (size_t k = 0; k < sizeof w->picture; ++k)
            w->sum = w->sum * 31 + ((unsigned char *)w->picture)[k];
    }
    return NULL;
}

static void *ask(void *argument) {
    struct work *both = argument;
    while (!atomic_load(&done))
        for (int i = 0; i < 2; ++i) {
            char text[64];
            (void)shutterbug_last_error(both[i].engine, text, sizeof text);
            (void)shutterbug_last_error((void *)0x1235, text, sizeof text);
        }
    return NULL;
}

static void *race(void *unused) {
    (void)unused;
    for (int i = 0; i < 100000; ++i) ++raced;
    return NULL;
}

int main(int argc, char **argv) {
    static struct work both[2];
    pthread_t threads[3];
    for (int i = 0; i < 2; ++i) {
        shutterbug_engine_options options = {.struct_size = sizeof options, .samples = 1, .seed = 7};
        must(shutterbug_engine_create(&options, &both[i].engine), NULL);
        must(shutterbug_engine_set_camera_text(both[i].engine,
            "width = 32\nheight = 24\nfx = 30\nfy = 30\ncx = 16\ncy = 12\nframe_period_s = 0.04\n"
            "[rolling_shutter]\nreadout_time_s = 0.03\n[read_noise]\nsigma = 0.01\n"), both[i].engine);
        both[i].frames = argc > 1 ? atol(argv[1]) : 20;
    }
    pthread_create(threads + 2, NULL, ask, both);
    for (int i = 0; i < 2; ++i) pthread_create(threads + i, NULL, work, both + i);
    for (int i = 0; i < 2; ++i) pthread_join(threads[i], NULL);
    atomic_store(&done, 1);
    pthread_join(threads[2], NULL);
    for (int i = 0; i < 2; ++i) must(shutterbug_engine_destroy(both[i].engine), NULL);
    if (argc > 2 && !strcmp(argv[2], "race")) {
        for (int i = 0; i < 2; ++i) pthread_create(threads + i, NULL, race, NULL);
        for (int i = 0; i < 2; ++i) pthread_join(threads[i], NULL);
    }
    printf("%ld frames in each of two threads, busy %ld times, %ld\n", both[0].frames, atomic_load(&busy), raced);
    if (both[0].sum != both[1].sum) return fprintf(stderr, "the engines differ\n"), 3;
    return 0;
}
