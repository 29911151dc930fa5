/* Shutterbug: turns a rendered frame into the frame of a real, cheap, moving camera. This header is the manual.
 *
 * CALLS     Every call that can fail returns a shutterbug_status; SHUTTERBUG_OK is 0. Outputs are written on success
 *           only.
 * ERRORS    shutterbug_last_error() gives a sentence: what was found, and what was expected. Calls without a handle
 *           write it to your buffer (error_text, which may be null). Common errors are not listed at each call: any
 *           call can give ARGUMENT, STRUCT_SIZE and PANIC; any call on a handle can give HANDLE, BUSY, POISONED and
 *           FORKED. All other errors of a call stand at its "Errors:". "device" there stands for DEVICE_LOST,
 *           OUT_OF_MEMORY, VULKAN and, if the call waits, TIMEOUT.
 * HANDLES   A handle is a number in a table, not an address: it is looked up, never followed. Null, made-up, destroyed
 *           and wrong-kind handles give SHUTTERBUG_HANDLE. Destroying null is fine; destroying twice gives
 *           SHUTTERBUG_HANDLE.
 * OWNERSHIP You own all memory that you pass. The library keeps none of it after the call, except shared memory
 *           (shutterbug_memory) and the Vulkan objects of a shutterbug_host_device. What a *_create, *_submit, *_import
 *           or *_export call gives you is yours to destroy. Destroy in any order: a frame whose engine is gone returns
 *           an error; shared memory keeps its device open.
 * THREADS   Any thread may use a handle, one thread at a time. A second thread gets SHUTTERBUG_BUSY and nothing
 *           happens. Calls on a frame that is not finished use its engine's handle too. Different engines are
 *           independent of each other.
 * FORK      In a forked child, every call on a handle of the parent returns FORKED at once, whatever the parent was
 *           doing. Destroying such a handle returns OK and does not touch the parent's object. The child creates its
 *           own engines on software drivers. Where the parent has opened the driver of a GPU, the child's
 *           shutterbug_engine_create returns SHUTTERBUG_NO_DEVICE: opening it again would take the parent's device
 *           away. Fork before the first engine, or start the child anew (exec, Python's "spawn").
 * UNITS     Seconds, metres, pixels; the names end in the unit. Pixel (0,0) is top left, its centre is (0.5, 0.5), x
 *           points right, y points down. Pictures are stored top row first. A camera looks along +z (x right, y down).
 *           World coordinates are metres in any right-handed frame. A pose maps camera to world coordinates;
 *           quaternions are x y z w. docs/conventions.md of the sources has drawings.
 * TIME      time_s of a frame is the START of exposure of the first line read. Line i of N (in scan order) starts at
 *           time_s + readout_time_s i/N and integrates for exposure_time_s.
 * STRUCTS   Set struct_size = sizeof(struct) before you pass one, for outputs too, and zero the rest (= {0}) before you
 *           fill in fields: zero is each option's default. Structs grow at their end only. A size from an older header
 *           is accepted; the missing fields count as zero. Any other size gives SHUTTERBUG_STRUCT_SIZE.
 * PROCESS   The only global state is the table of live handles, one Vulkan instance that engines share and that stays
 *           until the process ends (drivers do not survive many instances; a second where validation is on; none with
 *           a loader or a device of your own), and two idle log subscribers that keep the engines'
 *           logs apart. No signal handlers, no exit, nothing on stdout. A bug in the library becomes SHUTTERBUG_PANIC,
 *           with Rust's message on stderr; it makes that one handle unusable. The first engine that loads a scene
 *           starts a pool of worker threads, which stay, idle.
 */
#ifndef SHUTTERBUG_H
#define SHUTTERBUG_H

#include <stddef.h>
#include <stdint.h>

#define SHUTTERBUG_VERSION_MAJOR 0
#define SHUTTERBUG_VERSION_MINOR 1
#define SHUTTERBUG_VERSION_PATCH 0

