/* A frame of your own renderer, colour and motion, through the camera; writes it as PPM.
 *   cc process.c $(pkg-config --cflags --libs shutterbug) && ./a.out out.ppm */
#include <shutterbug.h>
#include <stdio.h>
#include <stdlib.h>

enum { W = 320, H = 240 };

static void must(shutterbug_status status, const void *handle) {
    char text[256];
    if (status == SHUTTERBUG_OK) return;
    shutterbug_last_error(handle, text, sizeof text);
    fprintf(stderr, "%s: %s\n", shutterbug_status_text(status), text);
    exit(1);
}

int main(int argc, char **argv) {
    static unsigned char color[H][W][3], picture[H][W][3];
    static float motion[H][W][2];
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x) { /* vertical bars that move 40 px a frame to the right */
            for (int c = 0; c < 3; ++c) color[y][x][c] = x / 20 % 2 ? 230 : 30;
            motion[y][x][0] = 40;
        }

    shutterbug_engine_options options = {.struct_size = sizeof options, .seed = 1};
    shutterbug_engine *engine = NULL;
    must(shutterbug_engine_create(&options, &engine), NULL);
    must(shutterbug_engine_set_camera_text(engine,
        "width = 320\nheight = 240\nfx = 250\nfy = 250\ncx = 160\ncy = 120\nframe_period_s = 0.04\n"
        "[rolling_shutter]\nreadout_time_s = 0.03\n[motion_blur]\nexposure_time_s = 0.01\n"
        "[paper_noise]\ncolor_variance_g = 0.0004\n"), engine);

    shutterbug_image color_image = {.struct_size = sizeof color_image, .format = SHUTTERBUG_RGB8, .width = W,
                                    .height = H, .stride_bytes = 3 * W, .capacity_bytes = sizeof color,
                                    .pixels = color};
    shutterbug_image motion_image = {.struct_size = sizeof motion_image, .format = SHUTTERBUG_RG32F, .width = W,
                                     .height = H, .stride_bytes = 8 * W, .capacity_bytes = sizeof motion,
                                     .pixels = motion};
    shutterbug_motion_convention convention = {.struct_size = sizeof convention};
    must(shutterbug_motion_preset(SHUTTERBUG_MOTION_OWN, &convention, NULL, 0), NULL);
    shutterbug_outside outside = {.struct_size = sizeof outside, .color_time_s = 0.02, .color = &color_image,
                                  .motion_count = 1, .motions = &motion_image, .motion_convention = &convention};
    shutterbug_frame *frame = NULL;
    must(shutterbug_engine_submit_outside(engine, &outside, &frame), engine);
    must(shutterbug_frame_wait(frame, -1), frame);
    color_image.pixels = picture;
    must(shutterbug_frame_read(frame, SHUTTERBUG_PICTURE, &color_image), frame);
    must(shutterbug_frame_destroy(frame), NULL);
    must(shutterbug_engine_destroy(engine), NULL);

    FILE *file = fopen(argc > 1 ? argv[1] : "out.ppm", "wb");
    if (!file) return perror("out.ppm"), 1;
    fprintf(file, "P6\n%d %d\n255\n", W, H);
    fwrite(picture, 1, sizeof picture, file);
    return fclose(file);
}
