/* long_life.c FRAMES LOSSES PERIOD: one process sends so many frames of 64x48 px, with a rolling shutter, a lens, noise
 * and JPEG, through the library. Frame i has the content of frame i modulo PERIOD, and must have the picture of that
 * one in the first period, to the bit. So many times on the way the device is lost (vkQueueSubmit says so), the engine
 * is destroyed and made anew. Fifty times it prints what it holds: resident memory, memory of the device (as asked of
 * Vulkan and not freed), descriptors, threads. Fails if one of them has grown since the first half (resident memory: by
 * more than 2 %). Fourth argument, for controls: "leak" loses 6 kB a frame, "change" gives the last frame other
 * bits. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <malloc.h>
#include <shutterbug.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

enum { W = 64, H = 48, PARTS = 50, SETTLED = 25 };

/* As much of Vulkan as is looked at; handles are 64 bit or pointers. */
typedef void (*function)(void);
typedef function (*get_proc)(void *, const char *);
typedef struct {
    int32_t type;
    const void *next;
    uint64_t bytes;
    uint32_t kind;
} allocate_info;

static get_proc loader;
static function real_device_proc, real_submit, real_allocate, real_free;
static atomic_int lose;
static atomic_long device_bytes;
static struct { uint64_t memory, bytes; } held[4096];

static int32_t submit(void *queue, uint32_t count, const void *submits, uint64_t fence) {
    if (atomic_exchange(&lose, 0)) return -4; /* VK_ERROR_DEVICE_LOST */
    return ((int32_t (*)(void *, uint32_t, const void *, uint64_t))real_submit)(queue, count, submits, fence);
}

static int32_t allocate(void *device, const allocate_info *info, const void *how, uint64_t *memory) {
    int32_t done = ((int32_t (*)(void *, const void *, const void *, uint64_t *))real_allocate)(device, info, how,
        memory);
    for (int i = 0; !done && i < 4096; ++i)
        if (!held[i].memory) {
            held[i].memory = *memory;
            held[i].bytes = info->bytes;
            device_bytes += (long)info->bytes;
            break;
        }
    return done;
}

static void let_go(void *device, uint64_t memory, const void *how) {
    for (int i = 0; memory && i < 4096; ++i)
        if (held[i].memory == memory) {
            device_bytes -= (long)held[i].bytes;
            held[i].memory = 0;
            break;
        }
    ((void (*)(void *, uint64_t, const void *))real_free)(device, memory, how);
}

static function wrapped(const char *name, function found) {
    if (!found) return found;
    if (!strcmp(name, "vkQueueSubmit")) return real_submit = found, (function)submit;
    if (!strcmp(name, "vkAllocateMemory")) return real_allocate = found, (function)allocate;
    if (!strcmp(name, "vkFreeMemory")) return real_free = found, (function)let_go;
    return found;
}

static function device_proc(void *device, const char *name) {
    return wrapped(name, ((get_proc)real_device_proc)(device, name));
}

static function instance_proc(void *instance, const char *name) {
    function found = loader(instance, name);
    if (!strcmp(name, "vkGetDeviceProcAddr")) return real_device_proc = found, (function)device_proc;
    return wrapped(name, found);
}

static void must(shutterbug_status status, const void *handle) {
    char text[256] = "";
    if (status == SHUTTERBUG_OK) return;
    shutterbug_last_error(handle, text, sizeof text);
    fprintf(stderr, "%s: %s\n", shutterbug_status_text(status), text);
    exit(1);
}

static const char CAMERA[] =
    "width = 64\nheight = 48\nfx = 50\nfy = 50\ncx = 32\ncy = 24\nframe_period_s = 0.04\n"
    "[rolling_shutter]\nreadout_time_s = 0.03\n[motion_blur]\nexposure_time_s = 0.01\n[vignetting]\na1 = -0.3\n"
    "[shot_noise]\nfull_well_e = 4000.0\n[read_noise]\nsigma = 0.01\n[row_noise]\nsigma = 0.003\n"
    "[jpeg]\nquality = 90\n";

static shutterbug_engine *make(void) {
    shutterbug_engine_options options = {.struct_size = sizeof options, .samples = 1, .seed = 5};
    char why[256] = "";
    options.error_text = why;
    options.error_capacity = sizeof why;
    options.get_instance_proc_addr = (void *)instance_proc;
    shutterbug_engine *engine = NULL;
    shutterbug_status status = shutterbug_engine_create(&options, &engine);
    if (status != SHUTTERBUG_OK) {
        fprintf(stderr, "%s\n", why);
        exit(status == SHUTTERBUG_NO_DEVICE ? 77 : 1);
    }
    must(shutterbug_engine_set_camera_text(engine, CAMERA), engine);
    return engine;
}