#ifdef __cplusplus
extern "C" {
#endif
/* From here to "END OF PLAIN C" there is no preprocessor: Python's cffi parses it as it is. */

/* ---- Status ------------------------------------------------------------------------------------------------------ */

typedef int32_t shutterbug_status;
enum {
    SHUTTERBUG_OK = 0,
    SHUTTERBUG_ARGUMENT = 1,       /* null, misaligned, out of range or not a number */
    SHUTTERBUG_HANDLE = 2,         /* not alive, or of another kind */
    SHUTTERBUG_BUSY = 3,           /* another thread is using the handle: try again */
    SHUTTERBUG_POISONED = 4,       /* unusable since an earlier SHUTTERBUG_PANIC: destroy it */
    SHUTTERBUG_PANIC = 5,          /* a bug in the library; the handle is unusable from now on */
    SHUTTERBUG_STRUCT_SIZE = 6,    /* struct_size is not a size that this library knows */
    SHUTTERBUG_TOO_SMALL = 7,      /* a stride, a capacity or a margin */
    SHUTTERBUG_FORMAT = 8,         /* a pixel format that is not possible here */
    SHUTTERBUG_STATE = 9,          /* the call needs another one first */
    SHUTTERBUG_INPUT = 10,         /* a file or text holds something that cannot be used */
    SHUTTERBUG_IO = 11,            /* the operating system refused a file operation */
    SHUTTERBUG_TIME = 12,          /* the trajectory does not cover the frame: poses are never extrapolated */
    SHUTTERBUG_FULL = 13,          /* all frames in flight are taken: wait for any of them */
    SHUTTERBUG_NOT_READY = 14,     /* the frame has not been waited for */
    SHUTTERBUG_TIMEOUT = 15,       /* the time limit passed; the frame can be waited for again */
    SHUTTERBUG_NO_DEVICE = 16,     /* no Vulkan loader, or no device that can be used */
    SHUTTERBUG_UNSUPPORTED = 17,   /* the device or this version of the library cannot do it */
    SHUTTERBUG_DEVICE_LOST = 18,   /* the engine can only be destroyed; another one may work */
    SHUTTERBUG_OUT_OF_MEMORY = 19, /* of the device or the host; nothing was changed */
    SHUTTERBUG_LIMIT = 20,         /* beyond what the device or the options allow */
    SHUTTERBUG_VULKAN = 21,        /* any other failed Vulkan call */
    SHUTTERBUG_FORKED = 22         /* the handle belongs to the process that forked this one */
};

/* ---- Handles ----------------------------------------------------------------------------------------------------- */

typedef struct shutterbug_engine shutterbug_engine;       /* a device, a camera, and a scene if you load one */
typedef struct shutterbug_frame shutterbug_frame;         /* a frame on its way, or delivered */
typedef struct shutterbug_memory shutterbug_memory;       /* memory that device and host share */
typedef struct shutterbug_semaphore shutterbug_semaphore; /* a semaphore that device and host share */

/* ---- Version and errors ------------------------------------------------------------------------------------------ */

/* The library's version: major * 1000000 + minor * 1000 + patch. Any thread, at any time. */
uint32_t shutterbug_version(void);
/* The same as text, "0.1.0". Static: never freed. Any thread, at any time. */
const char *shutterbug_version_text(void);
/* What a status means. Static: never freed. Unknown numbers have a text too. Any thread, at any time. */
const char *shutterbug_status_text(shutterbug_status status);
/* Copies the text of the last failed call on a handle of any kind (NUL-terminated, cut to capacity) and returns its
 * full length without NUL. text may be null. Any thread, even while another one uses the handle. SHUTTERBUG_BUSY and
 * SHUTTERBUG_HANDLE leave no text. The handle's text stays until the next failure. */
size_t shutterbug_last_error(const void *handle, char *text, size_t capacity);

/* ---- Engines ----------------------------------------------------------------------------------------------------- */

/* Called on the thread of the call that has something to say: level 1 error, 2 warning, 3 information. text lives
 * through the call only. It must return normally and should not call the engine it speaks of (SHUTTERBUG_BUSY). */
typedef void (*shutterbug_log_fn)(void *user, uint32_t level, const char *text);

/* A Vulkan device of yours. Instance of API 1.2 or later, device with shaderStorageImageExtendedFormats (and
 * timelineSemaphore where you use timelines), a queue of graphics and compute. All of it must outlive the engine and
 * its shared memory, and while a call on the engine or its frames runs nobody else may use the queue. Nothing of it is
 * destroyed by this library. */
typedef struct shutterbug_host_device {
    uint32_t struct_size;
    uint32_t queue_family;
    const void *get_instance_proc_addr; /* your vkGetInstanceProcAddr */
    void *instance;                     /* VkInstance */
    void *physical_device;              /* VkPhysicalDevice */
    void *device;                       /* VkDevice */
    void *queue;                        /* VkQueue */
    const char *const *extensions;      /* names of the device extensions that you enabled */
    uint32_t extension_count;
    uint32_t reserved; /* 0 */
} shutterbug_host_device;

enum {                                /* shutterbug_engine_options.flags */
    SHUTTERBUG_ENGINE_VALIDATION = 1, /* load the Khronos validation layer; its absence is an error */
    SHUTTERBUG_ENGINE_PLANES = 2      /* frames may ask for sharp planes */
};
enum {                              /* shutterbug_engine_options.method: how frames are made (docs/methods.md) */
    SHUTTERBUG_METHOD_DEFAULT = 0,  /* the library's choice: exact for scenes, and for frames from outside what they
                                     * bring */
    SHUTTERBUG_METHOD_ACCUMULATION = 1, /* many renders a frame: the reference; of scenes only */
    SHUTTERBUG_METHOD_PAPER = 2,    /* one render, motion images, remap and blur as a gather; from outside: motion or
                                     * two poses */
    SHUTTERBUG_METHOD_EXACT = 3,    /* one render with every line at its own time, blurred along true paths; of scenes
                                     * only */
    SHUTTERBUG_METHOD_FAST = 4      /* one render and a warp along true paths; from outside: depth and pose_count
                                     * poses */
};

typedef struct shutterbug_engine_options {
    uint32_t struct_size;
    uint32_t flags;            /* SHUTTERBUG_ENGINE_* */
    uint32_t method;           /* SHUTTERBUG_METHOD_* */
    uint32_t samples;          /* a pixel: 1, 4 or 16 (0: 16) */
    uint32_t frames_in_flight; /* 1 to 8 (0: 2) */
    uint32_t motion_images;    /* of methods paper (1 to 6, 0: 2) and fast (2, 4 or 6, 0: 4) */
    uint32_t max_blur_samples; /* of paper, fast and frames from outside: 1 to 4096 (0: 240) */
    uint32_t max_side_px;      /* larger cameras are refused (0, and all above: 16384) */
    double time_limit_s;       /* longest wait for the device (0: 600) */
    uint64_t seed;             /* of all noise: same seed and frame_index, same picture */
    const char *device;        /* index, UUID or part of the name; null: the first usable, software devices last */
    shutterbug_log_fn log;     /* may be null */
    void *log_user;            /* handed to log */
    char *error_text;          /* where a failed create puts its sentence; may be null */
    uint64_t error_capacity;   /* bytes of error_text */
    const shutterbug_host_device *host; /* your own Vulkan device instead of a new one; device and validation mean
                                         * nothing then */
    const void *get_instance_proc_addr; /* your Vulkan loader instead of the system's; may be null */
} shutterbug_engine_options;

/* Opens a device. The engine is yours: destroy it. Nothing of the options is kept but log, log_user and
 * get_instance_proc_addr, which must live as long as the engine, and what host stands for. Takes tens to hundreds of
 * milliseconds. Any thread; several at once make engines of their own. Errors: NO_DEVICE, UNSUPPORTED (the device lacks
 * something, or no validation layer), device. */
shutterbug_status shutterbug_engine_create(const shutterbug_engine_options *options, shutterbug_engine **engine);

/* Waits for what is in flight (20 s at most: see semaphores) and frees everything that the engine has. Frames that were
 * waited for stay readable, others answer with HANDLE. Errors: none but the common ones; after BUSY the engine is still
 * there. */
shutterbug_status shutterbug_engine_destroy(shutterbug_engine *engine);

enum {                        /* shutterbug_camera.scan_order: which line is read first */
    SHUTTERBUG_TOP_TO_BOTTOM = 0,
    SHUTTERBUG_BOTTOM_TO_TOP = 1,
    SHUTTERBUG_LEFT_TO_RIGHT = 2, /* lines are columns */
    SHUTTERBUG_RIGHT_TO_LEFT = 3
};
enum { SHUTTERBUG_CAMERA_STATIC = 1 }; /* shutterbug_camera.flags: the camera rests during each frame */

typedef struct shutterbug_camera {
    uint32_t struct_size;
    uint32_t width, height; /* px */
    uint32_t scan_order;
    double fx_px, fy_px, cx_px, cy_px; /* a camera point falls on (fx x/z + cx, fy y/z + cy) */
    double frame_period_s;             /* from one frame to the next */
    double readout_time_s;             /* number of lines times the delay from line to line; 0: global shutter */
    double exposure_time_s;            /* of each line; 0: an instant */
    uint32_t flags;
    uint32_t reserved; /* 0 */
} shutterbug_camera;

/* Sets the camera of the frames that are submitted from now on: pinhole and shutter, no other effect. A new size or
 * pinhole frees what frames need and makes it anew with the next one. Nothing of the struct is kept. Errors: INPUT
 * (names the field and its range), STATE (frames are in flight, and size or pinhole change), LIMIT. */
shutterbug_status shutterbug_engine_set_camera(shutterbug_engine *engine, const shutterbug_camera *camera);
/* The same from the text of a camera.toml, with all effects; or from JSON with the same keys (first character '{').
 * Effects of lens and mounting (lens_distortion, chromatic_aberration, focal_length_error, pose_offset) act where a
 * pixel looks: with one of them, frames from outside need depth and pose_count poses, and are UNSUPPORTED without.
 * auto_exposure counts an engine's frames in the order of their submission, whatever their time and index: each answers
 * to the one submitted delay_frames before it, which must have been waited for (else STATE; so at most delay_frames may
 * be in flight). It begins anew, with initial_gain, where a camera has other values of auto_exposure than the one
 * before, where a capture, scene or trajectory is loaded or set, and by shutterbug_engine_reset_exposure. The text is
 * UTF-8; nothing of it is kept. Errors: INPUT (names line, key and range), STATE and LIMIT as above. */
shutterbug_status shutterbug_engine_set_camera_text(shutterbug_engine *engine, const char *text);

/* Automatic exposure begins anew with the next frame: after a jump in time, or a frame that failed. No other effect.
 * Errors: none but the common ones. */
shutterbug_status shutterbug_engine_reset_exposure(shutterbug_engine *engine);

/* Loads a capture: a folder with camera.toml, scene.obj, trajectory.tum, frames.csv. Its camera is set. Times are on
 * the files' own clock (its zero: epoch_ns of shutterbug_engine_info); shutterbug_engine_get_frame_times tells those of
 * the frames. The folder (UTF-8) is read before the call returns and not again. Errors: STATE (frames are in flight),
 * INPUT, IO, TIME (the trajectory does not cover the capture's frames), LIMIT. On failure the engine has what it
 * had. */
shutterbug_status shutterbug_engine_load_capture(shutterbug_engine *engine, const char *folder);
/* Loads an OBJ file with its materials and textures, unlit, world coordinates in metres. Frames of it need a camera and
 * a trajectory too, set before or after. Errors: STATE (frames are in flight), INPUT, IO, LIMIT. */
shutterbug_status shutterbug_engine_load_scene(shutterbug_engine *engine, const char *obj_file);

typedef struct shutterbug_pose {
    double translation_m[3];
    double rotation_xyzw[4]; /* unit quaternion within 1e-3 */
} shutterbug_pose;
typedef struct shutterbug_stamped_pose {
    double time_s;
    shutterbug_pose world_from_camera;
} shutterbug_stamped_pose;

/* Sets the camera's poses over time; times increase. Between two: linear position, rotation on the shorter arc; beyond
 * the first and last there is none. The poses are copied. Errors: STATE (frames are in flight), INPUT (times). */
shutterbug_status shutterbug_engine_set_trajectory(shutterbug_engine *engine, const shutterbug_stamped_pose *poses,
                                                   size_t count);

enum {                                 /* shutterbug_engine_info.capabilities */
    SHUTTERBUG_CAN_IMPORT_HOST = 1,    /* shutterbug_memory_import_host */
    SHUTTERBUG_CAN_SHARE_MEMORY = 2,   /* shutterbug_memory_import_fd, _export_fd, _import_image_fd, _export_image_fd */
    SHUTTERBUG_CAN_SHARE_SEMAPHORE = 4, /* shutterbug_semaphore_import_fd, _export_fd of SHUTTERBUG_BINARY */
    SHUTTERBUG_CAN_SHARE_TIMELINE = 8  /* the same of SHUTTERBUG_TIMELINE */
};

typedef struct shutterbug_engine_info {
    uint32_t struct_size;
    uint32_t capabilities;
    uint32_t device_kind; /* 0 other, 1 discrete GPU, 2 integrated GPU, 3 virtual GPU, 4 software (its times are CPU
                           * times) */
    uint32_t frames_in_flight;
    uint32_t width, height;       /* of the camera; 0 before one is set */
    uint32_t capture_frames;      /* frames of the loaded capture */
    uint32_t validation_messages; /* so far; anything but 0 is a bug of the library (or of your device) */
    int64_t epoch_ns;             /* zero of the capture's clock */
    uint64_t host_alignment_bytes; /* of shutterbug_memory_import_host; 0: not possible */
    char device_name[256];
    char driver[256];
    uint8_t device_uuid[16];
} shutterbug_engine_info;

/* What the engine is and has; the texts are NUL-terminated UTF-8, cut where they do not fit. Errors: none but the
 * common ones. */
shutterbug_status shutterbug_engine_get_info(shutterbug_engine *engine, shutterbug_engine_info *info);
/* Starts of the loaded capture's frames, s; room for capture_frames numbers. Errors: TOO_SMALL. */
shutterbug_status shutterbug_engine_get_frame_times(shutterbug_engine *engine, double *times_s, size_t capacity);

/* ---- Pictures ---------------------------------------------------------------------------------------------------- */

enum {                         /* shutterbug_image.format. Values of several bytes are little-endian and aligned. */
    SHUTTERBUG_RGB8 = 1,       /* 3 bytes a pixel, sRGB unless said otherwise */
    SHUTTERBUG_RGBA8 = 2,
    SHUTTERBUG_BGRA8 = 3,
    SHUTTERBUG_RGBA16F = 4,    /* linear radiance, 1 = white */
    SHUTTERBUG_RGBA32F = 5,
    SHUTTERBUG_R32F = 6,       /* depth */
    SHUTTERBUG_RG16F = 7,      /* motion: x, y */
    SHUTTERBUG_RG32F = 8,
    SHUTTERBUG_R32U = 9,       /* ids */
    SHUTTERBUG_R16U = 10,
    SHUTTERBUG_R8U = 11,
    SHUTTERBUG_NV12 = 12,      /* only of SHUTTERBUG_PICTURE read back: luma, below it interleaved chroma (blue, red) of
                                * 2x2 pixels; BT.601, full range, as in JPEG. Even sides; capacity_bytes for height 3/2
                                * rows */
    SHUTTERBUG_RGB16 = 13,     /* only of SHUTTERBUG_PICTURE read back: 16 bits a value, sRGB, 65535 = white */
    SHUTTERBUG_RGBA16 = 14,    /* the same with an alpha of 65535 */
    /* Only of SHUTTERBUG_RAW. BAYERn: a number of n bits in the low bits of each 16-bit word, the high ones 0.
     * MIPI_RAWn: rows of MIPI CSI-2, without padding of their own (V4L2's pRAA, pRCC, pREE and so on), pixels from the
     * left:
     *   RAW10  4 pixels in 5 bytes: bits 9..2 of each, then bits 1..0 of each, the first pixel's lowest
     *   RAW12  2 pixels in 3 bytes: bits 11..4 of each, then bits 3..0 of each, the first pixel's lowest
     *   RAW14  4 pixels in 7 bytes: bits 13..6 of each, then bits 5..0 of each as one little-endian number of 24 bits,
     *          the first pixel's lowest
     * The width is a multiple of those pixels; stride_bytes is at least a row's bytes, of BAYERn a multiple of 2. */
    SHUTTERBUG_BAYER10 = 15,
    SHUTTERBUG_BAYER12 = 16,
    SHUTTERBUG_BAYER14 = 17,
    SHUTTERBUG_BAYER16 = 18,
    SHUTTERBUG_MIPI_RAW10 = 19,
    SHUTTERBUG_MIPI_RAW12 = 20,
    SHUTTERBUG_MIPI_RAW14 = 21,
    SHUTTERBUG_BOTTOM_UP = 0x10000 /* added to one of the above but NV12 and raw: the last row comes first in memory */
};

/* A picture in memory of yours, top row first unless SHUTTERBUG_BOTTOM_UP is added to its format. Row y starts at
 * pixels + y stride_bytes; bytes between rows are neither read nor written. */
typedef struct shutterbug_image {
    uint32_t struct_size;
    uint32_t format;
    uint32_t width, height;   /* px, margin included */
    uint64_t stride_bytes;    /* at least width times the pixel's bytes */
    uint64_t capacity_bytes;  /* bytes at pixels: at least stride_bytes (height - 1) + one row without padding */
    void *pixels;             /* only read where the image is an input */
    shutterbug_memory *memory; /* instead of pixels: shared memory (inputs only; stride and offset multiples of 4), or a
                                * GPU image (then stride_bytes and capacity_bytes mean nothing, format may be 0) */
    uint64_t memory_offset;   /* where row 0 starts in shared memory, bytes; 0 with a GPU image */
} shutterbug_image;

/* ---- Frames of a scene ------------------------------------------------------------------------------------------- */

enum {                               /* shutterbug_request.flags */
    SHUTTERBUG_REQUEST_PLANES = 1,   /* sharp planes too */
    SHUTTERBUG_REQUEST_RADIANCE = 2, /* SHUTTERBUG_RADIANCE too */
    SHUTTERBUG_REQUEST_FINE = 4,     /* SHUTTERBUG_PICTURE in 16 bits and floats too; not with jpeg, which has 8 bits */
    SHUTTERBUG_REQUEST_RAW = 8       /* SHUTTERBUG_RAW too; with bayer_mosaic in the camera's text */
};

typedef struct shutterbug_request {
    uint32_t struct_size;
    uint32_t frame_index; /* noise that changes from frame to frame is drawn for it */
    double time_s;        /* START of exposure of the first line read */
    uint32_t flags;
    uint32_t reserved; /* 0 */
    shutterbug_semaphore *wait;   /* the device waits for it before it writes picture_memory; may be null */
    shutterbug_semaphore *signal; /* signalled when the frame is done; may be null */
    uint64_t wait_value, signal_value; /* of timeline semaphores */
    shutterbug_memory *picture_memory; /* as in shutterbug_outside; may be null */
} shutterbug_request;

/* Hands a frame of the loaded scene to the device and returns without waiting for it (long accumulations wait for all
 * but their last part; the first frame of a kind makes what it needs, which takes longer). Depends on nothing but the
 * request, unless the camera has auto_exposure: frames may be asked for and waited for in any order. The last bit may
 * be another after a frame that needed a wider margin or had a longer readout: images and triangles made for it stay in
 * use. The same calls give the same bits. The frame is yours: destroy it. Errors: FULL (frames_in_flight frames have
 * not been waited for: wait for any of them), STATE (no camera, scene or trajectory; auto_exposure), TIME, INPUT
 * (effects that the method cannot do, RAW without bayer_mosaic), UNSUPPORTED (jpeg with picture_memory or FINE),
 * TOO_SMALL and FORMAT (picture_memory), LIMIT, device. After any of them nothing is in flight that was not before. */
shutterbug_status shutterbug_engine_submit(shutterbug_engine *engine, const shutterbug_request *request,
                                           shutterbug_frame **frame);

/* ---- Frames from outside ----------------------------------------------------------------------------------------- */

enum { SHUTTERBUG_PREVIOUS_TO_CURRENT = 0, SHUTTERBUG_CURRENT_TO_PREVIOUS = 1 }; /* .direction */
enum { SHUTTERBUG_PIXELS = 0, SHUTTERBUG_NDC = 1, SHUTTERBUG_UV = 2 };           /* .unit; NDC spans 2 a side, UV 1 */
enum { SHUTTERBUG_Y_DOWN = 0, SHUTTERBUG_Y_UP = 1 };                             /* .y_axis */

/* How motion vectors are meant. They become px per frame period, from where content was to where it is (for content
 * that moves on alike, "current to next" is the same). NDC and UV refer to the motion image with its margin. */
typedef struct shutterbug_motion_convention {
    uint32_t struct_size;
    uint32_t direction;
    uint32_t unit;
    uint32_t y_axis;
    double scale_x, scale_y; /* multiply the values first: a host's own MotionVectorScale. Not 0. */
    double interval_s;       /* time that a vector spans; 0: the camera's frame_period_s */
} shutterbug_motion_convention;

enum {                          /* presets of shutterbug_motion_preset */
    SHUTTERBUG_MOTION_OWN = 0,  /* this library's own: pixels, previous to current, y down */
    SHUTTERBUG_MOTION_FSR2 = 1, /* current to previous, pixels, y down */
    SHUTTERBUG_MOTION_FSR2_UV = 2, /* the same in UV */
    SHUTTERBUG_MOTION_UNITY = 3,   /* previous to current, NDC, y up */
    SHUTTERBUG_MOTION_STREAMLINE = 4, /* current to previous, NDC, y up */
    SHUTTERBUG_MOTION_OPTICAL_FLOW = 5 /* current to next, pixels, y down (OpenCV; EXR forward.u, forward.v;
                                        * SHUTTERBUG_MOTION). Taken as OWN: the same where content moves on alike */
};

/* Fills in a convention (struct_size set by you). Change what your host does differently. Needs no engine; any thread,
 * at any time. error_text takes the sentence of a failure, NUL-terminated and cut to error_capacity bytes; it may be
 * null. Errors: none but the common ones (ARGUMENT: no such preset). */
shutterbug_status shutterbug_motion_preset(uint32_t preset, shutterbug_motion_convention *convention, char *error_text,
                                           uint64_t error_capacity);
/* Converts a motion image to this library's own convention, px a frame_interval_s (s), on the CPU; from and to may be
 * the same memory only if they are the same image. Both in host memory, of one size. Needs no engine; any thread, at
 * any time. error_text and error_capacity as above. Errors: FORMAT, TOO_SMALL, LIMIT (a stride of 4 GiB). */
shutterbug_status shutterbug_motion_convert(const shutterbug_image *from,
                                            const shutterbug_motion_convention *convention,
                                            double frame_interval_s, const shutterbug_image *to, char *error_text,
                                            uint64_t error_capacity);

enum {                             /* shutterbug_depth_convention.kind */
    SHUTTERBUG_DEPTH_METRES = 0,   /* along the optical axis; infinite, NaN or <= 0: infinitely far */
    SHUTTERBUG_DEPTH_REVERSED = 1, /* near_m / depth: 1 at near_m, 0 at infinity */
    SHUTTERBUG_DEPTH_BUFFER = 2,   /* 0 at near_m, 1 at far_m (the usual perspective depth buffer) */
    SHUTTERBUG_DEPTH_REVERSED_FINITE = 3, /* 1 at near_m, 0 at far_m */
    SHUTTERBUG_DEPTH_NDC = 4       /* -1 at near_m, 1 at far_m (OpenGL's normalised device coordinates) */
};
typedef struct shutterbug_depth_convention {
    uint32_t struct_size;
    uint32_t kind;
    double near_m, far_m;
} shutterbug_depth_convention;

enum { SHUTTERBUG_ENCODING_SRGB = 0, SHUTTERBUG_ENCODING_LINEAR = 1 }; /* of 8-bit colour */

enum {                                    /* shutterbug_outside.flags */
    SHUTTERBUG_OUTSIDE_REPEAT_BORDER = 1, /* with pose_count: a margin that is too small is accepted */
    SHUTTERBUG_OUTSIDE_RADIANCE = 2,      /* SHUTTERBUG_RADIANCE can be read of the frame */
    SHUTTERBUG_OUTSIDE_FINE = 4,          /* as SHUTTERBUG_REQUEST_FINE */
    SHUTTERBUG_OUTSIDE_RAW = 8            /* as SHUTTERBUG_REQUEST_RAW */
};

/* How poses are meant. Zero: this library's own. */
typedef struct shutterbug_pose_convention {
    uint32_t struct_size;
    uint32_t form;      /* SHUTTERBUG_POSE_*: what the values are */
    uint32_t axes;      /* SHUTTERBUG_AXES_* of the camera */
    uint32_t direction; /* SHUTTERBUG_WORLD_FROM_CAMERA or _CAMERA_FROM_WORLD */
    double metres;      /* one unit of the translation; 0: 1 */
} shutterbug_pose_convention;
enum {                                /* .form */
    SHUTTERBUG_POSE_XYZW = 0,         /* translation x y z, quaternion x y z w: 7 values */
    SHUTTERBUG_POSE_WXYZ = 1,         /* translation x y z, quaternion w x y z: 7 values */
    SHUTTERBUG_POSE_MATRIX_ROWS = 2,  /* 4x4, row by row (NumPy): 16 values */
    SHUTTERBUG_POSE_MATRIX_COLUMNS = 3 /* 4x4, column by column (OpenGL): 16 values */
};
enum {
    SHUTTERBUG_AXES_OPTICAL = 0, /* x right, y down, z forward */
    SHUTTERBUG_AXES_OPENGL = 1,  /* x right, y up, z backward: OpenGL, MuJoCo, Blender, USD */
    SHUTTERBUG_AXES_ROBOT = 2    /* x forward, y left, z up: ROS body frames */
};
enum { SHUTTERBUG_WORLD_FROM_CAMERA = 0, SHUTTERBUG_CAMERA_FROM_WORLD = 1 };

/* Brings a pose into this library's own convention; values has 7 or 16 numbers. Needs no engine; any thread, at any
 * time. error_text and error_capacity as of shutterbug_motion_preset. Errors: none but the common ones (ARGUMENT:
 * values that are no pose, such as a matrix that scales or lies the other way round). */
shutterbug_status shutterbug_pose_convert(const shutterbug_pose_convention *convention, const double *values,
                                          shutterbug_pose *pose, char *error_text, uint64_t error_capacity);

/* One of two frames that are compared. */
typedef struct shutterbug_view {
    uint32_t struct_size;
    uint32_t reserved; /* 0 */
    const shutterbug_image *color; /* the camera's size, no margin, in host memory */
    const shutterbug_image *depth; /* R32F, as color */
    const shutterbug_depth_convention *depth_convention;
    shutterbug_pose world_from_camera; /* as you would hand it in */
    uint32_t encoding; /* SHUTTERBUG_ENCODING_* of 8-bit colour */
    uint32_t reserved_more; /* 0 */
} shutterbug_view;

enum { /* shutterbug_agreement.verdict */
    SHUTTERBUG_AGREE = 0,        /* the frames agree as they are given */
    SHUTTERBUG_AGREE_BETTER = 1, /* they agree much better with .change */
    SHUTTERBUG_AGREE_UNKNOWN = 2, /* the camera hardly moves between them: nothing can be told */
    SHUTTERBUG_AGREE_NEVER = 3   /* in none of the conventions that were tried */
};
enum { /* bits of shutterbug_agreement.change */
    SHUTTERBUG_CHANGE_Y_UP = 1,        /* the poses are of a camera with y up and z backward */
    SHUTTERBUG_CHANGE_INVERSE = 2,     /* they are camera from world */
    SHUTTERBUG_CHANGE_W_FIRST = 4,     /* their quaternions have w first */
    SHUTTERBUG_CHANGE_MILLIMETRES = 8, /* depth is in millimetres of the poses' metres */
    SHUTTERBUG_CHANGE_ALONG_RAY = 16,  /* depth is along the ray */
    SHUTTERBUG_CHANGE_BOTTOM_UP = 32,  /* rows lie from bottom to top */
    SHUTTERBUG_CHANGE_ENCODING = 64    /* colours are linear where they are said to be sRGB, or the reverse (floats are
                                        * said to be linear): told by pixels that edges cross, so of smooth edges only.
                                        * as_given and best do not show it */
};
typedef struct shutterbug_agreement {
    uint32_t struct_size;
    uint32_t verdict;
    uint32_t change;   /* with SHUTTERBUG_AGREE_BETTER */
    uint32_t reserved; /* 0 */
    double as_given;   /* mean difference of what both frames show (square root of radiance) at three quarters of the
                        * places, 0 to 0.25 */
    double best;       /* the same in the best convention */
} shutterbug_agreement;

/* Says whether two frames of a scene at rest agree with what is said of their poses and depth, or would in another
 * convention: each pixel of the second is looked for in the first. Wrong conventions give plausible pictures. The
 * camera should move and turn by a few degrees about more than one axis between them. text (text_capacity bytes, may be
 * null) takes a sentence, on failure that of the error. Takes milliseconds; needs no engine; any thread, at any time.
 * Errors: INPUT (camera), FORMAT, TOO_SMALL. */
shutterbug_status shutterbug_check_conventions(const shutterbug_camera *camera, const shutterbug_view *first,
                                               const shutterbug_view *second, shutterbug_agreement *agreement,
                                               char *text, uint64_t text_capacity);

/* What moves by itself in a frame from outside, as a rigid body. Its poses reach over the frame as the camera's do;
 * what has an id that no body has rests in the world. */
typedef struct shutterbug_body {
    uint32_t id;         /* of shutterbug_outside.ids; each body another */
    uint32_t pose_count; /* 2 or more */
    const shutterbug_stamped_pose *poses; /* for a body, world_from_camera holds world_from_body; any frame of the body
                                           * will do */
} shutterbug_body;

/* A further picture of a frame from outside, of an instant of its own. Everything but the instant is as of the first
 * one. */
typedef struct shutterbug_picture {
    double time_s;                /* when it was rendered; each picture at another time */
    const shutterbug_image *color;
    const shutterbug_image *depth;
    const shutterbug_image *ids;  /* with body_count */
} shutterbug_picture;

/* One frame of your own renderer: colour, and one of three things that say how it moves. All pictures have the camera's
 * size plus the margin on every side. Render them with the nominal pinhole, from the nominal pose.
 *
 *   depth, poses (pose_count 2 or more)
 *       For what rests; with ids and bodies also for what moves rigidly. The poses cover all of the frame and
 *       color_time_s, else TIME: give those of your physics steps, at any times. Between poses lies a curve through
 *       four of them; two make a straight line. Every line is taken from where the camera was then. Depth keeps
 *       silhouettes apart. Lens, shutter and blur read the colour once. A margin that is too small for turns (and, with
 *       nearest_m, for movement) is TOO_SMALL, and the error says how much is needed, unless
 *       SHUTTERBUG_OUTSIDE_REPEAT_BORDER is set. With further pictures, of other instants, each line is taken from the
 *       three that are nearest to it in time, read together where they show one surface; what one did not see is taken
 *       from the others.
 *   motion images (motion_count 1 to 6)
 *       For any motion: one vector a pixel, at the place where content arrives. It says how content moves at the
 *       image's instant. What a line sees has come this way since color_time_s: the integral of the vectors over time,
 *       linear between images, constant before the first and after the last. Two images of a camera that shakes faster
 *       than they follow each other can be worse than one.
 *   depth, two poses (pose_count 0)
 *       Motion goes from one pose to the other and continues evenly, also beyond them.
 *
 * With the last two, what enters from beyond the picture is its repeated border. */
typedef struct shutterbug_outside {
    uint32_t struct_size;
    uint32_t frame_index;
    double time_s;              /* START of exposure of the first line read */
    double color_time_s;        /* when colour (and depth) were rendered; the frame's middle halves the errors */
    double first_motion_time_s; /* time of the first motion image */
    double motion_step_s;       /* from one motion image to the next; unused with one */
    uint32_t flags;             /* SHUTTERBUG_OUTSIDE_* */
    uint32_t encoding;          /* SHUTTERBUG_ENCODING_*, of 8-bit colour; floats are linear */
    uint32_t margin_x_px, margin_y_px; /* columns and rows beyond each side, at most the camera's own */
    uint32_t motion_count;      /* 1 to 6; 0: depth is given */
    uint32_t reserved;          /* 0 */
    const shutterbug_image *color;   /* any colour format */
    const shutterbug_image *motions; /* motion_count images, RG16F or RG32F */
    const shutterbug_motion_convention *motion_convention; /* with motions */
    const shutterbug_image *depth;   /* R32F */
    const shutterbug_depth_convention *depth_convention; /* with depth */
    const shutterbug_stamped_pose *poses; /* with depth: pose_count of them, at increasing times; 0: two, which enclose
                                           * color_time_s */
    shutterbug_semaphore *wait;      /* the device waits for it before it reads; may be null */
    shutterbug_semaphore *signal;    /* signalled when the frame is done; may be null */
    uint64_t wait_value, signal_value; /* of timeline semaphores; unused with binary ones */
    shutterbug_memory *picture_memory; /* the picture is copied there too: RGBA8 without padding, or a GPU image of the
                                        * camera's size, VK_FORMAT_R8G8B8A8_UNORM or _SRGB; may be null. UNSUPPORTED
                                        * with a camera that has jpeg, which is not made on the device */
    uint32_t pose_count;                /* poses at poses, 2 or more; 0: two, as above */
    uint32_t body_count;                /* bodies at bodies, at most 255; 0: all that is seen rests */
    double nearest_m;                   /* with pose_count: nothing that comes in at the border is nearer; 0: not
                                         * known */
    const shutterbug_image *ids;        /* with body_count: whose surface each pixel shows, R8U, R16U or R32U */
    const shutterbug_body *bodies;
    uint32_t picture_count;             /* further pictures at pictures, with pose_count; at most 7 */
    uint32_t reserved_more;             /* 0 */
    const shutterbug_picture *pictures;
} shutterbug_outside;

/* How a camera moves at most. */
typedef struct shutterbug_motion_bound {
    uint32_t struct_size;
    uint32_t reserved;      /* 0 */
    double turn_rate_rad_s; /* about any axis */
    double speed_m_s;       /* in any direction; with nearest_m */
    double nearest_m;       /* nothing that comes in at the border is nearer; 0: only turns are reckoned with */
    double color_delay_s;   /* color_time_s - time_s of the frames to come */
} shutterbug_motion_bound;

/* The margin that frames of such motion need for the camera that is set, its lens, mounting and clock included: what
 * your renderer has to show beyond each side. Such frames are never TOO_SMALL then. Errors: ARGUMENT, STATE (no
 * camera), INPUT (the lens folds), UNSUPPORTED (options.method makes no frames from outside with pose_count poses). */
shutterbug_status shutterbug_engine_margin(shutterbug_engine *engine, const shutterbug_motion_bound *bound,
                                           uint32_t *margin_x_px, uint32_t *margin_y_px);

/* Hands a frame of yours to the device and returns without waiting. Pixels in host memory are copied before it returns;
 * shared memory must not be changed until the frame has been waited for. Same input and seed, same picture. Needs a
 * camera, and no scene. The frame is yours: destroy it. Errors: FULL and STATE as for shutterbug_engine_submit, TIME
 * (the poses do not cover the frame or color_time_s), INPUT (effects that need a scene's depth; poses' times; RAW
 * without bayer_mosaic), UNSUPPORTED (effects of lens and mounting without pose_count poses, jpeg with picture_memory
 * or FINE, frames that options.method does not make), TOO_SMALL, FORMAT, LIMIT, device. After any of them nothing is in
 * flight that was not before. */
shutterbug_status shutterbug_engine_submit_outside(shutterbug_engine *engine, const shutterbug_outside *outside,
                                                   shutterbug_frame **frame);

/* ---- Delivered frames -------------------------------------------------------------------------------------------- */

/* Whether shutterbug_frame_wait would return at once: 1 or 0. Errors: device, as of shutterbug_frame_wait. */
shutterbug_status shutterbug_frame_poll(shutterbug_frame *frame, uint32_t *ready);
/* Waits for a frame, at most limit_s seconds (negative: as long as the engine's time_limit_s), and takes it from the
 * device: its place in flight is free again. Waiting once more is fine. Errors: device (after TIMEOUT it can be waited
 * for again, after the others never: each later call says the same), HANDLE (the engine is gone). */
shutterbug_status shutterbug_frame_wait(shutterbug_frame *frame, double limit_s);

enum {                        /* plane of shutterbug_frame_read */
    SHUTTERBUG_PICTURE = 1,   /* what the camera delivers: RGB8, RGBA8, BGRA8, NV12, sRGB; alpha 255. With _FINE also
                               * not rounded to 8 bits: RGB16, RGBA16 (sRGB), and RGBA32F, RGBA16F (the linear light of
                               * the same, 1 = white) */
    SHUTTERBUG_COLOR = 2,     /* ideal camera at time_s, linear, alpha = coverage: RGBA32F, RGBA16F */
    SHUTTERBUG_MOTION = 3,    /* px, y down, from this frame (time_s) to the next (time_s + frame_period_s), stored
                               * where content is at time_s: RG32F, RG16F */
    SHUTTERBUG_DEPTH = 4,     /* m along the optical axis, infinite where nothing is: R32F */
    SHUTTERBUG_RADIANCE = 5,  /* linear, 1 = white: what reaches the sensor, with lens, shutter and blur, before
                               * defocus, glare, noise and encoding; alpha 1: RGBA32F, RGBA16F */
    SHUTTERBUG_RAW = 6        /* what the converter delivers, one colour a pixel: BAYER10 to 16, MIPI_RAW10 to 14. Which
                               * colour says bayer_mosaic.pattern of the camera's text, by the upper left 2x2 pixels.
                               * All that the sensor does is in it (exposure_gain to quantization in the light's path),
                               * nothing that is done to its numbers (white balance, colour matrix, gamma and so on).
                               * Linear; the largest number is full scale, no light is black_level.offset of it.
                               * quantization.bits should be the format's: with fewer, numbers are spread over the
                               * format's range; 0 rounds once, to the format */
};

/* Copies a plane of a frame that was waited for into host memory. Planes 2 to 4 need SHUTTERBUG_REQUEST_PLANES, of
 * which frames from outside have none; 5 needs SHUTTERBUG_REQUEST_RADIANCE or SHUTTERBUG_OUTSIDE_RADIANCE, 6 and
 * formats of more than 8 bits need _RAW and _FINE in the same way. Can be repeated, in other formats too. The image has
 * the camera's size. Errors: NOT_READY, STATE (no such plane was asked for), FORMAT, TOO_SMALL; of a frame that failed,
 * its failure. */
shutterbug_status shutterbug_frame_read(shutterbug_frame *frame, uint32_t plane, const shutterbug_image *to);

typedef struct shutterbug_instant {
    double time_s;
    shutterbug_pose world_from_camera; /* identity without pose */
    uint32_t has_pose;                 /* 0 where no pose is known: frames from outside with motion, or beyond the two
                                        * poses */
    uint32_t reserved;
} shutterbug_instant;

typedef struct shutterbug_frame_info {
    uint32_t struct_size;
    uint32_t frame_index;
    uint32_t width, height;
    shutterbug_instant first_line_start; /* start of exposure of the first line read (time_s, with the camera's
                                          * time_offset) */
    shutterbug_instant middle;           /* half way between the two others */
    shutterbug_instant last_line_end;    /* end of exposure of the last line read */
    double host_ms;                      /* from submission to the end of the wait by the host's clock */
    double exposure_gain;                /* factor on the radiance: exposure_gain of the camera times auto_exposure */
} shutterbug_frame_info;

/* When a frame that was waited for was taken, and the camera's pose then. Errors: NOT_READY; of a frame that failed,
 * its failure. */
shutterbug_status shutterbug_frame_get_info(shutterbug_frame *frame, shutterbug_frame_info *info);

typedef struct shutterbug_pass_time {
    char name[32];
    double ms; /* on the device */
} shutterbug_pass_time;

/* Times of the passes of a frame that was waited for, in their order; none on devices without timestamps. times has
 * room for capacity of them, or is null: then only the count is written. Errors: NOT_READY, TOO_SMALL; of a frame that
 * failed, its failure. */
shutterbug_status shutterbug_frame_get_times(shutterbug_frame *frame, shutterbug_pass_time *times, size_t capacity,
                                             size_t *count);

/* Frees a frame. One that is in flight is waited for first, at most time_limit_s; whatever comes of that, it is freed
 * (its place in flight once the device is done). Errors: none but the common ones; after BUSY the frame is still
 * there. */
shutterbug_status shutterbug_frame_destroy(shutterbug_frame *frame);

/* ---- Zero copy --------------------------------------------------------------------------------------------------- */
/* What a device cannot do gives UNSUPPORTED; see capabilities. Shared memory and semaphores work with the engine they
 * were made with (any other: ARGUMENT), keep its device open, and are destroyed after the frames that use them were
 * waited for (earlier is safe: the frame keeps what it needs). Errors of all that make them: UNSUPPORTED, LIMIT (sizes,
 * alignment), device (a descriptor that the driver refuses is VULKAN); FORMAT of images. */

/* The device reads your memory where it is. pointer and bytes are multiples of host_alignment_bytes; the memory stays
 * yours, and allocated until the handle and all frames that use it are gone. Errors: see above. */
shutterbug_status shutterbug_memory_import_host(shutterbug_engine *engine, void *pointer, uint64_t bytes,
                                                shutterbug_memory **memory);
/* Memory that another user of the same device and driver exported as an opaque fd. On success the fd belongs to the
 * driver: do not close it. On failure it is still yours. Errors: see above. */
shutterbug_status shutterbug_memory_import_fd(shutterbug_engine *engine, int fd, uint64_t bytes,
                                              shutterbug_memory **memory);
/* New memory on the engine's device, and an opaque fd of it that is yours to close or to import elsewhere; the memory
 * lives as long as one of the two does. Errors: see above. */
shutterbug_status shutterbug_memory_export_fd(shutterbug_engine *engine, uint64_t bytes, shutterbug_memory **memory,
                                              int *fd);
/* Frees the handle; the memory goes with the last frame that uses it. Errors: none but the common ones. */
shutterbug_status shutterbug_memory_destroy(shutterbug_memory *memory);

/* GPU images as input (shutterbug_image.memory) and output (picture_memory) of frames. The device copies them where it
 * reads or writes them; nothing passes through host memory. 2D, one layer, one mip level, one sample; of these
 * VkFormats:
 *   color   R8G8B8A8, B8G8R8A8 (_UNORM, _SRGB: read as shutterbug_outside.encoding says), R16G16B16A16_SFLOAT,
 *           R32G32B32A32_SFLOAT
 *   motion  R16G16_SFLOAT, R32G32_SFLOAT
 *   depth   R32_SFLOAT, D32_SFLOAT, D32_SFLOAT_S8_UINT (its depth)
 *   output  R8G8B8A8_UNORM, R8G8B8A8_SRGB
 * Numbers are those of the Vulkan headers, which this header does not need. */
typedef struct shutterbug_gpu_image {
    uint32_t struct_size;
    uint32_t vk_format;       /* VkFormat */
    uint32_t width, height;   /* px */
    uint32_t vk_layout;       /* VkImageLayout in which each frame finds it; of outputs VK_IMAGE_LAYOUT_UNDEFINED is
                               * fine */
    uint32_t vk_layout_after; /* in which each frame leaves it; 0: the same */
    uint32_t vk_tiling;       /* VkImageTiling, of images by fd */
    uint32_t vk_usage;        /* VkImageUsageFlags, of images by fd: with TRANSFER_SRC for inputs, TRANSFER_DST for
                               * outputs */
    uint64_t vk_image;        /* VkImage, of shutterbug_memory_use_image; else 0 */
} shutterbug_gpu_image;

/* Your own image of the device that the engine was created on (shutterbug_engine_options.host; else UNSUPPORTED). It
 * was made with usage TRANSFER_SRC (inputs), TRANSFER_DST (outputs), belongs to the engine's queue family (or is shared
 * concurrently), and outlives the handle and all frames that use it. Never destroyed by this library. Errors: see
 * above. */
shutterbug_status shutterbug_memory_use_image(shutterbug_engine *engine, const shutterbug_gpu_image *image,
                                              shutterbug_memory **memory);
/* An image in memory that another user of the same device and driver exported as an opaque fd: format, size, tiling and
 * usage as it was made there, no flags, in a dedicated allocation of so many bytes. Release it to
 * VK_QUEUE_FAMILY_EXTERNAL before a frame and acquire it from there afterwards. The fd is treated as by
 * shutterbug_memory_import_fd. Errors: see above. */
shutterbug_status shutterbug_memory_import_image_fd(shutterbug_engine *engine, const shutterbug_gpu_image *image,
                                                    int fd, uint64_t bytes, shutterbug_memory **memory);
/* A new image on the engine's device, an opaque fd of its memory that is yours, and the memory's size: what the call
 * above, or another user of the same device and driver, needs to import it. Errors: see above. */
shutterbug_status shutterbug_memory_export_image_fd(shutterbug_engine *engine, const shutterbug_gpu_image *image,
                                                    shutterbug_memory **memory, int *fd, uint64_t *bytes);

/* Semaphores. A frame whose wait never comes is never done: its wait ends with TIMEOUT, and destroying its engine takes
 * 20 s and leaks what the frame uses. */
enum {                       /* kind of a semaphore */
    SHUTTERBUG_BINARY = 0,   /* each wait takes one signal, which was submitted before it */
    SHUTTERBUG_TIMELINE = 1  /* waits for wait_value or more; signal_value is greater than all values before it */
};
/* Your own VkSemaphore (as a number) of the device that the engine was created on; else UNSUPPORTED. It outlives the
 * handle and all frames that use it. Never destroyed by this library. Errors: see above. */
shutterbug_status shutterbug_semaphore_use(shutterbug_engine *engine, uint64_t vk_semaphore, uint32_t kind,
                                           shutterbug_semaphore **semaphore);
/* One that another user of the same device and driver exported as an opaque fd, of the same kind. On success the fd
 * belongs to the driver: do not close it. On failure it is still yours. Errors: see above. */
shutterbug_status shutterbug_semaphore_import_fd(shutterbug_engine *engine, int fd, uint32_t kind,
                                                 shutterbug_semaphore **semaphore);
/* A new one, and an opaque fd of it that is yours to close or to import elsewhere; timelines start at 0. Errors: see
 * above. */
shutterbug_status shutterbug_semaphore_export_fd(shutterbug_engine *engine, uint32_t kind,
                                                 shutterbug_semaphore **semaphore, int *fd);
/* Frees the handle; the semaphore (unless it is your own) goes with the last frame that uses it. Errors: none but the
 * common ones. */
shutterbug_status shutterbug_semaphore_destroy(shutterbug_semaphore *semaphore);

/* END OF PLAIN C */
#ifdef __cplusplus
}
#endif
#endif
