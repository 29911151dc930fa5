/* instances.c CYCLES: makes and destroys a VkInstance and a VkDevice so many times, and nothing of shutterbug: what it
 * loses is the Vulkan loader's and its driver's. The few declarations are those of vulkan_core.h, which need not be
 * installed. */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
    int32_t type;
    const void *next;
    const char *app;
    uint32_t app_version;
    const char *engine;
    uint32_t engine_version, api_version;
} application;

typedef struct {
    int32_t type;
    const void *next;
    uint32_t flags;
    const application *app;
    uint32_t layer_count;
    const char *const *layers;
    uint32_t extension_count;
    const char *const *extensions;
} instance_info;

typedef struct {
    int32_t type;
    const void *next;
    uint32_t flags, family, count;
    const float *priorities;
} queue_info;

typedef struct {
    int32_t type;
    const void *next;
    uint32_t flags, queue_count;
    const queue_info *queues;
    uint32_t layer_count;
    const char *const *layers;
    uint32_t extension_count;
    const char *const *extensions;
    const void *features;
} device_info;

static void *function(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (!found) exit(77);
    return found;
}

int main(int argc, char **argv) {
    void *vulkan = dlopen("libvulkan.so.1", RTLD_NOW);
    if (!vulkan) return 77;
    int32_t (*make)(const instance_info *, const void *, void **) = function(vulkan, "vkCreateInstance");
    int32_t (*list)(void *, uint32_t *, void **) = function(vulkan, "vkEnumeratePhysicalDevices");
    int32_t (*open)(void *, const device_info *, const void *, void **) = function(vulkan, "vkCreateDevice");
    void (*close)(void *, const void *) = function(vulkan, "vkDestroyDevice");
    void (*destroy)(void *, const void *) = function(vulkan, "vkDestroyInstance");
    application app = {.type = 0, .api_version = 1u << 22 | 2u << 12};
    instance_info info = {.type = 1, .app = &app};
    float priority = 1;
    queue_info queue = {.type = 2, .count = 1, .priorities = &priority};
    device_info of_device = {.type = 3, .queue_count = 1, .queues = &queue};
    for (long i = 0; i < (argc > 1 ? atol(argv[1]) : 3); ++i) {
        void *instance = NULL, *physical = NULL, *device = NULL;
        uint32_t count = 1;
        if (make(&info, NULL, &instance)) return 77;
        if (list(instance, &count, &physical) < 0 || count < 1) return 77;
        if (open(physical, &of_device, NULL, &device)) return 77;
        close(device, NULL);
        destroy(instance, NULL);
    }
    return 0;
}
