// Reading the samples of one delivered pixel: `grid` texels of a supersampled image, each with as many samples as the
// image has. MULTISAMPLED chooses the kind of image.
// Where both counts are known when the kernel is made, a software device unrolls the loops over them; 0: not known.
layout(constant_id = 12) const int KNOWN_GRID = 0;
layout(constant_id = 13) const int KNOWN_SAMPLES = 0;

#ifdef MULTISAMPLED
#define SAMPLES_2D sampler2DMS
int sample_count(sampler2DMS image) { return KNOWN_SAMPLES != 0 ? KNOWN_SAMPLES : textureSamples(image); }
#else
#define SAMPLES_2D sampler2D
int sample_count(sampler2D image) { return 1; }
#endif

ivec2 grid_of(ivec2 pushed) {
    return KNOWN_GRID != 0 ? ivec2(KNOWN_GRID) : pushed;
}

vec4 sample_at(SAMPLES_2D image, ivec2 texel, int index) {
#ifdef MULTISAMPLED
    return texelFetch(image, texel, index);
#else
    return texelFetch(image, texel, 0);
#endif
}

// Mean over all samples of the pixel: a box of one px, linear radiance.
vec4 mean_of_pixel(SAMPLES_2D image, ivec2 pixel, ivec2 grid) {
    int count = sample_count(image);
    vec4 sum = vec4(0.0);
    for (int y = 0; y < grid.y; ++y) {
        for (int x = 0; x < grid.x; ++x) {
            for (int i = 0; i < count; ++i) {
                sum += sample_at(image, pixel * grid + ivec2(x, y), i);
            }
        }
    }
    return sum / float(count * grid.x * grid.y);
}