/* Sends a frame; its hash, or the status where that is no success. */
static shutterbug_status process(shutterbug_engine *engine, uint32_t index, uint64_t *hash) {
    static unsigned char color[H][W][4], picture[H][W][4];
    static float motion[H][W][2];
    for (uint32_t y = 0; y < H; ++y)
        for (uint32_t x = 0; x < W; ++x) {
            for (uint32_t c = 0; c < 3; ++c)
                color[y][x][c] = (unsigned char)((x * (5 + c) + y * 3 + index * 7) ^ (x * y));
            motion[y][x][0] = (float)(index % 13), motion[y][x][1] = (float)(index % 5) - 2;
        }
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
    shutterbug_status status = shutterbug_engine_submit_outside(engine, &outside, &frame);
    if (status != SHUTTERBUG_OK) return status;
    status = shutterbug_frame_wait(frame, -1);
    images[0].pixels = picture;
    if (status == SHUTTERBUG_OK) status = shutterbug_frame_read(frame, SHUTTERBUG_PICTURE, images);
    must(shutterbug_frame_destroy(frame), NULL);
    *hash = 1469598103934665603u;
    for (size_t i = 0; i < sizeof picture; ++i) *hash = (*hash ^ ((unsigned char *)picture)[i]) * 1099511628211u;
    return status;
}

struct held_now {
    long resident_kib, device_kib, descriptors, threads;
};

static long entries(const char *path) {
    DIR *folder = opendir(path);
    long count = -1; /* The folder itself is open meanwhile. */
    if (!folder) exit(2);
    while (readdir(folder)) ++count;
    closedir(folder);
    return count;
}

static struct held_now look(void) {
    long pages = 0, ignored = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (!file || fscanf(file, "%ld %ld", &ignored, &pages) != 2) exit(2);
    fclose(file);
    return (struct held_now){pages * (sysconf(_SC_PAGESIZE) / 1024), device_bytes / 1024, entries("/proc/self/fd"),
                             entries("/proc/self/task")};
}

static shutterbug_engine *lose_the_device(shutterbug_engine *engine) {
    uint64_t hash;
    atomic_store(&lose, 1);
    shutterbug_status status = process(engine, 0, &hash);
    if (status != SHUTTERBUG_DEVICE_LOST || process(engine, 0, &hash) != SHUTTERBUG_DEVICE_LOST) {
        fprintf(stderr, "a lost device answers %s\n", shutterbug_status_text(status));
        exit(5);
    }
    must(shutterbug_engine_destroy(engine), NULL);
    return make();
}

int main(int argc, char **argv) {
    long frames = argc > 1 ? atol(argv[1]) : 1000, losses = argc > 2 ? atol(argv[2]) : 2;
    long period = argc > 3 ? atol(argv[3]) : 100;
    const char *control = argc > 4 ? argv[4] : "";
    uint64_t *first = calloc((size_t)period, sizeof *first), hash = 0;
    struct held_now settled = {0};
    loader = (get_proc)(uintptr_t)dlsym(dlopen("libvulkan.so.1", RTLD_NOW | RTLD_NODELETE), "vkGetInstanceProcAddr");
    if (!loader || !first) return 77;
    /* As in cycles.c: the driver's own habits of taking memory are not what is looked for. */
    mallopt(M_ARENA_MAX, 1);
    mallopt(M_MMAP_THRESHOLD, 128 << 10);
    time_t start = time(NULL);
    shutterbug_engine *engine = make();
    for (long i = 0; i < frames; ++i) {
        if (losses && i % (frames / (losses + 1)) == frames / (losses + 1) - 1 && i / (frames / (losses + 1)) < losses)
            engine = lose_the_device(engine);
        must(process(engine, (uint32_t)(i % period), &hash), engine);
        if (!strcmp(control, "leak")) memset(malloc(6000), 1, 6000);
        if (!strcmp(control, "change") && i == frames - 1) ++hash;
        if (i < period) first[i] = hash;
        if (first[i % period] != hash) {
            fprintf(stderr, "frame %ld has other bits than frame %ld\n", i, i % period);
            return 3;
        }
        if ((i + 1) % (frames / PARTS) != 0) continue;
        struct held_now now = look();
        printf("%8ld frames, %5ld s: resident %ld KiB, device %ld KiB, descriptors %ld, threads %ld\n", i + 1,
               (long)(time(NULL) - start), now.resident_kib, now.device_kib, now.descriptors, now.threads);
        fflush(stdout);
        if ((i + 1) / (frames / PARTS) == SETTLED) settled = now;
        if (settled.resident_kib && (now.resident_kib > settled.resident_kib + settled.resident_kib / 50 ||
                                    now.device_kib > settled.device_kib || now.descriptors > settled.descriptors ||
                                    now.threads > settled.threads)) {
            fprintf(stderr, "grown since part %d of %d\n", SETTLED, PARTS);
            return 4;
        }
    }
    must(shutterbug_engine_destroy(engine), NULL);
    struct rusage use;
    getrusage(RUSAGE_SELF, &use);
    printf("device memory at the end %ld KiB, most resident %ld KiB\n", (long)device_bytes / 1024, use.ru_maxrss);
    return device_bytes ? 6 : 0;
}
